//! A driving layer that is not ideal.

use crate::geometry::Point;

/// Radius of a connecting point, as a share of the detector's shorter side: 3 mm, a snap fastener's or a clip's, on 60 mm. As a share, it
/// leaves the resistance of a sheet the same at any size.
const POINT_SHARE: f64 = 0.05;

/// A driving layer with a resistance of its own, or that touches the detector lightly everywhere. The default is ideal: neither.
///
/// Contacts draw their currents `J` through the layer, so its potential at them is below `Vcc` by `D J`, where `D` is Neumann's function of
/// the layer as seen from its connecting points: `N_SS + diag(1/C) + D_SS` in the system of contacts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DrivingLayer {
    /// Its sheet resistance (ohm per square).
    pub sheet_ohm: f64,
    /// Points that connect it to `Vcc`: one, at the corner of smallest x and y, or two, at the opposite one too.
    pub points: ConnectingPoints,
    /// Conductance to the detector where nothing presses (S), spread evenly over the whole surface.
    pub leak_s: f64,
}

/// How many points connect a driving layer to `Vcc`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ConnectingPoints {
    /// A corner.
    #[default]
    One,
    /// Two opposite corners.
    Two,
}

impl Default for DrivingLayer {
    fn default() -> Self {
        Self { sheet_ohm: 0.0, points: ConnectingPoints::One, leak_s: 0.0 }
    }
}

impl DrivingLayer {
    /// Where it is connected (m), from the corner of a rectangle of that size.
    pub(super) fn points_m(&self, size_m: [f64; 2]) -> Vec<Point> {
        match self.points {
            ConnectingPoints::One => vec![[0.0; 2]],
            ConnectingPoints::Two => vec![[0.0; 2], size_m],
        }
    }

    /// Radius of a connecting point (m).
    pub(super) fn point_radius_m(size_m: [f64; 2]) -> f64 {
        POINT_SHARE * size_m[0].min(size_m[1])
    }
}
