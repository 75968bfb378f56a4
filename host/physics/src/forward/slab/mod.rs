//! A rectangular detector in full: layers in depth, equipotential pads below, contacts on top.
//!
//! The slab is diagonal in cosine modes in the plane and exact in depth ([`layers`]). Its kernel between points of a surface
//! is a look-up ([`kernel`]); pads and contacts are discs of a few densities ([`disc`]); the pads are eliminated once
//! ([`pads`]), so that a contact costs a few look-ups and a small solve. Conductivity that differs across the plane changes the kernels
//! ([`uneven`]). Layers that are joined by dots of glue are two slabs, of which the dots are eliminated with the pads ([`bond`]).

mod bond;
mod check;
mod cut;
mod disc;
mod discs;
mod driving;
mod green;
mod image;
mod layers;
mod near;
mod pads;
mod quadrature;
mod spline;
mod spots;
mod stacks;
#[cfg(test)]
mod tests;
mod uneven;
#[cfg(test)]
mod uneven_tests;

use std::sync::{Arc, OnceLock};

use nalgebra::DMatrix;

pub use self::bond::{DotCurrent, DotCurrents, Face};
use self::bond::{Dots, Stacks};
use self::check::check;
use self::disc::{DiscBasis, MAX_DEGREE};
use self::driving::Covered;
use self::green::SurfaceGreen;
use self::image::{CellFields, ImageGrid};
use self::pads::{PadFields, PadPoints};
use self::spots::SlabSpots;
use self::stacks::{bottom_surface, split_m, stacks, top_surface, widest_m};
use self::uneven::Uneven;
use super::contact::{ContactFields, ContactSystem, conducting_patches};
use super::driving::DrivingLayer;
use super::spots::SpotFields;
use super::{DiscFields, ForwardError, ForwardModel, ImageMesh, check_image, leaks};
use crate::detector::Detector;
use crate::geometry::Point;
use crate::scene::Contact;

/// Nodes of the image unless said otherwise, about.
const IMAGE_NODES: usize = 2000;

/// How finely a [`Slab`] is resolved: degrees of the polynomials that current densities are made of.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Resolution {
    /// On the pads.
    pub pad_degree: usize,
    /// On contacts that are small against the thickness; wider ones get more.
    pub contact_degree: usize,
    /// On the widest contacts. With 8, readings of three firm discs of 18 mm that overlap on `square-60` are within 0.0004 of the largest of those with
    /// 12, and take a third of the time.
    pub most_degree: usize,
    /// On discs with an even current, at most.
    pub even_degree: usize,
    /// On dots of glue.
    pub dot_degree: usize,
    /// Half waves along a side of the modes that unevenness couples.
    pub uneven_modes: usize,
    /// Wave numbers, times the thickness, up to which the pads' fields reach the top: those above have fallen to 2 exp(-this).
    pub across: usize,
    /// Length at which the pads' fields on the top of a thin layer are split, at least, in radii of the smallest pad.
    pub split_in_pad: f64,
    /// The same in pitches of the pads: nearly no place has more than two pads in reach then.
    pub split_in_pitch: f64,
    /// Most steps in a pad's or dot's radius of the table of their fields, where they are not split: what limits it on layers that are thin against them.
    pub steps_in_pad: usize,
}

impl Resolution {
    /// Enough for readings within a few tenths of a per cent: against reference readings, one degree more changes nothing.
    pub const STANDARD: Self = Self {
        pad_degree: 2,
        contact_degree: 2,
        most_degree: 8,
        even_degree: 8,
        dot_degree: 3,
        uneven_modes: 10,
        across: 11,
        split_in_pad: 1.25,
        split_in_pitch: 0.2,
        steps_in_pad: 10,
    };
    /// For how readings change from one detector to another: on `square-60` changes are off by up to 3 % of themselves, those with a pad's own
    /// impedance by a sixth.
    pub const COARSE: Self = Self {
        pad_degree: 1,
        contact_degree: 2,
        most_degree: 8,
        even_degree: 1,
        dot_degree: 2,
        uneven_modes: 8,
        across: 6,
        split_in_pad: 2.0,
        split_in_pitch: 0.25,
        steps_in_pad: 3,
    };
    /// Finer than any solver needs.
    pub const FINE: Self = Self {
        pad_degree: 3,
        contact_degree: 4,
        most_degree: MAX_DEGREE,
        even_degree: MAX_DEGREE,
        dot_degree: 4,
        uneven_modes: 16,
        across: 11,
        split_in_pad: 1.25,
        split_in_pitch: 0.2,
        steps_in_pad: 10,
    };
}

/// A rectangular detector, layered in depth.
#[derive(Clone, Debug)]
pub struct Slab {
    detector: Detector,
    size_m: [f64; 2],
    driving: DrivingLayer,
    resolution: Resolution,
    bottom: Arc<SurfaceGreen>,
    top: Arc<SurfaceGreen>,
    points: Arc<PadPoints>,
    pads: Arc<PadFields>,
    /// Of the layers below the top, down to dots of glue; `None` where the conductivity is even across the plane.
    uneven: Option<Arc<Uneven>>,
    /// `None` where all layers touch all over.
    bonded: Option<Arc<Bonded>>,
    image: Arc<Image>,
}

/// What a slab has besides if dots of glue join two of its layers.
#[derive(Clone, Debug)]
struct Bonded {
    dots: Arc<Dots>,
    /// Of the layers below the dots.
    uneven: Option<Arc<Uneven>>,
}

/// Degree on the contacts of a [rough](ForwardModel::rough) slab.
const ROUGH_DEGREE: usize = 2;

/// The grid that images are on, and what is made when the first image is asked for.
#[derive(Clone, Debug)]
struct Image {
    grid: ImageGrid,
    mesh: OnceLock<ImageMesh>,
    fields_ohm: OnceLock<DMatrix<f64>>,
    cells: OnceLock<CellFields>,
}

impl Slab {
    /// Makes the model at the standard resolution.
    ///
    /// # Errors
    /// [`ForwardError::Detector`] if the outline is not a rectangle, or a layer or an electrode makes no sense.
    pub fn new(detector: &Detector) -> Result<Self, ForwardError> {
        Self::with_resolution(detector, Resolution::STANDARD)
    }

    /// Makes the model at a resolution.
    ///
    /// # Errors
    /// As for [`new`](Self::new).
    pub fn with_resolution(detector: &Detector, resolution: Resolution) -> Result<Self, ForwardError> {
        Self::under(detector, resolution, DrivingLayer::default())
    }

    /// Makes the model with a driving layer that need not be ideal.
    ///
    /// # Errors
    /// As for [`new`](Self::new).
    pub fn under(detector: &Detector, resolution: Resolution, driving: DrivingLayer) -> Result<Self, ForwardError> {
        Self::like(None, detector, resolution, driving)
    }

    /// Makes the model, with what a slab of a detector that is nearly the same has in common with it.
    fn like(
        like: Option<&Self>,
        detector: &Detector,
        resolution: Resolution,
        driving: DrivingLayer,
    ) -> Result<Self, ForwardError> {
        let wrong = |what: String| ForwardError::Detector { detector: detector.name.clone(), what };
        let size_m = check(detector).map_err(wrong)?;
        let bond = detector.bond();
        let stacks @ [lower, upper] = stacks(detector, size_m, driving);
        let split_m = stacks.map(|stack| split_m(stack.thickness_m(), size_m, widest_m(detector)));
        let as_even = like.filter(|like| {
            let other = &like.detector;
            (like.size_m, &other.layers, widest_m(other)) == (size_m, &detector.layers, widest_m(detector))
        });
        let [bottom, top] = match as_even {
            Some(like) => [Arc::clone(&like.bottom), Arc::clone(&like.top)],
            None => [
                SurfaceGreen::new(size_m, split_m[0], &bottom_surface(lower)).into(),
                SurfaceGreen::new(size_m, split_m[1], &top_surface(upper)).into(),
            ],
        };
        let as_uneven = as_even.filter(|like| like.detector.unevenness == detector.unevenness);
        let uneven = |stack: Covered<'_>| {
            Uneven::new(size_m, &detector.unevenness, stack.layers(), resolution.uneven_modes).map(Arc::new)
        };
        let bonded = bond.map(|(_, bond)| {
            let dots = || Dots::new(bond, resolution.dot_degree, stacks).into();
            let bonded = |like: &'_ Self| like.bonded.clone();
            Bonded {
                dots: as_even.and_then(bonded).map_or_else(dots, |bonded| Arc::clone(&bonded.dots)),
                uneven: as_uneven.and_then(bonded).map_or_else(|| uneven(lower), |bonded| bonded.uneven.clone()),
            }
        });
        let uneven = as_uneven.map_or_else(|| uneven(upper), |like| like.uneven.clone());
        let basis = DiscBasis::of_degree(resolution.pad_degree);
        let points = PadPoints::new(detector, size_m, basis, &bottom, as_even.map(|like| &*like.points));
        let mut slab = Self {
            detector: detector.clone(),
            size_m,
            driving,
            resolution,
            bottom,
            top,
            points: points.into(),
            pads: PadFields::default().into(),
            uneven,
            bonded: bonded.map(Arc::new),
            image: Image::new(ImageGrid::new(size_m, IMAGE_NODES)).into(),
        };
        slab.pads = slab.pad_fields().ok_or_else(|| slab.not_positive())?.into();
        Ok(slab)
    }

    /// Eliminates the pads, and the dots of glue if there are any; `None` if they are not positive definite.
    fn pad_fields(&self) -> Option<PadFields> {
        let impedances = self.pad_impedances();
        if let Some(bonded) = &self.bonded {
            return self.stacks(bonded).fields(&impedances);
        }
        let [_, covered] = stacks(&self.detector, self.size_m, self.driving);
        let basis = DiscBasis::of_degree(self.resolution.pad_degree);
        PadFields::new(
            self.points.pads(),
            basis,
            impedances,
            &self.bottom,
            &covered,
            self.uneven.as_deref(),
            self.resolution,
        )
    }

    /// Impedances between all densities of the pads (ohm), below their layers alone.
    fn pad_impedances(&self) -> DMatrix<f64> {
        let uneven = self.bonded.as_ref().map_or(&self.uneven, |bonded| &bonded.uneven);
        self.points.impedances(DiscBasis::of_degree(self.resolution.pad_degree), &self.bottom, uneven.as_deref())
    }

    fn stacks<'a>(&'a self, bonded: &'a Bonded) -> Stacks<'a> {
        Stacks {
            dots: &bonded.dots,
            covered: stacks(&self.detector, self.size_m, self.driving),
            uneven: [bonded.uneven.as_deref(), self.uneven.as_deref()],
            pads: self.points.pads(),
            basis: DiscBasis::of_degree(self.resolution.pad_degree),
            resolution: self.resolution,
        }
    }

    fn not_positive(&self) -> ForwardError {
        let what = "its pads touch each other; pads need a gap between them".to_owned();
        ForwardError::Detector { detector: self.detector.name.clone(), what }
    }

    /// The same model with images of about `nodes` nodes instead of 2000; at least 9.
    pub fn on_image(self, nodes: usize) -> Self {
        Self { image: Image::new(ImageGrid::new(self.size_m, nodes)).into(), ..self }
    }

    fn image_fields_ohm(&self) -> &DMatrix<f64> {
        let fields_ohm = || self.image.grid.means(&self.pads, self.pads.electrodes()).transpose();
        self.image.fields_ohm.get_or_init(fields_ohm)
    }

    fn cells(&self) -> &CellFields {
        self.image.cells.get_or_init(|| {
            let [_, upper] = stacks(&self.detector, self.size_m, self.driving);
            let top = top_surface(upper);
            CellFields::new(self.image.grid, &self.pads, self.uneven.as_deref(), top.response, top.floating)
        })
    }

    /// The nodes of an image that conduct, and their system.
    fn touched(&self, image_s: &[f64]) -> Result<(Vec<usize>, ContactSystem<'_>), ForwardError> {
        match check_image(image_s, self.image.grid.nodes()) {
            Err(ForwardError::NoContact) if self.driving.leak_s > 0.0 => {}
            checked => checked?,
        }
        let touched: Vec<_> = (0..image_s.len()).filter(|node| image_s[*node] > 0.0).collect();
        let conductance_s: Vec<_> = touched.iter().map(|node| image_s[*node]).collect();
        let cross = self.image_fields_ohm().select_rows(&touched);
        let patches = self.cells().within(&touched);
        let system = conducting_patches(&self.pads.electrodes_ohm, &cross, patches, &conductance_s);
        Ok((touched, ContactSystem { leak_s: self.driving.leak_s, ..system }))
    }
}

impl ForwardModel for Slab {
    fn name(&self) -> &'static str {
        "slab"
    }

    fn detector(&self) -> &Detector {
        &self.detector
    }

    fn impedance_ohm(&self, contacts: &[Contact]) -> Result<DMatrix<f64>, ForwardError> {
        self.discs(contacts)?.impedance_ohm().ok_or(ForwardError::NoContact)
    }

    fn impedance_with_changes_ohm(
        &self,
        contacts: &[Contact],
        replaced: &[(usize, Contact)],
    ) -> Result<(DMatrix<f64>, Vec<DMatrix<f64>>), ForwardError> {
        self.discs(contacts)?.with_changes_ohm(replaced)
    }

    fn disc_fields(&self, place_m: Point, radius_m: f64) -> Result<DiscFields, ForwardError> {
        self.fields_of_disc(place_m, radius_m)
    }

    fn rough(&self) -> Option<Arc<dyn ForwardModel>> {
        Some(Arc::new(Self { resolution: Resolution { most_degree: ROUGH_DEGREE, ..self.resolution }, ..self.clone() }))
    }

    fn coarse(&self) -> Result<Option<Arc<dyn ForwardModel>>, ForwardError> {
        let resolution = Resolution { most_degree: ROUGH_DEGREE, ..Resolution::COARSE };
        Ok(Some(Arc::new(Self::like(None, &self.detector, resolution, self.driving)?)))
    }

    fn image_fields(&self, image_s: &[f64]) -> Result<ContactFields, ForwardError> {
        let (touched, system) = self.touched(image_s)?;
        let mut solved = system.solve().ok_or(ForwardError::NoContact)?;
        let scaled = |row: usize| image_s[touched[row]].sqrt();
        solved.unknowns.row_iter_mut().enumerate().for_each(|(row, mut currents)| currents *= scaled(row));
        let untouched: Vec<_> = (0..image_s.len()).filter(|node| image_s[*node] == 0.0).collect();
        let cells = self.cells();
        let fields_ohm = self.image_fields_ohm();
        let mut elsewhere = fields_ohm.select_rows(&untouched) + cells.between(&untouched, &touched) * &solved.unknowns;
        elsewhere.column_iter_mut().zip(&solved.constant_ohm).for_each(|(mut e, ohm)| e.add_scalar_mut(*ohm));
        let mut nodes_ohm = DMatrix::zeros(image_s.len(), fields_ohm.ncols());
        for (row, node) in touched.iter().enumerate() {
            nodes_ohm.row_mut(*node).copy_from(&(solved.unknowns.row(row) / -image_s[*node]));
        }
        untouched.iter().enumerate().for_each(|(row, node)| nodes_ohm.row_mut(*node).copy_from(&elsewhere.row(row)));
        Ok(ContactFields { impedance_ohm: solved.impedance_ohm, nodes_ohm })
    }

    fn image_impedance_ohm(&self, image_s: &[f64]) -> Result<DMatrix<f64>, ForwardError> {
        self.touched(image_s)?.1.impedance_ohm().ok_or(ForwardError::NoContact)
    }

    fn touched_fields(&self, image_s: &[f64]) -> Result<ContactFields, ForwardError> {
        let (touched, system) = self.touched(image_s)?;
        let conductance_s: Vec<_> = touched.iter().map(|node| image_s[*node]).collect();
        system.fields(&conductance_s).ok_or(ForwardError::NoContact)
    }

    fn on_image_of(&self, nodes: usize) -> Result<Box<dyn ForwardModel>, ForwardError> {
        Ok(Box::new(self.clone().on_image(nodes)))
    }

    fn spots(&self, radius_m: f64) -> Option<Box<dyn SpotFields>> {
        let leaks = self.driving.leak_s > 0.0;
        (!leaks).then(|| Box::new(SlabSpots::new(self.clone(), radius_m)) as Box<dyn SpotFields>)
    }

    fn image_mesh(&self) -> &ImageMesh {
        self.image.mesh.get_or_init(|| self.image.grid.mesh())
    }

    fn of_similar(&self, detector: &Detector) -> Result<Arc<dyn ForwardModel>, ForwardError> {
        Ok(Arc::new(Self::like(Some(self), detector, self.resolution, self.driving)?))
    }

    fn fields_ohm(&self) -> &DMatrix<f64> {
        self.image_fields_ohm()
    }

    fn node_fields_ohm(&self) -> Result<DMatrix<f64>, ForwardError> {
        if self.driving.leak_s > 0.0 {
            return Err(leaks(&self.detector));
        }
        let nodes: Vec<_> = (0..self.image.grid.nodes()).collect();
        Ok(self.cells().between(&nodes, &nodes))
    }

    fn electrode_fields_ohm(&self) -> &DMatrix<f64> {
        &self.pads.electrodes_ohm
    }
}

/// A place from the corner, given from the middle (m).
fn from_corner(size_m: [f64; 2], at_m: [f64; 2]) -> [f64; 2] {
    [0, 1].map(|axis| at_m[axis] + size_m[axis] / 2.0)
}

impl Image {
    fn new(grid: ImageGrid) -> Self {
        Self { grid, mesh: OnceLock::new(), fields_ohm: OnceLock::new(), cells: OnceLock::new() }
    }
}
