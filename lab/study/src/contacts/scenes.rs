//! Random scenes of discs.

use std::ops::Range;

use crate::scenes::electrode_distance_m;
use tactomo_physics::detector::{Detector, Outline};
use tactomo_physics::geometry::{self, Point};
use tactomo_physics::scene::Contact;

/// Most contacts of a scene.
pub(super) const MAX_CONTACTS: usize = 5;
/// Lengths are for electrodes at this distance (m), and in proportion for others: a fingertip's on `square-60`.
const SPACING_M: f64 = 0.015;
/// Radii (m).
const RADII_M: Range<f64> = 1e-3..6e-3;
/// Between the discs, at least (m).
const GAP_M: f64 = 2e-3;
/// From a centre to the outline, at least (m): so discs may be cut by a wall.
const MARGIN_M: f64 = 1e-3;
/// Conductances (S): from some noise of the converter to where more would change little.
const CONDUCTANCES_S: Range<f64> = 1e-5..1e-1;
/// Places tried for a contact before all are placed anew.
const TRIES: usize = 1000;

/// A scene.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct RandomScene {
    /// Its number.
    pub index: usize,
    /// Which of the detectors.
    pub detector: usize,
    /// What touches.
    pub contacts: Vec<Contact>,
    /// Seed of the noise.
    pub noise_seed: u64,
}

/// So many scenes: the number of contacts goes round fastest, then the detector. The same seed gives the same scenes, however many there are.
pub(super) fn random(detectors: &[Detector], count: usize, seed: u64) -> Vec<RandomScene> {
    let mut random = fastrand::Rng::with_seed(seed);
    let mut scene = |index: usize| {
        let detector = index / MAX_CONTACTS % detectors.len();
        let contacts = contacts(&detectors[detector], 1 + index % MAX_CONTACTS, &mut random);
        RandomScene { index, detector, contacts, noise_seed: random.u64(..) }
    };
    (0..count).map(&mut scene).collect()
}

/// Ratio of a detector's lengths to those of 15 mm between electrodes.
pub(super) fn scale(detector: &Detector) -> f64 {
    electrode_distance_m(detector) / SPACING_M
}

/// Sizes first, so that those of scenes with many contacts are not smaller than of others.
fn contacts(detector: &Detector, count: usize, random: &mut fastrand::Rng) -> Vec<Contact> {
    let scale = scale(detector);
    let sizes: Vec<Contact> = (0..count)
        .map(|_| Contact::flat(0.0, 0.0, scale * log_uniform(RADII_M, random), log_uniform(CONDUCTANCES_S, random)))
        .collect();
    let tried = (0..TRIES).find_map(|_| placed(&detector.outline, &sizes, scale, random));
    // A detector that is too narrow for so many has fewer.
    tried.unwrap_or_else(|| sizes.iter().take(1).copied().collect())
}

fn placed(outline: &Outline, sizes: &[Contact], scale: f64, random: &mut fastrand::Rng) -> Option<Vec<Contact>> {
    let mut all: Vec<Contact> = Vec::with_capacity(sizes.len());
    for size in sizes {
        let is_free = |contact: &Contact| {
            let gap_m = |other: &Contact| {
                (other.x_m - contact.x_m).hypot(other.y_m - contact.y_m) - other.radius_m - contact.radius_m
            };
            margin_m(outline, [contact.x_m, contact.y_m]) >= scale * MARGIN_M
                && all.iter().all(|other| gap_m(other) > scale * GAP_M)
        };
        let mut anywhere = || {
            let [x_m, y_m] = outline.size_m().map(|side_m| side_m * (random.f64() - 0.5));
            Contact { x_m, y_m, ..*size }
        };
        let contact = (0..TRIES).map(|_| anywhere()).find(is_free)?;
        all.push(contact);
    }
    Some(all)
}

/// Distance of a place from the outline (m); below zero where it is beside the detector.
fn margin_m(outline: &Outline, place_m: Point) -> f64 {
    let rings = || std::iter::once(&outline.outer).chain(&outline.holes);
    let edges = rings().flat_map(|ring| geometry::edges(ring));
    let distance_m = edges.map(|edge| geometry::segment_distance(place_m, edge)).fold(f64::INFINITY, f64::min);
    let is_on = geometry::is_inside(place_m, &outline.outer)
        && !outline.holes.iter().any(|hole| geometry::is_inside(place_m, hole));
    if is_on { distance_m } else { -distance_m }
}

fn log_uniform(range: Range<f64>, random: &mut fastrand::Rng) -> f64 {
    range.start * (range.end / range.start).powf(random.f64())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contacts::detectors;

    #[test]
    fn contacts_are_on_their_detector_apart_and_of_all_sizes() {
        let detectors = detectors();
        let scenes = random(&detectors, 600, 1);
        for scene in &scenes {
            let (detector, contacts) = (&detectors[scene.detector], &scene.contacts);
            let scale = scale(detector);
            let half_m = detector.outline.size_m().map(|side_m| side_m / 2.0);
            assert_eq!(contacts.len(), 1 + scene.index % 5);
            for (index, contact) in contacts.iter().enumerate() {
                assert!(RADII_M.contains(&(contact.radius_m / scale)), "{contact:?}");
                assert!(CONDUCTANCES_S.contains(&contact.conductance_s), "{contact:?}");
                let to_wall_m = (half_m[0] - contact.x_m.abs()).min(half_m[1] - contact.y_m.abs());
                assert!(to_wall_m >= scale * MARGIN_M, "{contact:?}");
                for other in &contacts[..index] {
                    let apart_m = (other.x_m - contact.x_m).hypot(other.y_m - contact.y_m);
                    assert!(apart_m > other.radius_m + contact.radius_m + scale * GAP_M, "{contact:?} {other:?}");
                }
            }
        }
        // Half of the numbers that are uniform in the logarithm lie below the geometric mean of their ends: 1800 of them within 5 %.
        let all: Vec<&Contact> = scenes.iter().flat_map(|scene| &scene.contacts).collect();
        let share =
            |is: &dyn Fn(&Contact) -> bool| all.iter().filter(|contact| is(contact)).count() as f64 / all.len() as f64;
        assert!((share(&|contact| contact.conductance_s < 1e-3) - 0.5).abs() < 0.05);
        let square = |contact: &Contact| contact.radius_m < 6f64.sqrt() * 1e-3 * scale(&detectors[0]);
        assert!(share(&square) > 0.4 && share(&square) < 0.55, "{}", share(&square));
    }

    #[test]
    fn counts_and_detectors_have_equal_shares() {
        let scenes = random(&detectors(), 180, 1);
        for detector in 0..3 {
            for count in 1..=5 {
                let alike = |scene: &&RandomScene| scene.detector == detector && scene.contacts.len() == count;
                assert_eq!(scenes.iter().filter(alike).count(), 12);
            }
        }
    }

    #[test]
    fn a_seed_repeats_and_more_scenes_begin_with_the_same() {
        let detectors = detectors();
        assert_eq!(random(&detectors, 20, 7)[..], random(&detectors, 40, 7)[..20]);
        assert_ne!(random(&detectors, 20, 7), random(&detectors, 20, 8));
    }

    #[test]
    fn holes_and_what_is_beyond_the_outline_are_beside_the_detector() {
        let hole = vec![[-0.01, -0.01], [0.01, -0.01], [0.01, 0.01], [-0.01, 0.01]];
        let outline = Outline { holes: vec![hole], ..Outline::rectangle(0.06, 0.06) };
        let margin_mm = |x_m: f64| (1e3 * margin_m(&outline, [x_m, 0.0])).round();
        assert_eq!([0.0, 0.015, 0.028, 0.033].map(margin_mm), [-10.0, 5.0, 2.0, -3.0]);
    }
}
