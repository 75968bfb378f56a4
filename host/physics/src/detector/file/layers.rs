//! Layers in a detector's file, and what joins them.

use std::fmt::Write as _;

use serde::Deserialize;

use super::quoted;
use crate::detector::check::Problem;
use crate::detector::material::Foam;
use crate::detector::{Bond, Layer};

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct LayerTable {
    thickness_m: f64,
    material: Option<String>,
    conductivity_s_per_m: Option<f64>,
    bottom_s_per_m: Option<f64>,
    top_s_per_m: Option<f64>,
    bond: Option<BondTable>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct BondTable {
    grid: [usize; 2],
    diameter_m: f64,
    sheet_conductance_s: Option<f64>,
    contact_impedance_ohm_m2: Option<f64>,
}

impl Layer {
    pub(super) fn write_toml(&self, text: &mut String) -> std::fmt::Result {
        writeln!(text, "\n[[layers]]\nthickness_m = {:?}", self.thickness_m)?;
        if self.bottom_s_per_m == self.top_s_per_m {
            writeln!(text, "conductivity_s_per_m = {:?}", self.bottom_s_per_m)?;
        } else {
            writeln!(text, "bottom_s_per_m = {:?}\ntop_s_per_m = {:?}", self.bottom_s_per_m, self.top_s_per_m)?;
        }
        self.bond.as_ref().map_or(Ok(()), |bond| bond.write_toml(text))
    }
}

impl Bond {
    fn write_toml(&self, text: &mut String) -> std::fmt::Result {
        writeln!(text, "[layers.bond]\ngrid = {:?}\ndiameter_m = {:?}", self.grid, self.diameter_m)?;
        writeln!(text, "sheet_conductance_s = {:?}", self.sheet_conductance_s)?;
        writeln!(text, "contact_impedance_ohm_m2 = {:?}", self.contact_impedance_ohm_m2)
    }
}

impl LayerTable {
    /// The layer, and the foam that it is of, if that is said.
    pub(super) fn into_layer(self, field: &str) -> Result<(Layer, Option<Foam>), Problem> {
        let Self { thickness_m, material, conductivity_s_per_m, bottom_s_per_m, top_s_per_m, bond } = self;
        let (layer, foam) = match (material, conductivity_s_per_m, bottom_s_per_m, top_s_per_m) {
            (Some(material), None, None, None) => {
                let foam = single(&material).and_then(Foam::of);
                let what = || format!("is {}, but has to be \"A\", \"B\", \"C\" or \"D\"", quoted(&material));
                let foam = foam.ok_or_else(|| Problem::new(format!("{field}.material"), what()))?;
                (Layer::uniform(thickness_m, foam.conductivity_s_per_m), Some(foam))
            }
            (None, Some(conductivity), None, None) => (Layer::uniform(thickness_m, conductivity), None),
            (None, None, Some(bottom), Some(top)) => (Layer::graded(thickness_m, [bottom, top]), None),
            _ => {
                return Err(Problem::new(
                    field,
                    "has to have one of material, conductivity_s_per_m, or bottom_s_per_m with top_s_per_m",
                ));
            }
        };
        Ok((Layer { bond: bond.map(BondTable::into_bond), ..layer }, foam))
    }
}

impl BondTable {
    fn into_bond(self) -> Bond {
        let usual = Bond::of_dots(self.grid, self.diameter_m);
        Bond {
            sheet_conductance_s: self.sheet_conductance_s.unwrap_or(usual.sheet_conductance_s),
            contact_impedance_ohm_m2: self.contact_impedance_ohm_m2.unwrap_or(usual.contact_impedance_ohm_m2),
            ..usual
        }
    }
}

/// The only character of a text.
fn single(text: &str) -> Option<char> {
    let mut characters = text.chars();
    characters.next().filter(|_| characters.next().is_none())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::detector::Detector;

    const FILE: &str = "[outline]\nsize_m = [0.06, 0.06]\n[[layers]]\nthickness_m = 0.005\nmaterial = \"B\"\n[[layers]]\nthickness_m = 0.005\n\
        material = \"A\"\n[layers.bond]\ngrid = [5, 4]\ndiameter_m = 0.007\n[electrodes]\ngrid = [4, 4]\ndiameter_m = 0.004\n";

    #[test]
    fn dots_are_read_and_written() {
        let detector = Detector::from_toml(FILE, "glued").unwrap();
        assert_eq!(detector.bond(), Some((1, Bond::of_dots([5, 4], 0.007))));
        let mut other = detector;
        let bond = other.layers[1].bond.as_mut().unwrap();
        (bond.sheet_conductance_s, bond.contact_impedance_ohm_m2) = (0.25, 3e-5);
        assert_eq!(Detector::from_toml(&other.to_toml(), "").unwrap(), other);
    }

    #[test]
    fn dots_that_cannot_be_are_refused_with_their_line() {
        let error =
            |from: &str, to: &str| Detector::from_toml(&FILE.replace(from, to), "glued").unwrap_err().to_string();
        assert!(
            error("0.007", "0.0151")
                .starts_with("line 11: layers[1].bond.diameter_m is 0.0151, which makes the dots overlap")
        );
        assert!(error("[5, 4]", "[5, 0]").starts_with("line 10: layers[1].bond.grid is [5, 0]"));
        assert!(error("diameter_m = 0.007", "radius_m = 0.003").contains("radius_m"));
        let below =
            FILE.replacen("material = \"B\"", "material = \"B\"\nbond = { grid = [5, 5], diameter_m = 0.003 }", 1);
        let below = Detector::from_toml(&below, "glued").unwrap_err().to_string();
        assert!(below.starts_with("line 6: layers[0].bond joins a layer to the one below"), "{below}");
    }
}
