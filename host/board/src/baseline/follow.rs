//! How a baseline follows what drifts, and stays where it is under load.
//!
//! Frames in which nothing touches are gathered to blocks, in whose mean a touch shows that no frame shows; only then does the baseline go
//! towards them. It does so slowly: drift takes minutes to days, so whatever goes faster than [`FOLLOW_S`] and is too light to be seen
//! in a block does not become part of it. What is too slow for that too is known by its pattern: the baseline follows offsets and even
//! leakage as far as they go, but no more of a contact than may be in it in the first place. After a load it is less sure of what it knows,
//! the longer the less, and learns faster.

use tactomo_physics::rest::RestSum;

use super::classifier::{Change, RestClassifier};
use super::state::LASTING_S;
use crate::baseline::FRAMES;

/// Time in which the baseline goes towards the readings (s): short against drift, long against hands.
const FOLLOW_S: f64 = 60.0;
/// Frames that it is the mean of, at most: their noise is a sixteenth of a frame's, and less than what solvers average to.
const BEHIND: f64 = 256.0;
/// Longest block (s).
const BLOCK_S: f64 = 1.0;
/// Drift that is expected without a look at the detector at rest (codes in a second): 3 codes in an hour, as while a board grows warm.
const DRIFT_CODES_PER_S: f64 = 3.0 / 3600.0;
/// Frames in a row that read less than at rest before the baseline is taken anew.
const LESS: u32 = 8;

/// What follows a baseline.
#[derive(Clone, Debug, Default)]
pub(super) struct Following {
    /// Mean readings when the baseline was taken (V).
    taken_v: Vec<f64>,
    /// Frames that it is worth by now.
    worth: f64,
    block: RestSum,
    /// When the block began, when the detector was last at rest, and since when it is touched (s).
    begun_s: f64,
    rest_s: f64,
    touched_s: Option<f64>,
    less: u32,
}

/// What comes of a frame.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Seen {
    /// Nothing new.
    Nothing,
    /// The detector is at rest, and these are its mean readings (V), worth so many frames.
    Rest { mean_v: Vec<f64>, frames: f64 },
    /// What was on the detector when the baseline was taken is gone.
    Less,
    /// The mean readings have come to look like a touch at x and y (m).
    Drifted([f64; 2]),
    /// A touch lasts.
    Lasting,
}

impl Following {
    /// From a baseline (V) that was taken at a time (s) from so many frames.
    pub fn from(taken_v: Vec<f64>, frames: u32, time_s: f64) -> Self {
        Self { taken_v, worth: f64::from(frames), begun_s: time_s, rest_s: time_s, ..Self::default() }
    }

    /// Looks at the mean of some frames (V) at a time (s); `rest_v` is the baseline.
    pub fn see(
        &mut self,
        classifier: &RestClassifier,
        rest_v: &[f64],
        readings_v: &[f64],
        frames: u32,
        time_s: f64,
    ) -> Seen {
        // A recording that is played again goes back in time.
        let away_s = (time_s - self.rest_s).max(0.0);
        let change = classifier.change(&less(readings_v, rest_v), frames, away_s);
        self.less = if change == Change::Less { self.less + frames } else { 0 };
        match change {
            Change::Touch => self.touch(time_s),
            Change::Less => {
                self.block = RestSum::default();
                if self.less < LESS { Seen::Nothing } else { Seen::Less }
            }
            Change::Rest => {
                if self.block.frames() == 0 {
                    self.begun_s = time_s;
                }
                self.block.add(readings_v, frames);
                // What is hardly known need not be looked at for long.
                let enough = self.worth_after(classifier, away_s).min(f64::from(FRAMES));
                let is_whole = f64::from(self.block.frames()) >= enough || (time_s - self.begun_s).abs() >= BLOCK_S;
                if is_whole { self.settle(classifier, rest_v, time_s) } else { Seen::Nothing }
            }
        }
    }

    /// Something touches: the block is none of rest.
    fn touch(&mut self, time_s: f64) -> Seen {
        self.block = RestSum::default();
        let since_s = *self.touched_s.get_or_insert(time_s);
        if time_s < since_s {
            self.touched_s = Some(time_s);
        }
        if time_s - since_s > LASTING_S { Seen::Lasting } else { Seen::Nothing }
    }

    /// A whole block: the baseline goes towards its mean unless that shows a touch.
    fn settle(&mut self, classifier: &RestClassifier, rest_v: &[f64], time_s: f64) -> Seen {
        let block = std::mem::take(&mut self.block);
        let (block_v, frames) = (block.mean_v(), f64::from(block.frames()));
        let change_v = less(&block_v, rest_v);
        let away_s = (time_s - self.rest_s).max(0.0);
        match classifier.change(&change_v, block.frames(), away_s) {
            Change::Touch => return self.touch(time_s),
            // Single frames decide.
            Change::Less => return Seen::Nothing,
            Change::Rest => {}
        }
        let share = self.share(classifier, frames, away_s);
        let mean_v: Vec<f64> = rest_v.iter().zip(&change_v).map(|(rest, change)| rest + share * change).collect();
        (self.rest_s, self.touched_s) = (time_s, None);
        if let Some(place_m) = classifier.drifted(&less(&mean_v, &self.taken_v)) {
            return Seen::Drifted(place_m);
        }
        Seen::Rest { mean_v, frames: self.worth }
    }

    /// How far the baseline goes towards the mean of so many frames, which it has not seen for `away_s` (s).
    fn share(&mut self, classifier: &RestClassifier, frames: f64, away_s: f64) -> f64 {
        self.worth = self.worth_after(classifier, away_s);
        let by_frames = frames / (self.worth + frames);
        let is_sure = self.worth + frames > BEHIND;
        self.worth = (self.worth + frames).min(BEHIND);
        if is_sure { by_frames.min(away_s / FOLLOW_S) } else { by_frames }
    }

    /// Frames that the baseline is worth after so long without a look at the detector at rest (s).
    fn worth_after(&self, classifier: &RestClassifier, away_s: f64) -> f64 {
        let adc = &classifier.detector().adc;
        let drift = DRIFT_CODES_PER_S * away_s * adc.lsb_v() / adc.deviation_v();
        1.0 / (1.0 / self.worth + drift * drift)
    }
}

/// Differences (V).
fn less(a: &[f64], b: &[f64]) -> Vec<f64> {
    a.iter().zip(b).map(|(a, b)| a - b).collect()
}
