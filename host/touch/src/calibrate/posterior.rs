//! What a fit leaves unknown of a detector.

use nalgebra::{Cholesky, DMatrix, SymmetricEigen};
use tactomo_physics::detector::{CalibratedParameter, Parameter};

/// Share of its standard deviation before that a parameter's standard error is still, if the readings said next to nothing of it.
const AT_PRIOR: f64 = 0.9;
/// Directions that change a press's readings by less than this, in the root of the sum of squares over their deviations, are left out: a
/// tenth of all.
const NEGLIGIBLE: f64 = 0.3;

/// Covariance of the parameters after a fit, in standard deviations before.
pub(super) struct Posterior {
    covariance: DMatrix<f64>,
    /// Its inverse.
    pub precision: DMatrix<f64>,
    /// Information of the readings of an average press alone.
    of_press: DMatrix<f64>,
}

impl Posterior {
    /// Of a fit of some presses with such information, whose readings miss the model by `chi_square`; `None` if that is no number.
    pub fn new(information: &DMatrix<f64>, of_press: DMatrix<f64>, chi_square: f64) -> Option<Self> {
        let count = information.nrows();
        // Where the model misses more than was reckoned, the readings say that much less.
        let system = information / chi_square.max(1.0) + DMatrix::identity(count, count);
        Some(Self { covariance: Cholesky::new(system.clone())?.inverse(), precision: system, of_press })
    }

    /// Before anything is fitted: the description.
    pub fn before(count: usize) -> Self {
        let one = DMatrix::identity(count, count);
        Self { covariance: one.clone(), precision: one, of_press: DMatrix::zeros(count, count) }
    }

    /// The parameters with their standard errors.
    pub fn parameters(&self, parameters: &[(Parameter, f64)]) -> Vec<CalibratedParameter> {
        let of = |(index, (parameter, deviation)): (usize, &(Parameter, f64))| {
            let left = self.covariance[(index, index)].max(0.0).sqrt();
            CalibratedParameter { parameter: *parameter, standard_error: left * deviation, is_prior: left > AT_PRIOR }
        };
        parameters.iter().enumerate().map(of).collect()
    }

    /// Independent directions of one standard deviation, in the parameters' units, those that change readings most first: what is left of
    /// others changes none.
    pub fn directions(&self, parameters: &[(Parameter, f64)]) -> Vec<Vec<f64>> {
        let Some(root) = Cholesky::new(self.covariance.clone()).map(|factor| factor.unpack()) else {
            return Vec::new();
        };
        let effect = root.tr_mul(&(&self.of_press * &root));
        let SymmetricEigen { eigenvalues, eigenvectors } = SymmetricEigen::new(effect);
        let mut order: Vec<usize> = (0..eigenvalues.len()).collect();
        order.sort_by(|a, b| eigenvalues[*b].total_cmp(&eigenvalues[*a]));
        let all = root * eigenvectors;
        let matters = order.into_iter().filter(|index| eigenvalues[*index] > NEGLIGIBLE * NEGLIGIBLE);
        matters
            .map(|index| {
                all.column(index).iter().zip(parameters).map(|(step, (_, deviation))| step * deviation).collect()
            })
            .collect()
    }
}
