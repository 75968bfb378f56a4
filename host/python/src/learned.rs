//! `Learned` and `learn`: touch learned from presses at known places.

use std::path::PathBuf;

use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyType};
use tactomo::learned::Learned as Taught;
use tactomo::solve::{Kernel, Presses, Strength};

use crate::detector::Detector;
use crate::error::{raised, refused};
use crate::file::write_new;
use crate::given;
use crate::pickle::{Restored, restored};
use crate::solution::Solution;

/// What was learned from presses, by `learn` or `tactomo-lab learn`, or a network of `tools/train_network.py`: for `Solver(learned=...)`.
///
/// `Learned(path)` reads a file.
#[pyclass(frozen, module = "tactomo")]
pub struct Learned {
    pub taught: Taught,
    /// The file that it is.
    bytes: Vec<u8>,
}

impl Learned {
    fn of(bytes: Vec<u8>) -> PyResult<Self> {
        Ok(Self { taught: Taught::parse(&bytes).map_err(raised)?, bytes })
    }

    fn kernel(&self) -> Option<&Kernel> {
        match &self.taught {
            Taught::Kernel(kernel) => Some(kernel),
            Taught::Network(_) => None,
        }
    }
}

#[pymethods]
impl Learned {
    #[new]
    fn new(py: Python<'_>, path: PathBuf) -> PyResult<Self> {
        let (taught, bytes) = py.detach(|| Taught::read_with_bytes(&path)).map_err(raised)?;
        Ok(Self { taught, bytes })
    }

    /// Writes it to a new file, for `Learned(path)` and `--learned`; a file that exists is not replaced.
    fn save(&self, path: PathBuf) -> PyResult<()> {
        write_new(&path, &self.bytes)
    }

    /// What the channels of any sensor, less those at rest (V), say of a press: `(channels,)`. On a detector, `Solver(learned=...)` does the
    /// same, and leaves out broken electrodes.
    fn solve(&self, py: Python<'_>, readings: &Bound<'_, PyAny>) -> PyResult<Solution> {
        let kernel = self.kernel().ok_or_else(|| {
            refused("a network was learned for a detector: use it in Solver(\"network\", detector, learned=...)")
        })?;
        let volts: Vec<f64> = given::array("readings", readings)?.as_array().iter().copied().collect();
        let press = py.detach(|| kernel.press(&volts)).map_err(|channel| match channel {
            Some(channel) => refused(format!("channel {channel} is not a finite number")),
            None => {
                refused(format!("{} readings, but it has learned from {} channels", volts.len(), kernel.channels()))
            }
        })?;
        Ok(Solution::new(py, press.map(|press| press.solution(kernel.strength())).unwrap_or_default()))
    }

    /// Name of the solver that uses it: `kernel` or `network`.
    #[getter]
    fn solver(&self) -> &'static str {
        self.taught.method().name()
    }

    /// Readings that it needs.
    #[getter]
    fn channels(&self) -> usize {
        self.taught.channels()
    }

    /// Presses that it has learned from; `None` of a network.
    #[getter]
    fn presses(&self) -> Option<usize> {
        self.kernel().map(Kernel::presses)
    }

    /// Distance (m, root mean square) by which it misses a press that it was not taught, by leaving each out; `None` of a network.
    #[getter]
    fn left_out_m(&self) -> Option<f64> {
        self.kernel().map(Kernel::left_out_m)
    }

    /// The same of who guesses the middle of all presses each time (m).
    #[getter]
    fn middle_m(&self) -> Option<f64> {
        self.kernel().and_then(Kernel::middle_m)
    }

    /// What was learned of the strength: `force_n`, `depth_m` or `conductance_s`; `None` if nothing was.
    #[getter]
    fn strength(&self) -> Option<&'static str> {
        self.kernel().and_then(Kernel::strength).map(Strength::name)
    }

    /// Share by which it misses the strength of a press that it was not taught; `None` if that was not learned.
    #[getter]
    fn left_out_strength_share(&self) -> Option<f64> {
        self.kernel().and_then(Kernel::left_out_strength)
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<Restored<'py, (Bound<'py, PyBytes>,)>> {
        restored(slf, (PyBytes::new(slf.py(), &slf.get().bytes),))
    }

    #[classmethod]
    fn _restored(_class: &Bound<'_, PyType>, bytes: Vec<u8>) -> PyResult<Self> {
        Self::of(bytes)
    }

    fn __repr__(&self) -> String {
        match self.kernel() {
            Some(kernel) => format!("Learned({})", kernel.sentence()),
            None => format!("Learned(a network of {} readings)", self.taught.channels()),
        }
    }
}

/// Learns where and how hard something presses from presses at known places: on any sensor, with any number of channels. Some hundreds of
/// presses are good.
///
/// `readings` has a row a press, less those at rest (V): `(presses, channels)`, or `(presses, n, n)`. `places_m` are `(presses, 2)`, or
/// `(presses, 3)` (m). Of `force_n`, `depth_m` and `conductance_s`, `(presses,)`, at most one is learned too. With `detector` the readings
/// are its own, as in `Solver.solve`: then the force is taken out of them before places are learned.
#[pyfunction]
#[pyo3(signature = (readings, places_m, *, detector = None, force_n = None, depth_m = None, conductance_s = None))]
pub fn learn(
    py: Python<'_>,
    readings: &Bound<'_, PyAny>,
    places_m: &Bound<'_, PyAny>,
    detector: Option<&Detector>,
    force_n: Option<&Bound<'_, PyAny>>,
    depth_m: Option<&Bound<'_, PyAny>>,
    conductance_s: Option<&Bound<'_, PyAny>>,
) -> PyResult<Learned> {
    let (channels, readings_v) = channels(readings, detector)?;
    let given = [(Strength::Force, force_n), (Strength::Depth, depth_m), (Strength::Conductance, conductance_s)];
    let mut given = given.into_iter().filter_map(|(strength, values)| Some((strength, values?)));
    let (strength, strengths) = match given.next() {
        Some((strength, values)) => (Some(strength), given::numbers(strength.name(), values)?),
        None => (None, Vec::new()),
    };
    if given.next().is_some() {
        return Err(refused("give one of force_n, depth_m and conductance_s: one strength is learned"));
    }
    let presses = Presses {
        channels,
        names: Vec::new(),
        readings_v,
        places_m: given::places(places_m)?,
        strengths,
        strength,
        drive_v: detector.map(|detector| detector.0.drive_v),
        of: None,
        others: Vec::new(),
    };
    let bytes = py.detach(|| Taught::bytes_of(&Kernel::train(&presses).map_err(raised)?).map_err(raised))?;
    Learned::of(bytes)
}

/// How many channels there are, and all their readings.
fn channels(readings: &Bound<'_, PyAny>, detector: Option<&Detector>) -> PyResult<(usize, Vec<f64>)> {
    if let Some(Detector(detector)) = detector {
        let mut frames = given::frames(readings, detector)?;
        // As a solver has them.
        frames.iter_mut().for_each(|readings| readings.correct_channels(detector));
        let all = frames.iter().flat_map(|readings| readings.volts().iter().copied()).collect();
        return Ok((detector.electrodes.len().pow(2), all));
    }
    let array = given::array("readings", readings)?;
    let all = array.as_array();
    match all.shape() {
        [_, channels @ ..] if !channels.is_empty() => Ok((channels.iter().product(), all.iter().copied().collect())),
        _ => Err(refused("readings: an array (presses, channels) is needed (V)")),
    }
}
