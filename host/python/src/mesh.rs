//! `Mesh` and `Raster`: where an image is.

use numpy::{AllowTypeChange, PyArray1, PyArray2, PyArrayLike1, PyArrayMethods};
use pyo3::prelude::*;
use tactomo::detector::Detector as Described;
use tactomo::forward::ImageMesh;
use tactomo::solve::Interpolation;

use crate::array::{places, square};
use crate::error::refused;

/// Nodes of an image of contact conductance and the triangles between them.
#[pyclass(frozen, module = "tactomo")]
pub struct Mesh {
    mesh: ImageMesh,
    detector: Described,
}

impl Mesh {
    /// That of a solver's images.
    pub fn new(mesh: ImageMesh, detector: Described) -> Self {
        Self { mesh, detector }
    }
}

#[pymethods]
impl Mesh {
    /// Positions (m), `(nodes, 2)`; on a curved detector those of its map, which are for drawing only.
    #[getter]
    fn nodes_m<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        places(py, self.mesh.nodes_m.iter().copied())
    }

    /// Positions in space (m), `(nodes, 3)`.
    #[getter]
    fn places_m<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        places(py, (0..self.mesh.nodes_m.len()).map(|node| self.mesh.place_m(node)))
    }

    /// Corners of each triangle, counter-clockwise: `(triangles, 3)`, indices of nodes.
    #[getter]
    fn triangles<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<u32>>> {
        square(py, self.mesh.triangles.iter().flatten().copied().collect(), 3)
    }

    /// Area that belongs to each node (m2), `(nodes,)`; image times area is conductance (S).
    #[getter]
    fn node_areas_m2<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_slice(py, &self.mesh.node_areas_m2)
    }

    /// What makes pixels of images on this mesh: `raster(image)` is an array `(height, width)`.
    #[pyo3(signature = (width = 64, height = 64))]
    fn raster(&self, py: Python<'_>, width: usize, height: usize) -> PyResult<Raster> {
        if ![width, height].iter().all(|side| (1..=4096).contains(side)) {
            return Err(refused("a raster has 1 to 4096 pixels a side"));
        }
        py.detach(|| Ok(Raster::new(&self.mesh, &self.detector, [width, height])))
    }

    fn __len__(&self) -> usize {
        self.mesh.nodes_m.len()
    }
}

/// Makes pixels of images: row 0 is the largest y, as pictures are drawn; beside the detector pixels are zero.
#[pyclass(frozen, module = "tactomo")]
pub struct Raster {
    interpolation: Interpolation,
    nodes: usize,
    width: usize,
    is_inside: Vec<bool>,
    bounds_m: [[f64; 2]; 2],
}

impl Raster {
    fn new(mesh: &ImageMesh, detector: &Described, [width, height]: [usize; 2]) -> Self {
        let bounds_m @ [low, high] = detector.outline.bounds();
        let share = |index: usize, count: usize| (index as f64 + 0.5) / count as f64;
        let at = |index: usize| {
            let (across, down) = (share(index % width, width), share(index / width, height));
            [low[0] + across * (high[0] - low[0]), high[1] - down * (high[1] - low[1])]
        };
        let pixels_m: Vec<[f64; 2]> = (0..width * height).map(at).collect();
        let is_inside = pixels_m.iter().map(|at_m| detector.outline.holds(*at_m)).collect();
        let pixels = ImageMesh { nodes_m: pixels_m, ..ImageMesh::default() };
        let interpolation = Interpolation::new(mesh, &pixels);
        Self { interpolation, nodes: mesh.nodes_m.len(), width, is_inside, bounds_m }
    }
}

#[pymethods]
impl Raster {
    /// Pixels of an image `(nodes,)` (S/m2): `(height, width)`, float32.
    fn __call__<'py>(
        &self,
        py: Python<'py>,
        image: PyArrayLike1<'py, f32, AllowTypeChange>,
    ) -> PyResult<Bound<'py, PyArray2<f32>>> {
        let image = image.to_vec()?;
        if image.len() != self.nodes {
            return Err(refused(format!("an image of {} values, but the mesh has {} nodes", image.len(), self.nodes)));
        }
        let mut pixels = self.interpolation.apply(&image);
        pixels.iter_mut().zip(&self.is_inside).filter(|(_, inside)| !**inside).for_each(|(pixel, _)| *pixel = 0.0);
        square(py, pixels, self.width)
    }

    /// Left, right, bottom and top (m), as matplotlib's `imshow` takes it.
    #[getter]
    fn extent_m(&self) -> (f64, f64, f64, f64) {
        let [low, high] = self.bounds_m;
        (low[0], high[0], low[1], high[1])
    }
}
