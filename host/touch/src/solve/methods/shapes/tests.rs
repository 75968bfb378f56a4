//! Tests of lines and rings on the readings of a finer model than the one that is fitted.

use std::sync::Arc;

use super::fit::PRIOR_ROWS;
use super::*;
use crate::solve::before::adaptive_mean::Mean;
use crate::solve::methods::contacts::{ContactFinder, ContactSettings};
use tactomo_physics::detector::Detector;
use tactomo_physics::forward::{ForwardModel, Slab, readings_v, touched_impedance_ohm};
use tactomo_physics::readings::Readings;
use tactomo_physics::scene::{Shape, Touch};
use tactomo_physics::simulate::{Noise, finer_model, measured};

/// The finders of shapes and of contacts, with what a finer model of the detector reads.
struct ShapeTrial {
    detector: Detector,
    finder: Arc<ShapeFinder>,
    contacts: ContactFinder,
    fine: Box<dyn ForwardModel>,
    noise: Noise,
}

impl ShapeTrial {
    fn new() -> Self {
        let detector = Detector::preset(Detector::DEFAULT).unwrap().taken_as_exact();
        let problem = Problem::new(Box::new(Slab::new(&detector).unwrap()) as Box<dyn ForwardModel>);
        Self {
            finder: Arc::new(ShapeFinder::new(&problem).unwrap().unwrap()),
            contacts: ContactFinder::new(&problem, ContactSettings::of(&problem)).unwrap(),
            fine: finer_model(&detector, &[], 1).unwrap(),
            noise: Noise::new(17),
            detector,
        }
    }

    fn readings(&mut self, touch: &Touch) -> Readings {
        let exact =
            readings_v(&touched_impedance_ohm(&*self.fine, std::slice::from_ref(touch)).unwrap(), &self.detector);
        measured(&exact, &self.detector.adc, &mut self.noise)
    }

    fn target(&mut self, touch: &Touch) -> Target {
        let readings = self.readings(touch);
        self.contacts.target_of(&Mean { readings, frames: 1 }, None).unwrap()
    }

    /// The shape found from four contacts that stand for the touch badly.
    fn found(&mut self, touch: &Touch, contacts: [[f64; 2]; 4]) -> (FoundShape, Target, StripFit) {
        let target = self.target(touch);
        let contacts = contacts.map(|[x_m, y_m]| FoundContact::flat(x_m, y_m, touch.conductance_s / 4.0));
        let fit = self.finder.search(&contacts, None, &target, f64::INFINITY).unwrap();
        (self.finder.shape(&fit), target, fit)
    }
}

fn line(sheets: f64) -> Touch {
    let sheet_s = Detector::default().sheet_conductance_s();
    let shape = Shape::Line { length_m: 0.034, width_m: 0.003, angle_rad: 0.6 };
    Touch::flat([0.003, -0.004], shape, sheets * sheet_s)
}

fn ring(sheets: f64) -> Touch {
    let sheet_s = Detector::default().sheet_conductance_s();
    Touch::flat([0.004, 0.006], Shape::Ring { radius_m: 0.013, width_m: 0.003 }, sheets * sheet_s)
}

/// Beside the ends and the middle of [`line`].
const ALONG: [[f64; 2]; 4] = [[-0.011, -0.011], [0.001, -0.007], [0.007, 0.0], [0.016, 0.003]];
/// Beside [`ring`].
const AROUND: [[f64; 2]; 4] = [[-0.007, 0.003], [0.005, -0.009], [0.015, 0.009], [0.001, 0.017]];

#[test]
fn readings_follow_their_derivatives() {
    let mut trial = ShapeTrial::new();
    let target = trial.target(&line(1.0));
    let finder = Arc::clone(&trial.finder);
    let fitter = finder.fitter(&finder.fine);
    let courses =
        [Course::Line([[-0.012, -0.011], [0.016, 0.034]]), Course::Ring { centre_m: [0.004, 0.006], radius_m: 0.012 }];
    for course in courses {
        let strip = Strip { course, width_m: 0.003, conductance_s: 1e-3 };
        let laid = fitter.lay(strip).unwrap();
        let slopes = fitter.slopes(&laid, &target);
        assert_eq!(slopes.nrows(), 256 + PRIOR_ROWS);
        for parameter in 0..strip.parameters() {
            let is_place = parameter < strip.layout().coordinates;
            let step = if is_place { 2e-6 } else { 1e-3 };
            let [before, after] = [-step, step].map(|by| {
                let mut all = vec![0.0; strip.parameters()];
                all[parameter] = by;
                fitter.look(fitter.lay(strip.moved(&all)).unwrap(), &target).residuals
            });
            let difference = (before - after) / (2.0 * step);
            let off = (slopes.column(parameter) - &difference).norm() / difference.norm();
            assert!(off < 2e-3, "parameter {parameter} of {course:?}: {off}");
        }
    }
}

#[test]
fn a_line_is_found_within_its_standard_errors() {
    let mut trial = ShapeTrial::new();
    for sheets in [0.15, 1.0, 3.0] {
        let touch = line(sheets);
        let (found, target, fit) = trial.found(&touch, ALONG);
        let FoundShape::Line(found) = found else { panic!("{found:?}") };
        assert!(!fit.evidence().is_misfit(target.count()), "{fit:?}");
        let errors = found.uncertainty.unwrap();
        let half_m = [0.017 * 0.6f64.cos(), 0.017 * 0.6f64.sin()];
        let mut ends = [found.from_m, found.to_m].into_iter().zip([errors.from_m, errors.to_m]).collect::<Vec<_>>();
        ends.sort_unstable_by(|a, b| a.0[0].total_cmp(&b.0[0]));
        for ((end_m, error_m), sign) in ends.into_iter().zip([-1.0, 1.0]) {
            for axis in 0..2 {
                let off_m = end_m[axis] - (touch.centre_m[axis] + sign * half_m[axis]);
                assert!(off_m.abs() < 3.0 * error_m[axis] && error_m[axis] < 1e-3, "{found:?}");
            }
        }
        assert!(
            (found.conductance_s - touch.conductance_s).abs() < 3.0 * errors.conductance_s + 0.01 * touch.conductance_s
        );
        assert!((found.width_m - 0.003).abs() < 3.0 * errors.width_m, "{found:?}");
    }
}

#[test]
fn a_ring_is_found_within_its_standard_errors() {
    let mut trial = ShapeTrial::new();
    for sheets in [0.15, 1.0, 3.0] {
        let touch = ring(sheets);
        let (found, target, fit) = trial.found(&touch, AROUND);
        let FoundShape::Ring(found) = found else { panic!("{found:?}") };
        assert!(!fit.evidence().is_misfit(target.count()), "{fit:?}");
        let errors = found.uncertainty.unwrap();
        for axis in 0..2 {
            let off_m = (found.centre_m[axis] - touch.centre_m[axis]).abs();
            assert!(off_m < 3.0 * errors.centre_m[axis] && errors.centre_m[axis] < 5e-4, "{found:?}");
        }
        assert!((found.radius_m - 0.013).abs() < 3.0 * errors.radius_m && errors.radius_m < 5e-4, "{found:?}");
        assert!((found.width_m - 0.003).abs() < 3.0 * errors.width_m, "{found:?}");
        assert!(
            (found.conductance_s - touch.conductance_s).abs() < 3.0 * errors.conductance_s + 0.01 * touch.conductance_s
        );
    }
}

#[test]
fn what_is_beyond_an_edge_is_not_known() {
    let mut trial = ShapeTrial::new();
    let touch = Touch { centre_m: [0.018, -0.004], ..line(1.0) };
    let shifted = ALONG.map(|[x_m, y_m]| [(x_m + 0.012_f64).min(0.029), y_m]);
    let (found, ..) = trial.found(&touch, shifted);
    let FoundShape::Line(found) = found else { panic!("{found:?}") };
    let rightmost_m = found.from_m[0].max(found.to_m[0]);
    assert!((rightmost_m - 0.03).abs() < 1e-9, "{found:?}");
    let image_s = trial.fine.image_mesh().conductances_s(&[touch]).unwrap();
    let on_it_s: f64 = image_s.iter().sum();
    assert!((found.conductance_s / on_it_s - 1.0).abs() < 0.03, "{found:?} {on_it_s}");
}

#[test]
fn the_image_of_a_shape_conducts_what_it_says() {
    let mut trial = ShapeTrial::new();
    let (shape, target, fit) = trial.found(&ring(1.0), AROUND);
    let solution = trial.finder.solution(&fit, &target);
    let areas_m2 = &trial.finder.problem.jacobian.image_mesh.node_areas_m2;
    let image = solution.image_s_per_m2.unwrap();
    let image_s: f64 = image.iter().zip(areas_m2).map(|(density, area_m2)| f64::from(*density) * area_m2).sum();
    assert!((image_s / shape.conductance_s() - 1.0).abs() < 0.01, "{image_s}");
    assert_eq!(solution.shape, Some(shape));
}

#[test]
fn a_shape_is_followed_as_it_moves_and_lost_when_it_is_gone() {
    let mut trial = ShapeTrial::new();
    let (_, target, fit) = trial.found(&line(1.0), ALONG);
    let mut tracker = ShapeTracker::new(Arc::clone(&trial.finder));
    tracker.adopt(&fit, &target);
    assert!(!tracker.has_lost(&target));
    for step in 1..=20 {
        let angle_rad = 0.6 + 0.02 * f64::from(step);
        let shape = Shape::Line { length_m: 0.034, width_m: 0.003, angle_rad };
        let touch = Touch { centre_m: [0.003, -0.004 + 3e-4 * f64::from(step)], shape, ..line(1.0) };
        assert!(!tracker.follow(&trial.target(&touch)), "step {step}");
    }
    let FoundShape::Line(found) = trial.finder.shape(tracker.found().unwrap()) else { panic!() };
    let along = [0, 1].map(|axis| found.to_m[axis] - found.from_m[axis]);
    assert!(((along[1] / along[0]).atan() - 1.0).abs() < 0.01, "{found:?}");
    let target = trial.target(&ring(0.5));
    assert!(tracker.follow(&target), "a ring is no line");
}

#[test]
fn a_ring_that_closes_is_let_go_before_it_is_a_disc() {
    let mut trial = ShapeTrial::new();
    let sheet_s = Detector::default().sheet_conductance_s();
    let touch = |radius_m: f64| Touch::flat([0.004, 0.006], Shape::Ring { radius_m, width_m: 0.006 }, sheet_s);
    let (_, target, fit) = trial.found(&touch(0.013), AROUND);
    let mut tracker = ShapeTracker::new(Arc::clone(&trial.finder));
    tracker.adopt(&fit, &target);
    let mut radius_m = 0.013;
    let mut was_let_go = false;
    while radius_m > 0.004 {
        let target = trial.target(&touch(radius_m));
        let is_lost = tracker.follow(&target);
        // A search would find it again, perhaps as what it is no longer.
        tracker.adopt(&fit, &target);
        if let Some(Solution { shape: Some(FoundShape::Ring(found)), .. }) = tracker.solution(&target) {
            assert!(
                found.radius_m > policy::KEPT_SHAPE_SHARE * 1.5 * found.width_m,
                "{found:?} of a ring of {radius_m} m"
            );
        } else {
            assert!(is_lost);
            was_let_go = true;
        }
        radius_m -= 5e-4;
    }
    assert!(was_let_go);
}
