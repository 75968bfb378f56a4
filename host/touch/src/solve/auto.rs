//! No more model than the scene needs.
//!
//! Nothing, one contact, two, up to five, an image: the first that explains the readings to within noise and the model's
//! error is the answer, and the solution says which and why. What is known is followed from frame to frame, which costs least,
//! and searched anew only when it no longer explains the readings, or now and then.

use std::sync::Arc;

use super::contacts::{ContactFinder, ContactFollower, ContactSearcher};
use super::follow::{Followed, Follower, Known, Lead, Parts, Searcher, follow_and_search};
use super::still::{Mean, Still};
use super::{
    Choice, ContactSettings, FoundContact, Nonlinear, NonlinearSettings, Problem, Solution, SolveError, Solver,
};
use tactomo_physics::forward::ForwardError;
use tactomo_physics::readings::Readings;

/// After so many frames that contacts did not explain, they are tried again; doubled each time, up to the second.
const PATIENCE: [u32; 2] = [2, 64];

/// Chooses the model of the scene.
pub struct Auto {
    follower: AutoFollower,
    searcher: AutoSearcher,
}

/// Follows whichever model was chosen last.
struct AutoFollower {
    electrodes: usize,
    still: Still,
    contacts: Option<ContactFollower>,
    image: Nonlinear,
    /// Why an image is followed; `None` while contacts are.
    imaged: Option<String>,
    /// Frames for which contacts are not tried, and how many it will be next time.
    skip: u32,
    patience: u32,
}

/// Chooses the model.
struct AutoSearcher {
    contacts: Option<ContactSearcher>,
    image: Nonlinear,
    /// What the image that was found last leaves.
    residual: Option<f64>,
}

impl Auto {
    /// Makes it ready for a problem.
    ///
    /// # Errors
    /// [`ForwardError`] if the model cannot be had on a coarser image.
    pub fn new(problem: &Problem) -> Result<Self, ForwardError> {
        // A model without fields of single contacts has images only.
        let finder = ContactFinder::new(problem, ContactSettings::of(problem)).ok().map(Arc::new);
        let image = Nonlinear::new(problem, NonlinearSettings::default())?;
        let follower = AutoFollower {
            electrodes: problem.detector().electrodes.len(),
            still: Still::new(problem.detector().adc.deviation_v()),
            contacts: finder.clone().map(ContactFollower::new),
            image: image.clone(),
            imaged: None,
            skip: 0,
            patience: PATIENCE[0],
        };
        Ok(Self {
            follower,
            searcher: AutoSearcher { contacts: finder.map(ContactSearcher::new), image, residual: None },
        })
    }
}

impl Solver for Auto {
    fn name(&self) -> &'static str {
        "auto"
    }

    fn solve(&mut self, readings: &Readings) -> Result<Solution, SolveError> {
        follow_and_search(&mut self.follower, &mut self.searcher, readings)
    }

    fn reset(&mut self) {
        self.follower.reset();
        self.searcher.image.reset();
    }

    fn split(self: Box<Self>) -> Parts {
        Parts { follower: Box::new(self.follower), searcher: Some(Box::new(self.searcher)) }
    }
}

impl AutoFollower {
    fn follow_image(&mut self, readings: &Readings, why: String) -> Result<Followed, SolveError> {
        let (solution, is_lost) = self.image.follow(readings)?;
        let search = is_lost || self.skip == 0;
        self.skip = self.skip.saturating_sub(1);
        let followed = Followed { solution: imaged(solution, &why), search };
        self.imaged = Some(why);
        Ok(followed)
    }

    fn follow_contacts(&mut self, readings: &Readings) -> Result<Followed, SolveError> {
        let Some(contacts) = &mut self.contacts else {
            let search = !self.image.is_rest(readings);
            return Ok(Followed { solution: nothing(Solution::default(), search), search });
        };
        let target = contacts.finder().target_of(&self.still.mean_or(readings))?;
        let search = contacts.follow(&target);
        Ok(Followed { solution: as_contacts(contacts.solution(&target), search), search })
    }

    fn follow_known(&mut self, readings: &Readings) -> Result<Followed, SolveError> {
        match self.imaged.take() {
            Some(why) if !self.image.is_rest(readings) => self.follow_image(readings, why),
            _ => self.follow_contacts(readings),
        }
    }

    /// Derivatives of the readings by the parameters of the contacts that are followed (V).
    fn slopes_v(contacts: Option<&ContactFollower>) -> &[Vec<f64>] {
        contacts.map_or(&[], ContactFollower::slopes_v)
    }

    fn begin_with_contacts(&mut self) {
        (self.imaged, self.skip, self.patience) = (None, 0, PATIENCE[0]);
    }
}

impl Follower for AutoFollower {
    fn follow(&mut self, readings: &Readings) -> Result<Followed, SolveError> {
        super::check(readings, self.electrodes)?;
        self.still.add_beside(readings.volts(), Self::slopes_v(self.contacts.as_ref()));
        self.follow_known(readings)
    }

    fn adopt(&mut self, lead: Lead, readings: &Readings) -> Result<Followed, SolveError> {
        super::check(readings, self.electrodes)?;
        self.still.add_if_new(readings.volts(), Self::slopes_v(self.contacts.as_ref()));
        let mean = lead.mean;
        match lead.known {
            Known::Image(descent, why) if !self.image.is_rest(readings) => {
                // An image of the past is no better than contacts that explain the present.
                let followed = self.follow_known(readings)?;
                if self.imaged.is_none() && !followed.solution.contacts.is_empty() && !followed.solution.flags.misfit {
                    return Ok(Followed { search: false, ..followed });
                }
                self.image.go_on_from(Some(*descent));
                self.skip = self.patience;
                self.patience = (2 * self.patience).min(PATIENCE[1]);
                if let Some(contacts) = &mut self.contacts {
                    contacts.let_go();
                }
                self.follow_image(readings, why)
            }
            known => {
                // Nor are contacts of the past better than an image that explains the present.
                let image = self.imaged.take().map(|why| self.follow_image(readings, why)).transpose()?;
                let Some(contacts) = &mut self.contacts else { return self.follow_contacts(readings) };
                let target = contacts.finder().target_of(&self.still.mean_or(readings))?;
                let search = contacts.adopt(Lead { known, mean }, &target);
                let left = contacts.residual(readings)?;
                if let Some(image) = image.filter(|image| left > image.solution.residual) {
                    contacts.let_go();
                    return Ok(image);
                }
                let solution = as_contacts(contacts.solution(&target), search);
                self.begin_with_contacts();
                Ok(Followed { solution, search })
            }
        }
    }

    fn lead(&self) -> Lead {
        let mean = self.still.mean();
        match (&self.imaged, self.image.descent(), &self.contacts) {
            (Some(why), Some(descent), _) => Lead { known: Known::Image(Box::new(descent.clone()), why.clone()), mean },
            (_, _, Some(contacts)) => Lead::of_contacts(contacts.found(), mean),
            _ => Lead { mean, ..Lead::default() },
        }
    }

    fn inherit(&mut self, before: &[FoundContact]) {
        if let Some(contacts) = &mut self.contacts {
            contacts.inherit(before);
        }
    }

    fn reset(&mut self) {
        if let Some(contacts) = &mut self.contacts {
            contacts.reset();
        }
        self.still.reset();
        self.image.reset();
        self.begin_with_contacts();
    }
}

impl Searcher for AutoSearcher {
    fn search(&mut self, from: Lead, readings: &Readings, found: &mut dyn FnMut(Lead)) -> Result<Lead, SolveError> {
        let mean = from.mean_or(readings);
        let known = self.search_mean(from.known, &mean, found)?;
        Ok(Lead { known, mean: Some(mean) })
    }
}

impl AutoSearcher {
    fn search_mean(&mut self, from: Known, mean: &Mean, found: &mut dyn FnMut(Lead)) -> Result<Known, SolveError> {
        let Some(searcher) = &self.contacts else {
            let why = "this model has no fields of single contacts".to_owned();
            return self.search_image(from, &mean.readings, why);
        };
        // A picture does not change to contacts that may not explain it.
        let mut nowhere = |_| {};
        let (contacts, from, found): (_, _, &mut dyn FnMut(Lead)) = match from {
            Known::Contacts(contacts) => (Some(*contacts), Known::Nothing, found),
            Known::Nothing => (None, from, found),
            Known::Image(..) => (None, from, &mut nowhere),
        };
        let Some((found, solution)) = searcher.contacts(contacts, mean, found)? else {
            return Ok(Known::Nothing);
        };
        if !solution.flags.misfit {
            return Ok(Known::Contacts(Box::new(found)));
        }
        let left = solution.residual.unwrap_or_default();
        let why = format!("{} would leave a residual of {left:.1} x noise", counted(solution.contacts.len()));
        let image = self.search_image(from, &mean.readings, why)?;
        // An image that explains less than contacts do is no better. What it leaves is in the noise of one frame.
        let averaged = (mean.frames as f64).sqrt();
        let is_better = self.residual.is_none_or(|residual| residual * averaged <= left);
        Ok(if is_better { image } else { Known::Contacts(Box::new(found)) })
    }

    fn search_image(&mut self, from: Known, readings: &Readings, why: String) -> Result<Known, SolveError> {
        if self.image.is_rest(readings) {
            return Ok(Known::Nothing);
        }
        self.image.go_on_from(match from {
            Known::Image(descent, _) => Some(*descent),
            Known::Nothing | Known::Contacts(_) => None,
        });
        self.residual = self.image.begin(readings)?.residual;
        let image = self.image.descent().cloned();
        Ok(image.map_or(Known::Nothing, |descent| Known::Image(Box::new(descent), why)))
    }
}

/// The solution of contacts, and what it is.
fn as_contacts(solution: Solution, search: bool) -> Solution {
    if solution.contacts.is_empty() {
        return nothing(solution, search);
    }
    let what = counted(solution.contacts.len());
    let residual = solution.residual.unwrap_or_default();
    let why = match search {
        true => format!("residual {residual:.1} x noise; searching for a better answer"),
        false => format!("residual {residual:.1} x noise"),
    };
    chosen(solution, what, why)
}

/// The solution of nothing; unless something stands out, and is searched.
fn nothing(mut solution: Solution, search: bool) -> Solution {
    solution.flags.unfinished |= search;
    let (what, why) = match search {
        true => ("searching", "something touches, and it is not known yet what"),
        false => ("nothing", "no reading stands out of the noise"),
    };
    chosen(solution, what.to_owned(), why.to_owned())
}

/// The solution of an image, and why it is one.
fn imaged(solution: Solution, why: &str) -> Solution {
    let residual = solution.residual.unwrap_or_default();
    chosen(solution, "image".to_owned(), format!("residual {residual:.1} x noise; {why}"))
}

fn chosen(solution: Solution, what: String, why: String) -> Solution {
    Solution { choice: Some(Choice { what, why }), ..solution }
}

fn counted(contacts: usize) -> String {
    if contacts == 1 { "1 contact".to_owned() } else { format!("{contacts} contacts") }
}

#[cfg(test)]
mod tests {
    use super::*;
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
        let moved = |x_m: f64| {
            [Contact::flat(0.008 + x_m, 0.004, 0.0025, 3e-4), Contact::flat(-0.012, -0.009 + x_m, 0.0025, 5e-4)]
        };
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
}
