//! What no parameter of a detector explains: errors of places and conductances at known presses, which `tactomo calibrate presses` keeps.
//!
//! The presses themselves are kept, with what says how smoothly the errors between them run. Solvers make Gaussian processes of them, whose
//! means they take off their contacts (`tactomo_touch::solve`).

use std::fmt::{self, Write as _};
use std::ops::RangeInclusive;

use super::check::{Problem, within};

/// Most presses of a correction: solvers make a matrix of their pairs.
const MOST: usize = 300;
/// Distances over which errors change (m): from less than any pad to more than any detector.
const RANGE_M: RangeInclusive<f64> = 1e-5..=100.0;
/// Errors of places, and their deviations (m).
const ERROR_M: RangeInclusive<f64> = -10.0..=10.0;
const DEVIATION_M: RangeInclusive<f64> = 0.0..=10.0;
/// Errors of the logarithm of a conductance, and their deviations: a factor of `e^10` is no correction.
const ERROR: RangeInclusive<f64> = -10.0..=10.0;
const DEVIATION: RangeInclusive<f64> = 0.0..=10.0;
const SHARE: RangeInclusive<f64> = 0.0..=1.0;

/// Errors at known presses, and how they run between these.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Correction {
    /// Of places, if presses ask for that.
    pub place: Option<PlaceErrors>,
    /// Of conductances, if presses ask for that.
    pub conductance: Option<ConductanceErrors>,
}

/// Errors of places, x and y alike and independent of each other.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PlaceErrors {
    /// Length `l` of the kernel `deviation^2 exp(-distance^2 / (2 l^2))` (m).
    pub length_m: f64,
    /// Standard deviation of the smooth error of a coordinate (m).
    pub deviation_m: f64,
    /// Standard deviation of what is not smooth (m): it differs from press to press.
    pub noise_m: f64,
    /// Share of the solver's standard errors that differs from press to press: the rest is the same at the same place, and corrected.
    pub claimed_share: f64,
    /// Where presses were found (m).
    pub found_m: Vec<[f64; 2]>,
    /// How far from where they were (m): found less known.
    pub errors_m: Vec<[f64; 2]>,
    /// Standard errors of x and y that the solver gave (m).
    pub standard_errors_m: Vec<[f64; 2]>,
}

/// Errors of the logarithm of conductances, against what the law of force says.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ConductanceErrors {
    /// Length of the kernel (m).
    pub length_m: f64,
    /// Standard deviation of the smooth error.
    pub deviation: f64,
    /// Standard deviation of what is not smooth, which is the law's scatter too.
    pub noise: f64,
    /// Where presses were found (m).
    pub found_m: Vec<[f64; 2]>,
    /// Logarithm of the conductance found over that of the law, with the constriction both.
    pub log_errors: Vec<f64>,
    /// Standard errors of it that the solver gave.
    pub log_standard_errors: Vec<f64>,
}

impl Correction {
    /// Presses that it was made from.
    pub fn presses(&self) -> usize {
        let places = self.place.as_ref().map_or(0, |errors| errors.found_m.len());
        places.max(self.conductance.as_ref().map_or(0, |errors| errors.found_m.len()))
    }

    /// Checks the numbers of a correction that was read.
    ///
    /// # Errors
    /// The first [`Problem`] found, with its field.
    pub fn check(&self) -> Result<(), Problem> {
        self.place.as_ref().map_or(Ok(()), PlaceErrors::check)?;
        self.conductance.as_ref().map_or(Ok(()), ConductanceErrors::check)?;
        match self.presses() {
            0 => Err(Problem::new("correction", "has to have a table place or conductance: leave it out otherwise")),
            _ => Ok(()),
        }
    }

    /// As the tables `[correction.place]` and `[correction.conductance]` of a detector's file.
    pub(super) fn write_toml(&self, text: &mut String) -> fmt::Result {
        if let Some(errors) = &self.place {
            writeln!(text, "\n[correction.place]\nlength_m = {:?}", errors.length_m)?;
            writeln!(text, "deviation_m = {:?}\nnoise_m = {:?}", errors.deviation_m, errors.noise_m)?;
            writeln!(text, "claimed_share = {:?}", errors.claimed_share)?;
            write_all(text, "found_m", &errors.found_m)?;
            write_all(text, "errors_m", &errors.errors_m)?;
            write_all(text, "standard_errors_m", &errors.standard_errors_m)?;
        }
        if let Some(errors) = &self.conductance {
            writeln!(text, "\n[correction.conductance]\nlength_m = {:?}", errors.length_m)?;
            writeln!(text, "deviation = {:?}\nnoise = {:?}", errors.deviation, errors.noise)?;
            write_all(text, "found_m", &errors.found_m)?;
            writeln!(text, "log_errors = {:?}", errors.log_errors)?;
            writeln!(text, "log_standard_errors = {:?}", errors.log_standard_errors)?;
        }
        Ok(())
    }
}

/// A list of pairs, one a line.
fn write_all(text: &mut String, name: &str, pairs: &[[f64; 2]]) -> fmt::Result {
    writeln!(text, "{name} = [")?;
    pairs.iter().try_for_each(|pair| writeln!(text, "  {pair:?},"))?;
    writeln!(text, "]")
}

impl PlaceErrors {
    fn check(&self) -> Result<(), Problem> {
        let field = |name: &str| format!("correction.place.{name}");
        within(&field("length_m"), self.length_m, RANGE_M)?;
        within(&field("deviation_m"), self.deviation_m, DEVIATION_M)?;
        within(&field("noise_m"), self.noise_m, DEVIATION_M)?;
        within(&field("claimed_share"), self.claimed_share, SHARE)?;
        let flat = |pairs: &[[f64; 2]]| pairs.as_flattened().to_vec();
        check_list(&field("found_m"), &self.found_m, &flat(&self.found_m), &ERROR_M)?;
        check_list(&field("errors_m"), &self.found_m, &flat(&self.errors_m), &ERROR_M)?;
        check_list(&field("standard_errors_m"), &self.found_m, &flat(&self.standard_errors_m), &DEVIATION_M)
    }
}

impl ConductanceErrors {
    fn check(&self) -> Result<(), Problem> {
        let field = |name: &str| format!("correction.conductance.{name}");
        within(&field("length_m"), self.length_m, RANGE_M)?;
        within(&field("deviation"), self.deviation, DEVIATION)?;
        within(&field("noise"), self.noise, DEVIATION)?;
        check_list(&field("found_m"), &self.found_m, self.found_m.as_flattened(), &ERROR_M)?;
        let doubled = |values: &[f64]| values.iter().flat_map(|value| [*value; 2]).collect::<Vec<_>>();
        check_list(&field("log_errors"), &self.found_m, &doubled(&self.log_errors), &ERROR)?;
        check_list(&field("log_standard_errors"), &self.found_m, &doubled(&self.log_standard_errors), &DEVIATION)
    }
}

/// Checks that there are as many pairs of numbers as presses, and few enough, all within a range.
fn check_list(field: &str, presses: &[[f64; 2]], numbers: &[f64], range: &RangeInclusive<f64>) -> Result<(), Problem> {
    if !(1..=MOST).contains(&presses.len()) {
        return Err(Problem::new(field, format!("has {} presses, but has to have 1 to {MOST}", presses.len())));
    }
    if numbers.len() != 2 * presses.len() {
        let what = format!("has {} presses, but found_m has {}", numbers.len() / 2, presses.len());
        return Err(Problem::new(field, what));
    }
    numbers.iter().try_for_each(|number| within(field, *number, range.clone()))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn correction() -> Correction {
        let found_m = vec![[0.01, -0.02], [0.0, 1.0 / 300.0]];
        Correction {
            place: Some(PlaceErrors {
                length_m: 0.03,
                deviation_m: 1e-3,
                noise_m: 1e-4,
                claimed_share: 0.3,
                found_m: found_m.clone(),
                errors_m: vec![[1e-3, 0.0], [-2e-4, 1e-5 / 3.0]],
                standard_errors_m: vec![[1e-4; 2]; 2],
            }),
            conductance: Some(ConductanceErrors {
                length_m: 0.05,
                deviation: 0.1,
                noise: 0.01,
                found_m,
                log_errors: vec![0.1, -0.2 / 3.0],
                log_standard_errors: vec![0.001, 0.002],
            }),
        }
    }

    #[test]
    fn it_goes_through_its_tables_to_the_digit() {
        let both = correction();
        let ones = [Correction { place: None, ..both.clone() }, Correction { conductance: None, ..both.clone() }];
        for correction in ones.into_iter().chain([both]) {
            let mut text = String::new();
            correction.write_toml(&mut text).unwrap();
            #[derive(serde::Deserialize)]
            struct Document {
                correction: Correction,
            }
            let again: Document = toml::from_str(&text).unwrap();
            assert_eq!((again.correction.check(), again.correction), (Ok(()), correction), "{text}");
        }
    }

    #[test]
    fn wrong_numbers_are_named() {
        let problem = |spoil: fn(&mut PlaceErrors, &mut ConductanceErrors)| {
            let mut wrong = correction();
            spoil(wrong.place.as_mut().unwrap(), wrong.conductance.as_mut().unwrap());
            wrong.check().unwrap_err().to_string()
        };
        assert!(problem(|place, _| place.length_m = 0.0).starts_with("correction.place.length_m is 0.0"));
        assert!(problem(|place, _| place.noise_m = f64::NAN).starts_with("correction.place.noise_m is NaN"));
        assert!(problem(|place, _| place.claimed_share = 2.0).starts_with("correction.place.claimed_share is 2.0"));
        let fewer = problem(|place, _| place.errors_m.truncate(1));
        assert_eq!(fewer, "correction.place.errors_m has 1 presses, but found_m has 2");
        assert!(
            problem(|place, _| place.errors_m[1][0] = f64::INFINITY).starts_with("correction.place.errors_m is inf")
        );
        assert!(problem(|place, _| place.found_m = vec![[0.0; 2]; 301]).contains("has 301 presses"));
        assert!(problem(|_, conductance| conductance.noise = -1.0).starts_with("correction.conductance.noise is -1"));
        assert!(problem(|_, conductance| conductance.log_errors.truncate(1)).contains("log_errors has 1 presses"));
        assert!(Correction::default().check().unwrap_err().to_string().contains("leave it out"));
    }
}
