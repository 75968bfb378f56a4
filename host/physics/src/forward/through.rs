//! A model seen through some of its electrodes, some of which may be joined.
//!
//! A pad that is neither grounded nor read floats, as it does in every model: so the fields of the others are what they were. One
//! that is joined to another carries what current makes their potentials alike ([`super::joined`]): the two are one electrode, and
//! it is enough to keep one of them, to be grounded and read.

use std::sync::{Arc, OnceLock};

use nalgebra::DMatrix;

use super::joined::{Joint, JointCurrents};
use super::spots::{Spot, SpotFields};
use super::{ContactFields, DiscFields, ForwardError, ForwardModel, ImageMesh};
use crate::detector::Detector;
use crate::geometry::Point;
use crate::scene::Contact;
use crate::space::Place;

/// A model of a detector of which only some electrodes are connected.
pub struct Through {
    model: Arc<dyn ForwardModel>,
    kept: Vec<usize>,
    joints: Vec<Joint>,
    /// Of the bare detector.
    joint_currents: JointCurrents,
    detector: Detector,
    /// Made when they are asked for.
    fields_ohm: OnceLock<DMatrix<f64>>,
    electrode_fields_ohm: DMatrix<f64>,
}

impl Through {
    /// The model through the electrodes `kept`, in this order, with some of all its electrodes joined.
    ///
    /// # Panics
    /// If there is no such electrode.
    pub fn new(model: Arc<dyn ForwardModel>, kept: Vec<usize>, joints: Vec<Joint>) -> Self {
        let detector = model.detector().keeping(&kept);
        let joint_currents = JointCurrents::new(model.electrode_fields_ohm(), &joints);
        let electrode_fields_ohm = square(&joint_currents.applied(model.electrode_fields_ohm()), &kept);
        Self { model, kept, joints, joint_currents, detector, fields_ohm: OnceLock::new(), electrode_fields_ohm }
    }

    /// What is seen of an impedance matrix of all electrodes.
    fn seen(&self, impedance_ohm: &DMatrix<f64>) -> DMatrix<f64> {
        square(&JointCurrents::new(impedance_ohm, &self.joints).applied(impedance_ohm), &self.kept)
    }

    fn seen_fields(&self, all: &ContactFields) -> ContactFields {
        let nodes_ohm = JointCurrents::new(&all.impedance_ohm, &self.joints).applied(&all.nodes_ohm);
        ContactFields { impedance_ohm: self.seen(&all.impedance_ohm), nodes_ohm: nodes_ohm.select_columns(&self.kept) }
    }
}

impl ForwardModel for Through {
    fn name(&self) -> &'static str {
        self.model.name()
    }

    fn detector(&self) -> &Detector {
        &self.detector
    }

    fn impedance_ohm(&self, contacts: &[Contact]) -> Result<DMatrix<f64>, ForwardError> {
        Ok(self.seen(&self.model.impedance_ohm(contacts)?))
    }

    fn impedance_with_changes_ohm(
        &self,
        contacts: &[Contact],
        replaced: &[(usize, Contact)],
    ) -> Result<(DMatrix<f64>, Vec<DMatrix<f64>>), ForwardError> {
        let (all, changes) = self.model.impedance_with_changes_ohm(contacts, replaced)?;
        let before = self.seen(&all);
        let changes = changes.into_iter().map(|change| self.seen(&(&all + change)) - &before).collect();
        Ok((before, changes))
    }

    fn coarse(&self) -> Result<Option<Arc<dyn ForwardModel>>, ForwardError> {
        let through =
            |model| Arc::new(Self::new(model, self.kept.clone(), self.joints.clone())) as Arc<dyn ForwardModel>;
        Ok(self.model.coarse()?.map(through))
    }

    fn rough(&self) -> Option<Arc<dyn ForwardModel>> {
        Some(Arc::new(Self::new(self.model.rough()?, self.kept.clone(), self.joints.clone())))
    }

    fn image_fields(&self, image_s: &[f64]) -> Result<ContactFields, ForwardError> {
        Ok(self.seen_fields(&self.model.image_fields(image_s)?))
    }

    fn touched_fields(&self, image_s: &[f64]) -> Result<ContactFields, ForwardError> {
        Ok(self.seen_fields(&self.model.touched_fields(image_s)?))
    }

    fn image_impedance_ohm(&self, image_s: &[f64]) -> Result<DMatrix<f64>, ForwardError> {
        Ok(self.seen(&self.model.image_impedance_ohm(image_s)?))
    }

    fn image_mesh(&self) -> &ImageMesh {
        self.model.image_mesh()
    }

    fn on_image_of(&self, nodes: usize) -> Result<Box<dyn ForwardModel>, ForwardError> {
        Ok(Box::new(Self::new(self.model.on_image_of(nodes)?.into(), self.kept.clone(), self.joints.clone())))
    }

    fn disc_fields(&self, place_m: Point, radius_m: f64) -> Result<DiscFields, ForwardError> {
        if !self.joints.is_empty() {
            return DiscFields::of_light(self, place_m, radius_m);
        }
        let DiscFields { electrodes_ohm, own_ohm, share } = self.model.disc_fields(place_m, radius_m)?;
        Ok(DiscFields::centred(self.kept.iter().map(|e| electrodes_ohm[*e]).collect(), own_ohm, share))
    }

    fn spots(&self, radius_m: f64) -> Option<Box<dyn SpotFields>> {
        let spots = self.model.spots(radius_m)?;
        Some(Box::new(SpotsThrough { spots, kept: self.kept.clone(), joint_currents: self.joint_currents.clone() }))
    }

    fn of_similar(&self, detector: &Detector) -> Result<Arc<dyn ForwardModel>, ForwardError> {
        // What belongs to the detector as a whole, and to the electrodes that are seen.
        let all = self.model.detector();
        let mut whole = Detector { electrodes: all.electrodes.clone(), calibration: None, ..detector.clone() };
        self.kept.iter().zip(&detector.electrodes).for_each(|(e, pad)| whole.electrodes[*e] = *pad);
        Ok(Arc::new(Self::new(self.model.of_similar(&whole)?, self.kept.clone(), self.joints.clone())))
    }

    fn fields_ohm(&self) -> &DMatrix<f64> {
        let fields_ohm = || self.joint_currents.applied(self.model.fields_ohm()).select_columns(&self.kept);
        self.fields_ohm.get_or_init(fields_ohm)
    }

    fn node_fields_ohm(&self) -> Result<DMatrix<f64>, ForwardError> {
        let at = self.joint_currents.at(self.model.fields_ohm());
        Ok(self.model.node_fields_ohm()? - &at * at.transpose())
    }

    fn electrode_fields_ohm(&self) -> &DMatrix<f64> {
        &self.electrode_fields_ohm
    }
}

/// Spots of which only some electrodes see the fields.
struct SpotsThrough {
    spots: Box<dyn SpotFields>,
    kept: Vec<usize>,
    joint_currents: JointCurrents,
}

impl SpotFields for SpotsThrough {
    fn spot(&self, place_m: Place) -> Spot {
        let mut spot = self.spots.spot(place_m);
        spot.joined = self.joint_currents.apply(&mut spot.electrodes_ohm);
        spot.electrodes_ohm = self.kept.iter().map(|e| spot.electrodes_ohm[*e]).collect();
        spot.own_ohm -= product(&spot.joined, &spot.joined);
        spot
    }

    fn footing(&self, place_m: Place) -> (Place, [Place; 2]) {
        self.spots.footing(place_m)
    }

    fn places_m(&self, count: usize) -> Vec<Place> {
        self.spots.places_m(count)
    }

    fn between_ohm(&self, a: &Spot, b: &Spot) -> f64 {
        self.spots.between_ohm(a, b) - product(&a.joined, &b.joined)
    }
}

fn product(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

fn square(matrix: &DMatrix<f64>, kept: &[usize]) -> DMatrix<f64> {
    matrix.select_rows(kept).select_columns(kept)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::forward::contact::conducting_patches;
    use crate::forward::{Nuisance, Patches, Slab, readings_v};
    use crate::simulate::{Fault, Measurement};

    #[test]
    fn what_some_electrodes_see_is_part_of_what_all_do() -> Result<(), ForwardError> {
        let detector = Detector::preset(Detector::DEFAULT).unwrap();
        let all: Arc<dyn ForwardModel> = Arc::new(Slab::new(&detector)?);
        let kept = vec![5, 0, 9];
        let some = Through::new(Arc::clone(&all), kept.clone(), Vec::new());
        let contact = [Contact::flat(0.004, -0.007, 0.002, 1e-3)];
        let [few, many] = [&some as &dyn ForwardModel, &*all].map(|model| model.impedance_ohm(&contact).unwrap());
        assert_eq!((few.nrows(), few[(0, 2)], few[(1, 1)]), (3, many[(5, 9)], many[(0, 0)]));
        let fields = some.disc_fields([0.004, -0.007], 0.002)?;
        let told = DiscFields::of_light(&some, [0.004, -0.007], 0.002)?;
        let pairs = fields.electrodes_ohm.iter().zip(&told.electrodes_ohm).chain([(&fields.own_ohm, &told.own_ohm)]);
        assert!(pairs.into_iter().all(|(a, b)| (a - b).abs() < 1e-3 * told.own_ohm.abs()), "{fields:?} {told:?}");
        let [few, many] = [&some as &dyn ForwardModel, &*all].map(|model| model.spots(0.002).unwrap());
        let [few, many] = [few, many].map(|spots| spots.spot([0.004, -0.007, 0.0]));
        assert_eq!(few.electrodes_ohm, [5, 0, 9].map(|e| many.electrodes_ohm[e]));
        assert_eq!((few.own_ohm, some.fields_ohm().ncols(), some.detector().electrodes.len()), (many.own_ohm, 3, 3));
        Ok(())
    }

    #[test]
    fn joined_pads_are_the_short_that_a_board_has() -> Result<(), ForwardError> {
        let detector = Detector::preset(Detector::DEFAULT).unwrap();
        let all: Arc<dyn ForwardModel> = Arc::new(Slab::new(&detector)?.on_image(200));
        let contacts = [Contact::flat(0.006, 0.012, 0.0025, 1e-3), Contact::flat(-0.016, -0.003, 0.002, 2e-4)];
        let kept: Vec<_> = (0..16).filter(|e| *e != 7 && *e != 9).collect();
        let joints = vec![Joint::short(2, 7), Joint { electrodes: [4, 9], ohm: 35.0 }];
        let some = Through::new(Arc::clone(&all), kept.clone(), joints);
        let faults: Vec<Fault> = ["short:2,7", "short:4,9:35"].map(|fault| fault.parse().unwrap()).into();
        let mut board = Measurement::new(&detector, &faults, 1).unwrap();
        let expected = board.pad_voltages(Some(&all.impedance_ohm(&contacts)?)).of(&kept);
        let found = readings_v(&some.impedance_ohm(&contacts)?, some.detector());
        let off = found.volts().iter().zip(expected.volts()).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(off < 1e-9, "{off}");
        Ok(())
    }

    #[test]
    fn what_is_not_known_is_seen_through_them_too() -> Result<(), ForwardError> {
        let all: Arc<dyn ForwardModel> = Arc::new(Slab::new(&Detector::default())?.on_image(200));
        let whole = Nuisance::new(&all, all.detector(), 2)?.unwrap();
        let contacts = [Contact::flat(0.006, 0.012, 0.0025, 1e-3)];
        for (kept, joints) in [(vec![5, 0, 9, 12], Vec::new()), (vec![2, 3, 4, 8, 11], vec![Joint::short(2, 7)])] {
            let some: Arc<dyn ForwardModel> = Arc::new(Through::new(Arc::clone(&all), kept.clone(), joints.clone()));
            let [seen, anew] =
                [whole.through(&some, &kept, &joints)?, Nuisance::new(&some, some.detector(), 2)?.unwrap()];
            let covariance = |nuisance: &Nuisance| {
                let patterns_v = nuisance.patterns_v(&contacts, some.detector()).unwrap();
                &patterns_v * patterns_v.transpose()
            };
            let [seen, anew] = [seen, anew].map(|nuisance| covariance(&nuisance));
            // But for what is common to all pads' impedances, which is a mean over pairs of those that there are.
            assert!((&seen - &anew).amax() < 1e-5 * anew.amax(), "{kept:?}: {}", (seen - &anew).amax() / anew.amax());
        }
        Ok(())
    }

    #[test]
    fn fields_of_joined_pads_make_the_readings_of_spots_and_images() -> Result<(), ForwardError> {
        let detector = Detector::preset(Detector::DEFAULT).unwrap();
        let all: Arc<dyn ForwardModel> = Arc::new(Slab::new(&detector)?.on_image(200));
        let kept: Vec<_> = (0..15).collect();
        let some = Through::new(all, kept, vec![Joint::short(2, 15), Joint::short(15, 2), Joint::short(3, 2)]);
        // An image by the fields of the bare detector, and by the full model.
        let image_s = some.image_mesh().image_with([(70, 2e-4), (120, 1e-3)]);
        let patches = Patches::of(&some)?.fields(&image_s).unwrap();
        let full = some.image_fields(&image_s)?;
        assert!((&patches.impedance_ohm - &full.impedance_ohm).amax() < 1e-6 * full.impedance_ohm.amax());
        assert!((&patches.nodes_ohm - &full.nodes_ohm).amax() < 1e-6 * full.nodes_ohm.amax());
        let touched = some.touched_fields(&image_s)?;
        assert!((&touched.impedance_ohm - &full.impedance_ohm).amax() < 1e-6 * full.impedance_ohm.amax());
        assert!((&touched.nodes_ohm - &full.of_touched(&image_s).nodes_ohm).amax() < 1e-6 * touched.nodes_ohm.amax());
        // Two spots by theirs.
        let contacts = [Contact::flat(0.006, 0.012, 0.002, 1e-5), Contact::flat(-0.016, -0.003, 0.002, 2e-5)];
        let fields = some.spots(0.002).unwrap();
        let spots = contacts.map(|at| fields.spot([at.x_m, at.y_m, 0.0]));
        let cross = DMatrix::from_fn(2, 15, |k, e| spots[k].electrodes_ohm[e]);
        let between =
            DMatrix::from_fn(
                2,
                2,
                |k, l| {
                    if k == l { spots[k].own_ohm } else { fields.between_ohm(&spots[k], &spots[l]) }
                },
            );
        let found =
            conducting_patches(some.electrode_fields_ohm(), &cross, between, &contacts.map(|at| at.conductance_s));
        let [found, expected] = [found.impedance_ohm().unwrap(), some.impedance_ohm(&contacts)?];
        let [found, expected] = [found, expected].map(|z| readings_v(&z, some.detector()));
        let off = found.volts().iter().zip(expected.volts()).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(off < 0.01 * expected.largest_v(), "{}", off / expected.largest_v());
        Ok(())
    }
}
