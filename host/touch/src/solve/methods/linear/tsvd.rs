//! Linear image from the first singular images alone: truncated singular value decomposition.
//!
//! What Tikhonov's image holds down step by step is here kept whole or left out: the singular images whose value is at least a
//! share of the largest (Hansen, "Rank-Deficient and Discrete Ill-Posed Problems", 1998, ch. 3).

use crate::solve::answer::{Solution, SolveError};
use crate::solve::fit::linear::{Decomposition, Force, LinearImage};
use crate::solve::fit::locate::Locator;
use crate::solve::solver::Solver;
use tactomo_physics::forward::jacobian::Jacobian;
use tactomo_physics::readings::Readings;

/// Linear image from the first singular images alone.
pub struct Tsvd {
    linear: LinearImage,
    /// Singular values below are left out.
    least: f64,
    locator: Locator,
}

impl Tsvd {
    /// The share with the smallest position error on the slab: `examples/lambda.rs`.
    pub const SHARE: f64 = 0.015;

    /// Makes it ready for a detector, to keep singular values of at least `share` of the largest.
    pub fn new(jacobian: &Jacobian, share: f64) -> Self {
        let linear = LinearImage::new(jacobian, Decomposition::of(jacobian));
        let least = share * linear.singular_values()[0];
        Self { linear, least, locator: Locator::new(&jacobian.image_mesh, &jacobian.detector) }
    }

    /// Number of singular images that are kept.
    pub fn rank(&self) -> usize {
        self.linear.singular_values().iter().filter(|value| **value >= self.least).count()
    }
}

impl Solver for Tsvd {
    fn name(&self) -> &'static str {
        "tsvd"
    }

    fn solve(&mut self, readings: &Readings) -> Result<Solution, SolveError> {
        let spectrum = self.linear.spectrum(readings, Force::Balanced)?;
        let (shares, left_v2) = spectrum.filtered(|value| if value >= self.least { 1.0 } else { 0.0 });
        let image = self.linear.image_s_per_m2(&shares);
        let contacts = if self.locator.is_rest(readings) { Vec::new() } else { self.locator.peaks(&image) };
        Ok(Solution {
            contacts,
            residual: Some(spectrum.deviations(left_v2)),
            flags: self.linear.flags(readings, &spectrum),
            image_s_per_m2: Some(image),
            ..Solution::default()
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::solve::fit::lambda::Lambda;
    use crate::solve::methods::linear::{Tikhonov, Variant};
    use crate::solve::samples::{CONTACT, jacobian, readings};

    #[test]
    fn all_singular_images_are_tikhonovs_without_lambda() {
        let (jacobian, readings) = (jacobian(500), readings(CONTACT));
        let mut all = Tsvd::new(&jacobian, 1e-9);
        assert_eq!(all.rank(), 16);
        let solution = all.solve(&readings).unwrap();
        let tikhonov = Tikhonov::new(&jacobian, Lambda::Relative(1e-6), Variant::Balanced);
        let (image, same) = (solution.image_s_per_m2.unwrap(), tikhonov.image_s_per_m2(&readings).unwrap());
        let largest = same.iter().fold(0.0f32, |largest, value| largest.max(value.abs()));
        assert!(image.iter().zip(&same).all(|(a, b)| (a - b).abs() < 1e-3 * largest));
    }

    #[test]
    fn fewer_singular_images_leave_more_of_the_readings() {
        let (jacobian, readings) = (jacobian(500), readings(CONTACT));
        let left = |share| Tsvd::new(&jacobian, share).solve(&readings).unwrap().residual.unwrap();
        let [few, some, all] = [0.5, 0.05, 1e-9].map(left);
        assert!(few > 1.5 * some && some > all, "{few} {some} {all}");
    }

    #[test]
    fn finds_a_contact_where_it_is() {
        let solution = Tsvd::new(&jacobian(2000), Tsvd::SHARE).solve(&readings(CONTACT)).unwrap();
        let found = solution.contacts.first().copied().unwrap_or_default();
        assert!((found.x_m - 0.009).hypot(found.y_m + 0.006) < 0.005, "{:?}", solution.contacts);
    }
}
