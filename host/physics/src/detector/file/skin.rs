//! The table of a detector's skin.

use std::fmt::Write as _;

use serde::Deserialize;

use crate::detector::check::Problem;
use crate::detector::{Foam, Layer};
use crate::hertz::{POISSON, Skin, Surface};

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct SkinTable {
    young_pa: f64,
    poisson: Option<f64>,
    film_unit_pa: Option<f64>,
    ideal_depth_m: Option<f64>,
}

impl Skin {
    /// The table `[skin]` of a detector's file.
    pub fn to_toml(&self) -> String {
        let mut text = String::new();
        // Writing to a string cannot fail.
        let _ = self.write_toml(&mut text);
        text.trim().to_owned()
    }

    pub(super) fn write_toml(&self, text: &mut String) -> std::fmt::Result {
        writeln!(text, "\n[skin]\nyoung_pa = {:?}\npoisson = {:?}", self.young_pa, self.poisson)?;
        match self.surface {
            Surface::Film { unit_pa } => writeln!(text, "film_unit_pa = {unit_pa:?}"),
            Surface::Ideal { depth_m } => writeln!(text, "ideal_depth_m = {depth_m:?}"),
        }
    }
}

impl SkinTable {
    /// Without a law of the surface, that of the paper's foams.
    pub(super) fn into_skin(self) -> Result<Skin, Problem> {
        let surface = match (self.film_unit_pa, self.ideal_depth_m) {
            (None, None) => Surface::measured(self.young_pa),
            (Some(unit_pa), None) => Surface::Film { unit_pa },
            (None, Some(depth_m)) => Surface::Ideal { depth_m },
            (Some(_), Some(_)) => {
                return Err(Problem::new(
                    "skin",
                    "has film_unit_pa and ideal_depth_m, but a surface is one or the other",
                ));
            }
        };
        Ok(Skin { young_pa: self.young_pa, poisson: self.poisson.unwrap_or(POISSON), surface })
    }
}

/// The skin of layers, bottom first, where each is of a foam that is known.
pub(super) fn of_foams(layers: &[(Layer, Option<Foam>)]) -> Option<Skin> {
    let soft = |(layer, foam): &(Layer, Option<Foam>)| Some((layer.thickness_m, foam.as_ref()?.elasticity_pa));
    layers.iter().map(soft).collect::<Option<Vec<_>>>().map(Skin::of_layers)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::detector::Detector;

    const FILE: &str = "[outline]\nsize_m = [0.06, 0.06]\n[[layers]]\nthickness_m = 0.005\nconductivity_s_per_m = 0.2\n\
        [electrodes]\ngrid = [4, 4]\ndiameter_m = 0.004\n";

    fn read(skin: &str) -> Result<Option<Skin>, String> {
        let read = Detector::from_toml(&format!("{FILE}{skin}"), "soft");
        read.map(|detector| detector.skin).map_err(|error| error.to_string())
    }

    #[test]
    fn a_skin_is_read_and_written() {
        assert_eq!(read(""), Ok(None), "nothing says how soft it is");
        assert_eq!(read("[skin]\nyoung_pa = 3e5\n"), Ok(Some(Skin::of(3e5))));
        let film = Skin::of(3e5).with(Surface::Film { unit_pa: 5e4 });
        assert_eq!(read("[skin]\nyoung_pa = 3e5\nfilm_unit_pa = 5e4\n"), Ok(Some(film)));
        let ideal = Skin { poisson: 0.4, ..Skin::of(3e5).with(Surface::Ideal { depth_m: 2e-4 }) };
        assert_eq!(read("[skin]\nyoung_pa = 3e5\npoisson = 0.4\nideal_depth_m = 2e-4\n"), Ok(Some(ideal)));
        for skin in [None, Some(film), Some(ideal)] {
            let detector = Detector { skin, ..Detector::default() };
            assert_eq!(Detector::from_toml(&detector.to_toml(), "").unwrap(), detector);
        }
    }

    #[test]
    fn layers_of_known_foams_say_how_soft_they_are() {
        let layers = |second: &str| {
            let layers = format!("material = \"B\"\n[[layers]]\nthickness_m = 0.002\n{second}");
            let text = FILE.replace("conductivity_s_per_m = 0.2", &layers);
            Detector::from_toml(&text, "foams").unwrap().skin
        };
        assert_eq!(layers("material = \"A\""), Some(Skin::of_layers([(0.005, 0.96e6), (0.002, 0.35e6)])));
        assert_eq!(layers("conductivity_s_per_m = 0.2"), None, "one of them is not known");
    }

    #[test]
    fn what_is_no_skin_is_named_with_its_line() {
        for (skin, told) in [
            ("young_pa = 0.35", "line 10: skin.young_pa is 0.35, but has to be from 100.0"),
            ("young_pa = 3e5\npoisson = 0.6", "line 11: skin.poisson is 0.6"),
            ("young_pa = 3e5\nfilm_unit_pa = 0.0", "line 11: skin.film_unit_pa is 0.0"),
            ("young_pa = 3e5\nideal_depth_m = 2.0", "line 11: skin.ideal_depth_m is 2.0"),
            (
                "young_pa = 3e5\nideal_depth_m = 2e-4\nfilm_unit_pa = 5e4",
                "line 9: skin has film_unit_pa and ideal_depth_m",
            ),
            ("poisson = 0.3", "missing field `young_pa`"),
            ("young_pa = 3e5\nunit_pa = 5e4", "unknown field `unit_pa`"),
        ] {
            let error = read(&format!("[skin]\n{skin}\n")).unwrap_err();
            assert!(error.contains(told), "{skin}: {error}");
        }
    }
}
