//! Boards: how bytes come from them, what they say, and what is kept of it.
//!
//! [`link`] brings bytes from a serial port, the [simulated board](simulated) or a [recording](record); [`session`] is the talk with a
//! board, [`check`] a first look at it, [`frames`] what its frames mean, [`baseline`] what they read with nothing on the detector. Nothing here knows of solvers.

pub mod baseline;
pub mod board_log;
pub mod check;
pub mod clock;
pub mod frames;
pub mod identity;
pub mod inputs;
pub mod link;
pub mod measured;
pub mod record;
pub mod sequence;
pub mod session;
pub mod simulated;
pub mod source;
pub mod table;
