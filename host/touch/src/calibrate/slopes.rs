//! How the readings of a press change with the detector: by models of detectors that are a little different.
//!
//! Of the conductivity and the driving layer there is no model: what they do to the readings of a single contact is, but for what pads and the
//! switch take up, exactly what its conductance does (see [`Nuisance`](tactomo_physics::forward::Nuisance)). Differences of models have it to a
//! hundredth; over a rub of a hundred presses that hundredth would tell the conductivity, which no readings tell.

use std::sync::Arc;

use nalgebra::DMatrix;
use tactomo_physics::detector::{Detector, Parameter};
use tactomo_physics::forward::{ForwardError, ForwardModel, readings_v, sheet_drops_ohm};
use tactomo_physics::scene::Contact;

use tactomo_physics::threads::map;

/// Step of a parameter, in its standard deviations: small enough for a slope, large against the rounding of tables.
const STEP: f64 = 0.1;

/// Derivatives of the readings by parameters of the detector.
pub(super) struct Slopes {
    /// What the models are a step from, as coarse as they are.
    coarse: Arc<dyn ForwardModel>,
    /// With all pads' contact impedances a step further.
    pads: Arc<dyn ForwardModel>,
    all: Vec<Slope>,
}

/// One of them.
enum Slope {
    /// A model with the parameter a step further.
    Model(Arc<dyn ForwardModel>),
    /// All pads' contact impedances, the switch's resistance and the conductivity, by these logarithms.
    Pads(f64),
    Switch(f64),
    Conductivity(f64),
    /// The driving layer's sheet resistance (ohm per square).
    DrivingSheet(f64),
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
                Parameter::OnResistance => Slope::Switch(*deviation),
                Parameter::Pads => Slope::Pads(*deviation),
                Parameter::Conductivity => Slope::Conductivity(*deviation),
                Parameter::DrivingSheet => Slope::DrivingSheet(*deviation),
                _ => Slope::Model(coarse.of_similar(&model.detector().stepped(&[(*parameter, step)]))?),
            })
        };
        let all = map(parameters, slope).into_iter().collect::<Result<_, _>>()?;
        let pads = coarse.of_similar(&model.detector().stepped(&[(Parameter::Pads, STEP)]))?;
        Ok(Self { pads, coarse, all })
    }

    /// Gives for each parameter by how much the readings of a contact change (V) with one of its standard deviations.
    pub fn readings_v(&self, at: &At<'_>, mut give: impl FnMut(usize, &[f64])) {
        let At { contact, predicted, by_conductance_v, .. } = *at;
        let n = at.impedance_ohm.nrows();
        let mut change_v = vec![0.0; n * n];
        let Ok(coarse_ohm) = self.coarse.impedance_ohm(&[*contact]) else { return };
        let Ok(pads_ohm) = self.pads.impedance_ohm(&[*contact]) else { return };
        let coarse = as_read(&coarse_ohm, self.coarse.detector());
        let by = |(to, from): (f64, &f64)| (to - from) / STEP;
        let by_pads: Vec<f64> = as_read(&pads_ohm, self.pads.detector()).into_iter().zip(&coarse).map(by).collect();
        let by_switch = at.by_switch_v();
        let below_ohm = sheet_drops_ohm(self.coarse.detector(), &[*contact])[(0, 0)];
        for (column, slope) in self.all.iter().enumerate() {
            let mut with = |change: &dyn Fn(usize) -> f64| {
                change_v.iter_mut().enumerate().for_each(|(index, to)| *to = change(index));
            };
            match slope {
                Slope::Gain(channel, deviation) => {
                    with(&|index| if index % n == *channel { deviation * predicted[index] } else { 0.0 });
                }
                Slope::Offset(channel, offset_v) => {
                    with(&|index| if index % n == *channel { *offset_v } else { 0.0 });
                }
                Slope::Pads(deviation) => with(&|index| deviation * by_pads[index]),
                Slope::Switch(deviation) => with(&|index| deviation * by_switch[index]),
                Slope::Conductivity(deviation) => {
                    with(&|index| deviation * (by_pads[index] + by_switch[index] - by_conductance_v[index]));
                }
                Slope::DrivingSheet(deviation) => {
                    let log = -deviation * below_ohm * contact.conductance_s;
                    with(&|index| log * by_conductance_v[index]);
                }
                Slope::Model(model) => {
                    let Ok(other_ohm) = model.impedance_ohm(&[*contact]) else { continue };
                    let other = as_read(&other_ohm, model.detector());
                    with(&|index| (other[index] - coarse[index]) / STEP);
                }
            }
            give(column, &change_v);
        }
    }
}

/// Where derivatives are taken.
pub(super) struct At<'a> {
    pub contact: &'a Contact,
    /// The detector as it stands.
    pub detector: &'a Detector,
    pub impedance_ohm: &'a DMatrix<f64>,
    /// Readings (V), and by how much they change with the logarithm of the contact's conductance.
    pub predicted: &'a [f64],
    pub by_conductance_v: &'a [f64],
}

impl At<'_> {
    /// By how much readings change with the logarithm of the switch's resistance `R` (V): with `L = Z[g][g] + R`, `(Vcc - V) R / L`.
    fn by_switch_v(&self) -> Vec<f64> {
        let (n, switch_ohm) = (self.impedance_ohm.nrows(), self.detector.on_resistance_ohm);
        let mut all = readings_v(self.impedance_ohm, self.detector);
        for (index, volts) in all.volts_mut().iter_mut().enumerate() {
            let (g, e) = (index / n, index % n);
            let share = switch_ohm / (self.impedance_ohm[(g, g)] + switch_ohm);
            *volts = self.detector.electrodes[e].gain * (self.detector.drive_v - *volts) * share;
        }
        all.volts().to_vec()
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
