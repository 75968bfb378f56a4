//! A run of the live threads on the simulated board, with every answer and every byte kept.

use std::path::PathBuf;
use std::sync::{Arc, Mutex, mpsc};
use std::time::Duration;

use tactomo::board::record::{Header, Recorder};
use tactomo::board::simulated::{Options, SimulatedBoard};
use tactomo::board::source::Opened;
use tactomo::run::options::{Ends, RunOptions, Solving, Summary};
use tactomo::run::{Listener, Snapshot, TouchEvent};
use tactomo::scene::{Hand, Scene, SceneName, Touch};
use tactomo::simulate::Simulation;
use tactomo::solve::{Method, Problem, Solution};
use tokio::sync::watch;

/// A cold search of five discs that do not explain a ring, beside the simulated board on two cores: 0.2 to 0.9 s were measured.
pub const SEARCH_S: f64 = 1.0;
/// Seed of scene, noise and faults.
const SEED: u64 = 1;

/// An answer, and the frame that it is of.
pub struct Answer {
    /// Number of the frame.
    pub sequence: u64,
    /// Time of the scene (s).
    pub time_s: f64,
    pub solution: Solution,
}

/// What a run has come to.
pub struct Live {
    pub answers: Vec<Answer>,
    pub summary: Summary,
    pub recording: PathBuf,
    scene: Scene,
    /// Time of the scene from which on answers count, and when it ends (s).
    counted_s: [f64; 2],
}

struct Keeper(Arc<Mutex<Vec<(u64, u64, Solution)>>>);

impl Listener for Keeper {
    fn touched(&mut self, event: &Arc<TouchEvent>) {
        self.0.lock().unwrap().push((event.frame.sequence, event.frame.board_time_us, event.solution.clone()));
    }
}

impl Live {
    /// Runs a solver on a scene; answers count from the first of two times on, and it ends at the second (s).
    pub fn run(problem: &Problem, method: Method, name: SceneName, counted_s: [f64; 2]) -> Self {
        let detector = problem.detector().clone();
        let scene = Scene::new(name, &detector, Hand::relative(&detector), SEED);
        let simulation = Simulation::new(&detector, scene.clone(), &[], SEED).unwrap();
        let board = SimulatedBoard::simulate(&detector, simulation, Options { seed: SEED, ..Options::default() });
        let recording =
            std::env::temp_dir().join(format!("tactomo-{}-{}-{name}.tactomo", std::process::id(), method.name()));
        let header = Header::of(&detector, "simulated board".to_owned(), 0);
        let kept = Arc::new(Mutex::new(Vec::new()));
        let options = RunOptions {
            solving: Some(Solving::new(method, problem.clone())),
            recorder: Some(Recorder::create(&recording, &header).unwrap()),
            listeners: vec![Box::new(Keeper(Arc::clone(&kept)))],
            seconds: Some(Duration::from_secs_f64(counted_s[1])),
            ..RunOptions::new(detector)
        };
        let (snapshots, _page) = watch::channel(Arc::new(Snapshot::default()));
        let (_requests, requests) = mpsc::sync_channel(1);
        let ends = Ends { snapshots, requests, stop: Arc::default() };
        let summary = tactomo::run::run(&mut Opened::new(Box::new(board.unwrap())), options, ends).unwrap();
        let kept = std::mem::take(&mut *kept.lock().unwrap());
        // Scene time begins with the first frame.
        let first_us = kept.first().map_or(0, |(sequence, time_us, _)| time_us - sequence * 832);
        let answer = |(sequence, time_us, solution): (u64, u64, Solution)| Answer {
            sequence,
            time_s: (time_us - first_us) as f64 * 1e-6,
            solution,
        };
        let answers = kept.into_iter().map(answer).filter(|answer| answer.time_s > counted_s[0]).collect();
        Self { answers, summary, recording, scene, counted_s }
    }

    /// Whether there was an answer as often as answers take, soon after the start and then without a gap, and none was old: 50 ms or what an
    /// answer takes, whichever is longer, and twice that on a busy machine. A scene that is no few contacts is searched for longer, in which
    /// there may be a gap of [`SEARCH_S`], and fewer answers.
    pub fn is_timely(&self) -> bool {
        let [from_s, to_s] = self.counted_s;
        let answer_s = 1e-6 * self.summary.latency_us.p99.max(833.0);
        let longest_s = 2.0 * answer_s.max(0.05);
        let times = self.answers.iter().map(|answer| answer.time_s);
        let first = times.clone().next().is_some_and(|first_s| first_s < from_s + SEARCH_S);
        let gaps = times.clone().zip(times.skip(1)).map(|(a, b)| b - a).fold(0.0, f64::max);
        let enough = self.answers.len() as f64 > 0.1 * (to_s - from_s) / answer_s;
        first && enough && gaps < SEARCH_S + answer_s && self.summary.age_us.p99 * 1e-6 < longest_s
    }

    /// What truly touched at each answer's time.
    pub fn truths(&self) -> Vec<Vec<Touch>> {
        self.answers.iter().map(|answer| self.scene.at(answer.time_s)).collect()
    }
}

impl Drop for Live {
    fn drop(&mut self) {
        // It may be gone already.
        let _ = std::fs::remove_file(&self.recording);
    }
}
