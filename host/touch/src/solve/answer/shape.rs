//! Shapes that were found, as they leave a solver.

use std::f64::consts::TAU;

use tactomo_physics::geometry::{self, Point};

/// A shape that explains a frame with less than an image takes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum FoundShape {
    /// A bar.
    Line(FoundLine),
    /// The rim of something round.
    Ring(FoundRing),
}

/// A straight strip of contact.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FoundLine {
    /// One end (m), on the strip's middle line; where it crosses an edge of the detector, that place.
    pub from_m: Point,
    /// The other one (m).
    pub to_m: Point,
    /// Width (m).
    pub width_m: f64,
    /// Conductance of what of it is on the detector (S).
    pub conductance_s: f64,
    /// Standard errors, if they are known.
    pub uncertainty: Option<LineUncertainty>,
}

/// Standard errors of a [`FoundLine`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LineUncertainty {
    /// Of one end's x and y (m).
    pub from_m: Point,
    /// Of the other's (m).
    pub to_m: Point,
    /// Of the width (m).
    pub width_m: f64,
    /// Of the conductance (S).
    pub conductance_s: f64,
}

/// A circular strip of contact.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FoundRing {
    /// Centre (m).
    pub centre_m: Point,
    /// Radius of the strip's middle line (m).
    pub radius_m: f64,
    /// Width (m).
    pub width_m: f64,
    /// Conductance of what of it is on the detector (S).
    pub conductance_s: f64,
    /// Standard errors, if they are known.
    pub uncertainty: Option<RingUncertainty>,
}

/// Standard errors of a [`FoundRing`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RingUncertainty {
    /// Of the centre's x and y (m).
    pub centre_m: Point,
    /// Of the radius (m).
    pub radius_m: f64,
    /// Of the width (m).
    pub width_m: f64,
    /// Of the conductance (S).
    pub conductance_s: f64,
}

impl FoundLine {
    /// Its length (m).
    pub fn length_m(&self) -> f64 {
        geometry::distance(self.from_m, self.to_m)
    }
}

impl FoundShape {
    /// What it is in a word: `line` or `ring`.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Line(_) => "line",
            Self::Ring(_) => "ring",
        }
    }

    /// Width (m).
    pub fn width_m(&self) -> f64 {
        match self {
            Self::Line(line) => line.width_m,
            Self::Ring(ring) => ring.width_m,
        }
    }

    /// Conductance of what of it is on the detector (S).
    pub fn conductance_s(&self) -> f64 {
        match self {
            Self::Line(line) => line.conductance_s,
            Self::Ring(ring) => ring.conductance_s,
        }
    }

    /// Its middle (m): of a line that between its ends, of a ring its centre.
    pub fn centre_m(&self) -> Point {
        match self {
            Self::Line(line) => std::array::from_fn(|axis| 0.5 * (line.from_m[axis] + line.to_m[axis])),
            Self::Ring(ring) => ring.centre_m,
        }
    }

    /// Its area (m2), with what of it may reach over an edge of the detector.
    pub fn area_m2(&self) -> f64 {
        match self {
            Self::Line(line) => line.length_m() * line.width_m,
            Self::Ring(ring) => TAU * ring.radius_m * ring.width_m,
        }
    }
}
