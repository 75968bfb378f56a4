//! The study as text and as a table for other programs.

use std::fmt::Write;

use super::super::claim;
use super::super::text::{cells, number};
use super::{Report, Row};

pub(super) fn table(report: &Report) -> String {
    let mut text = format!(
        "{} bonds in {:.1} s\n\n{}",
        report.rows.len(),
        report.course.seconds,
        claim::table(&report.course.claims)
    );
    let mut name = String::new();
    for row in &report.rows {
        if row.name() != name {
            name = row.name();
            _ = writeln!(text, "\n{name:36}  error, paper's   place   two points    SR   density in a dot");
        }
        let diameter = row.diameter_m.map_or("-".to_owned(), |m| format!("{:.2} mm", m * 1e3));
        _ = writeln!(
            text,
            "{diameter:>36}  {:>14}  {:>6}  {:>10}  {:>5}  {:>10}",
            number(row.position_error_m, 1e3),
            number(row.limit.place_m, 1e3),
            number(row.limit.two_points_m, 1e3),
            number(row.imaging.spatial_resolution, 1.0),
            number(row.largest_density_a_per_m2(), 1.0)
        );
    }
    text + "mm; density: largest mean over a dot, A/m2, of a contact in the middle with an electrode beside it grounded\n"
}

pub(super) fn figures(row: &Row) -> [Option<f64>; 7] {
    [
        row.diameter_m,
        row.position_error_m,
        row.imaging.spatial_resolution,
        row.limit.place_m,
        row.limit.two_points_m,
        Some(row.limit.signal_to_noise_db),
        row.largest_density_a_per_m2(),
    ]
}

pub(super) fn csv(report: &Report) -> String {
    let mut text =
        "dots,glue,diameter_m,position_error_m,sr,place_m,two_points_m,signal_to_noise_db,largest_density_a_per_m2\n"
            .to_owned();
    for row in &report.rows {
        let glue = row.glue.map_or("none", super::Glue::title);
        _ = writeln!(text, "{},{glue},{}", row.dots, cells(&figures(row)));
    }
    text
}
