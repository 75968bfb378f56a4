//! A driving layer that is not ideal.

use std::f64::consts::PI;

use nalgebra::DMatrix;

use super::{ForwardError, ForwardModel};
use crate::detector::Detector;
use crate::geometry::Point;
use crate::scene::Contact;

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

/// Radius of a disc over its mean distance from itself: that of `ln |x - y|` over both points is `ln r - 1/4`.
const OWN_DISTANCE: f64 = 0.7788;
/// Pairs of images that are added beside the nearest: what is left out is `exp(-4 pi)` of the sum.
const IMAGES: usize = 2;

/// What a driving sheet of one ohm per square, connected at a corner, takes off the potential of each contact for an ampere through each
/// (ohm): `D` of [`DrivingLayer`], of even discs. Of an outline that is not a rectangle it is that of the bounding one; of a curved detector
/// that of its map.
pub fn sheet_drops_ohm(detector: &Detector, contacts: &[Contact]) -> DMatrix<f64> {
    let [low, high] = detector.outline.bounds();
    let size_m = [high[0] - low[0], high[1] - low[1]];
    let point = ([0.0; 2], DrivingLayer::point_radius_m(size_m));
    let disc = |contact: &Contact| {
        let at_m = detector.map_m([contact.x_m, contact.y_m, contact.z_m]);
        ([0, 1].map(|axis| (at_m[axis] - low[axis]).clamp(0.0, size_m[axis])), contact.radius_m)
    };
    let discs: Vec<_> = contacts.iter().map(disc).collect();
    let to_point: Vec<_> = discs.iter().map(|(at_m, _)| neumann(size_m, *at_m, point.0, 0.0)).collect();
    let of_point = neumann(size_m, point.0, point.0, point.1);
    DMatrix::from_fn(discs.len(), discs.len(), |k, l| {
        let own_m = if k == l { discs[k].1 } else { 0.0 };
        neumann(size_m, discs[k].0, discs[l].0, own_m) - to_point[k] - to_point[l] + of_point
    })
}

/// Step of the logarithm of a conductance for a derivative.
const STEP_LOG: f64 = 1e-3;

/// What contacts have in common of a driving sheet of one ohm per square: by how much `Z` is larger (ohm) than that of contacts which each
/// conduct less by what is below it alone. With `J[k]` the current through contact `k` for an ampere into each electrode, which
/// `J[k] J[k]' = -C[k] dZ/d ln C[k]` tells, the sum of `J[k] D[k][l] J[l]'` over all that are two, to first order.
///
/// # Errors
/// [`ForwardError`] if a contact is not on the detector or none conducts.
pub fn sheet_between_ohm(model: &dyn ForwardModel, contacts: &[Contact]) -> Result<DMatrix<f64>, ForwardError> {
    let n = model.detector().electrodes.len();
    if contacts.len() < 2 {
        return Ok(DMatrix::zeros(n, n));
    }
    let firmer = |contact: &Contact| Contact { conductance_s: contact.conductance_s * STEP_LOG.exp(), ..*contact };
    let firmer: Vec<_> = contacts.iter().map(firmer).enumerate().collect();
    let (_, changes_ohm) = model.impedance_with_changes_ohm(contacts, &firmer)?;
    let current = |(contact, change): (&Contact, &DMatrix<f64>)| {
        change.diagonal().map(|ohm| (-contact.conductance_s * ohm / STEP_LOG).max(0.0).sqrt())
    };
    let currents: Vec<_> = contacts.iter().zip(&changes_ohm).map(current).collect();
    let currents = DMatrix::from_columns(&currents);
    let mut drops_ohm = sheet_drops_ohm(model.detector(), contacts);
    drops_ohm.fill_diagonal(0.0);
    Ok(&currents * drops_ohm * currents.transpose())
}

/// Neumann's function of a rectangular sheet of one ohm per square between two places from its corner (m), of mean zero; of an even disc to
/// itself with its radius (m), else zero. Cosines along the shorter side; along the longer one, images, so that the sum over the cosines is a
/// logarithm (Morse and Feshbach, *Methods of Theoretical Physics*, 1953, section 10.1).
fn neumann(size_m: [f64; 2], a_m: Point, b_m: Point, own_radius_m: f64) -> f64 {
    let short = usize::from(size_m[1] < size_m[0]);
    let (side_m, length_m) = (size_m[short], size_m[1 - short]);
    let ([x, y], [other_x, other_y]) = ([a_m[short], a_m[1 - short]], [b_m[short], b_m[1 - short]]);
    let even = (y * y + other_y * other_y) / (2.0 * length_m) - y.max(other_y) + length_m / 3.0;
    let nearest = (PI * OWN_DISTANCE * own_radius_m / side_m).powi(2);
    let image = |across_m: f64, along_m: f64| {
        let decay = (-PI * along_m / side_m).exp();
        -0.5 * (1.0 - 2.0 * decay * (PI * across_m / side_m).cos() + decay * decay + nearest).ln()
    };
    let mut waves = 0.0;
    for across_m in [x - other_x, x + other_x] {
        for along_m in [(y - other_y).abs(), y + other_y] {
            for round in 0..IMAGES {
                let rounds_m = 2.0 * round as f64 * length_m;
                waves += image(across_m, along_m + rounds_m) + image(across_m, 2.0 * length_m - along_m + rounds_m);
            }
        }
    }
    even / side_m + waves / (2.0 * PI)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::detector::Outline;
    use crate::forward::{ForwardModel, Resolution, Slab};

    /// Against the slab under a driving layer, whose modes share nothing with this: what one ohm per square changes.
    #[test]
    fn contacts_are_below_the_drive_as_under_a_slab() {
        let long = Detector { outline: Outline::rectangle(0.1, 0.06), ..Detector::default() };
        for detector in [Detector::default(), long] {
            let layer = |sheet_ohm| DrivingLayer { sheet_ohm, ..DrivingLayer::default() };
            let [ideal, real] =
                [0.0, 2.0].map(|ohm| Slab::under(&detector, Resolution::FINE, layer(ohm)).unwrap().on_image(100));
            for places_m in [[0.0, 0.0], [-0.02, 0.01], [0.024, -0.02]] {
                let contact = Contact::flat(places_m[0], places_m[1], 0.003, 1e-4);
                let change = real.impedance_ohm(&[contact]).unwrap() - ideal.impedance_ohm(&[contact]).unwrap();
                let drop_ohm = 2.0 * sheet_drops_ohm(&detector, &[contact])[(0, 0)];
                assert!((change.mean() / drop_ohm - 1.0).abs() < 0.02, "{places_m:?}: {} {drop_ohm}", change.mean());
            }
        }
    }

    #[test]
    fn neighbours_share_most_of_the_way_to_the_connecting_point() {
        let contacts = [[-0.01, 0.0], [0.01, 0.0], [0.01, 0.02]].map(|[x, y]| Contact::flat(x, y, 0.003, 1e-4));
        let drops_ohm = sheet_drops_ohm(&Detector::default(), &contacts);
        assert!((drops_ohm.clone() - drops_ohm.transpose()).amax() < 1e-12);
        assert!(drops_ohm.clone().symmetric_eigenvalues().min() > 0.0, "{drops_ohm}");
        assert!(drops_ohm[(0, 1)] > 0.3 * drops_ohm[(0, 0)] && drops_ohm[(0, 1)] < drops_ohm[(0, 0)], "{drops_ohm}");
    }
}
