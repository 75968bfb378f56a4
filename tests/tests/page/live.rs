//! The whole way in one process: simulated board, pipeline, server.

use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::sync_channel;
use std::thread::JoinHandle;
use std::time::Duration;

use anyhow::{Context, Result};
use tactomo::board::simulated::{Options, SimulatedBoard};
use tactomo::board::source::Opened;
use tactomo::detector::Detector;
use tactomo::run::options::{Ends, LiveError, RunOptions, Solving, Summary};
use tactomo::run::{Snapshot, Statistics};
use tactomo::scene::{Contact, Hand, Scene, SceneName};
use tactomo::simulate::{Controls, Fault, Simulation, drawn};
use tactomo::sink::page::{Finger, Listen, PageSetup, Server, Shown};
use tactomo::solve::{ContactSettings, Method, Problem};
use tokio::sync::watch;

/// How firmly the mouse presses.
const FIRMNESS: f64 = 0.2;

/// A live picture of the simulated board.
pub struct Live {
    pub server: Server,
    /// What presses beside the scene.
    pub mouse: Controls,
    hand: Hand,
    snapshots: watch::Receiver<Arc<Snapshot>>,
    stop: Arc<AtomicBool>,
    pipeline: Option<JoinHandle<Result<Summary, LiveError>>>,
}

impl Live {
    /// Starts it with a scene on the default detector, with faults if asked, and the default solver.
    pub fn start(scene: SceneName, faults: &[Fault]) -> Result<Self> {
        let described = Detector::preset(Detector::DEFAULT).context("the default preset")?;
        Self::of(&described, scene, faults, Path::new("."))
    }

    /// Starts it at rest on the detector that was built with this seed, of which it has the description only; calibrated detectors are saved in
    /// this folder.
    pub fn as_built(seed: u64, folder: &Path) -> Result<Self> {
        let described = Detector::preset(Detector::DEFAULT).context("the default preset")?;
        Self::of(&drawn(&described, seed), SceneName::Rest, &[], folder)
    }

    fn of(built: &Detector, scene: SceneName, faults: &[Fault], folder: &Path) -> Result<Self> {
        let detector = Detector::preset(Detector::DEFAULT).context("the default preset")?;
        let hand = Hand::relative(&detector);
        let simulation = Simulation::new(built, Scene::new(scene, &detector, hand, 1), faults, 1)?;
        let mouse = simulation.controls();
        let problem = Problem::of(&detector)?;
        let (snapshots, receiver) = watch::channel(Arc::default());
        let (sender, requests) = sync_channel(64);
        let page = PageSetup {
            detector: detector.clone(),
            mesh: problem.jacobian.image_mesh.clone(),
            usual_radius_m: ContactSettings::of(&problem).radius_m,
            source: "simulated board".to_owned(),
            finger: Some(Finger::from(touch(&hand, [0.0; 2], FIRMNESS)?)),
        };
        let server =
            Server::start(Listen { port: Some(0), ..Listen::default() }, Shown::alone(page, receiver.clone(), sender))?;
        let stop = Arc::default();
        let ends = Ends { snapshots, requests, stop: Arc::clone(&stop) };
        let board = SimulatedBoard::simulate(built, simulation, Options::default())?;
        let options = RunOptions {
            solving: Some(Solving::new(Method::Auto, problem)),
            folder: folder.to_owned(),
            ..RunOptions::new(detector.clone())
        };
        let mut source = Opened::new(Box::new(board));
        let pipeline = Some(std::thread::spawn(move || tactomo::run::run(&mut source, options, ends)));
        Ok(Self { server, mouse, hand, snapshots: receiver, stop, pipeline })
    }

    /// Presses here (mm), as if by itself.
    pub fn press(&self, at_mm: [f64; 2]) -> Result<()> {
        self.press_with(at_mm, FIRMNESS)
    }

    /// Presses here (mm) so firmly.
    pub fn press_with(&self, at_mm: [f64; 2], firmness: f64) -> Result<()> {
        self.mouse.press(vec![touch(&self.hand, at_mm, firmness)?]);
        Ok(())
    }

    /// Counts of now.
    pub fn statistics(&self) -> Statistics {
        self.snapshots.borrow().statistics
    }

    /// Frames a second, and frames dropped, over the next while.
    pub async fn rate_over(&self, time: Duration) -> (f64, u64) {
        let (before, begin) = (self.statistics(), std::time::Instant::now());
        tokio::time::sleep(time).await;
        let after = self.statistics();
        let rate = (after.frames - before.frames) as f64 / begin.elapsed().as_secs_f64();
        (rate, after.dropped - before.dropped)
    }
}

impl Drop for Live {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        if let Some(Ok(Err(error))) = self.pipeline.take().map(JoinHandle::join) {
            eprintln!("the pipeline failed: {error}");
        }
    }
}

/// A touch at a place (mm).
fn touch(hand: &Hand, at_mm: [f64; 2], firmness: f64) -> Result<Contact> {
    hand.tip(at_mm.map(|mm| mm * 1e-3), firmness, 1.0).disc().context("a tip touches in a disc")
}
