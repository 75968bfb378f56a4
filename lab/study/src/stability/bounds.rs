//! What noise allows, and what solvers reach.

use super::scenes::{APART, pair};
use super::sweep::Bench;
use super::trials::Trials;
use crate::bound::cramer_rao;
use crate::experiment::StudyError;
use crate::scenes::SceneKind;
use tactomo_physics::scene::{Contact, Touch};

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

/// Both.
pub(super) fn report(bench: &Bench, trials: &mut Trials) -> Result<BoundReport, StudyError> {
    let sheet_s = bench.sound.detector.sheet_conductance_s();
    let one = |sheets: f64, seed: u64| {
        vec![Contact { conductance_s: sheets * sheet_s, ..bench.contact(SceneKind::Firm, seed) }]
    };
    let distances_m = APART.map(|share| share * bench.sound.reach_m());
    let two = |kind: SceneKind| {
        move |apart_m: f64, seed: u64| pair(bench, kind, apart_m / bench.sound.reach_m(), seed).to_vec()
    };
    let charts = vec![
        chart(bench, trials, ("One contact, against its conductance", false), &CONDUCTANCES, one)?,
        chart(
            bench,
            trials,
            ("Two light contacts, against their distance", true),
            &distances_m,
            two(SceneKind::Light),
        )?,
        chart(bench, trials, ("Two firm contacts, against their distance", true), &distances_m, two(SceneKind::Firm))?,
    ];
    Ok(BoundReport { charts })
}

fn chart(
    bench: &Bench,
    trials: &mut Trials,
    (title, is_distance): (&str, bool),
    values: &[f64],
    contacts: impl Fn(f64, u64) -> Vec<Contact>,
) -> Result<BoundChart, StudyError> {
    let methods = &bench.plan.methods;
    let mut curves = vec![BoundCurve { solver: None, points: Vec::new() }];
    curves
        .extend(methods.iter().map(|method| BoundCurve { solver: Some(method.name().to_owned()), points: Vec::new() }));
    for value in bench.some(values) {
        curves[0].points.extend(bound(bench, |seed| contacts(*value, seed))?.map(|bound_m| [*value, bound_m]));
        let touches = |seed| contacts(*value, seed).into_iter().map(Touch::from).collect();
        let point = bench.touched(String::new(), 0.0, bench.sound.with_faults(&[], 0)?, touches)?;
        for (method, curve) in methods.iter().zip(&mut curves[1..]) {
            let error_m = trials.summary(*method, &point)?.and_then(|summary| summary.error_m);
            curve.points.extend(error_m.map(|error_m| [*value, error_m]));
        }
    }
    Ok(BoundChart { title: title.to_owned(), is_distance, curves })
}

/// Mean of the bound over contacts and places (m); `None` where they cannot be separated.
fn bound(bench: &Bench, contacts: impl Fn(u64) -> Vec<Contact>) -> Result<Option<f64>, StudyError> {
    let deviation_v = bench.sound.detector.adc.deviation_v();
    let mut all = Vec::new();
    for seed in bench.seeds() {
        match cramer_rao(&*bench.sound.problem.model, &contacts(seed), deviation_v)? {
            Some(bounds) => all.extend(bounds.iter().map(|bound| bound.position_m)),
            None => return Ok(None),
        }
    }
    Ok(Some(all.iter().sum::<f64>() / all.len().max(1) as f64))
}
