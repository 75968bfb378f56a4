//! Thresholds that can be changed while the program runs, to measure what each is worth: with the feature `ablation` alone. Without it each is
//! a constant.

/// Defines each threshold as a function of its name.
#[cfg(not(feature = "ablation"))]
macro_rules! thresholds {
    ($($(#[$about:meta])* $name:ident: $kind:ty = $value:expr;)*) => {
        $($(#[$about])* pub(crate) const fn $name() -> $kind { $value })*
    };
}

/// Defines each threshold as a function of its name, that tells a [`Threshold`] when it is read; and [`all`] of those.
#[cfg(feature = "ablation")]
macro_rules! thresholds {
    ($($(#[$about:meta])* $name:ident: $kind:ty = $value:expr;)*) => {
        #[allow(non_upper_case_globals, reason = "named as what they are of")]
        mod of {
            use $crate::solve::fit::ablation::Threshold;
            $(pub static $name: Threshold = Threshold::new(stringify!($name), stringify!($value));)*
        }
        $($(#[$about])* pub(crate) fn $name() -> $kind { of::$name.of($value) })*

        /// All thresholds that decide between answers.
        pub fn all() -> &'static [&'static super::ablation::Threshold] {
            const ALL: &[&super::ablation::Threshold] = &[$(&of::$name),*];
            ALL
        }
    };
}

pub(crate) use thresholds;

#[cfg(feature = "ablation")]
pub use self::changed::Threshold;

#[cfg(feature = "ablation")]
mod changed {
    use std::sync::atomic::{AtomicU64, Ordering};

    /// One threshold.
    #[derive(Debug)]
    pub struct Threshold {
        /// Its name.
        pub name: &'static str,
        /// Its value, as it is written.
        pub value: &'static str,
        /// Bits of the factor on it.
        factor: AtomicU64,
        reads: AtomicU64,
    }

    /// What a factor changes.
    pub trait Scaled {
        /// So many times as much.
        fn times(self, factor: f64) -> Self;
    }

    impl Threshold {
        pub(in crate::solve::fit) const fn new(name: &'static str, value: &'static str) -> Self {
            Self { name, value, factor: AtomicU64::new(1f64.to_bits()), reads: AtomicU64::new(0) }
        }

        pub(in crate::solve::fit) fn of<T: Scaled>(&self, value: T) -> T {
            self.reads.fetch_add(1, Ordering::Relaxed);
            value.times(f64::from_bits(self.factor.load(Ordering::Relaxed)))
        }

        /// Makes it so many times as large as it is written, for the whole program; 1 makes it what it is.
        pub fn scale(&self, factor: f64) {
            self.factor.store(factor.to_bits(), Ordering::Relaxed);
        }

        /// How often it was read since it was asked last.
        pub fn take_reads(&self) -> u64 {
            self.reads.swap(0, Ordering::Relaxed)
        }
    }

    impl Scaled for f64 {
        fn times(self, factor: f64) -> Self {
            self * factor
        }
    }

    impl Scaled for f32 {
        fn times(self, factor: f64) -> Self {
            self * factor as Self
        }
    }

    impl Scaled for u32 {
        fn times(self, factor: f64) -> Self {
            (f64::from(self) * factor).round() as Self
        }
    }

    impl Scaled for usize {
        fn times(self, factor: f64) -> Self {
            (self as f64 * factor).round() as Self
        }
    }

    impl<T: Scaled, const N: usize> Scaled for [T; N] {
        fn times(self, factor: f64) -> Self {
            self.map(|one| one.times(factor))
        }
    }
}
