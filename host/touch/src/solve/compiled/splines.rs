//! Splines over a detector, fitted to values at the corners of their cells.

use std::sync::Arc;

use nalgebra::DMatrix;

use tactomo_physics::algebra::{Factor, Plan};
use tactomo_physics::detector::Outline;
use tactomo_touch_core::spline::{interval, weights};
use tactomo_touch_core::table::MAX_SIDE;

use super::Modelled;
use super::table::{CompileError, failed};

/// Cells, about. Of 390 random scenes of one to three discs on `square-60` 27 contacts are invented with 35 cells along a side (106 kB), 35 with 34 (100 kB) and 35
/// with 33 (95 kB); 66, 73 and 73 are missed.
const CELLS: usize = 1200;
/// Fewest cells along a side.
const LEAST_CELLS: usize = 6;
/// Weight of the squares of second differences of coefficients, over that of a place: it decides where no place does.
const SMOOTHNESS: f64 = 1e-6;

/// Cells that cover a detector.
#[derive(Clone, Debug)]
pub(super) struct Grid {
    /// Lowest corner (m).
    pub low_m: [f64; 2],
    /// Sides of a cell (m).
    pub step_m: [f64; 2],
    /// How many there are along x and y.
    pub cells: [usize; 2],
}

impl Grid {
    /// Of a detector.
    pub fn of(modelled: Modelled<'_>) -> Self {
        let [low_m, high_m] = modelled.detector.outline.bounds();
        let size_m = [0, 1].map(|axis| high_m[axis] - low_m[axis]);
        let step_m = (size_m[0] * size_m[1] / CELLS as f64).sqrt();
        let cells = size_m.map(|size_m| ((size_m / step_m).round() as usize).clamp(LEAST_CELLS, MAX_SIDE - 3));
        Self { low_m, step_m: [0, 1].map(|axis| size_m[axis] / cells[axis] as f64), cells }
    }

    /// Coefficients along x and y.
    pub fn sides(&self) -> [usize; 2] {
        self.cells.map(|cells| cells + 3)
    }

    /// A place by cells from the lowest corner (m).
    pub fn place_m(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        [self.low_m[0] + x * self.step_m[0], self.low_m[1] + y * self.step_m[1]]
    }

    /// Whether the middle of each cell is on a detector: in rows of y.
    pub fn on_detector(&self, outline: &Outline) -> impl Iterator<Item = bool> {
        let [columns, rows] = self.cells;
        let middles = (0..rows).flat_map(move |j| (0..columns).map(move |i| [i as f64 + 0.5, j as f64 + 0.5]));
        middles.map(|middle| outline.holds(self.place_m(middle)))
    }

    /// Coefficients with their weights at a place.
    fn stencil(&self, place_m: [f64; 2]) -> [(usize, f64); 16] {
        let along = [0, 1].map(|axis| {
            let position = (place_m[axis] - self.low_m[axis]) / self.step_m[axis];
            let (cell, t) = interval(position, self.cells[axis]);
            (cell, weights(t).value)
        });
        let [(i, x), (j, y)] = along;
        std::array::from_fn(|k| ((j + k / 4) * self.sides()[0] + i + k % 4, x[k % 4] * y[k / 4]))
    }
}

/// Splines that are fitted to values at places of a detector.
pub(super) struct Splines {
    pub grid: Grid,
    places_m: Vec<[f64; 2]>,
    factor: Factor,
}

impl Splines {
    /// Over a detector.
    ///
    /// # Errors
    /// [`CompileError::Fit`] if its places do not determine them.
    pub fn of(modelled: Modelled<'_>) -> Result<Self, CompileError> {
        let grid = Grid::of(modelled);
        let outline = &modelled.detector.outline;
        let [columns, rows] = grid.cells;
        let corners = (0..=rows).flat_map(|j| (0..=columns).map(move |i| [i as f64, j as f64]));
        // A corner on the outline is as far inside as rounding may take it outside.
        let inside = |[i, j]: [f64; 2]| {
            let within = |at: f64, most: usize| at.clamp(INSIDE, most as f64 - INSIDE);
            grid.place_m([within(i, columns), within(j, rows)])
        };
        let places_m: Vec<_> = corners.map(inside).filter(|place_m| outline.holds(*place_m)).collect();
        let (mut places, mut elements) = (Vec::new(), Vec::new());
        let mut add = |(i, a): (usize, f64), (j, b): (usize, f64), weight: f64| {
            if j <= i {
                places.push([i as u32, j as u32]);
                elements.push(weight * a * b);
            }
        };
        for place_m in &places_m {
            let stencil = grid.stencil(*place_m);
            stencil.iter().for_each(|one| stencil.iter().for_each(|other| add(*one, *other, 1.0)));
        }
        let [columns, rows] = grid.sides();
        let mut smooth = |three: [usize; 3]| {
            let three = [(three[0], 1.0), (three[1], -2.0), (three[2], 1.0)];
            three.iter().for_each(|one| three.iter().for_each(|other| add(*one, *other, SMOOTHNESS)));
        };
        for j in 0..rows {
            (1..columns - 1).for_each(|i| smooth([i - 1, i, i + 1].map(|i| j * columns + i)));
        }
        for i in 0..columns {
            (1..rows - 1).for_each(|j| smooth([j - 1, j, j + 1].map(|j| j * columns + i)));
        }
        let plan: Arc<Plan> = Plan::new(columns * rows, &places);
        let factor = plan.factorise(&elements).map_err(|_| failed(modelled, "the places do not determine them"))?;
        Ok(Self { grid, places_m, factor })
    }

    /// Places whose values they are fitted to (m).
    pub fn places_m(&self) -> &[[f64; 2]] {
        &self.places_m
    }

    /// Coefficients of all quantities, a column each, from their values at the places.
    pub fn fitted(&self, values: &[Vec<f64>]) -> DMatrix<f64> {
        let quantities = values.first().map_or(0, Vec::len);
        let mut right = DMatrix::zeros(self.factor.unknowns(), quantities);
        for (place_m, values) in self.places_m.iter().zip(values) {
            for (i, weight) in self.grid.stencil(*place_m) {
                values.iter().enumerate().for_each(|(q, value)| right[(i, q)] += weight * value);
            }
        }
        self.factor.solve(&mut right);
        right
    }
}

/// Shares of a cell that places on the outline are inside.
const INSIDE: f64 = 1e-6;
