//! The thin shell: a detector as a sheet of triangles with its electrodes in the plane.
//!
//! `-div(s grad phi) + c (phi - Vcc) = 0` with the sheet conductance `s` and contact conductance `c` per area; on a pad the
//! complete electrode model, `(phi - U) / z_e`. The current through a thick layer is not in it: see the documentation of the
//! physics for what that costs.

mod contact;
mod facets;
mod inverse;
mod locate;
mod mesh;
mod meshing;
mod rings;
mod spots;
#[cfg(test)]
mod spots_tests;
#[cfg(test)]
mod surface_tests;
mod system;
#[cfg(test)]
mod tests;

use std::sync::{Arc, Mutex, OnceLock, PoisonError};

use nalgebra::DMatrix;

use self::inverse::Inverse;
use self::locate::Locator;
pub use self::mesh::Mesh;
use self::spots::{ShellSpots, SpotTable};
use self::system::{Factor, System};
use super::contact::{ContactFields, ContactSystem, conducting_patches};
use super::driving::DrivingLayer;
use super::spots::SpotFields;
use super::{ForwardError, ForwardModel, ImageMesh, check_image, leaks};
use crate::algebra::NotPositive;
use crate::detector::{Bond, Detector, Electrode};
use crate::scene::Contact;

/// A pad's contact impedance is at least this share of `radius^2 / sheet conductance`: below, it makes no difference to a
/// reading (current enters within 1/1000 of the radius) and the equations only lose digits.
const SMALLEST_PAD_IMPEDANCE: f64 = 1e-6;

/// Contacts that touch more nodes are solved for by factorising anew.
const MOST_TOUCHED: usize = 400;

/// The thin-shell model of a detector.
pub struct Shell {
    detector: Detector,
    mesh: Mesh,
    locator: Locator,
    image_mesh: ImageMesh,
    system: System,
    fields_ohm: DMatrix<f64>,
    electrode_fields_ohm: DMatrix<f64>,
    /// Conductance to the driving layer where nothing presses (S/m2).
    leak_s_per_m2: f64,
    /// Fields between single nodes; made when first contacts are small enough to ask for them.
    between_nodes: OnceLock<Option<BetweenNodes>>,
    /// Tables of spots, by radius (m).
    spots: Mutex<Vec<(f64, Arc<SpotTable>)>>,
}

/// Neumann functions between single nodes.
struct BetweenNodes {
    inverse: Inverse,
    /// Means of the inverse's columns over the detector (ohm), and the mean of these: what takes them to a mean of zero.
    means_ohm: Vec<f64>,
    mean_ohm: f64,
}

impl BetweenNodes {
    fn ohm(&self, i: usize, j: usize) -> f64 {
        self.inverse.element(i, j) - self.means_ohm[i] - self.means_ohm[j] + self.mean_ohm
    }
}

impl Shell {
    /// Nodes of the mesh unless said otherwise: 2000 for 16 electrodes.
    pub fn default_nodes(detector: &Detector) -> usize {
        400 + 100 * detector.electrodes.len()
    }

    /// A model with the default number of nodes.
    ///
    /// # Errors
    /// [`ForwardError::Detector`] if the detector cannot be meshed.
    pub fn new(detector: &Detector) -> Result<Self, ForwardError> {
        Self::with_nodes(detector, Self::default_nodes(detector))
    }

    /// A model with about `nodes` nodes.
    ///
    /// # Errors
    /// [`ForwardError::Detector`] if the detector cannot be meshed.
    pub fn with_nodes(detector: &Detector, nodes: usize) -> Result<Self, ForwardError> {
        if let Some((_, bond)) = detector.bond() {
            return Err(joined_by_dots(detector, &bond));
        }
        let singular = |_: NotPositive| singular(detector);
        let pad_impedance_ohm_m2: Vec<_> =
            detector.electrodes.iter().map(|pad| pad_impedance_ohm_m2(detector, pad)).collect();
        let sheet_conductance_s = detector.sheet_conductance_s();
        let mesh = Mesh::new(detector, nodes)?;
        let sheet_s =
            |triangle| detector.log_unevenness(detector.map_m(mesh.centroid_m(triangle))).exp() * sheet_conductance_s;
        let system = System::new(&mesh, sheet_s, &pad_impedance_ohm_m2);
        let node_areas_m2 = mesh.node_areas_m2();
        // Ground one pad by some conductance: with no net current none flows there, and the solution is the floating one.
        let factor = system.factorise([(system.pad(0), sheet_conductance_s)]).map_err(singular)?;
        let into_pad = |pad: usize| vec![(system.pad(pad) as u32, 1.0)];
        let (fields_ohm, electrode_fields_ohm) =
            floating_fields_ohm(&factor, &system, &node_areas_m2, system.pads(), into_pad);
        let image_mesh = ImageMesh {
            nodes_m: mesh.nodes_m.clone(),
            places_m: mesh.places_m.clone(),
            triangles: mesh.triangles.clone(),
            node_areas_m2,
        };
        Ok(Self {
            detector: detector.clone(),
            locator: Locator::new(&mesh),
            mesh,
            image_mesh,
            system,
            fields_ohm,
            electrode_fields_ohm,
            leak_s_per_m2: 0.0,
            between_nodes: OnceLock::new(),
            spots: Mutex::new(Vec::new()),
        })
    }

    /// The same model with a driving layer that need not be ideal: one that leaks.
    ///
    /// # Errors
    /// [`ForwardError::Detector`] if the layer has a sheet resistance, which only the slab can have.
    pub fn under(self, driving: DrivingLayer) -> Result<Self, ForwardError> {
        if driving.sheet_ohm > 0.0 {
            let what = "its driving layer has a sheet resistance, which only the slab can have: a flat rectangle";
            return Err(ForwardError::Detector { detector: self.detector.name.clone(), what: what.to_owned() });
        }
        Ok(Self { leak_s_per_m2: driving.leak_s / self.area_m2(), ..self })
    }

    fn area_m2(&self) -> f64 {
        self.image_mesh.node_areas_m2.iter().sum()
    }

    /// Whether `image_s` can be an image on this model; one of nothing if it leaks.
    fn check_image(&self, image_s: &[f64]) -> Result<(), ForwardError> {
        match check_image(image_s, self.mesh.nodes_m.len()) {
            Err(ForwardError::NoContact) if self.leak_s_per_m2 > 0.0 => Ok(()),
            checked => checked,
        }
    }

    /// What the few nodes that conduct make of the fields between them (Woodbury's identity), which costs less than factorising anew:
    /// their system, and their conductances (S). `None` if they are many, or if the detector leaks everywhere.
    fn touched(&self, image_s: &[f64]) -> Option<(ContactSystem<'_>, Vec<f64>)> {
        let touched: Vec<_> = (0..image_s.len()).filter(|node| image_s[*node] > 0.0).collect();
        if touched.len() > MOST_TOUCHED || self.leak_s_per_m2 > 0.0 {
            return None;
        }
        let fields = self.between_nodes.get_or_init(|| self.between_nodes().ok()).as_ref()?;
        let cross = self.fields_ohm.select_rows(&touched);
        let nodes = symmetric(touched.len(), |k, l| fields.ohm(touched[k], touched[l]));
        let conductances_s: Vec<_> = touched.iter().map(|node| image_s[*node]).collect();
        Some((conducting_patches(&self.electrode_fields_ohm, &cross, nodes, &conductances_s), conductances_s))
    }

    fn between_nodes(&self) -> Result<BetweenNodes, NotPositive> {
        let factor = self.system.factorise([self.ground()])?;
        let areas_m2 = &self.image_mesh.node_areas_m2;
        let area_m2: f64 = areas_m2.iter().sum();
        let evenly = |i: usize| areas_m2.get(i).map_or(0.0, |node_area_m2| node_area_m2 / area_m2);
        let currents_a = DMatrix::from_fn(self.system.pad(self.system.pads()), 1, |i, _| evenly(i));
        let (nodes_ohm, _) = factor.solve(currents_a);
        let mean_ohm = nodes_ohm.iter().enumerate().map(|(i, ohm)| evenly(i) * ohm).sum();
        Ok(BetweenNodes { inverse: factor.inverse(), means_ohm: nodes_ohm.as_slice().to_vec(), mean_ohm })
    }

    /// A pad grounded by some conductance (S): with no net current none flows there, and the solution is the floating one.
    fn ground(&self) -> (usize, f64) {
        (self.system.pad(0), self.detector.sheet_conductance_s())
    }

    /// Neumann functions at the nodes (ohm) of currents that add up to 1 A each, given by node and share.
    fn floating_fields_ohm(
        &self,
        count: usize,
        into: impl Fn(usize) -> Vec<(u32, f64)>,
    ) -> Result<DMatrix<f64>, ForwardError> {
        let factor = self.system.factorise([self.ground()]).map_err(|_| singular(&self.detector))?;
        Ok(floating_fields_ohm(&factor, &self.system, &self.image_mesh.node_areas_m2, count, into).0)
    }

    /// The table of spots of a radius (m), which is made once.
    fn spot_table(&self, radius_m: f64) -> Option<Arc<SpotTable>> {
        let mut tables = self.spots.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((_, table)) = tables.iter().find(|(radius, _)| *radius == radius_m) {
            return Some(Arc::clone(table));
        }
        let table = Arc::new(SpotTable::new(self, radius_m).ok()?);
        tables.push((radius_m, Arc::clone(&table)));
        Some(table)
    }

    /// Contact conductance that each node gets from discs of contact (S).
    ///
    /// # Errors
    /// [`ForwardError::Contact`] if a contact is off the detector or no positive disc.
    pub fn node_conductances_s(&self, contacts: &[Contact]) -> Result<Vec<f64>, ForwardError> {
        contact::node_conductances_s(&self.mesh, &self.locator, contacts)
    }
}

impl ForwardModel for Shell {
    fn name(&self) -> &'static str {
        "shell"
    }

    fn detector(&self) -> &Detector {
        &self.detector
    }

    fn impedance_ohm(&self, contacts: &[Contact]) -> Result<DMatrix<f64>, ForwardError> {
        self.image_impedance_ohm(&self.node_conductances_s(contacts)?)
    }

    fn image_impedance_ohm(&self, image_s: &[f64]) -> Result<DMatrix<f64>, ForwardError> {
        self.check_image(image_s)?;
        match self.touched(image_s).and_then(|(system, _)| system.impedance_ohm()) {
            Some(impedance_ohm) => Ok(impedance_ohm),
            None => Ok(self.image_fields(image_s)?.impedance_ohm),
        }
    }

    fn image_fields(&self, image_s: &[f64]) -> Result<ContactFields, ForwardError> {
        self.check_image(image_s)?;
        let leaks_s = self.image_mesh.node_areas_m2.iter().map(|area_m2| self.leak_s_per_m2 * area_m2);
        let conductances_s = image_s.iter().zip(leaks_s).map(|(image_s, leak_s)| image_s + leak_s);
        let factor = self.system.factorise(conductances_s.enumerate()).map_err(|_| ForwardError::NoContact)?;
        let pads = self.system.pads();
        let currents_a =
            DMatrix::from_fn(self.system.pad(pads), pads, |i, j| f64::from(u8::from(i == self.system.pad(j))));
        let (nodes_ohm, impedance_ohm) = factor.solve(currents_a);
        Ok(ContactFields { impedance_ohm, nodes_ohm })
    }

    fn touched_fields(&self, image_s: &[f64]) -> Result<ContactFields, ForwardError> {
        self.check_image(image_s)?;
        match self.touched(image_s).and_then(|(system, conductances_s)| system.fields(&conductances_s)) {
            Some(fields) => Ok(fields),
            None => Ok(self.image_fields(image_s)?.of_touched(image_s)),
        }
    }

    fn on_image_of(&self, nodes: usize) -> Result<Box<dyn ForwardModel>, ForwardError> {
        let leak_s = self.leak_s_per_m2 * self.area_m2();
        let driving = DrivingLayer { leak_s, ..DrivingLayer::default() };
        Ok(Box::new(Self::with_nodes(&self.detector, nodes)?.under(driving)?))
    }

    fn of_similar(&self, detector: &Detector) -> Result<Arc<dyn ForwardModel>, ForwardError> {
        Ok(Arc::new(Self::with_nodes(detector, self.mesh.nodes_m.len())?))
    }

    fn spots(&self, radius_m: f64) -> Option<Box<dyn SpotFields>> {
        if self.leak_s_per_m2 > 0.0 {
            return None;
        }
        Some(Box::new(ShellSpots(self.spot_table(radius_m)?)))
    }

    fn image_mesh(&self) -> &ImageMesh {
        &self.image_mesh
    }

    fn fields_ohm(&self) -> &DMatrix<f64> {
        &self.fields_ohm
    }

    fn node_fields_ohm(&self) -> Result<DMatrix<f64>, ForwardError> {
        if self.leak_s_per_m2 > 0.0 {
            return Err(leaks(&self.detector));
        }
        self.floating_fields_ohm(self.mesh.nodes_m.len(), |node| vec![(node as u32, 1.0)])
    }

    fn electrode_fields_ohm(&self) -> &DMatrix<f64> {
        &self.electrode_fields_ohm
    }
}

/// A symmetric matrix from its lower triangle.
fn symmetric(count: usize, element: impl Fn(usize, usize) -> f64) -> DMatrix<f64> {
    let mut matrix = DMatrix::zeros(count, count);
    for column in 0..count {
        for row in column..count {
            let value = element(row, column);
            (matrix[(row, column)], matrix[(column, row)]) = (value, value);
        }
    }
    matrix
}

/// Contact impedance of a pad that the equations are made with (ohm m2).
fn pad_impedance_ohm_m2(detector: &Detector, pad: &Electrode) -> f64 {
    let smallest = SMALLEST_PAD_IMPEDANCE * pad.radius_m * pad.radius_m / detector.sheet_conductance_s();
    detector.pad_impedance_ohm_m2(pad).max(smallest)
}

fn joined_by_dots(detector: &Detector, bond: &Bond) -> ForwardError {
    let what = format!(
        "its layers are joined by {}, and a thin shell has one layer: use the slab (--model slab or auto), or take `bond` out of the layer for layers \
         that touch all over",
        bond.summary()
    );
    ForwardError::Detector { detector: detector.name.clone(), what }
}

fn singular(detector: &Detector) -> ForwardError {
    ForwardError::Detector {
        detector: detector.name.clone(),
        what: "its equations are singular: conductivity and contact impedance have to be finite and above zero"
            .to_owned(),
    }
}

/// Neumann functions of some currents, at nodes and at pads: 1 A into the unknowns that `into` gives with their shares, out evenly
/// all over, mean zero. So they are symmetric.
fn floating_fields_ohm(
    factor: &Factor,
    system: &System,
    node_areas_m2: &[f64],
    count: usize,
    into: impl Fn(usize) -> Vec<(u32, f64)>,
) -> (DMatrix<f64>, DMatrix<f64>) {
    let area_m2: f64 = node_areas_m2.iter().sum();
    let out_a = |i: usize| node_areas_m2.get(i).map_or(0.0, |node_area_m2| node_area_m2 / area_m2);
    let mut currents_a = DMatrix::from_fn(system.pad(system.pads()), count, |i, _| -out_a(i));
    for column in 0..count {
        into(column).into_iter().for_each(|(unknown, share)| currents_a[(unknown as usize, column)] += share);
    }
    let (mut nodes, mut electrodes) = factor.solve(currents_a);
    for column in 0..count {
        let sum: f64 = nodes.column(column).iter().zip(node_areas_m2).map(|(ohm, area)| ohm * area).sum();
        nodes.column_mut(column).add_scalar_mut(-sum / area_m2);
        electrodes.column_mut(column).add_scalar_mut(-sum / area_m2);
    }
    (nodes, electrodes)
}
