//! `TouchEvent`: what an answered frame gave.

use std::sync::Arc;

use numpy::PyArray2;
use pyo3::prelude::*;
use pyo3::types::PyList;
use tactomo::changes::Changed;
use tactomo::readings::Readings;
use tactomo::run::TouchEvent as Answered;
use tactomo::schema::FrameReport;
use tactomo::solve::Solution as Answer;

use crate::error::raised;
use crate::forward::array;
use crate::solution::{Solution, contact_array, contacts};

/// What an answered frame gave; names are those of the program's `--stream`.
#[pyclass(frozen, module = "tactomo")]
pub struct TouchEvent {
    pub event: Arc<Answered>,
    /// Its contacts, with what they have done since the event that was taken before.
    pub changed: Changed,
}

impl TouchEvent {
    /// What the solver got (V).
    pub fn touch(&self) -> &Readings {
        &self.event.touch
    }
}

#[pymethods]
impl TouchEvent {
    /// Number of the scan since the board started.
    #[getter]
    fn sequence(&self) -> u64 {
        self.event.frame.sequence
    }

    /// Board time in the middle of the scan (s).
    #[getter]
    fn time_s(&self) -> f64 {
        self.event.frame.time_s()
    }

    /// When the frame's last byte came, by this machine's clock (s since 1970).
    #[getter]
    fn arrived_unix_s(&self) -> f64 {
        self.event.frame.arrived.unix_ns as f64 * 1e-9
    }

    /// When the middle of the scan was, by this machine's clock (ns since 1970); `None` if the board's clock is not known.
    #[getter]
    fn host_time_ns(&self) -> Option<u64> {
        self.event.frame.scanned().map(|scanned| scanned.unix_ns)
    }

    /// How far that is from the truth at most (ns).
    #[getter]
    fn host_time_error_ns(&self) -> Option<u64> {
        self.event.frame.scanned().map(|scanned| scanned.error_ns)
    }

    /// Age of the answer when it was ready: since the frame's last byte came (us); `None` of a frame from a file.
    #[getter]
    fn age_us(&self) -> Option<f64> {
        self.event.age.map(|age| age.as_secs_f64() * 1e6)
    }

    /// Frames that the link or the board lost since the event before.
    #[getter]
    fn lost_before(&self) -> u64 {
        self.event.lost_before
    }

    /// Whether this is a better answer to the frame of the event before.
    #[getter]
    fn revised(&self) -> bool {
        self.event.is_revision
    }

    /// Whether the baseline is being taken, so that less is known of touch.
    #[getter]
    fn rezeroing(&self) -> bool {
        self.event.is_taking_baseline
    }

    /// Readings as measured (V), `(n, n)`: `readings_v[g][e]` is electrode `e` while `g` is grounded.
    #[getter]
    fn readings_v<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        array(py, &self.event.frame.measured)
    }

    /// The same as they are used (V), `(n, n)`: a reading within two deviations of the noise of an end of its converter's range is the bound
    /// there.
    #[getter]
    fn used_v<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        array(py, &self.event.frame.used)
    }

    /// What the solver got (V), `(n, n)`: the mean of the last frames as far as they stood still, less the baseline.
    #[getter]
    fn touch_v<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        array(py, &self.event.touch)
    }

    /// How many frames that is the mean of.
    #[getter]
    fn averaged(&self) -> u32 {
        self.event.averaged
    }

    /// What the solver found.
    #[getter]
    fn solution(&self, py: Python<'_>) -> Solution {
        Solution::new(py, Answer { contacts: self.changed.contacts.clone(), ..self.event.solution.clone() })
    }

    /// The contacts found: those of the solution.
    #[getter]
    fn contacts<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyList>> {
        contacts(py, &self.changed.contacts)
    }

    /// The same as a structured array, a row each.
    #[getter]
    fn array<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        contact_array(py, &self.changed.contacts)
    }

    /// Numbers of the contacts that the event taken before this had, and this has no more.
    #[getter]
    fn ended(&self) -> Vec<u32> {
        self.changed.ended.clone()
    }

    /// This as the line of JSON of the program's `--stream`; with the image and the readings if they are wanted.
    #[pyo3(signature = (*, image = false, readings = false))]
    fn to_json(&self, image: bool, readings: bool) -> PyResult<String> {
        let all = self.event.report();
        let report = FrameReport {
            contacts: &self.changed.contacts,
            ended: &self.changed.ended,
            image_s_per_m2: all.image_s_per_m2.filter(|_| image),
            readings_v: all.readings_v.filter(|_| readings),
            used_v: all.used_v.filter(|_| readings),
            touch_v: all.touch_v.filter(|_| readings),
            ..all
        };
        serde_json::to_string(&report).map_err(raised)
    }

    fn __repr__(&self) -> String {
        let (sequence, count) = (self.event.frame.sequence, self.event.solution.contacts.len());
        format!("TouchEvent(sequence={sequence}, time_s={:.6}, {count} contacts)", self.event.frame.time_s())
    }
}
