//! Key frames of contacts that are followed: means over short times in which their strengths differ.

use std::collections::VecDeque;
use std::sync::Arc;

use super::super::ContactFinder;
use super::super::discs::{DiscFit, place_m};
use crate::solve::before::adaptive_mean::Mean;
use crate::solve::fit::evidence::misfit_limit;
use crate::solve::fit::target::{Errors, Target};
use tactomo_physics::readings::{Readings, Says};
use tactomo_physics::scene::Contact;
use tactomo_physics::space;
use tactomo_touch_core::MOST_TOGETHER;

/// Frames that a key frame is the mean of: a tenth of a second of the paper's board. Fewer, but not less than these, where readings change by more
/// than a share of themselves: over a tenth, what their mean has beside the readings of mean strengths is a two-thousandth.
const AVERAGED: usize = 25;
const AVERAGED_AT_LEAST: usize = 5;
const CHANGED: f64 = 0.1;
/// How far a contact that was told to stay may go while frames are averaged (usual radii): one that slides is in their mean as what is no disc, which two that stay explain
/// better than one that moves.
const SLID: f64 = 0.4;
/// Key frames that are kept, and fewest that are explained together.
const KEPT: usize = MOST_TOGETHER;
const FEWEST: usize = 4;
/// A key frame is let go when so many have come after it: what touched then may be gone. At 250 frames a second they are of four seconds.
const LASTING: usize = 40;
/// New ones that are waited for before they are explained again, at first and at most: one more each time that says nothing new.
const WAITED_FOR: [usize; 2] = [3, 16];

/// The mean of some frames, with the contacts as they were followed at its end.
#[derive(Clone, Debug)]
pub(in super::super) struct KeyFrame {
    pub mean: Mean,
    pub contacts: Vec<Contact>,
    /// Its number.
    number: usize,
}

impl KeyFrame {
    /// As many other contacts, in the order of its own: each is the nearest that is left.
    fn in_order(&self, others: &[Contact]) -> Vec<Contact> {
        let mut left = others.to_vec();
        let nearest = |own: &Contact| {
            let apart_m = |other: &Contact| space::distance(place_m(own), place_m(other));
            let nearest = (0..left.len()).min_by(|a, b| apart_m(&left[*a]).total_cmp(&apart_m(&left[*b])));
            nearest.map(|index| left.swap_remove(index))
        };
        self.contacts.iter().filter_map(nearest).collect()
    }

    /// Whether none of other contacts in the same order is so far from its own (m).
    fn is_near(&self, others: &[Contact], far_m: f64) -> bool {
        let mut pairs = self.contacts.iter().zip(others);
        pairs.all(|(own, other)| space::distance(place_m(own), place_m(other)) < far_m)
    }
}

/// Key frames of what is followed.
#[derive(Clone, Debug, Default)]
pub(in super::super) struct KeyFrames {
    kept: VecDeque<KeyFrame>,
    /// How many came, how many of them since they were looked at, and how often that said nothing new.
    came: usize,
    new: usize,
    in_vain: usize,
    /// The first of the frames since the last one, as contacts are followed in it and what is read (V), their sum, what they say, and their number.
    first: Vec<Contact>,
    first_v: Vec<f64>,
    sum_v: Vec<f64>,
    says: Vec<Says>,
    frames: usize,
}

impl KeyFrames {
    /// Takes the next frame with what is followed.
    pub fn take(&mut self, target: &Target, fit: &DiscFit, finder: &ContactFinder) {
        let errors = &finder.errors;
        if self.kept.back().is_some_and(|last| last.contacts.len() != fit.contacts.len()) {
            // What touches is the same; how many contacts it is said to be is not.
            self.kept.iter_mut().for_each(|key| key.contacts.clone_from(&fit.contacts));
            self.in_vain = 0;
        }
        let readings = target.readings();
        if self.frames > 0 && self.have_changed(&readings, errors.noise_v) {
            self.end(fit, finder);
        }
        if self.frames == 0 {
            self.first.clone_from(&fit.contacts);
        }
        self.add(&readings);
        if self.frames == AVERAGED {
            self.end(fit, finder);
        }
    }

    /// Whether readings have changed by so much since the last key frame that their mean is none of contacts.
    fn have_changed(&self, readings: &Readings, noise_v: f64) -> bool {
        let pairs = readings.volts().iter().zip(&self.first_v);
        let squares = pairs.map(|(now, first)| [(now - first).powi(2), first * first]);
        let [change_v2, all_v2] = squares.fold([0.0; 2], |sum, squares| [sum[0] + squares[0], sum[1] + squares[1]]);
        change_v2 - 2.0 * self.first_v.len() as f64 * noise_v * noise_v > CHANGED * CHANGED * all_v2
    }

    /// Whether one of the contacts, that were told to stay, has gone so far (m) since the last key frame. Others go far where one stands for two.
    fn have_slid(&self, fit: &DiscFit, far_m: f64) -> bool {
        let mut pairs = self.first.iter().zip(&fit.contacts);
        let are_same = fit.still.is_some() && self.first.len() == fit.contacts.len();
        are_same && pairs.any(|(before, now)| space::distance(place_m(before), place_m(now)) > far_m)
    }

    /// Makes a key frame of the frames since the last one, if they are enough and differ from it.
    fn end(&mut self, fit: &DiscFit, finder: &ContactFinder) {
        let frames = std::mem::take(&mut self.frames);
        if frames < AVERAGED_AT_LEAST || self.have_slid(fit, SLID * finder.settings.radius_m) {
            return;
        }
        let mean = self.mean(frames);
        if self.kept.back().is_some_and(|last| !differs(&last.mean, &mean, &finder.errors)) {
            return;
        }
        if self.kept.len() == KEPT {
            self.drop_one();
        }
        // A search may have found the same contacts in another order.
        let contacts = self.kept.back().map_or_else(|| fit.contacts.clone(), |last| last.in_order(&fit.contacts));
        (self.came, self.new) = (self.came + 1, self.new + 1);
        // What has gone that far is not explained by contacts that stay.
        let is_over = |oldest: &KeyFrame| {
            oldest.number + LASTING < self.came || !oldest.is_near(&contacts, finder.side_by_side_m())
        };
        while self.kept.front().is_some_and(is_over) {
            self.kept.pop_front();
        }
        self.kept.push_back(KeyFrame { mean, contacts, number: self.came });
    }

    /// Drops the one whose neighbours differ least: those that are left differ as much as they can. The newest eight of a hand whose weight goes
    /// round in four seconds are of 0.8 s, in which strengths change too little to tell a fifth finger.
    fn drop_one(&mut self) {
        let apart_v2 = |k: &usize| {
            let [one, other] = [k - 1, k + 1].map(|of| self.kept[of].mean.readings.volts());
            one.iter().zip(other).map(|(a, b)| (a - b) * (a - b)).sum::<f64>()
        };
        let least = (1..self.kept.len() - 1).min_by(|a, b| apart_v2(a).total_cmp(&apart_v2(b)));
        least.and_then(|k| self.kept.remove(k));
    }

    fn add(&mut self, readings: &Readings) {
        let volts = readings.volts();
        let says = (0..volts.len()).map(|i| readings.all_say().get(i).copied().unwrap_or_default());
        if self.frames == 0 {
            self.first_v.clear();
            self.first_v.extend_from_slice(volts);
            self.sum_v.clone_from(&self.first_v);
            self.says.clear();
            self.says.extend(says);
        } else {
            self.sum_v.iter_mut().zip(volts).for_each(|(sum, volts)| *sum += volts);
            self.says.iter_mut().zip(says).for_each(|(ours, theirs)| *ours = ours.of_mean(theirs));
        }
        self.frames += 1;
    }

    fn mean(&self, frames: usize) -> Mean {
        let electrodes = self.sum_v.len().isqrt();
        let at = |g: usize, e: usize| g * electrodes + e;
        let readings = Readings::from_fn(electrodes, |g, e| self.sum_v[at(g, e)] / frames as f64);
        Mean { readings: readings.saying(|g, e| self.says[at(g, e)]), frames }
    }

    /// Whether they are worth a look.
    pub fn are_ripe(&self) -> bool {
        self.kept.len() >= FEWEST && self.new >= (WAITED_FOR[0] + self.in_vain).min(WAITED_FOR[1])
    }

    /// They were looked at.
    pub fn looked_at(&mut self) {
        self.new = 0;
        self.in_vain += 1;
    }

    /// All of them.
    pub fn all(&self) -> Arc<[KeyFrame]> {
        self.kept.iter().cloned().collect()
    }
}

/// Whether two means differ by more than noise.
fn differs(one: &Mean, other: &Mean, errors: &Errors) -> bool {
    let n = one.readings.electrodes();
    let is_voltage = |i: &usize| [one, other].iter().all(|mean| mean.readings.says(i / n, i % n) == Says::Voltage);
    let square = |i: usize| (one.readings.volts()[i] - other.readings.volts()[i]).powi(2);
    let (sum_v2, count) =
        (0..n * n).filter(is_voltage).fold((0.0, 0.0), |(sum, count), i| (sum + square(i), count + 1.0));
    let noise_v2 = errors.of_mean_v(one.frames).powi(2) + errors.of_mean_v(other.frames).powi(2);
    sum_v2 > noise_v2 * count * misfit_limit(count)
}
