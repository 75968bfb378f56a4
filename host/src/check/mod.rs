//! A first look at a board and its detector: whether every electrode is connected, and to what it should be.
//!
//! A person is asked to let go, to lay a hand on the foam, and to press with a fingertip at some places; [`Check`] takes the frames that come
//! meanwhile. What they say of electrodes is [`ElectrodeWatch`]'s to tell; added here is what only a whole course of touches shows: inputs
//! that follow nothing, and exchanged wires, which one fingertip has to show twice.
//!
//! [`ElectrodeWatch`]: tactomo_touch::solve::ElectrodeWatch

mod advice;
mod course;
mod diagnosis;
mod picture;
mod presser;
mod report;
#[cfg(test)]
mod tests;
mod touch;

pub use self::course::{Ask, Check, FINGERS};
pub use self::picture::picture;
pub use self::presser::Presser;
pub use self::report::{ElectrodeReport, Report, State};
