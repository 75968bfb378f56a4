//! The foams at hand: the paper's four, or a list.

use std::path::{Path, PathBuf};

use tactomo_physics::detector::{CONDUCTIVITY_S_PER_M, FOAMS, LENGTH_M};
use tactomo_physics::hertz::YOUNG_PA;
use tactomo_table::file::Format;

/// A list of foams.
const FORMAT: Format = Format::new("a list of foams", 1 << 20);
/// Thicknesses that foams are taken to be sold in unless their list says otherwise (m).
const THICKNESSES_M: [f64; 6] = [0.5e-3, 1e-3, 2e-3, 3e-3, 5e-3, 10e-3];

/// A foam that can be had.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Material {
    /// Its name, short: stacks are named by their foams.
    pub name: String,
    /// Conductivity (S/m).
    pub conductivity_s_per_m: f64,
    /// Young's modulus (Pa).
    pub elasticity_pa: f64,
    /// Thicknesses that it can be had in (m).
    #[serde(default = "usual_thicknesses_m")]
    pub thicknesses_m: Vec<f64>,
}

/// A list of foams as a file has it.
#[derive(serde::Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    foam: Vec<Material>,
}

/// Why a list of foams cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum FoamsError {
    /// It cannot be read.
    #[error("cannot read {}: {error}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// Why.
        error: std::io::Error,
    },
    /// It is no list of foams.
    #[error(
        "{}: {error}each foam is a [[foam]] with name, conductivity_s_per_m, elasticity_pa and, if not the usual ones, thicknesses_m",
        path.display()
    )]
    Toml {
        /// The file.
        path: PathBuf,
        /// Why.
        error: toml::de::Error,
    },
    /// A foam in it is none.
    #[error("{}: {wrong}", path.display())]
    Foam {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        wrong: WrongFoam,
    },
}

/// A foam that cannot be.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("foam {name:?}: {what}")]
pub struct WrongFoam {
    name: String,
    what: String,
}

fn usual_thicknesses_m() -> Vec<f64> {
    THICKNESSES_M.to_vec()
}

impl Material {
    /// The paper's four.
    pub fn of_paper() -> Vec<Self> {
        let of = |foam: tactomo_physics::detector::Foam| Self {
            name: foam.letter.to_string(),
            conductivity_s_per_m: foam.conductivity_s_per_m,
            elasticity_pa: foam.elasticity_pa,
            thicknesses_m: usual_thicknesses_m(),
        };
        FOAMS.map(of).to_vec()
    }

    /// The foams of a TOML file.
    ///
    /// # Errors
    /// [`FoamsError`] that names the file and what is wrong in it.
    pub fn read(path: &Path) -> Result<Vec<Self>, FoamsError> {
        let text = FORMAT.read_text(path).map_err(|error| FoamsError::Io { path: path.to_owned(), error })?;
        let file: File = toml::from_str(&text).map_err(|error| FoamsError::Toml { path: path.to_owned(), error })?;
        Self::check_all(&file.foam).map_err(|wrong| FoamsError::Foam { path: path.to_owned(), wrong })?;
        Ok(file.foam)
    }

    /// Checks that there are foams, each a different one with numbers that make sense.
    fn check_all(foams: &[Self]) -> Result<(), WrongFoam> {
        let wrong = |name: &str, what: String| Err(WrongFoam { name: name.to_owned(), what });
        if foams.is_empty() {
            return wrong("", "there is none: at least one [[foam]] is needed".to_owned());
        }
        for (index, foam) in foams.iter().enumerate() {
            if foam.name.is_empty() || foams[..index].iter().any(|other| other.name == foam.name) {
                return wrong(&foam.name, "each foam needs a name of its own".to_owned());
            }
            let numbers = [
                ("conductivity_s_per_m", foam.conductivity_s_per_m, CONDUCTIVITY_S_PER_M),
                ("elasticity_pa", foam.elasticity_pa, YOUNG_PA),
            ];
            let thicknesses = foam.thicknesses_m.iter().map(|thickness_m| ("thicknesses_m", *thickness_m, LENGTH_M));
            for (field, value, range) in numbers.into_iter().chain(thicknesses) {
                if !range.contains(&value) {
                    let (low, high) = (range.start(), range.end());
                    return wrong(&foam.name, format!("{field} is {value:?}; it has to be from {low:?} to {high:?}"));
                }
            }
            if foam.thicknesses_m.is_empty() {
                return wrong(&foam.name, "thicknesses_m is empty: at least one thickness is needed".to_owned());
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<Vec<Material>, String> {
        let path = std::env::temp_dir().join(format!("tactomo-{}-foams-{}.toml", std::process::id(), text.len()));
        std::fs::write(&path, text).unwrap();
        let read = Material::read(&path).map_err(|error| error.to_string());
        std::fs::remove_file(&path).unwrap();
        read
    }

    #[test]
    fn a_list_is_read_with_usual_thicknesses_where_it_has_none() {
        let foams = read("[[foam]]\nname = \"X\"\nconductivity_s_per_m = 0.1\nelasticity_pa = 2e5\n").unwrap();
        assert_eq!((foams[0].name.as_str(), foams[0].thicknesses_m.len()), ("X", THICKNESSES_M.len()));
        assert!(Material::check_all(&Material::of_paper()).is_ok());
    }

    #[test]
    fn what_is_no_foam_says_what_is_wrong() {
        for (text, named) in [
            ("[[foam]]\nname = \"X\"\nconductivity_s_per_m = 0.1\n", "elasticity_pa"),
            (
                "[[foam]]\nname = \"X\"\nconductivity_s_per_m = -0.1\nelasticity_pa = 2e5\n",
                "conductivity_s_per_m is -0.1",
            ),
            ("[[foam]]\nname = \"X\"\nconductivity_s_per_m = 0.1\nelasticity_pa = 0.0\n", "elasticity_pa is 0"),
            (
                "[[foam]]\nname = \"X\"\nconductivity_s_per_m = 0.1\nelasticity_pa = 2e5\nthicknesses_m = [0]\n",
                "thicknesses_m is 0",
            ),
            (
                "[[foam]]\nname = \"X\"\nconductivity_s_per_m = 0.1\nelasticity_pa = 2e5\nthicknesses_m = []\n",
                "at least one thickness",
            ),
            ("foam = []\n", "there is none"),
            ("nothing = 1\n", "each foam is a [[foam]]"),
        ] {
            let error = read(text).unwrap_err();
            assert!(error.contains(named) && error.contains(".toml"), "{error}");
        }
        assert!(
            Material::read(Path::new("no/foams.toml")).unwrap_err().to_string().contains("cannot read no/foams.toml")
        );
    }
}
