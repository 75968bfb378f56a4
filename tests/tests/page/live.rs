//! The whole way in one process: simulated board, pipeline, server.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::sync_channel;
use std::thread::JoinHandle;
use std::time::Duration;

use anyhow::{Context, Result};
use tactomo::board::board_log::BoardLog;
use tactomo::board::link::Opened;
use tactomo::board::session::RequestedSettings;
use tactomo::board::simulated::{Options, SimulatedBoard};
use tactomo::detector::Detector;
use tactomo::forward::Auto;
use tactomo::readings::Readings;
use tactomo::run::plan::{Ends, LiveError, Plan, Solving, Summary};
use tactomo::run::{Snapshot, Statistics, pipeline};
use tactomo::scene::{Contact, Hand, Scene, SceneName};
use tactomo::simulate::{Fault, Mouse, Physics, Simulation};
use tactomo::sink::page::{Finger, Listen, PageSetup, Server};
use tactomo::solve::{ContactSettings, Guard, Method, Problem};
use tokio::sync::watch;

/// How firmly the mouse presses.
const FIRMNESS: f64 = 0.2;

/// A live picture of the simulated board.
pub struct Live {
    pub server: Server,
    /// What presses beside the scene.
    pub mouse: Mouse,
    hand: Hand,
    snapshots: watch::Receiver<Arc<Snapshot>>,
    stop: Arc<AtomicBool>,
    pipeline: Option<JoinHandle<Result<Summary, LiveError>>>,
}

impl Live {
    /// Starts it with a scene on the default detector, with faults if asked, and the default solver.
    pub fn start(scene: SceneName, faults: &[Fault]) -> Result<Self> {
        let (detector, hand, physics) = simulation(scene, faults)?;
        let mouse = physics.mouse();
        Self::of(&detector, hand, mouse, Box::new(physics), RequestedSettings::default())
    }

    /// Starts it at rest and with few frames, for pictures of what a solver finds when it has time; the scene begins after a while.
    pub fn after_rest(scene: SceneName, rest: Duration) -> Result<Self> {
        let (detector, hand, at_rest) = simulation(SceneName::Rest, &[])?;
        let (_, _, scene) = simulation(scene, &[])?;
        let mouse = at_rest.mouse();
        let few = RequestedSettings { max_frames_per_s: Some(60), ..RequestedSettings::default() };
        Self::of(&detector, hand, mouse, Box::new(AfterRest { at_rest, scene, rest_s: rest.as_secs_f64() }), few)
    }

    fn of(
        detector: &Detector,
        hand: Hand,
        mouse: Mouse,
        physics: Box<dyn Physics>,
        settings: RequestedSettings,
    ) -> Result<Self> {
        let problem = Problem::new(Auto::new(detector, None)?.model);
        let (snapshots, receiver) = watch::channel(Arc::default());
        let (sender, requests) = sync_channel(64);
        let page = PageSetup {
            detector: detector.clone(),
            mesh: problem.jacobian.image_mesh.clone(),
            usual_radius_m: ContactSettings::of(&problem).radius_m,
            source: "simulated board".to_owned(),
            finger: Some(Finger::from(touch(&hand, [0.0; 2])?)),
        };
        let server = Server::start(Listen { port: Some(0), ..Listen::default() }, page, receiver.clone(), sender)?;
        let stop = Arc::default();
        let ends = Ends { snapshots, requests, stop: Arc::clone(&stop) };
        let pipeline = Some(run(detector, physics, mouse.clone(), settings, problem, ends)?);
        Ok(Self { server, mouse, hand, snapshots: receiver, stop, pipeline })
    }

    /// Presses here (mm), as if by itself.
    pub fn press(&self, at_mm: [f64; 2]) -> Result<()> {
        self.mouse.press(Some(touch(&self.hand, at_mm)?));
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

/// Nothing touches before the scene begins.
struct AfterRest {
    at_rest: Simulation,
    scene: Simulation,
    rest_s: f64,
}

impl Physics for AfterRest {
    fn readings_v(&mut self, time_s: f64) -> Readings {
        let of_now = if time_s < self.rest_s { &mut self.at_rest } else { &mut self.scene };
        of_now.readings_v(time_s)
    }
}

fn simulation(scene: SceneName, faults: &[Fault]) -> Result<(Detector, Hand, Simulation)> {
    let detector = Detector::preset(Detector::DEFAULT).context("the default preset")?;
    let hand = Hand::relative(&detector);
    let physics = Simulation::new(&detector, Scene::new(scene, &detector, hand, 1), faults, 1)?;
    Ok((detector, hand, physics))
}

/// The mouse's touch at a place (mm).
fn touch(hand: &Hand, at_mm: [f64; 2]) -> Result<Contact> {
    hand.tip(at_mm.map(|mm| mm * 1e-3), FIRMNESS, 1.0).disc().context("a tip touches in a disc")
}

fn run(
    detector: &Detector,
    physics: Box<dyn Physics>,
    mouse: Mouse,
    settings: RequestedSettings,
    problem: Problem,
    ends: Ends,
) -> Result<JoinHandle<Result<Summary, LiveError>>> {
    let board = SimulatedBoard::start(detector, physics, Options::default())?;
    let plan = Plan {
        detector: detector.clone(),
        settings,
        solving: Some(Solving {
            method: Method::Auto,
            make: Arc::new(move |method, detector| Ok(Box::new(Guard::new(method, &problem.measured_as(detector))?))),
        }),
        recorder: None,
        board_log: BoardLog::unread(),
        press: Some(Box::new(move |contact| mouse.press(contact))),
        seconds: None,
    };
    let mut source = Opened::new(Box::new(board));
    Ok(std::thread::spawn(move || pipeline::run(&mut source, plan, ends)))
}
