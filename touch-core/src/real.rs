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

/// The natural logarithm of a positive number, to 1.5e-4: of its exponent, and of its fraction `m` three terms of `2 artanh((m - 1) / (m + 1))`.
pub(crate) fn rough_ln(value: f32) -> f32 {
    const ONE: u32 = 1.0f32.to_bits();
    const FRACTION: u32 = (1 << (f32::MANTISSA_DIGITS - 1)) - 1;
    let exponent = (value.to_bits() >> (f32::MANTISSA_DIGITS - 1)) as f32 - (ONE >> (f32::MANTISSA_DIGITS - 1)) as f32;
    let fraction = f32::from_bits(value.to_bits() & FRACTION | ONE);
    let s = (fraction - 1.0) / (fraction + 1.0);
    let square = s * s;
    exponent * core::f32::consts::LN_2 + 2.0 * s * (1.0 + square * (1.0 / 3.0 + square * (1.0 / 5.0)))
}

#[cfg(test)]
mod tests {
    #[test]
    fn the_rough_logarithm_is_near_the_logarithm() {
        for value in (0..2000).map(|index| libm::expf(0.02 * index as f32 - 20.0)) {
            assert!((super::rough_ln(value) - libm::logf(value)).abs() < 1.5e-4, "{value}");
        }
    }
}
