//! A run: what is wanted of it, and the thread it is on.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, mpsc};
use std::thread::{self, JoinHandle};
use std::time::Duration;

use pyo3::prelude::*;
use tactomo::board::record::{Header, Recorder};
use tactomo::board::session::RequestedSettings;
use tactomo::causes::with_causes;
use tactomo::detector::Detector as Described;
use tactomo::learned::Learned as Taught;
use tactomo::run::calibration::Learning;
use tactomo::run::options::{Ends, LiveError, RunOptions, Solving, Summary};
use tactomo::run::scanning::ScanChoice;
use tactomo::run::{LinkState, Request, Snapshot, run};
use tactomo::solve::{Method, Problem};
use tokio::sync::watch;

use super::queue::{Ended, Queue, Tail};
use super::source::Chosen;
use crate::error::{in_python, raised, refused};

/// Requests that may wait.
const REQUESTS: usize = 64;

/// What is to be run.
pub struct Wanted {
    /// Where bytes come from.
    pub source: Chosen,
    /// The detector as told.
    pub detector: Described,
    /// The solver.
    pub method: Method,
    /// What known presses have taught it.
    pub learned: Option<Taught>,
    /// Rows to scan.
    pub scan: ScanChoice,
    /// What is asked of the board.
    pub settings: RequestedSettings,
    /// How long; to the end unless given.
    pub seconds: Option<Duration>,
    /// The file that keeps every byte.
    pub record: Option<PathBuf>,
    /// How the detector is learned, if it is.
    pub learning: Option<Learning>,
}

impl Wanted {
    /// Starts it; its events are put into the queue.
    pub fn start(&self, queue: &Arc<Queue>) -> PyResult<Running> {
        let mut source = self.source.open(&self.detector)?;
        self.learning.as_ref().map_or(Ok(()), Learning::check).map_err(refused)?;
        let detector = self.detector.clone();
        let problem = Problem::of(&detector).map_err(raised)?;
        let problem = match &self.learned {
            Some(learned) => problem.with_learned(learned.clone()).map_err(raised)?,
            None => problem,
        };
        let record = |path: &PathBuf| Recorder::create(path, &Header::now(&detector, source.name()));
        let options = RunOptions {
            recorder: self.record.as_ref().map(record).transpose().map_err(raised)?,
            settings: self.settings,
            scan: self.scan.clone(),
            solving: Some(Solving { learning: self.learning.clone(), ..Solving::new(self.method, problem) }),
            listeners: vec![Box::new(Tail(Arc::clone(queue)))],
            seconds: self.seconds,
            ..RunOptions::new(detector)
        };
        let stop = Arc::new(AtomicBool::new(false));
        let (snapshots, shown) = watch::channel(Arc::new(Snapshot::default()));
        let (request, requests) = mpsc::sync_channel(REQUESTS);
        let ends = Ends { snapshots, requests, stop: Arc::clone(&stop) };
        let queue = Arc::clone(queue);
        let work = move || {
            let run = AssertUnwindSafe(|| run(&mut *source, options, ends));
            queue.end(ended(catch_unwind(run)));
        };
        let thread = thread::Builder::new().name("tactomo".to_owned()).spawn(work);
        let thread = Some(thread.map_err(|error| refused(format!("cannot start a thread: {error}")))?);
        Ok(Running { stop, requests: request, snapshots: shown, thread })
    }
}

/// A run under way; it ends where this is dropped.
pub struct Running {
    stop: Arc<AtomicBool>,
    requests: mpsc::SyncSender<Request>,
    snapshots: watch::Receiver<Arc<Snapshot>>,
    thread: Option<JoinHandle<()>>,
}

impl Running {
    /// How the link to the board fares.
    pub fn link(&self) -> LinkState {
        self.snapshots.borrow().link.clone()
    }

    /// What to know of the baseline.
    pub fn notice(&self) -> Option<String> {
        self.snapshots.borrow().baseline.clone()
    }

    /// Asks something of it.
    pub fn ask(&self, request: Request) -> PyResult<()> {
        self.requests.try_send(request).map_err(|_| refused("too many requests wait, or the run has ended"))
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        // Whatever ended it is in the queue.
        let _ = self.thread.take().map(JoinHandle::join);
    }
}

/// How a run has ended, in words.
fn ended(run: thread::Result<Result<Summary, LiveError>>) -> Ended {
    match run {
        Ok(Ok(summary)) => serde_json::to_string(&summary).map_err(|error| error.to_string()),
        Ok(Err(error)) => Err(in_python(&with_causes(&error))),
        Err(_) => Err("the run panicked: this is a mistake in tactomo, please report it".to_owned()),
    }
}
