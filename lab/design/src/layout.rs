//! Where electrodes are.

use std::f64::consts::TAU;

use tactomo_physics::detector::{Electrode, electrode_grid};

/// A ring's electrodes are so many of their radii from the edge.
const FROM_EDGE: f64 = 2.0;

/// A pattern of round electrodes on a rectangle.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Layout {
    /// Cell-centred rows and columns, drawn together to a share of their pitch.
    Grid {
        /// Electrodes along x.
        columns: usize,
        /// Along y.
        rows: usize,
        /// Pitch as a share of side / count: 1 is cell-centred.
        spread: f64,
    },
    /// Rows of which every other one is half a pitch aside.
    Staggered {
        /// Electrodes along x.
        columns: usize,
        /// Along y.
        rows: usize,
    },
    /// Along the edge, even in the angle around the middle.
    Ring {
        /// How many.
        count: usize,
    },
}

impl Layout {
    /// A cell-centred grid.
    pub const fn grid(columns: usize, rows: usize) -> Self {
        Self::Grid { columns, rows, spread: 1.0 }
    }

    /// How many electrodes it has.
    pub fn count(&self) -> usize {
        match *self {
            Self::Grid { columns, rows, .. } | Self::Staggered { columns, rows } => columns * rows,
            Self::Ring { count } => count,
        }
    }

    /// What it is, for people.
    pub fn name(&self) -> String {
        match *self {
            Self::Grid { columns, rows, spread: 1.0 } => format!("{columns} x {rows} grid"),
            Self::Grid { columns, rows, spread } => format!("{columns} x {rows} grid, {:.0} % pitch", spread * 100.0),
            Self::Staggered { columns, rows } => format!("{columns} x {rows} staggered"),
            Self::Ring { count } => format!("ring of {count}"),
        }
    }

    /// The electrodes on a detector of such sides (m), with a radius (m).
    pub fn electrodes(&self, [width_m, height_m]: [f64; 2], radius_m: f64) -> Vec<Electrode> {
        match *self {
            Self::Grid { columns, rows, spread } => {
                electrode_grid(width_m * spread, height_m * spread, columns, rows, radius_m)
            }
            Self::Staggered { columns, rows } => {
                // A quarter of a pitch to either side, so that the pattern stays in the middle.
                let aside_m = 0.25 * width_m / columns as f64;
                let mut electrodes = electrode_grid(width_m, height_m, columns, rows, radius_m);
                for (index, electrode) in electrodes.iter_mut().enumerate() {
                    electrode.x_m += if (index / columns).is_multiple_of(2) { aside_m } else { -aside_m };
                }
                electrodes
            }
            Self::Ring { count } => {
                let half_m = [width_m, height_m].map(|side_m| side_m / 2.0 - FROM_EDGE * radius_m);
                let at = |index: usize| {
                    let angle = TAU * (index as f64 + 0.5) / count as f64;
                    let (sin, cos) = angle.sin_cos();
                    // From the middle out to the rectangle.
                    let scale = 1.0 / cos.abs().max(sin.abs());
                    Electrode::flat(half_m[0] * cos * scale, half_m[1] * sin * scale, radius_m)
                };
                (0..count).map(at).collect()
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tactomo_physics::detector::Detector;

    #[test]
    fn patterns_have_their_number_of_electrodes_and_make_detectors() {
        for layout in [
            Layout::grid(4, 4),
            Layout::grid(2, 8),
            Layout::Grid { columns: 4, rows: 4, spread: 0.7 },
            Layout::Staggered { columns: 4, rows: 4 },
            Layout::Ring { count: 16 },
        ] {
            let detector = Detector { electrodes: layout.electrodes([0.06, 0.06], 0.002), ..Detector::default() };
            assert_eq!(detector.electrodes.len(), layout.count(), "{}", layout.name());
            assert!(detector.check().is_ok(), "{}: {:?}", layout.name(), detector.check());
        }
        assert_eq!(Layout::grid(4, 4).electrodes([0.06, 0.06], 0.002), Detector::default().electrodes);
    }

    #[test]
    fn a_ring_is_along_the_edge() {
        for electrode in (Layout::Ring { count: 12 }).electrodes([0.06, 0.04], 0.001) {
            let edge_m = (0.03 - electrode.x_m.abs()).min(0.02 - electrode.y_m.abs());
            assert!((edge_m - 0.002).abs() < 1e-12, "{electrode:?}");
        }
    }
}
