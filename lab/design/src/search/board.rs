//! The board that reads a detector, as far as it decides what the detector gives.

use tactomo_physics::detector::{Adc, ConverterErrors, Detector};

/// What a board makes of a detector's voltages, and how often. The figures are those of the simulated board of that name.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Board {
    /// Its name.
    pub name: String,
    /// Its converter.
    pub adc: Adc,
    /// Voltage that the multiplexer's ground is lifted to (V), so that nothing lies below the converters' floors.
    pub ground_v: f64,
    /// What is known of its converters' errors; empty if there are none.
    #[serde(skip)]
    pub converters: Vec<ConverterErrors>,
    /// Which of them each electrode is on that it has an input for.
    #[serde(skip)]
    pub inputs: Vec<usize>,
    /// Frames a second of one electrode, of two, and so on, at the settings after a reset.
    pub frames_per_s: Vec<f64>,
}

impl Board {
    /// Most electrodes that it has inputs for.
    pub fn most_electrodes(&self) -> usize {
        self.inputs.len()
    }

    /// Frames a second of so many electrodes; none of more than it has inputs for.
    pub fn frames_per_s(&self, electrodes: usize) -> f64 {
        electrodes.checked_sub(1).and_then(|index| self.frames_per_s.get(index).copied()).unwrap_or(0.0)
    }

    /// Voltage above that of a grounded electrode below which it reads nothing (V): the highest floor of its converters, zero where nothing hides.
    pub fn floor_v(&self) -> f64 {
        self.converters.iter().map(|converter| converter.range_v[0] - self.ground_v).fold(0.0, f64::max)
    }

    /// Whether it hides light presses.
    pub fn has_floor(&self) -> bool {
        self.floor_v() > 0.0
    }

    /// A detector as it measures it.
    pub fn measuring(&self, mut detector: Detector) -> Detector {
        detector.adc = self.adc;
        detector.ground_v = self.ground_v;
        detector.converters = self.converters.clone();
        let ends_v = detector.converters.iter_mut().flat_map(|converter| &mut converter.range_v);
        ends_v.for_each(|end_v| *end_v -= self.ground_v);
        detector.electrodes.iter_mut().zip(&self.inputs).for_each(|(pad, input)| pad.converter = *input);
        detector
    }
}
