//! What of a detector is known to a tolerance only, quantity by quantity.

use std::fmt;
use std::str::FromStr;

use super::{Detector, Layer};
use crate::space::Place;

/// A quantity of a detector that differs between paper and bench. Its steps are in the unit given: logarithms are of the factor by which
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
    /// Sheet resistance of the driving layer (ohm per square). Detectors are described, and modelled, under one of none: it is in what their
    /// readings may be off by alone.
    DrivingSheet,
}

/// Most half waves of unevenness along a side.
const MOST_UNEVEN: usize = 7;

impl Parameter {
    /// All of a detector, with modes of unevenness of wavelengths down to a share of the shorter side.
    pub fn all(detector: &Detector, shortest_wave: f64) -> Vec<Self> {
        let electrodes = || 0..detector.electrodes.len();
        let one = [Self::Thickness, Self::Conductivity, Self::TopOverBottom, Self::OnResistance, Self::Pads];
        let uneven = Self::uneven_modes(detector, 2.0 / shortest_wave).map(Self::Uneven);
        let of_electrode = |e| [Self::ElectrodeX(e), Self::ElectrodeY(e), Self::Pad(e), Self::Gain(e), Self::Offset(e)];
        let each = electrodes().flat_map(of_electrode);
        one.into_iter().chain(uneven).chain(each).chain([Self::DrivingSheet]).collect()
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

    /// This quantity of another electrode, if it is one's.
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
        !matches!(self, Self::ElectrodeX(_) | Self::ElectrodeY(_) | Self::Offset(_) | Self::DrivingSheet)
    }

    /// Whether it belongs to the board that measures, and not to the detector.
    pub fn is_of_board(self) -> bool {
        matches!(self, Self::Gain(_) | Self::Offset(_) | Self::OnResistance)
    }
}

impl Detector {
    /// This detector with some of its parameters changed by steps in their units. An electrode stays within the outline's bounding box, or on
    /// the surface; the driving layer, which is no part of a detector, changes nothing.
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
            Parameter::DrivingSheet => {}
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
        let [x_m, y_m, z_m] = self.electrodes[e].place_m();
        self.put_electrode(e, [x_m + by_m[0], y_m + by_m[1], z_m]);
    }

    /// Puts a pad to a place, but not beyond the outline's bounding box; on a curved detector, to the nearest place of the surface.
    pub(crate) fn put_electrode(&mut self, e: usize, place_m: Place) {
        let [low, high] = self.outline.bounds();
        let pad = &mut self.electrodes[e];
        let within = |axis: usize| {
            let (first_m, last_m) = (low[axis] + pad.radius_m, high[axis] - pad.radius_m);
            let at_m = place_m[axis];
            if first_m < last_m { at_m.clamp(first_m * INSIDE, last_m * INSIDE) } else { at_m }
        };
        [pad.x_m, pad.y_m, pad.z_m] = match &self.surface {
            Some(surface) => surface.nearest(place_m).place_m,
            None => [within(0), within(1), place_m[2]],
        };
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
const FORMS: &str = "thickness, conductivity, top-over-bottom, uneven:1,0, x:3, y:3, pads, pad:3, gain:3, offset:3, \
     on-resistance or driving-sheet";

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
            Self::DrivingSheet => formatter.write_str("driving-sheet"),
        }
    }
}

/// A name that no [`Parameter`] has.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("`{0}` is no parameter of a detector: {FORMS}")]
pub struct UnknownParameter(pub String);

impl FromStr for Parameter {
    type Err = UnknownParameter;

    fn from_str(text: &str) -> Result<Self, UnknownParameter> {
        let wrong = || UnknownParameter(text.to_owned());
        let number = |text: &str| text.parse::<usize>().map_err(|_| wrong());
        match text.split_once(':') {
            None => match text {
                "thickness" => Ok(Self::Thickness),
                "conductivity" => Ok(Self::Conductivity),
                "top-over-bottom" => Ok(Self::TopOverBottom),
                "pads" => Ok(Self::Pads),
                "on-resistance" => Ok(Self::OnResistance),
                "driving-sheet" => Ok(Self::DrivingSheet),
                _ => Err(wrong()),
            },
            Some(("uneven", modes)) => {
                let (i, j) = modes.split_once(',').ok_or_else(wrong)?;
                Ok(Self::Uneven([number(i)?, number(j)?]))
            }
            Some(("x", e)) => Ok(Self::ElectrodeX(number(e)?)),
            Some(("y", e)) => Ok(Self::ElectrodeY(number(e)?)),
            Some(("pad", e)) => Ok(Self::Pad(number(e)?)),
            Some(("gain", e)) => Ok(Self::Gain(number(e)?)),
            Some(("offset", e)) => Ok(Self::Offset(number(e)?)),
            Some(_) => Err(wrong()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::detector::{CalibratedParameter, Calibration, Outline};
    use proptest::prelude::*;

    fn layered() -> Detector {
        let lower = Layer::graded(0.002, [0.4, 0.1]);
        Detector { layers: vec![lower, Layer::uniform(0.003, 0.2273)], ..Detector::default() }
    }

    fn stepped(parameter: Parameter, step: f64) -> Detector {
        layered().stepped(&[(parameter, step)])
    }

    fn is_near(found: f64, expected: f64) -> bool {
        (found / expected - 1.0).abs() < 1e-12
    }

    #[test]
    fn thickness_and_conductivity_are_those_of_every_layer() {
        let (before, factor) = (layered(), 0.3f64.exp());
        let thicker = stepped(Parameter::Thickness, 0.3);
        let better = stepped(Parameter::Conductivity, 0.3);
        for (layer, (thick, good)) in before.layers.iter().zip(thicker.layers.iter().zip(&better.layers)) {
            assert!(is_near(thick.thickness_m, factor * layer.thickness_m));
            assert_eq!((thick.bottom_s_per_m, thick.top_s_per_m), (layer.bottom_s_per_m, layer.top_s_per_m));
            assert!(is_near(good.bottom_s_per_m, factor * layer.bottom_s_per_m));
            assert!(is_near(good.top_s_per_m, factor * layer.top_s_per_m));
            assert_eq!(good.thickness_m, layer.thickness_m);
        }
        for changed in [thicker, better] {
            assert!(is_near(changed.sheet_conductance_s(), factor * before.sheet_conductance_s()));
            assert_eq!(changed.electrodes, before.electrodes);
        }
    }

    #[test]
    fn a_tilt_keeps_the_sheet_conductance_and_multiplies_top_over_bottom() {
        let before = layered();
        let ends = |detector: &Detector| detector.layers[1].top_s_per_m / detector.layers[0].bottom_s_per_m;
        for step in [-2.0, -0.1, 0.0, 0.7, 3.0] {
            let tilted = stepped(Parameter::TopOverBottom, step);
            assert!(is_near(tilted.sheet_conductance_s(), before.sheet_conductance_s()), "{step}");
            assert!(is_near(ends(&tilted), step.exp() * ends(&before)), "{step}");
            // Where two layers meet both are multiplied alike.
            let jump = |detector: &Detector| detector.layers[1].bottom_s_per_m / detector.layers[0].top_s_per_m;
            assert!(is_near(jump(&tilted), jump(&before)), "{step}");
            assert_eq!(tilted.thickness_m(), before.thickness_m());
        }
    }

    #[test]
    fn pads_change_alike_or_alone() {
        let before = layered();
        let ohm_m2 = |detector: &Detector, e: usize| detector.pad_impedance_ohm_m2(&detector.electrodes[e]);
        let all = stepped(Parameter::Pads, 1.0);
        assert!((0..16).all(|e| is_near(ohm_m2(&all, e), 1f64.exp() * ohm_m2(&before, e))));
        let both = layered().stepped(&[(Parameter::Pad(3), 0.5), (Parameter::Pads, 1.0)]);
        assert!(is_near(ohm_m2(&both, 3), 1.5f64.exp() * ohm_m2(&before, 3)));
        assert!(is_near(ohm_m2(&both, 4), 1f64.exp() * ohm_m2(&before, 4)));
    }

    #[test]
    fn what_is_of_a_channel_or_of_the_board_changes_nothing_else() {
        let before = layered();
        let mut gain = stepped(Parameter::Gain(5), 0.01);
        assert!(is_near(gain.electrodes[5].gain, 0.01f64.exp()));
        gain.electrodes[5].gain = 1.0;
        assert_eq!(gain, before);
        let mut switch = stepped(Parameter::OnResistance, -0.2);
        assert!(is_near(switch.on_resistance_ohm, (-0.2f64).exp() * before.on_resistance_ohm));
        switch.on_resistance_ohm = before.on_resistance_ohm;
        assert_eq!(switch, before);
        assert!(Parameter::all(&before, 0.5).into_iter().filter(|it| it.is_of_board()).count() == 33);
    }

    #[test]
    fn unevenness_is_added_to() {
        let twice = layered().stepped(&[(Parameter::Uneven([1, 2]), 0.1), (Parameter::Uneven([1, 2]), -0.04)]);
        let modes: Vec<_> = twice.unevenness.modes().collect();
        assert!(modes.len() == 1 && modes[0].0 == [1, 2] && (modes[0].1 - 0.06).abs() < 1e-15, "{modes:?}");
        // From the corner, cos(0) cos(0); in the middle of x, cos(pi / 2).
        assert!((twice.log_unevenness([-0.03, -0.03]) - 0.06).abs() < 1e-15);
        assert!(twice.log_unevenness([0.0, -0.03]).abs() < 1e-15);
    }

    #[test]
    fn electrodes_move_up_to_the_wall_and_on_a_surface_along_it() {
        let moved = layered().stepped(&[(Parameter::ElectrodeX(0), 1e-3), (Parameter::ElectrodeY(0), -1.0)]);
        let [pad, before] = [moved.electrodes[0], layered().electrodes[0]];
        assert!((pad.x_m - before.x_m - 1e-3).abs() < 1e-15);
        assert!(moved.has_room_for(0) && pad.y_m < -0.0279, "{pad:?}");

        let file = concat!(env!("CARGO_MANIFEST_DIR"), "/../examples/detectors/fingertip.toml");
        let curved = Detector::read(file.as_ref()).unwrap();
        let moved = curved.stepped(&[(Parameter::ElectrodeX(3), 5e-4)]);
        let (place_m, surface) = (moved.electrodes[3].place_m(), curved.surface.as_ref().unwrap());
        assert!(crate::space::distance(surface.nearest(place_m).place_m, place_m) < 1e-9);
        assert!(crate::space::distance(place_m, curved.electrodes[3].place_m()) > 5e-5);
    }

    #[test]
    fn modes_of_unevenness_go_down_to_a_wavelength() {
        let modes = |detector: &Detector, wave| {
            let all = Parameter::all(detector, wave).into_iter();
            all.filter_map(|it| if let Parameter::Uneven(mode) = it { Some(mode) } else { None }).collect::<Vec<_>>()
        };
        // Half waves (i, j) with i^2 + j^2 <= 2^2, but (0, 0).
        assert_eq!(modes(&layered(), 1.0), [[0, 1], [0, 2], [1, 0], [1, 1], [2, 0]]);
        let long = Detector { outline: Outline::rectangle(0.12, 0.06), ..layered() };
        assert!(modes(&long, 1.0).contains(&[4, 0]) && !modes(&long, 1.0).contains(&[4, 1]));
    }

    #[test]
    fn a_calibration_keeps_what_is_of_the_electrodes_kept_by_their_new_numbers() {
        let known = |parameter, standard_error| CalibratedParameter { parameter, standard_error, is_prior: false };
        let calibration = Calibration {
            parameters: vec![
                known(Parameter::Thickness, 0.01),
                known(Parameter::Gain(2), 0.02),
                known(Parameter::ElectrodeX(7), 0.03),
            ],
            directions: vec![vec![0.1, 0.2, 0.3], vec![0.0, 0.0, 0.4]],
            ..Calibration::default()
        };
        let detector = Detector { calibration: Some(calibration), ..layered() };
        let kept = detector.keeping(&[9, 7, 1]).calibration.unwrap();
        let parameters = [known(Parameter::Thickness, 0.01), known(Parameter::ElectrodeX(1), 0.03)];
        assert_eq!(kept.parameters, parameters);
        assert_eq!(kept.directions, [[0.1, 0.3], [0.0, 0.4]]);
        let unknown = detector.keeping(&[9, 7, 1]).unknowns().directions;
        assert_eq!(unknown[0], [(Parameter::Thickness, 0.1), (Parameter::ElectrodeX(1), 0.3)]);
        assert_eq!(unknown[1], [(Parameter::ElectrodeX(1), 0.4)], "what does not change is not listed");
    }

    fn any_parameter() -> impl Strategy<Value = Parameter> {
        prop_oneof![
            Just(Parameter::Thickness),
            Just(Parameter::Conductivity),
            Just(Parameter::TopOverBottom),
            Just(Parameter::Pads),
            Just(Parameter::OnResistance),
            Just(Parameter::DrivingSheet),
            [any::<usize>(), any::<usize>()].prop_map(Parameter::Uneven),
            any::<usize>().prop_map(Parameter::ElectrodeX),
            any::<usize>().prop_map(Parameter::ElectrodeY),
            any::<usize>().prop_map(Parameter::Pad),
            any::<usize>().prop_map(Parameter::Gain),
            any::<usize>().prop_map(Parameter::Offset),
        ]
    }

    proptest! {
        #[test]
        fn every_parameter_goes_through_its_text(parameter in any_parameter()) {
            prop_assert_eq!(parameter.to_string().parse::<Parameter>().unwrap(), parameter);
        }

        #[test]
        fn no_text_panics(text in "[a-z:,0-9-]{0,12}") {
            if let Ok(parameter) = text.parse::<Parameter>() {
                prop_assert_eq!(parameter.to_string().parse::<Parameter>().unwrap(), parameter);
            }
        }
    }

    #[test]
    fn other_texts_say_what_there_is() {
        for text in ["", "gain", "gain:", "gain:-1", "uneven:1", "uneven:1,x", "pads:3", "X:1", "thickness:0"] {
            let error = text.parse::<Parameter>().unwrap_err().to_string();
            assert!(error.contains("top-over-bottom") && error.contains(&format!("`{text}`")), "{error}");
        }
    }
}
