//! What noise allows, and what solvers reach.

use super::scenes::{APART, pair};
use super::sweep::Bench;
use super::trials::Trials;
use crate::bound::{Bound, Errors, cramer_rao};
use crate::experiment::StudyError;
use crate::scenes::SceneKind;
use crate::score::Summary;
use tactomo_physics::scene::{Contact, Touch};
use tactomo_touch::solve::Method;

/// Conductances of one contact (sheet conductances).
const CONDUCTANCES: [f64; 7] = [0.003, 0.01, 0.03, 0.1, 0.3, 1.0, 3.0];

/// Errors against what noise allows.
#[derive(Clone, Debug, serde::Serialize)]
pub struct BoundReport {
    /// One contact against its conductance (sheet conductances); two against their distance (m), when light and when firm.
    pub charts: Vec<BoundChart>,
}

/// A chart.
#[derive(Clone, Debug, serde::Serialize)]
pub struct BoundChart {
    /// What it shows.
    pub title: String,
    /// What is to the right: conductances in sheet conductances, or distances in metres.
    pub is_distance: bool,
    /// The bound first, then the solvers.
    pub curves: Vec<BoundCurve>,
}

/// Errors along a chart.
#[derive(Clone, Debug, serde::Serialize)]
pub struct BoundCurve {
    /// The solver; `None` for the bound.
    pub solver: Option<String>,
    /// Value and error (m).
    pub points: Vec<[f64; 2]>,
}

/// What a chart has: its title, what is to the right, at which values, and the contacts at a value and a seed.
pub(super) struct Charted {
    pub title: &'static str,
    is_distance: bool,
    values: &'static [f64],
    contacts: fn(&Bench, f64, u64) -> Vec<Contact>,
}

/// All charts. Distances are in mean distances of electrodes.
pub(super) const CHARTS: [Charted; 3] = [
    Charted {
        title: "One contact, against its conductance",
        is_distance: false,
        values: &CONDUCTANCES,
        contacts: |bench, sheets, seed| {
            let conductance_s = sheets * bench.sound.detector.sheet_conductance_s();
            vec![Contact { conductance_s, ..bench.contact(SceneKind::Firm, seed) }]
        },
    },
    Charted {
        title: "Two light contacts, against their distance",
        is_distance: true,
        values: &APART,
        contacts: |bench, apart, seed| pair(bench, SceneKind::Light, apart, seed).to_vec(),
    },
    Charted {
        title: "Two firm contacts, against their distance",
        is_distance: true,
        values: &APART,
        contacts: |bench, apart, seed| pair(bench, SceneKind::Firm, apart, seed).to_vec(),
    },
];

impl Charted {
    /// How much work it is, in points.
    pub fn work(&self) -> usize {
        self.values.len()
    }

    /// The bound and the solvers along it.
    pub fn of(&self, bench: &Bench, trials: &mut Trials) -> Result<BoundChart, StudyError> {
        let methods = &bench.plan.methods;
        let curve = |solver: Option<&Method>| BoundCurve {
            solver: solver.map(|method| method.name().to_owned()),
            points: Vec::new(),
        };
        let mut curves: Vec<_> = std::iter::once(None).chain(methods.iter().map(Some)).map(curve).collect();
        for value in bench.some(self.values) {
            let x = value * if self.is_distance { bench.sound.reach_m() } else { 1.0 };
            let contacts = |seed| (self.contacts)(bench, *value, seed);
            curves[0].points.extend(bound(bench, contacts)?.map(|bound_m| [x, bound_m]));
            let touches = |seed| contacts(seed).into_iter().map(Touch::from).collect();
            let point = bench.touched(String::new(), 0.0, bench.sound.with_faults(&[], 0)?, touches)?;
            for (method, curve) in methods.iter().zip(&mut curves[1..]) {
                let error_m = trials.scores(*method, &point)?.and_then(|scores| Summary::of(&scores).error_m);
                curve.points.extend(error_m.map(|error_m| [x, error_m]));
            }
        }
        Ok(BoundChart { title: self.title.to_owned(), is_distance: self.is_distance, curves })
    }
}

/// Mean distance of errors at the bound over contacts and places (m); `None` where they cannot be separated.
fn bound(bench: &Bench, contacts: impl Fn(u64) -> Vec<Contact>) -> Result<Option<f64>, StudyError> {
    let detector = &bench.sound.detector;
    let errors = Errors::of_noise(detector, detector.adc.deviation_v());
    let mut all = Vec::new();
    for seed in bench.seeds() {
        match cramer_rao(&*bench.sound.problem.model, &contacts(seed), &errors)? {
            Some(bounds) => all.extend(bounds.iter().map(Bound::mean_m)),
            None => return Ok(None),
        }
    }
    Ok(Some(all.iter().sum::<f64>() / all.len().max(1) as f64))
}
