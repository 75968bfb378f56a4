//! `Detector`: what is pressed.

use std::path::PathBuf;

use numpy::PyArray2;
use pyo3::prelude::*;
use pyo3::types::PyType;
use tactomo::detector::{Chosen, Detector as Described, Stack};
use tactomo::simulate;

use crate::array;
use crate::error::raised;
use crate::file::write_new;
use crate::pickle::{Restored, restored};

/// A detection layer with its electrodes and the circuit that measures it.
///
/// `name` is that of a preset (`Detector.presets()`) or the path of a TOML file, as for `--detector` of the program.
/// Coordinates are metres from the middle of the outline, z up from the electrode side.
///
/// >>> Detector("square-60").electrodes_m.shape
/// (16, 3)
#[pyclass(frozen, eq, module = "tactomo")]
#[derive(Clone, PartialEq)]
pub struct Detector(pub Described);

#[pymethods]
impl Detector {
    #[new]
    #[pyo3(signature = (name = PathBuf::from(Described::DEFAULT)), text_signature = "(name='square-60')")]
    fn new(name: PathBuf) -> PyResult<Self> {
        let chosen = match name.to_str() {
            Some(name) => name.parse().map_err(raised)?,
            None => Chosen::File(name),
        };
        Ok(Self(chosen.get().map_err(raised)?))
    }

    /// A detector from the text of a TOML file (docs/detector.md); `name` where the text has none.
    #[staticmethod]
    #[pyo3(signature = (text, name = "detector"))]
    fn from_toml(text: &str, name: &str) -> PyResult<Self> {
        Ok(Self(Described::from_toml(text, name).map_err(raised)?))
    }

    /// Names of the presets.
    #[staticmethod]
    fn presets() -> Vec<&'static str> {
        Described::preset_names().collect()
    }

    /// This detector as the text of a TOML file.
    fn to_toml(&self) -> String {
        self.0.to_toml()
    }

    /// Writes it to a new TOML file, for `Detector(path)` and `--detector`, and the surface of a curved one beside it as OBJ; a file
    /// that exists is not replaced.
    fn save(&self, path: PathBuf) -> PyResult<()> {
        let stem = path.file_stem().map(|stem| stem.to_string_lossy().into_owned()).unwrap_or_default();
        let (text, surface) = self.0.to_files(&stem);
        write_new(&path, text.as_bytes())?;
        surface.map_or(Ok(()), |(name, obj)| write_new(&path.with_file_name(name), obj.as_bytes()))
    }

    /// A detector as it may have been built by this description: each quantity off by its tolerance, drawn with `seed`. It is what a
    /// simulation should be of; a solver knows the description alone.
    fn as_built(&self, seed: u64) -> PyResult<Self> {
        Ok(Self(simulate::try_drawn(&self.0, seed).map_err(raised)?))
    }

    /// This detector in another foam of the paper, `"A"` to `"D"`, or in a stack of them such as `"BC"`, B above C.
    fn in_material(&self, material: &str) -> PyResult<Self> {
        let stack: Stack = material.parse().map_err(raised)?;
        Ok(Self(self.0.clone().in_material(&stack).map_err(raised)?))
    }

    /// This detector with its description taken as exact: there is nothing to correct then.
    fn taken_as_exact(&self) -> Self {
        Self(self.0.taken_as_exact())
    }

    /// Name of the preset or file.
    #[getter]
    fn name(&self) -> &str {
        &self.0.name
    }

    /// Width and height of the outline's bounding box (m).
    #[getter]
    fn size_m(&self) -> (f64, f64) {
        self.0.outline.size_m().into()
    }

    /// Corners of the outline (m), counter-clockwise: `(corners, 2)`.
    #[getter]
    fn outline_m<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        array::places(py, self.0.outline.outer.iter().copied())
    }

    /// Thickness of all layers together (m).
    #[getter]
    fn thickness_m(&self) -> f64 {
        self.0.thickness_m()
    }

    /// Conductivity integrated over the thickness (S per square): the natural unit of contact conductance.
    #[getter]
    fn sheet_conductance_s(&self) -> f64 {
        self.0.sheet_conductance_s()
    }

    /// Number of electrodes; a frame has `electrodes x electrodes` readings.
    #[getter]
    fn electrodes(&self) -> usize {
        self.0.electrodes.len()
    }

    /// Centres of the electrodes (m) in the order of the channels: `(electrodes, 3)`.
    #[getter]
    fn electrodes_m<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        array::places(py, self.0.electrodes.iter().map(|pad| pad.place_m()))
    }

    /// Voltage of the driving layer (V).
    #[getter]
    fn drive_v(&self) -> f64 {
        self.0.drive_v
    }

    /// Standard deviation of a reading by the converter's noise and rounding (V).
    #[getter]
    fn noise_v(&self) -> f64 {
        self.0.adc.deviation_v()
    }

    /// Whether contacts on it carry newtons.
    #[getter]
    fn has_newtons(&self) -> bool {
        self.0.force.is_some()
    }

    /// Pickled as its TOML, with the surface of a curved one as OBJ.
    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<Restored<'py, (String, Option<String>)>> {
        let detector = &slf.get().0;
        restored(slf, (detector.to_toml(), detector.surface.as_ref().map(|surface| surface.to_obj())))
    }

    #[classmethod]
    fn _restored(_class: &Bound<'_, PyType>, toml: &str, obj: Option<&str>) -> PyResult<Self> {
        let detector = match obj {
            None => Described::from_toml(toml, Described::DEFAULT),
            Some(obj) => Described::from_toml_and_obj(toml, obj, Described::DEFAULT),
        };
        Ok(Self(detector.map_err(raised)?))
    }

    fn __repr__(&self) -> String {
        let [width_m, height_m] = self.0.outline.size_m().map(|side_m| side_m * 1e3);
        let (name, electrodes) = (&self.0.name, self.0.electrodes.len());
        format!("Detector({name:?}: {width_m:.4} x {height_m:.4} mm, {electrodes} electrodes)")
    }
}
