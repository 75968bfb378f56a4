//! The paper's samples, its tables I and II and figure 6: foams A to D and stacks of them under an indenter, simulated as they were
//! measured, and the measured figures beside.
//!
//! 60 x 60 mm, each layer 5 mm; nine places; a flat punch of 5 mm pressed from 0 to 5 N and let go, on foam with hysteresis. The output is the value of the
//! paper's image at its centroid, over a sheet of 1 S.

mod choices;
mod claims;
mod measured;
mod view;

use std::fmt::Display;
use std::time::Instant;

use tactomo_physics::detector::{Detector, Stack};
use tactomo_physics::forward::{Auto, ForwardError, ForwardModel, readings_v};
use tactomo_physics::geometry::Point;
use tactomo_physics::hertz::Skin;
use tactomo_physics::readings::Readings;
use tactomo_physics::scene::{Contact, Touch};
use tactomo_physics::simulate::{Fault, Foam, Noise, measured as through_converter};

pub use self::choices::{Choice, Choices};
pub use self::measured::{FAILED_N, Measured, all as measured};
pub use self::view::view;
use super::curve::{Fit, fit};
use super::imaging::{Images, Imaging, accuracy_of_the_middle};
use super::press::{FORCES_N, MIDDLE, STEPS, force_n, nine_places};
use super::reached::by_auto;
use super::{Claim, Course, DesignError, Limit, PaperSolver, Press, Progress, Reached};

/// Force at which places and images are compared (N), table II.
pub(crate) const COMPARED_N: f64 = 2.25;
/// Hysteresis of the foam, as a share of the conductance: the paper gives none; its curves of loading and unloading are apart by about so much.
const HYSTERESIS: f64 = 0.1;
/// Places along a line profile.
const PROFILE_PLACES: usize = 61;

/// What to compute.
#[derive(Clone, Debug)]
pub struct Plan {
    /// Of noise.
    pub seed: u64,
}

/// A sample as simulated, beside what was measured of it.
#[derive(Clone, Debug, serde::Serialize)]
pub struct Sample {
    /// As in the paper's table II.
    pub measured: Measured,
    /// Force (N) and output (S/m2 over a sheet of 1 S) in the middle, on the way up.
    pub loading: Vec<[f64; 2]>,
    /// The same on the way down.
    pub unloading: Vec<[f64; 2]>,
    /// Eq. (6) over the loading; strengths are newtons.
    pub curve: Option<Fit>,
    /// SR and PA at 2.25 N.
    #[serde(flatten)]
    pub imaging: Imaging,
    /// Value of the image along the line through the middle at 2.25 N: x (m) and share of its largest value.
    pub profile: Vec<[f64; 2]>,
    /// Where the nine contacts are and where the paper's solver sees them (m).
    pub places_m: Vec<[Point; 2]>,
    /// What the sensor itself can tell at 2.25 N; strengths are newtons.
    pub limit: Limit,
    /// What `auto` finds of the nine at 2.25 N.
    pub reached: Reached,
}

/// All of the study.
#[derive(Clone, Debug, serde::Serialize)]
pub struct Report {
    /// In the order of the table.
    pub samples: Vec<Sample>,
    /// PA of answering "the middle", whatever is read.
    pub accuracy_of_the_middle: f64,
    /// What the paper leaves open of its solver, and what each choice gives of its sample A; `None` where that was not computed.
    pub choices: Option<Choices>,
    /// Seed of the noise.
    pub seed: u64,
    /// What was concluded, and how the study went.
    #[serde(flatten)]
    pub course: Course,
}

/// Runs the study.
///
/// # Errors
/// [`DesignError`] if there is no model of a sample.
pub fn run(plan: &Plan, progress: Progress) -> Result<Report, DesignError> {
    let start = Instant::now();
    let solver = PaperSolver::new(&Detector::default())?;
    let tasks: Vec<(u64, Measured)> = (plan.seed..).zip(measured()).collect();
    let computed = progress.map("samples", &tasks, |(seed, measured)| sample(*measured, &solver, *seed));
    let is_stopped = computed.iter().any(Option::is_none);
    let samples: Vec<Sample> = computed.into_iter().flatten().collect::<Result<_, _>>()?;
    let choices = choices::of(progress)?;
    let course = Course::since(start, is_stopped || choices.is_none(), claims::of(&samples));
    let accuracy_of_the_middle = accuracy_of_the_middle(&Detector::default());
    Ok(Report { samples, accuracy_of_the_middle, choices, seed: plan.seed, course })
}

/// The detector that a sample was, and the paper's indenter on it.
fn pressed(name: &str) -> Result<(Detector, Press), DesignError> {
    let (stack, detector) = stacked(name)?;
    let detector = detector.taken_as_exact();
    let press = Press::indenter(&detector, Skin::from(&stack))?;
    Ok((detector, press))
}

/// The stack of a name, and the detector that it was.
///
/// # Errors
/// [`DesignError`] if there is no such stack.
pub fn stacked(name: &str) -> Result<(Stack, Detector), DesignError> {
    let wrong = |what: &dyn Display| ForwardError::Detector { detector: name.to_owned(), what: what.to_string() };
    let stack: Stack = name.parse().map_err(|error| wrong(&error))?;
    let detector = Detector::default().in_material(&stack).map_err(|error| wrong(&error))?;
    Ok((stack, detector))
}

fn sample(measured: Measured, solver: &PaperSolver, seed: u64) -> Result<Sample, DesignError> {
    let (detector, press) = pressed(measured.name)?;
    let model = Auto::new(&detector, None)?.model;
    let mut bench = Bench { model: &*model, noise: Noise::new(seed) };
    let [loading, unloading] = bench.load_and_unload(&press, solver)?;
    let places = nine_places(&detector).map(|place| press.at(place, COMPARED_N));
    let (mut places_m, mut images) = (Vec::new(), Images::new(solver));
    for contact in &places {
        if let Some(imaged) = images.add(&bench.read(contact)?, contact) {
            places_m.push([[contact.x_m, contact.y_m], imaged.centroid_m]);
        }
    }
    let readings = bench.read(&press.at(MIDDLE, COMPARED_N))?;
    Ok(Sample {
        measured,
        curve: fit(&loading),
        loading,
        unloading,
        imaging: images.figures(),
        profile: normalised(solver.profile(&readings, MIDDLE, PROFILE_PLACES).unwrap_or_default()),
        places_m,
        limit: Limit::of(&*model, &press, COMPARED_N, FORCES_N)?,
        reached: by_auto(&detector, &places, seed)?,
    })
}

/// The loading equipment: presses, and reads through the converter.
struct Bench<'a> {
    model: &'a dyn ForwardModel,
    noise: Noise,
}

impl Bench<'_> {
    fn read(&mut self, contact: &Contact) -> Result<Readings, ForwardError> {
        let detector = self.model.detector();
        let exact = readings_v(&self.model.impedance_ohm(&[*contact])?, detector);
        Ok(through_converter(&exact, &detector.adc, &mut self.noise))
    }

    /// Force and output in the middle, up and down.
    fn load_and_unload(&mut self, press: &Press, solver: &PaperSolver) -> Result<[Vec<[f64; 2]>; 2], ForwardError> {
        let mut foam = Foam::new(&[Fault::Hysteresis { share: HYSTERESIS }]);
        let mut ways = [Vec::new(), Vec::new()];
        let up = (1..=STEPS).map(|step| (0, step));
        let down = (1..STEPS).rev().map(|step| (1, step));
        for (time_s, (way, step)) in up.chain(down).enumerate() {
            let force_n = force_n(step);
            let contact = press.at(MIDDLE, force_n);
            let pressed = foam.press(vec![Touch::from(contact)], time_s as f64);
            let conductance_s = pressed.touches.first().map_or(contact.conductance_s, |touch| touch.conductance_s);
            let contact = Contact { conductance_s, ..contact };
            if let Some(imaged) = solver.imaged(&self.read(&contact)?, &contact) {
                ways[way].push([force_n, imaged.output]);
            }
        }
        Ok(ways)
    }
}

/// Values over the largest of them.
fn normalised(profile: Vec<[f64; 2]>) -> Vec<[f64; 2]> {
    let largest = profile.iter().map(|[_, value]| *value).fold(f64::MIN_POSITIVE, f64::max);
    profile.into_iter().map(|[x_m, value]| [x_m, value / largest]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sample_loads_unloads_above_and_is_beside_its_measurement() {
        let solver = PaperSolver::new(&Detector::default()).unwrap();
        // Of a foam whose output still rises at 5 N.
        let d = measured::all().find(|sample| sample.name == "D").unwrap();
        let sample = sample(d, &solver, 1).unwrap();
        assert_eq!((sample.loading.len(), sample.unloading.len(), sample.places_m.len()), (STEPS, STEPS - 1, 9));
        let mean_of = |way: &[[f64; 2]]| way.iter().map(|[_, output]| output).sum::<f64>() / way.len() as f64;
        assert!(mean_of(&sample.unloading) > mean_of(&sample.loading[..STEPS - 1]), "hysteresis");
        assert_eq!(measured::all().next().and_then(|sample| sample.maximum_n), Some(2.837));
        assert_eq!(sample.reached.found, 1.0);
        assert!(sample.profile.iter().all(|[_, share]| *share <= 1.0));
        assert!(measured::all().filter(|sample| sample.maximum_n.is_none()).map(|sample| sample.name).eq(["D", "DA"]));
    }

    #[test]
    fn the_whole_says_what_is_a_failed_fit_what_has_collapsed_and_what_the_middle_gives() {
        let stop = std::sync::atomic::AtomicBool::new(false);
        let report = run(&Plan { seed: 1 }, Progress::new(&stop, &|_| {})).unwrap();
        let below = report.samples.iter().filter(|one| one.measured.position_accuracy < report.accuracy_of_the_middle);
        assert_eq!(below.count(), 5);
        let view = [view(&report)];
        let [text, page] = [tactomo_study::view::text(&view), tactomo_study::view::page(&view, "")];
        for part in ["34975, failed fit", "105.5, failed fit", "of 11 measured PA 5 are below", "of 8 tests (Holm)"] {
            assert!(text.contains(part) && page.contains(part), "{part}: {text}");
        }
        for part in ["SR and FMAX, measured", "PA and SENS, simulated", "the middle", "force, N", "ideal points"] {
            assert!(page.contains(part), "{part}");
        }
        // A collapsed image is no figure of any claim: of SR none is left.
        assert!(report.samples.iter().all(|one| one.imaging.is_spread_out));
        let resolutions = report.course.claims.iter().find(|claim| claim.claim.contains("resolutions")).unwrap();
        assert!(resolutions.paper.contains("too few"), "{resolutions:?}");
        assert!(page.contains("class=\"collapsed\"") && !page.contains("NaN"));
    }
}
