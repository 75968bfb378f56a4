//! The study as text and as a table for other programs.

use std::fmt::Write;

use super::super::claim;
use super::super::imaging::figure;
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
    text += "\n          the paper's metrics                             the sensor itself, contact of 1 S/m\n\
             sample        SENS     FMAX       SR       PA  PA noisy   place    auto  two points  S/N   from - to, N\n";
    for sample in &report.samples {
        _ = writeln!(text, "{}", row(sample));
    }
    text + "SENS in V per S/m and FMAX in S/m of the contact; SR and PA in brackets are of images that have collapsed; place, auto and two points in mm, S/N in dB\n"
}

fn row(sample: &Condition) -> String {
    let limit = &sample.limit;
    let reached = sample.reached.and_then(|reached| reached.place_m);
    format!(
        "{:8}  {:>9}  {:>7}  {:>7}  {:>7}  {:>7}     {:>6}  {:>6}  {:>6}      {:>4.0}  {} - {}",
        sample.name.unwrap_or("map"),
        number(sample.exact.sensitivity(), 1.0),
        number(sample.exact.maximum(), 1.0),
        figure(&sample.exact.imaging, 0),
        figure(&sample.exact.imaging, 1),
        figure(&sample.noisy.imaging, 1),
        number(limit.place_m, 1e3),
        number(reached, 1e3),
        number(limit.two_points_m, 1e3),
        limit.signal_to_noise_db,
        number(sample.force_range_n[0], 1.0),
        number(sample.force_range_n[1], 1.0)
    )
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
        "sr_collapsed",
        "pa_collapsed",
        "half_s_per_m",
        "half_sr",
        "half_pa",
        "half_sr_collapsed",
        "half_pa_collapsed",
        "half_place_m",
        "half_two_points_m",
    ];
    let mut text = heads.join(",") + "\n";
    for c in report.samples.iter().chain(&report.conditions) {
        let (limit, half) = (&c.limit, c.at_half.as_ref());
        let figures = [
            Some(c.bottom_s_per_m),
            Some(c.top_s_per_m),
            c.exact.sensitivity(),
            c.exact.maximum(),
            c.exact.printed_maximum,
            c.exact.imaging.spatial_resolution,
            c.exact.imaging.position_accuracy,
            c.noisy.sensitivity(),
            c.noisy.maximum(),
            c.noisy.imaging.spatial_resolution,
            c.noisy.imaging.position_accuracy,
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
            Some(f64::from(u8::from(c.exact.imaging.is_spread_out))),
            Some(f64::from(u8::from(c.exact.imaging.is_central))),
            half.map(|half| half.strength_s_per_m),
            half.and_then(|half| half.imaging.spatial_resolution),
            half.and_then(|half| half.imaging.position_accuracy),
            half.map(|half| f64::from(u8::from(half.imaging.is_spread_out))),
            half.map(|half| f64::from(u8::from(half.imaging.is_central))),
            half.and_then(|half| half.place_m),
            half.and_then(|half| half.two_points_m),
        ];
        _ = writeln!(text, "{},{}", c.name.unwrap_or_default(), cells(&figures));
    }
    text
}
