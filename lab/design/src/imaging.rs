//! SR and PA with the paper's solver, and whether the images that they are of have collapsed.

use tactomo_physics::detector::Detector;
use tactomo_physics::geometry::distance;
use tactomo_physics::readings::Readings;
use tactomo_physics::scene::Contact;

use super::paper::{Imaged, PaperSolver};
use super::press::{MIDDLE, nine_places};
use super::rank::mean;

/// Images whose centroids are on average within this share of the width of the middle say "the middle", wherever the contact is.
const CENTRAL_OF_WIDTH: f64 = 0.01;

/// SR and PA of a detector with the paper's solver.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize)]
pub struct Imaging {
    /// SR (9) of a contact in the middle, whatever its image is; `None` if that is nowhere above zero.
    pub spatial_resolution: Option<f64>,
    /// Whether that image has collapsed: its contour at half height reaches the corners, and SR is what the outline gives.
    pub is_spread_out: bool,
    /// PA (10), mean over the nine places.
    pub position_accuracy: Option<f64>,
    /// Whether these images have collapsed: their centroids are on average within 1 % of the width of the middle, and PA is what answering "the
    /// middle" gives, [`accuracy_of_the_middle`].
    pub is_central: bool,
}

impl Imaging {
    /// SR, if the image has not collapsed.
    pub fn sharpness(&self) -> Option<f64> {
        self.spatial_resolution.filter(|_| !self.is_spread_out)
    }

    /// PA, if the images have not collapsed.
    pub fn accuracy(&self) -> Option<f64> {
        self.position_accuracy.filter(|_| !self.is_central)
    }
}

/// SR (0) or PA (1) as text, in brackets where the image has collapsed.
pub(crate) fn figure(imaging: &Imaging, index: usize) -> String {
    let (value, is_collapsed) = match index {
        0 => (imaging.spatial_resolution, imaging.is_spread_out),
        _ => (imaging.position_accuracy, imaging.is_central),
    };
    match value {
        None => "-".to_owned(),
        Some(value) if is_collapsed => format!("({value:.3})"),
        Some(value) => format!("{value:.3}"),
    }
}

/// PA of answering "the middle" at the nine places of a detector.
pub fn accuracy_of_the_middle(detector: &Detector) -> f64 {
    let width_m = detector.outline.size_m()[0];
    let places = nine_places(detector);
    1.0 - places.iter().map(|place| distance(*place, MIDDLE)).sum::<f64>() / places.len() as f64 / width_m
}

/// Images of contacts, one after the other.
pub(crate) struct Images<'a> {
    solver: &'a PaperSolver,
    resolutions: Vec<f64>,
    spread_out: usize,
    accuracies: Vec<f64>,
    from_middle_m: Vec<f64>,
}

impl<'a> Images<'a> {
    pub fn new(solver: &'a PaperSolver) -> Self {
        Self { solver, resolutions: Vec::new(), spread_out: 0, accuracies: Vec::new(), from_middle_m: Vec::new() }
    }

    /// Takes in the readings of a contact; what is seen of it, if anything.
    pub fn add(&mut self, readings: &Readings, contact: &Contact) -> Option<Imaged> {
        let imaged = self.solver.imaged(readings, contact)?;
        self.accuracies.push(imaged.figures.position_accuracy);
        self.from_middle_m.push(distance(imaged.centroid_m, MIDDLE));
        if [contact.x_m, contact.y_m] == MIDDLE {
            self.resolutions.push(imaged.figures.spatial_resolution);
            self.spread_out += usize::from(imaged.figures.is_spread_out);
        }
        Some(imaged)
    }

    /// Figures over all of them; of several in the middle, an image has collapsed if most have.
    pub fn figures(&self) -> Imaging {
        let central_m = CENTRAL_OF_WIDTH * self.solver.width_m();
        Imaging {
            spatial_resolution: mean(&self.resolutions),
            is_spread_out: 2 * self.spread_out > self.resolutions.len(),
            position_accuracy: mean(&self.accuracies),
            is_central: mean(&self.from_middle_m).is_some_and(|from_middle_m| from_middle_m <= central_m),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tactomo_physics::detector::Layer;
    use tactomo_physics::forward::{ForwardModel, Slab, readings_v};

    use super::super::press::Press;

    fn imaging(bottom_s_per_m: f64, top_s_per_m: f64) -> Imaging {
        let base = Detector::default().taken_as_exact();
        let layer = Layer { bottom_s_per_m, top_s_per_m, ..Layer::uniform(0.010, top_s_per_m) };
        let detector = Detector { layers: vec![layer], ..base };
        let (slab, solver) = (Slab::new(&detector).unwrap(), PaperSolver::new(&Detector::default()).unwrap());
        let mut images = Images::new(&solver);
        for place in nine_places(&detector) {
            let contact = Press::PAPER.at(place, 1.0);
            images.add(&readings_v(&slab.impedance_ohm(&[contact]).unwrap(), &detector), &contact);
        }
        images.figures()
    }

    #[test]
    fn answering_the_middle_is_right_to_two_thirds_of_the_width() {
        // By hand: four places at 20 mm, four at 28.28 mm, one in the middle, of 60 mm.
        let expected = 1.0 - (4.0 * 20.0 + 4.0 * 800f64.sqrt()) / 9.0 / 60.0;
        assert!((accuracy_of_the_middle(&Detector::default()) - expected).abs() < 1e-12);
    }

    #[test]
    fn images_of_a_top_that_spreads_everything_have_collapsed_and_are_no_figures() {
        let collapsed = imaging(0.001, 10.0);
        assert!(collapsed.is_spread_out && collapsed.is_central, "{collapsed:?}");
        assert_eq!((collapsed.sharpness(), collapsed.accuracy()), (None, None));
        let corner = 1.0 - 0.5f64.sqrt();
        assert!((collapsed.spatial_resolution.unwrap() - corner).abs() < 1e-3, "{collapsed:?}");
        let middle = accuracy_of_the_middle(&Detector::default());
        assert!((collapsed.position_accuracy.unwrap() - middle).abs() <= CENTRAL_OF_WIDTH, "{collapsed:?}");
        let seen = imaging(3.0, 0.001);
        assert!(seen.sharpness().is_some() && seen.accuracy() > Some(middle), "{seen:?}");
    }
}
