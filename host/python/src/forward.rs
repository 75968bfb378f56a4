//! `Contact`, `Model` and `Simulator`: from what presses to readings.

use std::ffi::CString;
use std::sync::{Arc, Mutex, PoisonError};

use numpy::PyArray2;
use pyo3::exceptions::PyUserWarning;
use pyo3::prelude::*;
use tactomo::detector::Detector as Described;
use tactomo::forward::{Auto, ForwardError, ForwardModel, readings_v, touched_impedance_ohm};
use tactomo::hertz::{self, Hertz};
use tactomo::nalgebra::DMatrix;
use tactomo::readings::Readings;
use tactomo::scene::{Contact as Disc, Touch};
use tactomo::simulate::{self, Fault, Measurement};

use crate::array::square;
use crate::detector::Detector;
use crate::error::{raised, refused};

/// A disc of contact between driving layer and detector: centre and radius (m), and the conductance of all of it (S).
#[pyclass(frozen, eq, get_all, module = "tactomo")]
#[derive(Clone, Copy, PartialEq)]
pub struct Contact {
    /// Centre, x (m).
    x_m: f64,
    /// Centre, y (m).
    y_m: f64,
    /// Centre, z (m): on a curved detector; zero on a flat one.
    z_m: f64,
    /// Radius (m).
    radius_m: f64,
    /// Conductance of the whole disc (S), spread evenly over its area.
    conductance_s: f64,
}

#[pymethods]
impl Contact {
    #[new]
    #[pyo3(signature = (x_m, y_m, radius_m, conductance_s, z_m = 0.0))]
    fn new(x_m: f64, y_m: f64, radius_m: f64, conductance_s: f64, z_m: f64) -> PyResult<Self> {
        let contact = Self { x_m, y_m, z_m, radius_m, conductance_s };
        Touch::from(contact).check().map_err(raised)?;
        Ok(contact)
    }

    /// The contact under a ball of `radius_m` (m) that is pressed on a detector with `force_n` (N): by Hertz's theory and what the detector's file
    /// says of its foam and surface (docs/detector.md, `[skin]`). Warns where the theory ends.
    #[staticmethod]
    #[pyo3(signature = (detector, x_m, y_m, radius_m, force_n, *, z_m = 0.0))]
    fn ball(
        py: Python<'_>,
        detector: &Detector,
        x_m: f64,
        y_m: f64,
        radius_m: f64,
        force_n: f64,
        z_m: f64,
    ) -> PyResult<Self> {
        hertz::check_press(radius_m, force_n).map_err(raised)?;
        let skin = detector.0.skin.ok_or_else(|| {
            refused(format!(
                "forces need to know how soft {} is: take detector.in_material(\"A\"), or write young_pa in a table [skin] of its file",
                detector.0.name
            ))
        })?;
        let imprint = Hertz::new(&detector.0, skin).map_err(raised)?.ball(radius_m, force_n);
        if let Some(beyond) = imprint.beyond {
            let warning = CString::new(format!("{force_n} N is beyond Hertz's theory: {beyond}"))?;
            PyErr::warn(py, &py.get_type::<PyUserWarning>(), &warning, 1)?;
        }
        Ok(Self { x_m, y_m, z_m, radius_m: imprint.half_width_m, conductance_s: imprint.conductance_s })
    }

    /// What it is made of again, for pickle and copies.
    fn __getnewargs__(&self) -> (f64, f64, f64, f64, f64) {
        (self.x_m, self.y_m, self.radius_m, self.conductance_s, self.z_m)
    }

    fn __repr__(&self) -> String {
        let Self { x_m, y_m, radius_m, conductance_s, .. } = self;
        format!("Contact(x_m={x_m}, y_m={y_m}, radius_m={radius_m}, conductance_s={conductance_s})")
    }
}

impl From<Contact> for Touch {
    fn from(contact: Contact) -> Self {
        let Contact { x_m, y_m, z_m, radius_m, conductance_s } = contact;
        Disc { x_m, y_m, z_m, radius_m, conductance_s }.into()
    }
}

/// What touches: contacts, rows `x_m, y_m, radius_m, conductance_s`, or touches of any shape as mappings.
pub fn touches(given: &Bound<'_, PyAny>) -> PyResult<Vec<Touch>> {
    given.try_iter()?.enumerate().map(|(index, one)| touch(&one?, index)).collect()
}

fn touch(given: &Bound<'_, PyAny>, index: usize) -> PyResult<Touch> {
    if let Ok(contact) = given.cast::<Contact>() {
        return Ok((*contact.get()).into());
    }
    if let Ok([x_m, y_m, radius_m, conductance_s]) = given.extract::<[f64; 4]>() {
        let touch = Contact::new(x_m, y_m, radius_m, conductance_s, 0.0).map(Touch::from);
        return touch.map_err(|error| refused(format!("contact {index}: {}", error.value(given.py()))));
    }
    let text = given.py().import("json")?.call_method1("dumps", (given,));
    let touch = text.and_then(|text| serde_json::from_str(text.extract()?).map_err(raised));
    let touch = touch.and_then(|touch: Touch| touch.check().map(|()| touch).map_err(raised));
    touch.map_err(|error| {
        refused(format!(
            "contact {index}: a Contact, four numbers (x_m, y_m, radius_m, conductance_s), or a touch such as {{\"centre_m\": [0, 0], \
             \"shape\": {{\"disc\": {{\"radius_m\": 0.003}}}}, \"conductance_s\": 0.001}} is needed: {}",
            error.value(given.py())
        ))
    })
}

/// Impedances under touches (ohm); `None` where nothing touches.
fn impedance_ohm(model: &dyn ForwardModel, touches: &[Touch]) -> Result<Option<DMatrix<f64>>, ForwardError> {
    if touches.is_empty() { Ok(None) } else { touched_impedance_ohm(model, touches).map(Some) }
}

/// Readings as an array `(n, n)`.
pub fn array<'py>(py: Python<'py>, readings: &Readings) -> PyResult<Bound<'py, PyArray2<f64>>> {
    square(py, readings.volts().to_vec(), readings.electrodes())
}

/// The model of a detector that solvers invert: made once, in milliseconds to seconds, and then asked as often as need be.
///
/// >>> Model(Detector()).forward([Contact(0.009, -0.006, 0.003, 2e-4)]).shape
/// (16, 16)
#[pyclass(frozen, module = "tactomo")]
pub struct Model {
    detector: Described,
    model: Box<dyn ForwardModel>,
}

#[pymethods]
impl Model {
    #[new]
    fn new(py: Python<'_>, detector: &Detector) -> PyResult<Self> {
        let detector = detector.0.clone();
        let Auto { model, .. } = py.detach(|| Auto::new(&detector, None)).map_err(raised)?;
        Ok(Self { detector, model })
    }

    /// What it is made of again, for pickle and copies.
    fn __getnewargs__(&self) -> (Detector,) {
        (self.detector(),)
    }

    /// The detector.
    #[getter]
    fn detector(&self) -> Detector {
        Detector(self.detector.clone())
    }

    /// Which model it is: `slab` or `shell`.
    #[getter]
    fn name(&self) -> &'static str {
        self.model.name()
    }

    /// Readings under contacts (V), `(n, n)`: `readings[g][e]` is electrode `e` while `g` is grounded. Without noise: to try a solver, take a
    /// `Simulator`, whose model is another and finer one. With no contacts all are zero.
    ///
    /// `contacts` are `Contact`s, rows of `x_m, y_m, radius_m, conductance_s` (an array `(contacts, 4)`), or touches of any shape: mappings
    /// as `tactomo forward --json` prints them.
    fn forward<'py>(&self, py: Python<'py>, contacts: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let touches = touches(contacts)?;
        let readings = py.detach(|| {
            Ok(match impedance_ohm(&*self.model, &touches)? {
                Some(impedance_ohm) => readings_v(&impedance_ohm, &self.detector),
                None => Readings::from_fn(self.detector.electrodes.len(), |_, _| 0.0),
            })
        });
        array(py, &readings.map_err(|error: ForwardError| raised(error))?)
    }

    fn __repr__(&self) -> String {
        format!("Model({:?}: {})", self.detector.name, self.model.name())
    }
}

/// A board that measures a detector under contacts: a model finer than any that solvers invert, wires and their faults, a converter.
///
/// `detector` is what is simulated; `detector.as_built(seed)` is one that is not quite the one described. `faults` are those of the
/// program's `--fault`, such as `"open:3"`; `seed` chooses noise and what faults leave open.
#[pyclass(frozen, module = "tactomo")]
pub struct Simulator {
    detector: Described,
    model: Arc<dyn ForwardModel>,
    measurement: Mutex<Measurement>,
}

#[pymethods]
impl Simulator {
    #[new]
    #[pyo3(signature = (detector, *, faults = Vec::new(), seed = 1), text_signature = "(detector, *, faults=(), seed=1)")]
    fn new(py: Python<'_>, detector: &Detector, faults: Vec<String>, seed: u64) -> PyResult<Self> {
        let faults = faults.iter().map(|fault| fault.parse::<Fault>().map_err(raised)).collect::<PyResult<Vec<_>>>()?;
        let detector = detector.0.clone();
        let model = py.detach(|| simulate::finer_model(&detector, &faults, seed)).map_err(raised)?;
        let measurement = Measurement::new(&detector, &faults, seed).map_err(raised)?;
        Ok(Self { detector, model: model.into(), measurement: Mutex::new(measurement) })
    }

    /// The detector that is simulated.
    #[getter]
    fn detector(&self) -> Detector {
        Detector(self.detector.clone())
    }

    /// Voltages at the converter in the next frame (V), `(n, n)`: without its noise. `contacts` as for `Model.forward`; none is a frame at rest.
    #[pyo3(signature = (contacts = None), text_signature = "($self, contacts=())")]
    fn voltages<'py>(
        &self,
        py: Python<'py>,
        contacts: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        self.frame(py, contacts, Measurement::pad_voltages)
    }

    /// The next frame as the converter gives it (V), `(n, n)`: with its noise and in its steps. `contacts` as for `Model.forward`; none is a
    /// frame at rest.
    #[pyo3(signature = (contacts = None), text_signature = "($self, contacts=())")]
    fn readings<'py>(
        &self,
        py: Python<'py>,
        contacts: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        self.frame(py, contacts, Measurement::readings_v)
    }
}

type Measure = fn(&mut Measurement, Option<&DMatrix<f64>>) -> Readings;

impl Simulator {
    fn frame<'py>(
        &self,
        py: Python<'py>,
        contacts: Option<&Bound<'py, PyAny>>,
        measure: Measure,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let touches = contacts.map(touches).transpose()?.unwrap_or_default();
        let readings = py.detach(|| {
            let impedance_ohm = impedance_ohm(&*self.model, &touches)?;
            let mut measurement = self.measurement.lock().unwrap_or_else(PoisonError::into_inner);
            Ok(measure(&mut measurement, impedance_ohm.as_ref()))
        });
        array(py, &readings.map_err(|error: ForwardError| raised(error))?)
    }
}
