//! Cholesky factorisations, dense and sparse: what the models and the solvers solve their symmetric equations with.
//!
//! Products of matrices are nalgebra's, and so those of `matrixmultiply`, which takes the widest registers that the processor has.

mod dense;
mod order;
mod sparse;
#[cfg(test)]
mod tests;

pub(crate) use dense::dot;
pub use dense::{Cholesky, gram, gram_of_rows};
pub use sparse::{Factor, Plan};

/// A matrix that cannot be factorised: it is not positive definite to rounding, or not finite.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the matrix is not positive definite")]
pub struct NotPositive;

/// The root of what is left of a diagonal element.
fn pivot(left: f64) -> Result<f64, NotPositive> {
    if left > 0.0 && left.is_finite() { Ok(left.sqrt()) } else { Err(NotPositive) }
}
