//! What a calibration says of a detector besides its quantities.

use super::Parameter;

/// Where a detector's quantities come from, and what is still unknown of them.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Calibration {
    /// Identity of the board that measured it; none for tables.
    pub board: Option<String>,
    /// Name of the one sensor that it is of, in files that are kept for the next time; none in those that a person asked for.
    pub sensor: Option<String>,
    /// What stands for the description that such a file began from: another one has another.
    pub description: Option<String>,
    /// When it was calibrated, as a date of ISO 8601.
    pub date: String,
    /// Frames that were used.
    pub frames: usize,
    /// Presses that were used.
    pub presses: usize,
    /// Standard error that places are expected to have (m): the median over the detector, of a press of medium firmness in one frame. `None` in
    /// files that do not say it.
    pub place_error_m: Option<f64>,
    /// Parameters, each with its standard error in its unit, and whether the readings said next to nothing of it.
    pub parameters: Vec<CalibratedParameter>,
    /// What is left unknown, as independent directions of one standard deviation: each has a step of each parameter, in their order.
    pub directions: Vec<Vec<f64>>,
}

/// A parameter after calibration.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CalibratedParameter {
    /// Which it is.
    pub parameter: Parameter,
    /// Its standard error, in its unit.
    pub standard_error: f64,
    /// Whether its standard error is still about that before: what is known of it is the description.
    pub is_prior: bool,
}

/// Ways in which a detector may differ from what is known of it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Unknowns {
    /// Independent directions of one standard deviation: steps of some parameters, in their units.
    pub directions: Vec<Vec<(Parameter, f64)>>,
}

/// Shortest wave of unevenness that is reckoned with, as a share of the shorter side: shorter ones have a hundredth of its power.
pub const SHORTEST_WAVE: f64 = 0.45;

impl super::Detector {
    /// What is not known of this detector: after a calibration what that left, else its tolerances.
    pub fn unknowns(&self) -> Unknowns {
        let directions = match &self.calibration {
            Some(calibration) => calibration.unknown_directions(),
            None => Parameter::all(self, SHORTEST_WAVE)
                .into_iter()
                .map(|parameter| vec![(parameter, self.tolerances.deviation(self, parameter))])
                .filter(|direction| direction[0].1 > 0.0)
                .collect(),
        };
        Unknowns { directions }
    }

    /// Whether it may be what a calibration has made of a description: what none changes is alike.
    pub fn may_be_of(&self, description: &Self) -> bool {
        let unchanged = |detector: &Self| {
            // Of a curved one the surface is, and the map's outline comes of that.
            let outline = detector.surface.is_none().then(|| detector.outline.clone());
            (detector.name.clone(), outline, detector.tolerances)
        };
        let counts = |detector: &Self| [detector.electrodes.len(), detector.layers.len()];
        unchanged(self) == unchanged(description) && counts(self) == counts(description)
    }
}

impl Calibration {
    /// What it says of some of the electrodes only.
    pub(super) fn keeping(self, kept: &[usize]) -> Self {
        // All fields by name, as in `Detector::keeping`.
        let Self { board, sensor, description, date, frames, presses, place_error_m, parameters, directions } = self;
        let renumbered = |known: &CalibratedParameter| match known.parameter.electrode() {
            Some(e) => kept.iter().position(|kept| *kept == e).map(|to| known.parameter.with_electrode(to)),
            None => Some(known.parameter),
        };
        let left: Vec<_> = parameters.iter().map(renumbered).collect();
        let of_left = |all: &Vec<f64>| all.iter().zip(&left).filter_map(|(step, to)| to.map(|_| *step)).collect();
        let with_number = |(known, to): (&CalibratedParameter, &Option<Parameter>)| {
            to.map(|parameter| CalibratedParameter { parameter, ..*known })
        };
        Self {
            parameters: parameters.iter().zip(&left).filter_map(with_number).collect(),
            directions: directions.iter().map(of_left).collect(),
            board,
            sensor,
            description,
            date,
            frames,
            presses,
            place_error_m,
        }
    }

    fn unknown_directions(&self) -> Vec<Vec<(Parameter, f64)>> {
        let named = |steps: &Vec<f64>| {
            let pairs = self.parameters.iter().map(|known| known.parameter).zip(steps.iter().copied());
            pairs.filter(|(_, step)| *step != 0.0).collect()
        };
        self.directions.iter().map(named).collect()
    }
}
