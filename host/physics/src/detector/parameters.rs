//! What of a detector is known to a tolerance only, quantity by quantity.

use std::fmt;
use std::str::FromStr;

use super::{Detector, Layer};

/// A quantity of a detector that differs between paper and bench. Its steps are told in the unit given: logarithms are of the factor by which
/// it changes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Parameter {
    /// Thickness of all layers together (logarithm).
    Thickness,
    /// Conductivity of all layers, at the same contacts (logarithm).
    Conductivity,
    /// Conductivity at the top over that at the bottom (logarithm); the sheet conductance stays.
    TopOverBottom,
    /// Amplitude of a cosine of unevenness, by its half waves along both sides.
    Uneven([usize; 2]),
    /// Place of an electrode along x (m).
    ElectrodeX(usize),
    /// Place of an electrode along y (m).
    ElectrodeY(usize),
    /// Contact impedance of all pads (logarithm).
    Pads,
    /// Contact impedance of one pad (logarithm).
    Pad(usize),
    /// What a channel reads over what is there (logarithm).
    Gain(usize),
    /// What a channel reads besides what is there, and at rest does not show (V).
    Offset(usize),
    /// On-resistance of the multiplexer (logarithm).
    OnResistance,
}

/// Most half waves of unevenness along a side.
const MOST_UNEVEN: usize = 7;

impl Parameter {
    /// All of a detector, with modes of unevenness of wavelengths down to a share of the shorter side.
    pub fn all(detector: &Detector, shortest_wave: f64) -> Vec<Self> {
        let electrodes = || 0..detector.electrodes.len();
        let one = [Self::Thickness, Self::Conductivity, Self::TopOverBottom, Self::OnResistance, Self::Pads];
        let uneven = Self::uneven_modes(detector, 2.0 / shortest_wave).map(Self::Uneven);
        let of_electrode =
            |e| [Self::ElectrodeX(e), Self::ElectrodeY(e), Self::Pad(e), Self::Gain(e), Self::Offset(e)];
        let each = electrodes().flat_map(of_electrode);
        one.into_iter().chain(uneven).chain(each).collect()
    }

    /// Modes of unevenness of up to so many half waves on the shorter side.
    pub(super) fn uneven_modes(detector: &Detector, half_waves: f64) -> impl Iterator<Item = [usize; 2]> {
        let size_m = detector.outline.size_m();
        let shorter_m = size_m[0].min(size_m[1]);
        let within = move |mode: &[usize; 2]| {
            let waves = mode.iter().zip(size_m).map(|(m, side_m)| (*m as f64 * shorter_m / side_m).powi(2));
            *mode != [0, 0] && waves.sum::<f64>() <= half_waves * half_waves
        };
        (0..=MOST_UNEVEN).flat_map(|i| (0..=MOST_UNEVEN).map(move |j| [i, j])).filter(within)
    }

    /// The electrode that it is of, if it is one's.
    pub fn electrode(self) -> Option<usize> {
        match self {
            Self::ElectrodeX(e) | Self::ElectrodeY(e) | Self::Pad(e) | Self::Gain(e) | Self::Offset(e) => Some(e),
            _ => None,
        }
    }

    /// The same of another electrode, if it is one's.
    #[must_use]
    pub fn with_electrode(self, e: usize) -> Self {
        match self {
            Self::ElectrodeX(_) => Self::ElectrodeX(e),
            Self::ElectrodeY(_) => Self::ElectrodeY(e),
            Self::Pad(_) => Self::Pad(e),
            Self::Gain(_) => Self::Gain(e),
            Self::Offset(_) => Self::Offset(e),
            other => other,
        }
    }

    /// Whether its steps are logarithms.
    pub fn is_log(self) -> bool {
        !matches!(self, Self::ElectrodeX(_) | Self::ElectrodeY(_) | Self::Offset(_))
    }

    /// Whether it belongs to the board that measures, and not to the detector.
    pub fn is_of_board(self) -> bool {
        matches!(self, Self::Gain(_) | Self::Offset(_) | Self::OnResistance)
    }
}

impl Detector {
    /// This detector with some of its parameters changed by steps in their units. An electrode stays within the outline.
    pub fn stepped(&self, steps: &[(Parameter, f64)]) -> Self {
        let mut detector = self.clone();
        steps.iter().for_each(|(parameter, step)| detector.step(*parameter, *step));
        detector
    }

    fn step(&mut self, parameter: Parameter, step: f64) {
        match parameter {
            Parameter::Thickness => self.layers.iter_mut().for_each(|layer| layer.thickness_m *= step.exp()),
            Parameter::Conductivity => self.layers.iter_mut().for_each(|layer| layer.scale(step.exp())),
            Parameter::TopOverBottom => self.tilt(step),
            Parameter::Uneven(mode) => self.unevenness.add(mode, step),
            Parameter::ElectrodeX(e) => self.move_electrode(e, [step, 0.0]),
            Parameter::ElectrodeY(e) => self.move_electrode(e, [0.0, step]),
            Parameter::Pads => {
                self.contact_impedance_ohm_m2 *= step.exp();
                (0..self.electrodes.len()).for_each(|e| self.scale_pad(e, step.exp()));
            }
            Parameter::Pad(e) => {
                self.electrodes[e].contact_impedance_ohm_m2.get_or_insert(self.contact_impedance_ohm_m2);
                self.scale_pad(e, step.exp());
            }
            Parameter::Gain(e) => self.electrodes[e].gain *= step.exp(),
            Parameter::Offset(e) => self.electrodes[e].unseen_offset_v += step,
            Parameter::OnResistance => self.on_resistance_ohm *= step.exp(),
        }
    }

    /// Multiplies the conductivity by `exp(log (z / T - 1/2))`, and by what keeps the sheet conductance.
    fn tilt(&mut self, log: f64) {
        let (thickness_m, sheet_s) = (self.thickness_m(), self.sheet_conductance_s());
        let mut at_m = 0.0;
        for layer in &mut self.layers {
            let factor = |z_m: f64| (log * (z_m / thickness_m - 0.5)).exp();
            layer.bottom_s_per_m *= factor(at_m);
            at_m += layer.thickness_m;
            layer.top_s_per_m *= factor(at_m);
        }
        let scale = sheet_s / self.sheet_conductance_s();
        self.layers.iter_mut().for_each(|layer| layer.scale(scale));
    }

    fn move_electrode(&mut self, e: usize, by_m: [f64; 2]) {
        let [low, high] = self.outline.bounds();
        let pad = &mut self.electrodes[e];
        let within = |axis: usize, at_m: f64| {
            let (first_m, last_m) = (low[axis] + pad.radius_m, high[axis] - pad.radius_m);
            if first_m < last_m { at_m.clamp(first_m * INSIDE, last_m * INSIDE) } else { at_m }
        };
        let (x_m, y_m) = (within(0, pad.x_m + by_m[0]), within(1, pad.y_m + by_m[1]));
        (pad.x_m, pad.y_m) = (x_m, y_m);
    }

    fn scale_pad(&mut self, e: usize, factor: f64) {
        if let Some(ohm_m2) = &mut self.electrodes[e].contact_impedance_ohm_m2 {
            *ohm_m2 *= factor;
        }
    }
}

/// Share of the way to the wall up to which a pad may be moved: it does not touch the wall.
const INSIDE: f64 = 0.9999;

impl Layer {
    fn scale(&mut self, factor: f64) {
        self.bottom_s_per_m *= factor;
        self.top_s_per_m *= factor;
    }
}

/// Form of all parameters, for messages.
const FORMS: &str =
    "thickness, conductivity, top-over-bottom, uneven:1,0, x:3, y:3, pads, pad:3, gain:3, offset:3 or on-resistance";

impl fmt::Display for Parameter {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Thickness => formatter.write_str("thickness"),
            Self::Conductivity => formatter.write_str("conductivity"),
            Self::TopOverBottom => formatter.write_str("top-over-bottom"),
            Self::Uneven([i, j]) => write!(formatter, "uneven:{i},{j}"),
            Self::ElectrodeX(e) => write!(formatter, "x:{e}"),
            Self::ElectrodeY(e) => write!(formatter, "y:{e}"),
            Self::Pads => formatter.write_str("pads"),
            Self::Pad(e) => write!(formatter, "pad:{e}"),
            Self::Gain(e) => write!(formatter, "gain:{e}"),
            Self::Offset(e) => write!(formatter, "offset:{e}"),
            Self::OnResistance => formatter.write_str("on-resistance"),
        }
    }
}

impl FromStr for Parameter {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let wrong = || format!("`{text}` is no parameter of a detector: {FORMS}");
        let (name, index) = text.split_once(':').unwrap_or((text, ""));
        let number = |text: &str| text.parse::<usize>().map_err(|_| wrong());
        match name {
            "thickness" => Ok(Self::Thickness),
            "conductivity" => Ok(Self::Conductivity),
            "top-over-bottom" => Ok(Self::TopOverBottom),
            "pads" => Ok(Self::Pads),
            "on-resistance" => Ok(Self::OnResistance),
            "x" => Ok(Self::ElectrodeX(number(index)?)),
            "y" => Ok(Self::ElectrodeY(number(index)?)),
            "pad" => Ok(Self::Pad(number(index)?)),
            "gain" => Ok(Self::Gain(number(index)?)),
            "offset" => Ok(Self::Offset(number(index)?)),
            "uneven" => {
                let (i, j) = index.split_once(',').ok_or_else(wrong)?;
                Ok(Self::Uneven([number(i)?, number(j)?]))
            }
            _ => Err(wrong()),
        }
    }
}
