//! `Solution` and what it is made of; names are those of the one schema, [`tactomo::schema`].

use numpy::{PyArray1, PyArrayDescr, PyArrayMethods, PyUntypedArray};
use pyo3::IntoPyObjectExt;
use pyo3::PyClass;
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::{PyCFunction, PyDict, PyList, PyTuple, PyType};
use tactomo::schema::{CONTACT_COLUMNS, ContactColumn, FrameReport, Kind, SHAPE_COLUMNS, TOTAL_COLUMNS, word};
use tactomo::solve::{
    Alternative, Calibrated, Choice, FoundContact as FoundDisc, FoundShape, Solution as Answer, Total as Summed,
};

use crate::error::{raised, refused};
use crate::pickle::{Restored, restored};

/// Numbers of a contact, in the order of the schema.
type ContactValues = [Option<f64>; CONTACT_COLUMNS.len()];
/// Numbers of a shape, likewise.
type ShapeValues = [Option<f64>; SHAPE_COLUMNS.len()];
/// What pickle keeps of a solution: contacts, shape and image; residual, certainty, `alternative` and `calibrated_m`; the choice; flags as JSON.
type SolutionState = (
    Vec<ContactValues>,
    Option<ShapeValues>,
    Option<Py<PyArray1<f32>>>,
    (Option<f64>, Option<f64>, Option<(usize, f64)>, Option<(f64, f64)>),
    Option<(String, String)>,
    String,
);

/// What a solver found in a frame.
#[pyclass(frozen, module = "tactomo")]
pub struct Solution {
    /// Without its image, which is an array of its own.
    answer: Answer,
    image: Option<Py<PyArray1<f32>>>,
}

impl Solution {
    /// An answer whose image, if it has one, becomes an array without a copy.
    pub fn new(py: Python<'_>, mut answer: Answer) -> Self {
        let image = answer.image_s_per_m2.take().map(|image| PyArray1::from_vec(py, image).unbind());
        Self { answer, image }
    }

    /// The answer again, with a copy of its image.
    pub fn answer(&self, py: Python<'_>) -> PyResult<Answer> {
        let image = self.image.as_ref().map(|image| image.bind(py).to_vec()).transpose()?;
        Ok(Answer { image_s_per_m2: image, ..self.answer.clone() })
    }
}

#[pymethods]
impl Solution {
    /// The contacts found; where a shape or an image is the answer, the contacts that would explain the readings best beside it.
    #[getter]
    fn contacts<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyList>> {
        contacts(py, &self.answer.contacts)
    }

    /// The same as a structured array, a row each; its fields are those of a contact, all float64, NaN where not known.
    #[getter]
    fn array<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        contact_array(py, &self.answer.contacts)
    }

    /// Contact conductance per area at each node of the solver's mesh (S/m2), `(nodes,)`, float32; `None` of a method without images.
    #[getter]
    fn image<'py>(&self, py: Python<'py>) -> Option<Bound<'py, PyArray1<f32>>> {
        self.image.as_ref().map(|image| image.bind(py).clone())
    }

    /// The one line or ring that explains the readings; `None` unless a solver that knows shapes chose one.
    #[getter]
    fn shape(&self) -> Option<Shape> {
        self.answer.shape.map(Shape)
    }

    /// Whether the contacts are the answer, not beside it: no shape and no image.
    #[getter]
    fn is_contacts(&self) -> bool {
        self.image.is_none() && self.answer.is_contacts()
    }

    /// What all that touches comes to: force, conductance, area, centre of pressure; `None` if nothing touches or the answer is an image.
    #[getter]
    fn total(&self) -> Option<Total> {
        Summed::of(&self.answer, None).map(Total)
    }

    /// How far the readings are from those of what was found: root mean square, in standard deviations of the noise; `None` of a method
    /// that predicts none.
    #[getter]
    fn residual(&self) -> Option<f64> {
        self.answer.residual
    }

    /// Probability that as many contacts touch as were found; of a method that weighs them.
    #[getter]
    fn certainty(&self) -> Option<f64> {
        self.answer.certainty
    }

    /// The likeliest other number of contacts and its probability, where that has 5 % at least.
    #[getter]
    fn alternative(&self) -> Option<(usize, f64)> {
        self.answer.alternative.map(|Alternative { contacts, certainty }| (contacts, certainty))
    }

    /// What to know before this is believed.
    #[getter]
    fn flags(&self) -> Flags {
        Flags::from(&self.answer.flags)
    }

    /// What was chosen, such as `2 contacts`, `line` or `image`, and why; of a solver that chooses.
    #[getter]
    fn choice(&self) -> Option<(String, String)> {
        self.answer.choice.as_ref().map(|choice| (choice.what.clone(), choice.why.clone()))
    }

    /// Standard errors of the least known contact's place (m) as it is now and after a calibration; where `flags.calibrate` asks for one.
    #[getter]
    fn calibrated_m(&self) -> Option<(f64, f64)> {
        self.answer.calibrated.map(|Calibrated { now_m, calibrated_m }| (now_m, calibrated_m))
    }

    /// This as the line of JSON that the program writes, without the image.
    fn to_json(&self) -> PyResult<String> {
        serde_json::to_string(&FrameReport::of(&self.answer)).map_err(raised)
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<Restored<'py, SolutionState>> {
        let Self { answer, image } = slf.get();
        let state = (
            answer.contacts.iter().map(contact_values).collect(),
            answer.shape.as_ref().map(shape_values),
            image.as_ref().map(|image| image.clone_ref(slf.py())),
            (answer.residual, answer.certainty, slf.get().alternative(), slf.get().calibrated_m()),
            slf.get().choice(),
            serde_json::to_string(&answer.flags).map_err(raised)?,
        );
        restored(slf, state)
    }

    #[classmethod]
    #[pyo3(signature = (*state))]
    fn _restored(_class: &Bound<'_, PyType>, state: &Bound<'_, PyTuple>) -> PyResult<Self> {
        let (contacts, shape, image, (residual, certainty, alternative, calibrated_m), choice, flags): SolutionState =
            state.extract()?;
        let answer = Answer {
            image_s_per_m2: None,
            contacts: contacts.into_iter().map(FoundDisc::of_values).collect(),
            shape: shape.and_then(FoundShape::of_values),
            residual,
            flags: serde_json::from_str(&flags).map_err(raised)?,
            calibrated: calibrated_m.map(|(now_m, calibrated_m)| Calibrated { now_m, calibrated_m }),
            certainty,
            alternative: alternative.map(|(contacts, certainty)| Alternative { contacts, certainty }),
            choice: choice.map(|(what, why)| Choice { what, why }),
        };
        Ok(Self { answer, image })
    }

    fn __repr__(&self) -> String {
        match &self.answer.choice {
            Some(choice) => format!("Solution({})", choice.what),
            None => format!("Solution({} contacts)", self.answer.contacts.len()),
        }
    }
}

/// Contacts as a list.
pub fn contacts<'py>(py: Python<'py>, found: &[FoundDisc]) -> PyResult<Bound<'py, PyList>> {
    PyList::new(py, found.iter().map(|contact| FoundContact(*contact)))
}

/// Contacts as a structured array.
pub fn contact_array<'py>(py: Python<'py>, found: &[FoundDisc]) -> PyResult<Bound<'py, PyAny>> {
    let values = found.iter().flat_map(|contact| CONTACT_COLUMNS.iter().map(|column| column.value(contact)));
    let values: Vec<f64> = values.map(|value| value.unwrap_or(f64::NAN)).collect();
    let array: Bound<'_, PyUntypedArray> = PyArray1::from_vec(py, values).cast_into()?;
    array.call_method1("view", (contact_dtype(py)?,))
}

/// The fields of a contact, all float64.
pub fn contact_dtype(py: Python<'_>) -> PyResult<Bound<'_, PyArrayDescr>> {
    static DTYPE: PyOnceLock<Py<PyArrayDescr>> = PyOnceLock::new();
    let named = || {
        let fields: Vec<_> = CONTACT_COLUMNS.iter().map(|column| (column.name, "f8")).collect();
        PyArrayDescr::new(py, fields).map(Bound::unbind)
    };
    Ok(DTYPE.get_or_try_init(py, named)?.bind(py).clone())
}

/// A contact that was found. Its attributes are the fields of `tactomo.CONTACT_FIELDS`; `None` where not known.
#[pyclass(frozen, module = "tactomo")]
pub struct FoundContact(FoundDisc);

impl FoundContact {
    /// Gives the class a property for each field of the schema.
    pub fn add_fields(class: &Bound<'_, PyAny>) -> PyResult<()> {
        CONTACT_COLUMNS.iter().try_for_each(|column| {
            add_property(class, column.name, column.what, |contact: &Bound<'_, Self>| {
                Ok(field(column, contact.get(), contact.py())?.unbind())
            })
        })
    }
}

/// Gives a class a property, which is computed from an object of that class.
fn add_property<T: PyClass>(
    class: &Bound<'_, PyAny>,
    name: &str,
    what: &str,
    of: impl Fn(&Bound<'_, T>) -> PyResult<Py<PyAny>> + Send + Sync + 'static,
) -> PyResult<()> {
    let py = class.py();
    let get = move |arguments: &Bound<'_, PyTuple>, _: Option<&Bound<'_, PyDict>>| -> PyResult<Py<PyAny>> {
        of(&arguments.get_item(0)?.cast_into()?)
    };
    let get = PyCFunction::new_closure(py, None, None, get)?;
    let property = py.import("builtins")?.getattr("property")?;
    class.setattr(name, property.call1((get, py.None(), py.None(), what))?)
}

fn field<'py>(column: &ContactColumn, contact: &FoundContact, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
    let value = column.value(&contact.0);
    match column.kind {
        Kind::Integer => value.map(|value| value as i64).into_bound_py_any(py),
        Kind::Flag => value.map(|value| value != 0.0).into_bound_py_any(py),
        Kind::Number => value.into_bound_py_any(py),
        Kind::Word(words) => value.map(|value| word(words, value)).into_bound_py_any(py),
    }
}

fn contact_values(contact: &FoundDisc) -> ContactValues {
    CONTACT_COLUMNS.each_ref().map(|column| column.value(contact))
}

fn shape_values(shape: &FoundShape) -> ShapeValues {
    SHAPE_COLUMNS.each_ref().map(|column| column.value(shape))
}

#[pymethods]
impl FoundContact {
    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<Restored<'py, (ContactValues,)>> {
        restored(slf, (contact_values(&slf.get().0),))
    }

    #[classmethod]
    fn _restored(_class: &Bound<'_, PyType>, values: ContactValues) -> Self {
        Self(FoundDisc::of_values(values))
    }

    fn __repr__(&self) -> PyResult<String> {
        Ok(format!("FoundContact({})", serde_json::to_string(&self.0).map_err(raised)?))
    }
}

/// What all that touches comes to. Its attributes are `force_n`, `conductance_s`, `area_m2`, `x_m`, `y_m` and `z_m`; `None` where not known.
#[pyclass(frozen, module = "tactomo")]
pub struct Total(Summed);

impl Total {
    /// Gives the class a property for each field of the schema.
    pub fn add_fields(class: &Bound<'_, PyAny>) -> PyResult<()> {
        TOTAL_COLUMNS.iter().try_for_each(|column| {
            let name = column.name.trim_start_matches("total_");
            add_property(class, name, "Of all that touches; None where not known.", |total: &Bound<'_, Self>| {
                Ok(column.value(&total.get().0).into_bound_py_any(total.py())?.unbind())
            })
        })
    }
}

#[pymethods]
impl Total {
    fn __repr__(&self) -> PyResult<String> {
        Ok(format!("Total({})", serde_json::to_string(&self.0).map_err(raised)?))
    }
}

/// A line or a ring that was found. Beside `kind`, its attributes are `from_x_m`, `from_y_m`, `to_x_m`, `to_y_m` of a line, `x_m`, `y_m`,
/// `radius_m` of a ring, `width_m` and `conductance_s` of both, and `sigma_` with each name for its standard error; `None` where not known.
#[pyclass(frozen, module = "tactomo")]
pub struct Shape(pub FoundShape);

impl Shape {
    /// Gives the class a property for each field of the schema.
    pub fn add_fields(class: &Bound<'_, PyAny>) -> PyResult<()> {
        SHAPE_COLUMNS.iter().try_for_each(|column| {
            let name = column.name.trim_start_matches("shape_");
            add_property(class, name, "Of a line or a ring; None where not known.", |shape: &Bound<'_, Self>| {
                Ok(column.value(&shape.get().0).into_bound_py_any(shape.py())?.unbind())
            })
        })
    }
}

#[pymethods]
impl Shape {
    /// `line` or `ring`.
    #[getter]
    fn kind(&self) -> &'static str {
        self.0.name()
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<Restored<'py, (ShapeValues,)>> {
        restored(slf, (shape_values(&slf.get().0),))
    }

    #[classmethod]
    fn _restored(_class: &Bound<'_, PyType>, values: ShapeValues) -> PyResult<Self> {
        FoundShape::of_values(values).map(Self).ok_or_else(|| refused("these are no numbers of a shape"))
    }

    fn __repr__(&self) -> PyResult<String> {
        Ok(format!("Shape({})", serde_json::to_string(&self.0).map_err(raised)?))
    }
}

/// What to know before a solution is believed.
#[pyclass(frozen, get_all, module = "tactomo")]
pub struct Flags {
    /// Readings are at an end of the converter's range, or contacts conduct so well that more would change nothing.
    saturated: bool,
    /// The readings are not what the model can give for what was found.
    misfit: bool,
    /// The method stopped before its end.
    unfinished: bool,
    /// The readings are those of a detector that differs from the one described: a calibration would tell more.
    calibrate: bool,
    /// Electrodes that were left out.
    excluded: Vec<usize>,
    /// What is wrong with each of those: `open`, `shorted`, `exchanged` or `contradicting`.
    faults: Vec<&'static str>,
}

impl From<&tactomo::solve::Flags> for Flags {
    fn from(flags: &tactomo::solve::Flags) -> Self {
        let tactomo::solve::Flags { saturated, misfit, unfinished, calibrate, excluded, faults } = flags;
        Self {
            saturated: *saturated,
            misfit: *misfit,
            unfinished: *unfinished,
            calibrate: *calibrate,
            excluded: excluded.clone(),
            faults: faults.iter().map(|fault| fault.name()).collect(),
        }
    }
}

#[pymethods]
impl Flags {
    fn __repr__(&self) -> String {
        let set = [
            (self.saturated, "saturated"),
            (self.misfit, "misfit"),
            (self.unfinished, "unfinished"),
            (self.calibrate, "calibrate"),
        ];
        let mut set: Vec<String> =
            set.iter().filter(|(is_set, _)| *is_set).map(|(_, name)| (*name).to_owned()).collect();
        let left_out = self.excluded.iter().zip(&self.faults);
        set.extend(left_out.map(|(electrode, fault)| format!("electrode {electrode} left out ({fault})")));
        format!("Flags({})", set.join(", "))
    }
}
