//! How numbers are fitted to readings: what several methods share.

pub(crate) mod approximation;
pub(crate) mod balance;
pub(crate) mod dot;
pub(crate) mod evidence;
pub(crate) mod interpolate;
pub(crate) mod lambda;
pub(crate) mod least_squares;
pub(crate) mod linear;
pub(crate) mod locate;
pub(crate) mod policy;
pub(crate) mod spots;
pub(crate) mod stiffness;
pub(crate) mod target;
