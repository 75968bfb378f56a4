//! Which detector: what a sensor of some foam, thickness and electrodes can tell, and what of that its solver makes.
//!
//! The paper's studies ([`materials`] and others) put its four metrics, which are those of a thin shell and Tikhonov's image, beside the
//! [limit](Limit) of the sensor itself. Nothing here knows of commands or files.

pub mod bonding;
pub mod claim;
pub mod curve;
pub mod electrodes;
mod error;
pub mod explain;
mod imaging;
mod layout;
mod limit;
pub mod materials;
mod metrics;
mod paper;
mod press;
pub mod promises;
mod rank;
mod reached;
mod report;
pub mod samples;
pub mod search;
pub mod thickness;

pub use self::claim::{Basis, Claim, Verdict};
pub use self::error::DesignError;
pub use self::imaging::{Imaging, accuracy_of_the_middle};
pub use self::layout::Layout;
pub use self::limit::{Limit, Spread, places_everywhere, range, two_points_m};
pub use self::metrics::Metrics;
pub use self::paper::{Imaged, PaperSolver};
pub use self::press::Press;
pub use self::rank::{chance, holm, spearman};
pub use self::reached::Reached;
pub use self::report::{Course, overview};
pub use tactomo_study::{Progress, Step};
