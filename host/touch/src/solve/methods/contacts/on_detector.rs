//! What of the distribution of a contact's place lies on the detector.
//!
//! A fit ends at the edge where the readings pull beyond it, or tell the place badly. Nothing touches beyond the edge, so what is known of
//! the place is the normal distribution of the fit, `exp(d.u - u.u / 2)` in standard errors `u` from where the fit ended and with `d` the
//! step that it would take, as far as that is on the detector: its share speaks for the fit, and its mean and covariance are those
//! of the place. By sums over a grid along the principal axes.

use nalgebra::{DMatrix, Matrix2, Vector2};

use super::discs::{DiscFit, PARAMETERS, place_m};
use tactomo_physics::forward::spots::SpotFields;
use tactomo_physics::space::{self, Place};

/// Standard errors up to which a distribution is looked at: 0.1 % of it lies beyond.
const REACH: f64 = 3.5;
/// Where the edge is looked for: 0.6 % of a distribution lies beyond an edge that is just as far.
const NEAR: f64 = 2.5;
/// Points along each axis, in the middles of as many equal parts.
const POINTS: usize = 30;
/// Most standard errors of the step that the fit would take: further on, the readings are not linear in the place.
const FURTHEST: f64 = 3.0;
/// Bound on a standard error: so many distances between electrodes over the root of the contact's signal in standard deviations. No current
/// flows across an edge, so that the first derivative by the way to it vanishes there, but the second does not: over a distance between electrodes
/// readings change by about themselves. Without it, fits of firm contacts that ended on the edge claimed 10 mm instead of 0.2. With 2, places
/// in corners are claimed too well (75 % within two standard errors); with 4, errors in corners of detectors as built double.
const LARGEST_ERROR: f64 = 3.0;
/// A place is beyond the edge if the nearest one on the detector is off by this share of the way there, along the surface: curved ones leave
/// their tangents by less.
const BEYOND: f64 = 0.02;

/// What is known of the place of a contact near the edge, in the parameters of its fit.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct OnDetector {
    /// Logarithm of the share of the distribution.
    pub ln_share: f64,
    /// Mean, from where the fit ended.
    pub mean: Vector2<f64>,
    /// Covariance.
    pub covariance: Matrix2<f64>,
}

/// The distribution of a place as the fit tells it.
struct Distribution<'a> {
    fields: &'a dyn SpotFields,
    from_m: Place,
    along: [Place; 2],
    unit_m: f64,
    /// Principal axes, as long as their standard errors.
    axes: Matrix2<f64>,
    /// Standard errors of the step that the fit would take.
    pull: Vector2<f64>,
}

/// The part of a covariance that is of a contact's place.
pub(super) fn of_place(covariance: &DMatrix<f64>, k: usize) -> Matrix2<f64> {
    covariance.fixed_view::<2, 2>(PARAMETERS * k, PARAMETERS * k).into_owned()
}

impl OnDetector {
    /// Of a contact of a fit, on a detector whose electrodes are `spacing_m` (m) apart; `None` if the edge is too far away to matter.
    pub fn of(
        fit: &DiscFit,
        k: usize,
        covariance: &DMatrix<f64>,
        (fields, spacing_m): (&dyn SpotFields, f64),
    ) -> Option<Self> {
        let (along, unit_m) = fit.along(k);
        let eigen = of_place(covariance, k).symmetric_eigen();
        let deviations = eigen.eigenvalues.map(|variance| variance.max(0.0).sqrt());
        let strength = PARAMETERS * k + 2;
        let most = LARGEST_ERROR * spacing_m / unit_m / fit.normal[(strength, strength)].sqrt().sqrt();
        let deviations = deviations.map(|deviation| deviation.min(most));
        let towards = covariance.fixed_rows::<2>(PARAMETERS * k) * &fit.pull;
        let pull = (eigen.eigenvectors.transpose() * towards).component_div(&deviations);
        let pull = pull * (FURTHEST / pull.norm().max(FURTHEST));
        let axes = eigen.eigenvectors * Matrix2::from_diagonal(&deviations);
        let from_m = place_m(&fit.contacts[k]);
        let distribution = Distribution { fields, from_m, along, unit_m, axes, pull };
        (pull.iter().all(|pull| pull.is_finite()) && distribution.is_near_edge()).then(|| distribution.on_detector())
    }
}

impl Distribution<'_> {
    fn is_near_edge(&self) -> bool {
        let turned = |eighth: u32| {
            let (sin, cos) = (std::f64::consts::FRAC_PI_4 * f64::from(eighth)).sin_cos();
            Vector2::new(cos, sin) * NEAR
        };
        (0..8).any(|eighth| !self.is_on(turned(eighth)))
    }

    /// Whether a place is on the detector, so many standard errors from where the fit ended.
    fn is_on(&self, errors: Vector2<f64>) -> bool {
        let way = self.axes * errors * self.unit_m;
        let to_m = space::moved(self.from_m, way.into(), self.along);
        let off_m = space::sub(self.fields.footing(to_m).0, to_m);
        let along_m = self.along.map(|direction| space::dot(off_m, direction));
        along_m[0].hypot(along_m[1]) <= BEYOND * way.norm()
    }

    fn on_detector(&self) -> OnDetector {
        let step = 2.0 * REACH / POINTS as f64;
        let at = |index: usize| step * (index as f64 + 0.5) - REACH;
        let (mut sum, mut first, mut second) = (0.0, Vector2::zeros(), Matrix2::zeros());
        for index in 0..POINTS * POINTS {
            let errors = Vector2::new(at(index / POINTS), at(index % POINTS));
            if !self.is_on(errors) {
                continue;
            }
            let weight = (self.pull.dot(&errors) - 0.5 * errors.norm_squared()).exp();
            sum += weight;
            first += errors * weight;
            second += errors * errors.transpose() * weight;
        }
        let mean = first / sum;
        let covariance = second / sum - mean * mean.transpose();
        // All of it, as the evidence of a fit has it, is 2 pi.
        let share = sum * step * step / std::f64::consts::TAU;
        OnDetector {
            ln_share: share.min(1.0).ln(),
            mean: self.axes * mean,
            covariance: self.axes * covariance * self.axes.transpose(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::solver;
    use super::*;

    /// What is known with standard errors of 1 mm about a place of `square-60`, whose edges are at 30 mm.
    fn about(from_m: [f64; 2], pull: [f64; 2]) -> Option<OnDetector> {
        let solver = solver();
        let distribution = Distribution {
            fields: &*solver.finder().fields,
            from_m: [from_m[0], from_m[1], 0.0],
            along: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]],
            unit_m: 2e-3,
            axes: Matrix2::identity() * 0.5,
            pull: pull.into(),
        };
        distribution.is_near_edge().then(|| distribution.on_detector())
    }

    #[track_caller]
    fn assert_near(a: f64, b: f64, most: f64) {
        assert!((a - b).abs() < most, "{a} is not {b}");
    }

    #[test]
    fn far_from_the_edge_nothing_is_taken_away() {
        assert_eq!(about([0.02, -0.02], [0.0; 2]), None);
    }

    #[test]
    fn at_the_edge_half_of_a_normal_distribution_is_left() {
        let half = about([0.03, 0.0], [0.0; 2]).unwrap();
        assert_near(half.ln_share, 0.5_f64.ln(), 2e-3);
        // Of a half normal distribution, in units of 2 mm.
        assert_near((half.mean - Vector2::new(-0.399, 0.0)).norm(), 0.0, 2e-3);
        let variances = Vector2::new(0.25 * (1.0 - std::f64::consts::FRAC_2_PI), 0.25);
        assert_near((half.covariance - Matrix2::from_diagonal(&variances)).norm(), 0.0, 3e-3);
        let quarter = about([-0.03, 0.03], [0.0; 2]).unwrap();
        assert_near(quarter.ln_share, 0.25_f64.ln(), 4e-3);
    }

    #[test]
    fn what_pulls_over_the_edge_leaves_the_tail_of_a_distribution_beyond_it() {
        // About a place two standard errors further, of which 0.0228 are on the detector, exp(2 * 2 / 2) times as high there.
        let tail = about([0.0, 0.03], [0.0, 2.0]).unwrap();
        assert_near(tail.ln_share, (0.02275 * 2.0_f64.exp()).ln(), 0.02);
        assert_near(tail.mean.y, 0.5 * (2.0 - 0.05399 / 0.02275), 5e-3);
    }
}
