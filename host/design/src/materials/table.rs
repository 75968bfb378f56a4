//! The study as text and as a table for other programs.

use std::fmt::Write;

use super::super::claim;
use super::super::text::{cells, number};
use super::{Condition, Report};

/// Claims, samples, and where on the map each figure is best.
pub(super) fn table(report: &Report) -> String {
    let mut text = format!(
        "{} of {} conditions and {} samples in {:.1} s{}\n\n",
        report.conditions.len(),
        report.conductivities_s_per_m.len().pow(2),
        report.samples.len(),
        report.course.seconds,
        if report.course.is_stopped { ", stopped before the end" } else { "" }
    );
    text += &claim::table(&report.course.claims);
    text += "\n          paper's solver                                the sensor itself, contact of 1 S/m\n\
             sample    SENS       FMAX     SR     PA    PA noisy     place   auto    two points  S/N   from - to, N\n";
    for sample in &report.samples {
        _ = writeln!(text, "{}", row(sample));
    }
    text + "SENS in V per S/m and FMAX in S/m of the contact; place, auto and two points in mm, S/N in dB\n"
}

fn row(sample: &Condition) -> String {
    let limit = &sample.limit;
    let reached = sample.reached.and_then(|reached| reached.place_m);
    format!(
        "{:8}  {:>9}  {:>7}  {:>5}  {:>5}  {:>5}       {:>6}  {:>6}  {:>6}      {:>4.0}  {} - {}",
        sample.name.unwrap_or("map"),
        number(sample.exact.sensitivity(), 1.0),
        number(sample.exact.maximum(), 1.0),
        digits(sample.exact.spatial_resolution),
        digits(sample.exact.position_accuracy),
        digits(sample.noisy.position_accuracy),
        number(limit.place_m, 1e3),
        number(reached, 1e3),
        number(limit.two_points_m, 1e3),
        limit.signal_to_noise_db,
        number(sample.force_range_n[0], 1.0),
        number(sample.force_range_n[1], 1.0)
    )
}

fn digits(value: Option<f64>) -> String {
    value.map_or("-".to_owned(), |value| format!("{value:.3}"))
}

/// A row for each condition and sample, with heads; empty where a figure is open.
pub(super) fn csv(report: &Report) -> String {
    let heads = [
        "sample",
        "bottom_s_per_m",
        "top_s_per_m",
        "sens_v_per_s_per_m",
        "fmax_s_per_m",
        "fmax_printed_s_per_m",
        "sr",
        "pa",
        "noisy_sens_v_per_s_per_m",
        "noisy_fmax_s_per_m",
        "noisy_sr",
        "noisy_pa",
        "signal_to_noise_db",
        "place_m",
        "conductance_share",
        "two_points_m",
        "lightest_s_per_m",
        "saturated_s_per_m",
        "lightest_n",
        "saturated_n",
        "auto_place_m",
        "auto_found",
    ];
    let mut text = heads.join(",") + "\n";
    for c in report.samples.iter().chain(&report.conditions) {
        let limit = &c.limit;
        let figures = [
            Some(c.bottom_s_per_m),
            Some(c.top_s_per_m),
            c.exact.sensitivity(),
            c.exact.maximum(),
            c.exact.printed_maximum,
            c.exact.spatial_resolution,
            c.exact.position_accuracy,
            c.noisy.sensitivity(),
            c.noisy.maximum(),
            c.noisy.spatial_resolution,
            c.noisy.position_accuracy,
            Some(limit.signal_to_noise_db),
            limit.place_m,
            limit.conductance,
            limit.two_points_m,
            limit.range[0],
            limit.range[1],
            c.force_range_n[0],
            c.force_range_n[1],
            c.reached.and_then(|reached| reached.place_m),
            c.reached.map(|reached| reached.found),
        ];
        _ = writeln!(text, "{},{}", c.name.unwrap_or_default(), cells(&figures));
    }
    text
}
