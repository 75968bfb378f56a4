//! The paper's figure 6: samples in two planes of normalised metrics, as it measured them and as they are simulated.

use tactomo_study::page::{Axis, Chart, Mark, Series, Unit};

use super::super::text::number;
use super::{Report, Sample};

/// Where a failed fit is drawn: above all others.
const FAILED: f64 = 1.08;

/// A metric of a sample, and whether it is a figure: a failed fit and a collapsed image are none.
type Value = fn(&Sample) -> (Option<f64>, bool);

/// A metric: its name, whether it is normalised in its logarithm, measured and simulated.
struct Metric {
    name: &'static str,
    is_log: bool,
    of: [Value; 2],
}

const RESOLUTION: Metric = Metric {
    name: "SR",
    is_log: false,
    of: [
        |sample| (Some(sample.measured.spatial_resolution), true),
        |sample| (sample.imaging.spatial_resolution, !sample.imaging.is_spread_out),
    ],
};
const ACCURACY: Metric = Metric {
    name: "PA",
    is_log: false,
    of: [
        |sample| (Some(sample.measured.position_accuracy), true),
        |sample| (sample.imaging.position_accuracy, !sample.imaging.is_central),
    ],
};
const MAXIMUM: Metric = Metric {
    name: "FMAX",
    is_log: true,
    of: [
        |sample| (Some(sample.measured.printed_maximum_n), sample.measured.maximum_n.is_some()),
        |sample| (sample.curve.and_then(|fit| fit.maximum_force.value()), true),
    ],
};
const SENSITIVITY: Metric = Metric {
    name: "SENS",
    is_log: true,
    of: [
        |sample| (Some(sample.measured.sensitivity_mv_per_n), true),
        |sample| (sample.curve.and_then(|fit| fit.sensitivity.value()), true),
    ],
};

/// Both planes, measured and simulated.
pub(super) fn planes(report: &Report) -> Vec<String> {
    let both = [[&RESOLUTION, &MAXIMUM], [&ACCURACY, &SENSITIVITY]];
    let charts = both.into_iter().flat_map(|axes| [0, 1].map(|side| plane(report, axes, side).svg() + "\n"));
    vec![
        "<h3>Normalised</h3><p class=\"quiet\">The planes of figure 6, each metric from 0 for the lowest of these samples to 1 for the highest, SENS and FMAX in their logarithms: as the \
         paper measured them, and as they are simulated. Grey: a failed fit, above all others, or a collapsed image. A sample is missing where a figure is not determined.</p>"
            .to_owned(),
        format!("<div class=\"charts small\">{}</div>", charts.collect::<String>()),
    ]
}

/// Values of all samples from 0 to 1; failed ones above.
fn normalised(samples: &[Sample], metric: &Metric, side: usize) -> Vec<Option<(f64, bool)>> {
    let scaled = |value: f64| if metric.is_log { value.ln() } else { value };
    let values: Vec<(Option<f64>, bool)> = samples.iter().map(metric.of[side]).collect();
    // A collapsed image has a value like others; a failed fit has none.
    let counts = |is_figure: bool| is_figure || !metric.is_log;
    let counted = values.iter().filter(|(_, is_figure)| counts(*is_figure)).filter_map(|(value, _)| *value).map(scaled);
    let [low, high] = counted.fold([f64::INFINITY, f64::NEG_INFINITY], |[a, b], value| [a.min(value), b.max(value)]);
    let share = |value: f64| if high > low { (scaled(value) - low) / (high - low) } else { 0.5 };
    let place = |(value, is_figure): &(Option<f64>, bool)| {
        value.map(|value| (if counts(*is_figure) { share(value) } else { FAILED }, *is_figure))
    };
    values.iter().map(place).collect()
}

fn plane(report: &Report, [x, y]: [&Metric; 2], side: usize) -> Chart {
    let samples = &report.samples;
    let both = normalised(samples, x, side).into_iter().zip(normalised(samples, y, side));
    let series = samples.iter().zip(both).filter_map(|(sample, (at_x, at_y))| {
        let ((at_x, is_x), (at_y, is_y)) = (at_x?, at_y?);
        let text = |metric: &Metric| format!("{} {}", metric.name, number(metric.of[side](sample).0, 1.0));
        let tooltip = format!("{}: {}, {}", sample.measured.name, text(x), text(y));
        Some(Series {
            name: sample.measured.name.to_owned(),
            class: if is_x && is_y { "contacts" } else { "collapsed" },
            marks: vec![Mark { x: at_x, y: at_y, tooltip }],
            main: 0,
            is_joined: false,
        })
    });
    let axis = |metric: &Metric| {
        let title = format!("{}{}, normalised", if metric.is_log { "log " } else { "" }, metric.name);
        Axis { range: [-0.08, 1.14], ..Axis::linear(&title, Unit::Plain, []) }
    };
    Chart {
        title: format!("{} and {}, {}", x.name, y.name, ["measured", "simulated"][side]),
        subtitle: format!("{} upwards", axis(y).title),
        x: axis(x),
        y: axis(y),
        series: series.collect(),
        has_front: false,
        guide: None,
        level: None,
        size: [360.0, 300.0],
    }
}
