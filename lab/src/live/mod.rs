//! What live shows of a scene: the threads of `tactomo live` behind a simulated board, and every answer held against what truly touches.

mod score;

use std::fmt;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, mpsc};
use std::thread;
use std::time::{Duration, Instant};

use anyhow::Context;
use tactomo::run::calibration::{Keeping, Learning};
use tactomo::run::options::{Ends, RunOptions, Solving, Summary};
use tactomo::run::scanning::ScanChoice;
use tactomo::run::{Listener, Snapshot, TouchEvent};
use tactomo_board::record::{Header, Recorder};
use tactomo_board::simulated::{BoardModel, Options, SimulatedBoard};
use tactomo_board::source::{Opened, Recording, Source};
use tactomo_physics::detector::Detector;
use tactomo_physics::scene::{Hand, Scene, SceneName};
use tactomo_physics::simulate::{Simulation, drawn_top_over_bottom};
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
    /// By how many standard deviations of its tolerance the top of a detector as built conducts better than its bottom; as drawn without it.
    pub top_over_bottom: Option<f64>,
    /// Solver.
    pub method: Method,
    /// Seed of places and noise.
    pub seed: u64,
    /// How long.
    pub time: Duration,
    /// Threads that do nothing but keep cores busy.
    pub busy: u8,
    /// Whether the detector is learned from what presses.
    pub learns: bool,
    /// Whether the same bytes are answered once more, as fast as they can be read.
    pub offline: bool,
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
    /// Share of the time with the right answer, where the same bytes are answered frame by frame, however long that takes.
    pub offline_right: Option<f64>,
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

impl Case {
    /// Checks what can be checked before anything runs.
    pub fn check(&self) -> anyhow::Result<()> {
        let electrodes = self.described().electrodes.len();
        self.scan
            .check(electrodes)
            .map_err(|what| anyhow::anyhow!("--scan {}, scene {}: {what}", self.scan, self.scene))
    }

    /// The detector that its scene was made for.
    fn described(&self) -> Detector {
        self.scene.detector().and_then(Detector::preset).unwrap_or_default()
    }

    /// Runs it. A thread of it that panics is an error like others: whatever ran before stays of use.
    pub fn run(&self) -> anyhow::Result<Found> {
        std::panic::catch_unwind(|| run(self)).unwrap_or_else(|_| anyhow::bail!("the solver panicked"))
    }

    /// What is known of its detector.
    fn detector(&self) -> String {
        match (self.built, self.top_over_bottom) {
            (None, _) => "as described".to_owned(),
            (Some(seed), None) => format!("as built {seed}"),
            (Some(seed), Some(deviations)) => format!("as built {seed}, top over bottom by {deviations}"),
        }
    }
}

impl fmt::Display for Case {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let board = self.board.map_or("the usual board", BoardModel::name);
        write!(f, "{}, {}, {board}, {}", self.scene, self.detector(), self.scan)
    }
}

/// Runs one case.
fn run(case: &Case) -> anyhow::Result<Found> {
    let detector = case.described();
    let model = case.board.unwrap_or_else(|| BoardModel::usual(&detector));
    let detector = model.described(detector, case.built.is_some());
    let scene = Scene::new(case.scene, &detector, Hand::relative(&detector), case.seed);
    let truth = match case.built {
        Some(seed) => drawn_top_over_bottom(&detector, seed, case.top_over_bottom)?,
        None => detector.clone(),
    };
    let simulation = Simulation::new(&truth, scene.clone(), &[], case.seed)?;
    let board = SimulatedBoard::simulate(&truth, simulation, Options { seed: case.seed, model })?;
    let clock = board.scene_clock();
    let kept = case.offline.then(|| KeptBytes::of(&detector)).transpose()?;
    let (recorder, file) = kept.map_or((None, None), |(recorder, file)| (Some(recorder), Some(file)));
    let options = |time| -> anyhow::Result<RunOptions> {
        let solving = Solving::new(case.method, Problem::of(&detector)?);
        let learning = Learning::of(&detector, Keeping::Nowhere).filter(|_| case.learns);
        Ok(RunOptions {
            scan: case.scan.clone(),
            solving: Some(Solving { learning, ..solving }),
            seconds: time,
            ..RunOptions::new(detector.clone())
        })
    };
    let live = RunOptions { recorder, ..options(Some(case.time))? };
    let live = answered(&mut Opened::new(Box::new(board)), live, case.busy)?;
    anyhow::ensure!(!live.answers.is_empty(), "no answer came in {:.3} s", case.time.as_secs_f64());
    let began_s = clock.began_s().unwrap_or_default();
    let scorer = Scorer::new(&detector, scene);
    let offline_right = file.map(|file| -> anyhow::Result<f64> {
        let mut played = Recording { path: file.0.clone(), speed: f64::INFINITY, stays_open: false };
        let mut answers = answered(&mut played, options(None)?, 0)?.answers;
        // What counts is how long an answer stood by the board's clock.
        let began = Instant::now();
        answers.iter_mut().for_each(|answer| answer.came = began + Duration::from_secs_f64(answer.time_s));
        Ok(scorer.of(&answers, began_s).right)
    });
    let Live { summary, answers, learned } = live;
    let began = answers.first().map(|answer| answer.came);
    Ok(Found {
        scene: case.scene.to_string(),
        detector: case.detector(),
        board: model.name(),
        scan: case.scan.to_string(),
        scored: scorer.of(&answers, began_s),
        offline_right: offline_right.transpose()?,
        age_p99_us: summary.age_us.p99,
        learned_from: summary.learned.as_ref().map(|learned| learned.presses),
        learned_s: learned.zip(began).map(|(learned, began)| learned.duration_since(began).as_secs_f64()),
    })
}

/// What came of one run.
struct Live {
    summary: Summary,
    answers: Vec<Answer>,
    /// When something learned was first in use.
    learned: Option<Instant>,
}

/// Runs a source to its end, and keeps all answers.
fn answered(source: &mut dyn Source, options: RunOptions, busy: u8) -> anyhow::Result<Live> {
    let kept = Arc::new(Mutex::new(Vec::new()));
    let options = RunOptions { listeners: vec![Box::new(Keeper(Arc::clone(&kept)))], ..options };
    let (snapshots, shown) = tokio::sync::watch::channel(Arc::new(Snapshot::default()));
    let (_requests, requests) = mpsc::sync_channel(1);
    let (stop, ended) = (Arc::default(), AtomicBool::new(false));
    let (summary, learned) = thread::scope(|scope| {
        (0..busy).for_each(|_| drop(scope.spawn(|| keep_busy(&ended))));
        let watching = scope.spawn(|| first_learned(&shown, &ended));
        let ends = Ends { snapshots, requests, stop };
        let summary = tactomo::run::run(source, options, ends);
        ended.store(true, Ordering::Relaxed);
        (summary, watching.join().ok().flatten())
    });
    let answers = std::mem::take(&mut *kept.lock().ok().context("a thread panicked")?);
    Ok(Live { summary: summary?, answers, learned })
}

/// A file with a run's bytes, which is gone once this is dropped.
struct KeptBytes(PathBuf);

impl KeptBytes {
    fn of(detector: &Detector) -> anyhow::Result<(Recorder, Self)> {
        let path = std::env::temp_dir().join(format!("tactomo-lab-live-{}.tactomo", std::process::id()));
        let recorder = Recorder::create(&path, &Header::of(detector, "simulated board".to_owned(), 0))?;
        Ok((recorder, Self(path)))
    }
}

impl Drop for KeptBytes {
    fn drop(&mut self) {
        // It may be gone already.
        let _ = std::fs::remove_file(&self.0);
    }
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
