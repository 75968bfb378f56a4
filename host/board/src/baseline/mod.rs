//! The readings with nothing on the detector, which are taken off all others.
//!
//! Without contact an ideal detector reads 0 V everywhere; a real one has offsets of its converter and perhaps leakage, and both drift. A
//! baseline is taken at the start, follows what drifts while nothing touches, and never learns a touch: what looks like a contact is told
//! from offsets and leakage by its pattern ([`RestPatterns`](tactomo_physics::rest::RestPatterns)), in each frame and in the mean of many.
//! Under load it stays as it was. What it cannot decide, a person is asked ([`BaselineState::notice`]). Live, of recordings and of tables it
//! is the same; where a person has said which frames are the baseline ([`Baseline::told`]), it is neither judged nor followed.

mod classifier;
mod follow;
mod rest_rounds;
mod state;
#[cfg(test)]
mod tests;

use std::sync::Arc;

use self::classifier::{Absolute, RestClassifier};
use self::follow::Following;
use self::rest_rounds::RestRounds;
pub use self::state::{BaselineState, LASTING_S};
use tactomo_physics::forward::jacobian::Jacobian;
use tactomo_physics::readings::Readings;
use tactomo_physics::rest::{Rest, RestSum};

/// Frames that are averaged: the noise of their mean is a sixth of a frame's.
pub const FRAMES: u32 = 32;

/// Leakage that is looked at under load (sheet conductances): ten times less than costs anything.
const LEAKAGE: f64 = 5e-4;

/// Readings of a detector that nothing touches.
#[derive(Clone, Debug)]
pub struct Baseline {
    rest: Rest,
    /// Leakage in it (sheet conductances).
    leakage_sheets: f64,
    taking: Option<Taking>,
    state: BaselineState,
    /// Whether it was ever taken.
    held: bool,
    /// Rows that have come since all were read.
    rounds: RestRounds,
    /// What knows and follows the detector; nothing where there is none.
    known: Option<Known>,
}

/// A detector whose baseline is taken.
#[derive(Clone, Debug)]
struct Known {
    classifier: RestClassifier,
    /// Conversions that a reading is the mean of.
    conversions: u32,
    following: Following,
    /// Whether a person has said which frames the baseline is.
    is_told: bool,
}

/// A baseline that is being taken.
#[derive(Clone, Debug)]
struct Taking {
    sum: RestSum,
    /// Frames that it is taken from.
    frames: u32,
    /// Whether a person asked for it.
    asked: bool,
}

impl Taking {
    fn new(frames: u32, asked: bool) -> Self {
        Self { sum: RestSum::default(), frames, asked }
    }
}

impl Baseline {
    /// That of a detector as measured, whose readings are means of so many conversions each. It is zero until the first frames that nothing
    /// presses in.
    pub fn new(jacobian: Arc<Jacobian>, conversions: u32) -> Self {
        Self::of(jacobian, conversions, FRAMES, false)
    }

    /// The mean of the first `frames` frames of a detector as measured, whatever they are, because a person says so; of none it stays zero.
    /// What the converter cuts off, and what leakage does under load, is known of it as of any other.
    pub fn told(jacobian: Arc<Jacobian>, conversions: u32, frames: u32) -> Self {
        Self::of(jacobian, conversions, frames, true)
    }

    fn of(jacobian: Arc<Jacobian>, conversions: u32, frames: u32, is_told: bool) -> Self {
        let readings = jacobian.electrodes().pow(2);
        let known =
            Known { classifier: RestClassifier::new(jacobian), conversions, following: Following::default(), is_told };
        Self { known: Some(known), ..Self::over(frames, readings) }
    }

    /// The mean of so many frames of `count` readings of whatever that is; of none it stays zero.
    pub fn over(frames: u32, count: usize) -> Self {
        let held = frames == 0;
        Self {
            rest: Rest::zero(count),
            leakage_sheets: 0.0,
            taking: (!held).then(|| Taking::new(frames, false)),
            state: if held { BaselineState::Held } else { BaselineState::Starting },
            held,
            rounds: RestRounds::default(),
            known: None,
        }
    }

    /// Takes it anew from the frames to come, because a person says that nothing presses; until then the old one holds.
    pub fn renew(&mut self) {
        self.taking = Some(Taking::new(FRAMES, true));
        self.state = BaselineState::Renewing;
    }

    /// Says that readings are means of so many conversions from now on.
    pub fn set_conversions(&mut self, conversions: u32) {
        if let Some(known) = &mut self.known {
            known.conversions = conversions;
        }
    }

    /// How it stands.
    pub fn state(&self) -> BaselineState {
        self.state
    }

    /// Leakage in it (sheet conductances).
    pub fn leakage_sheets(&self) -> f64 {
        self.leakage_sheets
    }

    /// Takes the mean `readings_v` of `frames` frames at a time of the board (s) into account; whether the state has changed.
    /// Readings of the electrodes `left_out` say nothing.
    pub fn add(&mut self, readings_v: &[f64], frames: u32, time_s: f64, left_out: &[usize]) -> bool {
        let is_whole = readings_v.len() == self.rest.mean_v().len() && readings_v.iter().all(|volts| volts.is_finite());
        if frames == 0 || !is_whole {
            return false;
        }
        let before = self.state;
        if let Some(known) = &mut self.known {
            known.classifier.leave_out(left_out);
        }
        match self.taking.take() {
            Some(taking) => self.take(taking, readings_v, frames, time_s),
            None => self.follow(readings_v, frames, time_s),
        }
        self.state != before
    }

    /// Takes rows into account, the others of which say nothing: as a frame, once all were read. Whether the state has changed, and the
    /// frame if there is one.
    pub fn add_rows(&mut self, rows: &Readings, time_s: f64, left_out: &[usize]) -> (bool, Option<Readings>) {
        let Some(round) = self.rounds.add(rows, self.rest.mean_v(), time_s) else { return (false, None) };
        (self.add(&round.touches_v(), 1, time_s, left_out), Some(round))
    }

    /// Whether the last of such frames differs from the one before by no more than noise of that deviation (V).
    pub fn is_still(&self, noise_v: f64) -> bool {
        self.rounds.is_still(noise_v)
    }

    /// One step of taking it.
    fn take(&mut self, mut taking: Taking, readings_v: &[f64], frames: u32, time_s: f64) {
        let asked = taking.asked;
        let judged = |readings_v: &[f64], frames: u32| match &self.known {
            Some(known) if !known.is_told => known.classifier.absolute(readings_v, frames, asked),
            _ => Absolute::Rest,
        };
        // A press that begins in the last of the frames hardly shows in their mean.
        if let Absolute::Pressed(largest_v) = judged(readings_v, frames) {
            return self.refuse(asked, largest_v);
        }
        taking.sum.add(readings_v, frames.min(taking.frames - taking.sum.frames()));
        if taking.sum.frames() < taking.frames {
            self.taking = Some(taking);
            return;
        }
        match judged(&taking.sum.mean_v(), taking.frames) {
            Absolute::Pressed(largest_v) => self.refuse(asked, largest_v),
            Absolute::Doubtful(place_m) => self.hold(&taking.sum, time_s, BaselineState::Doubtful(place_m)),
            Absolute::Rest => self.hold(&taking.sum, time_s, BaselineState::Held),
        }
    }

    fn hold(&mut self, sum: &RestSum, time_s: f64, state: BaselineState) {
        (self.state, self.held) = (state, true);
        match &mut self.known {
            Some(Known { classifier, conversions, following, is_told }) => {
                self.rest = sum.rest(&classifier.detector().adc, classifier.detector().ground_v, *conversions);
                // Of frames that a person has called rest although something presses in them, nothing but the mean is known.
                let presses = || matches!(classifier.absolute(&sum.mean_v(), sum.frames(), true), Absolute::Pressed(_));
                let is_rest = !*is_told || !presses();
                self.leakage_sheets = if is_rest { classifier.leakage_sheets(self.rest.offset_v()) } else { 0.0 };
                *following = Following::from(self.rest.mean_v().to_vec(), sum.frames(), time_s);
            }
            None => self.rest.set(sum.mean_v(), f64::from(sum.frames())),
        }
    }

    /// Something presses, with readings up to this (V).
    fn refuse(&mut self, asked: bool, largest_v: f64) {
        if asked {
            self.state = BaselineState::Refused(largest_v);
        } else if self.state == BaselineState::Starting {
            self.state = BaselineState::Pressed(largest_v);
        }
        if !self.held {
            // The press may end: the next frames are looked at too.
            self.taking = Some(Taking::new(FRAMES, false));
        }
    }

    /// Follows what drifts while nothing touches.
    fn follow(&mut self, readings_v: &[f64], frames: u32, time_s: f64) {
        let Some(Known { classifier, conversions, following, is_told: false }) = &mut self.known else { return };
        let seen = following.see(classifier, self.rest.mean_v(), readings_v, frames, time_s);
        match seen {
            follow::Seen::Nothing => {}
            follow::Seen::Lasting => self.state = BaselineState::Lasting,
            follow::Seen::Drifted(place_m) => self.state = BaselineState::Drifted(place_m),
            follow::Seen::Less => self.taking = Some(Taking::new(FRAMES, false)),
            follow::Seen::Rest { mean_v, frames } => {
                self.rest.set(mean_v, frames * f64::from(*conversions));
                self.leakage_sheets = classifier.leakage_sheets(self.rest.offset_v());
                if !matches!(self.state, BaselineState::Doubtful(_)) {
                    self.state = BaselineState::Held;
                }
            }
        }
    }

    /// Puts `readings_v` less the baseline into `touch_v` (V): less what the detector reads at rest, and what leakage does under the touch
    /// otherwise. While the first baseline is taken, it is the mean of what has come of it.
    pub fn subtract(&self, readings_v: &[f64], touch_v: &mut [f64]) {
        let first = self.taking.as_ref().filter(|taking| !self.held && taking.sum.frames() > 0 && self.known.is_some());
        if let Some(first) = first {
            let pairs = readings_v.iter().zip(first.sum.mean_v());
            touch_v.iter_mut().zip(pairs).for_each(|(touch, (volts, rest))| *touch = volts - rest);
            return;
        }
        self.rest.subtract(readings_v, touch_v);
        if let Some(known) = self.known.as_ref().filter(|_| self.leakage_sheets > LEAKAGE) {
            known.classifier.leakage().take_off(touch_v, self.leakage_sheets);
        }
    }
}
