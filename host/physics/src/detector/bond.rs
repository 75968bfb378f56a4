//! Dots of conductive glue between two layers.

use super::Detector;
use super::check::{LENGTH_M, Problem, within};
use super::pad::CONTACT_IMPEDANCE_OHM_M2;

/// Diameter of the paper's dots (m), section IV.C.2.
pub(super) const DOT_DIAMETER_M: f64 = 0.00722;

/// Sheet conductance of the glue where none is given (S): 0.1 mm of 0.001 ohm cm. The paper's glue is CircuitWorks CW2401, a silver-filled
/// adhesive; such adhesives are quoted at 0.001 to 0.01 ohm cm (for epoxies: Delmonte, *Metal-Filled Plastics*), and the thickness is a
/// judgement. From 1 S on, a dot on any of the paper's foams (up to 3 mS) is an equipotential, so the figure hardly matters.
const GLUE_SHEET_S: f64 = 10.0;

/// Sheet conductances that glue may have (S).
const SHEET_S: std::ops::RangeInclusive<f64> = 1e-9..=1e9;
/// Contact impedances that glue may have (ohm m2).
const IMPEDANCE_OHM_M2: std::ops::RangeInclusive<f64> = 0.0..=1e3;
const MAX_DOTS: usize = 256;
/// What two dots that touch may be nearer than their diameter, as a share of it.
const ROUNDING: f64 = 1e-9;

/// How a layer is glued to the layer below: by round dots, in the middles of the cells of a regular grid over the outline. Between the dots
/// the layers do not touch.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Bond {
    /// Columns and rows of dots.
    pub grid: [usize; 2],
    /// Of a dot (m).
    pub diameter_m: f64,
    /// Of the glue, along its plane (S per square).
    pub sheet_conductance_s: f64,
    /// Between the glue and each of the layers (ohm m2).
    pub contact_impedance_ohm_m2: f64,
}

impl Bond {
    /// Dots of the paper's glue.
    pub const fn of_dots(grid: [usize; 2], diameter_m: f64) -> Self {
        Self { grid, diameter_m, sheet_conductance_s: GLUE_SHEET_S, contact_impedance_ohm_m2: CONTACT_IMPEDANCE_OHM_M2 }
    }

    /// Middles of the dots on a rectangle about the origin (m), x running fastest.
    pub fn centres_m(&self, size_m: [f64; 2]) -> Vec<[f64; 2]> {
        let [columns, rows] = self.grid;
        let place = |axis: usize, i: usize| size_m[axis] * ((i as f64 + 0.5) / self.grid[axis] as f64 - 0.5);
        (0..rows).flat_map(|row| (0..columns).map(move |column| [place(0, column), place(1, row)])).collect()
    }

    /// Distance between neighbouring dots along a side (m).
    pub fn pitch_m(&self, size_m: [f64; 2], axis: usize) -> f64 {
        size_m[axis] / self.grid[axis] as f64
    }

    /// Share of the surface that is glued.
    pub fn coverage(&self, size_m: [f64; 2]) -> f64 {
        let dot_m2 = std::f64::consts::PI * (self.diameter_m / 2.0).powi(2);
        (self.grid[0] * self.grid[1]) as f64 * dot_m2 / (size_m[0] * size_m[1])
    }

    /// Checks that such dots fit on a rectangle.
    pub(super) fn check(&self, field: &str, size_m: [f64; 2]) -> Result<(), Problem> {
        let dots = self.grid[0].saturating_mul(self.grid[1]);
        if !(1..=MAX_DOTS).contains(&dots) {
            let what = format!("is {:?}, but has to be columns and rows of 1 to {MAX_DOTS} dots in all", self.grid);
            return Err(Problem::new(format!("{field}.grid"), what));
        }
        within(&format!("{field}.diameter_m"), self.diameter_m, LENGTH_M)?;
        within(&format!("{field}.sheet_conductance_s"), self.sheet_conductance_s, SHEET_S)?;
        within(&format!("{field}.contact_impedance_ohm_m2"), self.contact_impedance_ohm_m2, IMPEDANCE_OHM_M2)?;
        let too_wide = (0..2).find(|axis| self.diameter_m > self.pitch_m(size_m, *axis) * (1.0 + ROUNDING));
        let Some(axis) = too_wide else { return Ok(()) };
        let wrong = if self.grid[axis] == 1 { "reaches beyond the outline" } else { "makes the dots overlap" };
        let what = format!(
            "is {:?}, which {wrong}: {} dots on {:?} m may have {:?} m each",
            self.diameter_m,
            self.grid[axis],
            size_m[axis],
            self.pitch_m(size_m, axis)
        );
        Err(Problem::new(format!("{field}.diameter_m"), what))
    }

    /// Number and size of its dots, in a line.
    pub fn summary(&self) -> String {
        let [columns, rows] = self.grid;
        format!("{columns} \u{d7} {rows} dots of {} mm", super::short(self.diameter_m * 1e3))
    }
}

impl Detector {
    /// The first layer above the dots of glue, and the dots; `None` where all layers touch all over.
    pub fn bond(&self) -> Option<(usize, Bond)> {
        self.layers.iter().enumerate().find_map(|(index, layer)| Some((index, layer.bond?)))
    }

    pub(super) fn check_bond(&self) -> Result<(), Problem> {
        let Some((index, bond)) = self.bond() else { return Ok(()) };
        let field = format!("layers[{index}].bond");
        if index == 0 {
            return Err(Problem::new(
                field,
                "joins a layer to the one below, but this is the bottom layer: give it to a layer above",
            ));
        }
        if let Some(other) = self.layers.iter().skip(index + 1).position(|layer| layer.bond.is_some()) {
            let other = format!("layers[{}].bond", index + 1 + other);
            return Err(Problem::new(other, format!("is the second after {field}, but a detector may have one")));
        }
        match self.outline.as_rectangle().filter(|_| self.surface.is_none()) {
            Some(size_m) => bond.check(&field, size_m),
            None => Err(Problem::new(
                field,
                "needs a rectangular outline and no surface: only these are computed with dots",
            )),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn problem(spoil: impl FnOnce(&mut Detector)) -> String {
        let mut detector = Detector::preset("BB-5x5").unwrap();
        spoil(&mut detector);
        detector.check().unwrap_err().to_string()
    }

    fn bond(detector: &mut Detector) -> &mut Bond {
        detector.layers[1].bond.as_mut().unwrap()
    }

    #[test]
    fn the_papers_dots_are_in_the_middles_of_a_grid() {
        let (above, bond) = Detector::preset("BB-7x7").unwrap().bond().unwrap();
        let centres_m = bond.centres_m([0.06, 0.06]);
        assert_eq!((above, centres_m.len(), centres_m[24]), (1, 49, [0.0, 0.0]));
        assert!((centres_m[1][0] - centres_m[0][0] - 0.06 / 7.0).abs() < 1e-15 && centres_m[0][0] > -0.03);
        assert!((bond.coverage([0.06, 0.06]) - 0.557).abs() < 1e-3);
    }

    #[test]
    fn dots_have_to_be_few_apart_and_inside() {
        assert!(problem(|d| bond(d).grid = [0, 5]).starts_with("layers[1].bond.grid is [0, 5], but"));
        assert!(problem(|d| bond(d).grid = [usize::MAX, 5]).contains("1 to 256 dots"));
        assert!(problem(|d| bond(d).diameter_m = -1.0).starts_with("layers[1].bond.diameter_m is -1.0, but has"));
        assert!(
            problem(|d| bond(d).diameter_m = 0.0121)
                .contains("makes the dots overlap: 5 dots on 0.06 m may have 0.012")
        );
        assert!(problem(|d| (bond(d).grid, bond(d).diameter_m) = ([1, 1], 0.061)).contains("beyond the outline"));
        assert!(
            problem(|d| bond(d).sheet_conductance_s = 0.0).contains("sheet_conductance_s is 0.0, but has to be from")
        );
        let mut touching = Detector::preset("BB-7x7").unwrap();
        bond(&mut touching).diameter_m = 0.06 / 7.0;
        assert_eq!(touching.check(), Ok(()));
    }

    #[test]
    fn a_bond_is_between_two_layers_of_a_rectangle() {
        assert!(problem(|d| d.layers[0].bond = d.layers[1].bond.take()).contains("this is the bottom layer"));
        assert!(problem(|d| d.layers.push(d.layers[1])).starts_with("layers[2].bond is the second"));
        assert!(problem(|d| d.outline.outer[0][0] += 0.001).contains("needs a rectangular outline"));
    }
}
