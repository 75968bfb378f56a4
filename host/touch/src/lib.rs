//! From readings back to touch, and how right that is.
//!
//! [`solve`] has the solvers, one trait for all, with the plan of what uses what; [`calibrate`] what fits a detector's description to the one that was built;
//! [`learned`] has what solvers have learned, and opens files of it;
//! [`metrics`] the figures that solvers are judged by; [`changes`] says which contacts began, moved and ended; [`mod@pointer`] makes motion and clicks of a contact, [`vibration`] spectra of readings;
//! [`scanning`] chooses which rows to read; [`schema`] has the names of what leaves the program. None of them knows of boards, ports or pages.

pub mod calibrate;
pub mod changes;
mod gaussian;
pub mod learned;
pub mod metrics;
pub mod pointer;
pub mod scanning;
pub mod schema;
pub mod solve;
pub mod student;
pub mod vibration;
