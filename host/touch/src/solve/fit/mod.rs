//! Fitting numbers to readings.

pub(crate) mod least_squares;
