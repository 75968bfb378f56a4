//! Readings in whichever form they are given.

use numpy::{AllowTypeChange, PyArrayDyn, PyArrayLikeDyn, PyArrayMethods};
use pyo3::prelude::*;
use tactomo::readings::Readings;

use crate::array::of_array;
use crate::live::TouchEvent;
use crate::recording::Frame;

/// Readings of a frame: an array `(n, n)` or `(n * n,)` of whatever numbers (V), or a frame or an event that has some.
pub fn readings(given: &Bound<'_, PyAny>) -> PyResult<Readings> {
    if let Ok(array) = given.cast::<PyArrayDyn<f64>>() {
        return of_array(&array.try_readonly()?);
    }
    if let Ok(frame) = given.cast::<Frame>() {
        return Ok(frame.get().readings().clone());
    }
    if let Ok(event) = given.cast::<TouchEvent>() {
        return Ok(event.get().touch().clone());
    }
    let array: PyArrayLikeDyn<'_, f64, AllowTypeChange> = given.extract()?;
    of_array(&array)
}

/// Frames of readings: an array `(frames, n, n)`, `(frames, n * n)`, or a list of what [`readings`] takes.
pub fn frames(given: &Bound<'_, PyAny>) -> PyResult<Vec<Readings>> {
    given.try_iter()?.map(|frame| readings(&frame?)).collect()
}
