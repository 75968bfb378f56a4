//! What of the distribution of a contact's place lies on the detector.
//!
//! A fit ends at the edge where the readings pull beyond it, or tell the place badly. Nothing touches beyond the edge, and near it the readings
//! are not linear in the place. So what is known of the place is `exp(-cost / 2)` of [what the fit would leave there](PlaceCost), as far as that is on
//! the detector: its integral speaks for the fit, and its mean and covariance are those of the place. By sums over a grid, which closes
//! in on where the distribution is.

use nalgebra::{DMatrix, DVector, Matrix2, Vector2};

use super::discs::{DiscFit, DiscFitter, PARAMETERS, PlaceCost, place_m};
use tactomo_physics::forward::spots::SpotFields;
use tactomo_physics::space::{self, Place};

/// Where the edge is looked for, in standard errors: 0.6 % of a normal distribution lies beyond an edge that is just as far.
const NEAR: f64 = 2.5;
/// Half of the side of the square that is looked at first, in usual radii, if the normal distribution does not reach further: half of the mean
/// distance of electrodes. Further on, readings are not quadratic in the place.
const FIRST: f64 = 3.0;
/// Squares that are looked at, at most: each has a part of the one before, down to a 40th of its side.
const SQUARES: usize = 6;
/// Sum of squares over the least, up to which a distribution is looked at: 0.2 % of a normal one lies beyond.
const REACH: f64 = 12.25;
/// Points along each axis, in the middles of as many equal parts.
const POINTS: usize = 20;
/// A place is beyond the edge if the nearest one on the detector is off by this share of the way there, along the surface: curved ones leave
/// their tangents by less.
const BEYOND: f64 = 0.02;

/// What is known of the place of a contact near the edge, in the parameters of its fit.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct OnDetector {
    /// Logarithm of the integral, in that of the normal distribution of the fit.
    pub ln_share: f64,
    /// Mean, from where the fit ended.
    pub mean: Vector2<f64>,
    /// Covariance.
    pub covariance: Matrix2<f64>,
}

/// Where places are on a detector, from where a contact is, along the directions of its parameters.
struct Ground<'a> {
    fields: &'a dyn SpotFields,
    from_m: Place,
    along: [Place; 2],
    unit_m: f64,
}

/// A distribution of places.
struct Distribution<'a> {
    ground: Ground<'a>,
    cost: PlaceCost,
}

/// Points of a distribution: their middle and half side, each with the sum of squares over the least.
struct Square {
    low: Vector2<f64>,
    high: Vector2<f64>,
    points: Vec<(Vector2<f64>, f64)>,
    least: f64,
}

/// The part of a covariance that is of a contact's place.
pub(super) fn of_place(covariance: &DMatrix<f64>, k: usize) -> Matrix2<f64> {
    covariance.fixed_view::<2, 2>(PARAMETERS * k, PARAMETERS * k).into_owned()
}

/// Whether the place of a contact may be at the edge, as far as the fit's normal distribution tells.
pub(super) fn is_near_edge(fit: &DiscFit, k: usize, covariance: &DMatrix<f64>, fields: &dyn SpotFields) -> bool {
    let eigen = of_place(covariance, k).symmetric_eigen();
    let axes = eigen.eigenvectors * Matrix2::from_diagonal(&eigen.eigenvalues.map(|variance| variance.max(0.0).sqrt()));
    Ground::of(fit, k, fields).is_near_edge(&axes)
}

impl OnDetector {
    /// Of a contact of a fit; `None` if the edge is too far away to matter.
    pub fn of(fit: &DiscFit, k: usize, covariance: &DMatrix<f64>, fitter: &DiscFitter<'_>) -> Option<Self> {
        if !is_near_edge(fit, k, covariance, fitter.fields) {
            return None;
        }
        // What filters move ends with no step to take.
        let normal = fitter.linear_place_cost(fit, k, covariance, &DVector::zeros(covariance.nrows()))?;
        let cost = fit.place_costs.get(k).copied().flatten().unwrap_or(normal);
        let ground = Ground::of(fit, k, fitter.fields);
        let half = normal.reach(REACH).max(FIRST * fitter.usual_radius_m / ground.unit_m);
        let found = Distribution { ground, cost }.on_detector(half)?;
        Some(Self { ln_share: found.ln_share - 0.5 * of_place(covariance, k).determinant().ln(), ..found })
    }
}

impl<'a> Ground<'a> {
    fn of(fit: &DiscFit, k: usize, fields: &'a dyn SpotFields) -> Self {
        let (along, unit_m) = fit.along(k);
        Self { fields, from_m: place_m(&fit.contacts[k]), along, unit_m }
    }

    /// Whether an edge is within some standard errors, which are as long as the axes.
    fn is_near_edge(&self, axes: &Matrix2<f64>) -> bool {
        (0..8).any(|eighth| {
            let (sin, cos) = (std::f64::consts::FRAC_PI_4 * f64::from(eighth)).sin_cos();
            !self.holds(axes * Vector2::new(cos, sin) * NEAR)
        })
    }

    /// Whether a place is on the detector.
    fn holds(&self, way: Vector2<f64>) -> bool {
        let way_m = way * self.unit_m;
        let to_m = space::moved(self.from_m, way_m.into(), self.along);
        let off_m = space::sub(self.fields.footing(to_m).0, to_m);
        let along_m = self.along.map(|direction| space::dot(off_m, direction));
        along_m[0].hypot(along_m[1]) <= BEYOND * way_m.norm()
    }
}

impl Distribution<'_> {
    /// What of it is on the detector, in a square about where the fit ended with sides of twice `half`; its share is that of `2 pi`.
    fn on_detector(&self, half: f64) -> Option<OnDetector> {
        let all = Vector2::repeat(half);
        let mut square = self.square(-all, all);
        for _ in 1..SQUARES {
            let (low, high) = square.bounds()?;
            if (high - low).product() > 0.5 * (square.high - square.low).product() {
                break;
            }
            square = self.square(low, high);
        }
        let (mut sum, mut first, mut second) = (0.0, Vector2::zeros(), Matrix2::zeros());
        for (way, cost) in &square.points {
            let weight = (-0.5 * (cost - square.least)).exp();
            sum += weight;
            first += way * weight;
            second += way * way.transpose() * weight;
        }
        let mean = first / sum;
        let covariance = second / sum - mean * mean.transpose() + square.within();
        let part = square.side().product();
        Some(OnDetector { ln_share: (sum * part / std::f64::consts::TAU).ln() - 0.5 * square.least, mean, covariance })
            .filter(|found| found.ln_share.is_finite() && found.covariance.iter().all(|value| value.is_finite()))
    }

    fn square(&self, low: Vector2<f64>, high: Vector2<f64>) -> Square {
        let mut square = Square { low, high, points: Vec::with_capacity(POINTS * POINTS), least: f64::INFINITY };
        let side = square.side();
        for index in 0..POINTS * POINTS {
            let at = Vector2::new((index / POINTS) as f64 + 0.5, (index % POINTS) as f64 + 0.5);
            let way = low + at.component_mul(&side);
            if self.ground.holds(way) {
                let cost = self.cost.at(way);
                square.least = square.least.min(cost);
                square.points.push((way, cost));
            }
        }
        square
    }
}

impl Square {
    /// Sides of the parts that the points are in the middle of.
    fn side(&self) -> Vector2<f64> {
        (self.high - self.low) / POINTS as f64
    }

    /// Covariance within a part.
    fn within(&self) -> Matrix2<f64> {
        Matrix2::from_diagonal(&self.side().map(|side| side * side / 12.0))
    }

    /// Corners of what is to be looked at in it; `None` if nothing is.
    fn bounds(&self) -> Option<(Vector2<f64>, Vector2<f64>)> {
        let likely = self.points.iter().filter(|(_, cost)| *cost < self.least + REACH).map(|(way, _)| *way);
        let bounds = likely.fold(None, |bounds: Option<(Vector2<f64>, Vector2<f64>)>, way| {
            Some(bounds.map_or((way, way), |(low, high)| (low.inf(&way), high.sup(&way))))
        });
        bounds.map(|(low, high)| (low - self.side(), high + self.side()))
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::solver;
    use super::*;

    /// What is known with standard errors of 1 mm about a place of `square-60`, whose edges are at 30 mm.
    fn about(from_m: [f64; 2]) -> Option<OnDetector> {
        let solver = solver();
        let fields = &*solver.finder().fields;
        let [x_m, y_m] = from_m;
        let ground =
            Ground { fields, from_m: [x_m, y_m, 0.0], along: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], unit_m: 2e-3 };
        let covariance = Matrix2::identity() * 0.25;
        let cost = PlaceCost::normal(&covariance.try_inverse().unwrap(), Vector2::zeros());
        let is_near = ground.is_near_edge(&(Matrix2::identity() * 0.5));
        let found = is_near.then(|| Distribution { ground, cost }.on_detector(7.5).unwrap())?;
        Some(OnDetector { ln_share: found.ln_share - 0.5 * covariance.determinant().ln(), ..found })
    }

    #[track_caller]
    fn assert_near(a: f64, b: f64, most: f64) {
        assert!((a - b).abs() < most, "{a} is not {b}");
    }

    #[test]
    fn far_from_the_edge_nothing_is_taken_away() {
        assert_eq!(about([0.02, -0.02]), None);
    }

    #[test]
    fn at_the_edge_half_of_a_normal_distribution_is_left() {
        let half = about([0.03, 0.0]).unwrap();
        // Half of a part of the grid, which the edge may cut, is 0.07 nats.
        assert_near(half.ln_share, 0.5_f64.ln(), 0.07);
        // Of a half normal distribution, in units of 2 mm.
        assert_near((half.mean - Vector2::new(-0.399, 0.0)).norm(), 0.0, 0.03);
        let variances = Vector2::new(0.25 * (1.0 - std::f64::consts::FRAC_2_PI), 0.25);
        assert_near((half.covariance - Matrix2::from_diagonal(&variances)).norm(), 0.0, 0.03);
        let quarter = about([-0.03, 0.03]).unwrap();
        assert_near(quarter.ln_share, 0.25_f64.ln(), 0.14);
    }
}
