//! How the readings of a press change with the detector: by models of detectors that are a little different.

use std::sync::Arc;

use nalgebra::DMatrix;
use tactomo_physics::detector::{Detector, Parameter};
use tactomo_physics::forward::{ForwardError, ForwardModel, readings_v};
use tactomo_physics::scene::Contact;

use tactomo_physics::threads::map;

/// Step of a parameter, in its standard deviations: small enough for a slope, large against the rounding of tables.
const STEP: f64 = 0.1;

/// Derivatives of the readings by parameters of the detector.
pub(super) struct Slopes {
    /// What the models are a step from, as coarse as they are.
    coarse: Arc<dyn ForwardModel>,
    all: Vec<Slope>,
}

/// One of them.
enum Slope {
    /// A model with the parameter a step further.
    Model(Arc<dyn ForwardModel>),
    /// The same detector, whose board measures otherwise.
    Board(Box<Detector>),
    /// A channel's gain, by this logarithm.
    Gain(usize, f64),
    /// A channel's offset (V).
    Offset(usize, f64),
}

impl Slopes {
    /// Makes the models, each a standard deviation's share from `model`.
    ///
    /// # Errors
    /// [`ForwardError`] if one of the detectors cannot be.
    pub fn new(model: &Arc<dyn ForwardModel>, parameters: &[(Parameter, f64)]) -> Result<Self, ForwardError> {
        let coarse = model.coarse()?.unwrap_or_else(|| Arc::clone(model));
        let slope = |(parameter, deviation): &(Parameter, f64)| {
            let step = STEP * deviation;
            Ok(match *parameter {
                Parameter::Gain(channel) => Slope::Gain(channel, *deviation),
                Parameter::Offset(channel) => Slope::Offset(channel, *deviation),
                Parameter::OnResistance => Slope::Board(model.detector().stepped(&[(*parameter, step)]).into()),
                _ => Slope::Model(coarse.of_similar(&model.detector().stepped(&[(*parameter, step)]))?),
            })
        };
        let all = map(parameters, slope).into_iter().collect::<Result<_, _>>()?;
        Ok(Self { coarse, all })
    }

    /// Gives for each parameter by how much the readings of a contact change (V) with one of its standard deviations.
    pub fn readings_v(
        &self,
        contact: &Contact,
        impedance_ohm: &DMatrix<f64>,
        predicted: &[f64],
        mut give: impl FnMut(usize, &[f64]),
    ) {
        let n = impedance_ohm.nrows();
        let mut change_v = vec![0.0; n * n];
        let Ok(coarse_ohm) = self.coarse.impedance_ohm(&[*contact]) else { return };
        let coarse = as_read(&coarse_ohm, self.coarse.detector());
        for (column, slope) in self.all.iter().enumerate() {
            let (stepped, before) = match slope {
                Slope::Gain(channel, deviation) => {
                    change_v.fill(0.0);
                    let own = (*channel..n * n).step_by(n);
                    own.for_each(|index| change_v[index] = deviation * predicted[index]);
                    give(column, &change_v);
                    continue;
                }
                Slope::Offset(channel, offset_v) => {
                    change_v.fill(0.0);
                    (*channel..n * n).step_by(n).for_each(|index| change_v[index] = *offset_v);
                    give(column, &change_v);
                    continue;
                }
                Slope::Board(detector) => (as_read(impedance_ohm, detector), predicted),
                Slope::Model(model) => match model.impedance_ohm(&[*contact]) {
                    Ok(other_ohm) => (as_read(&other_ohm, model.detector()), &coarse[..]),
                    Err(_) => continue,
                },
            };
            let pairs = stepped.iter().zip(before);
            change_v.iter_mut().zip(pairs).for_each(|(change, (to, from))| *change = (to - from) / STEP);
            give(column, &change_v);
        }
    }
}

/// Readings as a detector's channels read them (V), with their gains and offsets.
pub(super) fn as_read(impedance_ohm: &DMatrix<f64>, detector: &Detector) -> Vec<f64> {
    let n = detector.electrodes.len();
    let mut volts = readings_v(impedance_ohm, detector);
    for (index, volts) in volts.volts_mut().iter_mut().enumerate() {
        let pad = &detector.electrodes[index % n];
        *volts = pad.gain * *volts + pad.unseen_offset_v;
    }
    volts.volts().to_vec()
}
