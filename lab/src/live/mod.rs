//! What live shows of a scene: the threads of `tactomo live` behind a simulated board, and every answer held against what truly touches.

mod score;

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, mpsc};
use std::thread;
use std::time::{Duration, Instant};

use anyhow::Context;
use tactomo::run::calibration::Learning;
use tactomo::run::options::{Ends, RunOptions, Solving};
use tactomo::run::scanning::ScanChoice;
use tactomo::run::{Listener, Snapshot, TouchEvent};
use tactomo_board::simulated::{BoardModel, Options, SimulatedBoard};
use tactomo_board::source::Opened;
use tactomo_physics::detector::Detector;
use tactomo_physics::scene::{Hand, Scene, SceneName};
use tactomo_physics::simulate::{Simulation, try_drawn};
use tactomo_touch::solve::{Method, Problem};

pub use self::score::{Answer, Scored, Scorer};

/// One run.
#[derive(Clone, Debug)]
pub struct Case {
    /// What touches, on its own detector unless it has none.
    pub scene: SceneName,
    /// Which board is simulated; `None` for the usual one of the detector.
    pub board: Option<BoardModel>,
    /// Which rows it scans.
    pub scan: ScanChoice,
    /// Seed of the detector as built; `None` of one that is as described.
    pub built: Option<u64>,
    /// Solver.
    pub method: Method,
    /// Seed of places and noise.
    pub seed: u64,
    /// How long.
    pub time: Duration,
    /// Threads that do nothing but keep cores busy.
    pub busy: usize,
    /// Whether the detector is learned from what presses.
    pub learns: bool,
}

/// What came of a run.
#[derive(Clone, Debug, serde::Serialize)]
pub struct Found {
    /// Scene, detector, board and scan.
    pub scene: String,
    pub detector: String,
    pub board: &'static str,
    pub scan: String,
    /// Answers against the truth.
    #[serde(flatten)]
    pub scored: Scored,
    /// Age of answers when they are ready: 99 % of them are younger (us).
    pub age_p99_us: f64,
    /// Presses that the detector was learned from, if that was in use at the end.
    pub learned_from: Option<usize>,
    /// When that was first used (s), since the first frame.
    pub learned_s: Option<f64>,
}

/// Keeps answers, and when they came.
struct Keeper(Arc<Mutex<Vec<Answer>>>);

impl Listener for Keeper {
    fn touched(&mut self, event: &Arc<TouchEvent>) {
        let (frame, solution) = (&event.frame, event.solution.clone());
        let answer = Answer { time_s: frame.time_s(), came: Instant::now(), solution };
        // A thread that panicked has ended the run anyway.
        if let Ok(mut all) = self.0.lock() {
            all.push(answer);
        }
    }
}

/// Runs one case.
pub fn run(case: &Case) -> anyhow::Result<Found> {
    let detector = case.scene.detector().and_then(Detector::preset).unwrap_or_default();
    let model = case.board.unwrap_or_else(|| BoardModel::usual(&detector));
    let detector = model.described(detector, case.built.is_some());
    let scene = Scene::new(case.scene, &detector, Hand::relative(&detector), case.seed);
    let truth = case.built.map_or_else(|| Ok(detector.clone()), |seed| try_drawn(&detector, seed))?;
    let simulation = Simulation::new(&truth, scene.clone(), &[], case.seed)?;
    let board = SimulatedBoard::simulate(&truth, simulation, Options { seed: case.seed, model })?;
    let (clock, kept) = (board.scene_clock(), Arc::new(Mutex::new(Vec::new())));
    let solving = Solving::new(case.method, Problem::of(&detector)?);
    let learning = Learning::of(&detector, None).filter(|_| case.learns);
    let options = RunOptions {
        scan: case.scan.clone(),
        solving: Some(Solving { learning, ..solving }),
        listeners: vec![Box::new(Keeper(Arc::clone(&kept)))],
        seconds: Some(case.time),
        ..RunOptions::new(detector.clone())
    };
    let (snapshots, shown) = tokio::sync::watch::channel(Arc::new(Snapshot::default()));
    let (_requests, requests) = mpsc::sync_channel(1);
    let (stop, ended) = (Arc::default(), AtomicBool::new(false));
    let (summary, learned) = thread::scope(|scope| {
        (0..case.busy).for_each(|_| drop(scope.spawn(|| keep_busy(&ended))));
        let watching = scope.spawn(|| first_learned(&shown, &ended));
        let ends = Ends { snapshots, requests, stop };
        let summary = tactomo::run::run(&mut Opened::new(Box::new(board)), options, ends);
        ended.store(true, Ordering::Relaxed);
        (summary, watching.join().ok().flatten())
    });
    let summary = summary?;
    let answers = std::mem::take(&mut *kept.lock().ok().context("a thread panicked")?);
    let began = answers.first().map(|answer| answer.came);
    Ok(Found {
        scene: case.scene.to_string(),
        detector: case.built.map_or_else(|| "as described".to_owned(), |seed| format!("as built {seed}")),
        board: model.name(),
        scan: case.scan.to_string(),
        scored: Scorer::new(&detector, scene).of(&answers, clock.began_s().unwrap_or_default()),
        age_p99_us: summary.age_us.p99,
        learned_from: summary.learned.as_ref().map(|learned| learned.presses),
        learned_s: learned.zip(began).map(|(learned, began)| learned.duration_since(began).as_secs_f64()),
    })
}

/// Keeps a core busy.
fn keep_busy(ended: &AtomicBool) {
    while !ended.load(Ordering::Relaxed) {
        std::hint::spin_loop();
    }
}

/// When something learned was first in use.
fn first_learned(shown: &tokio::sync::watch::Receiver<Arc<Snapshot>>, ended: &AtomicBool) -> Option<Instant> {
    while !ended.load(Ordering::Relaxed) {
        if shown.borrow().learned.is_some() {
            return Some(Instant::now());
        }
        thread::sleep(Duration::from_millis(20));
    }
    None
}
