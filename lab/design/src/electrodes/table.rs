//! The study as text and as a table for other programs.

use std::fmt::Write;

use super::super::text::{cells, number};
use super::{Group, Report};

pub(super) fn table(report: &Report) -> String {
    let mut text = format!("{} sets of electrodes in {:.1} s\n", report.rows.len(), report.course.seconds);
    for group in Group::ALL {
        _ = writeln!(
            text,
            "\n{:22}  conversions   place  median     p90     rms  in same time    auto  two points  S/N, dB",
            group.title()
        );
        for row in report.rows.iter().filter(|row| row.group == group) {
            _ = writeln!(
                text,
                "{:22}  {:11}  {:>6}  {:>6}  {:>6}  {:>6}  {:>12}  {:>6}  {:>10}  {:7.0}",
                row.name,
                row.conversions,
                number(row.limit.place_m, 1e3),
                number(row.everywhere.map(|spread| spread.median_m), 1e3),
                number(row.everywhere.map(|spread| spread.p90_m), 1e3),
                number(row.everywhere.map(|spread| spread.rms_m), 1e3),
                number(row.median_in_same_time_m, 1e3),
                number(row.reached.place_m, 1e3),
                number(row.limit.two_points_m, 1e3),
                row.limit.signal_to_noise_db
            );
        }
    }
    text + "\nmm; place: at the paper's nine places (rms); median, p90 and rms: over the whole surface; in same time: the median with as many frames as take the time of one of 16\n"
}

pub(super) fn csv(report: &Report) -> String {
    let mut text = "group,name,electrodes,diameter_m,conversions,place_m,worst_place_m,everywhere_median_m,everywhere_p90_m,everywhere_rms_m,median_in_same_time_m,two_points_m,signal_to_noise_db,\
                    lightest_s_per_m,saturated_s_per_m,auto_place_m,auto_found\n"
        .to_owned();
    for row in &report.rows {
        let limit = &row.limit;
        let figures = [
            Some(row.layout.count() as f64),
            Some(row.diameter_m),
            Some(row.conversions as f64),
            limit.place_m,
            limit.worst_place_m,
            row.everywhere.map(|spread| spread.median_m),
            row.everywhere.map(|spread| spread.p90_m),
            row.everywhere.map(|spread| spread.rms_m),
            row.median_in_same_time_m,
            limit.two_points_m,
            Some(limit.signal_to_noise_db),
            limit.range[0],
            limit.range[1],
            row.reached.place_m,
            Some(row.reached.found),
        ];
        _ = writeln!(text, "{:?},\"{}\",{}", row.group, row.name, cells(&figures));
    }
    text
}
