//! The mean error of presses by place.

use serde::Serialize;
use tactomo_study::view::{self, Axis, MM, Unit};

/// A press at a place (m), and how far from it it was found (m).
pub type Missed = ([f64; 2], f64);

/// Presses in a cell, about.
const PRESSES_EACH: f64 = 5.0;
/// Fewest and most cells along the longer side.
const CELLS: [f64; 2] = [3.0, 24.0];
/// A square of the map with presses in it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Cell {
    /// Its middle (m).
    pub x_m: f64,
    /// Its middle (m).
    pub y_m: f64,
    /// Presses in it.
    pub presses: usize,
    /// How far off they are, in the mean (m).
    pub mean_m: f64,
}

/// Errors by place.
#[derive(Clone, Debug, PartialEq)]
pub struct Map {
    /// Squares with presses in them.
    pub cells: Vec<Cell>,
    /// Side of a square (m).
    side_m: f64,
    /// Left lower and right upper corner (m).
    corners_m: [[f64; 2]; 2],
}

impl Map {
    /// Of presses.
    pub fn of(missed: &[Missed]) -> Self {
        let bounds = |axis: usize| {
            missed.iter().fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], (at_m, _)| {
                [low.min(at_m[axis]), high.max(at_m[axis])]
            })
        };
        let [[left, right], [low, high]] = [bounds(0), bounds(1)];
        let longer_m = (right - left).max(high - low);
        if !(longer_m > 0.0 && longer_m.is_finite()) {
            return Self { cells: Vec::new(), side_m: 0.0, corners_m: [[0.0; 2]; 2] };
        }
        let side_m = longer_m / (missed.len() as f64 / PRESSES_EACH).sqrt().clamp(CELLS[0], CELLS[1]).round();
        // A press at the upper edge belongs to the last cell.
        let counts = [right - left, high - low].map(|length_m| ((length_m / side_m - 1e-9).ceil() as usize).max(1));
        let mut sums = vec![(0_usize, 0.0); counts[0] * counts[1]];
        for (at_m, missed_m) in missed {
            let index = |axis: usize, from_m: f64| (((at_m[axis] - from_m) / side_m) as usize).min(counts[axis] - 1);
            let sum = &mut sums[index(1, low) * counts[0] + index(0, left)];
            *sum = (sum.0 + 1, sum.1 + missed_m);
        }
        let cell = |(index, (presses, sum)): (usize, (usize, f64))| Cell {
            x_m: left + ((index % counts[0]) as f64 + 0.5) * side_m,
            y_m: low + ((index / counts[0]) as f64 + 0.5) * side_m,
            presses,
            mean_m: sum / presses as f64,
        };
        let cells = sums.into_iter().enumerate().filter(|(_, (presses, _))| *presses > 0).map(cell).collect();
        let corners_m = [[left, low], [left + counts[0] as f64 * side_m, low + counts[1] as f64 * side_m]];
        Self { cells, side_m, corners_m }
    }

    /// How it is drawn.
    pub fn drawn(&self) -> view::Map {
        let [low, high] = self.corners_m;
        let [columns, rows] =
            [0, 1].map(|axis: usize| ((high[axis] - low[axis]) / self.side_m).round().max(0.0) as usize);
        let middles_m = |axis: usize, count: usize| {
            (0..count).map(|index| low[axis] + (index as f64 + 0.5) * self.side_m).collect::<Vec<_>>()
        };
        let mut values = vec![vec![None; columns]; rows];
        for cell in &self.cells {
            let [column, row] =
                [cell.x_m - low[0], cell.y_m - low[1]].map(|from_m| (from_m / self.side_m - 0.5).round() as usize);
            values[row][column] = Some(cell.mean_m);
        }
        view::Map {
            title: "Mean error by place".to_owned(),
            subtitle: "mm · dark is better".to_owned(),
            axes: ["x", "y"].map(|title| Axis::linear(title, Unit::Metres)),
            ticks: [middles_m(0, columns), middles_m(1, rows)],
            rows: values,
            empty: "no press",
            is_log: false,
            range: None,
            format: MM.digits(2),
            contours: 0,
            disc: None,
            aspect: rows as f64 / columns.max(1) as f64,
            marks: Vec::new(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_are_averaged_where_they_are() {
        let missed: Vec<Missed> = (0..100)
            .map(|i| ([f64::from(i % 10) * 1e-3, f64::from(i / 10) * 1e-3], if i % 10 < 5 { 1e-3 } else { 3e-3 }))
            .collect();
        let map = Map::of(&missed);
        assert_eq!(map.cells.iter().map(|cell| cell.presses).sum::<usize>(), 100);
        let left = map.cells.iter().find(|cell| cell.x_m < 2e-3).unwrap();
        let right = map.cells.iter().find(|cell| cell.x_m > 7e-3).unwrap();
        assert!((left.mean_m - 1e-3).abs() < 1e-12 && (right.mean_m - 3e-3).abs() < 1e-12, "{map:?}");
        assert!(view::standalone(&map.drawn()).contains("Mean error by place"));
    }

    #[test]
    fn presses_at_one_place_or_on_a_line_have_a_map_too() {
        assert!(Map::of(&[([0.0, 0.0], 1.0)]).cells.is_empty());
        let line = Map::of(&[([0.0, 0.0], 1.0), ([1.0, 0.0], 2.0)]);
        assert_eq!(line.cells.len(), 2);
        assert!(!view::standalone(&line.drawn()).contains("NaN"));
    }
}
