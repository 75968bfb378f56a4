//! Where methods fail: each thing that can go wrong, swept from harmless to hopeless.

mod bounds;
mod breakdown;
mod errors;
mod faults;
mod report;
mod run;
mod scenes;
mod shapes;
mod sweep;
mod tolerances;
mod trials;
mod view;
mod wrong;

pub use self::bounds::{BoundChart, BoundCurve, BoundReport};
pub use self::breakdown::{Break, Breakdown, CellReport, Classes, Margin};
pub use self::report::{ErrorRange, PointReport, Report, SolverRow, SweepReport};
pub use self::run::run;
pub use self::sweep::Plan;
pub use self::view::view;
