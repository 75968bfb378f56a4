//! Whether the simulation ranks the samples as the experiment did.

use tactomo_touch::student::quantile;

use super::super::claim::Verdict;
use super::super::rank::spearman;
use super::{Claim, Sample};

/// Of a standard normal distribution: one in 20 is beyond.
const CHANCE_DEVIATIONS: f64 = 1.959_964;

type Figure = fn(&Sample) -> Option<f64>;

/// A metric: what it is called, what was measured, and what of it is simulated with the paper's solver and of the sensor itself.
pub(super) struct Metric {
    pub claim: &'static str,
    pub measured: Figure,
    pub solver: Figure,
    pub sensor: (&'static str, Figure),
}

pub(super) const METRICS: [Metric; 4] = [
    Metric {
        claim: "the simulation predicts the order of measured sensitivities",
        measured: |sample| Some(sample.measured.sensitivity_mv_per_n),
        solver: |sample| sample.curve.and_then(|fit| fit.sensitivity.value()),
        sensor: ("signal to noise", |sample| Some(sample.limit.signal_to_noise_db)),
    },
    Metric {
        claim: "... of measured maximum forces",
        measured: |sample| sample.measured.maximum_n,
        solver: |sample| sample.curve.and_then(|fit| fit.maximum_force.value()),
        sensor: ("force at nine tenths of the drive", |sample| sample.limit.range[1]),
    },
    Metric {
        claim: "... of measured spatial resolutions",
        measured: |sample| Some(sample.measured.spatial_resolution),
        solver: |sample| sample.spatial_resolution,
        sensor: ("two points told apart", |sample| sample.limit.two_points_m.map(|m| -m)),
    },
    Metric {
        claim: "... of measured position accuracies",
        measured: |sample| Some(sample.measured.position_accuracy),
        solver: |sample| sample.position_accuracy,
        sensor: ("standard error of places", |sample| sample.limit.place_m.map(|m| -m)),
    },
];

pub(super) fn of(samples: &[Sample]) -> Vec<Claim> {
    let claim = |metric: &Metric| {
        let [solver, sensor] =
            [metric.solver, metric.sensor.1].map(|figure| Ranked::of(samples, metric.measured, figure));
        Claim {
            claim: metric.claim,
            verdict: Verdict::of(solver.is_there(), sensor.is_there()),
            solver: solver.text("the same metric"),
            sensor: sensor.text(metric.sensor.0),
        }
    };
    METRICS.iter().map(claim).collect()
}

/// How a figure ranks samples, against the measured one.
struct Ranked {
    correlation: Option<f64>,
    samples: usize,
}

impl Ranked {
    fn of(samples: &[Sample], measured: Figure, figure: Figure) -> Self {
        let pairs: Vec<_> = samples.iter().filter_map(|sample| Some([measured(sample)?, figure(sample)?])).collect();
        Self { correlation: spearman(&pairs), samples: pairs.len() }
    }

    /// Whether chance alone ranks so well once in 20 times or less: Student's test of a rank correlation.
    fn is_there(&self) -> Option<bool> {
        let (correlation, freedom) = (self.correlation?, self.samples as f64 - 2.0);
        let t = correlation * (freedom / (1.0 - correlation * correlation).max(1e-12)).sqrt();
        Some(t > quantile(CHANCE_DEVIATIONS, freedom))
    }

    fn text(&self, what: &str) -> String {
        let Some(correlation) = self.correlation else { return format!("{what}: too few samples") };
        let words = match self.is_there() {
            Some(true) => "the order is predicted",
            _ if correlation < -0.5 => "the order is rather the opposite",
            _ => "no more than chance can give",
        };
        format!("{what}: rank correlation {correlation:+.2} over {} samples; {words}", self.samples)
    }
}
