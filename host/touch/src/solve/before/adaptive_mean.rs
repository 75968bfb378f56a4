//! The mean of frames of a scene that stands still, over a window that adapts: change detection ends it where the scene moves.
//!
//! The mean of `m` still frames has the noise of one over the root of `m`. If a contact moves slowly, that mean lags behind it by `m / 2`
//! frames, and no test on those `m` frames can tell before the lag is several standard errors: the difference of two halves has the
//! deviation `2 s / sqrt(m)`, the lag matters from `s / sqrt(m)` on. Over `n` frames a constant velocity stands out by `n^(3/2)`. So
//! only the newest [`AVERAGED`]th of the frames that look still are averaged: what is not seen to move over all of them has moved by a
//! small part of a standard error over these.
//!
//! The newest 1, 2, 4, ... frames are compared with those before them (Basseville and Nikiforov, Detection of abrupt changes, 1993;
//! windows of powers of two as in Bifet and Gavalda, Learning from time-changing data with adaptive windowing, 2007): over all
//! readings, which finds a contact that comes or goes, and along the derivatives of the readings by the place and by the strength of
//! each contact that is known, which finds much less. Where they differ, the frames before are forgotten.

mod moves;

use std::collections::VecDeque;
use std::f64::consts::PI;

use self::moves::Moves;
use crate::solve::fit::policy;
use tactomo_physics::detector::Adc;
use tactomo_physics::readings::{Readings, Says};

/// Frames that are looked at, at most: a fifth of a second of 1200 frames/s.
pub(crate) const MOST_FRAMES: usize = 256;
/// One in so many of the frames that look still is averaged.
const AVERAGED: usize = 5;
/// First frames that are all averaged, as long as nothing has moved since the beginning.
const FIRST_FRAMES: usize = 16;
/// Terms of the series of the error by rounding: they leave out less than 1 %.
const TERMS: u32 = 50;

/// The mean of the newest frames of a scene.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Mean {
    /// Readings (V).
    pub readings: Readings,
    /// How many frames it is the mean of.
    pub frames: usize,
}

/// Averages frames as long as they differ by no more than noise.
#[derive(Clone, Debug)]
pub struct AdaptiveMean {
    /// Standard deviation of a reading (V).
    noise_v: f64,
    /// Sums of the readings up to each frame that is remembered, the oldest first, after what they begin with (V).
    sums_v: VecDeque<Vec<f64>>,
    newest_v: Vec<f64>,
    /// What each reading of the mean says: what that of any frame does that is no voltage. Empty where all are voltages.
    says: Vec<Says>,
    newest_says: Vec<Says>,
    /// Whether anything has moved since the beginning.
    has_moved: bool,
}

/// How two means differ, in what noise makes of them.
struct Difference {
    /// Standard deviations by which the mean square is too large.
    overall: f64,
    /// Largest square of the Mahalanobis length of what two parameters of a contact have changed by.
    of_contacts: f64,
}

impl Mean {
    /// A single frame.
    pub fn of_frame(readings: &Readings) -> Self {
        Self { readings: readings.clone(), frames: 1 }
    }
}

impl AdaptiveMean {
    /// Begins with nothing; `noise_v` is the standard deviation of a reading (V).
    pub fn new(noise_v: f64) -> Self {
        let noise_v = noise_v.max(f64::MIN_POSITIVE.sqrt());
        Self {
            noise_v,
            sums_v: VecDeque::new(),
            newest_v: Vec::new(),
            says: Vec::new(),
            newest_says: Vec::new(),
            has_moved: false,
        }
    }

    /// Adds a frame's readings, unless they are the very same as those before: noise never repeats itself in all of them, so that they are the
    /// same observation, and tell no more than once.
    pub fn add(&mut self, readings: &Readings) {
        self.add_beside(readings, &[]);
    }

    /// Adds a frame's readings, unless they are the very same as those before; `slopes_v` are the readings' derivatives by the parameters of
    /// contacts that are known, in pairs that belong together (V).
    pub(crate) fn add_beside(&mut self, readings: &Readings, slopes_v: &[Vec<f64>]) {
        if self.newest_v == readings.volts() && self.newest_says == readings.all_say() {
            return;
        }
        if self.newest_v.len() != readings.volts().len() {
            self.reset();
        }
        self.push(readings.volts());
        self.merge(readings.all_say());
        if self.frames() > 1 {
            let moves = Moves::new(slopes_v, self.noise_v);
            self.forget_what_differs(moves.as_ref());
        }
    }

    /// Frames that are averaged.
    pub fn count(&self) -> usize {
        let all = self.frames();
        let at_first = if self.has_moved { 1 } else { FIRST_FRAMES };
        (all / AVERAGED).max(all.min(at_first))
    }

    /// A reading that is a bound in one frame is one in the mean.
    fn merge(&mut self, says: &[Says]) {
        self.newest_says.clear();
        self.newest_says.extend_from_slice(says);
        if self.says.is_empty() || self.frames() == 1 {
            self.says.clone_from(&self.newest_says);
            return;
        }
        let changed = self.says.iter_mut().zip(says).filter(|(_, says)| **says != Says::Voltage);
        changed.for_each(|(ours, theirs)| *ours = *theirs);
    }

    /// Their mean (V), once there is a frame.
    fn mean_v(&self) -> Vec<f64> {
        match self.count() {
            0 | 1 => self.newest_v.clone(),
            count => self.mean_between(self.frames() - count, self.frames()),
        }
    }

    /// Their mean, once there is a frame.
    pub fn mean_readings(&self) -> Option<Readings> {
        let n = self.newest_v.len().isqrt();
        let readings = Readings::new(n, self.mean_v()).filter(|_| self.frames() > 0)?;
        Some(if self.says.is_empty() { readings } else { readings.saying(|g, e| self.says[g * n + e]) })
    }

    /// The mean of the newest frames with their number, once there is a frame.
    pub(crate) fn mean(&self) -> Option<Mean> {
        self.mean_readings().map(|readings| Mean { readings, frames: self.count() })
    }

    /// The mean of the newest frames with their number, or else a single frame.
    pub(crate) fn mean_or(&self, readings: &Readings) -> Mean {
        self.mean().unwrap_or_else(|| Mean::of_frame(readings))
    }

    /// Forgets all frames.
    pub fn reset(&mut self) {
        *self = Self::new(self.noise_v);
    }

    /// Frames that are remembered.
    fn frames(&self) -> usize {
        self.sums_v.len().saturating_sub(1)
    }

    fn push(&mut self, volts: &[f64]) {
        let zeros = || vec![0.0; volts.len()];
        // After a month of frames the sums are 10^9 V at most, which are right to less than a microvolt.
        let mut sums_v = match self.frames() {
            MOST_FRAMES => self.sums_v.pop_front().unwrap_or_default(),
            _ => zeros(),
        };
        if self.sums_v.is_empty() {
            self.sums_v.push_back(zeros());
        }
        let before = &self.sums_v[self.sums_v.len() - 1];
        sums_v.iter_mut().zip(before).zip(volts).for_each(|((sum, before), volts)| *sum = before + volts);
        self.sums_v.push_back(sums_v);
        self.newest_v.clear();
        self.newest_v.extend_from_slice(volts);
    }

    /// Mean of the frames from one to before another (V).
    fn mean_between(&self, from: usize, to: usize) -> Vec<f64> {
        let share = 1.0 / (to - from) as f64;
        self.sums_v[to].iter().zip(&self.sums_v[from]).map(|(to, from)| share * (to - from)).collect()
    }

    fn forget_what_differs(&mut self, moves: Option<&Moves<'_>>) {
        let all = self.frames();
        for newest in windows(all) {
            let difference = self.difference(newest, moves);
            let alarm = -2.0 * (policy::FALSE_ALARMS * newest as f64).ln();
            // A reading that is no voltage of a board makes sums that nothing can be concluded from.
            if difference.overall.is_nan()
                || difference.overall > policy::MISFIT_DEVIATIONS
                || difference.of_contacts > alarm
            {
                self.begin_with_newest(newest);
                return;
            }
            self.has_moved |= difference.of_contacts > -2.0 * policy::FALSE_DOUBTS.ln() && newest == all / 2;
        }
    }

    /// Forgets all but so many of the newest frames, and what their sums began with: that may be far larger than they are.
    fn begin_with_newest(&mut self, newest: usize) {
        self.has_moved = true;
        self.says.clone_from(&self.newest_says);
        self.sums_v.drain(..self.frames() - newest);
        if newest == 1 {
            self.sums_v = VecDeque::from([vec![0.0; self.newest_v.len()], self.newest_v.clone()]);
            return;
        }
        let begun_with = self.sums_v[0].clone();
        for sums_v in &mut self.sums_v {
            sums_v.iter_mut().zip(&begun_with).for_each(|(sum, begun)| *sum -= begun);
        }
    }

    /// How the mean of the newest frames differs from that of those before.
    fn difference(&self, newest: usize, moves: Option<&Moves<'_>>) -> Difference {
        let all = self.frames();
        let (before_v, mut change_v) = (self.mean_between(0, all - newest), self.mean_between(all - newest, all));
        let scale = (1.0 / newest as f64 + 1.0 / (all - newest) as f64).sqrt().recip();
        change_v.iter_mut().zip(&before_v).for_each(|(change, before)| *change = scale * (*change - before));
        // What stays beyond the converter's range has no noise.
        let bounds = self.says.iter().filter(|says| **says != Says::Voltage).count();
        let squares = change_v.iter().map(|change| change * change).sum::<f64>() / (self.noise_v * self.noise_v);
        let readings = (change_v.len() - bounds).max(1) as f64;
        Difference {
            overall: (squares - readings) / (2.0 * readings).sqrt(),
            of_contacts: moves.map_or(0.0, |moves| moves.largest(&change_v)),
        }
    }
}

/// Counts of newest frames that are compared with those before them: powers of two, and half.
fn windows(frames: usize) -> impl Iterator<Item = usize> {
    let half = (frames / 2).max(1);
    let powers = std::iter::successors(Some(1), |count| Some(2 * count)).take_while(move |count| *count < half);
    powers.chain(std::iter::once(half))
}

/// Standard deviation of what rounding to codes leaves in the mean of any number of readings (V): noise of half a code takes nearly all
/// of it away, none leaves the root of 1/12 (Widrow and Kollar, Quantization noise, 2008: a Fourier series of the mean error, damped by the
/// characteristic function of the noise).
pub(crate) fn rounding_v(adc: &Adc) -> f64 {
    let term = |k: u32| {
        let k = f64::from(k) * PI;
        (-(2.0 * k * adc.noise_lsb).powi(2)).exp() / (2.0 * k * k)
    };
    (1..=TERMS).map(term).sum::<f64>().sqrt() * adc.lsb_v()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::solve::fit::dot::dot;

    const NOISE_V: f64 = 1e-3;
    const READINGS: usize = 256;

    /// Frames of a scene that moves along some derivatives.
    struct MovingScene {
        random: fastrand::Rng,
        slopes_v: Vec<Vec<f64>>,
        average: AdaptiveMean,
    }

    impl MovingScene {
        /// The place of the contact is known to 0.1 by one frame, the strength to 0.01.
        fn new(seed: u64) -> Self {
            let mut random = fastrand::Rng::with_seed(seed);
            let mut slope_v = |deviation: f64| {
                let scale = NOISE_V / deviation / (READINGS as f64 / 12.0).sqrt();
                (0..READINGS).map(|_| scale * (random.f64() - 0.5)).collect::<Vec<_>>()
            };
            let slopes_v = vec![slope_v(0.1), slope_v(0.1), slope_v(0.01), slope_v(1.0)];
            Self { random, slopes_v, average: AdaptiveMean::new(NOISE_V) }
        }

        fn frame(&mut self, moved: f64) -> Readings {
            let noise = |random: &mut fastrand::Rng| (0..12).map(|_| random.f64()).sum::<f64>() - 6.0;
            let volts =
                self.slopes_v[0].iter().map(|slope| 0.5 + moved * slope + NOISE_V * noise(&mut self.random)).collect();
            Readings::new(READINGS.isqrt(), volts).unwrap()
        }

        fn add(&mut self, moved: f64) {
            let volts = self.frame(moved);
            self.average.add_beside(&volts, &self.slopes_v);
        }

        /// Error of the mean along the place, in what noise makes of it.
        fn error(&self, moved: f64) -> f64 {
            let slope = &self.slopes_v[0];
            let truth = slope.iter().map(|slope| 0.5 + moved * slope);
            let left: Vec<_> = self.average.mean_v().iter().zip(truth).map(|(mean, truth)| mean - truth).collect();
            let deviation = NOISE_V * dot(slope, slope).sqrt() / (self.average.count() as f64).sqrt();
            dot(slope, &left) / deviation
        }
    }

    #[test]
    fn still_frames_are_averaged_and_a_move_begins_anew() {
        let mut scene = MovingScene::new(4);
        for count in 1..=16 {
            scene.add(0.0);
            assert_eq!(scene.average.count(), count);
        }
        let error_v = (scene.average.mean_v().iter().map(|volts| (volts - 0.5).powi(2)).sum::<f64>() / 256.0).sqrt();
        assert!((0.85..1.15).contains(&(4.0 * error_v / NOISE_V)), "a quarter of the noise: {error_v}");
        scene.add(2.0);
        assert_eq!(scene.average.count(), 1, "20 standard deviations");
        (0..9).for_each(|_| scene.add(2.0));
        assert_eq!(scene.average.count(), 2, "what has just moved may move on slowly");
    }

    #[test]
    fn a_still_scene_is_seldom_taken_to_move() {
        let mut counts = Vec::new();
        for seed in 0..8 {
            let mut scene = MovingScene::new(seed);
            counts.extend((0..2000).map(|_| {
                scene.add(0.0);
                scene.average.count() as f64
            }));
        }
        let mean = counts.iter().sum::<f64>() / counts.len() as f64;
        assert!(mean > 36.0, "{mean} of 51");
    }

    #[test]
    fn the_mean_does_not_lag_behind_what_moves_slowly() {
        // From one thousandth of what a frame's noise makes of it to ten times that.
        for speed in [1e-3, 3e-3, 1e-2, 3e-2, 0.1, 0.3, 1.0, 10.0].map(|deviations| 0.1 * deviations) {
            let (mut squares, mut inside, mut frames) = (0.0, 0, 0);
            for seed in 0..6 {
                let mut scene = MovingScene::new(seed);
                for frame in 0..1500 {
                    let moved = speed * f64::from(frame);
                    scene.add(moved);
                    let error = scene.error(moved);
                    squares += error * error;
                    inside += u32::from(error.abs() < 1.0);
                    frames += 1;
                }
            }
            let (rms, inside) = ((squares / f64::from(frames)).sqrt(), f64::from(inside) / f64::from(frames));
            assert!(rms < 1.2 && inside > 0.62, "{speed}: {rms} standard deviations, {inside} within one");
        }
    }

    #[test]
    fn a_known_contact_is_seen_to_move_where_all_readings_hide_it() {
        let mut scene = MovingScene::new(5);
        let mut blind = AdaptiveMean::new(NOISE_V);
        // Half a standard deviation of its place.
        let frames: Vec<_> = (0..200).map(|frame| scene.frame(if frame < 100 { 0.0 } else { 0.05 })).collect();
        for frame in &frames {
            blind.add(frame);
            scene.average.add_beside(frame, &scene.slopes_v);
        }
        assert!(
            scene.average.frames() <= 130 && blind.frames() == 200,
            "{} {}",
            scene.average.frames(),
            blind.frames()
        );
    }

    #[test]
    fn the_same_readings_again_are_one_observation() {
        let mut scene = MovingScene::new(6);
        let (first, second) = (scene.frame(0.0), scene.frame(0.0));
        (0..20).for_each(|_| scene.average.add_beside(&first, &scene.slopes_v));
        assert_eq!((scene.average.count(), scene.average.mean_readings()), (1, Some(first.clone())));
        scene.average.add(&second);
        assert_eq!(scene.average.count(), 2);
        // What is the same but for what it says is another observation.
        scene.average.add(&second.clone().saying(|g, e| if g == e { Says::AtMost } else { Says::Voltage }));
        assert_eq!(scene.average.count(), 3);
    }

    #[test]
    fn other_readings_begin_anew() {
        let mut average = AdaptiveMean::new(NOISE_V);
        assert_eq!((average.count(), average.mean()), (0, None));
        (0..5).for_each(|frame| average.add(&Readings::from_fn(4, |_, _| 0.5 + 1e-5 * f64::from(frame))));
        average.add(&Readings::from_fn(3, |_, _| 0.5));
        assert_eq!((average.count(), average.mean_v().len()), (1, 9));
    }

    #[test]
    fn rounding_is_averaged_by_noise_only() {
        let adc = |noise_lsb: f64| Adc { bits: 12, full_scale_v: 4.096, noise_lsb };
        assert!((rounding_v(&adc(0.0)) / 1e-3 * 12f64.sqrt() - 1.0).abs() < 0.01);
        // The mean of many conversions of each voltage, against the voltage.
        let mut random = fastrand::Rng::with_seed(3);
        let mut noise = |deviation: f64| deviation * ((0..12).map(|_| random.f64()).sum::<f64>() - 6.0);
        for noise_lsb in [0.0, 0.1, 0.2, 0.3] {
            let mut squares = 0.0;
            for step in 0..50 {
                let truth = f64::from(step) / 50.0;
                let mean = (0..3000).map(|_| (truth + noise(noise_lsb)).round()).sum::<f64>() / 3000.0;
                squares += (mean - truth).powi(2) / 50.0;
            }
            let expected = rounding_v(&adc(noise_lsb)) / 1e-3;
            assert!((0.85..1.15).contains(&(squares.sqrt() / expected)), "{noise_lsb}: {} {expected}", squares.sqrt());
        }
    }
}
