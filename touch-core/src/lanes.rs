//! More numbers at once, where a processor can.

use crate::products::{ACROSS, DOWN, Dots, each_with_each};
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

/// Without lanes.
#[cfg(not(feature = "wide"))]
struct Plain;

#[cfg(not(feature = "wide"))]
impl<T: Real> Dots<T> for Plain {
    fn of_one(&self, a: &[T], b: [&[T]; ACROSS]) -> [T; ACROSS] {
        b.map(|b| dot(a, b))
    }

    fn of_some(&self, a: [&[T]; DOWN], b: [&[T]; ACROSS]) -> [[T; ACROSS]; DOWN] {
        a.map(|a| self.of_one(a, b))
    }
}

#[cfg(feature = "wide")]
struct Products<'a, T, F> {
    a: &'a [T],
    b: &'a [T],
    length: usize,
    is_lower: bool,
    out: F,
}

/// With a processor's, of so many numbers each.
#[cfg(feature = "wide")]
struct Wide<S, T>(S, core::marker::PhantomData<T>);

/// The compiler finds the way to multiply some rows at once by itself only now and then, and with arrays of sums not at all.
macro_rules! lanes {
    ($number:ty, $lanes:ident, $as_lanes:ident, $splat:ident, $add:ident, $sum:ident) => {
        impl Lanes for $number {
            fn products(a: &[Self], b: &[Self], length: usize, is_lower: bool, out: impl FnMut(usize, usize, Self)) {
                #[cfg(feature = "wide")]
                pulp::Arch::new().dispatch(Products { a, b, length, is_lower, out });
                #[cfg(not(feature = "wide"))]
                each_with_each([a, b], length, is_lower, out, &Plain);
            }
        }

        #[cfg(feature = "wide")]
        impl<F: FnMut(usize, usize, $number)> pulp::WithSimd for Products<'_, $number, F> {
            type Output = ();

            #[inline(always)]
            fn with_simd<S: pulp::Simd>(self, simd: S) {
                each_with_each(
                    [self.a, self.b],
                    self.length,
                    self.is_lower,
                    self.out,
                    &Wide(simd, core::marker::PhantomData::<$number>),
                );
            }
        }

        #[cfg(feature = "wide")]
        impl<S: pulp::Simd> Wide<S, $number> {
            /// Sums over lanes, with what is left over of rows.
            #[inline(always)]
            fn ended(&self, sums: [S::$lanes; ACROSS], a: &[$number], b: [&[$number]; ACROSS]) -> [$number; ACROSS] {
                let rest = |b: &[$number]| a.iter().zip(b).map(|(a, b)| a * b).sum::<$number>();
                core::array::from_fn(|j| self.0.$sum(sums[j]) + rest(b[j]))
            }
        }

        #[cfg(feature = "wide")]
        impl<S: pulp::Simd> Dots<$number> for Wide<S, $number> {
            #[inline(always)]
            fn of_one(&self, a: &[$number], b: [&[$number]; ACROSS]) -> [$number; ACROSS] {
                let (simd, (a, rest_a)) = (self.0, S::$as_lanes(a));
                let [(b0, rest0), (b1, rest1), (b2, rest2), (b3, rest3)] = b.map(|row| S::$as_lanes(row));
                let [mut s0, mut s1, mut s2, mut s3] = [simd.$splat(0.0); ACROSS];
                for ((((a, b0), b1), b2), b3) in a.iter().zip(b0).zip(b1).zip(b2).zip(b3) {
                    s0 = simd.$add(*a, *b0, s0);
                    s1 = simd.$add(*a, *b1, s1);
                    s2 = simd.$add(*a, *b2, s2);
                    s3 = simd.$add(*a, *b3, s3);
                }
                self.ended([s0, s1, s2, s3], rest_a, [rest0, rest1, rest2, rest3])
            }

            #[inline(always)]
            fn of_some(&self, a: [&[$number]; DOWN], b: [&[$number]; ACROSS]) -> [[$number; ACROSS]; DOWN] {
                let simd = self.0;
                let [(a0, rest_a0), (a1, rest_a1), (a2, rest_a2)] = a.map(|row| S::$as_lanes(row));
                let [(b0, rest0), (b1, rest1), (b2, rest2), (b3, rest3)] = b.map(|row| S::$as_lanes(row));
                let zero = simd.$splat(0.0);
                let [mut s00, mut s01, mut s02, mut s03] = [zero; ACROSS];
                let [mut s10, mut s11, mut s12, mut s13] = [zero; ACROSS];
                let [mut s20, mut s21, mut s22, mut s23] = [zero; ACROSS];
                let rows = a0.iter().zip(a1).zip(a2).zip(b0).zip(b1).zip(b2).zip(b3);
                for ((((((a0, a1), a2), b0), b1), b2), b3) in rows {
                    s00 = simd.$add(*a0, *b0, s00);
                    s10 = simd.$add(*a1, *b0, s10);
                    s20 = simd.$add(*a2, *b0, s20);
                    s01 = simd.$add(*a0, *b1, s01);
                    s11 = simd.$add(*a1, *b1, s11);
                    s21 = simd.$add(*a2, *b1, s21);
                    s02 = simd.$add(*a0, *b2, s02);
                    s12 = simd.$add(*a1, *b2, s12);
                    s22 = simd.$add(*a2, *b2, s22);
                    s03 = simd.$add(*a0, *b3, s03);
                    s13 = simd.$add(*a1, *b3, s13);
                    s23 = simd.$add(*a2, *b3, s23);
                }
                let rests = [rest0, rest1, rest2, rest3];
                [
                    self.ended([s00, s01, s02, s03], rest_a0, rests),
                    self.ended([s10, s11, s12, s13], rest_a1, rests),
                    self.ended([s20, s21, s22, s23], rest_a2, rests),
                ]
            }
        }
    };
}

lanes!(f32, f32s, as_simd_f32s, splat_f32s, mul_add_e_f32s, reduce_sum_f32s);
lanes!(f64, f64s, as_simd_f64s, splat_f64s, mul_add_e_f64s, reduce_sum_f64s);
