//! Which rows to scan: frames a second against error, for contacts that stand and that move, on what an ESP32 can read and send.
//!
//! One to three contacts touch all at once and stand, or go round together. They are scanned in whole frames, or in frames of some rows whose
//! grounds are chosen in several ways, and followed by the solver of contacts. Its answer is compared with where the contacts are when the
//! frame has arrived, and with where they were while its rows were read. What the solver takes does not count: neither following, which is
//! faster than the wire, nor searching, which live does beside it.

mod budget;
mod grounds;
mod path;
mod trial;
mod view;

use tactomo_physics::detector::Detector;
use tactomo_physics::scene::Contact;
use tactomo_physics::simulate::finer_model;
use tactomo_touch::metrics::Matching;

use super::bound::{Bound, RowInformation};
use super::experiment::{Experiment, StudyError};
use super::judge::wrong_m;
use super::machine::Machine;

use self::path::Path;
use self::trial::{Answer, Bench, Plan};

pub use self::grounds::Choice;
pub use self::view::view;

/// Speeds of contacts (m/s): none, a finger that feels its way, and one that wipes.
const SPEEDS_M_PER_S: [f64; 3] = [0.0, 0.05, 0.5];
/// Rows of a frame that is not whole.
const ROWS: [usize; 5] = [1, 2, 3, 4, 8];
/// Contacts that stand are judged by the last answer within this time of the touch (s), and those that move from then on, up to `END_S`.
const STILL_S: f64 = 50e-3;
const END_S: f64 = 120e-3;
/// Places on the way round at which the bound is computed.
const BOUND_PLACES: usize = 24;

/// What is tried.
#[derive(Clone, Debug)]
pub struct Settings {
    /// The detector, which solvers know exactly.
    pub detector: Detector,
    /// Numbers of contacts.
    pub contacts: Vec<usize>,
    /// Scenes of each number of contacts, each at every speed under every plan.
    pub scenes: usize,
    /// Where places and noise start.
    pub seed: u64,
}

/// What came out.
#[derive(Clone, Debug, serde::Serialize)]
pub struct Report {
    /// Where it ran.
    pub machine: Machine,
    /// How to run it again.
    pub command: String,
    /// Seed.
    pub seed: u64,
    /// Name of the detector.
    pub detector: String,
    /// Model that was inverted.
    pub model: String,
    /// Numbers of contacts.
    pub contacts: Vec<usize>,
    /// Scenes of each of them.
    pub scenes: usize,
    /// What a contact missed or invented counts (m).
    pub reach_m: f64,
    /// One for each number of contacts, speed and plan.
    pub points: Vec<Point>,
}

/// What came out for contacts under a plan.
#[derive(Clone, Debug, serde::Serialize)]
pub struct Point {
    /// How many contacts.
    pub contacts: usize,
    /// Their speed (m/s).
    pub speed_m_per_s: f64,
    /// How grounds are chosen.
    pub choice: Choice,
    /// Rows of a frame.
    pub rows: usize,
    /// Frames a second.
    pub frames_per_s: f64,
    /// From the middle of a frame's rows to its arrival (s).
    pub age_s: f64,
    /// Mean error against where the contacts are when the frame has arrived (m); one missed or invented counts the report's `reach_m`.
    pub arrived_m: f64,
    /// The same against where they were in the middle of the frame's rows (m).
    pub middle_m: f64,
    /// Share of answers with as many contacts as there are, none of them [too far off](crate::judge::WRONG_SHARE).
    pub count_right: f64,
    /// Mean error of these alone, against where the contacts are when the frame has arrived (m).
    pub right_m: Option<f64>,
    /// Cramer-Rao bound of the rows of a frame alone, radii known to a factor of two (m), at most `reach_m`: mean distance, mean of frames.
    pub bound_rows_m: f64,
    /// The same of all rows that have arrived; of contacts that stand.
    pub bound_all_m: Option<f64>,
}

/// Tries all plans. `progress` is called with what is tried next.
///
/// # Errors
/// [`StudyError`] if the detector cannot be modelled, is curved, or has no room for the contacts.
pub fn run(settings: &Settings, command: &str, progress: &mut dyn FnMut(&str)) -> Result<Report, StudyError> {
    let experiment = Experiment::new(&settings.detector)?;
    let mut points = Vec::new();
    for contacts in settings.contacts.iter().copied() {
        progress(&format!("{contacts} contacts: voltages on their ways"));
        let scenes = scenes(settings, &experiment, contacts)?;
        let mut bench = Bench::new(&experiment)?;
        for speed_m_per_s in SPEEDS_M_PER_S {
            progress(&format!("{contacts} contacts: {speed_m_per_s} m/s"));
            for plan in plans(settings.detector.electrodes.len()) {
                points.push(point(&mut bench, &experiment, &scenes, plan, speed_m_per_s)?);
            }
        }
    }
    Ok(Report {
        machine: Machine::this(),
        command: command.to_owned(),
        seed: settings.seed,
        detector: settings.detector.name.clone(),
        model: experiment.model.clone(),
        contacts: settings.contacts.clone(),
        scenes: settings.scenes,
        reach_m: experiment.reach_m(),
        points,
    })
}

fn plans(electrodes: usize) -> Vec<Plan> {
    let rows = |choice| ROWS.into_iter().filter(|rows| *rows < electrodes).map(move |rows| Plan { choice, rows });
    let corners = rows(Choice::Corners).filter(|plan| plan.rows <= 4);
    let whole = Plan { choice: Choice::Whole, rows: electrodes };
    [whole].into_iter().chain(rows(Choice::Adaptive)).chain(rows(Choice::InTurn)).chain(corners).collect()
}

/// Contacts on their way, and what rows tell of them.
struct Scene {
    path: Path,
    /// What rows tell at places on the way round.
    information: Vec<RowInformation>,
    /// Of the noise.
    seed: u64,
}

fn scenes(settings: &Settings, experiment: &Experiment, contacts: usize) -> Result<Vec<Scene>, StudyError> {
    let truth = finer_model(&settings.detector, &[], 0)?;
    let scene = |index: usize| {
        let seed = settings.seed.wrapping_mul(1_000_003).wrapping_add((100 * index + contacts) as u64);
        let path = Path::random(&*truth, experiment.reach_m(), contacts, seed)?;
        let model = &*experiment.problem.model;
        let deviation_v = settings.detector.adc.deviation_v();
        let place = |index: usize| path.contacts_at(index as f64 / BOUND_PLACES as f64 * path.round_m());
        let information = (0..BOUND_PLACES).map(|index| RowInformation::new(model, &place(index), deviation_v));
        let information = information.collect::<Result<_, _>>()?;
        Ok(Scene { path, information, seed })
    };
    (0..settings.scenes).map(scene).collect()
}

impl Scene {
    /// What rows tell after so long a way (m).
    fn information(&self, way_m: f64) -> &RowInformation {
        let place = (way_m / self.path.round_m() * BOUND_PLACES as f64).round();
        &self.information[place.rem_euclid(BOUND_PLACES as f64) as usize % BOUND_PLACES]
    }
}

fn point(
    bench: &mut Bench,
    experiment: &Experiment,
    scenes: &[Scene],
    plan: Plan,
    speed_m_per_s: f64,
) -> Result<Point, StudyError> {
    let electrodes = experiment.detector.electrodes.len();
    let times = budget::frame(plan.rows, electrodes);
    let (reach_m, wrong_m) = (experiment.reach_m(), wrong_m(&experiment.detector));
    let is_still = speed_m_per_s == 0.0;
    let mut sums = Sums::default();
    for scene in scenes {
        let until_s = if is_still { STILL_S } else { END_S };
        let answers = bench.run(&scene.path, plan, speed_m_per_s, until_s, scene.seed)?;
        let judged = match is_still {
            true => answers.len().saturating_sub(1),
            false => answers.partition_point(|answer| answer.arrived_s < STILL_S),
        };
        for answer in &answers[judged..] {
            let [arrived, middle] =
                [answer.arrived_s, answer.middle_s].map(|time_s| scene.path.contacts_at(speed_m_per_s * time_s));
            let bound = |answers: &[Answer]| {
                let information = scene.information(speed_m_per_s * answer.middle_s);
                bound_m(information, answers, electrodes).min(reach_m)
            };
            sums.add(answer, [&arrived, &middle], [reach_m, wrong_m]);
            sums.bound_rows_m += bound(std::slice::from_ref(answer));
            sums.bound_all_m += if is_still { bound(&answers) } else { 0.0 };
        }
    }
    let mean = |sum: f64| sum / sums.answers.max(1) as f64;
    Ok(Point {
        contacts: scenes.first().map_or(0, |scene| scene.path.contacts_at(0.0).len()),
        speed_m_per_s,
        choice: plan.choice,
        rows: plan.rows,
        frames_per_s: 1.0 / times.period_s,
        age_s: times.age_s - 0.5 * times.scan_s,
        arrived_m: mean(sums.arrived_m),
        middle_m: mean(sums.middle_m),
        count_right: mean(sums.right as f64),
        right_m: (sums.right > 0).then(|| sums.right_m / sums.right as f64),
        bound_rows_m: mean(sums.bound_rows_m),
        bound_all_m: is_still.then(|| mean(sums.bound_all_m)),
    })
}

/// Sums over answers.
#[derive(Default)]
struct Sums {
    answers: usize,
    arrived_m: f64,
    middle_m: f64,
    right: usize,
    right_m: f64,
    bound_rows_m: f64,
    bound_all_m: f64,
}

impl Sums {
    fn add(&mut self, answer: &Answer, [arrived, middle]: [&[Contact]; 2], [reach_m, wrong_m]: [f64; 2]) {
        let near = Matching::within(wrong_m, middle, &answer.contacts);
        let [arrived, middle] = [arrived, middle].map(|truth| Matching::within(reach_m, truth, &answer.contacts));
        self.answers += 1;
        self.arrived_m += arrived.ospa_m(reach_m);
        self.middle_m += middle.ospa_m(reach_m);
        if near.missed.is_empty() && near.invented.is_empty() {
            self.right += 1;
            self.right_m += arrived.ospa_m(reach_m);
        }
    }
}

/// Bound of the rows of some answers (m), mean of contacts; without end where they do not separate the unknowns.
fn bound_m(information: &RowInformation, answers: &[Answer], electrodes: usize) -> f64 {
    let mut times = vec![0.0; electrodes];
    answers.iter().flat_map(|answer| &answer.grounds).for_each(|ground| times[*ground] += 1.0);
    let Some(bounds) = information.bounds(&times) else { return f64::INFINITY };
    bounds.iter().map(Bound::mean_m).sum::<f64>() / bounds.len().max(1) as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::view::{page, picture, text};

    fn report(seed: u64) -> Report {
        let detector = Detector::preset(Detector::DEFAULT).unwrap();
        let settings = Settings { detector, contacts: vec![1], scenes: 1, seed };
        run(&settings, "tactomo <tradeoff> --scan", &mut |_| {}).unwrap()
    }

    fn at(report: &Report, speed_m_per_s: f64, choice: Choice, rows: usize) -> &Point {
        report.of(1, speed_m_per_s).find(|point| (point.choice, point.rows) == (choice, rows)).unwrap()
    }

    #[test]
    fn rows_are_nearer_to_a_contact_that_runs_and_every_plan_is_told() {
        let report = report(2);
        assert_eq!(report.points.len(), 3 * 15);
        let whole = at(&report, 0.5, Choice::Whole, 16);
        let rows = at(&report, 0.5, Choice::Adaptive, 2);
        assert!(rows.arrived_m < 0.5 * whole.arrived_m, "{rows:?} {whole:?}");
        assert!(whole.middle_m < whole.arrived_m && whole.bound_rows_m < rows.bound_rows_m, "{rows:?} {whole:?}");
        let still = at(&report, 0.0, Choice::Adaptive, 2);
        assert_eq!(still.arrived_m, still.middle_m);
        assert!(still.arrived_m < 2e-4 && still.bound_all_m.unwrap() < 0.5 * still.bound_rows_m, "{still:?}");
        let views = [view(&report)];
        let (page, table) = (page(&views, &report.command), text(&views));
        for part in ["adaptive", "in turn", "corners", "whole"] {
            assert!(page.contains(part) && table.contains(part), "{part}");
        }
        assert!(page.contains("tactomo &lt;tradeoff&gt; --scan") && !page.contains("NaN"));
        assert_eq!(picture(&views[0]).matches("<svg").count(), 3);
        let json = serde_json::to_value(&report).unwrap();
        assert_eq!((&json["points"][1]["choice"], &json["points"][1]["rows"]), (&"adaptive".into(), &1.into()));
        assert!(json["points"][0]["bound_all_m"].is_f64());
    }
}
