//! A page in front of snapshots that a test makes up, and the requests that the page answers with.

use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, sync_channel};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use anyhow::{Context, Result, bail};
use tactomo::board::link::Control;
use tactomo::detector::Detector;
use tactomo::forward::ImageMesh;
use tactomo::readings::Readings;
use tactomo::run::{Arrival, Frame, LinkState, Request, Snapshot, TouchEvent};
use tactomo::sink::page::{Finger, Listen, PageSetup, Server, Shown};
use tactomo::solve::{FoundContact, Solution};
use tokio::sync::watch;

/// Time between two snapshots.
const PUBLISH_EVERY: Duration = Duration::from_millis(10);
/// Nodes along a side of the image.
const NODES: u32 = 31;

pub const FINGER: Finger = Finger { radius_m: 0.003, conductance_s: 1e-4 };

/// A server, a thread that publishes the snapshot of now a hundred times a second, and what pages asked.
pub struct Script {
    pub server: Server,
    snapshot: Arc<Mutex<Snapshot>>,
    sequence: Arc<AtomicU64>,
    requests: Receiver<Request>,
    stop: Arc<AtomicBool>,
    publisher: Option<JoinHandle<()>>,
}

impl Script {
    /// Serves the default detector, with frames on which nothing touches.
    pub fn start() -> Result<Self> {
        let detector = Detector::preset(Detector::DEFAULT).context("the default preset")?;
        let (sender, receiver) = watch::channel(Arc::default());
        let (ask, requests) = sync_channel(64);
        let setup = PageSetup {
            mesh: grid(&detector),
            detector,
            usual_radius_m: 0.0025,
            source: "a scripted board".to_owned(),
            finger: Some(FINGER),
        };
        let server = Server::start(Listen { port: Some(0), ..Listen::default() }, Shown::alone(setup, receiver, ask))?;
        let first = Snapshot { link: LinkState::Streaming, ..Snapshot::default() };
        let snapshot = Arc::new(Mutex::new(first));
        let (sequence, stop) = (Arc::<AtomicU64>::default(), Arc::<AtomicBool>::default());
        let publisher = Some(publish(sender, Arc::clone(&snapshot), Arc::clone(&sequence), Arc::clone(&stop)));
        let script = Self { server, snapshot, sequence, requests, stop, publisher };
        script.solution(Solution::default());
        Ok(script)
    }

    /// Changes what is published from now on.
    pub fn set(&self, change: impl FnOnce(&mut Snapshot)) {
        change(&mut self.snapshot.lock().expect("no test panics with it"));
    }

    /// Publishes frames with this solution from now on.
    pub fn solution(&self, solution: Solution) {
        let readings = Readings::from_fn(16, |g, e| if g == e { 0.0 } else { 0.01 * (g + e) as f64 });
        self.set(|snapshot| snapshot.answer = Some(Arc::new(answer(0, readings, solution))));
    }

    /// Publishes frames with these contacts from now on.
    pub fn contacts(&self, contacts: Vec<FoundContact>) {
        self.solution(Solution { contacts, residual: Some(1.0), ..Solution::default() });
    }

    /// Publishes images with a round patch of this density (S/m2) at a place (mm) from now on.
    pub fn patch(&self, [x_mm, y_mm]: [f64; 2], s_per_m2: f64) {
        let detector = Detector::preset(Detector::DEFAULT).expect("the default preset");
        let value = |node: &[f64; 2]| {
            let r_mm = (node[0] * 1e3 - x_mm).hypot(node[1] * 1e3 - y_mm);
            (s_per_m2 * (-(r_mm / 5.0).powi(2)).exp()) as f32
        };
        let image = grid(&detector).nodes_m.iter().map(value).collect();
        self.solution(Solution { image_s_per_m2: Some(image), ..Solution::default() });
    }

    /// Waits until a frame that is published after now has been published `frames` times.
    pub fn publish(&self, frames: u64) {
        let until = self.sequence.load(Ordering::Relaxed) + frames;
        while self.sequence.load(Ordering::Relaxed) < until {
            std::thread::sleep(Duration::from_millis(1));
        }
    }

    /// The next request that pages make, but for those that let go of the detector.
    pub fn request(&self) -> Result<Request> {
        let deadline = Instant::now() + Duration::from_secs(10);
        while let Some(left) = deadline.checked_duration_since(Instant::now()) {
            match self.requests.recv_timeout(left).context("the page asks nothing")? {
                Request::Control(Control::Press(contacts)) if contacts.is_empty() => {}
                request => return Ok(request),
            }
        }
        bail!("the page only lets go")
    }
}

impl Drop for Script {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        if let Some(publisher) = self.publisher.take() {
            // A panic in it has been reported.
            let _ = publisher.join();
        }
    }
}

pub fn publish(
    snapshots: watch::Sender<Arc<Snapshot>>,
    now: Arc<Mutex<Snapshot>>,
    sequence: Arc<AtomicU64>,
    stop: Arc<AtomicBool>,
) -> JoinHandle<()> {
    std::thread::spawn(move || {
        while !stop.load(Ordering::Relaxed) {
            let mut snapshot = now.lock().expect("no test panics with it").clone();
            let number = sequence.fetch_add(1, Ordering::Relaxed);
            snapshot.statistics.frames = number;
            if let Some(answer) = &mut snapshot.answer {
                let frame = &mut Arc::make_mut(answer).frame;
                (frame.sequence, frame.arrived) = (number, Arrival::at(Instant::now()));
                frame.board_time_us = number * PUBLISH_EVERY.as_micros() as u64;
            }
            snapshots.send_replace(Arc::new(snapshot));
            std::thread::sleep(PUBLISH_EVERY);
        }
    })
}

/// An answer to a frame that comes now.
pub fn answer(sequence: u64, readings: Readings, solution: Solution) -> TouchEvent {
    let first = Frame::first(readings.clone(), readings.clone(), Arrival::at(Instant::now()));
    TouchEvent::new(Frame { sequence, ..first }, readings, solution)
}

/// A regular mesh over the whole detector.
pub fn grid(detector: &Detector) -> ImageMesh {
    let [[left, bottom], [right, top]] = detector.outline.bounds();
    let along = |low: f64, high: f64, i: u32| low + (high - low) * f64::from(i) / f64::from(NODES - 1);
    let nodes_m: Vec<[f64; 2]> = (0..NODES)
        .flat_map(|row| (0..NODES).map(move |column| [along(left, right, column), along(bottom, top, row)]))
        .collect();
    let cell = |row: u32, column: u32| {
        let [a, b] = [row * NODES + column, (row + 1) * NODES + column];
        [[a, a + 1, b + 1], [a, b + 1, b]]
    };
    let cells = (0..NODES - 1).flat_map(|row| (0..NODES - 1).map(move |column| (row, column)));
    let triangles = cells.flat_map(|(row, column)| cell(row, column)).collect();
    let node_areas_m2 = vec![(right - left) * (top - bottom) / nodes_m.len() as f64; nodes_m.len()];
    ImageMesh { nodes_m, places_m: Vec::new(), triangles, node_areas_m2 }
}
