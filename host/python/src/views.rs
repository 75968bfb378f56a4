//! Views of what was found and measured for pandas and xarray, which are imported where they are asked for and needed nowhere else.

use numpy::PyArray1;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};
use tactomo::schema::{CONTACT_COLUMNS, Kind, word};

use crate::recording::Recording;
use crate::solutions::{FLAGS, Solutions};

/// Names of the axes of `Recording.to_xarray`.
const READINGS: [&str; 3] = ["frame", "ground", "electrode"];

#[pymethods]
impl Solutions {
    /// A `pandas.DataFrame` with a row for each contact: its index is `(frame, contact)`, its columns are those of `tactomo.CONTACT_FIELDS`,
    /// each of its own kind, also where nothing is known: numbers, `Int64`, `boolean` or `string`. Needs pandas.
    fn to_pandas<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let pandas = py.import("pandas")?;
        let contacts = || self.answers.iter().flat_map(|answer| &answer.contacts);
        let frames = self.answers.iter().enumerate();
        let index = frames.flat_map(|(frame, answer)| (0..answer.contacts.len()).map(move |contact| (frame, contact)));
        let (frames, numbers): (Vec<i64>, Vec<i64>) =
            index.map(|(frame, contact)| (frame as i64, contact as i64)).unzip();
        let axes = PyList::new(py, [PyArray1::from_vec(py, frames), PyArray1::from_vec(py, numbers)])?;
        let names = PyDict::new(py);
        names.set_item("names", ("frame", "contact"))?;
        let index = pandas.getattr("MultiIndex")?.call_method("from_arrays", (axes,), Some(&names))?;
        let columns = PyDict::new(py);
        for column in &CONTACT_COLUMNS {
            let values = || contacts().map(|contact| column.value(contact));
            let numbers = || PyArray1::from_iter(py, values().map(|value| value.unwrap_or(f64::NAN)));
            // Of pandas' own kinds, which know what is not known: so a column keeps its kind where nothing is.
            let (values, kind) = match column.kind {
                Kind::Number => (numbers().into_any(), "float64"),
                Kind::Integer => (numbers().into_any(), "Int64"),
                Kind::Flag => (numbers().into_any(), "boolean"),
                Kind::Word(words) => {
                    let words = values().map(|value| value.map(|value| word(words, value)));
                    (PyList::new(py, words.collect::<Vec<_>>())?.into_any(), "string")
                }
            };
            columns.set_item(column.name, pandas.getattr("array")?.call1((values, kind))?)?;
        }
        pandas.getattr("DataFrame")?.call1((columns, index))
    }

    /// An `xarray.Dataset` of `array`, `(frame, contact)`, with `count`, `residual`, `certainty` and each flag, `(frame,)`, and `image`,
    /// `(frame, node)`, where there are images. Needs xarray.
    fn to_xarray<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let (array, flags) = (self.array(py)?, self.flags(py)?);
        let variables = PyDict::new(py);
        for column in &CONTACT_COLUMNS {
            variables.set_item(column.name, (("frame", "contact"), array.get_item(column.name)?))?;
        }
        variables.set_item("count", ("frame", self.count(py)))?;
        variables.set_item("residual", ("frame", self.residual(py)))?;
        variables.set_item("certainty", ("frame", self.certainty(py)))?;
        for (name, _) in FLAGS {
            variables.set_item(name, ("frame", flags.get_item(name)?))?;
        }
        if let Some(images) = self.images(py)? {
            variables.set_item("image", (("frame", "node"), images))?;
        }
        dataset(py, variables, PyDict::new(py))
    }
}

#[pymethods]
impl Recording {
    /// An `xarray.Dataset` of `arrays()`: `readings_v` and `used_v`, `(frame, ground, electrode)`, with the coordinates `time_s`, `sequence`
    /// and `lost_before`, `(frame,)`. Needs xarray.
    fn to_xarray<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let (arrays, variables, coordinates) = (self.arrays(py)?, PyDict::new(py), PyDict::new(py));
        for (name, array) in arrays {
            match array.getattr("ndim")?.extract::<usize>()? == 1 {
                true => coordinates.set_item(name, ("frame", array))?,
                false => variables.set_item(name, (READINGS, array))?,
            }
        }
        dataset(py, variables, coordinates)
    }
}

fn dataset<'py>(
    py: Python<'py>,
    variables: Bound<'py, PyDict>,
    coordinates: Bound<'py, PyDict>,
) -> PyResult<Bound<'py, PyAny>> {
    py.import("xarray")?.getattr("Dataset")?.call1((variables, coordinates))
}
