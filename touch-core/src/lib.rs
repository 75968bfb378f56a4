#![doc = include_str!("../README.md")]
//!
//! # Parts
//!
//! - [`table`]: the format, and its reader; [`Contents`] writes it
//! - [`spline`]: what its fields are interpolated with
//! - `loaded`, `circuit`: readings of a few contacts, and their derivatives
//! - `normal`, `posterior`, `fit`: least squares
//! - `unknown`, `moved`, `detector`: what is not known of a detector, and how it is after steps
//! - `patterns`, `local`, `held`, `round`: what that changes in readings, and fits with it
//! - `evidence`: which of two explanations is believed
//! - `scan`, `beside`, `births`: where a first contact may be, and one more, on a detector that is known or not
//! - `search`: what explains a frame that what was followed does not
//! - `together`: what several frames say together of contacts that stay
//! - [`Solver`]: contacts from frame to frame

#![no_std]
#![allow(
    clippy::needless_range_loop,
    reason = "an index is that of an electrode, or a parameter, in several arrays at once"
)]
#![cfg_attr(test, allow(clippy::unwrap_used, reason = "a test that unwraps fails where it should, and says where"))]

#[cfg(test)]
extern crate std;

mod answer;
mod beside;
mod births;
mod circuit;
mod contents;
mod crc;
mod detector;
mod disc;
mod evidence;
mod fields;
mod fit;
#[cfg(test)]
mod found;
mod frame;
mod head;
mod held;
mod kept;
mod lanes;
#[cfg(test)]
mod laws;
mod loaded;
mod local;
mod moved;
mod normal;
mod patterns;
mod posterior;
mod products;
mod real;
mod round;
#[cfg(test)]
mod samples;
mod scan;
mod search;
#[cfg(test)]
mod search_tests;
mod slopes;
mod solver;
pub mod spline;
pub mod table;
#[cfg(test)]
mod tests;
mod together;
mod told;
mod unknown;
#[cfg(test)]
mod unknown_tests;
mod vector;
mod walls;
pub mod ways;

pub use self::answer::{Answer, Certainty, Contact, Flags};
pub use self::contents::Contents;
pub use self::fit::Work;
pub use self::frame::{Frame, FrameError, Says};
pub use self::held::Room;
pub use self::real::Real;

pub use self::solver::{BOARD_CONTACTS, Solver};
pub use self::table::{MAX_ELECTRODES, Table, TableError};
pub use self::together::{MOST_TOGETHER, Motion, Together};
pub use self::unknown::{Change, Direction, Unknown};
