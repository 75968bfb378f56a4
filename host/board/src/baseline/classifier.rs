//! Whether readings are those of a detector that nothing touches.

use std::sync::Arc;

use tactomo_physics::detector::Detector;
use tactomo_physics::forward::jacobian::Jacobian;
use tactomo_physics::rest::{Leakage, RestChange, RestPatterns};

/// Deviations of its noise that a pattern has to stand out by. It is the largest of some hundred places, in 15 independent directions: 500
/// frames of noise stay below 5, and 6 is beyond the deviation in all of them in 1 of 600 frames at most.
const DEVIATIONS: f64 = 6.0;
/// Noise that is never undercut (codes), however many frames are averaged: steps of a converter are not quite even.
const UNEVEN_CODES: f64 = 0.15;
/// Scatter (codes) that may come on top of noise before it no longer excuses a pattern.
const SCATTER_CODES: f64 = 1.0;
/// How much more than the expected noise is taken for noise.
const NOISIER: f64 = 4.0;
/// Conductance of an even touch (sheet conductances) that may be drift of leakage, and by how much more in a second without a look at the
/// detector at rest: leakage of 0.05 that changes by 20 % in a day.
const EVEN: f64 = 1e-3;
const EVEN_PER_S: f64 = 0.05 * 0.2 / 86_400.0;

/// Channel offset that may be in a baseline (V) is this many codes: data sheets of simple converters give 2 to 4; or this share of the drive.
const OFFSET_CODES: f64 = 4.0;
const OFFSET_SHARE: f64 = 0.005;
/// Leakage that may be in a baseline (sheet conductances), by itself, and when a person says that nothing presses.
const LEAKAGE: [f64; 2] = [0.06, 0.1];
/// Conductance of a contact that may be in a baseline (sheet conductances), and as a share of leakage, which is never quite even: leakage that
/// varies by 30 % looks like contacts of 13 to 26 % of it. The lightest contacts that solvers find well are ten times as large.
const CONTACT: f64 = 0.003;
const CONTACT_SHARE: f64 = 0.3;
/// Share of the readings by leakage that its pattern may be wrong by: that of a detector with a builder's tolerances is by up to 15 %.
const UNLIKE: f64 = 0.2;
/// Share of the drive above which something presses, whatever a person says.
const PRESSED: f64 = 0.05;

/// Knows what a detector reads when nothing touches it.
#[derive(Clone, Debug)]
pub(super) struct RestClassifier {
    jacobian: Arc<Jacobian>,
    patterns: RestPatterns,
    leakage: Leakage,
    left_out: Vec<usize>,
}

/// What a change of readings is, of readings that were those of rest.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Change {
    /// Drift, or nothing.
    Rest,
    /// Something touches.
    Touch,
    /// Less is on the detector than was at rest.
    Less,
}

/// What readings are that nothing is known of.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Absolute {
    /// Those of rest.
    Rest,
    /// They may be, but look like a light touch at x and y (m).
    Doubtful([f64; 2]),
    /// Something presses, with readings up to this (V).
    Pressed(f64),
}

impl RestClassifier {
    pub fn new(jacobian: Arc<Jacobian>) -> Self {
        let all: Vec<usize> = (0..jacobian.electrodes()).collect();
        let (patterns, leakage) = (RestPatterns::new(&jacobian, &all), Leakage::new(&jacobian, &all));
        Self { jacobian, patterns, leakage, left_out: Vec::new() }
    }

    pub fn detector(&self) -> &Detector {
        &self.jacobian.detector
    }

    /// Looks at the other electrodes only.
    pub fn leave_out(&mut self, left_out: &[usize]) {
        if self.left_out != left_out {
            self.left_out = left_out.to_vec();
            let kept: Vec<usize> = (0..self.jacobian.electrodes()).filter(|e| !left_out.contains(e)).collect();
            self.patterns = RestPatterns::new(&self.jacobian, &kept);
            self.leakage = Leakage::new(&self.jacobian, &kept);
        }
    }

    /// What leakage does under a touch.
    pub fn leakage(&self) -> &Leakage {
        &self.leakage
    }

    /// Leakage in readings at rest (V), in sheet conductances.
    pub fn leakage_sheets(&self, rest_v: &[f64]) -> f64 {
        self.leakage.at_rest(&self.patterns, rest_v)
    }

    /// What a change of the mean of some frames (V) is, `away_s` seconds after the detector was last seen at rest.
    pub fn change(&self, change_v: &[f64], frames: u32, away_s: f64) -> Change {
        let found = self.patterns.explain(change_v);
        let limit_v = self.limit_v(&found, frames);
        let even = EVEN + EVEN_PER_S * away_s;
        if found.total_v < -limit_v && found.total_sheets < -even {
            return Change::Less;
        }
        let is_touch = found.contact_v > limit_v || found.total_v > limit_v && found.total_sheets > even;
        if is_touch { Change::Touch } else { Change::Rest }
    }

    /// Where readings at rest have come to look like a light touch, x and y (m).
    pub fn drifted(&self, change_v: &[f64]) -> Option<[f64; 2]> {
        let found = self.patterns.explain(change_v);
        let limit_v = DEVIATIONS * SCATTER_CODES * self.detector().adc.lsb_v();
        (found.contact_sheets > CONTACT && found.contact_v > limit_v).then_some([found.place_m[0], found.place_m[1]])
    }

    /// What the mean of some frames (V) is; `asked` if a person says that nothing presses.
    pub fn absolute(&self, readings_v: &[f64], frames: u32, asked: bool) -> Absolute {
        let found = self.patterns.explain(readings_v);
        let leakage_sheets = found.leakage_sheets.max(0.0);
        let [offset_v, left_v] = self.patterns.largest_v(readings_v, leakage_sheets);
        let Detector { drive_v, adc, .. } = self.detector();
        let by_itself_v = (OFFSET_CODES * adc.lsb_v()).max(OFFSET_SHARE * drive_v);
        let most_v = if asked { by_itself_v.max(PRESSED * drive_v) } else { by_itself_v };
        let unlike_v = UNLIKE * leakage_sheets * self.patterns.leakage_v().iter().copied().fold(0.0, f64::max);
        let noise_v = DEVIATIONS * adc.deviation_v() / f64::from(frames.max(1)).sqrt();
        // No leakage is below zero.
        let is_contact = found.contact_v > self.limit_v(&found, frames)
            && found.contact_sheets.min(found.total_sheets) > CONTACT.max(CONTACT_SHARE * leakage_sheets);
        let is_pressed = offset_v > most_v + unlike_v
            || left_v > most_v + unlike_v + noise_v
            || leakage_sheets > LEAKAGE[usize::from(asked)]
            || is_contact && !asked;
        match (is_pressed, is_contact) {
            (true, _) => Absolute::Pressed(self.largest_v(readings_v)),
            (false, true) => Absolute::Doubtful([found.place_m[0], found.place_m[1]]),
            (false, false) => Absolute::Rest,
        }
    }

    /// What a pattern has to exceed in the mean of some frames (V).
    fn limit_v(&self, found: &RestChange, frames: u32) -> f64 {
        let adc = &self.detector().adc;
        let noise_v = (adc.deviation_v() / f64::from(frames.max(1)).sqrt()).max(UNEVEN_CODES * adc.lsb_v());
        DEVIATIONS * found.scatter_v.clamp(noise_v, NOISIER * noise_v + SCATTER_CODES * adc.lsb_v())
    }

    /// Largest of readings (V) but for those of electrodes that are left out.
    fn largest_v(&self, readings_v: &[f64]) -> f64 {
        let electrodes = self.jacobian.electrodes();
        let kept = self.patterns.kept();
        let pairs = kept.iter().flat_map(|g| kept.iter().map(move |e| g * electrodes + e));
        pairs.map(|index| readings_v[index].abs()).fold(0.0, f64::max)
    }
}
