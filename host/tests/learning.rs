//! Live learns the detector from what presses on it, unasked.

#![allow(clippy::unwrap_used, reason = "a test that unwraps fails where it should, and says where")]

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, mpsc};
use std::time::{Duration, Instant};

use tactomo::board::simulated::{BoardModel, Options, SimulatedBoard};
use tactomo::board::source::Opened;
use tactomo::detector::Detector;
use tactomo::run::options::{Ends, RunOptions, Solving, Summary};
use tactomo::run::{Listener, Snapshot, TouchEvent};
use tactomo::scene::{Hand, Scene, SceneName};
use tactomo::simulate::{Simulation, drawn};
use tactomo::solve::{FoundContact, Method, Problem};
use tokio::sync::watch;

/// Seed of scene and noise, and of the detector as built.
const SEED: u64 = 1;
const BUILT: u64 = 3;
/// Longest wait until something is learned: 2 to 6 s on two quiet cores, of which a fit takes 1 s of one.
const PATIENCE: Duration = Duration::from_secs(90);
/// Time for which places count then: a press and what is between two.
const COUNTS: Duration = Duration::from_secs(4);
/// Median error that is left (m): 0.18 to 0.25 mm were measured, and 0.3 to 3.1 mm from press to press as described.
const LEFT_M: f64 = 0.35e-3;

/// Number of a frame, its time (s), and what was found in it.
type Answer = (u64, f64, Vec<FoundContact>);

/// Keeps answers.
struct Keeper(Arc<Mutex<Vec<Answer>>>);

impl Listener for Keeper {
    fn touched(&mut self, event: &Arc<TouchEvent>) {
        let (frame, contacts) = (&event.frame, event.solution.contacts.clone());
        self.0.lock().unwrap().push((frame.sequence, 1e-6 * frame.board_time_us as f64, contacts));
    }
}

/// Waits until something is learned, and then for [`COUNTS`]; how many answers there were before.
fn waited(snapshots: &watch::Receiver<Arc<Snapshot>>, answers: &Mutex<Vec<Answer>>) -> usize {
    let begun = Instant::now();
    while begun.elapsed() < PATIENCE && snapshots.borrow().learned.is_none() {
        std::thread::sleep(Duration::from_millis(20));
    }
    let before = answers.lock().unwrap().len();
    std::thread::sleep(COUNTS);
    before
}

/// A press that wanders on a detector as built, until it is learned and a while longer: the answers from then on, with times of the scene.
fn answers_once_learned(detector: &Detector, scene: &Scene) -> (Summary, Vec<Answer>) {
    let simulation = Simulation::new(&drawn(detector, BUILT), scene.clone(), &[], SEED).unwrap();
    let options = Options { seed: SEED, model: BoardModel::Esp32 };
    let board = SimulatedBoard::simulate(detector, simulation, options).unwrap();
    let kept = Arc::new(Mutex::new(Vec::new()));
    let solving = Solving::new(Method::Auto, Problem::of(detector).unwrap());
    let options = RunOptions {
        solving: Some(Solving { learns: true, ..solving }),
        listeners: vec![Box::new(Keeper(Arc::clone(&kept)))],
        ..RunOptions::new(detector.clone())
    };
    let (snapshots, shown) = watch::channel(Arc::new(Snapshot::default()));
    let (_requests, requests) = mpsc::sync_channel(1);
    let stop = Arc::new(AtomicBool::new(false));
    let ends = Ends { snapshots, requests, stop: Arc::clone(&stop) };
    let (summary, before) = std::thread::scope(|scope| {
        let waiting = scope.spawn(|| {
            let before = waited(&shown, &kept);
            stop.store(true, Ordering::Relaxed);
            before
        });
        let summary = tactomo::run::run(&mut Opened::new(Box::new(board)), options, ends).unwrap();
        (summary, waiting.join().unwrap())
    });
    let mut answers = std::mem::take(&mut *kept.lock().unwrap());
    // The scene begins with the first frame.
    let [first, last] =
        [&answers[0], &answers[answers.len() - 1]].map(|(sequence, time_s, _)| (*sequence as f64, *time_s));
    let began_s = first.1 - first.0 * (last.1 - first.1) / (last.0 - first.0);
    answers.iter_mut().for_each(|(_, time_s, _)| *time_s -= began_s);
    (summary, answers.split_off(before))
}

#[test]
fn what_presses_teaches_the_detector_and_places_get_better() {
    let detector = Detector::preset(Detector::DEFAULT).unwrap();
    let scene = Scene::new(SceneName::Wandering, &detector, Hand::relative(&detector), SEED);
    let (summary, answers) = answers_once_learned(&detector, &scene);
    let learned = summary.learned.expect("something is learned");
    assert!(learned.presses >= 5 && learned.place_error_m < 3e-4, "{learned:?}");
    let off = |(_, time_s, found): &Answer| {
        let (truth, [found]) = (scene.at(*time_s).first()?.disc()?, &found[..]) else { return None };
        Some((found.x_m - truth.x_m).hypot(found.y_m - truth.y_m))
    };
    let mut off: Vec<f64> = answers.iter().filter_map(off).collect();
    off.sort_by(f64::total_cmp);
    println!("{learned}: {} of {} answers, median {:?} m", off.len(), answers.len(), off.get(off.len() / 2));
    assert!(off[off.len() / 2] < LEFT_M, "{:?} m of {} answers: {summary:?}", off[off.len() / 2], off.len());
}
