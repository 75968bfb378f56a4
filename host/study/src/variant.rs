//! The solvers that studies try, with their main parameters.

use std::fmt;

use tactomo_physics::forward::ForwardError;
use tactomo_touch::solve::{
    ContactSettings, Contacts, Lambda, Method, Nonlinear, NonlinearSettings, Problem, Solver, Tikhonov, Tsvd, Variant,
};

/// Shares of the largest singular value that are tried in place of the default, for lambda or where singular values are left out.
const SHARES: [f64; 5] = [1e-3, 0.01, 0.1, 0.3, 1.0];
/// Ways to choose lambda from the readings.
const RULES: [Setting; 3] =
    [Setting::Lambda(Lambda::Discrepancy(1.0)), Setting::Lambda(Lambda::LCurve), Setting::Lambda(Lambda::Gcv)];
/// Most contacts that are tried in place of the default.
const MOST: [usize; 3] = [1, 2, 3];

/// Nodes of a nonlinear image that are tried in place of the default.
const NODES: [usize; 2] = [100, 225];

/// What a solver is made of, for charts.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Family {
    /// The paper's own.
    Paper,
    /// Linear images.
    Linear,
    /// Images of the full contact physics or under a constraint.
    Image,
    /// A few contacts.
    Contacts,
    /// Learned from presses.
    Learned,
    /// The one that chooses.
    Auto,
}

impl Family {
    /// Its class in the style sheet of pages.
    pub fn class(self) -> &'static str {
        match self {
            Self::Paper => "paper",
            Self::Linear => "linear",
            Self::Image => "image",
            Self::Contacts => "contacts",
            Self::Learned => "learned",
            Self::Auto => "auto",
        }
    }
}

/// What family a method is of.
pub fn family(method: Method) -> Family {
    match method.name() {
        "tikhonov-paper" => Family::Paper,
        "tikhonov" | "tsvd" | "noser" | "laplace" => Family::Linear,
        "contacts" => Family::Contacts,
        "kernel" => Family::Learned,
        "auto" => Family::Auto,
        _ => Family::Image,
    }
}

/// A solver with a value of its main parameter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Variation {
    /// The solver.
    pub method: Method,
    /// Its main parameter, where that is not the default.
    pub setting: Option<Setting>,
}

/// A value of the main parameter of a solver.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Setting {
    /// How strongly an image is held down.
    Lambda(Lambda),
    /// Singular values below this share of the largest are left out.
    Share(f64),
    /// Most contacts.
    Most(usize),
    /// Nodes of the image that is fitted.
    Nodes(usize),
}

impl fmt::Display for Setting {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Lambda(Lambda::Relative(share)) => write!(formatter, "lambda {share}"),
            Self::Lambda(Lambda::Absolute(lambda)) => write!(formatter, "lambda {lambda} absolute"),
            Self::Lambda(Lambda::Paper(squared)) => write!(formatter, "lambda^2 {squared} of the paper"),
            Self::Lambda(Lambda::Discrepancy(_)) => write!(formatter, "lambda by discrepancy"),
            Self::Lambda(Lambda::LCurve) => write!(formatter, "lambda by L-curve"),
            Self::Lambda(Lambda::Gcv) => write!(formatter, "lambda by GCV"),
            Self::Share(share) => write!(formatter, "share {share}"),
            Self::Most(most) => write!(formatter, "at most {most}"),
            Self::Nodes(nodes) => write!(formatter, "{nodes} nodes"),
        }
    }
}

impl Variation {
    /// A solver as it is best for most.
    pub fn default_of(method: Method) -> Self {
        Self { method, setting: None }
    }

    /// A solver as it is best for most, and with its main parameter at other values, if it has one.
    pub fn sweep(method: Method) -> Vec<Self> {
        let settings: Vec<Setting> = match method {
            Method::Tikhonov => lambdas(&SHARES).chain(RULES).collect(),
            _ if Self::has_lambda(method) => lambdas(&SHARES).collect(),
            Method::Tsvd => SHARES[..4].iter().map(|share| Setting::Share(*share)).collect(),
            Method::Nonlinear => NODES.map(Setting::Nodes).to_vec(),
            Method::Contacts => MOST.map(Setting::Most).to_vec(),
            _ => Vec::new(),
        };
        let with = |setting| Self { method, setting: Some(setting) };
        std::iter::once(Self::default_of(method)).chain(settings.into_iter().map(with)).collect()
    }

    /// Whether a solver has a lambda.
    pub fn has_lambda(method: Method) -> bool {
        matches!(method, Method::Tikhonov | Method::TikhonovPaper | Method::Noser | Method::Laplace)
    }

    /// A solver with lambda at a share of the largest singular value.
    pub fn with_lambda(method: Method, share: f64) -> Self {
        Self { method, setting: Some(Setting::Lambda(Lambda::Relative(share))) }
    }

    /// Makes the solver; a setting that it does not have is left out.
    ///
    /// # Errors
    /// [`ForwardError`] if the model cannot give what the solver needs.
    pub fn build(&self, problem: &Problem) -> Result<Box<dyn Solver>, ForwardError> {
        let jacobian = &problem.jacobian;
        Ok(match (self.method, self.setting) {
            (Method::Tikhonov, Some(Setting::Lambda(lambda))) => {
                Box::new(Tikhonov::new(jacobian, lambda, Variant::Balanced))
            }
            (Method::TikhonovPaper, Some(Setting::Lambda(lambda))) => {
                Box::new(Tikhonov::new(jacobian, lambda, Variant::Paper))
            }
            (Method::Noser, Some(Setting::Lambda(lambda))) => Box::new(Tikhonov::noser(jacobian, lambda)),
            (Method::Laplace, Some(Setting::Lambda(lambda))) => Box::new(Tikhonov::laplace_with(jacobian, lambda)?),
            (Method::Tsvd, Some(Setting::Share(share))) => Box::new(Tsvd::new(jacobian, share)),
            (Method::Contacts, Some(Setting::Most(most))) => {
                Box::new(Contacts::new(problem, ContactSettings { most, ..ContactSettings::of(problem) })?)
            }
            (Method::Nonlinear, Some(Setting::Nodes(nodes))) => {
                Box::new(Nonlinear::new(problem, NonlinearSettings { nodes, ..NonlinearSettings::default() })?)
            }
            _ => self.method.build(problem)?,
        })
    }

    /// Name for people: that of the solver, and of the setting if it is not the default.
    pub fn label(&self) -> String {
        match self.setting {
            Some(setting) => format!("{} {setting}", self.method.name()),
            None => self.method.name().to_owned(),
        }
    }
}

fn lambdas(shares: &[f64]) -> impl Iterator<Item = Setting> {
    shares.iter().map(|share| Setting::Lambda(Lambda::Relative(*share)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Laboratory, SceneKind};
    use tactomo_physics::detector::Detector;
    use tactomo_physics::readings::Readings;

    #[test]
    fn a_setting_changes_what_is_found_and_has_a_name_of_its_own() {
        let laboratory = Laboratory::new(&Detector::preset(Detector::DEFAULT).unwrap()).unwrap();
        let touches = SceneKind::Three.frames(&laboratory.detector, 1, 1);
        let readings: Readings = laboratory.frames(&touches, 1).unwrap().remove(0).readings;
        for method in Method::ALL {
            let sweep = Variation::sweep(method);
            let solve = |variation: &Variation| variation.build(&laboratory.problem).unwrap().solve(&readings).unwrap();
            let default = solve(&sweep[0]);
            for variation in &sweep[1..] {
                let label = variation.label();
                assert_eq!(sweep.iter().filter(|other| other.label() == label).count(), 1, "{label}");
                let changes = !matches!(variation.setting, Some(Setting::Most(3)));
                assert!(solve(variation) != default || !changes, "{label}");
            }
        }
    }
}
