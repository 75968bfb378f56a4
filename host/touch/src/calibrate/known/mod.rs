//! From presses at known places to a smooth correction of what is found: for what no parameter of the detector explains.
//!
//! The error of a place found is taken for a smooth function of the place, with its uncertainty, and with what differs from press to press
//! (`smooth`). The same goes for the logarithm of the conductance where the force is known and the detector has a law of force. What is believed of
//! it is what presses that were left out say: an error that is not smooth is not corrected.

mod order;
mod smooth;
#[cfg(test)]
mod tests;

use tactomo_physics::detector::{ConductanceErrors, Correction, Detector, ForceLaw, PlaceErrors};
use tactomo_physics::geometry::area;

use crate::solve::FoundContact;

pub use self::order::WouldFit;
use self::smooth::{Channel, Errors, Verdict, judge};

/// Fewest presses: fewer say nothing of what is smooth.
pub const FEWEST: usize = 3;
/// Most presses: as many as a detector's file may hold.
pub const MOST: usize = 300;
/// Mean distances of electrodes by which places may be off, in the root of the mean square: on detectors of the default tolerances they are off by a
/// fifth at most, and by one and more where the sensor is taken for turned.
const OFF_SPACINGS: f64 = 0.5;

/// A press at a known place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct KnownPress {
    /// Where a solver finds it (m).
    pub found_m: [f64; 2],
    /// Standard errors of x and y that the solver tells (m).
    pub standard_errors_m: [f64; 2],
    /// Where it is (m).
    pub known_m: [f64; 2],
    /// Conductance found over that of the law of force, where the force is known: its logarithm, and the standard error of that.
    pub log_conductance: Option<[f64; 2]>,
}

/// What known presses say.
#[derive(Clone, Debug)]
pub struct Corrected {
    /// What solvers take off their contacts; `None` if nothing is asked for.
    pub correction: Option<Correction>,
    /// What was decided of places.
    pub place: Evidence,
    /// What was decided of conductances, if forces are known.
    pub conductance: Option<Evidence>,
    /// How far each press is off as it was found (m).
    pub before_m: Vec<f64>,
    /// How far it is off if the others correct it (m).
    pub left_out_m: Vec<f64>,
    /// Standard error that is given of it then (m), in the root of the mean square of x and y.
    pub left_out_deviations_m: Vec<f64>,
    /// How much the rest was off as presses came.
    pub progress: Vec<Progress>,
}

/// Whether presses ask for a smooth correction.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Evidence {
    /// Whether they do.
    pub is_corrected: bool,
    /// Logarithm of the marginal likelihood with noise alone.
    pub log_evidence_without: f64,
    /// Logarithm of the marginal likelihood with a smooth error.
    pub log_evidence_with: f64,
}

/// What some presses do for the others.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Progress {
    /// How many were known: the first.
    pub presses: usize,
    /// Mean distance of the rest from where they are, as found (m).
    pub before_m: f64,
    /// Mean distance of the rest from where they are, corrected by those known (m).
    pub after_m: f64,
}

/// Why there is no correction.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum KnownError {
    /// Too few.
    #[error(
        "{found} presses at known places, but {FEWEST} at least are needed, all over the sensor; 16 to 25 are good"
    )]
    TooFew {
        /// How many there are.
        found: usize,
    },
    /// Too many.
    #[error("{found} presses at known places, but {MOST} at most can be kept: leave out some")]
    TooMany {
        /// How many there are.
        found: usize,
    },
    /// Not a press.
    #[error("press {}: {what}", press + 1)]
    Value {
        /// Its index.
        press: usize,
        /// What is wrong.
        what: &'static str,
    },
    /// Places have a height.
    #[error("{detector} is curved: places are corrected on flat detectors only")]
    Curved {
        /// Name of the detector.
        detector: String,
    },
    /// Places that contradict the presses.
    #[error("the known places do not belong to the presses: they are off by {off_mm:.1} mm; {would}")]
    Places {
        /// Root mean square (mm).
        off_mm: f64,
        /// What would make them fit.
        would: WouldFit,
    },
}

/// Finds what known presses correct on a detector; `report` hears how the error falls as they come.
///
/// # Errors
/// [`KnownError`] if they are no presses of that detector.
pub fn correction(
    detector: &Detector,
    presses: &[KnownPress],
    report: &mut dyn FnMut(&Progress),
) -> Result<Corrected, KnownError> {
    check(detector, presses)?;
    let [width_m, height_m] = detector.outline.size_m();
    let side_m = width_m.max(height_m);
    let progress = (0..).map(|power| 1 << power).take_while(|count| *count < presses.len()).map(|count| {
        let progress = progressed(presses, count, side_m);
        report(&progress);
        progress
    });
    let progress = progress.collect();
    let found_m: Vec<_> = presses.iter().map(|press| press.found_m).collect();
    let places = place_errors(presses, &found_m, side_m);
    let place = judge(&places);
    let known: Vec<_> = presses.iter().filter_map(|press| Some((press.found_m, press.log_conductance?))).collect();
    let known_m: Vec<_> = known.iter().map(|(found_m, _)| *found_m).collect();
    let conductances = conductance_errors(&known, &known_m, side_m);
    let conductance = if known.len() < FEWEST { None } else { judge(&conductances) };
    let correction = Correction {
        place: place.filter(|verdict| verdict.is_smooth).map(|verdict| kept_places(&places, &verdict)),
        conductance: conductance
            .filter(|verdict| verdict.is_smooth)
            .map(|verdict| kept_conductances(&conductances, &verdict)),
    };
    let before_m: Vec<f64> = presses.iter().map(KnownPress::off_m).collect();
    let left_out =
        left_out(&places, place.as_ref()).unwrap_or_else(|| before_m.iter().map(|off_m| [*off_m, 0.0]).collect());
    Ok(Corrected {
        correction: (correction != Correction::default()).then_some(correction),
        place: Evidence::of(place.as_ref()),
        conductance: conductance.as_ref().map(|verdict| Evidence::of(Some(verdict))),
        before_m,
        left_out_m: left_out.iter().map(|[off_m, _]| *off_m).collect(),
        left_out_deviations_m: left_out.iter().map(|[_, deviation_m]| *deviation_m).collect(),
        progress,
    })
}

impl KnownPress {
    /// That of a contact which was found on a detector with [`ForceLaw::siemens`]; of a known force, what the `law` says of its conductance.
    pub fn of(contact: &FoundContact, known_m: [f64; 2], law: Option<&ForceLaw>, force_n: Option<f64>) -> Self {
        let log_conductance = || {
            let (law, force_n) = law.zip(force_n)?;
            let (found_s, deviation_s) = contact.force_n.zip(contact.force_deviation_n)?;
            (found_s > 0.0).then(|| [(found_s / law.conductance_s(force_n)).ln(), deviation_s / found_s])
        };
        Self {
            found_m: [contact.x_m, contact.y_m],
            standard_errors_m: contact.uncertainty.map_or([0.0; 2], |claimed| [claimed.x_m, claimed.y_m]),
            known_m,
            log_conductance: log_conductance(),
        }
    }

    /// The presses that a correction was made from, as far as it keeps them: all, if it corrects places.
    pub fn kept(correction: &Correction) -> Vec<Self> {
        let conductance_at = |found_m: [f64; 2]| {
            let errors = correction.conductance.as_ref()?;
            let index = errors.found_m.iter().position(|other| *other == found_m)?;
            Some([errors.log_errors[index], errors.log_standard_errors[index]])
        };
        let press = |errors: &PlaceErrors, k: usize| Self {
            found_m: errors.found_m[k],
            standard_errors_m: errors.standard_errors_m[k],
            known_m: [0, 1].map(|axis| errors.found_m[k][axis] - errors.errors_m[k][axis]),
            log_conductance: conductance_at(errors.found_m[k]),
        };
        let all = correction.place.iter();
        let indices = all.flat_map(|errors| (0..errors.found_m.len()).map(move |k| (errors, k)));
        indices.map(|(errors, k)| press(errors, k)).collect()
    }

    /// Found less known (m).
    fn error_m(&self) -> [f64; 2] {
        [0, 1].map(|axis| self.found_m[axis] - self.known_m[axis])
    }

    fn off_m(&self) -> f64 {
        let [x_m, y_m] = self.error_m();
        x_m.hypot(y_m)
    }
}

impl Evidence {
    fn of(verdict: Option<&Verdict>) -> Self {
        let [log_evidence_without, log_evidence_with] = verdict.map_or([0.0; 2], |verdict| verdict.log_evidence);
        let is_corrected = verdict.is_some_and(|verdict| verdict.is_smooth);
        Self { is_corrected, log_evidence_without, log_evidence_with }
    }
}

fn check(detector: &Detector, presses: &[KnownPress]) -> Result<(), KnownError> {
    if detector.surface.is_some() {
        return Err(KnownError::Curved { detector: detector.name.clone() });
    }
    for (index, press) in presses.iter().enumerate() {
        let wrong = |what| Err(KnownError::Value { press: index, what });
        let numbers = press.found_m.into_iter().chain(press.known_m).chain(press.log_conductance.into_iter().flatten());
        if numbers.into_iter().any(|number| !number.is_finite()) {
            return wrong("its place or its conductance is not a finite number");
        }
        if !press.standard_errors_m.iter().all(|error_m| *error_m >= 0.0 && error_m.is_finite()) {
            return wrong("its standard errors have to be zero or more");
        }
    }
    if presses.len() < FEWEST {
        return Err(KnownError::TooFew { found: presses.len() });
    }
    if presses.len() > MOST {
        return Err(KnownError::TooMany { found: presses.len() });
    }
    let outline = &detector.outline;
    let area_m2 = outline.holes.iter().chain([&outline.outer]).map(|corners| area(corners)).sum::<f64>();
    let spacing_m = (area_m2 / detector.electrodes.len().max(1) as f64).sqrt();
    let [found_m, known_m] = [|press: &KnownPress| press.found_m, |press: &KnownPress| press.known_m];
    let [found_m, known_m] = [found_m, known_m].map(|of| presses.iter().map(of).collect::<Vec<_>>());
    order::check(&found_m, &known_m, OFF_SPACINGS * spacing_m)
        .map_err(|(off_m, would)| KnownError::Places { off_mm: 1e3 * off_m, would })
}

fn place_errors<'a>(presses: &[KnownPress], found_m: &'a [[f64; 2]], side_m: f64) -> Errors<'a> {
    let channel = |axis: usize| Channel {
        errors: presses.iter().map(|press| press.error_m()[axis]).collect(),
        claimed: presses.iter().map(|press| press.standard_errors_m[axis]).collect(),
    };
    Errors { found_m, channels: vec![channel(0), channel(1)], side_m, has_share: true }
}

fn conductance_errors<'a>(known: &[([f64; 2], [f64; 2])], found_m: &'a [[f64; 2]], side_m: f64) -> Errors<'a> {
    let [errors, claimed] = [0, 1].map(|k| known.iter().map(|(_, log)| log[k]).collect());
    Errors { found_m, channels: vec![Channel { errors, claimed }], side_m, has_share: false }
}

fn kept_places(errors: &Errors, verdict: &Verdict) -> PlaceErrors {
    let pairs = |of: &dyn Fn(&Channel, usize) -> f64| {
        (0..errors.found_m.len()).map(|k| [0, 1].map(|axis| of(&errors.channels[axis], k))).collect()
    };
    PlaceErrors {
        length_m: verdict.smooth.prior.length_m,
        deviation_m: verdict.smooth.prior.deviation,
        noise_m: verdict.smooth.scatter.noise,
        claimed_share: verdict.smooth.scatter.share,
        found_m: errors.found_m.to_vec(),
        errors_m: pairs(&|channel, k| channel.errors[k]),
        standard_errors_m: pairs(&|channel, k| channel.claimed[k]),
    }
}

fn kept_conductances(errors: &Errors, verdict: &Verdict) -> ConductanceErrors {
    let channel = &errors.channels[0];
    ConductanceErrors {
        length_m: verdict.smooth.prior.length_m,
        deviation: verdict.smooth.prior.deviation,
        noise: verdict.smooth.scatter.noise,
        found_m: errors.found_m.to_vec(),
        log_errors: channel.errors.clone(),
        log_standard_errors: channel.claimed.clone(),
    }
}

/// What each press is off, and the standard error, if the others correct it (m); `None` if nothing is corrected.
fn left_out(errors: &Errors, verdict: Option<&Verdict>) -> Option<Vec<[f64; 2]>> {
    let processes = verdict.filter(|verdict| verdict.is_smooth)?.smooth.processes(errors)?;
    let axes: Vec<_> = processes.iter().map(|process| process.left_out()).collect();
    let off = |axis: usize, k: usize| errors.channels[axis].errors[k] - axes[axis][k].mean;
    let row = |k: usize| {
        let deviation_m = (0.5 * (axes[0][k].variance + axes[1][k].variance)).sqrt();
        [off(0, k).hypot(off(1, k)), deviation_m]
    };
    Some((0..errors.found_m.len()).map(row).collect())
}

/// What the first presses do for the rest.
fn progressed(presses: &[KnownPress], count: usize, side_m: f64) -> Progress {
    let (known, rest) = presses.split_at(count);
    let found_m: Vec<_> = known.iter().map(|press| press.found_m).collect();
    let errors = place_errors(known, &found_m, side_m);
    let verdict = if count < FEWEST { None } else { judge(&errors).filter(|verdict| verdict.is_smooth) };
    let processes = verdict.and_then(|verdict| verdict.smooth.processes(&errors)).unwrap_or_default();
    let after_m = |press: &KnownPress| {
        let error_m = press.error_m();
        let mean_m = |axis: usize| processes.get(axis).map_or(0.0, |process| process.at(press.found_m).mean);
        (error_m[0] - mean_m(0)).hypot(error_m[1] - mean_m(1))
    };
    let mean = |of: &dyn Fn(&KnownPress) -> f64| rest.iter().map(of).sum::<f64>() / rest.len().max(1) as f64;
    Progress { presses: count, before_m: mean(&KnownPress::off_m), after_m: mean(&after_m) }
}
