//! The solvers by their names: one table, a row each.

use std::sync::Arc;

use super::parameter::{Parameter, ParameterKind};
use super::{Staged, Stages};
use crate::learned::Learned;
use crate::learned::network::{Network, NetworkError};
use crate::solve::fit::lambda::Lambda;
use crate::solve::methods::auto::Auto;
use crate::solve::methods::comparisons::{Bsbl, Nonnegative, Tv};
use crate::solve::methods::compiled::Compiled;
use crate::solve::methods::contacts::{ContactSettings, Contacts};
use crate::solve::methods::image::{Nonlinear, NonlinearSettings};
use crate::solve::methods::kernel::KernelSolver;
use crate::solve::methods::linear::{Tikhonov, Variant};
use crate::solve::methods::network::NetworkSolver;
use crate::solve::problem::Problem;
use crate::solve::solver::Solver;
use tactomo_physics::causes::with_causes;
use tactomo_physics::forward::ForwardError;

/// A solver by its name; the order is that of the [table](Method::ALL).
///
/// ```
/// use tactomo_touch::solve::Method;
///
/// assert_eq!("tikhonov".parse(), Ok(Method::Tikhonov));
/// for method in Method::ALL {
///     println!("{}: {}", method.name(), method.explanation());
/// }
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Method {
    /// Chooses between nothing, contacts, a line, a ring and an image.
    Auto,
    /// Fits a few contacts with the full contact physics.
    Contacts,
    /// Up to three contacts from a compiled table, as on a board.
    Core,
    /// Image with the full contact physics.
    Nonlinear,
    /// Sparse image of a few patches.
    Bsbl,
    /// Linear image; a contact at each of its peaks.
    Tikhonov,
    /// Linear image that keeps edges.
    Tv,
    /// Linear image without negative values.
    Nonnegative,
    /// Smooth linear image.
    Laplace,
    /// Linear image weighted by sensitivity.
    Noser,
    /// Linear image from the largest singular values alone.
    Tsvd,
    /// Regression from presses at known places.
    Kernel,
    /// Image and contacts by a network trained on simulated detectors as built.
    Network,
    /// The paper's linear image.
    TikhonovPaper,
}

/// What a solver is made of, for charts and legends.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Family {
    /// Chooses by itself.
    Auto,
    /// A few contacts.
    Contacts,
    /// Images under a constraint or with the full contact physics.
    Image,
    /// Linear images.
    Linear,
    /// Learned from presses.
    Learned,
    /// The paper's own.
    Paper,
}

impl Family {
    /// All of them.
    pub const ALL: [Self; 6] = [Self::Auto, Self::Contacts, Self::Image, Self::Linear, Self::Learned, Self::Paper];

    /// Its name in style sheets.
    pub fn class(self) -> &'static str {
        match self {
            Self::Auto => "auto",
            Self::Contacts => "contacts",
            Self::Image => "image",
            Self::Linear => "linear",
            Self::Learned => "learned",
            Self::Paper => "paper",
        }
    }

    /// Its name for people.
    pub fn title(self) -> &'static str {
        match self {
            Self::Auto => "chooses by itself",
            Self::Contacts => "a few contacts",
            Self::Image => "images with constraints or the full contact physics",
            Self::Linear => "linear images",
            Self::Learned => "learned from presses",
            Self::Paper => "the paper's",
        }
    }
}

type Built = Result<Box<dyn Solver>, ForwardError>;

/// All that is known of a method before it is built.
struct Row {
    method: Method,
    /// On the command line.
    name: &'static str,
    /// What it is for, in a line.
    explanation: &'static str,
    family: Family,
    parameter: Option<ParameterKind>,
    /// Builds it; a parameter that is `None`, or not of its kind, leaves the default.
    build: fn(&Problem, Option<Parameter>) -> Built,
}

/// The methods, those that most people look for first.
const TABLE: [Row; 14] = [
    Row {
        method: Method::Auto,
        name: "auto",
        explanation: "for most uses: decides for each frame between nothing, contacts, a line, a ring and an image",
        family: Family::Auto,
        parameter: None,
        build: |problem, _| Ok(Box::new(Auto::new(problem)?)),
    },
    Row {
        method: Method::Contacts,
        name: "contacts",
        explanation: "for fingertips and probes: fits position and conductance of up to six contacts, with standard errors",
        family: Family::Contacts,
        parameter: Some(ParameterKind::MaxContacts),
        build: |problem, parameter| {
            let settings = ContactSettings::of(problem);
            let most = if let Some(Parameter::MaxContacts(most)) = parameter { most } else { settings.most };
            Ok(Box::new(Contacts::new(problem, ContactSettings { most, ..settings })?))
        },
    },
    Row {
        method: Method::Core,
        name: "core",
        explanation: "for up to eight contacts in some milliseconds, as boards without a computer find three of them: from a compiled table, with standard errors",
        family: Family::Contacts,
        parameter: None,
        build: |problem, _| Ok(Box::new(Compiled::new(problem)?)),
    },
    Row {
        method: Method::Nonlinear,
        name: "nonlinear",
        explanation: "for hands, rings and other shapes: an image with the full contact physics; slower",
        family: Family::Image,
        parameter: Some(ParameterKind::Nodes),
        build: |problem, parameter| {
            let settings = NonlinearSettings::default();
            let nodes = if let Some(Parameter::Nodes(nodes)) = parameter { nodes } else { settings.nodes };
            Ok(Box::new(Nonlinear::new(problem, NonlinearSettings { nodes, ..settings })?))
        },
    },
    Row {
        method: Method::Bsbl,
        name: "bsbl",
        explanation: "for several blunt contacts: an image of few patches, by sparse Bayesian learning; slow",
        family: Family::Image,
        parameter: None,
        build: |problem, _| Ok(Box::new(Bsbl::new(problem)?)),
    },
    Row {
        method: Method::Tikhonov,
        name: "tikhonov",
        explanation: "for a fast picture: linear image in a few microseconds, with a contact at each peak",
        family: Family::Linear,
        parameter: Some(ParameterKind::Lambda),
        build: |problem, parameter| {
            Ok(Box::new(Tikhonov::new(&problem.jacobian, lambda(parameter).unwrap_or_default(), Variant::Balanced)))
        },
    },
    Row {
        method: Method::Tv,
        name: "tv",
        explanation: "for objects with sharp edges: linear image by total variation; slow",
        family: Family::Image,
        parameter: None,
        build: |problem, _| Ok(Box::new(Tv::new(problem)?)),
    },
    Row {
        method: Method::Nonnegative,
        name: "nonnegative",
        explanation: "for a clean background: linear image in which no conductance is negative",
        family: Family::Image,
        parameter: None,
        build: |problem, _| Ok(Box::new(Nonnegative::new(&problem.jacobian, Nonnegative::SHARE))),
    },
    Row {
        method: Method::Laplace,
        name: "laplace",
        explanation: "for broad, gentle presses: linear image that is smooth",
        family: Family::Linear,
        parameter: Some(ParameterKind::Lambda),
        build: |problem, parameter| {
            Ok(Box::new(match lambda(parameter) {
                Some(lambda) => Tikhonov::laplace_with(&problem.jacobian, lambda)?,
                None => Tikhonov::laplace(&problem.jacobian)?,
            }))
        },
    },
    Row {
        method: Method::Noser,
        name: "noser",
        explanation: "for even sensitivity: linear image that makes up for places far from electrodes",
        family: Family::Linear,
        parameter: Some(ParameterKind::Lambda),
        build: |problem, parameter| {
            Ok(Box::new(Tikhonov::noser(&problem.jacobian, lambda(parameter).unwrap_or_default())))
        },
    },
    Row {
        method: Method::Tsvd,
        name: "tsvd",
        explanation: "for comparison: linear image from the largest singular values alone",
        family: Family::Linear,
        parameter: Some(ParameterKind::SingularShare),
        build: |problem, parameter| {
            let share =
                if let Some(Parameter::SingularShare(share)) = parameter { share } else { Tikhonov::SINGULAR_SHARE };
            Ok(Box::new(Tikhonov::truncated(&problem.jacobian, share)))
        },
    },
    Row {
        method: Method::Kernel,
        name: "kernel",
        explanation: "for sensors without a model: one contact, learned from presses at known places, or from simulated ones",
        family: Family::Learned,
        parameter: None,
        build: |problem, _| Ok(Box::new(KernelSolver::new(problem)?)),
    },
    Row {
        method: Method::Network,
        name: "network",
        explanation: "for detectors that nobody calibrated: image and contacts by a network, trained on simulated ones as built",
        family: Family::Learned,
        parameter: None,
        build: |problem, _| {
            let named = |error: NetworkError| ForwardError::Detector {
                detector: problem.detector().name.clone(),
                what: with_causes(&error),
            };
            let network = match problem.learned() {
                Some(Learned::Network(network)) => Ok(Arc::clone(network)),
                _ => Network::shipped().map(Arc::new),
            };
            let solver = network.and_then(|network| NetworkSolver::new(problem, network)).map_err(named)?;
            Ok(Box::new(solver))
        },
    },
    Row {
        method: Method::TikhonovPaper,
        name: "tikhonov-paper",
        explanation: "for comparison with the paper: its linear image, and one contact at the centroid",
        family: Family::Paper,
        parameter: Some(ParameterKind::Lambda),
        build: |problem, parameter| {
            Ok(Box::new(Tikhonov::new(&problem.jacobian, lambda(parameter).unwrap_or(Lambda::PAPER), Variant::Paper)))
        },
    },
];

fn lambda(parameter: Option<Parameter>) -> Option<Lambda> {
    if let Some(Parameter::Lambda(lambda)) = parameter { Some(lambda) } else { None }
}

impl Method {
    /// All of them, those that most people look for first.
    pub const ALL: [Self; TABLE.len()] = {
        let mut all = [Self::Auto; TABLE.len()];
        let mut row = 0;
        while row < TABLE.len() {
            all[row] = TABLE[row].method;
            assert!(all[row] as usize == row, "the table is in the order of the enum");
            row += 1;
        }
        all
    };

    fn row(self) -> &'static Row {
        const ROWS: &[Row] = &TABLE;
        &ROWS[self as usize]
    }

    /// Name on the command line.
    pub fn name(self) -> &'static str {
        self.row().name
    }

    /// What it is for, in a line.
    pub fn explanation(self) -> &'static str {
        self.row().explanation
    }

    /// What it is made of.
    pub fn family(self) -> Family {
        self.row().family
    }

    /// Its main parameter, if it has one.
    pub fn parameter(self) -> Option<ParameterKind> {
        self.row().parameter
    }

    /// Makes the solver for a problem, with its parameters as they are best for most.
    ///
    /// # Errors
    /// [`ForwardError`] if the model cannot give what the solver needs.
    pub fn build(self, problem: &Problem) -> Result<Box<dyn Solver>, ForwardError> {
        self.build_with(problem, None)
    }

    /// Makes the solver with a value of its main parameter; one that it does not have changes nothing. On a detector with a law of force, its
    /// contacts carry newtons; on one that known presses have corrected, they are where these say.
    ///
    /// # Errors
    /// [`ForwardError`] if the model cannot give what the solver needs.
    pub fn build_with(self, problem: &Problem, parameter: Option<Parameter>) -> Result<Box<dyn Solver>, ForwardError> {
        Ok(Box::new(self.staged(problem, parameter)?))
    }

    /// The method between the stages that it needs.
    pub(super) fn staged(
        self,
        problem: &Problem,
        parameter: Option<Parameter>,
    ) -> Result<Staged<dyn Solver>, ForwardError> {
        let solver = (self.row().build)(problem, parameter)?;
        // What was taught on the sensor itself says where and how hard by itself.
        if self == Self::Kernel && problem.is_learned(self) {
            return Ok(Staged::new(Stages::completing(problem), solver));
        }
        let stages = Stages::of(problem);
        // These take what each reading says into account by themselves.
        let stages = match self {
            Self::Auto | Self::Contacts | Self::Core | Self::Nonlinear => stages,
            _ => Stages { completed: Some(problem.clone()), ..stages },
        };
        Ok(Staged::new(stages, solver))
    }
}

impl Learned {
    /// The method that uses it.
    pub fn method(&self) -> Method {
        match self {
            Self::Kernel(_) => Method::Kernel,
            Self::Network(_) => Method::Network,
        }
    }
}

impl Problem {
    /// Whether a method takes what was learned on the sensor itself.
    pub fn is_learned(&self, method: Method) -> bool {
        self.learned().is_some_and(|learned| learned.method() == method)
    }
}

/// A name that no solver has.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("there is no solver `{0}`; choose one of {names}", names = Method::ALL.map(Method::name).join(", "))]
pub struct UnknownSolver(pub String);

impl std::str::FromStr for Method {
    type Err = UnknownSolver;

    fn from_str(name: &str) -> Result<Self, UnknownSolver> {
        Self::ALL.into_iter().find(|method| method.name() == name).ok_or_else(|| UnknownSolver(name.to_owned()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_people_look_for_comes_first() {
        assert_eq!(Method::ALL[..2], [Method::Auto, Method::Contacts]);
    }

    #[test]
    fn each_method_is_found_by_its_name_and_says_what_it_is_for() {
        for method in Method::ALL {
            assert_eq!(method.name().parse(), Ok(method));
            assert!(method.explanation().starts_with("for "), "{}", method.name());
            assert!(Family::ALL.contains(&method.family()));
        }
        let wrong = "jazz".parse::<Method>().map_err(|error| error.to_string());
        assert!(wrong.is_err_and(|error| error.starts_with("there is no solver `jazz`; choose one of auto, contacts")));
    }

    #[test]
    fn a_parameter_changes_the_solver_that_has_it_and_no_other() {
        use tactomo_physics::detector::Detector;
        use tactomo_physics::forward::shell::Shell;
        let shell = Shell::with_nodes(&Detector::default(), 300).unwrap_or_else(|error| panic!("{error}"));
        let problem = Problem::new(Box::new(shell) as Box<dyn tactomo_physics::forward::ForwardModel>);
        let readings = crate::solve::samples::readings(crate::solve::samples::CONTACT);
        let strong = Some(Parameter::Lambda(Lambda::Relative(3.0)));
        for method in [Method::Tikhonov, Method::TikhonovPaper, Method::Noser, Method::Laplace, Method::Tsvd] {
            let image = |parameter| {
                let mut solver = method.build_with(&problem, parameter).unwrap_or_else(|error| panic!("{error}"));
                solver.solve(&readings).map(|solution| solution.image_s_per_m2)
            };
            let changes = image(strong) != image(None);
            assert_eq!(changes, method.parameter() == Some(ParameterKind::Lambda), "{}", method.name());
        }
    }
}
