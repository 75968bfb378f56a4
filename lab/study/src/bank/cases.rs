//! The frozen cases of the bank, and those that are asked for.

use std::sync::Arc;

use serde::{Serialize, Serializer};

use super::patches::{Grip, OnPatches};
use super::scenes::{Scenes, TriedScene};
use crate::calibrate::{Calibrate, Calibrated};
use crate::experiment::{Experiment, StudyError};
use crate::independent::Independent;
use tactomo_physics::causes::with_causes;
use tactomo_physics::detector::{Detector, FOAMS, Layer};
use tactomo_physics::simulate::drawn_top_over_bottom;

/// How much better the graded detector conducts at the bottom than at the top: as much as the paper's samples differ, and more.
const GRADING: f64 = 10.0;
/// Standard deviations of its tolerance by which the top conducts better than the bottom where single presses were taken for two on the simulated
/// ESP32: by 1.4 to 2.9 on the three of 75 detectors as built (seeds 9, 104, 120).
const TOP_OVER_BOTTOM: f64 = 2.5;

/// What touches, and what readings are of.
#[derive(Clone, Debug, Serialize)]
#[serde(untagged)]
pub enum Touching {
    /// Anything anywhere: readings are of the finest model.
    Anywhere(Scenes),
    /// Patches of an independent solution, which readings are of.
    OnPatches(OnPatches),
}

/// Scenes on detectors, and what is known of these.
#[derive(Clone, Debug, Serialize)]
pub struct Case {
    /// What it is called.
    pub name: String,
    /// What touches.
    pub scenes: Touching,
    /// Detectors as they are described, which scenes have in turns.
    #[serde(serialize_with = "names")]
    pub detectors: Vec<Detector>,
    /// Seeds of what was built of each; none leaves them as they are described, and known exactly. An independent solution is what was built.
    pub built: Vec<u64>,
    /// By how many standard deviations of its tolerance the top of what was built conducts better than the bottom; as drawn without it.
    pub top_over_bottom: Option<f64>,
    /// Single presses at unknown places that each detector as built is calibrated with before; none leaves it as described.
    pub rub: usize,
}

fn names<S: Serializer>(detectors: &[Detector], serializer: S) -> Result<S::Ok, S::Error> {
    serializer.collect_seq(detectors.iter().map(|detector| &detector.name))
}

/// Three detectors that the slab models, of different sizes, foams and numbers of electrodes: `square-60`, 16 electrodes on foam A; the same
/// with foam B at the bottom and a tenth of its conductivity at the top; and `display-140x70`, 32 electrodes on a thinner layer.
pub fn detectors() -> Vec<Detector> {
    [Some(Detector::default()), Some(graded()), Detector::preset("display-140x70")].into_iter().flatten().collect()
}

fn graded() -> Detector {
    let square = Detector::default();
    let bottom_s_per_m = FOAMS[1].conductivity_s_per_m;
    let layer = Layer { bottom_s_per_m, top_s_per_m: bottom_s_per_m / GRADING, ..square.layers[0] };
    Detector { name: format!("{} graded", square.name), layers: vec![layer], ..square }
}

impl Case {
    /// Scenes on detectors that are as described, which solvers take as exact.
    pub fn of(name: impl Into<String>, scenes: Scenes, detectors: Vec<Detector>) -> Self {
        let scenes = Touching::Anywhere(scenes);
        Self { name: name.into(), scenes, detectors, built: Vec::new(), top_over_bottom: None, rub: 0 }
    }

    /// The bank: so many detectors as built a case, drawn from a seed on.
    pub fn bank(seed: u64, builds: u64) -> Vec<Self> {
        let square = || vec![Detector::default()];
        let preset = |name: &str| Detector::preset(name).into_iter().collect();
        let built = |name: &str, scenes, detectors| Self {
            built: (seed..seed + builds).collect(),
            ..Self::of(name, scenes, detectors)
        };
        vec![
            Self::of("exact", Scenes::Random, square()),
            Self::of("exact corners", Scenes::Corner, square()),
            Self::of("exact shapes", Scenes::Shape, square()),
            built("built", Scenes::Random, square()),
            Self {
                top_over_bottom: Some(TOP_OVER_BOTTOM),
                ..built("built, top over bottom", Scenes::Single, square())
            },
            built("built, corners", Scenes::Corner, square()),
            built("built, rows", Scenes::Row, square()),
            built("built, near", Scenes::Near, square()),
            built("built, hands", Scenes::Hand, square()),
            built("built, shapes", Scenes::Shape, square()),
            built("built, 32 electrodes", Scenes::Random, preset("display-140x70")),
            built("built, strip", Scenes::Random, preset("strip-13x60")),
            built("built, thin", Scenes::Random, preset("fingertip-10")),
            built("built, graded", Scenes::Random, vec![graded()]),
        ]
    }

    /// Scenes on the patches of an independent solution, a case for each number of them. Solvers know the description of the detector
    /// and its tolerances.
    pub fn independent(solution: Independent, described: &Detector) -> Vec<Self> {
        let independent = Arc::new(solution);
        let of = |grip: Grip| Self {
            name: format!("{}, {}", independent.name, grip.name()),
            scenes: Touching::OnPatches(OnPatches { independent: Arc::clone(&independent), grip }),
            detectors: vec![described.clone()],
            built: Vec::new(),
            top_over_bottom: None,
            rub: 0,
        };
        Grip::ALL.map(of).into()
    }

    /// So many scenes of its detectors in turns.
    pub(super) fn tried(&self, count: usize, seed: u64) -> Result<Vec<TriedScene>, StudyError> {
        match &self.scenes {
            Touching::Anywhere(scenes) => Ok(scenes.of(&self.described(), count, seed)),
            Touching::OnPatches(patches) => patches.of(&self.detectors[0], count, seed),
        }
    }

    /// What kinds of scenes there are, as its rows name them.
    pub(super) fn kinds(&self) -> &'static [&'static str] {
        match &self.scenes {
            Touching::Anywhere(scenes) => scenes.kinds(),
            Touching::OnPatches(_) => &[],
        }
    }

    /// The descriptions of its [experiments](Self::experiments), in their order.
    pub(super) fn described(&self) -> Vec<Detector> {
        let times = self.built.len().max(1);
        self.detectors.iter().flat_map(|detector| std::iter::repeat_n(detector.clone(), times)).collect()
    }

    /// Each detector as it is described, or as it was built with each seed and perhaps calibrated by presses of another seed than `seed`; or what an
    /// independent solution is of.
    pub(super) fn experiments(&self, seed: u64, progress: &mut dyn FnMut(&str)) -> Result<Vec<Experiment>, StudyError> {
        let mut all = Vec::new();
        for detector in &self.detectors {
            let sound = Experiment::new(detector)?;
            if let Touching::OnPatches(OnPatches { independent, .. }) = &self.scenes {
                all.push(sound.solved_by(Arc::clone(independent))?);
                continue;
            }
            for built in &self.built {
                let truth = drawn_top_over_bottom(detector, *built, self.top_over_bottom)?;
                all.push(self.calibrated(sound.made_as(&truth)?, seed, progress)?);
            }
            if self.built.is_empty() {
                all.push(sound);
            }
        }
        Ok(all)
    }

    fn calibrated(
        &self,
        built: Experiment,
        seed: u64,
        progress: &mut dyn FnMut(&str),
    ) -> Result<Experiment, StudyError> {
        if self.rub == 0 {
            return Ok(built);
        }
        let Calibrated { detector, refused } = Calibrate::Rub(self.rub).find(&built, seed)?;
        refused.iter().for_each(|why| progress(&with_causes(why)));
        built.known_as(&detector)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_bank_has_each_case_once_and_its_detectors_as_built_can_be_drawn() {
        let bank = Case::bank(1000, 3);
        for (index, case) in bank.iter().enumerate() {
            assert!(bank[..index].iter().all(|other| other.name != case.name), "{}", case.name);
            let builds = if case.name.starts_with("built") { 3 } else { 0 };
            assert_eq!((case.built.len(), case.detectors.len(), case.described().len()), (builds, 1, builds.max(1)));
            for seed in &case.built {
                assert!(
                    drawn_top_over_bottom(&case.detectors[0], *seed, case.top_over_bottom).is_ok(),
                    "{}, {seed}",
                    case.name
                );
            }
        }
    }
}
