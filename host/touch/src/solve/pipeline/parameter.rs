//! Main parameters of solvers.

use std::fmt;

use crate::solve::fit::lambda::Lambda;

/// A value of a solver's main parameter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Parameter {
    /// Regularisation: how strongly an image is held down.
    Lambda(Lambda),
    /// Singular values below this share of the largest are left out.
    SingularShare(f64),
    /// Most contacts that are fitted.
    MaxContacts(usize),
    /// Nodes of the image that is fitted.
    Nodes(usize),
}

/// Which main parameter a solver has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ParameterKind {
    /// [`Parameter::Lambda`].
    Lambda,
    /// [`Parameter::SingularShare`].
    SingularShare,
    /// [`Parameter::MaxContacts`].
    MaxContacts,
    /// [`Parameter::Nodes`].
    Nodes,
}

impl Parameter {
    /// Which it is.
    pub fn kind(&self) -> ParameterKind {
        match self {
            Self::Lambda(_) => ParameterKind::Lambda,
            Self::SingularShare(_) => ParameterKind::SingularShare,
            Self::MaxContacts(_) => ParameterKind::MaxContacts,
            Self::Nodes(_) => ParameterKind::Nodes,
        }
    }
}

impl fmt::Display for Parameter {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Lambda(Lambda::Relative(share)) => write!(formatter, "lambda {share}"),
            Self::Lambda(Lambda::Absolute(lambda)) => write!(formatter, "lambda {lambda} absolute"),
            Self::Lambda(Lambda::Paper(squared)) => write!(formatter, "lambda^2 {squared} of the paper"),
            Self::Lambda(Lambda::Discrepancy(_)) => write!(formatter, "lambda by discrepancy"),
            Self::Lambda(Lambda::LCurve) => write!(formatter, "lambda by L-curve"),
            Self::Lambda(Lambda::Gcv) => write!(formatter, "lambda by GCV"),
            Self::SingularShare(share) => write!(formatter, "share {share}"),
            Self::MaxContacts(most) => write!(formatter, "at most {most}"),
            Self::Nodes(nodes) => write!(formatter, "{nodes} nodes"),
        }
    }
}
