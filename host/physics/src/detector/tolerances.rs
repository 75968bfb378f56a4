//! How far a detector may be from its description.

use std::f64::consts::PI;

use super::{Detector, Parameter};

/// Standard deviations between a detector on paper and the one that was built. Without any, the description is taken as exact.
///
/// The defaults are what a hobbyist's bench gives: foam cut by hand, of a supplier who tells the conductivity of a batch and not where in it
/// a sheet comes from; electrodes placed on a printed mark; pads pressed or glued on; converters within their data sheet.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Tolerances {
    /// Of the thickness, as a share of it.
    pub thickness_share: f64,
    /// Of the conductivity, as a share of it.
    pub conductivity_share: f64,
    /// Of the top's conductivity over the bottom's: a factor, of at least 1.
    pub top_over_bottom_factor: f64,
    /// Of the conductivity from place to place, as a share of it; it changes over a quarter of the shorter side.
    pub uneven_share: f64,
    /// Of an electrode's x and y (m).
    pub electrodes_m: f64,
    /// Of all pads' contact impedance: a factor, of at least 1.
    pub contact_impedance_factor: f64,
    /// Of a pad's contact impedance from that of the others, as a share of it.
    pub contact_impedance_spread: f64,
    /// Of what a channel reads, as a share of what is there.
    pub gain_share: f64,
    /// Of what a channel reads where nothing is, in codes of the converter (LSB). A baseline takes it away, where the converter does not
    /// cut it off at zero.
    pub offset_lsb: f64,
    /// Of the multiplexer's on-resistance, as a share of it.
    pub on_resistance_share: f64,
    /// Of the driving layer's sheet resistance from none (ohm per square), in the root of the mean square. Of a file whose other tolerances are
    /// all nothing it is nothing too, unless it is given.
    #[serde(default = "not_given")]
    pub driving_sheet_ohm: f64,
}

/// Stands for a sheet resistance that a file does not give, until it is [settled](Tolerances::settled).
fn not_given() -> f64 {
    f64::NAN
}

/// Length over which the conductivity changes, as a share of the shorter side.
const UNEVEN_LENGTH: f64 = 0.25;

impl Tolerances {
    /// None: the detector is as it is described.
    pub const EXACT: Self = Self {
        thickness_share: 0.0,
        conductivity_share: 0.0,
        top_over_bottom_factor: 1.0,
        uneven_share: 0.0,
        electrodes_m: 0.0,
        contact_impedance_factor: 1.0,
        contact_impedance_spread: 0.0,
        gain_share: 0.0,
        offset_lsb: 0.0,
        on_resistance_share: 0.0,
        driving_sheet_ohm: 0.0,
    };

    /// As they were read, with what was not given of the driving layer: nothing where all else is exact, else the default.
    pub(super) fn settled(self) -> Self {
        let given = |driving_sheet_ohm| Self { driving_sheet_ohm, ..self };
        match self.driving_sheet_ohm.is_nan() {
            true if given(0.0).is_exact() => Self::EXACT,
            true => given(Self::default().driving_sheet_ohm),
            false => self,
        }
    }

    /// Whether there are none.
    pub fn is_exact(&self) -> bool {
        *self == Self::EXACT
    }

    /// All of them so many times: factors to that power. At 0 there are none.
    #[must_use]
    pub fn times(&self, factor: f64) -> Self {
        Self {
            thickness_share: factor * self.thickness_share,
            conductivity_share: factor * self.conductivity_share,
            top_over_bottom_factor: self.top_over_bottom_factor.powf(factor),
            uneven_share: factor * self.uneven_share,
            electrodes_m: factor * self.electrodes_m,
            contact_impedance_factor: self.contact_impedance_factor.powf(factor),
            contact_impedance_spread: factor * self.contact_impedance_spread,
            gain_share: factor * self.gain_share,
            offset_lsb: factor * self.offset_lsb,
            on_resistance_share: factor * self.on_resistance_share,
            driving_sheet_ohm: factor * self.driving_sheet_ohm,
        }
    }

    /// All of them by the names that they have in a file.
    pub fn named(&self) -> [(&'static str, f64); 11] {
        [
            ("thickness_share", self.thickness_share),
            ("conductivity_share", self.conductivity_share),
            ("top_over_bottom_factor", self.top_over_bottom_factor),
            ("uneven_share", self.uneven_share),
            ("electrodes_m", self.electrodes_m),
            ("contact_impedance_factor", self.contact_impedance_factor),
            ("contact_impedance_spread", self.contact_impedance_spread),
            ("gain_share", self.gain_share),
            ("offset_lsb", self.offset_lsb),
            ("on_resistance_share", self.on_resistance_share),
            ("driving_sheet_ohm", self.driving_sheet_ohm),
        ]
    }

    /// Standard deviation of one of the detector's parameters, in its unit.
    pub fn deviation(&self, detector: &Detector, parameter: Parameter) -> f64 {
        match parameter {
            Parameter::Thickness => self.thickness_share,
            Parameter::Conductivity => self.conductivity_share,
            Parameter::TopOverBottom => self.top_over_bottom_factor.ln(),
            Parameter::Uneven(mode) => self.uneven_share * uneven_share_of(detector, mode),
            Parameter::ElectrodeX(_) | Parameter::ElectrodeY(_) => self.electrodes_m,
            Parameter::Pads => self.contact_impedance_factor.ln(),
            Parameter::Pad(_) => self.contact_impedance_spread,
            Parameter::Gain(_) => self.gain_share,
            // A baseline takes away those above zero: half of them.
            Parameter::Offset(_) => 0.5f64.sqrt() * self.offset_lsb * detector.adc.lsb_v(),
            Parameter::OnResistance => self.on_resistance_share,
            Parameter::DrivingSheet => self.driving_sheet_ohm,
        }
    }
}

impl Default for Tolerances {
    fn default() -> Self {
        Self {
            thickness_share: 0.1,
            conductivity_share: 0.2,
            top_over_bottom_factor: 2.0,
            uneven_share: 0.06,
            electrodes_m: 0.3e-3,
            contact_impedance_factor: 3.0,
            contact_impedance_spread: 0.3,
            gain_share: 0.003,
            offset_lsb: 2.0,
            on_resistance_share: 0.25,
            driving_sheet_ohm: 100.0,
        }
    }
}

/// Standard deviation of a cosine's amplitude, where that of the logarithm of the conductivity is one over the plane: its covariance is
/// `exp(-d^2 / 2 l^2)`, so that the power of a mode is `exp(-k^2 l^2 / 2)`.
fn uneven_share_of(detector: &Detector, mode: [usize; 2]) -> f64 {
    let size_m = detector.outline.size_m();
    let length_m = UNEVEN_LENGTH * size_m[0].min(size_m[1]);
    let power = |[i, j]: [usize; 2]| {
        let k = [i, j].iter().zip(size_m).map(|(m, side_m)| (*m as f64 * PI / side_m).powi(2)).sum::<f64>();
        (-0.5 * k * length_m * length_m).exp()
    };
    let all: f64 = Parameter::uneven_modes(detector, f64::INFINITY).map(power).sum();
    let mean_square: f64 = mode.iter().map(|m| if *m == 0 { 1.0 } else { 0.5 }).product();
    (power(mode) / all / mean_square).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::detector::Outline;

    #[test]
    fn each_parameter_has_the_deviation_of_its_kind() {
        let detector = Detector::default();
        let of = |parameter| detector.tolerances.deviation(&detector, parameter);
        assert_eq!([of(Parameter::Thickness), of(Parameter::Conductivity)], [0.1, 0.2]);
        assert_eq!([of(Parameter::TopOverBottom), of(Parameter::Pads)], [2f64.ln(), 3f64.ln()]);
        assert_eq!([of(Parameter::ElectrodeX(3)), of(Parameter::ElectrodeY(3))], [3e-4; 2]);
        assert_eq!([of(Parameter::Pad(3)), of(Parameter::Gain(3)), of(Parameter::OnResistance)], [0.3, 0.003, 0.25]);
        let exact = |parameter| Tolerances::EXACT.deviation(&detector, parameter);
        assert!(Parameter::all(&detector, 0.0).into_iter().all(|parameter| exact(parameter) == 0.0));
        assert!(Tolerances::EXACT.is_exact() && !Tolerances::default().is_exact());
    }

    #[test]
    fn a_file_of_an_exact_detector_is_exact_without_a_word_of_the_driving_layer() {
        let read = |more: &str| {
            let table = Tolerances::EXACT.named().map(|(name, value)| format!("{name} = {value:?}\n"));
            let others = table.into_iter().filter(|line| !line.starts_with("driving")).collect::<String>();
            let text = Detector { tolerances: Tolerances::default(), ..Detector::default() }.to_toml();
            Detector::from_toml(&format!("{text}\n[tolerances]\n{others}{more}"), "").unwrap().tolerances
        };
        assert!(read("").is_exact());
        assert_eq!(read("driving_sheet_ohm = 30.0\n"), Tolerances { driving_sheet_ohm: 30.0, ..Tolerances::EXACT });
        assert_eq!(Detector::from_toml(&Detector::default().to_toml(), "").unwrap().tolerances, Tolerances::default());
    }

    #[test]
    fn tolerances_scale_in_their_units() {
        let (detector, twice) = (Detector::default(), Tolerances::default().times(2.0));
        for parameter in Parameter::all(&detector, 0.5) {
            let of = |tolerances: &Tolerances| tolerances.deviation(&detector, parameter);
            assert!((of(&twice) / of(&detector.tolerances) - 2.0).abs() < 1e-12, "{parameter}");
        }
        assert_eq!((twice.offset_lsb, Tolerances::default().times(0.0)), (4.0, Tolerances::EXACT));
    }

    /// Mean square of the unevenness over the plane and over all detectors, and its correlation a quarter of the width apart: `exp(-1/2)`.
    #[test]
    fn unevenness_is_as_large_and_as_long_as_given() {
        for size_m in [[0.06, 0.06], [0.14, 0.07]] {
            let detector = Detector { outline: Outline::rectangle(size_m[0], size_m[1]), ..Detector::default() };
            let variance = |mode: [usize; 2]| detector.tolerances.deviation(&detector, Parameter::Uneven(mode)).powi(2);
            let covariance = |a: [f64; 2], b: [f64; 2]| {
                let mode = |mode: [usize; 2]| {
                    let wave = |at: [f64; 2]| {
                        (0..2)
                            .map(|axis| (mode[axis] as f64 * PI * (at[axis] / size_m[axis] + 0.5)).cos())
                            .product::<f64>()
                    };
                    variance(mode) * wave(a) * wave(b)
                };
                Parameter::uneven_modes(&detector, f64::INFINITY).map(mode).sum::<f64>()
            };
            let points =
                || (0..24).flat_map(|i| (0..24).map(move |j| [i, j].map(|k| (f64::from(k) + 0.5) / 24.0 - 0.5)));
            let at = |share: [f64; 2]| [share[0] * size_m[0], share[1] * size_m[1]];
            let mean = points().map(|point| covariance(at(point), at(point))).sum::<f64>() / 576.0;
            assert!((mean.sqrt() / 0.06 - 1.0).abs() < 1e-6, "{}", mean.sqrt());
            let length_m = 0.25 * size_m[0].min(size_m[1]);
            // The mean over the plane is left out, as that is the conductivity: what is far apart shows by how much.
            let far = covariance(at([-0.5, -0.5]), at([0.5, 0.5]));
            let beyond = |b: [f64; 2]| covariance([0.0, 0.0], b) - far;
            let there = beyond([length_m, 0.0]) / beyond([0.0, 0.0]);
            assert!((there - (-0.5f64).exp()).abs() < 0.02, "{there}");
        }
    }
}
