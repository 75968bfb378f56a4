//! Vectors and matrices over the parameters of all contacts.

use core::ops::{Deref, DerefMut};

use crate::real::Real;

/// Parameters of a contact: its place along x and y in usual radii, the logarithm of its resistance, that of its radius.
pub(crate) const PARAMETERS: usize = 4;

/// A vector over the parameters of `K` contacts: those of the first, then those of the next.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Vector<T, const K: usize>(pub [[T; PARAMETERS]; K]);

impl<T: Real, const K: usize> Vector<T, K> {
    pub const ZERO: Self = Self([[T::ZERO; PARAMETERS]; K]);
}

impl<T, const K: usize> Deref for Vector<T, K> {
    type Target = [T];

    #[inline]
    fn deref(&self) -> &[T] {
        self.0.as_flattened()
    }
}

impl<T, const K: usize> DerefMut for Vector<T, K> {
    #[inline]
    fn deref_mut(&mut self) -> &mut [T] {
        self.0.as_flattened_mut()
    }
}

/// A square matrix over the parameters of `K` contacts, row by row.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Matrix<T, const K: usize>([[Vector<T, K>; PARAMETERS]; K]);

impl<T: Real, const K: usize> Matrix<T, K> {
    pub const ZERO: Self = Self([[Vector::ZERO; PARAMETERS]; K]);
}

impl<T, const K: usize> Deref for Matrix<T, K> {
    type Target = [Vector<T, K>];

    #[inline]
    fn deref(&self) -> &[Vector<T, K>] {
        self.0.as_flattened()
    }
}

impl<T, const K: usize> DerefMut for Matrix<T, K> {
    #[inline]
    fn deref_mut(&mut self) -> &mut [Vector<T, K>] {
        self.0.as_flattened_mut()
    }
}
