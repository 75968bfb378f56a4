//! What touches in the scenes of a bank.

use std::ops::Range;
use std::str::FromStr;

use super::places::{Places, SHAPES};
use crate::scenes::electrode_distance_m;
use tactomo_physics::detector::{Detector, Outline};
use tactomo_physics::geometry::{self, Point};
use tactomo_physics::scene::{Contact, Touch};

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
pub(super) const TRIES: usize = 1000;

/// What touches.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Scenes {
    /// One to five discs of any size and strength, in turns.
    Random,
    /// One fingertip.
    Single,
    /// A light contact in a corner, alone or beside a firm one.
    Corner,
    /// Three to five fingertips in a row.
    Row,
    /// Two fingertips, so near that they may be taken for one.
    Near,
    /// The five fingers of a hand.
    Hand,
    /// Two discs, a wide disc, and what is no disc: a line, a ring, a cross, a triangle, an L.
    Shape,
}

impl Scenes {
    /// All of them.
    pub const ALL: [Self; 7] =
        [Self::Random, Self::Single, Self::Corner, Self::Row, Self::Near, Self::Hand, Self::Shape];

    /// Its name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Random => "random",
            Self::Single => "single",
            Self::Corner => "corner",
            Self::Row => "row",
            Self::Near => "near",
            Self::Hand => "hand",
            Self::Shape => "shape",
        }
    }

    /// What kinds there are, which come in turns, as its rows name them.
    pub(super) fn kinds(self) -> &'static [&'static str] {
        match self {
            Self::Shape => &SHAPES,
            _ => &[],
        }
    }

    /// What touches in the scene of this number.
    fn touches(self, detector: &Detector, index: usize, random: &mut fastrand::Rng) -> Vec<Touch> {
        let mut places = Places::new(detector, random);
        let discs = match self {
            Self::Random => contacts(detector, 1 + index % MAX_CONTACTS, places.random),
            Self::Single => places.row(1, 0.0),
            Self::Corner => places.in_corner(index % 2 == 1),
            Self::Row => places.in_a_row(3 + index % 3),
            Self::Near => places.near(),
            Self::Hand => return places.hand(),
            Self::Shape => return places.shape(index % SHAPES.len()),
        };
        discs.into_iter().map(Touch::from).collect()
    }

    /// So many scenes of the detectors in turns: what differs by number goes round fastest, then the detector. The same seed gives the same scenes,
    /// however many there are.
    pub(super) fn of(self, detectors: &[Detector], count: usize, seed: u64) -> Vec<TriedScene> {
        let mut random = fastrand::Rng::with_seed(seed);
        let turns = MAX_CONTACTS.max(self.kinds().len());
        let mut scene = |index: usize| {
            let detector = index / turns % detectors.len();
            let touches = self.touches(&detectors[detector], index, &mut random);
            let kind = self.kinds().get(index % self.kinds().len().max(1)).copied();
            TriedScene { index, detector, kind, touches, noise_seed: random.u64(..) }
        };
        (0..count).map(&mut scene).collect()
    }
}

/// A name that no scenes have.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("there are no scenes `{0}`; there are {names}", names = Scenes::ALL.map(Scenes::name).join(", "))]
pub struct UnknownScenes(String);

impl FromStr for Scenes {
    type Err = UnknownScenes;

    fn from_str(name: &str) -> Result<Self, Self::Err> {
        Self::ALL.into_iter().find(|scenes| scenes.name() == name).ok_or_else(|| UnknownScenes(name.to_owned()))
    }
}

/// A scene.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct TriedScene {
    /// Its number.
    pub index: usize,
    /// Which of the detectors.
    pub detector: usize,
    /// Of which kind, where there are several.
    pub kind: Option<&'static str>,
    /// What touches.
    pub touches: Vec<Touch>,
    /// Seed of the noise.
    pub noise_seed: u64,
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
pub(super) fn margin_m(outline: &Outline, place_m: Point) -> f64 {
    let rings = || std::iter::once(&outline.outer).chain(&outline.holes);
    let edges = rings().flat_map(|ring| geometry::edges(ring));
    let distance_m = edges.map(|edge| geometry::segment_distance(place_m, edge)).fold(f64::INFINITY, f64::min);
    let is_on = geometry::is_inside(place_m, &outline.outer)
        && !outline.holes.iter().any(|hole| geometry::is_inside(place_m, hole));
    if is_on { distance_m } else { -distance_m }
}

pub(super) fn log_uniform(range: Range<f64>, random: &mut fastrand::Rng) -> f64 {
    range.start * (range.end / range.start).powf(random.f64())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bank::detectors;

    #[test]
    fn contacts_are_on_their_detector_apart_and_of_all_sizes() {
        let detectors = detectors();
        let scenes = Scenes::Random.of(&detectors, 600, 1);
        for scene in &scenes {
            let (detector, contacts) = (&detectors[scene.detector], discs(scene));
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
        let all: Vec<Contact> = scenes.iter().flat_map(discs).collect();
        let share =
            |is: &dyn Fn(&Contact) -> bool| all.iter().filter(|contact| is(contact)).count() as f64 / all.len() as f64;
        assert!((share(&|contact| contact.conductance_s < 1e-3) - 0.5).abs() < 0.05);
        let square = |contact: &Contact| contact.radius_m < 6f64.sqrt() * 1e-3 * scale(&detectors[0]);
        assert!(share(&square) > 0.4 && share(&square) < 0.55, "{}", share(&square));
    }

    #[test]
    fn scenes_have_what_they_say_on_the_detector() {
        let detectors: Vec<_> = detectors().into_iter().chain(Detector::preset("strip-13x60")).collect();
        for scenes in Scenes::ALL {
            for scene in scenes.of(&detectors, 84, 3) {
                let (detector, touches) = (&detectors[scene.detector], &scene.touches);
                let is_on = |place_m: &Point| margin_m(&detector.outline, *place_m) > -1e-9;
                let is_strip = detector.name.starts_with("strip");
                if scenes != Scenes::Random && !(is_strip && scenes == Scenes::Shape) {
                    assert!(
                        touches.iter().all(|touch| is_on(&touch.centre_m)),
                        "{scenes:?} on {}: {touches:?}",
                        detector.name
                    );
                    assert!(
                        touches.iter().flat_map(Touch::pieces).flatten().all(|place_m| is_on(&place_m)),
                        "{scenes:?}: {touches:?}"
                    );
                }
                let number = match scenes {
                    Scenes::Single => 1,
                    Scenes::Corner => 1 + scene.index % 2,
                    Scenes::Row => 3 + scene.index % 3,
                    Scenes::Near => 2,
                    Scenes::Hand => 5,
                    Scenes::Shape => {
                        if scene.kind == Some("two discs") {
                            2
                        } else {
                            1
                        }
                    }
                    Scenes::Random => 1 + scene.index % 5,
                };
                assert_eq!(touches.len(), number, "{scenes:?} on {}", detector.name);
            }
        }
    }

    fn discs(scene: &TriedScene) -> Vec<Contact> {
        scene.touches.iter().filter_map(Touch::disc).collect()
    }

    #[test]
    fn counts_and_detectors_have_equal_shares() {
        let scenes = Scenes::Random.of(&detectors(), 180, 1);
        for detector in 0..3 {
            for count in 1..=5 {
                let alike = |scene: &&TriedScene| scene.detector == detector && scene.touches.len() == count;
                assert_eq!(scenes.iter().filter(alike).count(), 12);
            }
        }
    }

    #[test]
    fn a_seed_repeats_and_more_scenes_begin_with_the_same() {
        let detectors = detectors();
        for scenes in Scenes::ALL {
            assert_eq!(scenes.of(&detectors, 20, 7)[..], scenes.of(&detectors, 40, 7)[..20]);
            assert_ne!(scenes.of(&detectors, 20, 7), scenes.of(&detectors, 20, 8));
        }
    }

    #[test]
    fn holes_and_what_is_beyond_the_outline_are_beside_the_detector() {
        let hole = vec![[-0.01, -0.01], [0.01, -0.01], [0.01, 0.01], [-0.01, 0.01]];
        let outline = Outline { holes: vec![hole], ..Outline::rectangle(0.06, 0.06) };
        let margin_mm = |x_m: f64| (1e3 * margin_m(&outline, [x_m, 0.0])).round();
        assert_eq!([0.0, 0.015, 0.028, 0.033].map(margin_mm), [-10.0, 5.0, 2.0, -3.0]);
    }
}
