//! Fits of a rub, in threads of their own: neither the reader nor the follower waits for them.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::Instant;

use tactomo_physics::causes::with_causes;
use tactomo_physics::detector::Detector;
use tactomo_physics::threads;
use tactomo_touch::calibrate::{Frame, Rub, RubSettings, rub};

use super::messages::{Fitted, Outcome};
use crate::date::today;
use crate::run::inbox::{Event, Inbox};

/// What a fit is of.
pub(super) struct Task {
    pub description: Arc<Detector>,
    /// Identity of the board.
    pub board: Option<String>,
    pub frames: Vec<Frame>,
    /// Most presses that are fitted.
    pub presses: usize,
    /// The detector in use, if one was found before: the presses that are held out are tried on it.
    pub rival: Option<Arc<Detector>>,
    pub is_last: bool,
    pub cancelled: Arc<AtomicBool>,
}

/// Begins a fit; it comes through the inbox, under the number of its rub.
pub(super) fn begin(task: Task, number: u64, inbox: &Arc<Inbox>) -> std::io::Result<()> {
    let inbox = Arc::clone(inbox);
    let thread = thread::Builder::new().name("calibration".to_owned());
    let run = move || {
        threads::leave_a_core();
        let (begun, is_last) = (Instant::now(), task.is_last);
        let fit = catch_unwind(AssertUnwindSafe(|| fit(&task)));
        let fit = fit.unwrap_or_else(|_| Err("the fit panicked: this is a mistake in the program".to_owned()));
        inbox.put(Event::Calibrated(number, Outcome::Fitted(Box::new(Fitted { is_last, fit, took: begun.elapsed() }))));
    };
    thread.spawn(run).map(drop)
}

fn fit(task: &Task) -> Result<Rub, String> {
    let settings = RubSettings { presses: task.presses, rival: task.rival.as_deref(), ..RubSettings::default() };
    let goes_on = &mut |_| !task.cancelled.load(Ordering::Relaxed);
    let found = rub(&task.description, &task.frames, &settings, goes_on);
    let mut rub = found.map_err(|error| with_causes(&error))?;
    if let Some(calibration) = &mut rub.detector.calibration {
        calibration.board.clone_from(&task.board);
        calibration.date = today();
    }
    Ok(rub)
}
