//! The study as text and as a table for other programs.

use std::fmt::Write;

use super::super::claim;
use super::super::curve::Figure;
use super::super::imaging::figure;
use super::super::text::{cells, number};
use super::{Report, Sample};

pub(super) fn table(report: &Report) -> String {
    let mut text = format!(
        "{} samples in {:.1} s; simulated [measured in the paper]\n\n{}",
        report.samples.len(),
        report.course.seconds,
        claim::table(&report.course.claims)
    );
    text += "\nsample   SENS              FMAX, N                                    SR               PA               place, mm   auto, mm  two points, mm\n";
    for sample in &report.samples {
        let measured = &sample.measured;
        _ = writeln!(
            text,
            "{:7}  {:>8} [{:.3}]  {:>23} [{:>17}]  {:>7} [{:.3}]  {:>7} [{:.3}]  {:>9}  {:>9}  {:>9}",
            measured.name,
            number(sensitivity(sample), 1.0),
            measured.sensitivity_mv_per_n,
            banded(maximum(sample), "N"),
            measured.maximum_text(),
            figure(&sample.imaging, 0),
            measured.spatial_resolution,
            figure(&sample.imaging, 1),
            measured.position_accuracy,
            number(sample.limit.place_m, 1e3),
            number(sample.reached.place_m, 1e3),
            number(sample.limit.two_points_m, 1e3)
        );
    }
    _ = writeln!(text, "\n{}", below_the_middle(report));
    if let Some(choices) = &report.choices {
        _ = writeln!(
            text,
            "\nwhat the paper leaves open of its solver: SR and PA of sample A, in brackets where collapsed"
        );
        for choice in choices.one_at_a_time() {
            _ = writeln!(
                text,
                "{:>7}  {:.3}  {}, {}, {}",
                choice.resolution_text(),
                choice.position_accuracy,
                choice.lambda.unwrap_or_default(),
                choice.rows,
                choice.pads
            );
        }
        _ = writeln!(text, "{}\n", choices.text());
    }
    text + "SENS: output per newton at 2.5 N, in S/m2 over a sheet of 1 S; measured in mV/N. FMAX with its 95 % band; at 2.25 N the rest; in round brackets: of images that have collapsed\n"
}

pub(super) fn sensitivity(sample: &Sample) -> Option<f64> {
    sample.curve.and_then(|fit| fit.sensitivity.value())
}

pub(super) fn maximum(sample: &Sample) -> Figure {
    sample.curve.map_or(Figure::Open, |fit| fit.maximum_force)
}

/// A figure with its band, or what is known of it.
pub(super) fn banded(figure: Figure, unit: &str) -> String {
    let three = |value: f64| number(Some(value), 1.0);
    match figure {
        Figure::Determined { value, low, high } => format!("{}, {} to {}", three(value), three(low), three(high)),
        Figure::Above(least) => format!("not determined, above {least:.0} {unit}"),
        Figure::Open => "not determined".to_owned(),
    }
}

/// Which measured PA are worse than answering "the middle": a sentence.
pub(super) fn below_the_middle(report: &Report) -> String {
    let middle = report.accuracy_of_the_middle;
    let below: Vec<&str> = report
        .samples
        .iter()
        .filter(|sample| sample.measured.position_accuracy < middle)
        .map(|sample| sample.measured.name)
        .collect();
    format!(
        "Answering \"the middle\", whatever is read, has PA {middle:.3} over the nine places; of {} measured PA {} are below that ({}).",
        report.samples.len(),
        below.len(),
        below.join(", ")
    )
}

pub(super) fn csv(report: &Report) -> String {
    let mut text = "sample,sens,fmax_n,fmax_low_n,fmax_high_n,sr,pa,measured_sens_mv_per_n,measured_fmax_n,measured_sr,measured_pa,measured_fmax_printed_n,sr_collapsed,pa_collapsed,place_m,two_points_m,\
                    signal_to_noise_db,lightest_n,saturated_n,auto_place_m,auto_found\n"
        .to_owned();
    for sample in &report.samples {
        let [low, high] = match maximum(sample) {
            Figure::Determined { low, high, .. } => [Some(low), Some(high)],
            _ => [None, None],
        };
        let (measured, limit) = (&sample.measured, &sample.limit);
        let figures = [
            sensitivity(sample),
            maximum(sample).value(),
            low,
            high,
            sample.imaging.spatial_resolution,
            sample.imaging.position_accuracy,
            Some(measured.sensitivity_mv_per_n),
            measured.maximum_n,
            Some(measured.spatial_resolution),
            Some(measured.position_accuracy),
            Some(measured.printed_maximum_n),
            Some(f64::from(u8::from(sample.imaging.is_spread_out))),
            Some(f64::from(u8::from(sample.imaging.is_central))),
            limit.place_m,
            limit.two_points_m,
            Some(limit.signal_to_noise_db),
            limit.range[0],
            limit.range[1],
            sample.reached.place_m,
            Some(sample.reached.found),
        ];
        _ = writeln!(text, "{},{}", measured.name, cells(&figures));
    }
    text
}
