//! The foams of the paper's table I, and detectors made of them.

use std::str::FromStr;

use super::{Detector, Layer};

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
#[derive(Clone, Debug, PartialEq)]
pub struct Stack {
    name: String,
    /// Bottom first.
    foams: Vec<Foam>,
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
}

impl FromStr for Stack {
    type Err = String;

    fn from_str(name: &str) -> Result<Self, String> {
        let foams: Option<Vec<Foam>> = name.chars().rev().map(Foam::of).collect();
        foams
            .filter(|foams| (1..=MAX_LETTERS).contains(&foams.len()))
            .map(|foams| Self { name: name.to_owned(), foams })
            .ok_or_else(|| {
                format!("a foam A, B, C or D is needed, or up to {MAX_LETTERS} of them as in BA, the upper one first")
            })
    }
}

impl Detector {
    /// This detector in another material, with no law of force and no correction: those were another material's. A stack of as many foams as there are layers keeps each layer's thickness; on a
    /// single layer, each foam has that layer's thickness, as the paper's stacks do.
    ///
    /// # Errors
    /// What does not fit, if there are several layers but another number of foams.
    pub fn in_material(mut self, stack: &Stack) -> Result<Self, String> {
        let (layers, foams) = (self.layers.len(), stack.foams.len());
        if layers != 1 && layers != foams {
            return Err(format!(
                "material {} has {foams} foams, but {} has {layers} layers: as many foams are needed",
                stack.name, self.name
            ));
        }
        let thickness_m = |index: usize| self.layers[index.min(layers - 1)].thickness_m;
        let layer = |(index, foam): (usize, &Foam)| Layer::uniform(thickness_m(index), foam.conductivity_s_per_m);
        self.layers = stack.foams.iter().enumerate().map(layer).collect();
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
        assert!(detector.in_material(&"ABC".parse().unwrap()).is_err_and(|what| what.contains("has 2 layers")));
    }

    #[test]
    fn other_letters_are_refused() {
        for wrong in ["", "E", "a", "AE", "ABCDABCDA", "BB-5x5"] {
            assert!(wrong.parse::<Stack>().is_err_and(|what| what.contains("A, B, C or D")), "{wrong}");
        }
    }
}
