//! The Python package `tactomo`: detectors, solvers, recordings and live boards for Python.
//!
//! Each class is a thin one over the library's type; names are those of the library and of its one schema. Whatever computes or waits lets
//! other threads of Python run meanwhile. What is documented here is what Python's `help` shows; types are in `python/tactomo/_tactomo.pyi`.

mod array;
mod calibration;
mod detector;
mod error;
mod file;
mod forward;
mod given;
mod json;
mod known;
mod learned;
mod live;
mod mesh;
mod pickle;
mod recording;
mod solution;
mod solutions;
mod solver;
mod views;

use pyo3::prelude::*;

/// Touch from tomographic tactile sensors.
#[pymodule]
mod _tactomo {
    #[pymodule_export]
    use super::calibration::Calibration;
    #[pymodule_export]
    use super::detector::Detector;
    #[pymodule_export]
    use super::error::TactomoError;
    #[pymodule_export]
    use super::forward::{Contact, Model, Simulator};
    #[pymodule_export]
    use super::known::{Correction, ForceLaw};
    #[pymodule_export]
    use super::learned::{Learned, learn};
    #[pymodule_export]
    use super::live::{Live, TouchEvent};
    #[pymodule_export]
    use super::mesh::{Mesh, Raster};
    #[pymodule_export]
    use super::recording::{Frame, Frames, Recording};
    #[pymodule_export]
    use super::solution::{Flags, FoundContact, Shape, Solution, Total};
    #[pymodule_export]
    use super::solutions::Solutions;
    #[pymodule_export]
    use super::solver::Solver;

    use pyo3::prelude::*;
    use pyo3::types::{PyDict, PyTuple};
    use tactomo::scene::SceneName;
    use tactomo::schema::CONTACT_COLUMNS;
    use tactomo::solve::Method;

    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        let py = module.py();
        let solvers = PyDict::new(py);
        Method::ALL.iter().try_for_each(|method| solvers.set_item(method.name(), method.explanation()))?;
        module.add("SOLVERS", solvers)?;
        module.add("SCENES", PyTuple::new(py, SceneName::ALL.map(|name| name.to_string()))?)?;
        module.add("CONTACT_FIELDS", PyTuple::new(py, CONTACT_COLUMNS.iter().map(|column| column.name))?)?;
        FoundContact::add_fields(&module.getattr("FoundContact")?)?;
        Shape::add_fields(&module.getattr("Shape")?)?;
        Total::add_fields(&module.getattr("Total")?)?;
        module.add("__version__", env!("CARGO_PKG_VERSION"))
    }
}
