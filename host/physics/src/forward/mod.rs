//! From contacts to readings.
//!
//! A [`ForwardModel`] gives the electrode impedance matrix `Z` of a detector for any contacts, and the fields that make
//! the linear theory. What follows from those is the same for every model and lives here, once.

mod auto;
mod contact;
mod disc_fields;
mod driving;
pub mod jacobian;
mod jacobian_file;
mod joined;
mod nuisance;
mod patches;
pub mod shell;
mod slab;
pub mod spots;
mod spread;
mod through;
mod uneven_place;

use std::sync::Arc;

use nalgebra::DMatrix;

pub use self::auto::Auto;
pub use self::contact::ContactFields;
pub use self::disc_fields::DiscFields;
pub use self::driving::{ConnectingPoints, DrivingLayer, sheet_drops_ohm};
pub use self::jacobian_file::JacobianFileError;
pub use self::joined::{Joint, JointCurrents};
pub use self::nuisance::{Nuisance, Similar, changed_models, pads_ohm};
pub use self::patches::Patches;
pub use self::slab::{DotCurrent, DotCurrents, Face, Resolution, Slab};
use self::spots::SpotFields;
pub use self::spread::touched_impedance_ohm;
pub use self::through::Through;
use crate::detector::Detector;
use crate::geometry::Point;
use crate::readings::Readings;
use crate::scene::Contact;
use crate::space;

/// A model of a detector.
pub trait ForwardModel: Send + Sync {
    /// Name on the command line: `shell` or `slab`.
    fn name(&self) -> &'static str;

    /// What it models.
    fn detector(&self) -> &Detector;

    /// The impedance matrix `Z` (ohm): `Z[(i, j)]` is the potential of electrode `i` for 1 A into electrode `j`, with the
    /// driving layer as reference. Symmetric.
    ///
    /// # Errors
    /// [`ForwardError`] if a contact is not on the detector or no contact conducts.
    fn impedance_ohm(&self, contacts: &[Contact]) -> Result<DMatrix<f64>, ForwardError>;

    /// The impedance matrix (ohm), and to first order by how much it changes (ohm) where one contact, given by its place in the list,
    /// is replaced by another that is near to it: derivatives by whatever contacts are described with. Some models give them at less
    /// cost than the impedances themselves.
    ///
    /// # Errors
    /// As for [`impedance_ohm`](Self::impedance_ohm).
    ///
    /// # Panics
    /// If there is no such contact.
    fn impedance_with_changes_ohm(
        &self,
        contacts: &[Contact],
        replaced: &[(usize, Contact)],
    ) -> Result<(DMatrix<f64>, Vec<DMatrix<f64>>), ForwardError> {
        let before = self.impedance_ohm(contacts)?;
        let changes = replaced.iter().map(|(index, contact)| {
            let mut contacts = contacts.to_vec();
            contacts[*index] = *contact;
            Ok(self.impedance_ohm(&contacts)? - &before)
        });
        let changes = changes.collect::<Result<_, _>>()?;
        Ok((before, changes))
    }

    /// A model of the same detector with contacts a few times cheaper and readings off by up to a per cent or so, to look where they may be; `None`
    /// if there is no such thing.
    fn rough(&self) -> Option<Arc<dyn ForwardModel>> {
        None
    }

    /// A model of the same detector at a resolution at which detectors that are [similar](Self::of_similar) are a few times cheaper to make:
    /// readings are off by up to a per cent or so, and their changes from one to the other by a few per cent, those with pads' own impedances by a
    /// sixth. `None` if there is no such thing.
    ///
    /// # Errors
    /// [`ForwardError::Detector`] if it cannot be modelled so.
    fn coarse(&self) -> Result<Option<Arc<dyn ForwardModel>>, ForwardError> {
        Ok(None)
    }

    /// The impedance matrix and the fields under the image's nodes with a conductance at each of them (S): an image of contact,
    /// or a mask of any shape. A node stands for its cell of the surface, over which its conductance is spread.
    ///
    /// # Errors
    /// [`ForwardError`] if the image has another number of nodes than [`image_mesh`](Self::image_mesh), a value that is no
    /// conductance, or nothing that conducts.
    fn image_fields(&self, image_s: &[f64]) -> Result<ContactFields, ForwardError>;

    /// The impedance matrix alone (ohm) of [`image_fields`](Self::image_fields), which is less work on some models.
    ///
    /// # Errors
    /// As for [`image_fields`](Self::image_fields).
    fn image_impedance_ohm(&self, image_s: &[f64]) -> Result<DMatrix<f64>, ForwardError> {
        Ok(self.image_fields(image_s)?.impedance_ohm)
    }

    /// The impedance matrix and the fields under those nodes alone that conduct, in their order: all that a step in their conductances needs,
    /// and less work than [`image_fields`](Self::image_fields) on most models.
    ///
    /// # Errors
    /// As for [`image_fields`](Self::image_fields).
    fn touched_fields(&self, image_s: &[f64]) -> Result<ContactFields, ForwardError> {
        Ok(self.image_fields(image_s)?.of_touched(image_s))
    }

    /// Places of the image that this model is inverted on.
    fn image_mesh(&self) -> &ImageMesh;

    /// This model, with images of about so many nodes.
    ///
    /// # Errors
    /// [`ForwardError::Detector`] if there is no such model of the detector.
    fn on_image_of(&self, nodes: usize) -> Result<Box<dyn ForwardModel>, ForwardError>;

    /// A model of this kind of a detector that is nearly the same, at as little cost as can be: derivatives by what a detector is made of.
    ///
    /// # Errors
    /// [`ForwardError::Detector`] if there is no such model of the detector.
    fn of_similar(&self, detector: &Detector) -> Result<Arc<dyn ForwardModel>, ForwardError>;

    /// Fields of an even current over a disc at a place (m), of a radius (m): over the part of it that is on the detector.
    ///
    /// # Errors
    /// [`ForwardError::Contact`] if it is not on the detector.
    fn disc_fields(&self, place_m: Point, radius_m: f64) -> Result<DiscFields, ForwardError> {
        DiscFields::of_light(self, place_m, radius_m)
    }

    /// Fields of spots that stand for contacts of a radius (m); none if the model has no such thing.
    fn spots(&self, radius_m: f64) -> Option<Box<dyn SpotFields>>;

    /// Neumann fields of the bare detector at the image's nodes (ohm): `nodes x electrodes`, `N(e, x)` up to a constant
    /// that is the same for all `e` and `x`; electrodes as floating equipotential pads.
    fn fields_ohm(&self) -> &DMatrix<f64>;

    /// Neumann fields of the bare detector between the image's nodes (ohm): `nodes x nodes`, symmetric, of a current over a node's cell the mean
    /// over another. For images of a few hundred nodes: it has as many elements as their square.
    ///
    /// # Errors
    /// [`ForwardError::Detector`] if the model cannot give them.
    fn node_fields_ohm(&self) -> Result<DMatrix<f64>, ForwardError>;

    /// Neumann fields of the bare detector at the electrodes themselves (ohm): `electrodes x electrodes`, symmetric, up to the constant of
    /// [`fields_ohm`](Self::fields_ohm).
    fn electrode_fields_ohm(&self) -> &DMatrix<f64>;
}

/// Nodes of an image of contact conductance and the triangles between them.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct ImageMesh {
    /// Positions (m); on a curved detector those of its map, which are for drawing only.
    pub nodes_m: Vec<[f64; 2]>,
    /// Positions in space (m) on a curved detector, else none.
    pub places_m: Vec<[f64; 3]>,
    /// Corners of each triangle, counter-clockwise.
    pub triangles: Vec<[u32; 3]>,
    /// Area that belongs to each node (m2); they add up to the detector's.
    pub node_areas_m2: Vec<f64>,
}

impl ImageMesh {
    /// Where a node is (m), with height zero on a flat detector.
    ///
    /// # Panics
    /// If there is no such node.
    pub fn place_m(&self, node: usize) -> [f64; 3] {
        let [x, y] = self.nodes_m[node];
        self.places_m.get(node).copied().unwrap_or([x, y, 0.0])
    }

    /// Area of each triangle (m2).
    pub fn triangle_areas_m2(&self) -> Vec<f64> {
        let area_m2 =
            |triangle: &[u32; 3]| 0.5 * space::length(space::normal(triangle.map(|node| self.place_m(node as usize))));
        self.triangles.iter().map(area_m2).collect()
    }

    /// An image that is zero but at some nodes.
    ///
    /// # Panics
    /// If there is no such node.
    pub fn image_with(&self, values: impl IntoIterator<Item = (usize, f64)>) -> Vec<f64> {
        let mut image = vec![0.0; self.nodes_m.len()];
        values.into_iter().for_each(|(node, value)| image[node] = value);
        image
    }
}

/// Why a model cannot answer.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ForwardError {
    /// A contact outside, or with a radius or conductance that is not a positive number.
    #[error("contact {index} ({what}): contacts need a place on the detector, a radius and a conductance above zero")]
    Contact {
        /// Its place in the list, from 0.
        index: usize,
        /// What is wrong.
        what: String,
    },
    /// An image that is not one of this model's.
    #[error("image of contact: {what}")]
    Image {
        /// What is wrong.
        what: String,
    },
    /// No contact: `Z` would be infinite.
    #[error("no contact conducts, so the impedance to the driving layer is infinite")]
    NoContact,
    /// The model cannot be made for this detector.
    #[error("detector {detector}: {what}")]
    Detector {
        /// Its name.
        detector: String,
        /// What is wrong and what is allowed.
        what: String,
    },
}

/// Whether `image_s` can be an image on so many nodes.
fn check_image(image_s: &[f64], nodes: usize) -> Result<(), ForwardError> {
    let wrong = |what: String| Err(ForwardError::Image { what });
    if image_s.len() != nodes {
        return wrong(format!("it has {} values, the model's image has {nodes} nodes", image_s.len()));
    }
    match image_s.iter().position(|value_s| !(*value_s >= 0.0 && value_s.is_finite())) {
        Some(node) => wrong(format!("node {node} has a conductance of {} S; zero or above is needed", image_s[node])),
        None if image_s.iter().all(|value_s| *value_s == 0.0) => Err(ForwardError::NoContact),
        None => Ok(()),
    }
}

/// A detector that leaks to the driving layer everywhere has no fields without contact.
fn leaks(detector: &Detector) -> ForwardError {
    let what = "it leaks to the driving layer everywhere, so it has no fields without contact".to_owned();
    ForwardError::Detector { detector: detector.name.clone(), what }
}

/// Readings of a frame from the impedance matrix (V): `V[g][e] = Vcc (1 - Z[e][g] / (Z[g][g] + R_on))`.
///
/// An electrode draws no current when it is read, so grounding `g` through `R_on` is a current `-Vcc / (Z[g][g] + R_on)` into it.
pub fn readings_v(impedance_ohm: &DMatrix<f64>, detector: &Detector) -> Readings {
    Readings::from_fn(impedance_ohm.nrows(), |g, e| {
        detector.drive_v * (1.0 - impedance_ohm[(e, g)] / (impedance_ohm[(g, g)] + detector.on_resistance_ohm))
    })
}
