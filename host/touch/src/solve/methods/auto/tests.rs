//! Tests of the choice between contacts, shapes and images.

use std::f64::consts::FRAC_PI_2;
use std::ops::ControlFlow;

use super::*;
use crate::solve::answer::{FoundContact, FoundShape, Solution};
use crate::solve::solver::Hypothesis;
use tactomo_physics::detector::Detector;
use tactomo_physics::forward::{ForwardModel, Resolution, Slab, readings_v, touched_impedance_ohm};
use tactomo_physics::scene::{Contact, Shape, Touch};
use tactomo_physics::simulate::{Noise, drawn, measured};

/// The solver, with what a finer model of the detector reads.
struct AutoTrial {
    detector: Detector,
    fine: Slab,
    auto: Auto,
    noise: Noise,
}

impl AutoTrial {
    fn new() -> Self {
        Self::on(Detector::DEFAULT)
    }

    fn on(preset: &str) -> Self {
        let mut detector = Detector::preset(preset).unwrap().taken_as_exact();
        detector.adc.noise_lsb = 1.5;
        let slab: Box<dyn ForwardModel> = Box::new(Slab::new(&detector).unwrap());
        let auto = Auto::new(&Problem::new(slab)).unwrap();
        let fine = Slab::with_resolution(&detector, Resolution::FINE).unwrap().on_image(3000);
        Self { detector, fine, auto, noise: Noise::new(11) }
    }

    fn solve(&mut self, exact: &Readings) -> Solution {
        self.auto.solve(&measured(exact, &self.detector.adc, &mut self.noise)).unwrap()
    }

    fn touched(&mut self, contacts: &[Contact]) -> Solution {
        let readings = self.measured(contacts);
        self.auto.solve(&readings).unwrap()
    }

    fn measured(&mut self, contacts: &[Contact]) -> Readings {
        let exact = readings_v(&self.fine.impedance_ohm(contacts).unwrap(), &self.detector);
        measured(&exact, &self.detector.adc, &mut self.noise)
    }

    /// Readings of shapes at places (m), of conductances in sheet conductances.
    fn shaped(&mut self, shapes: &[([f64; 2], Shape, f64)]) -> Readings {
        let sheet_s = self.detector.sheet_conductance_s();
        let touch =
            |(at_m, shape, sheets): &([f64; 2], Shape, f64)| Touch::flat(*at_m, shape.clone(), sheets * sheet_s);
        let touches: Vec<_> = shapes.iter().map(touch).collect();
        let exact = readings_v(&touched_impedance_ohm(&self.fine, &touches).unwrap(), &self.detector);
        measured(&exact, &self.detector.adc, &mut self.noise)
    }

    /// The frame of a square: no line, no ring, no few discs.
    fn frame(&mut self) -> Readings {
        let side = |turn: u8| {
            let angle_rad = 0.2 + f64::from(turn) * FRAC_PI_2;
            let (sin, cos) = angle_rad.sin_cos();
            ([-0.018 * sin, 0.018 * cos], Shape::Line { length_m: 0.036, width_m: 0.003, angle_rad }, 1.0)
        };
        self.shaped(&[side(0), side(1), side(2), side(3)])
    }

    fn problem(&self) -> Problem {
        let slab: Box<dyn ForwardModel> = Box::new(Slab::new(&self.detector).unwrap());
        Problem::new(slab)
    }
}

fn what(solution: &Solution) -> &str {
    solution.choice.as_ref().map_or("", |choice| &choice.what)
}

#[test]
fn it_takes_no_more_than_the_scene_needs() {
    let mut trial = AutoTrial::new();
    let rest = trial.solve(&Readings::from_fn(16, |_, _| 0.0));
    assert_eq!((what(&rest), rest.contacts.len()), ("nothing", 0));
    let [a, b] = [Contact::flat(0.01, 0.004, 0.0025, 3e-4), Contact::flat(-0.012, -0.009, 0.0025, 5e-4)];
    let one = trial.touched(&[a]);
    assert_eq!((what(&one), one.contacts.len()), ("1 contact", 1));
    let two = trial.touched(&[a, b]);
    assert_eq!((what(&two), two.contacts.len()), ("2 contacts", 2));
    let frame = trial.frame();
    let image = trial.auto.solve(&frame).unwrap();
    assert_eq!((what(&image), image.image_s_per_m2.is_some()), ("image", true), "{:?}", image.choice);
    assert!(image.shape.is_none() && image.contacts.len() > 2, "contacts are kept beside it: {image:?}");
    let again = trial.touched(&[a]);
    assert_eq!(what(&again), "1 contact", "the image no longer explains anything");
}

#[test]
fn two_alike_contacts_near_each_other_may_be_a_line_and_are_never_surely_one() {
    // 10.5 mm apart: a line of 18 mm leaves about as much.
    let mut trial = AutoTrial::new();
    let pair = |turn: u8, apart_m: f64| {
        let (sin, cos) = (0.8 * f64::from(turn)).sin_cos();
        let at = |side: f64| Contact::flat(8e-3 * sin + side * cos, 8e-3 * cos + side * sin, 0.0014, 3.4e-4);
        [-0.5 * apart_m, 0.5 * apart_m].map(at)
    };
    let mut followed = 0;
    let pairs = (0..8).map(|turn| {
        trial.auto.reset();
        let first = what(&trial.touched(&pair(turn, 0.0105))).to_owned();
        if first == "2 contacts or a line" {
            // They part without a search: of two that far apart no line is claimed.
            let next = trial.measured(&pair(turn, 0.0115));
            let next = trial.auto.tracker.follow(&next).unwrap();
            assert!(next.search || what(&next.solution) == "2 contacts", "{next:?}");
            followed += u32::from(!next.search);
        }
        first
    });
    let pairs: Vec<_> = pairs.collect();
    assert!(followed > 0, "{pairs:?}");
    assert!(pairs.iter().all(|what| what != "line"), "{pairs:?}");
    assert!(pairs.iter().any(|what| what == "2 contacts or a line"), "{pairs:?}");
    assert!(pairs.iter().filter(|what| what.starts_with('2')).count() >= 6, "{pairs:?}");
}

#[test]
fn a_touch_is_seen_in_its_first_frame_where_it_is_and_nothing_is_seen_without_one() {
    let mut trial = AutoTrial::new();
    let Parts { mut tracker, .. } = Box::new(Auto::new(&trial.problem()).unwrap()).split();
    let nothing = tracker.follow(&Readings::from_fn(16, |_, _| 0.0)).unwrap();
    assert_eq!((what(&nothing.solution), nothing.solution.image_s_per_m2.is_none()), ("nothing", true));
    let [x_m, y_m] = [0.01, 0.004];
    let touched = trial.measured(&[Contact::flat(x_m, y_m, 0.0025, 3e-4)]);
    let mesh = trial.problem().jacobian.image_mesh.clone();
    let peak_m = |solution: &Solution| {
        let image = solution.image_s_per_m2.as_deref().unwrap();
        assert!(image.iter().all(|density| *density >= 0.0));
        let highest = image.iter().enumerate().max_by(|a, b| a.1.total_cmp(b.1)).unwrap().0;
        mesh.nodes_m[highest]
    };
    // Before a search, and after one that has led to nothing.
    let followed = tracker.follow(&touched).unwrap();
    let adopted = tracker.adopt(Hypothesis::default(), &touched).unwrap();
    for followed in [followed, adopted] {
        assert_eq!((what(&followed.solution), followed.search), ("searching", true), "{followed:?}");
        let [x, y] = peak_m(&followed.solution);
        assert!((x - x_m).hypot(y - y_m) < 0.004, "{x} {y}");
    }
}

#[test]
fn what_an_image_explains_is_a_line_if_it_is_one_where_contacts_lead_nowhere() {
    let mut trial = AutoTrial::on("strip-13x60");
    let rod = Shape::Line { length_m: 0.036, width_m: 0.0018, angle_rad: 1.6 };
    let readings = trial.shaped(&[([0.0004, 0.003], rod, 20.0)]);
    let target = trial.auto.search.finder.as_ref().unwrap().target_of(&Mean::of_frame(&readings), None).unwrap();
    // Two of the rod's ends, of which one is where there is nothing: as a search that got lost leaves them.
    let lost = Solution {
        contacts: vec![FoundContact::flat(-0.005, 0.027, 1e-5), FoundContact::flat(0.006, -0.028, 3e-6)],
        ..Solution::default()
    };
    let whole = trial.auto.search.whole((Evidence::of(2e4, 8), &lost), None, &target, &readings).unwrap();
    let (Some(Whole::Shape(line)), None) = whole else { panic!("an image, or nothing") };
    assert!(line.strip().is_line() && (line.strip().course.length_m() - 0.036).abs() < 0.002, "{:?}", line.strip());
}

#[test]
fn a_firm_rod_between_two_columns_of_electrodes_is_a_line_at_its_first_frame() {
    let mut trial = AutoTrial::on("strip-13x60");
    let rod = Shape::Line { length_m: 0.036, width_m: 0.0018, angle_rad: FRAC_PI_2 };
    for y_m in [0.0, 0.001, -0.002, 0.003, 0.005, -0.004] {
        let readings = trial.shaped(&[([0.0001, y_m], rod.clone(), 4.0)]);
        trial.auto.reset();
        let solution = trial.auto.solve(&readings).unwrap();
        let Some(FoundShape::Line(line)) = solution.shape else { panic!("at {y_m}: {:?}", solution.choice) };
        assert!((line.length_m() - 0.036).abs() < 5e-4, "{line:?}");
    }
}

#[test]
fn a_follower_goes_on_from_what_was_searched_some_frames_ago() {
    let mut trial = AutoTrial::new();
    let Parts { mut tracker, search } = Box::new(Auto::new(&trial.problem()).unwrap()).split();
    let mut search = search.unwrap();
    let moved =
        |x_m: f64| [Contact::flat(0.008 + x_m, 0.004, 0.0025, 3e-4), Contact::flat(-0.012, -0.009 + x_m, 0.0025, 5e-4)];
    let first = trial.measured(&moved(0.0));
    let before = tracker.follow(&first).unwrap();
    assert!(before.search && before.solution.flags.unfinished && before.solution.contacts.is_empty());
    let hypothesis = search.search(tracker.hypothesis(), &first, &mut |_| ControlFlow::Continue(())).unwrap();
    // The answer comes when the contacts are 3 mm further on.
    let after = tracker.adopt(hypothesis, &trial.measured(&moved(0.003))).unwrap();
    assert_eq!((what(&after.solution), after.search), ("2 contacts", false), "{after:?}");
    let ids: Vec<_> = after.solution.contacts.iter().map(|contact| contact.id).collect();
    for step in 0..20 {
        let truth = moved(0.003 + 1e-4 * f64::from(step));
        let next = tracker.follow(&trial.measured(&truth)).unwrap();
        assert_eq!((what(&next.solution), next.search), ("2 contacts", false), "{next:?}");
        assert_eq!(next.solution.contacts.iter().map(|contact| contact.id).collect::<Vec<_>>(), ids);
        for contact in truth {
            let off_m = |found: &FoundContact| (found.x_m - contact.x_m).hypot(found.y_m - contact.y_m);
            assert!(next.solution.contacts.iter().any(|found| off_m(found) < 3e-4), "{next:?}");
        }
    }
    let lifted = tracker.follow(&trial.measured(&moved(0.005)[..1])).unwrap();
    assert_eq!(
        (what(&lifted.solution), lifted.search),
        ("1 contact", false),
        "a finger that lifts is gone at once: {lifted:?}"
    );
}

#[test]
fn a_search_of_the_past_does_not_replace_what_explains_the_present() {
    let mut trial = AutoTrial::new();
    let Parts { mut tracker, search } = Box::new(Auto::new(&trial.problem()).unwrap()).split();
    let mut search = search.unwrap();
    let [a, b] = [Contact::flat(0.01, 0.004, 0.0025, 3e-4), Contact::flat(-0.012, -0.009, 0.0025, 5e-4)];
    let past = search.search(Hypothesis::default(), &trial.measured(&[a]), &mut |_| ControlFlow::Continue(())).unwrap();
    let present = trial.measured(&[a, b]);
    let hypothesis = search.search(Hypothesis::default(), &present, &mut |_| ControlFlow::Continue(())).unwrap();
    tracker.adopt(hypothesis, &present).unwrap();
    let kept = tracker.adopt(past, &trial.measured(&[a, b])).unwrap();
    assert_eq!(what(&kept.solution), "2 contacts");
}

#[test]
fn an_image_and_contacts_of_the_past_do_not_replace_each_other() {
    let mut trial = AutoTrial::new();
    let Parts { mut tracker, search } = Box::new(Auto::new(&trial.problem()).unwrap()).split();
    let mut search = search.unwrap();
    let a = [Contact::flat(0.01, 0.004, 0.0025, 3e-4)];
    let frame = trial.frame();
    let image = search.search(Hypothesis::default(), &frame, &mut |_| ControlFlow::Continue(())).unwrap();
    let contact =
        search.search(Hypothesis::default(), &trial.measured(&a), &mut |_| ControlFlow::Continue(())).unwrap();
    tracker.adopt(contact.clone(), &trial.measured(&a)).unwrap();
    let kept = tracker.adopt(image.clone(), &trial.measured(&a)).unwrap();
    assert_eq!(what(&kept.solution), "1 contact");
    tracker.reset();
    tracker.adopt(image, &frame).unwrap();
    let kept = tracker.adopt(contact, &frame).unwrap();
    assert_eq!(what(&kept.solution), "image");
}

#[test]
fn a_contact_whose_readings_all_hide_in_the_noise_is_found() {
    let mut trial = AutoTrial::new();
    let light = [Contact::flat(0.004, -0.009, 0.0025, 1.2e-6)];
    let readings = trial.measured(&light);
    assert!(readings.largest_v() < 5.0 * trial.detector.adc.deviation_v(), "{}", readings.largest_v());
    let solution = trial.auto.solve(&readings).unwrap();
    assert_eq!(what(&solution), "1 contact", "{solution:?}");
}

#[test]
fn shapes_are_shapes_with_contacts_beside_them() {
    let mut trial = AutoTrial::new();
    let line = Shape::Line { length_m: 0.035, width_m: 0.003, angle_rad: 0.7 };
    let ring = Shape::Ring { radius_m: 0.013, width_m: 0.003 };
    for (shape, name) in [(line, "line"), (ring, "ring")] {
        let readings = trial.shaped(&[([0.002, -0.003], shape.clone(), 1.5)]);
        let solution = trial.auto.solve(&readings).unwrap();
        assert_eq!(what(&solution), name);
        assert_eq!(solution.shape.map(|shape| shape.name()), Some(name));
        assert!(
            !solution.flags.misfit && !solution.contacts.is_empty() && !solution.is_contacts(),
            "{:?}",
            solution.choice
        );
        let ids: Vec<_> = solution.contacts.iter().map(|contact| contact.id).collect();
        let readings = trial.shaped(&[([0.002, -0.003], shape, 1.5)]);
        let next = trial.auto.solve(&readings).unwrap();
        assert_eq!((what(&next), next.contacts.iter().map(|contact| contact.id).collect::<Vec<_>>()), (name, ids));
    }
    let one = trial.touched(&[Contact::flat(0.01, 0.004, 0.0025, 3e-4)]);
    assert_eq!((what(&one), one.shape, one.image_s_per_m2.is_none()), ("1 contact", None, true));
    let readings = trial.shaped(&[([0.002, -0.003], Shape::Ring { radius_m: 0.013, width_m: 0.003 }, 1.5)]);
    assert_eq!(what(&trial.auto.solve(&readings).unwrap()), "ring");
    let gone = trial.solve(&Readings::from_fn(16, |_, _| 0.0));
    assert_eq!((what(&gone), gone.contacts.len()), ("nothing", 0));
}

#[test]
fn a_shape_and_contacts_of_the_past_do_not_replace_each_other() {
    let mut trial = AutoTrial::new();
    let Parts { mut tracker, search } = Box::new(Auto::new(&trial.problem()).unwrap()).split();
    let mut search = search.unwrap();
    let pair = [Contact::flat(0.01, 0.004, 0.0025, 3e-4), Contact::flat(-0.012, -0.009, 0.0025, 5e-4)];
    let bar = [([0.002, -0.003], Shape::Line { length_m: 0.035, width_m: 0.003, angle_rad: 0.7 }, 1.5)];
    let line = search.search(Hypothesis::default(), &trial.shaped(&bar), &mut |_| ControlFlow::Continue(())).unwrap();
    let contacts =
        search.search(Hypothesis::default(), &trial.measured(&pair), &mut |_| ControlFlow::Continue(())).unwrap();
    tracker.adopt(contacts.clone(), &trial.measured(&pair)).unwrap();
    let kept = tracker.adopt(line.clone(), &trial.measured(&pair)).unwrap();
    assert!(kept.solution.is_contacts() && !kept.search, "{kept:?}");
    tracker.reset();
    tracker.adopt(line, &trial.shaped(&bar)).unwrap();
    let kept = tracker.adopt(contacts, &trial.shaped(&bar)).unwrap();
    assert_eq!((what(&kept.solution), kept.search), ("line", false));
    let lifted = tracker.follow(&trial.measured(&pair)).unwrap();
    assert!(lifted.search, "two fingers are no bar");
}

#[test]
fn a_ring_that_has_moved_on_a_detector_as_built_is_found_from_where_it_was() {
    let described = Detector::preset(Detector::DEFAULT).unwrap();
    let built = drawn(&described, 3);
    let fine = Slab::with_resolution(&built, Resolution::FINE).unwrap().on_image(3000);
    let mut noise = Noise::new(7);
    let mut ring_at = |x_m: f64| {
        let ring = Shape::Ring { radius_m: 0.013, width_m: 0.003 };
        let touch = Touch::flat([x_m, -0.003], ring, 1.5 * described.sheet_conductance_s());
        measured(&readings_v(&touched_impedance_ohm(&fine, &[touch]).unwrap(), &built), &built.adc, &mut noise)
    };
    let Parts { mut tracker, search } = Box::new(Auto::new(&Problem::of(&described).unwrap()).unwrap()).split();
    let mut search = search.unwrap();
    let (before, after) = (ring_at(0.008), ring_at(-0.008));
    let found = search.search(Hypothesis::default(), &before, &mut |_| ControlFlow::Continue(())).unwrap();
    let followed = tracker.adopt(found, &before).unwrap();
    assert_eq!(what(&followed.solution), "ring");
    assert!(tracker.follow(&after).unwrap().search, "it has gone farther than it is followed");
    let moved = search.search(tracker.hypothesis(), &after, &mut |_| ControlFlow::Continue(())).unwrap();
    let moved = tracker.adopt(moved, &after).unwrap().solution;
    let Some(FoundShape::Ring(ring)) = &moved.shape else { panic!("{moved:?}") };
    assert!(
        (ring.centre_m[0] + 0.008).hypot(ring.centre_m[1] + 0.003) < 1.5e-3 && !moved.flags.is_doubtful(),
        "{ring:?} {:?}",
        moved.flags
    );
    // Contacts that were searched from nothing are fewer.
    assert_eq!(moved.contacts.len(), 6, "they stand in a row along where it was");
}

#[test]
fn a_press_at_a_wall_of_a_detector_that_is_far_from_its_description_is_one_contact() {
    // A quarter thicker. As described, two contacts explain the press better than one, and a ring better than these.
    let described = Detector::preset(Detector::DEFAULT).unwrap();
    let built = drawn(&described, 2005);
    let fine = Slab::with_resolution(&built, Resolution::FINE).unwrap();
    let mut auto = Auto::new(&Problem::of(&described).unwrap()).unwrap();
    let mut noise = Noise::new(5);
    for (x_m, y_m, sheets) in [(-0.0257, 0.0207, 0.6), (-0.0219, -0.0255, 1.3)] {
        let press = Contact::flat(x_m, y_m, 0.003, sheets * described.sheet_conductance_s());
        let exact = readings_v(&fine.impedance_ohm(&[press]).unwrap(), &built);
        auto.reset();
        let solution = auto.solve(&measured(&exact, &built.adc, &mut noise)).unwrap();
        let [found] = &solution.contacts[..] else { panic!("{solution:?}") };
        assert_eq!(what(&solution), "1 contact");
        assert!((found.x_m - x_m).hypot(found.y_m - y_m) < 2e-3, "{found:?}");
    }
}
