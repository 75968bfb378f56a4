//! Tactomo's host side: what a detector is, how it answers to touch, how touch is read back from its readings, and the live
//! picture of it.
//!
//! Arrows run one way: [`detector`], [`scene`], [`forward`] and [`simulate`] (physics) <- [`solve`] and [`metrics`] (touch) <- [`run`] ->
//! [`board`], with [`sink`] behind `run` and [`study`] on touch alone. Each of them is a package of its own in the repository, and this one
//! gives them all. Units are SI, and in the names.

pub use tactomo_board as board;
pub use tactomo_physics::{detector, forward, hertz, readings, scene, simulate};
pub use tactomo_study as study;
pub use tactomo_table as table;
pub use tactomo_touch::{metrics, solve};

pub mod run;
pub mod sink;
