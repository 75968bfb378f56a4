//! Arguments that several commands share: detector, model, contacts.

use clap::ValueEnum;
use tactomo::detector::Detector;
use tactomo::forward::jacobian::Jacobian;
use tactomo::forward::shell::Shell;
use tactomo::forward::{ForwardError, ForwardModel};
use tactomo::scene::Contact;
use tactomo::solve::{Lambda, Solver, Tikhonov, Variant};

/// Which forward model.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Model {
    /// Thin shell of triangles: any outline, no thickness.
    Shell,
}

impl Model {
    /// Makes it for a detector; `nodes` of a shell's mesh, or the default.
    pub fn build(self, detector: &Detector, nodes: Option<usize>) -> Result<Box<dyn ForwardModel>, ForwardError> {
        let nodes = nodes.unwrap_or_else(|| Shell::default_nodes(detector));
        match self {
            Self::Shell => Ok(Box::new(Shell::with_nodes(detector, nodes)?)),
        }
    }
}

/// Which solver.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum SolverName {
    /// Linear image of the readings less the force; a contact at each of its peaks
    Tikhonov,
    /// Linear image and one contact at its centroid, as in the paper
    TikhonovPaper,
}

impl SolverName {
    /// Makes it for the detector of `jacobian`.
    pub fn build(self, jacobian: &Jacobian) -> Box<dyn Solver> {
        let variant = match self {
            Self::Tikhonov => Variant::Balanced,
            Self::TikhonovPaper => Variant::Paper,
        };
        Box::new(Tikhonov::new(jacobian, Lambda::default(), variant))
    }

    /// Its name on the command line.
    pub fn name(self) -> String {
        self.to_possible_value().map(|value| value.get_name().to_owned()).unwrap_or_default()
    }
}

/// A preset by its name.
pub fn preset(name: &str) -> Result<Detector, String> {
    let names = || Detector::preset_names().collect::<Vec<_>>().join(", ");
    Detector::preset(name).ok_or_else(|| format!("no such detector; there are {}", names()))
}

/// A contact from `x_mm,y_mm,radius_mm,conductance_s`.
pub fn contact(text: &str) -> Result<Contact, String> {
    let numbers: Vec<f64> = text
        .split(',')
        .map(|number| number.trim().parse().map_err(|_| format!("`{number}` is not a number")))
        .collect::<Result<_, _>>()?;
    let [x_mm, y_mm, radius_mm, conductance_s] = numbers[..] else {
        return Err(format!(
            "four numbers are needed, x_mm,y_mm,radius_mm,conductance_s, but there are {}",
            numbers.len()
        ));
    };
    Ok(Contact { x_m: x_mm * 1e-3, y_m: y_mm * 1e-3, radius_m: radius_mm * 1e-3, conductance_s })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn contacts_are_given_in_millimetres() {
        let contact = contact("3, -4.5,2,1e-3").unwrap_or_else(|error| panic!("{error}"));
        assert!((contact.x_m - 0.003).abs() < 1e-12 && (contact.y_m + 0.0045).abs() < 1e-12, "{contact:?}");
        assert!((contact.radius_m - 0.002).abs() < 1e-12 && contact.conductance_s == 1e-3, "{contact:?}");
    }

    #[test]
    fn wrong_contacts_and_detectors_say_what_is_allowed() {
        assert!(contact("1,2,3").is_err_and(|error| error.contains("x_mm,y_mm,radius_mm,conductance_s")));
        assert!(contact("1,2,3,much").is_err_and(|error| error.contains("`much` is not a number")));
        assert!(preset("round").is_err_and(|error| error.contains("square-60, square-50")));
    }
}
