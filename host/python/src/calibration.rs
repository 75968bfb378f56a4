//! `Calibration`: from the detector on paper to the one that was built.

use pyo3::prelude::*;
use tactomo::calibrate::{Frame, Rub, RubSettings, Step, rub};
use tactomo::date::today;
use tactomo::detector::{CalibratedParameter, Calibration as Found, Detector as Described};

use crate::detector::Detector;
use crate::error::{raised, refused};
use crate::given;

/// What a calibration found of a detector: its quantities as they are, with standard errors.
///
/// `Calibration(detector)` is that of a detector whose file is a calibrated one; `Calibration.rub(detector, readings)` makes one.
#[pyclass(frozen, module = "tactomo")]
pub struct Calibration {
    detector: Described,
    found: Found,
    rub: Option<RubFacts>,
}

/// What only the one who rubbed is told.
struct RubFacts {
    touched: usize,
    single: usize,
    place_error_m: f64,
    wires: Option<Vec<usize>>,
    left_out: Vec<usize>,
    residual: f64,
}

impl Calibration {
    /// That of a detector, if it has one.
    pub fn of(detector: &Described) -> Option<Self> {
        let found = detector.calibration.clone()?;
        Some(Self { detector: detector.clone(), found, rub: None })
    }

    fn rubbed(result: Rub) -> Option<Self> {
        let facts = RubFacts {
            touched: result.touched,
            single: result.single,
            place_error_m: result.place_error_m(),
            residual: result.chi_square[1].sqrt(),
            wires: result.wires,
            left_out: result.left_out,
        };
        Some(Self { rub: Some(facts), ..Self::of(&result.detector)? })
    }
}

#[pymethods]
impl Calibration {
    #[new]
    fn new(detector: &Detector) -> PyResult<Self> {
        Self::of(&detector.0).ok_or_else(|| {
            refused(format!("{} is not calibrated: use Calibration.rub, or `tactomo calibrate`", detector.0.name))
        })
    }

    /// Fits `detector` to one finger rubbed over it: half a minute, everywhere, now light and now firm. Nobody needs to know where it was.
    ///
    /// `readings` are frames less the baseline (V): `(frames, n, n)`, or frames of a `Recording`. `known` are presses at known
    /// places, `(index of the frame, x_m, y_m)`, which tell which way round the sensor lies. At most `presses` presses are fitted.
    /// `progress(iteration, residual)` hears of each step, the residual in standard deviations of noise, and stops it by returning `False`.
    #[staticmethod]
    #[pyo3(signature = (detector, readings, *, known = Vec::new(), presses = RubSettings::default().presses, progress = None))]
    #[pyo3(text_signature = "(detector, readings, *, known=(), presses=160, progress=None)")]
    fn rub(
        py: Python<'_>,
        detector: &Detector,
        readings: &Bound<'_, PyAny>,
        known: Vec<(usize, f64, f64)>,
        presses: usize,
        progress: Option<Py<PyAny>>,
    ) -> PyResult<Self> {
        let mut frames: Vec<Frame> = given::frames(readings, &detector.0)?
            .into_iter()
            .map(|readings| Frame { readings, known_m: None })
            .collect();
        for (index, x_m, y_m) in known {
            let count = frames.len();
            let frame = frames.get_mut(index);
            let frame = frame.ok_or_else(|| refused(format!("known: there is no frame {index} among {count}")))?;
            frame.known_m = Some([x_m, y_m]);
        }
        if !(4..=2000).contains(&presses) {
            return Err(refused("presses: a number from 4 to 2000 is needed"));
        }
        let settings = RubSettings { presses, ..RubSettings::default() };
        let mut raised_within = None;
        let result = py.detach(|| {
            let mut told = |step: Step| {
                told(progress.as_ref(), step).unwrap_or_else(|error| {
                    raised_within = Some(error);
                    false
                })
            };
            rub(&detector.0, &frames, &settings, &mut told)
        });
        if let Some(error) = raised_within {
            return Err(error);
        }
        let mut result = result.map_err(raised)?;
        if let Some(calibration) = &mut result.detector.calibration {
            calibration.date = today();
        }
        Self::rubbed(result).ok_or_else(|| refused("the rub left no calibration"))
    }

    /// The detector as it was found.
    #[getter]
    fn detector(&self) -> Detector {
        Detector(self.detector.clone())
    }

    /// Date of the calibration (ISO 8601).
    #[getter]
    fn date(&self) -> &str {
        &self.found.date
    }

    /// Identity of the board that measured; `None` of arrays.
    #[getter]
    fn board(&self) -> Option<&str> {
        self.found.board.as_deref()
    }

    /// Frames that were used.
    #[getter]
    fn frames(&self) -> usize {
        self.found.frames
    }

    /// Presses that were fitted.
    #[getter]
    fn presses(&self) -> usize {
        self.found.presses
    }

    /// Standard error of each parameter in its unit, by name; `(standard_error, left_at_prior)`, where the second tells that the
    /// readings said next to nothing of it.
    #[getter]
    fn parameters(&self) -> std::collections::BTreeMap<String, (f64, bool)> {
        let named = |known: &CalibratedParameter| (known.parameter.to_string(), (known.standard_error, known.is_prior));
        self.found.parameters.iter().map(named).collect()
    }

    /// Standard error that a place has now (m), mean over the sensor; of a fresh rub.
    #[getter]
    fn place_error_m(&self) -> Option<f64> {
        self.rub.as_ref().map(|rub| rub.place_error_m)
    }

    /// What the fit leaves of the readings, in standard deviations of noise and model error; of a fresh rub.
    #[getter]
    fn residual(&self) -> Option<f64> {
        self.rub.as_ref().map(|rub| rub.residual)
    }

    /// Frames that something touched in, and of those the ones of a single contact; of a fresh rub.
    #[getter]
    fn touched(&self) -> Option<(usize, usize)> {
        self.rub.as_ref().map(|rub| (rub.touched, rub.single))
    }

    /// Electrodes of the description that the channels are connected to, if not in its order; of a fresh rub.
    #[getter]
    fn wires(&self) -> Option<Vec<usize>> {
        self.rub.as_ref().and_then(|rub| rub.wires.clone())
    }

    /// Electrodes that were left out because they are wrong; of a fresh rub.
    #[getter]
    fn left_out(&self) -> Option<Vec<usize>> {
        self.rub.as_ref().map(|rub| rub.left_out.clone())
    }

    fn __repr__(&self) -> String {
        format!("Calibration({}, {}: {} presses)", self.detector.name, self.found.date, self.found.presses)
    }
}

#[pymethods]
impl Detector {
    /// What a calibration found; `None` if the detector is as it was described.
    #[getter]
    fn calibration(&self) -> Option<Calibration> {
        Calibration::of(&self.0)
    }
}

/// Tells of a step; whether to go on. Ctrl-C stops it.
fn told(progress: Option<&Py<PyAny>>, step: Step) -> PyResult<bool> {
    Python::attach(|py| {
        py.check_signals()?;
        let Some(progress) = progress else { return Ok(true) };
        let answer = progress.call1(py, (step.iteration, step.chi_square.sqrt()))?;
        Ok(answer.is_none(py) || answer.bind(py).is_truthy()?)
    })
}
