//! Detectors as built that are calibrated before solvers are tried on them, as `tactomo calibrate rub` does: from presses of one contact each
//! that are not among those tried.

use crate::experiment::{Experiment, StudyError};
use crate::presses;
use tactomo_physics::detector::Detector;
use tactomo_physics::readings::Readings;
use tactomo_physics::scene::{Contact, Touch};
use tactomo_touch::calibrate::{CalibrateError, Frame, RubSettings, rub};

/// What touched, and what was read.
pub(crate) type Scene = (Vec<Contact>, Readings);

/// Known places are exact in studies; so much is what a jig of a robot has (m).
const KNOWN_DEVIATION_M: f64 = 0.05e-3;

/// How a detector as built is calibrated.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Calibrate {
    /// From so many presses of one contact each, rubbed at places that nobody knows.
    Rub(usize),
    /// Without an error: the most that any calibration can do.
    Perfect,
}

/// A detector as built whose solvers know what a calibration found.
pub struct Calibrated {
    /// What they know, or the description where the calibration was refused.
    pub detector: Detector,
    /// Why it was refused, if it was.
    pub refused: Option<CalibrateError>,
}

impl Calibrate {
    /// For people.
    pub fn name(self) -> String {
        match self {
            Self::Rub(count) => format!("calibrated by rubbing, {count} presses at unknown places"),
            Self::Perfect => "calibrated without an error".to_owned(),
        }
    }

    /// Calibrates a detector as built, of which no more is known than a builder knows. Its presses are those of another seed than `seed`, which is
    /// that of the frames that are tried.
    ///
    /// # Errors
    /// [`StudyError`] if a press is off the detector.
    pub fn find(self, built: &Experiment, seed: u64) -> Result<Calibrated, StudyError> {
        match self {
            Self::Rub(count) => Ok(Calibrated::of(&built.detector, &rubbed(built, count, seed)?, 0)),
            Self::Perfect => Ok(Calibrated { detector: built.truth().clone(), refused: None }),
        }
    }
}

impl Calibrated {
    /// Fits a detector that is described as `nominal` to rubbed presses, of which so many are at known places.
    pub(crate) fn of(nominal: &Detector, rubbed: &[Scene], known: usize) -> Self {
        // Spread over the presses, as these are over the detector.
        let step = (rubbed.len() / known.max(1)).max(1);
        let frame = |(index, (contacts, readings)): (usize, &Scene)| {
            let is_known = index % step == 0 && index / step < known;
            let place = contacts.first().map(|contact| [contact.x_m, contact.y_m]);
            Frame { readings: readings.clone(), known_m: place.filter(|_| is_known) }
        };
        let frames: Vec<_> = rubbed.iter().enumerate().map(frame).collect();
        let settings = RubSettings { known_deviation_m: KNOWN_DEVIATION_M, ..RubSettings::default() };
        match rub(nominal, &frames, &settings, &mut |_| true) {
            Ok(found) => Self { detector: found.detector, refused: None },
            Err(error) => Self { detector: nominal.clone(), refused: Some(error) },
        }
    }
}

/// So many single presses at random places of a detector as built, of another seed than `seed`.
pub(crate) fn rubbed(built: &Experiment, count: usize, seed: u64) -> Result<Vec<Scene>, StudyError> {
    read(built, presses::random(&built.detector, count, !seed).into_iter().take(count).collect(), !seed)
}

/// What is read of contacts.
pub(crate) fn read(built: &Experiment, scenes: Vec<Vec<Contact>>, seed: u64) -> Result<Vec<Scene>, StudyError> {
    let touches = |contacts: &Vec<Contact>| contacts.iter().copied().map(Touch::from).collect();
    let frames = built.frames(&scenes.iter().map(touches).collect::<Vec<_>>(), seed)?;
    Ok(scenes.into_iter().zip(frames).map(|(contacts, frame)| (contacts, frame.readings)).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rub_brings_the_description_nearer_to_what_was_built_and_too_few_presses_leave_it() {
        let built = Experiment::of(&Detector::default(), Some(2)).unwrap();
        let found = Calibrate::Rub(24).find(&built, 2).unwrap();
        let off = |detector: &Detector| (detector.thickness_m() / built.truth().thickness_m()).ln().abs();
        assert!(found.refused.is_none() && off(&found.detector) < 0.5 * off(&built.detector), "{:?}", found.refused);
        let few = Calibrate::Rub(2).find(&built, 2).unwrap();
        assert!(matches!(few.refused, Some(CalibrateError::NotSingle { .. })), "{:?}", few.refused);
        assert_eq!(few.detector, built.detector);
    }
}
