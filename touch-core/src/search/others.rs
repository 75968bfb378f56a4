//! Explanations that differ from one in a contact, and may be as good.

use super::Search;
use crate::fit::{Fit, LN_RADII, Scene};
use crate::loaded::Spot;
use crate::real::Real;

/// What the readings say for a contact below which others may do as well without it (squared deviations). Of 400 scenes on `built205` and 200 on a detector that is known as many are
/// right as with 500, where searches take a quarter longer.
const NEEDED: f32 = 50.0;
/// Contacts so near to each other are side by side (usual radii): as far as the widest one reaches.
const BESIDE: f32 = 3.0;
/// Where on the way from a wall fields bend most (usual radii): two places on both sides of it read nearly alike.
const RIDGE: f32 = 2.0;

/// Kinds of such explanations for each contact.
#[derive(Clone, Copy)]
enum Kind {
    Without,
    AsOne,
    BeyondRidge,
    WithoutBeyondRidge,
}

const ALL: [Kind; 4] = [Kind::Without, Kind::AsOne, Kind::BeyondRidge, Kind::WithoutBeyondRidge];
pub(super) const KINDS: usize = ALL.len();

/// Whether the readings hardly tell one of several contacts.
pub(super) fn is_unsure<T: Real, const K: usize, const D: usize>(
    fit: &Fit<T, K, D>,
    contact: usize,
    sure: f32,
) -> bool {
    fit.scene.count > 1 && fit.information[contact] < T::of(sure)
}

/// The contacts of which each is side by side with another one of them, with this one: a bit each.
fn side_by_side<T: Real, const K: usize, const D: usize>(scene: &Scene<T, K, D>, k: usize, near_m: T) -> u32 {
    let is_near = |a: &Spot<T>, b: &Spot<T>| {
        let [x, y] = [0, 1].map(|d| a.at_m[d] - b.at_m[d]);
        x * x + y * y < near_m * near_m
    };
    let spots = scene.spots();
    let mut all = 1_u32 << k;
    for _ in spots {
        let is_of_them = |spot: &Spot<T>| (0..spots.len()).any(|l| all >> l & 1 == 1 && is_near(spot, &spots[l]));
        all = spots.iter().enumerate().filter(|(_, spot)| is_of_them(spot)).fold(0, |all, (l, _)| all | 1 << l);
    }
    all
}

/// The scene with some contacts, a bit each, as one: as strong together, where they are in the mean, and so wide that its second moment is theirs.
fn as_one<T: Real, const K: usize, const D: usize>(scene: &Scene<T, K, D>, which: u32, usual_m: T) -> Scene<T, K, D> {
    let is_of_them = |k: usize| which >> k & 1 == 1;
    let them = || scene.spots().iter().enumerate().filter(|(k, _)| is_of_them(*k)).map(|(_, spot)| spot);
    let sum = |of: &dyn Fn(&Spot<T>) -> T| them().map(|spot| (-spot.ln_ohm).exp() * of(spot)).sum::<T>();
    let all_s = sum(&|_| T::ONE);
    let at_m = [0, 1].map(|d| sum(&|spot| spot.at_m[d]) / all_s);
    let square = sum(&|spot| {
        let [x, y] = [0, 1].map(|d| (spot.at_m[d] - at_m[d]) / usual_m);
        (spot.ln_radius + spot.ln_radius).exp() + T::of(2.0) * (x * x + y * y)
    });
    let [least, most] = LN_RADII.map(T::of);
    let ln_radius = (T::of(0.5) * (square / all_s).ln()).max(least).min(most);
    let others = scene.spots().iter().enumerate().filter(|(k, _)| !is_of_them(*k));
    let empty = Scene { steps: scene.steps, ..Scene::EMPTY };
    others.fold(empty, |scene, (_, spot)| scene.with(*spot)).with(Spot { at_m, ln_ohm: -all_s.ln(), ln_radius })
}

impl<T: Real, const K: usize, const D: usize> Search<T, K, D> {
    /// Where the other explanation with this number begins: without a contact that the readings hardly tell; with more than two side by side as one; or with one that readings place
    /// badly beyond the ridge before the nearest wall, with all others or without one that may only be there since that one is not.
    pub(super) fn other(&self, kept: &Fit<T, K, D>, number: usize) -> Option<Scene<T, K, D>> {
        let (k, scene) = (number / KINDS, &kept.scene);
        match ALL[number % KINDS] {
            Kind::Without => is_unsure(kept, k, NEEDED).then(|| scene.without(k)),
            Kind::AsOne => {
                let usual_m = T::of(self.terms.radius_m);
                let all = side_by_side(scene, k, T::of(BESIDE) * usual_m);
                let is_first = all.trailing_zeros() as usize == k;
                (is_first && all.count_ones() > 2).then(|| as_one(scene, all, usual_m))
            }
            Kind::BeyondRidge => self.is_loose(kept, k).then(|| self.beyond_ridge(scene, k))?,
            Kind::WithoutBeyondRidge => {
                let beyond = (0..scene.count).find(|other| *other != k && self.is_loose(kept, *other))?;
                is_unsure(kept, k, NEEDED).then(|| Some(self.beyond_ridge(scene, beyond)?.without(k)))?
            }
        }
    }

    /// Whether a contact may well be elsewhere. On a detector that is not known as many of 310 scenes are right where others are tried for these, in a quarter more time.
    pub(super) fn is_loose(&self, fit: &Fit<T, K, D>, k: usize) -> bool {
        self.terms.is_known && fit.loose >> k & 1 == 1
    }

    fn beyond_ridge(&self, scene: &Scene<T, K, D>, k: usize) -> Option<Scene<T, K, D>> {
        let mut moved = *scene;
        let at_m = &mut moved.spots[k].at_m;
        let walls = self.terms.bounds_m.iter().flat_map(|ends_m| ends_m.iter().enumerate());
        let ways = walls.map(|(d, wall_m)| (d, T::of(*wall_m), at_m[d] - T::of(*wall_m)));
        let (d, wall_m, way_m) = ways.min_by(|(.., a), (.., b)| a.abs().total_cmp(&b.abs()))?;
        let beyond_m = T::of(2.0 * RIDGE * self.terms.radius_m) - way_m.abs();
        let [low_m, high_m] = self.terms.bounds_m.map(|ends_m| T::of(ends_m[d]));
        at_m[d] = (wall_m + if way_m < T::ZERO { -beyond_m } else { beyond_m }).max(low_m).min(high_m);
        (beyond_m > T::ZERO).then_some(moved)
    }
}
