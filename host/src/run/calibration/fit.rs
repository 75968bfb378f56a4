//! Fits of a rub, in threads of their own: neither the reader nor the follower waits for them.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::{Duration, Instant};

use tactomo_physics::causes::with_causes;
use tactomo_physics::detector::Detector;
use tactomo_physics::forward::ForwardError;
use tactomo_touch::calibrate::{Frame, Rub, RubSettings, rub};
use tactomo_touch::solve::{ContactSettings, Contacts, Problem, Solver};

use super::Outcome;
use crate::date::today;
use crate::run::inbox::{Event, Inbox};

/// Presses that the first fit is of, and most that others on the way are, each of twice as many as the one before: they are to be quick.
const PRESSES_ON_THE_WAY: [usize; 2] = [10, 60];
/// Presses that before and after are compared on.
const COMPARED: usize = 24;

/// A detector as it was built, and what that brings.
#[derive(Clone, Debug)]
pub struct Fit {
    /// What was found.
    pub rub: Rub,
    /// The same presses before and after, of the last fit.
    pub compared: Option<Compared>,
}

/// The same presses with the description and with the detector that was found. Medians, for frames of several contacts are among them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Compared {
    /// Residual of one contact, in standard deviations of the noise, before and after.
    pub residuals: [f64; 2],
    /// Distance of the places that are found (m).
    pub moved_m: f64,
}

/// What a fit is of.
pub(super) struct Task {
    pub description: Arc<Detector>,
    /// Identity of the board.
    pub board: Option<String>,
    pub frames: Vec<Frame>,
    /// Fits before this one.
    pub before: usize,
    pub is_last: bool,
    pub cancelled: Arc<AtomicBool>,
}

/// A fit that has ended.
pub(in crate::run) struct Fitted {
    pub is_last: bool,
    pub fit: Result<Fit, String>,
    pub took: Duration,
}

/// Begins a fit; it comes through the inbox, under the number of its rub.
pub(super) fn begin(task: Task, number: u64, inbox: &Arc<Inbox>) -> std::io::Result<()> {
    let inbox = Arc::clone(inbox);
    let thread = thread::Builder::new().name("calibration".to_owned());
    let run = move || {
        let (begun, is_last) = (Instant::now(), task.is_last);
        let fit = catch_unwind(AssertUnwindSafe(|| fit(&task)));
        let fit = fit.unwrap_or_else(|_| Err("the fit panicked: this is a mistake in the program".to_owned()));
        inbox.put(Event::Calibrated(number, Outcome::Fitted(Box::new(Fitted { is_last, fit, took: begun.elapsed() }))));
    };
    thread.spawn(run).map(drop)
}

fn fit(task: &Task) -> Result<Fit, String> {
    let usual = RubSettings::default();
    let [first, most] = PRESSES_ON_THE_WAY;
    let presses = if task.is_last { usual.presses } else { (first << task.before.min(8)).min(most) };
    let goes_on = &mut |_| !task.cancelled.load(Ordering::Relaxed);
    let found = rub(&task.description, &task.frames, &RubSettings { presses, ..usual }, goes_on);
    let mut rub = found.map_err(|error| with_causes(&error))?;
    if let Some(calibration) = &mut rub.detector.calibration {
        calibration.board.clone_from(&task.board);
        calibration.date = today();
    }
    let compared = match task.is_last && rub.left_out.is_empty() {
        true => compare(&task.description, &rub.detector, &task.frames).map_err(|error| with_causes(&error))?,
        false => None,
    };
    Ok(Fit { rub, compared })
}

/// Looks at some of the frames with both detectors.
fn compare(before: &Detector, after: &Detector, frames: &[Frame]) -> Result<Option<Compared>, ForwardError> {
    let some: Vec<_> = frames.iter().step_by(frames.len().div_ceil(COMPARED).max(1)).collect();
    let [found_before, found_after] = [singles(before, &some)?, singles(after, &some)?];
    let both: Vec<_> = found_before.into_iter().zip(found_after).filter_map(|(a, b)| Some((a?, b?))).collect();
    let residuals = [median(both.iter().map(|(a, _)| a.1)), median(both.iter().map(|(_, b)| b.1))];
    let moved_m = median(both.iter().map(|((a, _), (b, _))| (a[0] - b[0]).hypot(a[1] - b[1])));
    let [Some(residual_before), Some(residual_after)] = residuals else { return Ok(None) };
    Ok(moved_m.map(|moved_m| Compared { residuals: [residual_before, residual_after], moved_m }))
}

/// Place of a contact (m), and what it leaves of the readings, in standard deviations of the noise.
type Single = ([f64; 2], f64);

/// The one contact that explains each frame best on a detector that is taken as exact.
fn singles(detector: &Detector, frames: &[&Frame]) -> Result<Vec<Option<Single>>, ForwardError> {
    let problem = Problem::of(&detector.taken_as_exact())?;
    let Ok(mut solver) = Contacts::new(&problem, ContactSettings { most: 1, ..ContactSettings::of(&problem) }) else {
        return Ok(vec![None; frames.len()]);
    };
    let mut single = |frame: &&Frame| {
        solver.reset();
        let mut touch = frame.readings.clone();
        touch.correct_channels(detector);
        let found = solver.solve(&touch).ok()?;
        let contact = found.contacts.first()?;
        Some((detector.map_m([contact.x_m, contact.y_m, contact.z_m]), found.residual?))
    };
    Ok(frames.iter().map(&mut single).collect())
}

fn median(values: impl Iterator<Item = f64>) -> Option<f64> {
    let mut sorted: Vec<f64> = values.collect();
    sorted.sort_by(f64::total_cmp);
    sorted.get(sorted.len() / 2).copied()
}
