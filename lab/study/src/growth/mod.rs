//! How cost grows: time and memory against electrodes, nodes, contacts and frames.
//!
//! Each of these is varied alone, from what is common to what is large, with everything else as it is on the default detector; and powers of the size are
//! fitted to what was measured. Times are processor times of one thread. Detectors are known exactly.

mod power;
mod sizes;
mod view;

use super::experiment::StudyError;
use super::machine::Machine;
use super::progress::Progress;
use super::score::Spread;
use super::tradeoff::{Heap, Memory};

pub use self::power::Power;
pub use self::sizes::Against;
pub use self::view::view;

/// What is tried.
#[derive(Clone, Debug)]
pub struct Plan {
    /// Places of the contacts at each size, each with a cold start.
    pub places: usize,
    /// Where places and noise start.
    pub seed: u64,
    /// How memory is counted.
    pub heap: Heap,
}

/// What came out.
#[derive(Clone, Debug, serde::Serialize)]
pub struct Report {
    /// Where it ran.
    pub machine: Machine,
    /// How to run it again.
    pub command: String,
    /// Name of the detector of which sizes are varied.
    pub detector: String,
    /// Seed.
    pub seed: u64,
    /// Places at each size.
    pub places: usize,
    /// One for each thing that is varied.
    pub sweeps: Vec<SweepReport>,
    /// What was not tried when the study was stopped.
    pub missing: Vec<String>,
}

/// What came out for one thing that is varied.
#[derive(Clone, Debug, serde::Serialize)]
pub struct SweepReport {
    /// What is varied.
    pub against: Against,
    /// Name of the solver.
    pub solver: String,
    /// One for each size, rising.
    pub sizes: Vec<SizeReport>,
    /// How costs grow that have two sizes at least.
    pub growth: Vec<Growth>,
}

/// What a size costs.
#[derive(Clone, Debug, serde::Serialize)]
pub struct SizeReport {
    /// How many electrodes, nodes, contacts or frames.
    pub size: usize,
    /// Time for model, linear theory and solver (s).
    pub set_up_s: Spread,
    /// Time of the first answer (s).
    pub first_s: Spread,
    /// Time of an answer of a contact that is followed (s).
    pub following_s: Spread,
    /// What model and solver allocate.
    pub memory: Memory,
}

/// How a cost grows with the size.
#[derive(Clone, Copy, Debug, serde::Serialize)]
pub struct Growth {
    /// Which.
    pub cost: Cost,
    /// By which power.
    #[serde(flatten)]
    pub power: Power,
}

/// What is paid.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Cost {
    /// Time for model, linear theory and solver.
    SetUp,
    /// Time of the first answer.
    First,
    /// Time of an answer that follows.
    Following,
    /// Memory that stays allocated.
    Kept,
    /// The most memory that was allocated.
    Peak,
}

impl Cost {
    /// All of them.
    pub const ALL: [Self; 5] = [Self::SetUp, Self::First, Self::Following, Self::Kept, Self::Peak];

    /// For people.
    pub fn name(self) -> &'static str {
        match self {
            Self::SetUp => "set-up",
            Self::First => "first answer",
            Self::Following => "following",
            Self::Kept => "memory kept",
            Self::Peak => "memory at most",
        }
    }

    /// Of a size: the median (s), or bytes.
    pub fn of(self, size: &SizeReport) -> f64 {
        match self {
            Self::SetUp => size.set_up_s.median,
            Self::First => size.first_s.median,
            Self::Following => size.following_s.median,
            Self::Kept => size.memory.kept_bytes as f64,
            Self::Peak => size.memory.peak_bytes as f64,
        }
    }
}

/// Varies one thing after the other, until that is done or it is stopped: then what is missing is in the report.
///
/// # Errors
/// [`StudyError`] if a detector cannot be modelled.
pub fn run(plan: &Plan, command: &str, progress: Progress) -> Result<Report, StudyError> {
    // Sizes take longer the larger they are.
    let work = |against: Against| against.sizes().iter().map(|size| against.work(*size)).sum::<usize>();
    let progress = progress.part(0, Against::ALL.into_iter().map(work).sum());
    let (mut sweeps, mut missing, mut done) = (Vec::new(), Vec::new(), 0);
    for against in Against::ALL {
        let mut sizes = Vec::new();
        for size in against.sizes().iter().copied() {
            let what = format!("{size} {}", against.name());
            progress.tell(&what, done);
            match progress.is_stopped() {
                true => missing.push(what),
                false => sizes.push(against.measured(size, plan)?),
            }
            done += against.work(size);
        }
        let power =
            |cost: Cost| Some(Growth { cost, power: Power::of(sizes.iter().map(|s| [s.size as f64, cost.of(s)]))? });
        let growth = against.costs().iter().filter_map(|cost| power(*cost)).collect();
        sweeps.push(SweepReport { against, solver: against.method().name().to_owned(), growth, sizes });
    }
    sweeps.retain(|sweep| !sweep.sizes.is_empty());
    Ok(Report {
        machine: Machine::this(),
        command: command.to_owned(),
        detector: sizes::detector().name,
        seed: plan.seed,
        places: plan.places,
        sweeps,
        missing,
    })
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::{AtomicBool, Ordering};

    use super::*;
    use crate::progress::Step;
    use crate::view::{page, text};

    const HEAP: Heap = Heap { start: || {}, stop: || Memory { kept_bytes: 1000, peak_bytes: 2000 } };

    #[test]
    fn what_is_stopped_has_its_sizes_and_says_what_is_missing() {
        let (plan, stop) = (Plan { places: 1, seed: 1, heap: HEAP }, AtomicBool::new(false));
        let after_two = |step: &Step| {
            if step.what == "32 electrodes" {
                stop.store(true, Ordering::Relaxed);
            }
        };
        let report = run(&plan, "tactomo <growth>", Progress::new(&stop, &after_two)).unwrap();
        let [sweep] = &report.sweeps[..] else { panic!("{:?}", report.sweeps) };
        assert_eq!(sweep.sizes.iter().map(|size| size.size).collect::<Vec<_>>(), [8, 16]);
        assert!(sweep.sizes.iter().all(|size| size.set_up_s.median > size.following_s.median), "{sweep:?}");
        let kept = sweep.growth.iter().find(|growth| growth.cost == Cost::Kept).unwrap();
        assert!(kept.power.exponent.abs() < 1e-9 && kept.power.standard_error.is_none());
        let views = [view(&report)];
        for shown in [page(&views, ""), text(&views)] {
            assert!(
                shown.contains("Partial") && shown.contains("32 electrodes; ") && !shown.contains("NaN"),
                "{shown}"
            );
        }
    }
}
