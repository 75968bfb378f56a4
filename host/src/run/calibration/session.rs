//! One calibration: frames are collected, fitted in other threads, and used. It learns from whatever presses, unseen, until a person asks for
//! more: then it guides, and saves what it has found.

use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::{Duration, Instant};

use tactomo_physics::detector::Detector;
use tactomo_physics::readings::{Readings, Rounds};
use tactomo_touch::calibrate::{HeldOut, Rub, RubSettings};
use tactomo_touch::solve::FoundContact;

use super::collected::Collected;
use super::fit::{self, Task};
use super::messages::{Calibrate, Fitted, Outcome};
use super::{Calibrating, Stage, save};
use crate::run::inbox::{Event, Inbox};
use crate::run::notice::NoticeBoard;

/// Cells with frames, light and firm ones counted apart, before the first fit: fewer do not spread over a detector.
const ENOUGH: usize = 16;
/// Presses that the first fit that a person sees is of, and most that others on the way are, each of twice as many as the one before: they are
/// to be quick.
const PRESSES_ON_THE_WAY: [usize; 2] = [10, 60];
/// Cells with frames, light and firm ones counted apart, before what presses anyway is first learned from; twice as many before each time after.
/// On an independent detector as built 5 presses take two fifths of the median error of places, and 58 hardly more; of 3, the first fit of live
/// mostly failed, and the next came later.
const FIRST_LEARNED: usize = 5;
/// Shortest time from the end of a fit to the next; at least the fit's own time is left too, for the picture needs the cores.
const PAUSE: Duration = Duration::from_secs(2);
/// Share of the detector that has to be rubbed before it is done: fingertips hardly reach the corners.
const WHOLE: f64 = 0.8;
/// Share of the expected error before by which a fit has to better it for more to be worth it.
const WORTH: f64 = 0.05;
/// The sensor is another one than the detector in use was learned from where that leaves, of presses that were not fitted, so many times the
/// residual that the detector found leaves: of the same sensor 0.99 to 1.07 times, of others 1.33 to 2.6 times (six pairs as built, 3 to 11 presses).
const OTHER: f64 = 1.2;
/// Frames of rows without a whole one between them from which on the board's plan has none: an adaptive plan of 32 electrodes has one in every 64.
const NEVER_WHOLE: u64 = 500;
/// Most that is said to be missing at a time.
const TOLD: usize = 3;
/// Time between two pictures of how it is: a person sees that at once.
const SHOWN_EVERY: Duration = Duration::from_millis(80);

/// A calibration under way, in the follower.
pub(super) struct RubSession {
    /// Tells what comes of this one from what comes of others before.
    pub number: u64,
    inbox: Arc<Inbox>,
    notice: Arc<NoticeBoard>,
    folder: PathBuf,
    description: Arc<Detector>,
    /// Cells that have to have frames before the next fit that nobody asks for; `None` if there is to be none.
    learns_from: Option<usize>,
    /// The detector that was found before and is in use, if one is.
    used: Option<Arc<Detector>>,
    /// Whether a fit has said that presses of this session fit the detector in use.
    is_same: bool,
    collected: Collected,
    rounds: Rounds,
    shown: Calibrating,
    cancelled: Arc<AtomicBool>,
    next_fit: Instant,
    fitted_frames: u64,
    showed: Option<Instant>,
}

impl Drop for RubSession {
    fn drop(&mut self) {
        self.cancelled.store(true, Ordering::Relaxed);
    }
}

impl RubSession {
    /// Begins with the detector of this description, for files in this folder; with `learns`, unasked.
    pub fn new(
        number: u64,
        description: Arc<Detector>,
        learns: bool,
        folder: PathBuf,
        (inbox, notice): (Arc<Inbox>, Arc<NoticeBoard>),
    ) -> Self {
        let collected = Collected::new(&description);
        let shown = Calibrating {
            stage: Stage::Learning,
            coverage: collected.coverage.clone(),
            touched: 0,
            fitting: false,
            errors_m: Vec::new(),
            fit: None,
            trouble: None,
            saved: None,
            used: false,
        };
        Self {
            number,
            inbox,
            notice,
            folder,
            description,
            learns_from: learns.then_some(FIRST_LEARNED),
            used: None,
            is_same: false,
            collected,
            rounds: Rounds::default(),
            shown,
            cancelled: Arc::default(),
            next_fit: Instant::now(),
            fitted_frames: 0,
            showed: None,
        }
    }

    /// Does what a person asks, but for what is the follower's.
    pub fn ask(&mut self, ask: Calibrate) {
        self.showed = None;
        match (ask, self.shown.stage) {
            (Calibrate::End, _) => self.shown.stage = Stage::Learning,
            (Calibrate::Begin, Stage::Learning | Stage::Done) => {
                (self.shown.stage, self.shown.trouble) = (Stage::Rubbing, None)
            }
            (Calibrate::Finish, Stage::Rubbing) => self.finish(),
            (Calibrate::Save, Stage::Done) => self.save(),
            _ => {}
        }
    }

    /// What a person has found, to go on with, if there is something.
    pub fn use_found(&mut self) -> Option<Arc<Rub>> {
        let fit = self.shown.fit.as_ref().filter(|_| self.shown.stage == Stage::Done)?;
        (self.shown.used, self.showed) = (true, None);
        Some(Arc::clone(fit))
    }

    /// From now on this detector is used, that was found before.
    pub fn set_used(&mut self, used: Option<Arc<Detector>>) {
        self.used = used;
    }

    /// What was learned unasked, if presses that it was not fitted to say that it helps, and it is better than what is in use: places are known
    /// better, or the sensor is another one by now.
    pub fn learned(&mut self) -> Option<Arc<Rub>> {
        let fit = self.shown.fit.as_ref().filter(|_| self.shown.stage == Stage::Learning)?;
        let HeldOut { residuals: [_, after], rival, .. } = fit.held_out?;
        let is_other = rival.is_some_and(|rival| rival > OTHER * after);
        if is_other && fit.helped() {
            tracing::info!("this is another sensor than was learned before, so it is learned anew");
        }
        self.is_same = !is_other || fit.helped();
        let known_m = self.used.as_ref().and_then(|used| used.calibration.as_ref()?.place_error_m);
        let is_better = known_m.is_none_or(|known_m| fit.place_error_m() < (1.0 - WORTH) * known_m);
        (fit.helped() && (is_better || is_other)).then(|| Arc::clone(fit))
    }

    /// Takes a frame, or rows of one: readings (V) less the baseline, as the channels read them, their time (s), and the contacts found.
    pub fn take(&mut self, readings: &Readings, time_s: f64, contacts: &[FoundContact]) {
        let collects = match self.shown.stage {
            Stage::Learning => self.learns_from.is_some(),
            Stage::Rubbing => true,
            Stage::Finishing | Stage::Done => false,
        };
        if !collects {
            return;
        }
        let Some(readings) = self.rounds.add(readings, time_s).filter(Readings::is_whole) else {
            let waiting = self.rounds.waiting();
            if waiting >= NEVER_WHOLE {
                self.shown.trouble = Some(format!(
                    "{waiting} frames of some grounds only are left out: calibrate with whole frames (without --scan)"
                ));
            }
            return;
        };
        // Nobody has promised to press with one finger, so what is not one contact is left out; but where the sensor may be another one than what is in
        // use was learned from, one may seem several.
        let is_sure = self.used.is_none() || self.is_same;
        if self.shown.stage == Stage::Learning && is_sure && contacts.len() != 1 {
            return;
        }
        self.collected.take(&readings, contacts, &self.description);
        let enough = if self.shown.stage == Stage::Learning { self.learns_from.unwrap_or(usize::MAX) } else { ENOUGH };
        let is_new = self.collected.touched > self.fitted_frames;
        if is_new && !self.shown.fitting && self.collected.filled() >= enough && Instant::now() >= self.next_fit {
            self.learns_from = self.learns_from.map(|_| 2 * self.collected.filled());
            self.fit(false);
        }
    }

    /// Takes what has come of work in another thread.
    pub fn receive(&mut self, outcome: Outcome) {
        self.showed = None;
        match outcome {
            Outcome::Fitted(fitted) => self.fitted(*fitted),
            Outcome::Saved(saved) => {
                self.shown.trouble = saved.as_ref().err().cloned();
                self.shown.saved = saved.ok();
            }
        }
    }

    /// Whether a person sees it.
    pub fn is_open(&self) -> bool {
        self.shown.stage != Stage::Learning
    }

    /// How it is, if it is time to show that.
    pub fn newly_shown(&mut self) -> Option<Calibrating> {
        if self.showed.is_some_and(|showed| showed.elapsed() < SHOWN_EVERY) {
            return None;
        }
        self.showed = Some(Instant::now());
        self.shown.coverage.clone_from(&self.collected.coverage);
        self.shown.touched = self.collected.touched;
        Some(self.shown.clone())
    }

    fn finish(&mut self) {
        self.shown.stage = Stage::Finishing;
        // One that is under way is not of all frames: the last one follows it.
        if !self.shown.fitting {
            self.fit(true);
        }
    }

    fn fit(&mut self, is_last: bool) {
        let [first, most] = PRESSES_ON_THE_WAY;
        let presses = match self.shown.stage {
            _ if is_last => RubSettings::default().presses,
            Stage::Learning => most,
            _ => (first << self.shown.errors_m.len().min(8)).min(most),
        };
        let task = Task {
            description: Arc::clone(&self.description),
            board: self.notice.board(),
            frames: self.collected.frames(),
            presses,
            rival: self.used.clone(),
            is_last,
            cancelled: Arc::clone(&self.cancelled),
        };
        self.fitted_frames = self.collected.touched;
        match fit::begin(task, self.number, &self.inbox) {
            Ok(()) => self.shown.fitting = true,
            Err(error) => self.fail(format!("cannot start a thread: {error}")),
        }
    }

    fn fail(&mut self, trouble: String) {
        self.shown.trouble = Some(trouble);
        if self.shown.stage == Stage::Finishing {
            self.shown.stage = Stage::Rubbing;
        }
    }

    fn fitted(&mut self, Fitted { is_last, fit, took }: Fitted) {
        self.shown.fitting = false;
        self.next_fit = Instant::now() + PAUSE.max(took);
        let is_asked = self.shown.stage == Stage::Finishing && !is_last;
        match fit {
            // On the way there may be too little yet; at the end that is the answer.
            Err(trouble) if is_asked => self.shown.trouble = Some(trouble),
            Err(trouble) => self.fail(trouble),
            Ok(fit) => {
                let error_m = fit.place_error_m();
                // An error that rose is not settled: of few presses, or of one firmness, it is not known what it will be.
                let settled = |before_m: &f64| (error_m / before_m - 1.0).abs() < WORTH;
                let is_settled = self.shown.errors_m.last().is_some_and(settled) && fit.helped();
                let least_m = self.shown.errors_m.iter().copied().fold(f64::INFINITY, f64::min);
                let unfinished = is_last.then(|| unfinished(&fit, least_m)).flatten();
                self.shown.errors_m.push(error_m);
                self.shown.fit = Some(Arc::new(fit));
                (self.shown.trouble, self.shown.saved, self.shown.used) = (unfinished, None, false);
                let is_covered = self.collected.coverage.share() >= WHOLE;
                match self.shown.stage {
                    Stage::Finishing if is_last && self.shown.trouble.is_none() => self.shown.stage = Stage::Done,
                    Stage::Finishing if is_last => self.shown.stage = Stage::Rubbing,
                    Stage::Rubbing if is_settled && is_covered => self.finish(),
                    _ => {}
                }
            }
        }
        if is_asked {
            self.fit(true);
        }
    }

    fn save(&mut self) {
        let (Some(fit), None) = (&self.shown.fit, &self.shown.saved) else { return };
        let (fit, folder) = (Arc::clone(fit), self.folder.clone());
        let (number, inbox) = (self.number, Arc::clone(&self.inbox));
        let write = move || {
            let saved = save::save(&fit.detector, &folder);
            inbox.put(Event::Calibrated(number, Outcome::Saved(saved)));
        };
        if let Err(error) = thread::Builder::new().name("calibration file".to_owned()).spawn(write) {
            self.shown.trouble = Some(format!("cannot start a thread: {error}"));
        }
    }
}

/// Why a detector that was found is not to be used, and what to do, as a sentence for a person; `None` if presses that it was not fitted to
/// say that it has helped. An expected error that has risen from the least one before (m) is none to end with, while anything is missing.
fn unfinished(found: &Rub, least_m: f64) -> Option<String> {
    let error_m = found.place_error_m();
    let has_risen = error_m > (1.0 + WORTH) * least_m && !found.missing.is_empty();
    if found.helped() && !has_risen {
        return None;
    }
    let why = match &found.held_out {
        _ if found.helped() => {
            format!("The expected error has risen from {:.2} to {:.2} mm", 1e3 * least_m, 1e3 * error_m)
        }
        None => "It is too little to tell whether it helps".to_owned(),
        Some(HeldOut { residuals: [before, after], place_errors_m: [before_m, after_m], .. }) => format!(
            "It has not helped: presses that were not used leave {before:.1} × noise before and {after:.1} after, and places are known to \
             {:.2} mm before and {:.2} after",
            1e3 * before_m,
            1e3 * after_m
        ),
    };
    let missing: Vec<_> = found.missing.iter().take(TOLD).map(ToString::to_string).collect();
    let what = if missing.is_empty() { "rub on, with one fingertip alone".to_owned() } else { missing.join("; ") };
    Some(format!("{why}. What is missing: {what}."))
}

#[cfg(test)]
mod tests {
    use super::*;
    use tactomo_physics::detector::Calibration;
    use tactomo_touch::calibrate::Missing;

    fn found(place_errors_m: [f64; 2], residuals: [f64; 2], missing: &[Missing]) -> Rub {
        Rub {
            detector: Detector::default(),
            wires: None,
            left_out: Vec::new(),
            touched: 200,
            single: 200,
            presses: 160,
            known: 0,
            held_out: Some(HeldOut { presses: 24, residuals, place_errors_m, rival: None }),
            missing: missing.to_vec(),
            chi_square: [9.0, 1.0],
            place_errors_m: vec![([0.0; 2], place_errors_m[1])],
        }
    }

    fn session(learns: bool) -> RubSession {
        let (snapshots, _) = tokio::sync::watch::channel(Arc::default());
        let ends = (Arc::new(Inbox::new(false)), Arc::new(NoticeBoard::new(snapshots)));
        RubSession::new(1, Arc::default(), learns, PathBuf::from("."), ends)
    }

    /// A detector whose places are known to this (m).
    fn known(place_error_m: f64) -> Option<Arc<Detector>> {
        let calibration = Calibration { place_error_m: Some(place_error_m), ..Calibration::default() };
        Some(Arc::new(Detector { calibration: Some(calibration), ..Detector::default() }))
    }

    /// Whether a frame with so many contacts is kept.
    fn keeps(session: &mut RubSession, contacts: usize) -> bool {
        let before = session.collected.touched;
        let press = FoundContact::flat(0.01, 0.0, session.description.sheet_conductance_s());
        session.take(&Readings::from_fn(16, |_, _| 0.1), 0.0, &vec![press; contacts]);
        session.collected.touched > before
    }

    #[test]
    fn unasked_it_learns_from_one_contact_and_asked_from_all_frames() {
        let mut learning = session(true);
        assert!(keeps(&mut learning, 1) && !keeps(&mut learning, 2));
        learning.ask(Calibrate::Begin);
        assert!(learning.is_open() && keeps(&mut learning, 2), "the fit sorts them out");
        learning.ask(Calibrate::End);
        assert!(!learning.is_open() && keeps(&mut learning, 1), "it goes on learning");
        let mut taken = session(false);
        assert!(!keeps(&mut taken, 1));
        taken.ask(Calibrate::Begin);
        assert!(keeps(&mut taken, 1));
    }

    #[test]
    fn what_was_learned_is_used_only_if_it_helps_and_is_better_than_what_is_used() {
        let mut learning = session(true);
        assert!(learning.learned().is_none(), "nothing is fitted");
        let mut fitted = |place_errors_m, residuals, used| {
            learning.shown.fit = Some(Arc::new(found(place_errors_m, residuals, &[])));
            learning.set_used(used);
            learning.learned().is_some()
        };
        assert!(fitted([0.9e-3, 0.2e-3], [3.0, 1.0], None) && fitted([0.9e-3, 0.2e-3], [3.0, 1.0], known(0.3e-3)));
        assert!(!fitted([0.9e-3, 0.2e-3], [3.0, 1.0], known(0.205e-3)), "hardly better");
        assert!(!fitted([0.9e-3, 0.2e-3], [1.0, 1.3], None), "presses that were not used fit worse");
        learning.ask(Calibrate::Begin);
        learning.set_used(None);
        assert!(learning.learned().is_none(), "now a person decides");
    }

    #[test]
    fn another_sensor_than_was_learned_before_is_learned_anew_from_all_that_presses() {
        let mut learning = session(true);
        learning.set_used(known(0.15e-3));
        assert!(keeps(&mut learning, 2), "one contact may seem two with the detector of another sensor");
        let mut is_taken = |rival| {
            let held_out =
                HeldOut { presses: 4, residuals: [9.0, 1.0], place_errors_m: [0.9e-3, 0.2e-3], rival: Some(rival) };
            let found = found([0.9e-3, 0.2e-3], [9.0, 1.0], &[]);
            learning.shown.fit = Some(Arc::new(Rub { held_out: Some(held_out), ..found }));
            learning.learned().is_some()
        };
        assert!(!is_taken(1.1), "the detector in use fits, and tells places better");
        assert!(is_taken(2.5));
        assert!(!keeps(&mut learning, 2), "it is known by now");
    }

    #[test]
    fn what_rose_is_not_done_and_says_what_is_missing() {
        assert_eq!(unfinished(&found([0.9e-3, 0.2e-3], [3.0, 1.0], &[]), 0.25e-3), None);
        let risen = unfinished(&found([0.9e-3, 0.75e-3], [3.0, 1.0], &[Missing::Firm]), 0.68e-3).unwrap_or_default();
        assert!(risen.contains("risen from 0.68 to 0.75 mm") && risen.contains("press harder"), "{risen}");
        let worse = found([0.68e-3, 0.75e-3], [3.0, 1.0], &[Missing::Place([-0.02, 0.02])]);
        let worse = unfinished(&worse, 0.75e-3).unwrap_or_default();
        assert!(worse.contains("0.68 mm before and 0.75 after") && worse.contains("(-20, 20) mm"), "{worse}");
        let none = Rub { held_out: None, ..found([0.9e-3, 0.2e-3], [3.0, 1.0], &[]) };
        assert!(unfinished(&none, 0.3e-3).unwrap_or_default().contains("too little to tell"));
    }
}
