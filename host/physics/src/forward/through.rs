//! A model seen through some of its electrodes.
//!
//! A pad that is neither grounded nor read floats, as it does in every model: so the fields of the others are what they were.

use std::sync::Arc;

use nalgebra::DMatrix;

use super::spots::{Between, Spot, SpotFields};
use super::{ContactFields, ForwardError, ForwardModel, ImageMesh};
use crate::detector::Detector;
use crate::scene::Contact;
use crate::space::Place;

/// A model of a detector of which only some electrodes are connected.
pub struct Through {
    model: Arc<dyn ForwardModel>,
    kept: Vec<usize>,
    detector: Detector,
    fields_ohm: DMatrix<f64>,
    electrode_fields_ohm: DMatrix<f64>,
}

impl Through {
    /// The model through the electrodes `kept`, in this order.
    ///
    /// # Panics
    /// If there is no such electrode.
    pub fn new(model: Arc<dyn ForwardModel>, kept: Vec<usize>) -> Self {
        let mut detector = model.detector().clone();
        detector.electrodes = kept.iter().map(|e| detector.electrodes[*e]).collect();
        let fields_ohm = model.fields_ohm().select_columns(&kept);
        let electrode_fields_ohm = square(model.electrode_fields_ohm(), &kept);
        Self { model, kept, detector, fields_ohm, electrode_fields_ohm }
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
        Ok(square(&self.model.impedance_ohm(contacts)?, &self.kept))
    }

    fn image_fields(&self, image_s: &[f64]) -> Result<ContactFields, ForwardError> {
        let all = self.model.image_fields(image_s)?;
        Ok(ContactFields {
            impedance_ohm: square(&all.impedance_ohm, &self.kept),
            nodes_ohm: all.nodes_ohm.select_columns(&self.kept),
        })
    }

    fn image_impedance_ohm(&self, image_s: &[f64]) -> Result<DMatrix<f64>, ForwardError> {
        Ok(square(&self.model.image_impedance_ohm(image_s)?, &self.kept))
    }

    fn image_mesh(&self) -> &ImageMesh {
        self.model.image_mesh()
    }

    fn on_image_of(&self, nodes: usize) -> Result<Box<dyn ForwardModel>, ForwardError> {
        Ok(Box::new(Self::new(self.model.on_image_of(nodes)?.into(), self.kept.clone())))
    }

    fn spots(&self, radius_m: f64) -> Option<Box<dyn SpotFields>> {
        let spots = self.model.spots(radius_m)?;
        Some(Box::new(SpotsThrough { spots, kept: self.kept.clone() }))
    }

    fn fields_ohm(&self) -> &DMatrix<f64> {
        &self.fields_ohm
    }

    fn node_fields_ohm(&self) -> Result<DMatrix<f64>, ForwardError> {
        self.model.node_fields_ohm()
    }

    fn electrode_fields_ohm(&self) -> &DMatrix<f64> {
        &self.electrode_fields_ohm
    }
}

/// Spots of which only some electrodes see the fields.
struct SpotsThrough {
    spots: Box<dyn SpotFields>,
    kept: Vec<usize>,
}

impl SpotFields for SpotsThrough {
    fn spot(&self, place_m: Place) -> Spot {
        let mut spot = self.spots.spot(place_m);
        let [by_first, by_second] = &mut spot.slopes_ohm_per_m;
        for all in [&mut spot.electrodes_ohm, by_first, by_second] {
            *all = self.kept.iter().map(|e| all[*e]).collect();
        }
        spot
    }

    fn footing(&self, place_m: Place) -> (Place, [Place; 2]) {
        self.spots.footing(place_m)
    }

    fn places_m(&self, count: usize) -> Vec<Place> {
        self.spots.places_m(count)
    }

    fn between(&self, a: &Spot, b: &Spot) -> Between {
        self.spots.between(a, b)
    }

    fn between_ohm(&self, a: &Spot, b: &Spot) -> f64 {
        self.spots.between_ohm(a, b)
    }
}

fn square(matrix: &DMatrix<f64>, kept: &[usize]) -> DMatrix<f64> {
    matrix.select_rows(kept).select_columns(kept)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::forward::Slab;

    #[test]
    fn what_some_electrodes_see_is_part_of_what_all_do() -> Result<(), ForwardError> {
        let detector = Detector::preset(Detector::DEFAULT).unwrap();
        let all: Arc<dyn ForwardModel> = Arc::new(Slab::new(&detector)?);
        let kept = vec![5, 0, 9];
        let some = Through::new(Arc::clone(&all), kept.clone());
        let contact = [Contact::flat(0.004, -0.007, 0.002, 1e-3)];
        let [few, many] = [&some as &dyn ForwardModel, &*all].map(|model| model.impedance_ohm(&contact).unwrap());
        assert_eq!((few.nrows(), few[(0, 2)], few[(1, 1)]), (3, many[(5, 9)], many[(0, 0)]));
        let [few, many] = [&some as &dyn ForwardModel, &*all].map(|model| model.spots(0.002).unwrap());
        let [few, many] = [few, many].map(|spots| spots.spot([0.004, -0.007, 0.0]));
        assert_eq!(few.electrodes_ohm, [5, 0, 9].map(|e| many.electrodes_ohm[e]));
        assert_eq!((few.own_ohm, some.fields_ohm().ncols(), some.detector().electrodes.len()), (many.own_ohm, 3, 3));
        Ok(())
    }
}
