//! A tomographic tactile detector, what touches it, and the readings that it gives.
//!
//! [`detector`] says what a detector is, [`scene`] and [`hertz`] what presses on it, [`forward`] what it answers, and [`simulate`]
//! what of that arrives through wires and a converter. Nothing here knows of solvers, boards or files of other programs. Units are
//! SI, and in the names.

/// Matrices in this package's signatures are of this version of it.
pub use nalgebra;

pub mod algebra;
pub mod baseline;
pub mod causes;
pub mod detector;
pub mod forward;
pub mod geometry;
pub mod hertz;
pub mod new_file;
pub mod readings;
pub mod scene;
pub mod simulate;
pub mod space;
pub mod threads;
