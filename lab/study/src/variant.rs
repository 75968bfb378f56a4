//! The solvers that studies try, with values of their main parameters.

use super::score::OF_CONTACT;
use tactomo_physics::forward::ForwardError;
use tactomo_touch::solve::{
    ContactSettings, Lambda, Method, NonlinearSettings, Parameter, ParameterKind, Problem, Solver,
};

/// Shares of the largest singular value that are tried in place of the default, for lambda or where singular values are left out:
/// from where noise shows in images to where they are flat.
const SHARES: [f64; 5] = [1e-3, 0.01, 0.1, 0.3, 1.0];
/// Ways to choose lambda from the readings.
const RULES: [Lambda; 3] = [Lambda::Discrepancy(1.0), Lambda::LCurve, Lambda::Gcv];
/// Most contacts that are tried in place of the default.
const MAX_CONTACTS: [usize; 3] = [1, 2, 3];
/// Nodes of a nonlinear image that are tried in place of the default: 5 x 5, 10 x 10 and 15 x 15 on a square. 30 x 30 take half a second a
/// frame.
const NODES: [usize; 3] = [25, 100, 225];

/// A solver with a value of its main parameter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Variation {
    /// The solver.
    pub method: Method,
    /// Its main parameter, where that is not the default.
    pub parameter: Option<Parameter>,
}

impl Variation {
    /// A solver with its default parameter.
    pub fn default_of(method: Method) -> Self {
        Self { method, parameter: None }
    }

    /// A solver with its default parameter, and with other values of it if it has one.
    pub fn sweep(method: Method) -> Vec<Self> {
        let shares = || SHARES.map(|share| Parameter::Lambda(Lambda::Relative(share)));
        let parameters: Vec<Parameter> = match method.parameter() {
            None => Vec::new(),
            // One linear image is enough to compare the rules on.
            Some(ParameterKind::Lambda) if method == Method::Tikhonov => {
                shares().into_iter().chain(RULES.map(Parameter::Lambda)).collect()
            }
            Some(ParameterKind::Lambda) => shares().to_vec(),
            Some(ParameterKind::SingularShare) => SHARES[..4].iter().copied().map(Parameter::SingularShare).collect(),
            Some(ParameterKind::MaxContacts) => MAX_CONTACTS.map(Parameter::MaxContacts).to_vec(),
            Some(ParameterKind::Nodes) => NODES.map(Parameter::Nodes).to_vec(),
        };
        let with = |parameter| Self { method, parameter: Some(parameter) };
        std::iter::once(Self::default_of(method)).chain(parameters.into_iter().map(with)).collect()
    }

    /// A solver with lambda at a share of the largest singular value.
    pub fn with_lambda(method: Method, share: f64) -> Self {
        Self { method, parameter: Some(Parameter::Lambda(Lambda::Relative(share))) }
    }

    /// Makes the solver; a parameter that it does not have is left out.
    ///
    /// # Errors
    /// [`ForwardError`] if the model cannot give what the solver needs.
    pub fn build(&self, problem: &Problem) -> Result<Box<dyn Solver>, ForwardError> {
        self.method.build_with(problem, self.parameter)
    }

    /// The most unknowns that its model has, where that is its main parameter, and of a linear image: its nodes.
    pub fn unknowns(&self, problem: &Problem) -> Option<usize> {
        match (self.method.parameter()?, self.parameter) {
            (ParameterKind::MaxContacts, Some(Parameter::MaxContacts(most))) => Some(OF_CONTACT * most),
            (ParameterKind::MaxContacts, _) => Some(OF_CONTACT * ContactSettings::of(problem).most),
            (ParameterKind::Nodes, Some(Parameter::Nodes(nodes))) => Some(nodes),
            (ParameterKind::Nodes, _) => Some(NonlinearSettings::default().nodes),
            _ => (*self == Self::default_of(Method::Tikhonov)).then(|| problem.jacobian.image_mesh.nodes_m.len()),
        }
    }

    /// Name for people: that of the solver, and its parameter if that is not the default.
    pub fn label(&self) -> String {
        match self.parameter {
            Some(parameter) => format!("{} {parameter}", self.method.name()),
            None => self.method.name().to_owned(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Experiment, SceneKind};
    use tactomo_physics::detector::Detector;
    use tactomo_physics::readings::Readings;

    #[test]
    fn a_parameter_changes_what_is_found_and_has_a_name_of_its_own() {
        let experiment = Experiment::new(&Detector::preset(Detector::DEFAULT).unwrap()).unwrap();
        let touches = SceneKind::Three.frames(&experiment.detector, 1, 1);
        let readings: Readings = experiment.frames(&touches, 1).unwrap().remove(0).readings;
        for method in Method::ALL {
            let sweep = Variation::sweep(method);
            let solve = |variation: &Variation| variation.build(&experiment.problem).unwrap().solve(&readings).unwrap();
            let default = solve(&sweep[0]);
            for variation in &sweep[1..] {
                let label = variation.label();
                assert_eq!(sweep.iter().filter(|other| other.label() == label).count(), 1, "{label}");
                let changes = !matches!(variation.parameter, Some(Parameter::MaxContacts(3)));
                assert!(solve(variation) != default || !changes, "{label}");
            }
        }
    }
}
