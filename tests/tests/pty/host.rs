//! The host's pipeline on a serial port, in a thread of its own.

use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, mpsc};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use tactomo::board::link::serial::DEFAULT_BAUD;
use tactomo::board::source::NamedPort;
use tactomo::detector::Detector;
use tactomo::run::options::{Ends, LiveError, RunOptions, Summary};
use tactomo::run::{Request, Snapshot};
use tokio::sync::watch;

/// How long anything may take.
const PATIENCE: Duration = Duration::from_secs(10);

pub struct Host {
    snapshots: watch::Receiver<Arc<Snapshot>>,
    stop: Arc<AtomicBool>,
    thread: JoinHandle<Result<Summary, LiveError>>,
    /// Kept, since the pipeline may not lose its page.
    _requests: mpsc::Sender<Request>,
}

impl Host {
    pub fn start(port: &Path) -> Self {
        Self::with(port, |options| options)
    }

    /// With what `change` makes of the usual options.
    pub fn with(port: &Path, change: impl FnOnce(RunOptions) -> RunOptions) -> Self {
        let (snapshot, snapshots) = watch::channel(Arc::default());
        let (_requests, requests) = mpsc::channel();
        let stop = Arc::new(AtomicBool::new(false));
        let options = change(RunOptions::new(Detector::preset("square-60").unwrap()));
        let ends = Ends { snapshots: snapshot, requests, stop: Arc::clone(&stop) };
        let mut source = NamedPort { port: port.to_str().unwrap().to_owned(), baud: DEFAULT_BAUD };
        let thread = thread::spawn(move || tactomo::run::run(&mut source, options, ends));
        Self { snapshots, stop, thread, _requests }
    }

    /// Waits for a snapshot of which `told` holds.
    pub fn wait_until(&self, what: &str, told: impl Fn(&Snapshot) -> bool) {
        let begin = Instant::now();
        while !told(&self.snapshots.borrow()) {
            assert!(begin.elapsed() < PATIENCE, "never: {what}; the last is {:?}", self.snapshots.borrow());
            assert!(!self.thread.is_finished(), "the host ended before: {what}");
            thread::sleep(Duration::from_millis(5));
        }
    }

    pub fn wait_for_frames(&self, frames: u64) {
        self.wait_until(&format!("{frames} frames"), |snapshot| snapshot.statistics.frames >= frames);
    }

    /// Ends the run.
    pub fn finish(self) -> Result<Summary, LiveError> {
        self.stop.store(true, Ordering::Relaxed);
        self.ended()
    }

    /// What came of a run that ends, or is to end, by itself.
    pub fn ended(self) -> Result<Summary, LiveError> {
        let begin = Instant::now();
        while !self.thread.is_finished() {
            assert!(begin.elapsed() < PATIENCE, "the host does not end");
            thread::sleep(Duration::from_millis(5));
        }
        self.thread.join().unwrap()
    }
}
