//! `Live`: events of a board, as they come.

mod event;
mod queue;
mod running;
mod source;

use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use pyo3::prelude::*;
use tactomo::board::link::Control;
use tactomo::board::link::serial::DEFAULT_BAUD;
use tactomo::board::session::RequestedSettings;
use tactomo::changes::Changes;
use tactomo::run::calibration::{Keeping, Learning};
use tactomo::run::scanning::ScanChoice;
use tactomo::run::{LinkState, Request, TouchEvent as Answered};
use tactomo::scene::SceneName;

pub use self::event::TouchEvent;
use self::queue::{Next, Queue};
use self::running::{Running, Wanted};
use self::source::{Chosen, Simulated};
use crate::detector::Detector;
use crate::error::{in_python, raised, refused};
use crate::forward::touches;
use crate::json;
use crate::learned::Learned;
use crate::solver::chosen;

/// Longest wait before it is asked whether somebody has pressed Ctrl-C.
const LOOK_EVERY: Duration = Duration::from_millis(50);

/// The events of a board, as they come: a context manager, and an iterator that ends with the run.
///
/// `port` names the board's serial port; without it, the USB serial port on which a board answers is found. `simulate` takes the simulated
/// board instead, with `scene`, `board` (`ideal`, `esp32`, `esp32c3`), `faults`, `seed` and `as_built` (a seed) as the program's options;
/// `replay` plays a recording, `speed` times as fast. `record` keeps every byte in a new file. `settle_us`, `average` (1, 2, 4 ... 256 conversions),
/// `max_frames_per_s`, `select_us` and `discard` are asked of the board, and `scan`: `whole`, `four`, `adaptive`, or a list of grounds such as `"0,5,10,15"`.
///
/// The detector of a board is learned from what presses on it, and used once that helps, unless `learn` is false. The file `kept` keeps that for
/// the next time; what it holds is used from the start. `learned` is what known presses on the sensor have taught (`Learned`), as for `Solver`;
/// then the detector is taken as described.
///
/// Up to `queue` events wait; if more come, the oldest are lost and counted in `lost`: a slow loop never slows the board.
///
/// >>> with Live(simulate=True, seconds=1) as live:  # doctest: +SKIP
/// ...     for event in live:
/// ...         print(event.time_s, event.contacts)
#[pyclass(frozen, module = "tactomo")]
pub struct Live {
    wanted: Wanted,
    queue: Arc<Queue>,
    changes: Mutex<Changes>,
    has_begun: AtomicBool,
    running: Mutex<Option<Running>>,
}

#[pymethods]
impl Live {
    #[new]
    #[pyo3(signature = (
        port = None, *, detector = None, solver = None, learned = None, seconds = None, queue = 4096, simulate = false, scene = None, board = None,
        faults = None, seed = None, as_built = None, replay = None, speed = 1.0, record = None, learn = true, kept = None, scan = "whole", settle_us = None, average = None,
        max_frames_per_s = None, select_us = None, discard = None, baud = DEFAULT_BAUD
    ))]
    #[pyo3(
        text_signature = "(port=None, *, detector=None, solver=None, learned=None, seconds=None, queue=4096, simulate=False, scene=None, board=None, \
        faults=None, seed=None, as_built=None, replay=None, speed=1.0, record=None, learn=True, kept=None, scan='whole', settle_us=None, average=None, \
        max_frames_per_s=None, select_us=None, discard=None, baud=921600)"
    )]
    #[allow(clippy::too_many_arguments)]
    fn new(
        port: Option<String>,
        detector: Option<&Detector>,
        solver: Option<&str>,
        learned: Option<&Learned>,
        seconds: Option<f64>,
        queue: usize,
        simulate: bool,
        scene: Option<&str>,
        board: Option<&str>,
        faults: Option<Vec<String>>,
        seed: Option<u64>,
        as_built: Option<u64>,
        replay: Option<PathBuf>,
        speed: f64,
        record: Option<PathBuf>,
        learn: bool,
        kept: Option<PathBuf>,
        scan: &str,
        settle_us: Option<u16>,
        average: Option<u16>,
        max_frames_per_s: Option<u16>,
        select_us: Option<u16>,
        discard: Option<u8>,
        baud: u32,
    ) -> PyResult<Self> {
        let has_simulation =
            scene.is_some() || board.is_some() || faults.is_some() || seed.is_some() || as_built.is_some();
        if has_simulation && !simulate {
            return Err(refused(
                "scene, board, faults, seed and as_built are of the simulated board: give simulate=True",
            ));
        }
        let source = match (port, simulate, replay) {
            (None, true, None) => Chosen::Simulated(Simulated {
                scene: scene.map_or(Ok(SceneName::Wandering), |name| name.parse().map_err(raised))?,
                faults: faults
                    .into_iter()
                    .flatten()
                    .map(|fault| fault.parse().map_err(raised))
                    .collect::<PyResult<_>>()?,
                seed: seed.unwrap_or(1),
                as_built,
                model: board.map(|name| name.parse().map_err(raised)).transpose()?,
            }),
            (None, false, Some(path)) if speed > 0.0 => Chosen::Replay { path, speed },
            (None, false, Some(_)) => return Err(refused("speed: a number above 0 is needed, or inf")),
            (port, false, None) => Chosen::Board { port, baud },
            _ => return Err(refused("give one of port, simulate and replay")),
        };
        let learned = learned.map(|learned| learned.taught.clone());
        let learns = learn && learned.is_none() && !source.is_replay();
        if kept.is_some() && !learns {
            return Err(refused("kept: no detector is learned of a recording, with learn=False, or by learned"));
        }
        let detector = source.detector(detector.map(|detector| detector.0.clone()))?;
        let learning = Learning::of(&detector, kept.map_or(Keeping::Nowhere, Keeping::In)).filter(|_| learns);
        let scan: ScanChoice = scan.parse().map_err(|error: String| refused(format!("scan: {error}")))?;
        scan.check(detector.electrodes.len()).map_err(|error| refused(format!("scan: {error}")))?;
        let seconds = seconds.map(|seconds| {
            Duration::try_from_secs_f64(seconds).map_err(|_| refused("seconds: a time above 0 is needed"))
        });
        if queue == 0 {
            return Err(refused("queue: room for one event at least is needed"));
        }
        let wanted = Wanted {
            method: chosen(solver, learned.as_ref())?,
            learned,
            scan,
            settings: RequestedSettings {
                settle_us,
                average_log2: average.map(average_log2).transpose()?,
                max_frames_per_s,
                select_us,
                discarded: discard,
            },
            seconds: seconds.transpose()?,
            record,
            learning,
            source,
            detector,
        };
        Ok(Self {
            wanted,
            queue: Arc::new(Queue::new(queue)),
            changes: Mutex::default(),
            has_begun: AtomicBool::new(false),
            running: Mutex::new(None),
        })
    }

    /// Starts the run, and waits for its first event: a port that does not open, a board that does not answer or does not fit the detector
    /// fail here.
    fn __enter__(slf: Bound<'_, Self>) -> PyResult<Bound<'_, Self>> {
        let live = slf.get();
        slf.py().detach(|| live.start())?;
        let begun = live.await_first(slf.py());
        if begun.is_err() {
            live.stop(slf.py());
        }
        begun.map(|()| slf)
    }

    /// Ends it.
    #[pyo3(signature = (*_args))]
    fn __exit__(&self, py: Python<'_>, _args: &Bound<'_, pyo3::types::PyTuple>) {
        self.stop(py);
    }

    /// Ends the run; events that wait can still be taken.
    fn stop(&self, py: Python<'_>) {
        py.detach(|| {
            // Who asks how it fares meanwhile need not wait for its end.
            let running = self.running().take();
            drop(running);
        });
    }

    fn __iter__(slf: PyRef<'_, Self>) -> PyRef<'_, Self> {
        slf
    }

    fn __next__(&self, py: Python<'_>) -> PyResult<Option<TouchEvent>> {
        loop {
            if let Some(event) = self.wait(py, LOOK_EVERY)? {
                return Ok(event);
            }
        }
    }

    /// The next event; `None` if there is none within `timeout` (s), or the run has ended.
    #[pyo3(signature = (timeout = 1.0))]
    fn next(&self, py: Python<'_>, timeout: f64) -> PyResult<Option<TouchEvent>> {
        let until = Instant::now() + time(timeout)?;
        loop {
            let left = until.saturating_duration_since(Instant::now());
            match self.wait(py, left.min(LOOK_EVERY))? {
                Some(event) => return Ok(event),
                None if left.is_zero() => return Ok(None),
                None => {}
            }
        }
    }

    /// The newest event in place of all that wait; `None` if there is none within `timeout` (s), or the run has ended.
    #[pyo3(signature = (timeout = 1.0))]
    fn newest(&self, py: Python<'_>, timeout: f64) -> PyResult<Option<TouchEvent>> {
        match self.queue.newest() {
            Some(event) => Ok(Some(self.event(event))),
            None => self.next(py, timeout),
        }
    }

    /// Takes the baseline anew: nothing must press.
    fn rezero(&self) -> PyResult<()> {
        self.ask(Request::Rezero)
    }

    /// Reads the touch by another solver from now on.
    fn change_solver(&self, name: &str) -> PyResult<()> {
        self.ask(Request::Solver(name.parse().map_err(raised)?))
    }

    /// Presses on the simulated detector with these contacts and no others, beside its scene; with none, lets go.
    #[pyo3(signature = (contacts = None), text_signature = "($self, contacts=())")]
    fn press(&self, contacts: Option<&Bound<'_, PyAny>>) -> PyResult<()> {
        let touches = contacts.map(touches).transpose()?.unwrap_or_default();
        let discs: Option<Vec<_>> = touches.iter().map(|touch| touch.disc()).collect();
        let discs = discs.ok_or_else(|| refused("only discs can press on a detector that runs"))?;
        self.ask(Request::Control(Control::Press(discs)))
    }

    /// Events that were lost because nobody took them.
    #[getter]
    fn lost(&self) -> u64 {
        self.queue.lost()
    }

    /// The detector that the events are of.
    #[getter]
    fn detector(&self) -> Detector {
        Detector(self.wanted.detector.clone())
    }

    /// How the link to the board fares: `searching`, `waiting`, `streaming`, or in words what is wrong.
    #[getter]
    fn link(&self) -> String {
        match self.running().as_ref().map(Running::link) {
            None => "not running".to_owned(),
            Some(LinkState::Searching) => "searching".to_owned(),
            Some(LinkState::Waiting) => "waiting".to_owned(),
            Some(LinkState::Streaming) => "streaming".to_owned(),
            Some(LinkState::Silent(why) | LinkState::Absent(why) | LinkState::Lost(why) | LinkState::Ended(why)) => why,
        }
    }

    /// What to know of the baseline, in words; `None` if all is well.
    #[getter]
    fn notice(&self) -> Option<String> {
        self.running().as_ref().and_then(|running| running.notice())
    }

    /// What a run that has ended has come to, as `tactomo live --json` prints it; `None` before.
    #[getter]
    fn summary<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyAny>>> {
        match self.queue.ended() {
            Some(Ok(summary)) => json::loads(py, &summary).map(Some),
            _ => Ok(None),
        }
    }
}

impl Live {
    fn running(&self) -> MutexGuard<'_, Option<Running>> {
        self.running.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn start(&self) -> PyResult<()> {
        if self.has_begun.swap(true, Ordering::Relaxed) {
            return Err(refused("this Live has run: make another one"));
        }
        let running = self.wanted.start(&self.queue);
        self.has_begun.store(running.is_ok(), Ordering::Relaxed);
        *self.running() = Some(running?);
        Ok(())
    }

    /// Waits until there is an event; what keeps the run from giving one is an error.
    fn await_first(&self, py: Python<'_>) -> PyResult<()> {
        while !py.detach(|| self.queue.has_begun(LOOK_EVERY)) {
            py.check_signals()?;
            if let Some(LinkState::Silent(why) | LinkState::Lost(why)) = self.running().as_ref().map(Running::link) {
                return Err(refused(in_python(&why)));
            }
        }
        match self.queue.ended() {
            Some(Err(why)) => Err(refused(why)),
            _ => Ok(()),
        }
    }

    /// The next event, or `Some(None)` at the end; `None` if nothing came within `patience`.
    fn wait(&self, py: Python<'_>, patience: Duration) -> PyResult<Option<Option<TouchEvent>>> {
        let next = match self.queue.next(Duration::ZERO) {
            Next::Nothing => {
                if !self.has_begun.load(Ordering::Relaxed) {
                    return Err(refused("nothing runs: use it in a `with` statement"));
                }
                py.detach(|| self.queue.next(patience))
            }
            next => next,
        };
        match next {
            Next::Event(event) => Ok(Some(Some(self.event(event)))),
            Next::Ended(Ok(_)) => Ok(Some(None)),
            Next::Ended(Err(why)) => Err(refused(why)),
            Next::Nothing => py.check_signals().map(|()| None),
        }
    }

    fn event(&self, event: Arc<Answered>) -> TouchEvent {
        let mut changes = self.changes.lock().unwrap_or_else(PoisonError::into_inner);
        TouchEvent { changed: changes.take(&event.solution.contacts), event }
    }

    fn ask(&self, request: Request) -> PyResult<()> {
        let running = self.running();
        running.as_ref().ok_or_else(|| refused("nothing runs: use it in a `with` statement"))?.ask(request)
    }
}

fn average_log2(count: u16) -> PyResult<u8> {
    let is_one = count.is_power_of_two() && count <= 256;
    if is_one { Ok(count.ilog2() as u8) } else { Err(refused("average: 1, 2, 4, 8, 16, 32, 64, 128 or 256")) }
}

fn time(seconds: f64) -> PyResult<Duration> {
    Duration::try_from_secs_f64(seconds).map_err(|_| refused("timeout: a time of 0 or above is needed (s)"))
}
