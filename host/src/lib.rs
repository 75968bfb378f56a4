//! Tactomo's host side: what a detector is, how it answers to touch, how touch is read back from its readings, and the live
//! picture of it.
//!
//! Arrows run one way: [`detector`], [`scene`], [`forward`] and [`simulate`] (physics) <- [`solve`] and [`metrics`] (touch) <- [`run`] ->
//! [`board`], with [`sink`] behind `run`. Each of them is a package of its own in the repository, and this one
//! gives them all. Units are SI, and in the names.
//!
//! From a detector to contacts:
//!
//! ```
//! use tactomo::{detector::Detector, forward::readings_v, scene::Contact, simulate, solve::{Method, Problem}};
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let detector = Detector::default(); // or Detector::read("my.toml".as_ref())?
//! // In place of a board: the readings of a light press, by a finer model than the one that is inverted.
//! let press = Contact::flat(0.009, -0.006, 0.003, 2e-4);
//! let impedance_ohm = simulate::finer_model(&detector, &[], 0)?.impedance_ohm(&[press])?;
//! let readings = readings_v(&impedance_ohm, &detector);
//!
//! let mut solver = Method::Contacts.build(&Problem::of(&detector)?)?;
//! let found = solver.solve(&readings)?.contacts[0];
//! assert!((found.x_m - press.x_m).hypot(found.y_m - press.y_m) < 1e-3);
//! # Ok(())
//! # }
//! ```

pub use tactomo_board as board;
pub use tactomo_physics::{
    baseline, causes, detector, forward, hertz, nalgebra, new_file, readings, scene, simulate, threads,
};
pub use tactomo_table as table;
pub use tactomo_touch::{calibrate, changes, learned, metrics, pointer, schema, solve, vibration};

pub mod check;
pub mod date;
pub mod run;
pub mod sink;
