//! What is done to readings before a method has them: readings to readings.

pub(crate) mod adaptive_mean;
pub(crate) mod complete;
pub(crate) mod latest;
