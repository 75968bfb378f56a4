//! The table of a calibration.

use std::fmt::Write as _;

use serde::Deserialize;

use super::super::check::Problem;
use super::super::{CalibratedParameter, Calibration, UnknownParameter};
use super::quoted;

/// Most parameters and directions of a file.
const MOST: usize = 512;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct CalibrationTable {
    board: Option<String>,
    sensor: Option<String>,
    description: Option<String>,
    date: String,
    frames: usize,
    presses: usize,
    place_error_m: Option<f64>,
    parameters: Vec<String>,
    standard_errors: Vec<f64>,
    #[serde(default)]
    left_at_prior: Vec<String>,
    #[serde(default)]
    directions: Vec<Vec<f64>>,
}

impl CalibrationTable {
    pub(super) fn into_calibration(self) -> Result<Calibration, Problem> {
        let count = self.parameters.len();
        let each = |field: &str, numbers: &[f64]| {
            let what = || format!("has {} numbers, but has to have one for each of {count} parameters", numbers.len());
            if numbers.len() != count {
                return Err(Problem::new(field, what()));
            }
            match numbers.iter().find(|number| !number.is_finite()) {
                Some(number) => Err(Problem::new(field, format!("holds {number}, but has to hold finite numbers"))),
                None => Ok(()),
            }
        };
        if count.max(self.directions.len()) > MOST {
            return Err(Problem::new("calibration.parameters", format!("or directions are more than {MOST}")));
        }
        if self.place_error_m.is_some_and(|error_m| !(error_m.is_finite() && error_m > 0.0)) {
            return Err(Problem::new("calibration.place_error_m", "has to be a length above 0".to_owned()));
        }
        each("calibration.standard_errors", &self.standard_errors)?;
        self.directions.iter().try_for_each(|direction| each("calibration.directions", direction))?;
        if let Some(other) = self.left_at_prior.iter().find(|name| !self.parameters.contains(name)) {
            let what = format!("names {}, which is none of calibration.parameters", quoted(other));
            return Err(Problem::new("calibration.left_at_prior", what));
        }
        let unknown = |error: UnknownParameter| Problem::new("calibration.parameters", error.to_string());
        let parameter = |(name, standard_error): (&String, &f64)| {
            let parameter = name.parse().map_err(unknown)?;
            let is_prior = self.left_at_prior.contains(name);
            Ok(CalibratedParameter { parameter, standard_error: *standard_error, is_prior })
        };
        Ok(Calibration {
            parameters: self.parameters.iter().zip(&self.standard_errors).map(parameter).collect::<Result<_, _>>()?,
            board: self.board,
            sensor: self.sensor,
            description: self.description,
            date: self.date,
            frames: self.frames,
            presses: self.presses,
            place_error_m: self.place_error_m,
            directions: self.directions,
        })
    }
}

impl Calibration {
    pub(super) fn write_toml(&self, text: &mut String) -> std::fmt::Result {
        let names = |is: &dyn Fn(&CalibratedParameter) -> bool| {
            let named = self.parameters.iter().filter(|known| is(known)).map(|known| known.parameter.to_string());
            named.collect::<Vec<_>>()
        };
        let errors: Vec<f64> = self.parameters.iter().map(|known| known.standard_error).collect();
        writeln!(text, "\n[calibration]")?;
        for (name, told) in [("board", &self.board), ("sensor", &self.sensor), ("description", &self.description)] {
            if let Some(told) = told {
                writeln!(text, "{name} = {}", quoted(told))?;
            }
        }
        writeln!(text, "date = {}\nframes = {}\npresses = {}", quoted(&self.date), self.frames, self.presses)?;
        if let Some(error_m) = self.place_error_m {
            writeln!(text, "place_error_m = {error_m:?}")?;
        }
        writeln!(text, "parameters = {:?}", names(&|_| true))?;
        write!(text, "standard_errors = ")?;
        write_numbers(text, &errors)?;
        writeln!(text, "\nleft_at_prior = {:?}", names(&|known| known.is_prior))?;
        writeln!(
            text,
            "# What is left unknown, as independent directions of one standard deviation each.\ndirections = ["
        )?;
        for direction in &self.directions {
            write!(text, "  ")?;
            write_numbers(text, direction)?;
            writeln!(text, ",")?;
        }
        writeln!(text, "]")
    }
}

/// Standard errors need no more than four digits.
fn write_numbers(text: &mut String, numbers: &[f64]) -> std::fmt::Result {
    let all: Vec<_> =
        numbers.iter().map(|number| if *number == 0.0 { "0.0".to_owned() } else { format!("{number:.3e}") }).collect();
    write!(text, "[{}]", all.join(", "))
}
