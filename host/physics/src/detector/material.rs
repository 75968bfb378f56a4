//! The foams of the paper's table I, and detectors made of them.

use std::str::FromStr;

use super::bond::DOT_DIAMETER_M;
use super::check::Problem;
use super::{Bond, Detector, Layer};
use crate::hertz::Skin;

/// Letters that a stack may have.
const MAX_LETTERS: usize = 8;

/// A conductive foam.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Foam {
    /// Its letter in the paper.
    pub letter: char,
    /// What it is sold as.
    pub product: &'static str,
    /// Conductivity (S/m).
    pub conductivity_s_per_m: f64,
    /// Elasticity (Pa).
    pub elasticity_pa: f64,
}

/// Table I of the paper.
pub const FOAMS: [Foam; 4] = [
    Foam { letter: 'A', product: "INOAC C-4255E", conductivity_s_per_m: 0.2273, elasticity_pa: 0.35e6 },
    Foam { letter: 'B', product: "INOAC E4385", conductivity_s_per_m: 0.5208, elasticity_pa: 0.96e6 },
    Foam { letter: 'C', product: "SANWA SUPPLY TK-P2N2", conductivity_s_per_m: 0.001667, elasticity_pa: 1.51e6 },
    Foam { letter: 'D', product: "HOZAN F-10", conductivity_s_per_m: 0.008, elasticity_pa: 2.23e6 },
];

/// A foam or a stack of foams; the first letter is the upper layer, as in the paper.
///
/// ```
/// use tactomo_physics::detector::Detector;
///
/// let detector = Detector::default().in_material(&"BC".parse()?)?;
/// assert_eq!(detector.layers.len(), 2);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Stack {
    name: String,
    /// Bottom first.
    foams: Vec<Foam>,
    /// What joins the two, if they do not touch all over.
    bond: Option<Bond>,
}

impl Foam {
    /// The foam of a letter.
    pub fn of(letter: char) -> Option<Self> {
        FOAMS.into_iter().find(|foam| foam.letter == letter)
    }
}

impl Stack {
    /// Its foams, bottom first.
    pub fn foams(&self) -> &[Foam] {
        &self.foams
    }

    /// The foam that is touched.
    pub fn top(&self) -> Foam {
        self.foams[self.foams.len() - 1]
    }
}

/// Why a text is no [`Stack`].
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum StackError {
    /// These are no letters of foams, or too many.
    #[error(
        "`{0}`: a foam A, B, C or D is needed, or up to {MAX_LETTERS} of them as in BA, the upper one first, or two that are joined by dots \
         of glue as in BB-5x5"
    )]
    Foams(String),
    /// What follows the letters is no grid of dots between two foams.
    #[error("`-{0}` has to follow two foams and be columns and rows of dots, as in BB-5x5")]
    Dots(String),
}

/// Why a detector cannot be of a [`Stack`].
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum MaterialError {
    /// Another number of foams than of layers.
    #[error("material {stack} has {foams} foams, but {detector} has {layers} layers: as many foams are needed")]
    Layers {
        /// Name of the stack.
        stack: String,
        /// How many it has.
        foams: usize,
        /// Name of the detector.
        detector: String,
        /// How many it has.
        layers: usize,
    },
    /// Its dots do not fit on the detector.
    #[error("material {stack} on {detector}: {problem}")]
    Bond {
        /// Name of the stack.
        stack: String,
        /// Name of the detector.
        detector: String,
        /// What does not fit.
        problem: Problem,
    },
}

impl FromStr for Stack {
    type Err = StackError;

    fn from_str(name: &str) -> Result<Self, StackError> {
        let (letters, dots) = match name.split_once('-') {
            Some((letters, dots)) => (letters, Some(dots)),
            None => (name, None),
        };
        let foams: Option<Vec<Foam>> = letters.chars().rev().map(Foam::of).collect();
        let foams = foams.filter(|foams| (1..=MAX_LETTERS).contains(&foams.len()));
        let foams = foams.ok_or_else(|| StackError::Foams(name.to_owned()))?;
        let bond = dots.map(|dots| bond(dots, foams.len())).transpose()?;
        Ok(Self { name: name.to_owned(), foams, bond })
    }
}

/// The paper's dots in columns and rows as in `5x5`.
fn bond(dots: &str, foams: usize) -> Result<Bond, StackError> {
    let grid = dots.split_once('x').and_then(|(columns, rows)| Some([columns.parse().ok()?, rows.parse().ok()?]));
    let grid = grid.filter(|_| foams == 2);
    grid.map(|grid| Bond::of_dots(grid, DOT_DIAMETER_M)).ok_or_else(|| StackError::Dots(dots.to_owned()))
}

impl Detector {
    /// This detector in another material, with that one's skin and with no law of force and no correction: those were another material's. A stack of as many foams as there are layers keeps each layer's thickness; on a
    /// single layer, each foam has that layer's thickness, as the paper's stacks do. Layers that are joined by dots stay so, unless the stack has
    /// dots of its own.
    ///
    /// # Errors
    /// [`MaterialError`] if there are several layers but another number of foams, or dots that have no room.
    pub fn in_material(mut self, stack: &Stack) -> Result<Self, MaterialError> {
        let (layers, foams) = (self.layers.len(), stack.foams.len());
        if layers != 1 && layers != foams {
            return Err(MaterialError::Layers { stack: stack.name.clone(), foams, detector: self.name, layers });
        }
        let thickness_m = |index: usize| self.layers[index.min(layers - 1)].thickness_m;
        let own_bond = |index: usize| self.layers.get(index).and_then(|layer| layer.bond);
        let layer = |(index, foam): (usize, &Foam)| Layer {
            bond: stack.bond.filter(|_| index == 1).or(own_bond(index)),
            ..Layer::uniform(thickness_m(index), foam.conductivity_s_per_m)
        };
        self.layers = stack.foams.iter().enumerate().map(layer).collect();
        let (name, detector) = (&stack.name, &self.name);
        let soft = self.layers.iter().zip(&stack.foams).map(|(layer, foam)| (layer.thickness_m, foam.elasticity_pa));
        self.skin = Some(Skin::of_layers(soft));
        let named = |problem| MaterialError::Bond { stack: name.clone(), detector: detector.clone(), problem };
        self.check_bond().map_err(named)?;
        self.name = format!("{} in {}", self.name, stack.name);
        (self.force, self.correction) = (None, None);
        Ok(self)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn in_material(name: &str) -> Detector {
        Detector::preset(Detector::DEFAULT).unwrap().in_material(&name.parse().unwrap()).unwrap()
    }

    #[test]
    fn the_first_letter_is_the_upper_layer() {
        let detector = in_material("BC");
        assert_eq!(detector.layers, [Layer::uniform(0.005, 0.001667), Layer::uniform(0.005, 0.5208)]);
        assert_eq!(detector.name, "square-60 in BC");
        assert_eq!(in_material("A").layers, Detector::preset(Detector::DEFAULT).unwrap().layers);
    }

    #[test]
    fn as_many_foams_as_layers_keep_their_thickness() {
        let mut detector = in_material("BA");
        detector.layers[1].thickness_m = 0.001;
        let detector = detector.in_material(&"DC".parse().unwrap()).unwrap();
        assert_eq!(detector.layers, [Layer::uniform(0.005, 0.001667), Layer::uniform(0.001, 0.008)]);
        let error = detector.in_material(&"ABC".parse().unwrap());
        assert!(matches!(error, Err(MaterialError::Layers { foams: 3, layers: 2, .. })), "{error:?}");
    }

    #[test]
    fn other_letters_are_refused() {
        for wrong in ["", "E", "a", "AE", "ABCDABCDA", "-5x5"] {
            assert!(wrong.parse::<Stack>().is_err_and(|error| error.to_string().contains("A, B, C or D")), "{wrong}");
        }
        for wrong in ["BB-", "BB-5", "BB-5x", "BB-5x-5", "B-5x5", "BBB-5x5"] {
            assert!(wrong.parse::<Stack>().is_err_and(|error| error.to_string().contains("as in BB-5x5")), "{wrong}");
        }
    }

    #[test]
    fn two_letters_may_be_joined_by_dots() {
        let detector = in_material("AD-7x6");
        assert_eq!(detector.layers[0], Layer::uniform(0.005, 0.008));
        assert_eq!(detector.bond(), Some((1, Bond::of_dots([7, 6], 0.00722))));
        let other = detector.in_material(&"BC".parse().unwrap()).unwrap();
        assert_eq!(other.bond(), Some((1, Bond::of_dots([7, 6], 0.00722))), "another foam, the same glue");
        let small = Detector::preset("fingertip-10").unwrap().in_material(&"BB-5x5".parse().unwrap());
        assert!(small.is_err_and(|error| error.to_string().contains("makes the dots overlap")));
    }
}
