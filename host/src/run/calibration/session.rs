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
use super::guide::Guide;
use super::messages::{Calibrate, Fitted, Outcome};
use super::worth::{Compared, OTHER, WORTH, why_keep};
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
/// Frames of rows without a whole one between them from which on the board's plan has none: an adaptive plan of 32 electrodes has one in every 64.
const NEVER_WHOLE: u64 = 500;
/// Time between two pictures of how it is: a person sees that at once.
const SHOWN_EVERY: Duration = Duration::from_millis(80);

/// A calibration under way, in the follower.
pub(super) struct RubSession {
    /// Tells what comes of this one from what comes of others before.
    pub number: u64,
    inbox: Arc<Inbox>,
    notice: Arc<NoticeBoard>,
    folder: PathBuf,
    /// The detector that fits begin from, as the board measures it.
    pub description: Arc<Detector>,
    /// Cells that have to have frames before the next fit that nobody asks for; `None` if there is to be none.
    learns_from: Option<usize>,
    /// The detector that was found before and is in use, if one is.
    used: Option<Arc<Detector>>,
    /// Whether a fit has said that presses of this session fit the detector in use.
    is_same: bool,
    collected: Collected,
    guide: Guide,
    rounds: Rounds,
    shown: Calibrating,
    cancelled: Arc<AtomicBool>,
    next_fit: Instant,
    fitted_frames: u64,
    showed: Option<Instant>,
    /// Whether a person wants the end now, whatever comes of it.
    is_asked_to_finish: bool,
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
            target: None,
            touched: 0,
            fitting: false,
            errors_m: Vec::new(),
            fit: None,
            compared: None,
            keep: None,
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
            guide: Guide::default(),
            rounds: Rounds::default(),
            shown,
            cancelled: Arc::default(),
            next_fit: Instant::now(),
            fitted_frames: 0,
            showed: None,
            is_asked_to_finish: false,
        }
    }

    /// Does what a person asks, but for what is the follower's.
    pub fn ask(&mut self, ask: Calibrate) {
        self.showed = None;
        match (ask, self.shown.stage) {
            (Calibrate::End, _) => self.shown.stage = Stage::Learning,
            (Calibrate::Begin, Stage::Learning | Stage::Done) => {
                (self.shown.stage, self.shown.trouble, self.shown.keep) = (Stage::Rubbing, None, None);
            }
            (Calibrate::Finish, Stage::Rubbing) => {
                self.is_asked_to_finish = true;
                self.finish();
            }
            (Calibrate::Save, Stage::Done) if self.shown.keep.is_none() => self.save(),
            _ => {}
        }
    }

    /// What a person has found, to go on with, if there is something and it is better than what is in use.
    pub fn use_found(&mut self) -> Option<Arc<Rub>> {
        let is_better = self.shown.stage == Stage::Done && self.shown.keep.is_none();
        let fit = self.shown.fit.as_ref().filter(|_| is_better)?;
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
        let is_rubbing = self.shown.stage == Stage::Rubbing;
        self.shown.target =
            if is_rubbing { self.guide.target(&self.collected.coverage, self.collected.touched) } else { None };
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
            (self.shown.stage, self.is_asked_to_finish) = (Stage::Rubbing, false);
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
                let compared = Compared::of(&fit, self.used.as_deref());
                let keep = is_last.then(|| why_keep(&fit, compared, least_m)).flatten();
                self.shown.errors_m.push(error_m);
                (self.shown.fit, self.shown.compared) = (Some(Arc::new(fit)), compared);
                (self.shown.trouble, self.shown.saved, self.shown.used) = (None, None, false);
                let is_covered = self.collected.coverage.share() >= WHOLE;
                match self.shown.stage {
                    Stage::Finishing if is_last => self.finished(keep),
                    Stage::Rubbing if is_settled && is_covered => self.finish(),
                    _ => {}
                }
            }
        }
        if is_asked {
            self.fit(true);
        }
    }

    /// All is fitted. Where nobody has asked for the end, and what was found is not better, the guide goes on for what is missing.
    fn finished(&mut self, keep: Option<String>) {
        let is_asked = std::mem::take(&mut self.is_asked_to_finish);
        if keep.is_none() || is_asked {
            (self.shown.stage, self.shown.keep) = (Stage::Done, keep);
        } else {
            (self.shown.stage, self.shown.trouble) = (Stage::Rubbing, keep);
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

#[cfg(test)]
mod tests {
    use super::super::worth::tests::found;
    use super::*;
    use tactomo_physics::detector::Calibration;

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
            learning.shown.fit = Some(Arc::new(found(place_errors_m, residuals, None, &[])));
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
            let found = found([0.9e-3, 0.2e-3], [9.0, 1.0], None, &[]);
            learning.shown.fit = Some(Arc::new(Rub { held_out: Some(held_out), ..found }));
            learning.learned().is_some()
        };
        assert!(!is_taken(1.1), "the detector in use fits, and tells places better");
        assert!(is_taken(2.5));
        assert!(!keeps(&mut learning, 2), "it is known by now");
    }

    #[test]
    fn only_what_is_better_can_be_used_and_a_person_who_asks_for_the_end_is_told_why() {
        let ends_with = |residuals, is_asked: bool| {
            let mut session = session(false);
            session.ask(Calibrate::Begin);
            (session.shown.stage, session.is_asked_to_finish) = (Stage::Finishing, is_asked);
            let fit = Ok(found([0.9e-3, 0.2e-3], residuals, None, &[]));
            session.receive(Outcome::Fitted(Box::new(Fitted { is_last: true, fit, took: Duration::ZERO })));
            let is_usable = session.use_found().is_some();
            (session.shown.stage, session.shown.keep.is_some(), session.shown.trouble.is_some(), is_usable)
        };
        assert_eq!(ends_with([3.0, 1.0], true), (Stage::Done, false, false, true));
        assert_eq!(ends_with([3.0, 1.0], false), (Stage::Done, false, false, true));
        assert_eq!(ends_with([1.0, 1.5], true), (Stage::Done, true, false, false), "worse, and says to keep the other");
        assert_eq!(ends_with([1.0, 1.5], false), (Stage::Rubbing, false, true, false), "it goes on");
    }
}
