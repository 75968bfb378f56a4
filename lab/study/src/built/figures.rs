//! What trials show together.

use super::Trial;
use crate::score::quantiles;
use tactomo_touch::solve::Method;

/// Figures of a solver.
#[derive(Clone, Debug, serde::Serialize)]
pub struct Row {
    /// Name of the detector; none where it is over all.
    pub detector: Option<String>,
    /// Name of the solver.
    pub solver: &'static str,
    /// Contacts of the scenes.
    pub contacts: usize,
    /// The figures.
    #[serde(flatten)]
    pub figures: Figures,
}

/// Figures of some trials.
#[derive(Clone, Debug, Default, serde::Serialize)]
pub struct Figures {
    /// Scenes.
    pub scenes: usize,
    /// Mean distance of true contacts from those found for them (m), and its 95th percentile; none if nothing was found.
    pub error_m: Option<f64>,
    /// See [`error_m`](Self::error_m).
    pub p95_m: Option<f64>,
    /// Share of scenes in which as many contacts were found as touched.
    pub count_right: f64,
    /// Share of scenes that are flagged as misfits.
    pub misfit: f64,
    /// Share of coordinates within one and two claimed standard errors; none if none are claimed.
    pub within: Option<[f64; 2]>,
    /// The same of the logarithms of conductances.
    pub within_conductance: Option<[f64; 2]>,
    /// Median of the claimed standard errors (m).
    pub claimed_m: Option<f64>,
    /// Median time of a frame (s), and its 95th percentile.
    pub time_s: [f64; 2],
}

/// Rows of all solvers: single contacts, then more; for each of the detectors named, then over all.
pub(super) fn rows(methods: &[Method], trials: &[Trial], detectors: &[String]) -> Vec<Row> {
    let mut counts: Vec<_> = trials.iter().map(|trial| trial.truth.len()).collect();
    counts.sort_unstable();
    counts.dedup();
    let each = detectors.iter().enumerate().map(|(index, name)| (Some(index), Some(name.clone())));
    let mut rows = Vec::new();
    for (index, detector) in each.chain([(None, None)]) {
        for contacts in counts.iter().copied() {
            for method in methods {
                let chosen = trials.iter().filter(|trial| {
                    let is_of = index.is_none_or(|index| trial.detector == index);
                    is_of && trial.truth.len() == contacts && trial.solver == method.name()
                });
                let figures = Figures::of(&chosen.collect::<Vec<_>>());
                rows.push(Row { detector: detector.clone(), solver: method.name(), contacts, figures });
            }
        }
    }
    rows
}

impl Figures {
    fn of(trials: &[&Trial]) -> Self {
        let share = |is: &dyn Fn(&Trial) -> bool| {
            trials.iter().filter(|trial| is(trial)).count() as f64 / trials.len().max(1) as f64
        };
        let errors_m: Vec<_> = trials.iter().flat_map(|trial| trial.errors_m.iter().copied()).collect();
        let sigmas: Vec<_> = trials.iter().flat_map(|trial| trial.sigmas.iter().flatten().copied()).collect();
        let of_conductance = |[off, claimed]: &[f64; 2]| off / claimed;
        let conductances: Vec<_> =
            trials.iter().flat_map(|trial| trial.ln_conductances.iter().map(of_conductance)).collect();
        let claimed_m = trials.iter().flat_map(|trial| trial.claimed_m.iter().copied());
        Self {
            scenes: trials.len(),
            error_m: (!errors_m.is_empty()).then(|| errors_m.iter().sum::<f64>() / errors_m.len() as f64),
            p95_m: quantiles(errors_m.iter().copied(), [0.95]).map(|[p95_m]| p95_m),
            count_right: share(&|trial| trial.is_count_right),
            misfit: share(&|trial| trial.misfit),
            within: within(&sigmas),
            within_conductance: within(&conductances),
            claimed_m: quantiles(claimed_m, [0.5]).map(|[median_m]| median_m),
            time_s: quantiles(trials.iter().map(|trial| trial.time_s), [0.5, 0.95]).unwrap_or_default(),
        }
    }
}

/// Shares of errors within one and two standard errors; `None` of none.
fn within(sigmas: &[f64]) -> Option<[f64; 2]> {
    let within = |sigma: f64| sigmas.iter().filter(|off| off.abs() < sigma).count() as f64 / sigmas.len() as f64;
    (!sigmas.is_empty()).then(|| [within(1.0), within(2.0)])
}
