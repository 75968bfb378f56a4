//! `Correction` and `ForceLaw`: what presses at known places and of known forces tell of a detector.

use std::collections::BTreeMap;

use numpy::PyArray1;
use pyo3::prelude::*;
use tactomo::calibrate::force::{Direction, ForceFit, ForcePress, Law, MaximumForce, Moment, fit_force, pairs};
use tactomo::calibrate::known::{Corrected, KnownPress, correction};
use tactomo::calibrate::pressed::{Found, Solved, pressed, single};
use tactomo::detector::{Detector as Described, ForceLaw as KeptLaw};
use tactomo::readings::Readings;
use tactomo::solve::{FaultTolerant, Method, Problem, Solver as _};

use crate::detector::Detector;
use crate::error::{raised, refused};
use crate::given::{self, Given};

/// What to do where several contacts are found.
const ONE_TIP: &str = "press with one tip alone; or the detector is not as it is described";

/// What the solver `contacts` finds in frames of a detector. Newtons are siemens: conductances with their constriction, as laws of force have
/// them.
struct Frames {
    solver: FaultTolerant,
    given: Given,
}

impl Frames {
    fn of(detector: Described, mut given: Given) -> PyResult<Self> {
        given.readings.iter_mut().for_each(|readings| readings.correct_channels(&detector));
        let problem = Problem::of(&Described { force: Some(KeptLaw::siemens()), ..detector }).map_err(raised)?;
        Ok(Self { solver: FaultTolerant::new(Method::Contacts, &problem).map_err(raised)?, given })
    }

    /// Contacts of each frame; `times_s` of a recording, whose frames follow each other.
    fn solved(&mut self) -> PyResult<Vec<Solved>> {
        let Self { solver, given: Given { readings, times_s } } = self;
        let one = |(index, readings): (usize, &Readings)| -> PyResult<Solved> {
            if times_s.is_none() {
                solver.reset();
            }
            let solution = solver.solve(readings).map_err(raised)?;
            let time_s = times_s.as_ref().map_or(0.0, |times_s| times_s[index]);
            Ok(Solved { time_s, contacts: solution.contacts })
        };
        readings.iter().enumerate().map(one).collect()
    }
}

/// What of the places and conductances that a solver finds no parameter of the detector explains, from presses at known places: 16 to 25 are
/// good, all over the sensor, best after a rub.
#[pyclass(frozen, module = "tactomo")]
pub struct Correction {
    detector: Described,
    found: Corrected,
    kept: usize,
    skipped: Vec<(usize, usize)>,
}

#[pymethods]
impl Correction {
    /// Finds it, as `tactomo calibrate presses`.
    ///
    /// `readings` are less the baseline (V): `(presses, n, n)`, a frame a press; or the frames of a `Recording` of presses one after the
    /// other, each held for a second and lifted before the next. `places_m` are `(presses, 2)`, in their order (m). With `force_n`,
    /// `(presses,)`, conductances are corrected alike, on a detector with a law of force. Presses that the detector holds already count with
    /// the new ones.
    #[staticmethod]
    #[pyo3(signature = (detector, readings, places_m, *, force_n = None))]
    fn of_presses(
        py: Python<'_>,
        detector: &Detector,
        readings: &Bound<'_, PyAny>,
        places_m: &Bound<'_, PyAny>,
        force_n: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let described = &detector.0;
        let known_m: Vec<[f64; 2]> = given::places(places_m)?;
        let is_on_it = |[x_m, y_m]: [f64; 2]| x_m.is_finite() && y_m.is_finite() && described.outline.holds([x_m, y_m]);
        if let Some(index) = known_m.iter().position(|place_m| !is_on_it(*place_m)) {
            let [x_m, y_m] = known_m[index];
            return Err(refused(format!(
                "places_m[{index}]: {x_m}, {y_m} m is not on the sensor: x and y count from its middle, in metres"
            )));
        }
        let forces = force_n.map(forces).transpose()?;
        if let Some(forces) = forces.as_ref().filter(|forces| forces.len() != known_m.len()) {
            return Err(refused(format!("force_n: {} forces are given, but {} places", forces.len(), known_m.len())));
        }
        if forces.is_some() && described.force.is_none() {
            return Err(refused("force_n: the detector has no law of force: fit one by ForceLaw.of_presses first"));
        }
        let given = given::timed(readings, described)?;
        let (found, kept, skipped) = py.detach(|| -> PyResult<_> {
            // What is corrected already would be corrected twice.
            let mut frames = Frames::of(Described { correction: None, ..described.clone() }, given)?;
            let found = found(&mut frames, known_m.len())?;
            let kept = described.correction.as_ref().map(KnownPress::kept).unwrap_or_default();
            let (mut presses, mut skipped) = (kept.clone(), Vec::new());
            for (index, found) in found.iter().enumerate() {
                let force_n = forces.as_ref().map(|forces| forces[index]);
                match found {
                    Ok(contact) => {
                        presses.push(KnownPress::of(contact, known_m[index], described.force.as_ref(), force_n));
                    }
                    Err(contacts) => skipped.push((index, *contacts)),
                }
            }
            let found = correction(described, &presses, &mut |_| {}).map_err(raised)?;
            Ok((found, kept.len(), skipped))
        })?;
        let detector = Described { correction: found.correction.clone(), ..described.clone() };
        Ok(Self { detector, found, kept, skipped })
    }

    /// The detector with the correction; without one where the presses show nothing but noise.
    #[getter]
    fn detector(&self) -> Detector {
        Detector(self.detector.clone())
    }

    /// Whether places are corrected: whether the presses show errors that run smoothly over the sensor.
    #[getter]
    fn corrects_places(&self) -> bool {
        self.found.place.is_corrected
    }

    /// The same of conductances; `None` where forces are not known.
    #[getter]
    fn corrects_conductances(&self) -> Option<bool> {
        self.found.conductance.map(|evidence| evidence.is_corrected)
    }

    /// How far each press is from where it is known to be, as found (m), `(presses,)`: those that the detector held already, then the new
    /// ones that were not skipped.
    #[getter]
    fn before_m<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_slice(py, &self.found.before_m)
    }

    /// The same if the others correct it: what to expect of new presses (m).
    #[getter]
    fn left_out_m<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_slice(py, &self.found.left_out_m)
    }

    /// Standard error that is given of that (m).
    #[getter]
    fn sigma_left_out_m<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_slice(py, &self.found.left_out_deviations_m)
    }

    /// Presses that the detector held already.
    #[getter]
    fn kept(&self) -> usize {
        self.kept
    }

    /// Presses that are not a single contact and were left out: `(index, contacts)`.
    #[getter]
    fn skipped(&self) -> Vec<(usize, usize)> {
        self.skipped.clone()
    }

    fn __repr__(&self) -> String {
        let mean_mm = |all: &[f64]| 1e3 * all.iter().sum::<f64>() / all.len().max(1) as f64;
        let (before, after) = (mean_mm(&self.found.before_m), mean_mm(&self.found.left_out_m));
        format!("Correction({}: {before:.2} mm before, {after:.2} mm after)", self.detector.name)
    }
}

/// Which force is behind a contact's conductance, from presses of known force: ten from light to firm are good, all of them with the tip that
/// will be used.
#[pyclass(frozen, module = "tactomo")]
pub struct ForceLaw {
    detector: Described,
    fit: ForceFit,
}

#[pymethods]
impl ForceLaw {
    /// Fits it, as `tactomo calibrate force`.
    ///
    /// `readings` are less the baseline (V): `(presses, n, n)`, a frame a press; or the frames of a `Recording` of presses one after the
    /// other, each held for a second and lifted before the next. `force_n` are `(presses,)`, in their order (N), and `unloading` tells of
    /// each whether the force was falling, if that is known. With `time_s`, since the recording's first frame (s), `force_n` are those of a
    /// force sensor. `law` is `power` or `saturating`; unless given, the one that the presses need.
    #[staticmethod]
    #[pyo3(signature = (detector, readings, force_n, *, unloading = None, time_s = None, law = None))]
    fn of_presses(
        py: Python<'_>,
        detector: &Detector,
        readings: &Bound<'_, PyAny>,
        force_n: &Bound<'_, PyAny>,
        unloading: Option<&Bound<'_, PyAny>>,
        time_s: Option<&Bound<'_, PyAny>>,
        law: Option<&str>,
    ) -> PyResult<Self> {
        let law = match law {
            None => None,
            Some("power") => Some(Law::Power),
            Some("saturating") => Some(Law::Saturating),
            Some(other) => return Err(refused(format!("law: `power` or `saturating` is needed, not `{other}`"))),
        };
        let told = match time_s {
            Some(_) if unloading.is_some() => {
                return Err(refused("unloading: a force sensor tells that itself: leave it out"));
            }
            Some(time_s) => Told::Sensor(sensor(time_s, force_n)?),
            None => {
                let forces_n = forces(force_n)?;
                let unloading = unloading.map(|unloading| given::numbers("unloading", unloading)).transpose()?;
                let unloading: Option<Vec<bool>> =
                    unloading.map(|unloading| unloading.iter().map(|is_set| *is_set != 0.0).collect());
                if unloading.as_ref().is_some_and(|unloading| unloading.len() != forces_n.len()) {
                    return Err(refused("unloading: as many values as forces are needed"));
                }
                Told::Presses(forces_n, unloading)
            }
        };
        let given = given::timed(readings, &detector.0)?;
        let fit = py.detach(|| {
            let mut frames = Frames::of(detector.0.clone(), given)?;
            fit_force(&told.presses(&mut frames)?, law).map_err(raised)
        })?;
        Ok(Self { detector: Described { force: Some(fit.law.clone()), ..detector.0.clone() }, fit })
    }

    /// The detector with the law: contacts of every solver carry newtons on it.
    #[getter]
    fn detector(&self) -> Detector {
        Detector(self.detector.clone())
    }

    /// Which law it is: `power` or `saturating`.
    #[getter]
    fn law(&self) -> &'static str {
        if self.fit.law.series_ohm.is_some() { "saturating" } else { "power" }
    }

    /// Its parameters by the names of a detector's file, `(value, standard error)`; `None` of what is not determined.
    #[getter]
    fn parameters(&self) -> BTreeMap<&'static str, (Option<f64>, Option<f64>)> {
        self.fit.parameters.iter().map(|known| (known.name, (known.value, known.deviation))).collect()
    }

    /// The largest force that can be told and its standard error (N): where the law saturates; else the largest of the presses, and `None`.
    /// `None` where the presses do not tell.
    #[getter]
    fn maximum_force_n(&self) -> Option<(f64, Option<f64>)> {
        match self.fit.maximum {
            MaximumForce::Saturation { force_n, deviation_n } => Some((force_n, Some(deviation_n))),
            MaximumForce::Calibrated { force_n } => Some((force_n, None)),
            MaximumForce::NotDetermined => None,
        }
    }

    /// Standard deviation of presses about the law: of the logarithm of the conductance.
    #[getter]
    fn scatter(&self) -> f64 {
        self.fit.law.scatter
    }

    /// Half the width between loading and unloading, of the logarithm of the conductance.
    #[getter]
    fn hysteresis(&self) -> f64 {
        self.fit.law.hysteresis
    }

    /// Presses that do not agree with the others, by their index: they count for little.
    #[getter]
    fn left_out(&self) -> Vec<usize> {
        self.fit.left_out.clone()
    }

    fn __repr__(&self) -> String {
        format!("ForceLaw({}: {}, {} presses)", self.detector.name, self.law(), self.fit.law.presses)
    }
}

/// Forces that are known.
enum Told {
    /// Of each press (N), and whether it was falling.
    Presses(Vec<f64>, Option<Vec<bool>>),
    /// Of a force sensor: times (s) and forces (N).
    Sensor(Vec<[f64; 2]>),
}

impl Told {
    fn presses(&self, frames: &mut Frames) -> PyResult<Vec<ForcePress>> {
        let (forces_n, unloading) = match self {
            Self::Presses(forces_n, unloading) => (forces_n, unloading),
            Self::Sensor(sensor) => return of_sensor(frames, sensor),
        };
        let is_recording = frames.given.times_s.is_some();
        let solved = frames.solved()?;
        let conducted: Vec<(usize, f64, f64)> = match is_recording {
            true => {
                let presses = pressed(&solved, forces_n.len(), "forces").map_err(raised)?;
                let plateaus = presses.iter().map(|press| press.plateau);
                plateaus.map(|plateau| (plateau.contacts, plateau.conductance_s, plateau.deviation_s)).collect()
            }
            false => {
                require_as_many(solved.len(), forces_n.len(), "force_n")?;
                let moments = solved.iter().map(Solved::moment);
                moments.map(|moment| (moment.contacts, moment.conductance_s, moment.deviation_s)).collect()
            }
        };
        let press = |(index, (contacts, conductance_s, deviation_s)): (usize, (usize, f64, f64))| {
            if contacts != 1 || conductance_s <= 0.0 {
                let what = match contacts {
                    0 => "is too light to be found: leave it out".to_owned(),
                    contacts => format!("has {contacts} contacts: {ONE_TIP}"),
                };
                return Err(refused(format!("force_n[{index}]: its press, of {} N, {what}", forces_n[index])));
            }
            let direction = unloading.as_ref().map(|unloading| match unloading[index] {
                true => Direction::Unloading,
                false => Direction::Loading,
            });
            Ok(ForcePress { force_n: forces_n[index], conductance_s, deviation_s, direction })
        };
        conducted.into_iter().enumerate().map(press).collect()
    }
}

fn of_sensor(frames: &mut Frames, sensor: &[[f64; 2]]) -> PyResult<Vec<ForcePress>> {
    if frames.given.times_s.is_none() {
        return Err(refused("time_s: frames of a Recording are needed, whose times a force sensor's can belong to"));
    }
    let moments: Vec<Moment> = frames.solved()?.iter().map(Solved::moment).collect();
    let presses = pairs(&moments, sensor);
    if presses.is_empty() {
        return Err(refused(
            "no single contact while the force sensor was pressed: time_s counts from the recording's first frame",
        ));
    }
    Ok(presses)
}

/// The contact of each press.
fn found(frames: &mut Frames, told: usize) -> PyResult<Vec<Found>> {
    let is_recording = frames.given.times_s.is_some();
    let solved = frames.solved()?;
    if is_recording {
        let presses = pressed(&solved, told, "places").map_err(raised)?;
        return Ok(presses.into_iter().map(|press| press.found).collect());
    }
    require_as_many(solved.len(), told, "places_m")?;
    Ok(solved.iter().map(|frame| single(&frame.contacts)).collect())
}

fn require_as_many(frames: usize, told: usize, what: &str) -> PyResult<()> {
    match frames == told {
        true => Ok(()),
        false => Err(refused(format!("{what}: {told} are given, but {frames} frames: one for each is needed"))),
    }
}

/// Forces above zero.
fn forces(force_n: &Bound<'_, PyAny>) -> PyResult<Vec<f64>> {
    let forces_n = given::numbers("force_n", force_n)?;
    match forces_n.iter().position(|force_n| !(force_n.is_finite() && *force_n > 0.0)) {
        Some(index) => Err(refused(format!("force_n[{index}]: a force above zero is needed (N)"))),
        None => Ok(forces_n),
    }
}

/// Times and forces of a force sensor.
fn sensor(time_s: &Bound<'_, PyAny>, force_n: &Bound<'_, PyAny>) -> PyResult<Vec<[f64; 2]>> {
    let (times_s, forces_n) = (given::numbers("time_s", time_s)?, given::numbers("force_n", force_n)?);
    if times_s.len() != forces_n.len() {
        return Err(refused(format!("time_s: {} times, but {} forces are given", times_s.len(), forces_n.len())));
    }
    let all: Vec<[f64; 2]> = times_s.into_iter().zip(forces_n).map(|(time_s, force_n)| [time_s, force_n]).collect();
    let is_finite = all.iter().flatten().all(|value| value.is_finite());
    if !is_finite || all.windows(2).any(|pair| pair[1][0] <= pair[0][0]) {
        return Err(refused("time_s: finite times that rise are needed, and finite forces"));
    }
    Ok(all)
}
