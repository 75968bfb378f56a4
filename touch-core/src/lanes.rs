//! More numbers at once, where a processor can.

use crate::products::{ROWS, each_with_each};
#[cfg(not(feature = "wide"))]
use crate::{products::dot, real::Real};

/// Calls a function that is inlined with all that it calls, as the processor at hand can do it best.
#[inline(always)]
pub(crate) fn at_once<R>(function: impl FnOnce() -> R) -> R {
    #[cfg(feature = "wide")]
    return pulp::Arch::new().dispatch(function);
    #[cfg(not(feature = "wide"))]
    function()
}

/// Numbers whose rows are multiplied at once.
pub trait Lanes: Sized {
    /// Calls `out` with the numbers of two rows and their scalar product, for all rows of `a`, of `length` numbers each, with all of `b`, or where `is_lower` for those with
    /// no higher numbers and few besides.
    fn products(a: &[Self], b: &[Self], length: usize, is_lower: bool, out: impl FnMut(usize, usize, Self));
}

/// Scalar products of some rows with others.
#[cfg(not(feature = "wide"))]
fn dots<T: Real>(a: [&[T]; ROWS[0]], b: [&[T]; ROWS[1]]) -> [[T; ROWS[1]]; ROWS[0]] {
    a.map(|a| b.map(|b| dot(a, b)))
}

#[cfg(feature = "wide")]
struct Products<'a, T, F> {
    a: &'a [T],
    b: &'a [T],
    length: usize,
    is_lower: bool,
    out: F,
}

/// The compiler finds the way to multiply some rows at once by itself only now and then.
macro_rules! lanes {
    ($number:ty, $lanes:ident, $as_lanes:ident, $splat:ident, $add:ident, $sum:ident) => {
        impl Lanes for $number {
            fn products(a: &[Self], b: &[Self], length: usize, is_lower: bool, out: impl FnMut(usize, usize, Self)) {
                #[cfg(feature = "wide")]
                pulp::Arch::new().dispatch(Products { a, b, length, is_lower, out });
                #[cfg(not(feature = "wide"))]
                each_with_each([a, b], length, is_lower, out, dots);
            }
        }

        #[cfg(feature = "wide")]
        impl<F: FnMut(usize, usize, $number)> pulp::WithSimd for Products<'_, $number, F> {
            type Output = ();

            #[inline(always)]
            fn with_simd<S: pulp::Simd>(self, simd: S) {
                let dots = |a: [&[$number]; ROWS[0]], b: [&[$number]; ROWS[1]]| {
                    let [(a0, rest_a0), (a1, rest_a1)] = a.map(|row| S::$as_lanes(row));
                    let [(b0, rest0), (b1, rest1), (b2, rest2), (b3, rest3)] = b.map(|row| S::$as_lanes(row));
                    let zero = simd.$splat(0.0);
                    let [mut s00, mut s01, mut s02, mut s03] = [zero; ROWS[1]];
                    let [mut s10, mut s11, mut s12, mut s13] = [zero; ROWS[1]];
                    for (((((a0, a1), b0), b1), b2), b3) in a0.iter().zip(a1).zip(b0).zip(b1).zip(b2).zip(b3) {
                        s00 = simd.$add(*a0, *b0, s00);
                        s01 = simd.$add(*a0, *b1, s01);
                        s02 = simd.$add(*a0, *b2, s02);
                        s03 = simd.$add(*a0, *b3, s03);
                        s10 = simd.$add(*a1, *b0, s10);
                        s11 = simd.$add(*a1, *b1, s11);
                        s12 = simd.$add(*a1, *b2, s12);
                        s13 = simd.$add(*a1, *b3, s13);
                    }
                    let rest = |a: &[$number], b: &[$number]| a.iter().zip(b).map(|(a, b)| a * b).sum::<$number>();
                    let of_row = |sums: [S::$lanes; ROWS[1]], a: &[$number]| {
                        let rests = [rest0, rest1, rest2, rest3].map(|b| rest(a, b));
                        core::array::from_fn(|j| simd.$sum(sums[j]) + rests[j])
                    };
                    [of_row([s00, s01, s02, s03], rest_a0), of_row([s10, s11, s12, s13], rest_a1)]
                };
                each_with_each([self.a, self.b], self.length, self.is_lower, self.out, dots);
            }
        }
    };
}

lanes!(f32, f32s, as_simd_f32s, splat_f32s, mul_add_e_f32s, reduce_sum_f32s);
lanes!(f64, f64s, as_simd_f64s, splat_f64s, mul_add_e_f64s, reduce_sum_f64s);
