//! `Solutions`: what was found in many frames, as arrays.

use numpy::{PyArray1, PyArray2, PyUntypedArray};
use pyo3::exceptions::PyIndexError;
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::{PyRange, PyType};
use tactomo::schema::CONTACT_COLUMNS;
use tactomo::solve::{Flags, Solution as Answer};

use crate::array::square;
use crate::pickle::{Restored, restored};
use crate::solution::{Solution, contact_dtype};

/// A flag: its name, and whether it is set.
pub type Flag = (&'static str, fn(&Flags) -> bool);

/// Flags of `Solutions.flags`.
pub const FLAGS: [Flag; 4] = [
    ("saturated", |flags| flags.saturated),
    ("misfit", |flags| flags.misfit),
    ("unfinished", |flags| flags.unfinished),
    ("calibrate", |flags| flags.calibrate),
];

/// What a solver found in many frames: a sequence of `Solution`s, and arrays of what is in them.
///
/// >>> found = Solver("contacts").solve_many(Simulator(Detector()).readings([Contact(0.01, 0, 0.003, 2e-4)])[None])
/// >>> found.count, found.array["x_m"].shape
/// (array([1]), (1, 1))
#[pyclass(frozen, sequence, module = "tactomo")]
pub struct Solutions {
    pub answers: Vec<Answer>,
    array: PyOnceLock<Py<PyAny>>,
    images: PyOnceLock<Option<Py<PyArray2<f32>>>>,
}

impl Solutions {
    /// Those of frames, in their order.
    pub fn new(answers: Vec<Answer>) -> Self {
        Self { answers, array: PyOnceLock::new(), images: PyOnceLock::new() }
    }

    /// Most contacts of a frame.
    fn most(&self) -> usize {
        self.answers.iter().map(|answer| answer.contacts.len()).max().unwrap_or_default()
    }

    fn made_array<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let most = self.most();
        let contacts = |answer: &Answer| {
            let found =
                answer.contacts.iter().flat_map(|contact| CONTACT_COLUMNS.iter().map(|column| column.value(contact)));
            let found: Vec<_> = found.map(|value| value.unwrap_or(f64::NAN)).collect();
            let none = vec![f64::NAN; most * CONTACT_COLUMNS.len() - found.len()];
            [found, none].concat()
        };
        let values: Vec<f64> = self.answers.iter().flat_map(contacts).collect();
        let array: Bound<'_, PyUntypedArray> = PyArray1::from_vec(py, values).cast_into()?;
        array.call_method1("view", (contact_dtype(py)?,))?.call_method1("reshape", (self.answers.len(), most))
    }

    fn made_images(&self, py: Python<'_>) -> PyResult<Option<Py<PyArray2<f32>>>> {
        let images = || self.answers.iter().map(|answer| answer.image_s_per_m2.as_ref());
        let Some(nodes) = images().flatten().map(Vec::len).next() else { return Ok(None) };
        let nothing = vec![f32::NAN; nodes];
        let all: Vec<f32> = images().flat_map(|image| image.unwrap_or(&nothing).iter().copied()).collect();
        Ok(Some(square(py, all, nodes)?.unbind()))
    }

    fn numbers<'py>(&self, py: Python<'py>, of: fn(&Answer) -> Option<f64>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_iter(py, self.answers.iter().map(|answer| of(answer).unwrap_or(f64::NAN)))
    }
}

#[pymethods]
impl Solutions {
    fn __len__(&self) -> usize {
        self.answers.len()
    }

    fn __getitem__(&self, py: Python<'_>, index: isize) -> PyResult<Solution> {
        let from_start = if index < 0 { index.checked_add_unsigned(self.answers.len()) } else { Some(index) };
        let from_start = from_start.and_then(|index| usize::try_from(index).ok());
        let answer = from_start.and_then(|index| self.answers.get(index));
        let answer = answer
            .ok_or_else(|| PyIndexError::new_err(format!("there is no frame {index} among {}", self.answers.len())))?;
        Ok(Solution::new(py, answer.clone()))
    }

    fn __iter__<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        let indices = PyRange::new(slf.py(), 0, slf.len()?.try_into()?)?;
        slf.py().import("builtins")?.getattr("map")?.call1((slf.getattr("__getitem__")?, indices))
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<Restored<'py, (Vec<Solution>,)>> {
        let answers = &slf.get().answers;
        restored(slf, (answers.iter().map(|answer| Solution::new(slf.py(), answer.clone())).collect(),))
    }

    #[classmethod]
    fn _restored(class: &Bound<'_, PyType>, solutions: Vec<PyRef<'_, Solution>>) -> PyResult<Self> {
        let answers = solutions.iter().map(|solution| solution.answer(class.py()));
        Ok(Self::new(answers.collect::<PyResult<_>>()?))
    }

    /// Contacts of each frame, `(frames,)`.
    #[getter]
    pub fn count<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<i64>> {
        PyArray1::from_iter(py, self.answers.iter().map(|answer| answer.contacts.len() as i64))
    }

    /// The contacts of all frames as a structured array `(frames, most contacts of a frame)`: the fields of `tactomo.CONTACT_FIELDS`, all
    /// float64, NaN where not known and where a frame has fewer contacts. `array["x_m"][frame, contact]`.
    #[getter]
    pub fn array<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        Ok(self.array.get_or_try_init(py, || self.made_array(py).map(Bound::unbind))?.bind(py).clone())
    }

    /// How far the readings of each frame are from those of what was found, `(frames,)`: root mean square, in standard deviations of the
    /// noise; NaN of a method that predicts none.
    #[getter]
    pub fn residual<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.numbers(py, |answer| answer.residual)
    }

    /// Probability that as many contacts touch as were found in each frame, `(frames,)`; NaN where none is told.
    #[getter]
    pub fn certainty<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.numbers(py, |answer| answer.certainty)
    }

    /// What to know before each frame is believed: a structured array `(frames,)` of booleans `saturated`, `misfit`, `unfinished` and
    /// `calibrate`, as in `Solution.flags`.
    #[getter]
    pub fn flags<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let set = self.answers.iter().flat_map(|answer| FLAGS.iter().map(|(_, is_set)| is_set(&answer.flags)));
        let array: Bound<'_, PyUntypedArray> = PyArray1::from_vec(py, set.collect()).cast_into()?;
        array.call_method1("view", (FLAGS.map(|(name, _)| (name, "?")).to_vec(),))
    }

    /// Images of all frames on the nodes of the solver's mesh (S/m2), `(frames, nodes)`, float32; NaN of a frame without one, `None` where
    /// no frame has one.
    #[getter]
    pub fn images<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyArray2<f32>>>> {
        let images = self.images.get_or_try_init(py, || self.made_images(py))?;
        Ok(images.as_ref().map(|images| images.bind(py).clone()))
    }

    fn __repr__(&self) -> String {
        let contacts: usize = self.answers.iter().map(|answer| answer.contacts.len()).sum();
        format!("Solutions({} frames, {contacts} contacts)", self.answers.len())
    }
}
