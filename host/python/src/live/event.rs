//! `TouchEvent`: what an answered frame gave.

use std::sync::Arc;

use numpy::PyArray2;
use pyo3::prelude::*;
use pyo3::types::PyList;
use tactomo::readings::Readings;
use tactomo::run::TouchEvent as Answered;
use tactomo::schema::FrameReport;

use crate::error::raised;
use crate::forward::array;
use crate::solution::{Solution, contact_array, contacts};

/// What an answered frame gave; names are those of the program's `--stream`.
#[pyclass(frozen, module = "tactomo")]
pub struct TouchEvent(pub Arc<Answered>);

impl TouchEvent {
    /// What the solver got (V).
    pub fn touch(&self) -> &Readings {
        &self.0.touch
    }
}

#[pymethods]
impl TouchEvent {
    /// Number of the scan since the board started.
    #[getter]
    fn sequence(&self) -> u64 {
        self.0.frame.sequence
    }

    /// Board time in the middle of the scan (s).
    #[getter]
    fn time_s(&self) -> f64 {
        self.0.frame.time_s()
    }

    /// When the frame's last byte came, by this machine's clock (s since 1970).
    #[getter]
    fn arrived_unix_s(&self) -> f64 {
        self.0.frame.arrived.unix_ns as f64 * 1e-9
    }

    /// Age of the answer when it was ready: since the frame's last byte came (us); `None` of a frame from a file.
    #[getter]
    fn age_us(&self) -> Option<f64> {
        self.0.age.map(|age| age.as_secs_f64() * 1e6)
    }

    /// Frames that the link or the board lost since the event before.
    #[getter]
    fn lost_before(&self) -> u64 {
        self.0.lost_before
    }

    /// Whether this is a better answer to the frame of the event before.
    #[getter]
    fn revised(&self) -> bool {
        self.0.is_revision
    }

    /// Whether the baseline is being taken, so that less is known of touch.
    #[getter]
    fn rezeroing(&self) -> bool {
        self.0.is_taking_baseline
    }

    /// Readings as measured (V), `(n, n)`: `readings_v[g][e]` is electrode `e` while `g` is grounded.
    #[getter]
    fn readings_v<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        array(py, &self.0.frame.measured)
    }

    /// The same as they are used (V), `(n, n)`: a reading within two deviations of the noise of an end of its converter's range is the bound
    /// there.
    #[getter]
    fn used_v<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        array(py, &self.0.frame.used)
    }

    /// What the solver got (V), `(n, n)`: the mean of the last frames as far as they stood still, less the baseline.
    #[getter]
    fn touch_v<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        array(py, &self.0.touch)
    }

    /// How many frames that is the mean of.
    #[getter]
    fn averaged(&self) -> u32 {
        self.0.averaged
    }

    /// What the solver found.
    #[getter]
    fn solution(&self, py: Python<'_>) -> Solution {
        Solution::new(py, self.0.solution.clone())
    }

    /// The contacts found: those of the solution.
    #[getter]
    fn contacts<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyList>> {
        contacts(py, &self.0.solution.contacts)
    }

    /// The same as a structured array, a row each.
    #[getter]
    fn array<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        contact_array(py, &self.0.solution.contacts)
    }

    /// This as the line of JSON of the program's `--stream`; with the image and the readings if they are wanted.
    #[pyo3(signature = (*, image = false, readings = false))]
    fn to_json(&self, image: bool, readings: bool) -> PyResult<String> {
        let all = self.0.report();
        let report = FrameReport {
            image_s_per_m2: all.image_s_per_m2.filter(|_| image),
            readings_v: all.readings_v.filter(|_| readings),
            used_v: all.used_v.filter(|_| readings),
            touch_v: all.touch_v.filter(|_| readings),
            ..all
        };
        serde_json::to_string(&report).map_err(raised)
    }

    fn __repr__(&self) -> String {
        let (sequence, count) = (self.0.frame.sequence, self.0.solution.contacts.len());
        format!("TouchEvent(sequence={sequence}, time_s={:.6}, {count} contacts)", self.0.frame.time_s())
    }
}
