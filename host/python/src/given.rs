//! Readings in whichever form they are given.

use numpy::{AllowTypeChange, PyArrayDyn, PyArrayLikeDyn, PyArrayMethods, PyUntypedArray, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::types::{PyIterator, PyList};
use tactomo::detector::Detector;
use tactomo::readings::Readings;
use tactomo::solve::check;

use crate::array::{of_array, require_volts, sides};
use crate::error::{raised, refused};
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

/// Whatever numbers are given as the argument `name`, as an array.
pub fn array<'py>(name: &str, given: &Bound<'py, PyAny>) -> PyResult<PyArrayLikeDyn<'py, f64, AllowTypeChange>> {
    given.extract().map_err(|error: PyErr| refused(format!("{name}: numbers are needed: {}", error.value(given.py()))))
}

/// Numbers of the argument `name`, `(count,)`.
pub fn numbers(name: &str, given: &Bound<'_, PyAny>) -> PyResult<Vec<f64>> {
    let array = array(name, given)?;
    let view = array.as_array();
    match view.shape() {
        [_] => Ok(view.iter().copied().collect()),
        shape => Err(refused(format!("{name}: a list of numbers is needed, but it is an array of {}", sides(shape)))),
    }
}

/// Places of the argument `places_m`, `(places, N)`, or `(places, 2)` whose other coordinates are zero (m).
pub fn places<const N: usize>(given: &Bound<'_, PyAny>) -> PyResult<Vec<[f64; N]>> {
    let array = array("places_m", given)?;
    let view = array.as_array();
    let columns = match *view.shape() {
        [_, columns] if columns == 2 || columns == N => columns,
        ref shape => {
            let or_more = if N == 2 { String::new() } else { format!(" or (presses, {N})") };
            return Err(refused(format!(
                "places_m: an array (presses, 2){or_more} is needed, from the middle of the sensor (m), but it is one of {}",
                sides(shape)
            )));
        }
    };
    let all: Vec<f64> = view.iter().copied().collect();
    let place = |row: &[f64]| std::array::from_fn(|axis| row.get(axis).copied().unwrap_or_default());
    Ok(all.chunks_exact(columns).map(place).collect())
}

/// Frames of a detector's readings: an array `(frames, n, n)` or `(frames, n * n)`, or any iterable of what [`readings`] takes.
///
/// What cannot be readings of that detector is refused by the index of its frame, before anything is computed.
pub fn frames(given: &Bound<'_, PyAny>, detector: &Detector) -> PyResult<Vec<Readings>> {
    require_frames(given, detector.electrodes.len())?;
    let named = |index: usize, error: PyErr| refused(format!("frames[{index}]: {}", error.value(given.py())));
    let mut all = Vec::new();
    for (index, frame) in each(given)?.enumerate() {
        let readings = readings(&frame?).map_err(|error| named(index, error))?;
        check(&readings, detector.electrodes.len()).map_err(|error| named(index, raised(error)))?;
        all.push(readings);
    }
    require_volts(&all, detector)?;
    Ok(all)
}

/// Frames, and when they were measured.
pub struct Given {
    /// Readings (V).
    pub readings: Vec<Readings>,
    /// Of a recording, whose frames follow each other: the time of each (s).
    pub times_s: Option<Vec<f64>>,
}

/// What [`frames`] takes; with times where all are frames of a recording.
pub fn timed(given: &Bound<'_, PyAny>, detector: &Detector) -> PyResult<Given> {
    require_frames(given, detector.electrodes.len())?;
    // An iterator gives them once.
    let all = each(given)?.collect::<PyResult<Vec<_>>>()?;
    let time_s = |frame: &Bound<'_, PyAny>| Some(frame.cast::<Frame>().ok()?.get().time_s());
    let times_s: Option<Vec<f64>> = all.iter().map(time_s).collect();
    let readings = frames(PyList::new(given.py(), all)?.as_any(), detector)?;
    Ok(Given { readings, times_s: times_s.filter(|times_s| !times_s.is_empty()) })
}

fn each<'py>(given: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyIterator>> {
    given
        .try_iter()
        .map_err(|error| refused(format!("frames: an array or a list is needed: {}", error.value(given.py()))))
}

/// Refuses an array whose rows are no frames: a single frame, above all.
fn require_frames(given: &Bound<'_, PyAny>, electrodes: usize) -> PyResult<()> {
    let Ok(array) = given.cast::<PyUntypedArray>() else { return Ok(()) };
    match *array.shape() {
        [_, grounded, read] if grounded == electrodes && read == electrodes => Ok(()),
        [_, readings] if readings == electrodes * electrodes => Ok(()),
        // Of objects, which may be frames.
        [_] => Ok(()),
        ref shape => Err(refused(format!(
            "frames: an array of frames x {electrodes} x {electrodes} is needed (V), but it is one of {}{}",
            sides(shape),
            if *shape == [electrodes, electrodes] { ": one frame is frames[numpy.newaxis]" } else { "" }
        ))),
    }
}
