//! From readings back to touch.
//!
//! ```text
//! answer    what a solver says: Solution, FoundContact, Flags, errors          -> nobody
//! fit       least squares, evidence, policy, the linear theory                 -> answer
//! before    complete, adaptive_mean, latest: readings to readings                      -> fit
//! compiled  a detector compiled for `touch-core`: a table, what it may differ by  -> fit
//! problem   what solvers are made for: a detector with its models              -> before, compiled, what was learned
//! solver    what a method is to those who run it: one trait, and two halves    -> answer
//! after     associate, force, correct: solutions to solutions                  -> answer, fit, problem
//! health    which electrodes cannot be right                                   -> answer
//! methods   compiled | shapes | image | linear | network | kernel | comparisons
//!           -> answer, fit, problem, solver
//!           contacts, which average frames, number contacts by themselves and begin with those of compiled  -> these too, before, after
//!           auto, which chooses among contacts, shapes and image               -> these too
//! pipeline  before -> method -> after: the page to read first                  -> all of these
//! ```
//!
//! Methods know none of each other, but for `contacts` and `auto`. `tests/rooms.rs` is this plan as code, and holds every arrow.

mod after;
pub(crate) mod answer;
mod before;
mod compiled;
pub(crate) mod fit;
mod health;
mod methods;
mod pipeline;
mod problem;
#[cfg(test)]
mod samples;
mod solver;

#[cfg(test)]
pub(crate) use self::after::correct::Corrector;
pub use self::answer::{
    Alternative, Calibrated, Change, Choice, ElectrodeFault, Flags, FoundContact, FoundLine, FoundRing, FoundShape,
    LineUncertainty, RingUncertainty, Solution, SolveError, Total, Uncertainty, check,
};
pub use self::before::adaptive_mean::AdaptiveMean;
pub(crate) use self::before::adaptive_mean::rounding_v;
pub use self::before::latest::Latest;
pub use self::compiled::{CompileError, CompiledTable, TableFileError};
pub use self::fit::interpolate::Interpolation;
pub use self::fit::lambda::{Lambda, UnknownLambda};
pub use self::health::electrodes::faulty_electrodes;
pub(crate) use self::health::electrodes::{Pair as PairOfLoads, loads};
pub use self::health::table::{TableDoubt, table_doubt};
pub use self::health::watch::{ElectrodeWatch, FaultyElectrodes, Look};
pub use self::methods::auto::Auto;
pub use self::methods::comparisons::{Bsbl, Nonnegative, Tv};
pub use self::methods::compiled::{Compiled, add_newtons, compile};
pub use self::methods::contacts::{ContactSettings, Contacts, contact_over_needed};
pub use self::methods::image::{Nonlinear, NonlinearSettings};
pub use self::methods::kernel::KernelSolver;
pub use self::methods::linear::{Tikhonov, Variant};
pub use self::methods::network::NetworkSolver;
pub use self::pipeline::fault_tolerant::FaultTolerant;
pub use self::pipeline::method::{Family, Method, UnknownSolver};
pub use self::pipeline::parameter::{Parameter, ParameterKind};
pub use self::pipeline::unexplained::below_rest_v;
pub use self::pipeline::without::without;
pub use self::problem::{LearnedElsewhere, Problem};
pub use self::solver::{Followed, Hypothesis, Parts, Search, Solver, Tracker};
pub use crate::learned::kernel::{
    Description, Kernel, Press, Presses, PressesError, Strength, TeachError, check_newtons,
};
pub use crate::learned::network::{Network, NetworkError};
