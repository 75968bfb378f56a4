//! Arguments that several commands share: detector, model, contacts.

use std::path::Path;

use anyhow::Context;
use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use tactomo_board::record::{Header, RecordError, RecordReader};
use tactomo_board::simulated::BoardModel;
use tactomo_physics::detector::{Chosen, Detector, Stack};
use tactomo_physics::forward::shell::Shell;
use tactomo_physics::forward::{Auto, DrivingLayer, ForwardError, ForwardModel, Resolution, Slab};
use tactomo_physics::scene::{Contact, Touch};
use tactomo_touch::solve::Method;

use crate::output::message;

/// Which forward model.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Model {
    /// Chooses shell or slab by the detector, and prints why.
    Auto,
    /// Thin shell of triangles: any outline or curved surface; for thin layers.
    Shell,
    /// Layers in three dimensions: rectangles only.
    Slab,
}

impl Model {
    /// Makes it for a detector; `nodes` of a shell's mesh, or the default.
    pub fn build(self, detector: &Detector, nodes: Option<usize>) -> Result<Box<dyn ForwardModel>, ForwardError> {
        self.build_under(detector, nodes, DrivingLayer::default())
    }

    /// The same with a driving layer that need not be ideal.
    pub fn build_under(
        self,
        detector: &Detector,
        nodes: Option<usize>,
        driving: DrivingLayer,
    ) -> Result<Box<dyn ForwardModel>, ForwardError> {
        match self {
            Self::Auto => {
                let Auto { model, reason } = Auto::under(detector, nodes, driving)?;
                message!("model of {}: {}, since {reason}", detector.name, model.name());
                Ok(model)
            }
            Self::Shell => {
                let nodes = nodes.unwrap_or_else(|| Shell::default_nodes(detector));
                Ok(Box::new(Shell::with_nodes(detector, nodes)?.under(driving)?))
            }
            Self::Slab => Ok(Box::new(Slab::under(detector, Resolution::STANDARD, driving)?)),
        }
    }
}

/// Which detector.
#[derive(Clone, Debug, clap::Args)]
#[command(next_help_heading = "Detector")]
pub struct DetectorArgs {
    /// Detector: name of a preset, or a TOML file; unless given, that of the recording that is read, or square-60
    #[arg(long, value_name = "NAME|FILE")]
    pub detector: Option<Chosen>,
    /// Foam of the detector, A to D, or a stack of foams with the upper one first, such as BC or, joined by dots of glue, BB-5x5
    #[arg(long, value_name = "A..D|STACK")]
    pub material: Option<Stack>,
}

/// The detectors that were chosen, or the presets of such names.
pub fn detectors(chosen: &[Chosen], otherwise: &[&str]) -> anyhow::Result<Vec<Detector>> {
    match chosen {
        [] => Ok(otherwise.iter().filter_map(|name| Detector::preset(name)).collect()),
        _ => chosen.iter().map(|chosen| Ok(chosen.get()?)).collect(),
    }
}

/// Parses the name of a solver; `--help` lists all of them with what they are for.
pub fn method() -> impl TypedValueParser<Value = Method> {
    let values = Method::ALL.map(|method| PossibleValue::new(method.name()).help(method.explanation()));
    PossibleValuesParser::new(values).try_map(|name| name.parse::<Method>())
}

impl DetectorArgs {
    /// The detector, or the default one, in the material that is asked for.
    pub fn get(&self) -> anyhow::Result<Detector> {
        self.get_or(Detector::DEFAULT)
    }

    /// The detector, or the preset `otherwise`, in the material that is asked for.
    pub fn get_or(&self, otherwise: &str) -> anyhow::Result<Detector> {
        let detector = match &self.detector {
            Some(chosen) => chosen.get()?,
            None => Detector::preset(otherwise).with_context(|| format!("{otherwise} is no preset"))?,
        };
        self.in_material(detector)
    }

    /// The detector for the recording `path` with such a header: its own, unless another one or another material is given. A line on stderr
    /// says where what is used is not what the recording says.
    pub fn of_recording(&self, path: &Path, header: &Header) -> anyhow::Result<Detector> {
        if self.detector.is_none() {
            let recorded = self.in_material(recorded(path, header)?)?;
            if !header.is_of(&recorded) && self.material.is_some() {
                message!(
                    "{} was recorded on a detector of another material; it is read as of the one that --material gives",
                    path.display()
                );
            }
            return Ok(recorded);
        }
        let detector = self.get()?;
        if !header.detector.is_empty() && !header.is_of(&detector) {
            let (path, was) = (path.display(), &header.detector);
            match *was == detector.name {
                true => {
                    message!("{path} was recorded on another {was} than the one that --detector gives, which is used")
                }
                false => message!("{path} was recorded on {was}; it is read as {}, as --detector asks", detector.name),
            }
        }
        Ok(detector)
    }

    fn in_material(&self, detector: Detector) -> anyhow::Result<Detector> {
        match &self.material {
            Some(stack) => Ok(detector.in_material(stack)?),
            None => Ok(detector),
        }
    }
}

/// The detector that a recording was taken from; the default one where its header is lost.
fn recorded(path: &Path, header: &Header) -> anyhow::Result<Detector> {
    let open = |source| RecordError::Open { path: path.to_owned(), source };
    if let Some(found) = RecordReader::open(path)?.detector_found().map_err(open)?
        && let Some(detector) = found.detector(path)?
    {
        message!("{}: its detector was calibrated while it was recorded, and is read so", path.display());
        return Ok(detector);
    }
    if let Some(detector) = header.detector(path)? {
        return Ok(detector);
    }
    message!(
        "{}: its header is lost or does not hold the detector, so it is read as {}; --detector chooses another one",
        path.display(),
        Detector::DEFAULT
    );
    Detector::preset(Detector::DEFAULT).context("the default detector is no preset")
}

/// A contact from `x_mm,y_mm,radius_mm,conductance_s`, with `z_mm` after `y_mm` on a curved detector.
pub fn contact(text: &str) -> Result<Contact, String> {
    let ([x_m, y_m, z_m], [radius_mm, conductance_s]) = place_and(text, "radius_mm,conductance_s")?;
    let contact = Contact { z_m, ..Contact::flat(x_m, y_m, radius_mm * 1e-3, conductance_s) };
    Touch::from(contact).check().map_err(|error| error.to_string())?;
    Ok(contact)
}

/// A place (m) from `x_mm,y_mm`, or from `x_mm,y_mm,z_mm` on a curved detector, and two numbers more that have such names.
pub fn place_and(text: &str, names: &str) -> Result<([f64; 3], [f64; 2]), String> {
    let numbers: Vec<f64> = text
        .split(',')
        .map(|number| number.trim().parse().map_err(|_| format!("`{number}` is not a number")))
        .collect::<Result<_, _>>()?;
    let (place_mm, others) = match numbers[..] {
        [x_mm, y_mm, a, b] => ([x_mm, y_mm, 0.0], [a, b]),
        [x_mm, y_mm, z_mm, a, b] => ([x_mm, y_mm, z_mm], [a, b]),
        _ => {
            return Err(format!(
                "four numbers are needed, x_mm,y_mm,{names}, or five with z_mm after y_mm on a curved detector, but there \
                 are {}",
                numbers.len()
            ));
        }
    };
    Ok((place_mm.map(|mm| mm * 1e-3), others))
}

/// Parses the name of a simulated board.
pub fn board_model() -> impl TypedValueParser<Value = BoardModel> {
    let values = BoardModel::ALL.map(|model| PossibleValue::new(model.name()).help(model.explanation()));
    PossibleValuesParser::new(values).try_map(|name| name.parse::<BoardModel>())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn contacts_are_given_in_millimetres() {
        let contact = contact("3, -4.5,2,1e-3").unwrap_or_else(|error| panic!("{error}"));
        let above = super::contact("3,-4.5,12,2,1e-3").unwrap_or_else(|error| panic!("{error}"));
        assert_eq!((above.x_m, above.z_m, above.radius_m), (contact.x_m, 0.012, contact.radius_m));
        assert!((contact.x_m - 0.003).abs() < 1e-12 && (contact.y_m + 0.0045).abs() < 1e-12, "{contact:?}");
        assert!((contact.radius_m - 0.002).abs() < 1e-12 && contact.conductance_s == 1e-3, "{contact:?}");
    }

    #[test]
    fn wrong_contacts_say_what_is_allowed() {
        assert!(contact("1,2,3").is_err_and(|error| error.contains("x_mm,y_mm,radius_mm,conductance_s")));
        assert!(contact("1,2,3,much").is_err_and(|error| error.contains("`much` is not a number")));
        assert!(contact("1,1,1,1e308").is_err_and(|error| error.starts_with("conductance_s is 1e308")));
    }
}
