//! Tests of the choice between contacts, shapes and images.

use super::*;
use crate::solve::follow::Lead;
use crate::solve::{FoundContact, Solution};
use tactomo_physics::detector::Detector;
use tactomo_physics::forward::{ForwardModel, Resolution, Slab, readings_v};
use tactomo_physics::scene::Contact;
use tactomo_physics::simulate::{Noise, measured};

struct Bench {
    detector: Detector,
    fine: Slab,
    auto: Auto,
    noise: Noise,
}

impl Bench {
    fn new() -> Self {
        let mut detector = Detector::preset(Detector::DEFAULT).unwrap();
        detector.adc.noise_lsb = 1.5;
        let slab: Box<dyn ForwardModel> = Box::new(Slab::new(&detector).unwrap());
        let auto = Auto::new(&Problem::new(slab)).unwrap();
        let fine = Slab::with_resolution(&detector, Resolution::FINE).unwrap().on_image(900);
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

    /// Readings of a frame all around: nothing that a few discs can be.
    fn frame_around(&mut self) -> Readings {
        let nodes = &self.fine.image_mesh().nodes_m;
        let ring: Vec<_> =
            nodes.iter().map(|[x, y]| f64::from(u8::from((x.hypot(*y) - 0.018).abs() < 0.002)) * 2e-4).collect();
        let exact = readings_v(&self.fine.image_impedance_ohm(&ring).unwrap(), &self.detector);
        measured(&exact, &self.detector.adc, &mut self.noise)
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
    let mut bench = Bench::new();
    let rest = bench.solve(&Readings::from_fn(16, |_, _| 0.0));
    assert_eq!((what(&rest), rest.contacts.len()), ("nothing", 0));
    let [a, b] = [Contact::flat(0.01, 0.004, 0.0025, 3e-4), Contact::flat(-0.012, -0.009, 0.0025, 5e-4)];
    let one = bench.touched(&[a]);
    assert_eq!((what(&one), one.contacts.len()), ("1 contact", 1));
    let two = bench.touched(&[a, b]);
    assert_eq!((what(&two), two.contacts.len()), ("2 contacts", 2));
    let around = bench.frame_around();
    let image = bench.auto.solve(&around).unwrap();
    assert_eq!((what(&image), image.image_s_per_m2.is_some()), ("image", true), "{:?}", image.choice);
    let again = bench.touched(&[a]);
    assert_eq!(what(&again), "1 contact", "the image no longer explains anything");
}

#[test]
fn a_follower_goes_on_from_what_was_searched_some_frames_ago() {
    let mut bench = Bench::new();
    let Parts { mut follower, searcher } = Box::new(Auto::new(&bench.problem()).unwrap()).split();
    let mut searcher = searcher.unwrap();
    let moved =
        |x_m: f64| [Contact::flat(0.008 + x_m, 0.004, 0.0025, 3e-4), Contact::flat(-0.012, -0.009 + x_m, 0.0025, 5e-4)];
    let first = bench.measured(&moved(0.0));
    let before = follower.follow(&first).unwrap();
    assert!(before.search && before.solution.flags.unfinished && before.solution.contacts.is_empty());
    let lead = searcher.search(follower.lead(), &first, &mut |_| {}).unwrap();
    // The answer comes when the contacts are 3 mm further on.
    let after = follower.adopt(lead, &bench.measured(&moved(0.003))).unwrap();
    assert_eq!((what(&after.solution), after.search), ("2 contacts", false), "{after:?}");
    let ids: Vec<_> = after.solution.contacts.iter().map(|contact| contact.id).collect();
    for step in 0..20 {
        let truth = moved(0.003 + 1e-4 * f64::from(step));
        let next = follower.follow(&bench.measured(&truth)).unwrap();
        assert_eq!((what(&next.solution), next.search), ("2 contacts", false), "{next:?}");
        assert_eq!(next.solution.contacts.iter().map(|contact| contact.id).collect::<Vec<_>>(), ids);
        for contact in truth {
            let off_m = |found: &FoundContact| (found.x_m - contact.x_m).hypot(found.y_m - contact.y_m);
            assert!(next.solution.contacts.iter().any(|found| off_m(found) < 3e-4), "{next:?}");
        }
    }
    let lifted = follower.follow(&bench.measured(&moved(0.005)[..1])).unwrap();
    assert_eq!(
        (what(&lifted.solution), lifted.search),
        ("1 contact", false),
        "a finger that lifts is gone at once: {lifted:?}"
    );
}

#[test]
fn a_search_of_the_past_does_not_replace_what_explains_the_present() {
    let mut bench = Bench::new();
    let Parts { mut follower, searcher } = Box::new(Auto::new(&bench.problem()).unwrap()).split();
    let mut searcher = searcher.unwrap();
    let [a, b] = [Contact::flat(0.01, 0.004, 0.0025, 3e-4), Contact::flat(-0.012, -0.009, 0.0025, 5e-4)];
    let past = searcher.search(Lead::default(), &bench.measured(&[a]), &mut |_| {}).unwrap();
    let present = bench.measured(&[a, b]);
    let lead = searcher.search(Lead::default(), &present, &mut |_| {}).unwrap();
    follower.adopt(lead, &present).unwrap();
    let kept = follower.adopt(past, &bench.measured(&[a, b])).unwrap();
    assert_eq!(what(&kept.solution), "2 contacts");
}

#[test]
fn an_image_and_contacts_of_the_past_do_not_replace_each_other() {
    let mut bench = Bench::new();
    let Parts { mut follower, searcher } = Box::new(Auto::new(&bench.problem()).unwrap()).split();
    let mut searcher = searcher.unwrap();
    let a = [Contact::flat(0.01, 0.004, 0.0025, 3e-4)];
    let frame_around = bench.frame_around();
    let image = searcher.search(Lead::default(), &frame_around, &mut |_| {}).unwrap();
    let contact = searcher.search(Lead::default(), &bench.measured(&a), &mut |_| {}).unwrap();
    follower.adopt(contact.clone(), &bench.measured(&a)).unwrap();
    let kept = follower.adopt(image.clone(), &bench.measured(&a)).unwrap();
    assert_eq!(what(&kept.solution), "1 contact");
    follower.reset();
    follower.adopt(image, &frame_around).unwrap();
    let kept = follower.adopt(contact, &frame_around).unwrap();
    assert_eq!(what(&kept.solution), "image");
}
