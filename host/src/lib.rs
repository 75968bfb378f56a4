//! Tactomo's host side: what a detector is, how it answers to touch, how touch is read back from its readings, and the live
//! picture of it.
//!
//! Modules stand in the order in which the data flows: [`detector`] -> [`forward`] -> [`solve`] -> [`live`], with [`source`]
//! beside them. `forward` knows nothing of `solve`, `solve` nothing of serial ports or web pages. Units are SI, and in the
//! names.

pub mod case;
pub mod detector;
pub mod forward;
pub mod frames;
mod geometry;
pub mod hertz;
pub mod live;
pub mod metrics;
pub mod readings;
pub mod record;
pub mod scene;
pub mod simulate;
pub mod solve;
pub mod source;
mod space;
pub mod study;
pub mod table;
pub mod validate;
