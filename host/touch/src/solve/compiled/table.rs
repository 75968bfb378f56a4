//! The table of a detector for [`tactomo_touch_core`]: contacts without a computer.
//!
//! Fields are those of the model that solvers invert, of an even current over a small and over a wide disc; splines are fitted to places all over the detector.

use nalgebra::DMatrix;

use tactomo_physics::detector::{ForceLaw, Parameter};
use tactomo_physics::forward::{DiscFields, ForwardError, Nuisance};
use tactomo_touch_core::Contents;
use tactomo_touch_core::table::{EVEN_SPREADING, Head, MAX_ELECTRODES, RADII};

use super::Modelled;
use super::between::{Between, Paired};
use super::splines::{Grid, Splines};
use super::unknown::{Unknown, tried_m};
use crate::solve::fit::linear::full_v;
use crate::solve::fit::target::{PAD_ERROR, model_error};

/// Radii of the small and of the wide disc, in usual ones.
const DISCS: [f64; RADII] = [0.6, 2.2];
/// What readings by a table are off from the model's, as a share of the largest: with it four or five contacts leave 0.9 of what they may, with 0.0006 0.75. Of 180 random
/// scenes of one to five contacts on `square-60` 139 have the right number of contacts, and 130 with 0.0006.
const TABLE_SHARE: f64 = 0.0003;
/// Why a detector has no table.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CompileError {
    /// Too many electrodes.
    #[error(
        "{detector}: it has {found} electrodes; tables are for {MAX_ELECTRODES} at most; the solvers `auto` and `contacts` take more"
    )]
    Electrodes {
        /// Its name.
        detector: String,
        /// How many it has.
        found: usize,
    },
    /// It is curved.
    #[error(
        "{detector}: it is curved, and tables are for flat detectors; the solvers `auto` and `contacts` work on it"
    )]
    Curved {
        /// Its name.
        detector: String,
    },
    /// No model.
    #[error(transparent)]
    Model(#[from] ForwardError),
    /// The fits failed.
    #[error("{detector}: its fields cannot be fitted by splines: {what}")]
    Fit {
        /// Its name.
        detector: String,
        /// What went wrong.
        what: &'static str,
    },
}

/// The table of a detector as its board measures it, by what is not known of it.
///
/// # Errors
/// [`CompileError`] if it is curved, has too many electrodes or no model.
pub fn compiled(modelled: Modelled<'_>, nuisance: Option<&Nuisance>) -> Result<Vec<u8>, CompileError> {
    Ok(written(modelled, &Fitted::of(modelled)?, Unknown::of(modelled, nuisance)))
}

/// What the tables of a detector are fitted with.
pub(super) struct Fitted {
    /// Over places.
    pub splines: Splines,
    /// Between places.
    pub paired: Paired,
    between: Between,
    /// Coefficients of all quantities of discs, a column each.
    quantities: DMatrix<f64>,
}

impl Fitted {
    /// Of a detector.
    ///
    /// # Errors
    /// [`CompileError`] if it is curved, has too many electrodes or no model.
    pub fn of(modelled: Modelled<'_>) -> Result<Self, CompileError> {
        let detector = modelled.detector;
        let found = detector.electrodes.len();
        if found > MAX_ELECTRODES {
            return Err(CompileError::Electrodes { detector: detector.name.clone(), found });
        }
        if detector.surface.is_some() {
            return Err(CompileError::Curved { detector: detector.name.clone() });
        }
        let (paired, between) = Paired::of(modelled)?;
        let splines = Splines::of(modelled)?;
        let of_place = |place_m: &[f64; 2]| {
            let [small, wide] = DISCS.map(|radii| of_disc(modelled, *place_m, radii * modelled.radius_m));
            Ok([small?, wide?].concat())
        };
        let values = splines.places_m().iter().map(of_place).collect::<Result<Vec<_>, ForwardError>>()?;
        Ok(Self { quantities: splines.fitted(&values), splines, paired, between })
    }

    /// The table for who knows [what is not known](super::changes::Changes) of the detector apart from it: of its errors it has those only that no readings tell.
    pub fn table_apart(&self, modelled: Modelled<'_>) -> Vec<u8> {
        let directions = modelled.detector.unknowns().directions;
        let conductivity = directions.iter().flatten().filter(|(parameter, _)| *parameter == Parameter::Conductivity);
        let square: f64 = conductivity.map(|(_, step)| step * step).sum();
        written(modelled, self, Unknown { ln_conductance: square.sqrt(), ..Unknown::default() })
    }
}

pub(super) fn failed(modelled: Modelled<'_>, what: &'static str) -> CompileError {
    CompileError::Fit { detector: modelled.detector.name.clone(), what }
}

/// All quantities of a disc.
fn of_disc(modelled: Modelled<'_>, place_m: [f64; 2], radius_m: f64) -> Result<Vec<f64>, ForwardError> {
    let DiscFields { electrodes_ohm, own_ohm, share } = modelled.model.disc_fields(place_m, radius_m)?;
    let even_ohm = EVEN_SPREADING / (top_s_per_m(modelled) * radius_m);
    Ok(electrodes_ohm.into_iter().chain([own_ohm - even_ohm, share]).collect())
}

fn top_s_per_m(modelled: Modelled<'_>) -> f64 {
    modelled.detector.layers.last().map_or(1.0, |layer| layer.top_s_per_m)
}

/// The bytes.
fn written(modelled: Modelled<'_>, fitted: &Fitted, unknown: Unknown) -> Vec<u8> {
    let Fitted { splines: Splines { grid, .. }, paired, between, quantities } = fitted;
    let detector = modelled.detector;
    let n = detector.electrodes.len();
    let pads_ohm = modelled.model.electrode_fields_ohm();
    let codes: Vec<_> = quantities.column_iter().map(|column| Code::of(column.as_slice())).collect();
    let coefficients = quantities
        .row_iter()
        .flat_map(|row| row.iter().zip(&codes).map(|(v, code)| code.of_value(*v)).collect::<Vec<_>>());
    let mut bytes = Vec::new();
    Contents {
        head: head(modelled, grid, paired, unknown),
        places_m: &detector.electrodes.iter().map(|pad| pad.place_m().map(|m| m as f32)).collect::<Vec<_>>(),
        sides: grid.sides(),
        pads_ohm: &floats((0..n).flat_map(|e| (0..=e).map(move |g| pads_ohm[(e, g)]))),
        channels: &detector
            .electrodes
            .iter()
            .map(|pad| [pad.gain, pad.unseen_offset_v].map(|v| v as f32))
            .collect::<Vec<_>>(),
        distances_ohm: &floats(between.distances.iter().copied()),
        walls: &floats(between.walls.iter().copied()),
        codes: &codes.iter().map(|code| [code.zero, code.step].map(|v| v as f32)).collect::<Vec<_>>(),
        mask: &mask(modelled, grid),
        coefficients: &coefficients.collect::<Vec<_>>(),
    }
    .write(&mut bytes);
    bytes
}

fn floats(values: impl IntoIterator<Item = f64>) -> Vec<f32> {
    values.into_iter().map(|value| value as f32).collect()
}

fn head(modelled: Modelled<'_>, grid: &Grid, paired: &Paired, unknown: Unknown) -> Head {
    let (detector, radius_m) = (modelled.detector, modelled.radius_m);
    // Without one, or where nothing is left of it, there is no scale for forces.
    let constriction_ohm = constriction_ohm(modelled).filter(|ohm| *ohm > 0.0);
    let law = detector.force.as_ref().filter(|_| constriction_ohm.is_some());
    let of_law = |value: fn(&ForceLaw) -> f64| law.map_or(0.0, value) as f32;
    Head {
        left_m: grid.low_m[0] as f32,
        bottom_m: grid.low_m[1] as f32,
        step_x_m: grid.step_m[0] as f32,
        step_y_m: grid.step_m[1] as f32,
        radius_m: radius_m as f32,
        radii_m: DISCS.map(|radii| (radii * radius_m) as f32),
        near_m: paired.ways.near_m as f32,
        ln_step: paired.ways.ln_step as f32,
        drive_v: detector.drive_v as f32,
        on_resistance_ohm: detector.on_resistance_ohm as f32,
        noise_v: detector.adc.deviation_v() as f32,
        model_share: model_error(&**modelled.model).hypot(TABLE_SHARE).hypot(unknown.share) as f32,
        shift_m: unknown.place_m as f32,
        ln_conductance_error: unknown.ln_conductance as f32,
        pad_share: PAD_ERROR as f32,
        full_v: full_v(detector) as f32,
        sheet_s: detector.sheet_conductance_s() as f32,
        top_s_per_m: top_s_per_m(modelled) as f32,
        constriction_ohm: constriction_ohm.unwrap_or(1.0) as f32,
        force_s: of_law(|law| law.conductance_at_1_n_s),
        force_exponent: of_law(|law| law.exponent),
        force_ohm: of_law(|law| law.series_ohm.unwrap_or(0.0)),
        force_most_n: of_law(ForceLaw::farthest_n),
    }
}

/// The constriction that makes conductances, less a disc's own field here, those that the host's meter finds with a spot's own field there (ohm). Both fields are
/// in the gauge in which the electrodes' mean is zero.
fn constriction_ohm(modelled: Modelled<'_>) -> Option<f64> {
    let radius_m = modelled.radius_m;
    let [x_m, y_m] = tried_m(modelled).next()?;
    let spot = modelled.model.spots(radius_m)?.spot([x_m, y_m, 0.0]);
    let count = spot.electrodes_ohm.len() as f64;
    let spot_ohm = spot.own_ohm - 2.0 * spot.electrodes_ohm.iter().sum::<f64>() / count;
    let beyond_even_ohm = *of_disc(modelled, [x_m, y_m], radius_m).ok()?.get(spot.electrodes_ohm.len())?;
    let disc_ohm = beyond_even_ohm + EVEN_SPREADING / (top_s_per_m(modelled) * radius_m);
    Some(modelled.constriction_ohm()? - (spot_ohm - disc_ohm))
}

/// How a quantity's coefficients are stored.
struct Code {
    zero: f64,
    step: f64,
}

impl Code {
    fn of(values: &[f64]) -> Self {
        let (low, high) = values.iter().fold((f64::MAX, f64::MIN), |(low, high), v| (low.min(*v), high.max(*v)));
        Self { zero: 0.5 * (low + high), step: ((high - low) / 65_534.0).max(f64::from(f32::MIN_POSITIVE)) }
    }

    fn of_value(&self, value: f64) -> i16 {
        ((value - self.zero) / self.step).round() as i16
    }
}

/// A bit for each cell whose middle is on the detector.
fn mask(modelled: Modelled<'_>, grid: &Grid) -> Vec<u8> {
    let [columns, rows] = grid.cells;
    let mut bytes = vec![0; (columns * rows).div_ceil(8)];
    for (index, is_on) in grid.on_detector(&modelled.detector.outline).enumerate() {
        bytes[index / 8] |= u8::from(is_on) << (index % 8);
    }
    bytes
}
