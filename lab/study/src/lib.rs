//! Studies of solvers: how speed and accuracy trade against each other, and where methods fail.
//!
//! Data always come from a [finer model](tactomo_physics::simulate::finer_model) than any that is inverted,
//! or of an [independent solution](Independent), through wires, noise and converter.

pub mod bank;
mod bound;
pub mod built;
mod calibrate;
pub mod case;
mod experiment;
pub mod growth;
mod independent;
mod json_file;
pub mod judge;
mod machine;
pub mod picard;
mod presses;
mod progress;
pub mod scanning;
mod scenes;
pub mod score;
pub mod stability;
pub mod stopwatch;
mod summary;
pub mod surface;
pub mod tradeoff;
pub mod validate;
mod variant;
pub mod view;

pub use self::bound::{Bound, Errors, RADIUS_DEVIATION, cramer_rao};
pub use self::calibrate::{Calibrate, Calibrated};
pub use self::experiment::{Experiment, Frame, StudyError};
pub use self::independent::{Independent, IndependentError, Patch};
pub use self::machine::Machine;
pub use self::progress::{Progress, Step};
pub use self::scenes::{Group, SceneKind};
pub use self::score::{Score, Scorer, Summary};
pub use self::variant::Variation;
