//! The numbers that everything is worked out in.

use core::fmt::Debug;
use core::iter::{Product, Sum};

use num_traits::float::{FloatCore, TotalOrder};
use num_traits::{ConstOne, ConstZero, NumAssign};

use crate::lanes::Lanes;

/// A number to work with: `f32` or `f64`.
///
/// Roots, powers and logarithms are those of `libm` on all machines, so that a computer finds in `f32` what a board does, to the digit.
pub trait Real:
    Lanes
    + FloatCore
    + NumAssign
    + ConstZero
    + ConstOne
    + TotalOrder
    + Sum
    + Product
    + Default
    + Debug
    + Send
    + Sync
    + 'static
{
    /// The nearest one to a number.
    fn of(value: impl Into<f64>) -> Self;

    /// Its square root.
    fn sqrt(self) -> Self;

    /// `e` to its power.
    fn exp(self) -> Self;

    /// Its natural logarithm.
    fn ln(self) -> Self;

    /// Its power with an exponent.
    fn powf(self, exponent: Self) -> Self;
}

impl Real for f32 {
    #[inline]
    fn of(value: impl Into<f64>) -> Self {
        // What comes from an `f32` or a short whole number goes there and back in no instruction.
        value.into() as f32
    }

    #[inline]
    fn sqrt(self) -> Self {
        libm::sqrtf(self)
    }

    #[inline]
    fn exp(self) -> Self {
        libm::expf(self)
    }

    #[inline]
    fn ln(self) -> Self {
        libm::logf(self)
    }

    #[inline]
    fn powf(self, exponent: Self) -> Self {
        libm::powf(self, exponent)
    }
}

impl Real for f64 {
    #[inline]
    fn of(value: impl Into<f64>) -> Self {
        value.into()
    }

    #[inline]
    fn sqrt(self) -> Self {
        libm::sqrt(self)
    }

    #[inline]
    fn exp(self) -> Self {
        libm::exp(self)
    }

    #[inline]
    fn ln(self) -> Self {
        libm::log(self)
    }

    #[inline]
    fn powf(self, exponent: Self) -> Self {
        libm::pow(self, exponent)
    }
}
