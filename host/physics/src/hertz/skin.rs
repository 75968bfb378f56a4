//! How soft a detector is, and what its surface conducts.

use std::ops::RangeInclusive;

use super::Surface;
use crate::detector::{Foam, Problem, Stack, within};

/// Poisson's ratio where none is given: open-cell foams are near 1/3. The paper gives none.
pub const POISSON: f64 = 0.3;

/// Young's moduli (Pa): from a jelly's to a diamond's.
pub const YOUNG_PA: RangeInclusive<f64> = 1e2..=1e12;
/// Poisson's ratios: of stable solids above -1.
pub const RATIO: RangeInclusive<f64> = -0.99..=0.5;
const UNIT_PA: RangeInclusive<f64> = 1.0..=1e12;
const DEPTH_M: RangeInclusive<f64> = 1e-9..=1.0;

/// What a detector's layers are to the touch: all of them together, and the surface that is touched.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Skin {
    /// Young's modulus of all layers together (Pa).
    pub young_pa: f64,
    /// Poisson's ratio, above -1 to 0.5.
    pub poisson: f64,
    /// What its surface conducts.
    pub surface: Surface,
}

impl Skin {
    /// A skin of one Young's modulus (Pa).
    pub fn of(young_pa: f64) -> Self {
        Self { young_pa, poisson: POISSON, surface: Surface::measured(young_pa) }
    }

    /// A skin of layers of such thicknesses (any unit) and Young's moduli (Pa), bottom first: they give way one after the other, so that their
    /// compliances add up. The surface is the top's.
    pub fn of_layers(layers: impl IntoIterator<Item = (f64, f64)>) -> Self {
        let add = |[thickness, compliance, _]: [f64; 3], (own, young_pa): (f64, f64)| {
            [thickness + own, compliance + own / young_pa, young_pa]
        };
        let [thickness, compliance, top_pa] = layers.into_iter().fold([0.0; 3], add);
        Self { surface: Surface::measured(top_pa), ..Self::of(thickness / compliance) }
    }

    /// The same skin with another surface.
    #[must_use]
    pub fn with(self, surface: Surface) -> Self {
        Self { surface, ..self }
    }

    /// Checks its numbers, by the names that they have in a detector's file.
    ///
    /// # Errors
    /// The first [`Problem`] found, with its field.
    pub fn check(&self) -> Result<(), Problem> {
        within("skin.young_pa", self.young_pa, YOUNG_PA)?;
        within("skin.poisson", self.poisson, RATIO)?;
        match self.surface {
            Surface::Ideal { depth_m } => within("skin.ideal_depth_m", depth_m, DEPTH_M),
            Surface::Film { unit_pa } => within("skin.film_unit_pa", unit_pa, UNIT_PA),
        }
    }
}

impl From<Foam> for Skin {
    fn from(foam: Foam) -> Self {
        Self::of(foam.elasticity_pa)
    }
}

impl From<&Stack> for Skin {
    /// Foams of equal thickness.
    fn from(stack: &Stack) -> Self {
        Self::of_layers(stack.foams().iter().map(|foam| (1.0, foam.elasticity_pa)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::detector::Detector;
    use crate::hertz::Hertz;

    #[test]
    fn stacks_are_as_soft_as_springs_one_after_the_other() {
        let stack: Stack = "AB".parse().unwrap();
        assert!((Skin::from(&stack).young_pa - 2.0 / (1.0 / 0.35e6 + 1.0 / 0.96e6)).abs() < 1e-6);
        assert_eq!(Skin::from(&stack).surface, Surface::measured(0.35e6), "of the foam on top");
        assert_eq!(Skin::from(&"A".parse::<Stack>().unwrap()), Skin::of(0.35e6));
    }

    #[test]
    fn constants_of_no_layer_are_refused() {
        let detector = Detector::preset(Detector::DEFAULT).unwrap();
        for (skin, named) in [
            (Skin::of(0.0), "skin.young_pa is 0.0"),
            (Skin::of(f64::NAN), "skin.young_pa is NaN"),
            (Skin { poisson: 0.51, ..Skin::of(1e5) }, "skin.poisson is 0.51"),
            (Skin::of(1e5).with(Surface::Ideal { depth_m: -1.0 }), "skin.ideal_depth_m is -1.0"),
            (Skin::of(1e5).with(Surface::Film { unit_pa: 0.0 }), "skin.film_unit_pa is 0.0"),
        ] {
            let error = Hertz::new(&detector, skin).unwrap_err().to_string();
            assert!(error.contains(named), "{error}");
        }
    }
}
