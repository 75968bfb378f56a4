//! Reference cases: a detector, its contacts, and the readings that an independent solver found for them.

use std::io;
use std::path::{Path, PathBuf};

use nalgebra::DMatrix;
use serde::Deserialize;

use super::json_file;
use tactomo_physics::detector::{Adc, Detector, Electrode, Layer, Outline, Tolerances, Unevenness};
use tactomo_physics::readings::Readings;
use tactomo_physics::scene::Contact;

/// One reference case.
#[derive(Clone, Debug, PartialEq)]
pub struct Case {
    /// The detector; its name is the case's. The analogue-to-digital converter is the default one, for a case has none.
    pub detector: Detector,
    /// The contacts that were there.
    pub contacts: Vec<Contact>,
    /// Impedance matrix (ohm), as in [`tactomo_physics::forward::ForwardModel::impedance_ohm`].
    pub impedance_ohm: DMatrix<f64>,
    /// Readings (V).
    pub readings: Readings,
    /// Largest difference of a reading between the two meshes of the reference (V): about twice the error left in it.
    pub mesh_error_v: f64,
}

/// Why a case cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum CaseError {
    /// The file cannot be read.
    #[error("cannot read the case {}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// What the system says.
        source: io::Error,
    },
    /// Not JSON, or a field is missing or of the wrong type; the message names it with line and column.
    #[error("{}: not a case", path.display())]
    Parse {
        /// The file.
        path: PathBuf,
        /// What is wrong and where.
        source: serde_json::Error,
    },
    /// A field with a value that makes no sense.
    #[error("{}: field `{field}` {what}", path.display())]
    Field {
        /// The file.
        path: PathBuf,
        /// The field.
        field: &'static str,
        /// What is wrong and what is allowed.
        what: String,
    },
}

impl Case {
    /// Reads a case from a JSON file, which may be compressed by gzip.
    ///
    /// # Errors
    /// [`CaseError`], which names the file and the field.
    pub fn read(path: &Path) -> Result<Self, CaseError> {
        let text = json_file::text(path).map_err(|source| CaseError::Read { path: path.to_owned(), source })?;
        Self::parse(&text, path)
    }

    /// Reads a case from the text of a file; `path` is for the messages.
    ///
    /// # Errors
    /// [`CaseError`], which names the file and the field.
    pub fn parse(text: &str, path: &Path) -> Result<Self, CaseError> {
        let file: File =
            serde_json::from_str(text).map_err(|source| CaseError::Parse { path: path.to_owned(), source })?;
        file.check().map_err(|(field, what)| CaseError::Field { path: path.to_owned(), field, what })?;
        Ok(file.into_case())
    }
}

/// The file as it is written.
#[derive(Deserialize)]
struct File {
    name: String,
    size_m: [f64; 3],
    conductivity_s_per_m: Conductivity,
    electrodes: Electrodes,
    contacts: Vec<Contact>,
    drive_v: f64,
    electrode_contact_impedance_ohm_m2: f64,
    multiplexer_on_resistance_ohm: f64,
    impedance_ohm: Vec<Vec<f64>>,
    readings_v: Vec<Vec<f64>>,
    mesh_error_v: f64,
}

// Not an enum tagged by `kind`: serde buffers the fields of those, and numbers do not survive that when any crate of the
// build turns on serde_json's arbitrary precision.
#[derive(Deserialize)]
struct Conductivity {
    kind: Kind,
    #[serde(default)]
    layers: Vec<LayerShare>,
    #[serde(default)]
    bottom: f64,
    #[serde(default)]
    top: f64,
}

#[derive(Clone, Copy, Deserialize)]
#[serde(rename_all = "lowercase")]
enum Kind {
    Layers,
    Gradient,
}

#[derive(Deserialize)]
struct LayerShare {
    thickness_share: f64,
    conductivity: f64,
}

#[derive(Deserialize)]
struct Electrodes {
    diameter_m: f64,
    positions_m: Vec<[f64; 2]>,
}

type Checked = Result<(), (&'static str, String)>;

impl File {
    fn check(&self) -> Checked {
        for side_m in self.size_m {
            positive("size_m", side_m)?;
        }
        self.conductivity_s_per_m.check()?;
        self.electrodes.check(self.size_m)?;
        self.check_contacts()?;
        positive("drive_v", self.drive_v)?;
        not_negative("electrode_contact_impedance_ohm_m2", self.electrode_contact_impedance_ohm_m2)?;
        not_negative("multiplexer_on_resistance_ohm", self.multiplexer_on_resistance_ohm)?;
        not_negative("mesh_error_v", self.mesh_error_v)?;
        self.check_square("impedance_ohm", &self.impedance_ohm)?;
        self.check_square("readings_v", &self.readings_v)
    }

    fn check_contacts(&self) -> Checked {
        for contact in &self.contacts {
            on_detector("contacts", self.size_m, [contact.x_m, contact.y_m])?;
            positive("contacts.radius_m", contact.radius_m)?;
            positive("contacts.conductance_s", contact.conductance_s)?;
        }
        Ok(())
    }

    fn check_square(&self, field: &'static str, rows: &[Vec<f64>]) -> Checked {
        let count = self.electrodes.positions_m.len();
        if rows.len() != count || rows.iter().any(|row| row.len() != count) {
            return Err((field, format!("has to be {count} x {count}, one row and column for each electrode")));
        }
        match rows.iter().flatten().find(|value| !value.is_finite()) {
            Some(value) => Err((field, format!("holds {value}, but has to hold finite numbers"))),
            None => Ok(()),
        }
    }

    fn into_case(self) -> Case {
        let [width_m, height_m, thickness_m] = self.size_m;
        let count = self.electrodes.positions_m.len();
        Case {
            detector: Detector {
                name: self.name,
                outline: Outline::rectangle(width_m, height_m),
                surface: None,
                layers: self.conductivity_s_per_m.into_layers(thickness_m),
                unevenness: Unevenness::default(),
                electrodes: self.electrodes.into_list(),
                contact_impedance_ohm_m2: self.electrode_contact_impedance_ohm_m2,
                drive_v: self.drive_v,
                ground_v: 0.0,
                on_resistance_ohm: self.multiplexer_on_resistance_ohm,
                adc: Adc::default(),
                // What was solved is what the case describes.
                tolerances: Tolerances::EXACT,
                converters: Vec::new(),
                calibration: None,
                force: None,
                skin: None,
                correction: None,
            },
            contacts: self.contacts,
            impedance_ohm: DMatrix::from_fn(count, count, |i, j| self.impedance_ohm[i][j]),
            readings: Readings::from_fn(count, |g, e| self.readings_v[g][e]),
            mesh_error_v: self.mesh_error_v,
        }
    }
}

impl Conductivity {
    fn check(&self) -> Checked {
        match self.kind {
            Kind::Layers => self.check_layers(),
            Kind::Gradient => {
                positive("conductivity_s_per_m.bottom", self.bottom)?;
                positive("conductivity_s_per_m.top", self.top)
            }
        }
    }

    fn check_layers(&self) -> Checked {
        for layer in &self.layers {
            positive("conductivity_s_per_m.layers.thickness_share", layer.thickness_share)?;
            positive("conductivity_s_per_m.layers.conductivity", layer.conductivity)?;
        }
        let sum: f64 = self.layers.iter().map(|layer| layer.thickness_share).sum();
        let what = || format!("have shares that add up to {sum}, but the shares of all are 1");
        ((sum - 1.0).abs() < 1e-6).then_some(()).ok_or_else(|| ("conductivity_s_per_m.layers", what()))
    }

    fn into_layers(self, thickness_m: f64) -> Vec<Layer> {
        let uniform = |layer: LayerShare| Layer::uniform(layer.thickness_share * thickness_m, layer.conductivity);
        match self.kind {
            Kind::Layers => self.layers.into_iter().map(uniform).collect(),
            Kind::Gradient => vec![Layer::graded(thickness_m, [self.bottom, self.top])],
        }
    }
}

impl Electrodes {
    fn check(&self, size_m: [f64; 3]) -> Checked {
        positive("electrodes.diameter_m", self.diameter_m)?;
        if self.positions_m.len() < 2 {
            return Err(("electrodes.positions_m", "has to hold two electrodes or more".to_owned()));
        }
        self.positions_m.iter().try_for_each(|&position| on_detector("electrodes.positions_m", size_m, position))
    }

    fn into_list(self) -> Vec<Electrode> {
        let radius_m = self.diameter_m / 2.0;
        self.positions_m.into_iter().map(|[x_m, y_m]| Electrode::flat(x_m, y_m, radius_m)).collect()
    }
}

fn positive(field: &'static str, value: f64) -> Checked {
    let fine = value.is_finite() && value > 0.0;
    fine.then_some(()).ok_or_else(|| (field, format!("is {value}, but has to be above zero")))
}

fn not_negative(field: &'static str, value: f64) -> Checked {
    let fine = value.is_finite() && value >= 0.0;
    fine.then_some(()).ok_or_else(|| (field, format!("is {value}, but has to be zero or above")))
}

fn on_detector(field: &'static str, [width_m, height_m, _]: [f64; 3], [x_m, y_m]: [f64; 2]) -> Checked {
    let inside = x_m.abs() <= width_m / 2.0 && y_m.abs() <= height_m / 2.0;
    let what =
        || format!("has a centre at ({x_m}, {y_m}), outside the detector of {width_m} m x {height_m} m about (0, 0)");
    inside.then_some(()).ok_or_else(|| (field, what()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use tactomo_physics::causes::with_causes;

    const TWO_ELECTRODES: &str = r#"{"name": "two", "size_m": [0.06, 0.04, 0.01],
        "conductivity_s_per_m": {"kind": "layers", "layers": [
            {"thickness_share": 0.25, "conductivity": 0.5}, {"thickness_share": 0.75, "conductivity": 0.2}]},
        "electrodes": {"columns": 2, "rows": 1, "diameter_m": 0.004, "positions_m": [[-0.015, 0.0], [0.015, 0.0]]},
        "contacts": [{"x_m": 0.001, "y_m": 0.002, "radius_m": 0.003, "conductance_s": 0.001}],
        "drive_v": 2.0, "electrode_contact_impedance_ohm_m2": 1e-5, "multiplexer_on_resistance_ohm": 4.0,
        "impedance_ohm": [[20.0, 10.0], [10.0, 30.0]], "readings_v": [[0.1, 1.0], [1.5, 0.2]], "mesh_error_v": 0.01}"#;

    fn parse(text: &str) -> Result<Case, CaseError> {
        Case::parse(text, Path::new("two.json"))
    }

    #[test]
    fn layers_are_shares_of_the_thickness_bottom_first() -> Result<(), CaseError> {
        let case = parse(TWO_ELECTRODES)?;
        assert_eq!(case.detector.layers, [Layer::uniform(0.0025, 0.5), Layer::uniform(0.0075, 0.2)]);
        assert_eq!(case.detector.outline.as_rectangle(), Some([0.06, 0.04]));
        assert_eq!(case.readings.at(1, 0), 1.5);
        assert_eq!(case.impedance_ohm[(1, 1)], 30.0);
        Ok(())
    }

    #[test]
    fn a_gradient_is_one_layer() -> Result<(), CaseError> {
        let start = TWO_ELECTRODES.find("{\"kind\"").unwrap_or_default();
        let end = TWO_ELECTRODES.find("]},").unwrap_or_default() + 2;
        let gradient = r#"{"kind": "gradient", "bottom": 1.0, "top": 0.01}"#;
        let case = parse(&format!("{}{gradient}{}", &TWO_ELECTRODES[..start], &TWO_ELECTRODES[end..]))?;
        assert_eq!(case.detector.layers, [Layer::graded(0.01, [1.0, 0.01])]);
        Ok(())
    }

    #[test]
    fn errors_name_file_and_field() {
        let wrong = [
            ("\"drive_v\": 2.0", "\"drive_v\": -2.0", "two.json: field `drive_v` is -2"),
            ("\"drive_v\": 2.0,", "", "two.json: not a case: missing field `drive_v`"),
            ("0.75,", "0.5,", "shares that add up to 0.75"),
            ("[[-0.015", "[[-0.5", "field `electrodes.positions_m` has a centre at (-0.5, 0)"),
            ("[1.5, 0.2]]", "[1.5]]", "field `readings_v` has to be 2 x 2"),
        ];
        for (from, to, message) in wrong {
            let error =
                parse(&TWO_ELECTRODES.replacen(from, to, 1)).map_or_else(|e| with_causes(&e), |_| String::new());
            assert!(error.contains(message), "{error}");
        }
        let missing = Case::read(Path::new("no-such.json")).map_or_else(|e| with_causes(&e), |_| String::new());
        assert!(missing.starts_with("cannot read the case no-such.json: "), "{missing}");
    }
}
