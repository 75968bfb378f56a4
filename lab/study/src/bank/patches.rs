//! What touches on the patches of an independent solution.

use std::ops::Range;
use std::sync::Arc;

use serde::{Serialize, Serializer};

use super::places::Places;
use super::scenes::{TRIES, TriedScene, log_uniform, scale};
use crate::experiment::StudyError;
use crate::independent::{Independent, Patch};
use tactomo_physics::detector::Detector;
use tactomo_physics::scene::Touch;

/// Conductances (sheet conductances of the detector that was solved): 10^-1.5 to 10^0.5, light to firm.
const SHEETS: Range<f64> = 0.031_622_776_601_683_79..3.162_277_660_168_379_5;
/// Two and three contacts are so far apart at least (m), for electrodes at 15 mm: fingers of a hand that are held together are not nearer.
const APART_M: f64 = 12e-3;

/// How many patches are touched, and which.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Grip {
    /// One patch after the other in random order, each once before any comes again.
    Single,
    /// Two that are apart.
    Pair,
    /// Three that are apart.
    Triple,
    /// Those next to the five fingers of a hand, a patch for each: they may be near to each other.
    Hand,
}

/// Scenes of the patches of an independent solution.
#[derive(Clone, Debug, Serialize)]
pub struct OnPatches {
    /// The solution, which readings are of.
    #[serde(serialize_with = "name")]
    pub independent: Arc<Independent>,
    /// Which of them are touched.
    pub grip: Grip,
}

fn name<S: Serializer>(independent: &Independent, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_str(&independent.name)
}

impl Grip {
    /// All of them.
    pub const ALL: [Self; 4] = [Self::Single, Self::Pair, Self::Triple, Self::Hand];

    /// Its name in cases.
    pub fn name(self) -> &'static str {
        match self {
            Self::Single => "singles",
            Self::Pair => "pairs",
            Self::Triple => "triples",
            Self::Hand => "hands",
        }
    }
}

impl OnPatches {
    /// So many scenes; a solver takes them for those of `detector`. The same seed gives the same scenes, however many there are.
    ///
    /// # Errors
    /// [`StudyError::Independent`] if there are too few patches, or none so far apart.
    pub(super) fn of(&self, detector: &Detector, count: usize, seed: u64) -> Result<Vec<TriedScene>, StudyError> {
        let (mut random, mut order) = (fastrand::Rng::with_seed(seed), Vec::new());
        let mut scene = |index: usize| {
            let patches = match self.grip {
                Grip::Single => vec![self.next(&mut order, &mut random)?],
                Grip::Pair => self.apart(2, scale(detector) * APART_M, &mut random)?,
                Grip::Triple => self.apart(3, scale(detector) * APART_M, &mut random)?,
                Grip::Hand => self.next_to(&Places::new(detector, &mut random).hand())?,
            };
            let touches = patches.iter().map(|patch| {
                let conductance_s = self.independent.sheet_s * log_uniform(SHEETS, &mut random);
                Touch::from(patch.contact(conductance_s))
            });
            let touches = touches.collect();
            Ok(TriedScene { index, detector: 0, kind: None, touches, noise_seed: random.u64(..) })
        };
        (0..count).map(&mut scene).collect()
    }

    /// The next patch of an order, which is drawn anew where it ends.
    fn next(&self, order: &mut Vec<Patch>, random: &mut fastrand::Rng) -> Result<Patch, StudyError> {
        if order.is_empty() {
            order.clone_from(&self.independent.patches);
            random.shuffle(order);
        }
        order.pop().ok_or_else(|| self.wrong("it has no patches".to_owned()))
    }

    /// So many patches that are so far apart (m) from each other.
    fn apart(&self, count: usize, apart_m: f64, random: &mut fastrand::Rng) -> Result<Vec<Patch>, StudyError> {
        let are_apart = |patches: &Vec<Patch>| {
            let is_apart = |(index, patch): (usize, &Patch)| {
                patches[..index].iter().all(|other| patch.distance_m([other.x_m, other.y_m]) >= apart_m)
            };
            patches.len() == count && patches.iter().enumerate().all(is_apart)
        };
        let mut all = self.independent.patches.clone();
        let mut any = |_| {
            random.shuffle(&mut all);
            all.iter().copied().take(count).collect()
        };
        let found = (0..TRIES).map(&mut any).find(are_apart);
        found.ok_or_else(|| self.wrong(format!("no {count} of its patches are {:.0} mm apart", 1e3 * apart_m)))
    }

    /// For each touch the nearest patch that no touch before it has.
    fn next_to(&self, touches: &[Touch]) -> Result<Vec<Patch>, StudyError> {
        let mut free = self.independent.patches.clone();
        let nearest = |touch: &Touch| {
            let distance_m = |index: &usize| free[*index].distance_m(touch.centre_m);
            let index = (0..free.len()).min_by(|a, b| distance_m(a).total_cmp(&distance_m(b)));
            let index = index.ok_or_else(|| self.wrong(format!("it has less than {} patches", touches.len())))?;
            Ok(free.swap_remove(index))
        };
        touches.iter().map(nearest).collect()
    }

    fn wrong(&self, what: String) -> StudyError {
        StudyError::Independent { solution: self.independent.name.clone(), what }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::independent::tests::Contents;

    fn on_patches(grip: Grip) -> OnPatches {
        OnPatches { independent: Arc::new(Contents::of_network().read().unwrap()), grip }
    }

    fn places_m(scene: &TriedScene) -> Vec<[f64; 2]> {
        scene.touches.iter().map(|touch| touch.centre_m).collect()
    }

    #[test]
    fn scenes_are_of_different_patches_of_the_strengths_that_are_asked_for() {
        for (grip, number, apart_m) in
            [(Grip::Single, 1, 0.0), (Grip::Pair, 2, 12e-3), (Grip::Triple, 3, 12e-3), (Grip::Hand, 5, 9e-3)]
        {
            let of = on_patches(grip);
            let scenes = of.of(&Detector::default(), 50, 7).unwrap();
            assert_eq!(scenes[..20], of.of(&Detector::default(), 20, 7).unwrap());
            assert_ne!(scenes[..20], of.of(&Detector::default(), 20, 8).unwrap());
            for scene in &scenes {
                let places_m = places_m(scene);
                assert_eq!(places_m.len(), number, "{grip:?}");
                for (index, [x_m, y_m]) in places_m.iter().enumerate() {
                    let is_far = |other: &[f64; 2]| (other[0] - x_m).hypot(other[1] - y_m) >= apart_m;
                    assert!(places_m[..index].iter().all(is_far), "{grip:?}: {places_m:?}");
                }
                let sheets = |touch: &Touch| touch.conductance_s / of.independent.sheet_s;
                assert!(scene.touches.iter().all(|touch| SHEETS.contains(&sheets(touch))), "{scene:?}");
                assert!(of.independent.impedance_ohm(&scene.touches).is_ok());
            }
        }
    }

    #[test]
    fn single_presses_come_to_every_patch_before_any_comes_again() {
        let scenes = on_patches(Grip::Single).of(&Detector::default(), 50, 1).unwrap();
        for round in scenes.chunks(25) {
            let mut places_m: Vec<_> = round.iter().flat_map(places_m).collect();
            places_m.sort_by(|a, b| a.partial_cmp(b).unwrap());
            places_m.dedup();
            assert_eq!(places_m.len(), 25);
        }
        assert_ne!(places_m(&scenes[0]), places_m(&scenes[25]));
    }

    #[test]
    fn too_few_patches_are_told() {
        let few = |grip| {
            let mut independent = Contents::of_network().read().unwrap();
            independent.patches.truncate(2);
            let of = OnPatches { independent: Arc::new(independent), grip };
            of.of(&Detector::default(), 1, 1).map_err(|error| error.to_string())
        };
        assert_eq!(few(Grip::Triple), Err("network: no 3 of its patches are 12 mm apart".to_owned()));
        assert_eq!(few(Grip::Hand), Err("network: it has less than 5 patches".to_owned()));
    }
}
