//! The paper's study of materials: conductivities of top and bottom, its figures 2 and 3.
//!
//! A slab of 60 x 60 x 10 mm with an exponential gradient in depth, 16 electrodes below, one contact of 4 mm on top whose conductivity stands
//! for force. Each condition gets the paper's four metrics, without and with noise, and beside them the [limit](Limit) of the sensor itself;
//! the foams of table I and stacks of two of them are put among them.

mod claims;
mod half;
mod view;

use std::time::Instant;

use tactomo_physics::detector::{Detector, Layer, Stack};
use tactomo_physics::forward::Slab;
use tactomo_physics::hertz::Skin;
use tactomo_physics::simulate::Noise;
use tactomo_study::Errors;

pub(crate) use self::claims::extent;
pub use self::half::AtHalf;
pub use self::view::view;
use super::imaging::accuracy_of_the_middle;
use super::limit::range;
use super::metrics::Sweep;
use super::press::{COMPARED_S_PER_M, CONDUCTIVITIES_S_PER_M, FORCES_N, in_decades, nine_places};
use super::reached::by_auto;
use super::{Claim, Course, DesignError, Limit, Metrics, PaperSolver, Press, Progress, Reached};

/// Conductivities of top and bottom (S/m), section III.A.
const RANGE_S_PER_M: [f64; 2] = [1e-3, 100.0];
/// Thickness (m), there.
const THICKNESS_M: f64 = 0.010;
/// Conductivities under the contact: three a decade.
const STRENGTHS: usize = 13;
/// Foams and stacks of the paper's table II but for the bonding, the upper letter first.
const SAMPLES: [&str; 10] = ["A", "B", "C", "D", "BA", "AD", "BC", "AB", "DA", "BB"];

/// What to compute.
#[derive(Clone, Debug)]
pub struct Plan {
    /// Conductivities of a side of the map: 11 as in the paper.
    pub side: usize,
    /// Whether presses are also sought by `auto` on each condition of the map, not on the samples alone.
    pub reached: bool,
    /// Of noise.
    pub seed: u64,
}

/// A material and what it gives.
#[derive(Clone, Debug, serde::Serialize)]
pub struct Condition {
    /// Of a foam or a stack; `None` on the map.
    pub name: Option<&'static str>,
    /// Conductivity at the bottom (S/m).
    pub bottom_s_per_m: f64,
    /// Conductivity at the top (S/m).
    pub top_s_per_m: f64,
    /// The paper's metrics without noise. Strengths are conductivities of the contact (S/m).
    pub exact: Metrics,
    /// The same with the converter's noise.
    pub noisy: Metrics,
    /// What the sensor itself can tell of such a contact of 1 S/m; strengths are conductivities (S/m).
    pub limit: Limit,
    /// The same comparisons where the contact in the middle is at half of the drive: on every material as firm, as far from saturation. `None` where no
    /// contact is.
    pub at_half: Option<AtHalf>,
    /// Forces (N) under the paper's indenter from noise to nine tenths of the drive, for a foam as soft as this sample, or as sample A.
    pub force_range_n: [Option<f64>; 2],
    /// What `auto` makes of such contacts at the nine places, one noisy frame of each; if it was tried.
    pub reached: Option<Reached>,
}

/// All of the study.
#[derive(Clone, Debug, serde::Serialize)]
pub struct Report {
    /// The conductivities of a side (S/m).
    pub conductivities_s_per_m: Vec<f64>,
    /// The map, bottom by bottom: those that were computed.
    pub conditions: Vec<Condition>,
    /// Foams and stacks.
    pub samples: Vec<Condition>,
    /// PA of answering "the middle", whatever is read.
    pub accuracy_of_the_middle: f64,
    /// Seed of the noise.
    pub seed: u64,
    /// What was concluded, and how the study went.
    #[serde(flatten)]
    pub course: Course,
}

/// A material before it is computed.
struct Task {
    name: Option<&'static str>,
    layers: Vec<Layer>,
    skin: Skin,
    seed: u64,
}

/// Runs the study.
///
/// # Errors
/// [`DesignError`] if there is no model of a condition.
pub fn run(plan: &Plan, progress: Progress) -> Result<Report, DesignError> {
    let start = Instant::now();
    let base = Detector::default();
    let solver = PaperSolver::new(&base)?;
    let conductivities_s_per_m = in_decades(RANGE_S_PER_M, plan.side);
    let tasks = tasks(&base, &conductivities_s_per_m, plan.seed);
    let computed = progress.map("materials", &tasks, |task| condition(&base, task, &solver, plan.reached));
    let is_stopped = computed.iter().any(Option::is_none);
    let all: Vec<Condition> = computed.into_iter().flatten().collect::<Result<_, _>>()?;
    let (samples, conditions): (Vec<_>, Vec<_>) = all.into_iter().partition(|condition| condition.name.is_some());
    let course = Course::since(start, is_stopped, claims::of(&conditions, &conductivities_s_per_m));
    Ok(Report {
        conductivities_s_per_m,
        conditions,
        samples,
        accuracy_of_the_middle: accuracy_of_the_middle(&base),
        seed: plan.seed,
        course,
    })
}

/// The samples, for a picture needs them, and then the map.
fn tasks(base: &Detector, conductivities_s_per_m: &[f64], seed: u64) -> Vec<Task> {
    let softest = || "A".parse::<Stack>().map(|stack| Skin::from(&stack)).ok();
    let sample = |name: &'static str| {
        let stack: Stack = name.parse().ok()?;
        let foams = stack.foams();
        let layer = |foam: &tactomo_physics::detector::Foam| {
            Layer::uniform(THICKNESS_M / foams.len() as f64, foam.conductivity_s_per_m)
        };
        Some((Some(name), foams.iter().map(layer).collect(), Skin::from(&stack)))
    };
    let on_map = conductivities_s_per_m.iter().flat_map(|bottom_s_per_m| {
        conductivities_s_per_m.iter().filter_map(move |top_s_per_m| {
            let (bottom_s_per_m, top_s_per_m) = (*bottom_s_per_m, *top_s_per_m);
            let layer = Layer { bottom_s_per_m, top_s_per_m, ..Layer::uniform(THICKNESS_M, top_s_per_m) };
            Some((None, vec![layer], softest()?))
        })
    });
    debug_assert!(base.layers.len() == 1, "conditions replace its layers");
    let all = SAMPLES.into_iter().filter_map(sample).chain(on_map);
    all.enumerate()
        .map(|(index, (name, layers, skin))| Task { name, layers, skin, seed: seed.wrapping_add(index as u64) })
        .collect()
}

fn condition(base: &Detector, task: &Task, solver: &PaperSolver, reached: bool) -> Result<Condition, DesignError> {
    let detector = Detector { layers: task.layers.clone(), ..base.taken_as_exact() };
    let slab = Slab::new(&detector)?;
    let strengths = in_decades(CONDUCTIVITIES_S_PER_M, STRENGTHS);
    let sweep = Sweep::of(&slab, &Press::PAPER, &strengths, COMPARED_S_PER_M)?;
    let [bottom, top] = [task.layers.first(), task.layers.last()];
    let pressed = || nine_places(&detector).map(|place| Press::PAPER.at(place, COMPARED_S_PER_M));
    let reached = if reached || task.name.is_some() { Some(by_auto(&detector, &pressed(), task.seed)?) } else { None };
    let errors = Errors::of_noise(&detector, detector.adc.deviation_v());
    Ok(Condition {
        name: task.name,
        bottom_s_per_m: bottom.map_or(0.0, |layer| layer.bottom_s_per_m),
        top_s_per_m: top.map_or(0.0, |layer| layer.top_s_per_m),
        exact: sweep.metrics(solver),
        noisy: sweep.noisy_metrics(solver, &mut Noise::new(task.seed)),
        limit: Limit::of(&slab, &Press::PAPER, COMPARED_S_PER_M, CONDUCTIVITIES_S_PER_M)?,
        at_half: AtHalf::of(&slab, &Press::PAPER, CONDUCTIVITIES_S_PER_M, solver)?,
        force_range_n: range(&slab, &Press::indenter(&detector, task.skin)?, FORCES_N, &errors)?,
        reached,
    })
}

impl Condition {
    /// What it is, for people.
    pub fn title(&self) -> String {
        let conductivities = format!("bottom {} S/m, top {} S/m", short(self.bottom_s_per_m), short(self.top_s_per_m));
        self.name.map_or(conductivities.clone(), |name| format!("{name}: {conductivities}"))
    }

    /// Decades that the sensor tells: largest over smallest strength; `None` if it tells none.
    pub fn decades(&self) -> Option<f64> {
        match self.limit.range {
            [Some(low), Some(high)] if high > low => Some((high / low).log10()),
            _ => None,
        }
    }
}

/// A number with three digits.
fn short(value: f64) -> String {
    tactomo_physics::detector::short(value)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::atomic::{AtomicBool, Ordering};

    fn plan(side: usize, reached: bool) -> Plan {
        Plan { side, reached, seed: 1 }
    }

    #[test]
    fn a_small_map_has_all_conditions_and_samples_and_repeats_with_its_seed() {
        let stop = AtomicBool::new(false);
        let progress = Progress::new(&stop, &|_| {});
        let [a, b] = [1, 1].map(|_| run(&plan(3, false), progress).unwrap());
        assert_eq!((a.conditions.len(), a.samples.len(), a.course.is_stopped), (9, 10, false));
        assert_eq!(serde(&a), serde(&b));
        assert_eq!((a.conditions[1].bottom_s_per_m, a.conditions[1].top_s_per_m), (1e-3, a.conductivities_s_per_m[1]));
        let bc = a.samples.iter().find(|sample| sample.name == Some("BC")).unwrap();
        assert!(bc.top_s_per_m > bc.bottom_s_per_m, "B is above");
    }

    fn serde(report: &Report) -> Vec<String> {
        report.conditions.iter().map(|condition| format!("{:?}{:?}", condition.noisy, condition.limit)).collect()
    }

    #[test]
    fn what_is_done_when_it_is_stopped_is_kept() {
        let stop = AtomicBool::new(false);
        let say = |step: &crate::Step| stop.store(step.done >= 12, Ordering::Relaxed);
        let progress = Progress::new(&stop, &say);
        let report = run(&plan(5, false), progress).unwrap();
        assert!(report.course.is_stopped && (2..25).contains(&report.conditions.len()), "{}", report.conditions.len());
        let view = [view(&report)];
        let [page, text] = [tactomo_study::view::page(&view, ""), tactomo_study::view::text(&view)];
        assert!(page.contains("Stopped before the end") && text.contains("Stopped before the end"));
    }
}
