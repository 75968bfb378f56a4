//! Fields of small contacts that may be anywhere, for solvers that look for a few of them.
//!
//! A spot carries one current, so a scene of `K` of them is a system of `K` unknowns. It is near to a small contact of any
//! conductance: what the current's spread over the contact adds is a few per cent. So many places can be looked at, before contacts
//! are fitted with [`ForwardModel::impedance_ohm`](super::ForwardModel::impedance_ohm).

use super::uneven_place::UnevenPlace;
use crate::geometry::Point;
use crate::space::Place;

/// Most places of [`SpotFields::places_m`].
pub const MOST_PLACES: usize = 640;

/// Fields of spots on a detector.
pub trait SpotFields: Send + Sync {
    /// The spot at the place of the detector that is nearest.
    fn spot(&self, place_m: Place) -> Spot;

    /// Field of one spot at another (ohm).
    fn between_ohm(&self, a: &Spot, b: &Spot) -> f64;

    /// The place of the detector that is nearest to another (m), and unit vectors of two directions along the surface there.
    fn footing(&self, place_m: Place) -> (Place, [Place; 2]);

    /// About so many places, at most [`MOST_PLACES`], spread over the detector (m).
    fn places_m(&self, count: usize) -> Vec<Place>;
}

/// A place where current may enter, with its fields in the gauge of the model's.
#[derive(Clone, Debug, Default)]
pub struct Spot {
    /// Where it is (m).
    pub place_m: Place,
    /// Field of each electrode here (ohm).
    pub electrodes_ohm: Vec<f64>,
    /// Field of its own current, mean over the contact (ohm).
    pub own_ohm: f64,
    /// Part of the contact that is on the detector: the rest, beyond an edge, touches nothing.
    pub share: f64,
    /// What the model needs besides (square root of ohm).
    pub(super) inner: Vec<f32>,
    /// The middle of the part that is on the detector, in coordinates of the model's (m).
    pub(super) middle_m: Point,
    /// What uneven conductivity does here.
    pub(super) uneven: Option<UnevenPlace>,
    /// Fields of currents between joined electrodes (square root of ohm).
    pub(super) joined: Vec<f64>,
}

/// Scalar product of what spots carry, in eight sums for the processor to do at once.
pub(super) fn dot(a: &[f32], b: &[f32]) -> f64 {
    let (a_lanes, a_rest) = a.as_chunks::<8>();
    let (b_lanes, b_rest) = b.as_chunks::<8>();
    let mut sums = [0.0f32; 8];
    for (a, b) in a_lanes.iter().zip(b_lanes) {
        (0..8).for_each(|lane| sums[lane] += a[lane] * b[lane]);
    }
    f64::from(sums.iter().sum::<f32>() + a_rest.iter().zip(b_rest).map(|(a, b)| a * b).sum::<f32>())
}
