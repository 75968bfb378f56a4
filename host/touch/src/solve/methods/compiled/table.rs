//! The table of a detector for [`tactomo_touch_core`]: contacts without a computer.
//!
//! Fields are those of the model that solvers invert: means over discs, from the impedances that a light one gives. With one contact,
//! `Z[e][g] = E[e][g] + A - u_e - u_g` (fields `E` between the electrodes, `u` at the contact, `A` its resistance with its own field), so that `u` and `A`
//! follow from `Z` in the gauge in which `u` has no mean. They are found for a small and for a wide disc. Splines are fitted to places all over the detector by least squares.

use nalgebra::{Cholesky, DMatrix};

use tactomo_physics::detector::ForceLaw;
use tactomo_physics::forward::ForwardError;
use tactomo_physics::scene::Contact;
use tactomo_touch_core::Contents;
use tactomo_touch_core::spline::{interval, weights};
use tactomo_touch_core::table::{EVEN_SPREADING, Head, MAX_ELECTRODES, MAX_SIDE, OTHERS, RADII};

use super::between::Between;
use super::unknown::{Unknown, tried_m};
use crate::solve::fit::linear::full_v;
use crate::solve::fit::target::{PAD_ERROR, model_error};
use crate::solve::problem::Problem;

/// Cells, about. Of 390 random scenes of one to three discs on `square-60` 27 contacts are invented with 35 cells along a side (106 kB), 35 with 34 (100 kB) and 35
/// with 33 (95 kB); 66, 73 and 73 are missed.
const CELLS: usize = 1200;
/// Fewest cells along a side.
const LEAST_CELLS: usize = 6;
/// Places along each side of a cell that splines are fitted to.
const PLACES: usize = 2;
/// Weight of the squares of second differences of coefficients, over that of a place: it decides where no place does.
const SMOOTHNESS: f64 = 1e-6;
/// Conductances of the light discs (sheet conductances): their current is even.
const LIGHT_SHEETS: [f64; 2] = [1e-4, 1e-3];
/// Radii of the small and of the wide disc, in usual ones.
const DISCS: [f64; RADII] = [0.6, 2.2];
/// What readings by a table are off from the model's, as a share of the largest: of 150 random scenes of one to three discs on `square-60` as many have the
/// right number of contacts with 0.0003, 0.0007 and 0.001 (134, 133 and 131), and with more fewer; wide firm ones alone are split less with more.
const TABLE_SHARE: f64 = 0.0006;
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

/// The table of a detector, as it is known and as its board measures it.
///
/// # Errors
/// [`CompileError`] if it is curved, has too many electrodes or no model.
pub fn compile(problem: &Problem) -> Result<Vec<u8>, CompileError> {
    let detector = problem.detector();
    let n = detector.electrodes.len();
    if n > MAX_ELECTRODES {
        return Err(CompileError::Electrodes { detector: detector.name.clone(), found: n });
    }
    if detector.surface.is_some() {
        return Err(CompileError::Curved { detector: detector.name.clone() });
    }
    let grid = Grid::of(problem);
    let quantities = grid.fitted(problem)?;
    let between = Between::of(problem, &grid)?;
    Ok(written(problem, &grid, &quantities, &between))
}

/// Cells that cover a detector.
pub(super) struct Grid {
    low_m: [f64; 2],
    step_m: [f64; 2],
    cells: [usize; 2],
}

impl Grid {
    fn of(problem: &Problem) -> Self {
        let [low_m, high_m] = problem.detector().outline.bounds();
        let size_m = [0, 1].map(|axis| high_m[axis] - low_m[axis]);
        let step_m = (size_m[0] * size_m[1] / CELLS as f64).sqrt();
        let cells = size_m.map(|size_m| ((size_m / step_m).round() as usize).clamp(LEAST_CELLS, MAX_SIDE - 3));
        Self { low_m, step_m: [0, 1].map(|axis| size_m[axis] / cells[axis] as f64), cells }
    }

    fn sides(&self) -> [usize; 2] {
        self.cells.map(|cells| cells + 3)
    }

    /// A place by cells from the lowest corner.
    fn place_m(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        [self.low_m[0] + x * self.step_m[0], self.low_m[1] + y * self.step_m[1]]
    }

    /// Places on the detector, so many along each side of a cell.
    pub fn places_m(&self, problem: &Problem, per_cell: usize) -> Vec<[f64; 2]> {
        let [columns, rows] = self.cells.map(|cells| cells * per_cell);
        let at = |index: usize| (index as f64 + 0.5) / per_cell as f64;
        let all = (0..rows).flat_map(|j| (0..columns).map(move |i| [at(i), at(j)]));
        all.map(|at| self.place_m(at)).filter(|place_m| problem.detector().outline.holds(*place_m)).collect()
    }

    /// Coefficients with their weights at a place.
    fn stencil(&self, place_m: [f64; 2]) -> [(usize, f64); 16] {
        let along = [0, 1].map(|axis| {
            let position = (place_m[axis] - self.low_m[axis]) / self.step_m[axis];
            let (cell, t) = interval(position as f32, self.cells[axis]);
            (cell, weights(t).value.map(f64::from))
        });
        let [(i, x), (j, y)] = along;
        std::array::from_fn(|k| ((j + k / 4) * self.sides()[0] + i + k % 4, x[k % 4] * y[k / 4]))
    }

    /// Coefficients of all quantities: a column each.
    fn fitted(&self, problem: &Problem) -> Result<DMatrix<f64>, CompileError> {
        let places_m = self.places_m(problem, PLACES);
        let [columns, rows] = self.sides();
        let count = columns * rows;
        let quantities = RADII * (problem.detector().electrodes.len() + OTHERS);
        let mut matrix = DMatrix::zeros(count, count);
        let mut right = DMatrix::zeros(count, quantities);
        let values = values(problem, &places_m)?;
        for (place_m, values) in places_m.iter().zip(&values) {
            let stencil = self.stencil(*place_m);
            for (i, weight) in stencil {
                stencil.iter().for_each(|(j, other)| matrix[(i, *j)] += weight * other);
                values.iter().enumerate().for_each(|(q, value)| right[(i, q)] += weight * value);
            }
        }
        let mut smooth = |three: [usize; 3]| {
            for (i, a) in three.into_iter().zip([1.0, -2.0, 1.0]) {
                three.into_iter().zip([1.0, -2.0, 1.0]).for_each(|(j, b)| matrix[(i, j)] += SMOOTHNESS * a * b);
            }
        };
        for j in 0..rows {
            (1..columns - 1).for_each(|i| smooth([i - 1, i, i + 1].map(|i| j * columns + i)));
        }
        for i in 0..columns {
            (1..rows - 1).for_each(|j| smooth([j - 1, j, j + 1].map(|j| j * columns + i)));
        }
        let factor = Cholesky::new(matrix).ok_or_else(|| failed(problem, "the places do not determine them"))?;
        factor.solve_mut(&mut right);
        Ok(right)
    }
}

pub(super) fn failed(problem: &Problem, what: &'static str) -> CompileError {
    CompileError::Fit { detector: problem.detector().name.clone(), what }
}

/// All quantities at some places.
fn values(problem: &Problem, places_m: &[[f64; 2]]) -> Result<Vec<Vec<f64>>, ForwardError> {
    let of_place = |place_m: &[f64; 2]| {
        let [small, wide] = DISCS.map(|radii| of_disc(problem, *place_m, radii * problem.usual_radius_m()));
        Ok([small?, wide?].concat())
    };
    places_m.iter().map(of_place).collect()
}

/// All quantities of a disc.
fn of_disc(problem: &Problem, [x_m, y_m]: [f64; 2], radius_m: f64) -> Result<Vec<f64>, ForwardError> {
    let detector = problem.detector();
    let pads_ohm = problem.model.electrode_fields_ohm();
    let conductances_s = LIGHT_SHEETS.map(|sheets| sheets * detector.sheet_conductance_s());
    let by_contact = |conductance_s: f64| {
        let contact = Contact::flat(x_m, y_m, radius_m, conductance_s);
        Ok(problem.model.impedance_ohm(&[contact])? - pads_ohm)
    };
    let [lighter, firmer] = [by_contact(conductances_s[0])?, by_contact(conductances_s[1])?];
    let [lighter_ohm, firmer_ohm] = [lighter.mean(), firmer.mean()];
    // The resistance of the contact is that of its part on the detector.
    let whole_ohm = conductances_s[0].recip() - conductances_s[1].recip();
    let share = whole_ohm / (lighter_ohm - firmer_ohm);
    let own_ohm = firmer_ohm - 1.0 / (share * conductances_s[1]);
    let even_ohm = EVEN_SPREADING / (top_s_per_m(problem) * radius_m);
    let fields = (0..pads_ohm.nrows()).map(|e| firmer_ohm - firmer.row(e).mean());
    Ok(fields.chain([own_ohm - even_ohm, share.clamp(0.0, 1.0)]).collect())
}

fn top_s_per_m(problem: &Problem) -> f64 {
    problem.detector().layers.last().map_or(1.0, |layer| layer.top_s_per_m)
}

/// The bytes.
fn written(problem: &Problem, grid: &Grid, quantities: &DMatrix<f64>, between: &Between) -> Vec<u8> {
    let detector = problem.detector();
    let n = detector.electrodes.len();
    let pads_ohm = problem.model.electrode_fields_ohm();
    let codes: Vec<_> = quantities.column_iter().map(|column| Code::of(column.as_slice())).collect();
    let coefficients = quantities
        .row_iter()
        .flat_map(|row| row.iter().zip(&codes).map(|(v, code)| code.of_value(*v)).collect::<Vec<_>>());
    let mut bytes = Vec::new();
    Contents {
        head: head(problem, grid, between),
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
        mask: &mask(problem, grid),
        coefficients: &coefficients.collect::<Vec<_>>(),
    }
    .write(&mut bytes);
    bytes
}

fn floats(values: impl IntoIterator<Item = f64>) -> Vec<f32> {
    values.into_iter().map(|value| value as f32).collect()
}

fn head(problem: &Problem, grid: &Grid, between: &Between) -> Head {
    let (detector, radius_m) = (problem.detector(), problem.usual_radius_m());
    let unknown = Unknown::of(problem);
    // Without one, or where nothing is left of it, there is no scale for forces.
    let constriction_ohm = constriction_ohm(problem).filter(|ohm| *ohm > 0.0);
    let law = detector.force.as_ref().filter(|_| constriction_ohm.is_some());
    let of_law = |value: fn(&ForceLaw) -> f64| law.map_or(0.0, value) as f32;
    Head {
        left_m: grid.low_m[0] as f32,
        bottom_m: grid.low_m[1] as f32,
        step_x_m: grid.step_m[0] as f32,
        step_y_m: grid.step_m[1] as f32,
        radius_m: radius_m as f32,
        radii_m: DISCS.map(|radii| (radii * radius_m) as f32),
        near_m: between.near_m as f32,
        ln_step: between.ln_step as f32,
        drive_v: detector.drive_v as f32,
        on_resistance_ohm: detector.on_resistance_ohm as f32,
        noise_v: detector.adc.deviation_v() as f32,
        model_share: model_error(&*problem.model).hypot(TABLE_SHARE).hypot(unknown.share) as f32,
        shift_m: unknown.place_m as f32,
        ln_conductance_error: unknown.ln_conductance as f32,
        pad_share: PAD_ERROR as f32,
        full_v: full_v(detector) as f32,
        sheet_s: detector.sheet_conductance_s() as f32,
        top_s_per_m: top_s_per_m(problem) as f32,
        constriction_ohm: constriction_ohm.unwrap_or(1.0) as f32,
        force_s: of_law(|law| law.conductance_at_1_n_s),
        force_exponent: of_law(|law| law.exponent),
        force_ohm: of_law(|law| law.series_ohm.unwrap_or(0.0)),
        force_most_n: of_law(ForceLaw::farthest_n),
    }
}

/// The constriction that makes conductances, less a disc's own field here, those that the host's meter finds with a spot's own field there (ohm). Both fields are
/// in the gauge in which the electrodes' mean is zero.
fn constriction_ohm(problem: &Problem) -> Option<f64> {
    let radius_m = problem.usual_radius_m();
    let [x_m, y_m] = tried_m(problem).next()?;
    let spot = problem.model.spots(radius_m)?.spot([x_m, y_m, 0.0]);
    let count = spot.electrodes_ohm.len() as f64;
    let spot_ohm = spot.own_ohm - 2.0 * spot.electrodes_ohm.iter().sum::<f64>() / count;
    let beyond_even_ohm = *of_disc(problem, [x_m, y_m], radius_m).ok()?.get(spot.electrodes_ohm.len())?;
    let disc_ohm = beyond_even_ohm + EVEN_SPREADING / (top_s_per_m(problem) * radius_m);
    Some(problem.constriction_ohm()? - (spot_ohm - disc_ohm))
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
fn mask(problem: &Problem, grid: &Grid) -> Vec<u8> {
    let [columns, rows] = grid.cells;
    let mut bytes = vec![0; (columns * rows).div_ceil(8)];
    for index in 0..columns * rows {
        let middle_m = grid.place_m([(index % columns) as f64 + 0.5, (index / columns) as f64 + 0.5]);
        bytes[index / 8] |= u8::from(problem.detector().outline.holds(middle_m)) << (index % 8);
    }
    bytes
}
