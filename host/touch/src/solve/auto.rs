//! No more model than the scene needs.
//!
//! Nothing, one contact, two, up to five, an image: the first that explains the readings to within noise and the model's
//! error is the answer, and the solution says which and why. Contacts are followed from frame to frame, which costs least,
//! and searched anew only when they no longer explain the readings, or now and then, when their number may have changed by less than one
//! frame's noise. Where frames come faster than the thorough answer, it is given now and then and a cheaper one between.

use std::time::{Duration, Instant};

use super::contacts::Effort;
use super::{Choice, ContactSettings, Contacts, Lambda, Problem, Solution, SolveError, Solver, Tikhonov, Variant};
use super::{Nonlinear, NonlinearSettings};
use tactomo_physics::forward::ForwardError;
use tactomo_physics::readings::Readings;

/// Weight of the newest frame in the mean residual of a scene.
const NEWEST: f64 = 0.1;
/// Rise of that mean over what the last search left, or over what noise alone leaves, that asks for a new search.
const RISE: f64 = 0.12;
/// After so many frames that contacts did not explain, they are tried again; doubled each time, up to the second.
const PATIENCE: [u32; 2] = [2, 64];
/// A frame that takes longer than its period is paid back so many times: so few of them are late.
const INTEREST: u32 = 3;
/// Longest time that may be owed.
const CREDIT: Duration = Duration::from_secs(1);

/// Chooses the model of the scene.
pub struct Auto {
    contacts: Option<Contacts>,
    image: Nonlinear,
    linear: Tikhonov,
    /// Mean square residual after the last search, and its running mean.
    searched: f64,
    mean: f64,
    /// Frames for which contacts are not tried, and how many it will be next time.
    skip: u32,
    patience: u32,
    period: Option<Duration>,
    /// Time that frames took beyond their period.
    owed: Duration,
}

impl Auto {
    /// Makes it ready for a problem.
    ///
    /// # Errors
    /// [`ForwardError`] if the model cannot be had on a coarser image.
    pub fn new(problem: &Problem) -> Result<Self, ForwardError> {
        Ok(Self {
            // A model without fields of single contacts has images only.
            contacts: Contacts::new(problem, ContactSettings::of(problem)).ok(),
            image: Nonlinear::new(problem, NonlinearSettings::default())?,
            linear: Tikhonov::new(&problem.jacobian, Lambda::default(), Variant::Balanced),
            searched: 0.0,
            mean: 0.0,
            skip: 0,
            patience: PATIENCE[0],
            period: None,
            owed: Duration::ZERO,
        })
    }

    /// The answer that the scene needs.
    fn choose(&mut self, readings: &Readings) -> Result<Solution, SolveError> {
        if self.skip > 0 {
            self.skip -= 1;
            return self.image(readings, "contacts did not explain the frames before".to_owned());
        }
        let Some(found) = self.contacts(readings)? else {
            return self.image(readings, "this model has no fields of single contacts".to_owned());
        };
        if found.contacts.is_empty() {
            self.patience = PATIENCE[0];
            return Ok(chosen(found, "nothing", "no place's reading stands out of the noise".to_owned()));
        }
        let left = found.residual.unwrap_or_default();
        if !found.flags.misfit {
            self.patience = PATIENCE[0];
            let what = counted(found.contacts.len());
            return Ok(chosen(found, &what, format!("they leave {left:.2} of the noise")));
        }
        self.skip = self.patience;
        self.patience = (2 * self.patience).min(PATIENCE[1]);
        let why = format!("{} would leave {left:.1} of the noise", counted(found.contacts.len()));
        let image = self.image(readings, why)?;
        // An image that explains less than contacts do is no better.
        match image.residual {
            Some(residual) if residual > left => {
                let what = counted(found.contacts.len());
                Ok(chosen(found, &what, format!("they leave {left:.1} of the noise, an image {residual:.1}")))
            }
            _ => Ok(image),
        }
    }

    /// Contacts, searched anew when their residual has risen; `None` if there is no such solver.
    fn contacts(&mut self, readings: &Readings) -> Result<Option<Solution>, SolveError> {
        let Some(contacts) = &mut self.contacts else { return Ok(None) };
        let followed = contacts.is_following();
        let risen = followed && self.mean > (1.0 + RISE) * self.searched.max(1.0);
        let found = contacts.solve_with(readings, if risen { Effort::Anew } else { Effort::AsNeeded })?;
        let left = found.residual.unwrap_or_default().powi(2);
        if risen || !followed {
            (self.searched, self.mean) = (left, left);
        } else {
            self.mean += NEWEST * (left - self.mean);
        }
        Ok(Some(found))
    }

    fn image(&mut self, readings: &Readings, why: String) -> Result<Solution, SolveError> {
        let image = self.image.solve(readings)?;
        let left = image.residual.map_or_else(String::new, |left| format!("; an image leaves {left:.1}"));
        Ok(chosen(image, "image", why + &left))
    }

    /// The cheapest answer: contacts as they were, or the linear image.
    fn cheapest(&mut self, readings: &Readings) -> Result<Solution, SolveError> {
        let followed = match &mut self.contacts {
            Some(contacts) if contacts.is_following() && self.skip == 0 => {
                Some(contacts.solve_with(readings, Effort::FollowOnly)?)
            }
            _ => None,
        };
        if let Some(found) = followed.filter(|found| !found.flags.misfit && !found.contacts.is_empty()) {
            let what = counted(found.contacts.len());
            let left = found.residual.unwrap_or_default();
            return Ok(chosen(found, &what, format!("followed, they leave {left:.2} of the noise")));
        }
        let mut linear = chosen(self.linear.solve(readings)?, "linear image", "to keep up with the frames".to_owned());
        linear.flags.unfinished = true;
        Ok(linear)
    }
}

fn chosen(solution: Solution, what: &str, why: String) -> Solution {
    Solution { choice: Some(Choice { what: what.to_owned(), why }), ..solution }
}

fn counted(contacts: usize) -> String {
    if contacts == 1 { "1 contact".to_owned() } else { format!("{contacts} contacts") }
}

impl Solver for Auto {
    fn name(&self) -> &'static str {
        "auto"
    }

    fn solve(&mut self, readings: &Readings) -> Result<Solution, SolveError> {
        let Some(period) = self.period else { return self.choose(readings) };
        let begin = Instant::now();
        let solution = if self.owed > period { self.cheapest(readings) } else { self.choose(readings) };
        let took = begin.elapsed();
        self.owed = match took.checked_sub(period) {
            Some(late) => (self.owed + INTEREST * late).min(CREDIT),
            None => self.owed.saturating_sub(period - took),
        };
        solution
    }

    fn reset(&mut self) {
        if let Some(contacts) = &mut self.contacts {
            contacts.reset();
        }
        self.image.reset();
        (self.skip, self.patience, self.owed) = (0, PATIENCE[0], Duration::ZERO);
        (self.searched, self.mean) = (0.0, 0.0);
    }

    fn keep_within(&mut self, period: Option<Duration>) {
        if let Some(contacts) = &mut self.contacts {
            contacts.keep_within(period);
        }
        self.period = period;
        self.owed = Duration::ZERO;
    }
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
            let exact = readings_v(&self.fine.impedance_ohm(contacts).unwrap(), &self.detector);
            self.solve(&exact)
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
        // A frame all around: nothing that a few discs can be.
        let nodes = bench.fine.image_mesh().nodes_m.clone();
        let ring = nodes
            .iter()
            .map(|[x, y]| f64::from(u8::from((x.hypot(*y) - 0.018).abs() < 0.002)) * 2e-4)
            .collect::<Vec<_>>();
        let exact = readings_v(&bench.fine.image_impedance_ohm(&ring).unwrap(), &bench.detector);
        let image = bench.solve(&exact);
        assert_eq!((what(&image), image.image_s_per_m2.is_some()), ("image", true), "{:?}", image.choice);
        let again = bench.touched(&[a]);
        assert!(again.image_s_per_m2.is_some(), "contacts wait a few frames after they failed");
        let late = (0..8).map(|_| bench.touched(&[a])).last().unwrap();
        assert_eq!(what(&late), "1 contact");
    }

    #[test]
    fn with_no_time_it_gives_the_cheapest_answer_and_says_so() {
        let mut bench = Bench::new();
        bench.auto.keep_within(Some(Duration::from_nanos(1)));
        let contact = [Contact::flat(0.01, 0.004, 0.0025, 3e-4)];
        let first = bench.touched(&contact);
        assert!(!first.flags.unfinished, "nothing is owed yet");
        let second = bench.touched(&contact);
        let is_followed = second.choice.as_ref().is_some_and(|choice| choice.why.starts_with("followed"));
        assert!(is_followed && second.contacts.len() == 1, "{second:?}");
        // Two more fingers are more than following explains.
        let more = [contact[0], Contact::flat(-0.012, -0.009, 0.0025, 5e-4), Contact::flat(-0.01, 0.015, 0.0025, 5e-4)];
        let third = bench.touched(&more);
        assert!(third.flags.unfinished && what(&third) == "linear image", "{third:?}");
    }
}
