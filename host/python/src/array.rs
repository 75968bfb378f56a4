//! Arrays on their way in and out.

use numpy::{PyArray1, PyArray2, PyArrayMethods, PyReadonlyArrayDyn};
use pyo3::prelude::*;
use tactomo::detector::Detector;
use tactomo::readings::{Likely, Readings, check_volts};

use crate::error::refused;

/// Refuses readings that cannot be volts of a detector, with what they may be.
pub fn require_volts<'a>(all: impl IntoIterator<Item = &'a Readings>, detector: &Detector) -> PyResult<()> {
    let volts = all.into_iter().flat_map(|readings| readings.volts().iter().copied());
    check_volts(volts, detector).map_err(|error| {
        refused(match error.likely {
            Likely::Millivolts => format!("{error} Divide them by 1000"),
            Likely::Codes => format!("{error} Convert them to volts"),
        })
    })
}

/// Readings of a frame: an array `(n, n)` or `(n * n,)` (V).
pub fn of_array(array: &PyReadonlyArrayDyn<'_, f64>) -> PyResult<Readings> {
    let view = array.as_array();
    // Of the view: numpy's own slice is in the order of the memory, which may be by columns.
    let volts = view.as_slice().map_or_else(|| view.iter().copied().collect(), <[f64]>::to_vec);
    let electrodes = match *view.shape() {
        [grounded, read] if grounded == read => grounded,
        [count] => count.isqrt(),
        _ => 0,
    };
    Readings::new(electrodes, volts).ok_or_else(|| {
        refused(format!(
            "an array of {} is no frame: `electrodes x electrodes` readings (V) are needed, a row for each grounded electrode",
            sides(view.shape())
        ))
    })
}

/// The shape of an array in words: `16 x 15`.
pub fn sides(shape: &[usize]) -> String {
    if shape.is_empty() {
        return "one number".to_owned();
    }
    shape.iter().map(usize::to_string).collect::<Vec<_>>().join(" x ")
}

/// Numbers as an array `(rows, columns)`, without a copy of them; `columns` divides their number.
pub fn square<T: numpy::Element>(py: Python<'_>, values: Vec<T>, columns: usize) -> PyResult<Bound<'_, PyArray2<T>>> {
    let rows = values.len().checked_div(columns).unwrap_or_default();
    PyArray1::from_vec(py, values).reshape([rows, columns])
}

/// Places (m) as an array `(places, N)`.
pub fn places<const N: usize>(
    py: Python<'_>,
    places_m: impl IntoIterator<Item = [f64; N]>,
) -> PyResult<Bound<'_, PyArray2<f64>>> {
    square(py, places_m.into_iter().flatten().collect(), N)
}
