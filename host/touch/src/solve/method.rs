//! The solvers by their names.

use super::{
    Auto, Bsbl, ContactSettings, Contacts, KernelSolver, Lambda, Nonlinear, NonlinearSettings, Nonnegative, Problem,
    Solver, Tikhonov, Tsvd, Tv, Variant,
};
use tactomo_physics::forward::ForwardError;

/// A solver, with its parameters as they are best for most.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Method {
    /// Linear image of the readings less the force; a contact at each of its peaks.
    Tikhonov,
    /// Linear image and one contact at its centroid, as in the paper.
    TikhonovPaper,
    /// A few contacts fitted to the full contact physics.
    Contacts,
    /// No more of these than the scene needs.
    Auto,
    /// Linear image from the first singular images alone.
    Tsvd,
    /// Linear image that makes up for sensitivity.
    Noser,
    /// Smooth linear image.
    Laplace,
    /// Linear image, never negative.
    Nonnegative,
    /// Linear image that keeps edges.
    Tv,
    /// Sparse image of few patches, from 16 looks.
    Bsbl,
    /// Image by the full contact physics.
    Nonlinear,
    /// Regression from presses at known places.
    Kernel,
}

impl Method {
    /// All of them.
    pub const ALL: [Self; 12] = [
        Self::Tikhonov,
        Self::TikhonovPaper,
        Self::Tsvd,
        Self::Noser,
        Self::Laplace,
        Self::Nonnegative,
        Self::Tv,
        Self::Bsbl,
        Self::Nonlinear,
        Self::Kernel,
        Self::Contacts,
        Self::Auto,
    ];

    /// Name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Tikhonov => "tikhonov",
            Self::TikhonovPaper => "tikhonov-paper",
            Self::Contacts => "contacts",
            Self::Auto => "auto",
            Self::Tsvd => "tsvd",
            Self::Noser => "noser",
            Self::Laplace => "laplace",
            Self::Nonnegative => "nonnegative",
            Self::Tv => "tv",
            Self::Bsbl => "bsbl",
            Self::Nonlinear => "nonlinear",
            Self::Kernel => "kernel",
        }
    }

    /// What it is, in a line.
    pub fn explanation(self) -> &'static str {
        match self {
            Self::Tikhonov => "linear image of the readings less the force; a contact at each of its peaks",
            Self::TikhonovPaper => "linear image and one contact at its centroid, as in the paper",
            Self::Contacts => "up to five contacts fitted to the full contact physics, as many as the readings ask for",
            Self::Auto => "nothing, contacts or an image: no more than the scene needs",
            Self::Tsvd => "linear image from the first singular images alone",
            Self::Noser => "linear image that makes up for places that readings hear less",
            Self::Laplace => "linear image with a prior of smoothness",
            Self::Nonnegative => "linear image in which no conductance is negative",
            Self::Tv => "linear image that keeps edges, by total variation",
            Self::Bsbl => "image of few patches that all 16 grounds agree on, by sparse Bayesian learning",
            Self::Nonlinear => "image of conductance by the full contact physics, never negative",
            Self::Kernel => {
                "one contact, by regression from presses at known places (simulated, unless real ones are told)"
            }
        }
    }

    /// Makes the solver for a problem.
    ///
    /// # Errors
    /// [`ForwardError`] if the model cannot give what the solver needs.
    pub fn build(self, problem: &Problem) -> Result<Box<dyn Solver>, ForwardError> {
        let jacobian = &problem.jacobian;
        Ok(match self {
            Self::Tikhonov => Box::new(Tikhonov::new(jacobian, Lambda::default(), Variant::Balanced)),
            Self::TikhonovPaper => Box::new(Tikhonov::new(jacobian, Lambda::default(), Variant::Paper)),
            Self::Contacts => Box::new(Contacts::new(problem, ContactSettings::of(problem))?),
            Self::Auto => Box::new(Auto::new(problem)?),
            Self::Tsvd => Box::new(Tsvd::new(jacobian, Tsvd::SHARE)),
            Self::Noser => Box::new(Tikhonov::noser(jacobian, Lambda::default())),
            Self::Laplace => Box::new(Tikhonov::laplace(jacobian)?),
            Self::Nonnegative => Box::new(Nonnegative::new(jacobian, Nonnegative::SHARE)),
            Self::Tv => Box::new(Tv::new(problem)?),
            Self::Bsbl => Box::new(Bsbl::new(problem)?),
            Self::Nonlinear => Box::new(Nonlinear::new(problem, NonlinearSettings::default())?),
            Self::Kernel => Box::new(KernelSolver::new(problem)?),
        })
    }
}

impl std::str::FromStr for Method {
    type Err = String;

    fn from_str(name: &str) -> Result<Self, String> {
        let known = || Self::ALL.map(Self::name).join(", ");
        Self::ALL
            .into_iter()
            .find(|method| method.name() == name)
            .ok_or_else(|| format!("no such solver; there are {}", known()))
    }
}
