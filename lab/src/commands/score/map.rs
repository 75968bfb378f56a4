//! The mean error of presses by place, as a drawing that needs no style sheet.

use std::fmt::Write;

use serde::Serialize;
use tactomo_study::page::colour;

/// A press at a place (m), and how far from it it was found (m).
pub type Missed = ([f64; 2], f64);

/// Presses in a cell, about.
const PRESSES_EACH: f64 = 5.0;
/// Fewest and most cells along the longer side.
const CELLS: [f64; 2] = [3.0, 24.0];
/// Length of the longer side (px).
const SIDE: f64 = 480.0;
/// Room around the map: left, top, right (the scale), bottom (px).
const ROOM: [f64; 4] = [60.0, 44.0, 96.0, 44.0];
/// Steps of the scale of colours.
const STEPS: usize = 32;

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

    /// Pixels in a metre.
    fn scale(&self) -> f64 {
        let [low, high] = self.corners_m;
        SIDE / (high[0] - low[0]).max(high[1] - low[1]).max(self.side_m).max(f64::MIN_POSITIVE)
    }

    /// The map as SVG.
    pub fn svg(&self) -> String {
        let [low, high] = self.corners_m;
        let [width, height] = [0, 1].map(|axis: usize| (high[axis] - low[axis]) * self.scale());
        let [all_width, all_height] = [ROOM[0] + width + ROOM[2], ROOM[1] + height.max(160.0) + ROOM[3]];
        let mut svg = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {all_width:.0} {all_height:.0}\" width=\"{all_width:.0}\" \
             font-family=\"system-ui, sans-serif\" font-size=\"13\" role=\"img\" aria-label=\"Mean error by place\">\n\
             <rect width=\"100%\" height=\"100%\" fill=\"#fff\"/>\n\
             <text x=\"{}\" y=\"24\" font-size=\"15\" fill=\"#222\">Mean error by place (mm)</text>\n",
            ROOM[0]
        );
        let most_m = self.cells.iter().map(|cell| cell.mean_m).fold(0.0, f64::max);
        for cell in &self.cells {
            self.draw(cell, most_m, &mut svg);
        }
        self.axes([width, height], &mut svg);
        legend(ROOM[0] + width + 24.0, height.max(160.0), most_m, &mut svg);
        svg + "</svg>\n"
    }

    fn draw(&self, cell: &Cell, most_m: f64, svg: &mut String) {
        let (half_m, scale) = (0.5 * self.side_m, self.scale());
        let left = ROOM[0] + (cell.x_m - half_m - self.corners_m[0][0]) * scale;
        let top = ROOM[1] + (self.corners_m[1][1] - cell.y_m - half_m) * scale;
        let share = if most_m > 0.0 { cell.mean_m / most_m } else { 0.0 };
        let side = self.side_m * scale;
        _ = writeln!(
            svg,
            "<rect x=\"{left:.1}\" y=\"{top:.1}\" width=\"{side:.1}\" height=\"{side:.1}\" fill=\"{}\" stroke=\"#fff\"><title>{:.2} mm, \
             {} presses about ({:.1}, {:.1}) mm</title></rect>",
            colour::of_share(share),
            cell.mean_m * 1e3,
            cell.presses,
            cell.x_m * 1e3,
            cell.y_m * 1e3
        );
    }

    fn axes(&self, [width, height]: [f64; 2], svg: &mut String) {
        let [low, high] = self.corners_m;
        let (bottom, middle) = (ROOM[1] + height, ROOM[0] + 0.5 * width);
        for (share, x_m, y_m) in
            [(0.0, low[0], low[1]), (0.5, 0.5 * (low[0] + high[0]), 0.5 * (low[1] + high[1])), (1.0, high[0], high[1])]
        {
            let (x, y) = (ROOM[0] + share * width, bottom - share * height);
            _ = writeln!(
                svg,
                "<text x=\"{x:.1}\" y=\"{:.1}\" text-anchor=\"middle\" fill=\"#444\">{:.1}</text>\
                 <text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"end\" fill=\"#444\">{:.1}</text>",
                bottom + 17.0,
                x_m * 1e3,
                ROOM[0] - 6.0,
                y + 4.0,
                y_m * 1e3
            );
        }
        _ = writeln!(
            svg,
            "<text x=\"{middle:.1}\" y=\"{:.1}\" text-anchor=\"middle\" fill=\"#444\">x (mm)</text>\
             <text transform=\"translate(14 {:.1}) rotate(-90)\" text-anchor=\"middle\" fill=\"#444\">y (mm)</text>",
            bottom + 35.0,
            ROOM[1] + 0.5 * height
        );
    }
}

/// The colours and what they mean.
fn legend(left: f64, height: f64, most_m: f64, svg: &mut String) {
    let step = height / STEPS as f64;
    for index in 0..STEPS {
        let share = 1.0 - (index as f64 + 0.5) / STEPS as f64;
        _ = writeln!(
            svg,
            "<rect x=\"{left:.1}\" y=\"{:.1}\" width=\"16\" height=\"{:.1}\" fill=\"{}\"/>",
            ROOM[1] + index as f64 * step,
            step + 0.3,
            colour::of_share(share)
        );
    }
    for share in [0.0, 0.5, 1.0] {
        _ = writeln!(
            svg,
            "<text x=\"{:.1}\" y=\"{:.1}\" fill=\"#444\">{:.2}</text>",
            left + 22.0,
            ROOM[1] + (1.0 - share) * height + 4.0,
            share * most_m * 1e3
        );
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
        assert!(map.svg().contains("Mean error by place"));
    }

    #[test]
    fn presses_at_one_place_or_on_a_line_have_a_map_too() {
        assert!(Map::of(&[([0.0, 0.0], 1.0)]).cells.is_empty());
        let line = Map::of(&[([0.0, 0.0], 1.0), ([1.0, 0.0], 2.0)]);
        assert_eq!(line.cells.len(), 2);
        assert!(!line.svg().contains("NaN"));
    }
}
