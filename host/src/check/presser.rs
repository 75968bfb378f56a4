//! Does on the simulated detector what a person is asked to.

use tactomo_physics::detector::Detector;
use tactomo_physics::forward::ImageMesh;
use tactomo_physics::scene::{Contact, SceneName};

use super::course::{Ask, FINGERS};

/// How far from the middle of the electrodes fingertips press, as a share of the way to one of them.
const OUTWARDS: f64 = 0.4;

/// A simulated hand.
pub struct Presser {
    places: Vec<Contact>,
}

impl Presser {
    /// A hand whose fingertips press with such a radius (m) and conductance (S) at places of a detector.
    pub fn new(detector: &Detector, mesh: &ImageMesh, radius_m: f64, conductance_s: f64) -> Self {
        let places = (0..FINGERS).filter_map(|number| place(detector, mesh, number));
        let press = |[x_m, y_m, z_m]: [f64; 3]| Contact { z_m, ..Contact::flat(x_m, y_m, radius_m, conductance_s) };
        Self { places: places.map(press).collect() }
    }

    /// What touches the detector as it is asked: a scene, and contacts beside it.
    pub fn touch(&self, ask: Ask) -> (SceneName, Vec<Contact>) {
        match ask {
            Ask::Rest | Ask::LetGo(_) | Ask::Nothing => (SceneName::Rest, Vec::new()),
            Ask::Hand => (SceneName::Wide, Vec::new()),
            Ask::Finger(number) => (SceneName::Rest, self.places.get(number).copied().into_iter().collect()),
        }
    }
}

/// Where a fingertip presses (m): on the way from the middle of the electrodes to one of them, at the nearest node.
fn place(detector: &Detector, mesh: &ImageMesh, number: usize) -> Option<[f64; 3]> {
    let pads: Vec<[f64; 3]> = detector.electrodes.iter().map(|pad| [pad.x_m, pad.y_m, pad.z_m]).collect();
    let middle: [f64; 3] =
        std::array::from_fn(|axis| pads.iter().map(|pad| pad[axis]).sum::<f64>() / pads.len().max(1) as f64);
    let towards = pads.get(number * pads.len() / FINGERS)?;
    let wanted: [f64; 3] = std::array::from_fn(|axis| middle[axis] + OUTWARDS * (towards[axis] - middle[axis]));
    let away_m2 = |node: &[f64; 3]| (0..3).map(|axis| (node[axis] - wanted[axis]).powi(2)).sum::<f64>();
    (0..mesh.nodes_m.len()).map(|node| mesh.place_m(node)).min_by(|a, b| away_m2(a).total_cmp(&away_m2(b)))
}
