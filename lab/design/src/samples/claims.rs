//! Whether the simulation ranks the samples as the experiment did.

use super::super::claim::{Basis, Found, Verdict};
use super::super::rank::{chance, holm, p_text, spearman};
use super::{Claim, Sample};

/// One false prediction among all tests of the family is less likely than this.
const FALSE_ONE: f64 = 0.05;

type Figure = fn(&Sample) -> Option<f64>;

/// A metric: what it is called, what was measured, and what of it is simulated with the paper's solver and of the sensor itself.
struct Metric {
    claim: &'static str,
    measured: Figure,
    solver: Figure,
    sensor: (&'static str, Figure),
}

const METRICS: [Metric; 4] = [
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
        solver: |sample| sample.imaging.sharpness(),
        sensor: ("two points told apart", |sample| sample.limit.two_points_m.map(|m| -m)),
    },
    Metric {
        claim: "... of measured position accuracies",
        measured: |sample| Some(sample.measured.position_accuracy),
        solver: |sample| sample.imaging.accuracy(),
        sensor: ("standard error of places", |sample| sample.limit.place_m.map(|m| -m)),
    },
];

/// Eight tests, two of each metric, are one family: chance gives one of them in 20 three times as often as one alone.
pub(super) fn of(samples: &[Sample]) -> Vec<Claim> {
    let ranked: Vec<[Ranked; 2]> = METRICS
        .iter()
        .map(|metric| [metric.solver, metric.sensor.1].map(|figure| Ranked::of(samples, metric.measured, figure)))
        .collect();
    let chances: Vec<_> = ranked.iter().flatten().map(|ranked| ranked.chance).collect();
    let stand = holm(&chances, FALSE_ONE);
    let claim = |((metric, [solver, sensor]), stand): ((&Metric, &[Ranked; 2]), &[bool])| {
        let found = [
            solver.found("the same metric", stand[0], chances.len()),
            sensor.found(metric.sensor.0, stand[1], chances.len()),
        ];
        Claim::new(metric.claim, Basis::Solver, found)
    };
    METRICS.iter().zip(&ranked).zip(stand.chunks_exact(2)).map(claim).collect()
}

/// How a figure ranks samples, against the measured one.
struct Ranked {
    correlation: Option<f64>,
    /// Probability of a correlation so far from zero by chance alone.
    chance: Option<f64>,
    samples: usize,
}

impl Ranked {
    fn of(samples: &[Sample], measured: Figure, figure: Figure) -> Self {
        let pairs: Vec<_> = samples.iter().filter_map(|sample| Some([measured(sample)?, figure(sample)?])).collect();
        Self { correlation: spearman(&pairs), chance: chance(&pairs), samples: pairs.len() }
    }

    /// Whether the order is predicted: in the right direction, and beyond what chance gives among all tests. What is not beyond it is not shown; of fewer than
    /// five samples no order is.
    fn found(&self, what: &str, stands: bool, tests: usize) -> Found {
        let (Some(correlation), Some(chance)) = (self.correlation, self.chance) else {
            return Found::new(Verdict::Unknown, format!("{what}: too few samples"));
        };
        let (verdict, words) = match stands {
            true if correlation > 0.0 => (Verdict::Holds, "the order is predicted"),
            true => (Verdict::DoesNotHold, "the order is the opposite"),
            false => (Verdict::NotShown, "that shows nothing"),
        };
        let p = p_text(chance);
        let text = format!(
            "{what}: rank correlation {correlation:+.2} (n = {}), {p} alone; of {tests} tests (Holm), {words}",
            self.samples
        );
        Found::new(verdict, text)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_chance_may_give_is_not_shown_and_what_it_cannot_is() {
        let verdict = |correlation, stands| {
            let ranked = Ranked { correlation, chance: correlation.map(|_| 2e-5), samples: 9 };
            let found = ranked.found("it", stands, 8);
            (found.verdict, found.text.contains("p < 0.001"))
        };
        assert_eq!(verdict(Some(0.9), true), (Verdict::Holds, true));
        assert_eq!(verdict(Some(-0.9), true), (Verdict::DoesNotHold, true));
        assert_eq!(verdict(Some(0.7), false), (Verdict::NotShown, true));
        assert_eq!(verdict(None, false), (Verdict::Unknown, false));
    }
}
