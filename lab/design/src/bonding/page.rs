//! The study as parts of a page.

use std::fmt::Write;

use tactomo_study::page::{Axis, Chart, Mark, Series, Unit, colour, escaped, table};

use super::super::text::number;
use super::claims::series;
use super::section;
use super::table::figures;
use super::{Bar, GRIDS, Glue, Report, Row};

/// Errors below this show there (m).
const FLOOR_M: f64 = 1e-6;
/// Diameters whose currents are drawn, by their place.
const DRAWN: [usize; 3] = [1, 4, 9];
/// Side of a drawing (px), and of a detector (m).
const SIDE: f64 = 200.0;
const SIDE_M: f64 = 0.060;

pub(super) fn parts(report: &Report) -> Vec<String> {
    let charts = [
        chart(report, "Error of the paper's solver", Unit::Metres, |row| row.position_error_m),
        chart(report, "Standard error of a place", Unit::Metres, |row| row.limit.place_m),
        chart(report, "Largest current density of a dot, A/m2", Unit::Plain, Row::largest_density_a_per_m2),
    ];
    let charts: String = charts.iter().map(|chart| chart.svg() + "\n").collect();
    let drawings: String = GRIDS
        .iter()
        .flat_map(|dots| {
            let all: Vec<&Row> = series(&report.rows, *dots, Glue::Conducting).collect();
            DRAWN.into_iter().filter_map(move |index| all.get(index).copied()).map(drawing).collect::<Vec<_>>()
        })
        .collect();
    vec![
        format!("<div class=\"charts small\">{charts}</div>"),
        "<h3>Current in the dots</h3><p class=\"quiet\">Of a contact in the middle (ring), with the electrode at the cross grounded: each dot's mean density over the largest one of the picture; light is \
         more. Hover for the values.</p>"
            .to_owned(),
        format!("<div class=\"maps\">{drawings}</div>"),
        "<h3>A bar with 1 V from top to bottom</h3><p class=\"quiet\">Two halves of a conductor of 1 S/m that one dot of glue joins: a dot's share of the bond, as a cylinder. Wider dots let more current through \
         the bond, and less through each square metre of dot. Lines are 0.05 V apart.</p>"
            .to_owned(),
        format!("<div class=\"single\">{}</div>{}", density(report).svg(), bars(report)),
        all(report),
    ]
}

/// Current density over the dots' diameter: over the bond, and over the dot.
fn density(report: &Report) -> Chart {
    let per_grid = report.bars.len() / GRIDS.len();
    let of = |grid: usize, what: &str, class: &'static str, value: fn(&Bar) -> f64| {
        let mark = |bar: &Bar| Mark {
            x: bar.dot_diameter_m,
            y: value(bar),
            tooltip: format!("{}, {what}: {}", Unit::Metres.text(bar.dot_diameter_m), number(Some(value(bar)), 1.0)),
        };
        let marks: Vec<_> = report.bars.iter().skip(grid * per_grid).take(per_grid).map(mark).collect();
        let name = format!("{0} x {0}, {what}", GRIDS[grid]);
        Series { name, class, main: marks.len() / 2, marks, is_joined: true }
    };
    let series = vec![
        of(0, "bond", "paper", |bar| bar.over_bond_a_per_m2),
        of(1, "bond", "contacts", |bar| bar.over_bond_a_per_m2),
        of(0, "dot", "bound", |bar| bar.over_dot_a_per_m2),
        of(1, "dot", "linear", |bar| bar.over_dot_a_per_m2),
    ];
    let values = |of: fn(&Mark) -> f64| series.iter().flat_map(|line| &line.marks).map(of).collect::<Vec<_>>();
    Chart {
        title: "Mean current density, A/m2".to_owned(),
        subtitle: "over the bond, and over the dot".to_owned(),
        x: Axis::over("diameter of a dot", Unit::Metres, values(|mark| mark.x), FLOOR_M, 0.6),
        y: Axis::over("", Unit::Plain, values(|mark| mark.y), FLOOR_M, 0.4),
        series,
        has_front: false,
        guide: None,
        level: None,
        size: [400.0, 330.0],
    }
}

/// Potentials in sections through three bars of the first grid, and their scale.
fn bars(report: &Report) -> String {
    let drawn: String = DRAWN.into_iter().filter_map(|index| report.bars.get(index)).map(section::section).collect();
    format!("<div class=\"maps\">{drawn}</div>")
}

fn chart(report: &Report, title: &str, unit: Unit, value: fn(&Row) -> Option<f64>) -> Chart {
    let lines = [
        (GRIDS[0], Glue::Conducting, "paper"),
        (GRIDS[1], Glue::Conducting, "contacts"),
        (GRIDS[0], Glue::AcrossOnly, "bound"),
        (GRIDS[1], Glue::AcrossOnly, "linear"),
    ];
    let lines = lines.into_iter().map(|(dots, glue, class)| {
        let mark = |row: &Row| {
            let (x, y) = (row.diameter_m?, value(row)?);
            Some(Mark { x, y, tooltip: format!("{}, {}: {}", row.name(), Unit::Metres.text(x), unit.text(y)) })
        };
        let marks: Vec<_> = series(&report.rows, dots, glue).filter_map(mark).collect();
        let name = format!("{dots} x {dots}{}", if glue == Glue::AcrossOnly { ", only across" } else { "" });
        let main = if glue == Glue::AcrossOnly { marks.len() / 3 } else { 2 * marks.len() / 3 };
        Series { name, class, main, marks, is_joined: true }
    });
    let lines: Vec<Series> = lines.collect();
    let values = |of: fn(&Mark) -> f64| lines.iter().flat_map(|line| &line.marks).map(of).collect::<Vec<_>>();
    let touching = report.rows.iter().find(|row| row.glue.is_none()).and_then(value);
    Chart {
        title: title.to_owned(),
        subtitle: touching
            .map_or_else(String::new, |touching| format!("where the layers touch all over: {}", unit.text(touching))),
        x: Axis::over("diameter of a dot", Unit::Metres, values(|mark| mark.x), FLOOR_M, 0.6),
        y: Axis::over("", unit, values(|mark| mark.y).into_iter().chain(touching), FLOOR_M, 0.4),
        series: lines,
        has_front: false,
        guide: None,
        level: None,
        size: [400.0, 330.0],
    }
}

/// Dots coloured by their current density.
fn drawing(row: &Row) -> String {
    let largest = row.largest_density_a_per_m2().unwrap_or(1.0);
    let px = |m: f64| m / SIDE_M * SIDE;
    let at = |[x_m, y_m]: [f64; 2]| (SIDE / 2.0 + px(x_m), SIDE / 2.0 - px(y_m));
    let radius = px(row.diameter_m.unwrap_or(0.0) / 2.0);
    let mut svg = format!("<rect class=\"guide\" width=\"{SIDE}\" height=\"{SIDE}\"/>");
    for current in &row.currents {
        let (x, y) = at(current.centre_m);
        _ = write!(
            svg,
            "<circle style=\"fill:{};stroke:none\" cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"{radius:.1}\"><title>{} A/m2, {} uA</title></circle>",
            colour::of_share(current.density_a_per_m2 / largest),
            number(Some(current.density_a_per_m2), 1.0),
            number(Some(current.current_a), 1e6)
        );
    }
    let (x, y) = at([0.0; 2]);
    _ = write!(svg, "<circle class=\"ring\" cx=\"{x}\" cy=\"{y}\" r=\"{:.1}\"/>", px(0.002));
    // The electrode that is grounded: in the second column and row of four.
    let (x, y) = at([-SIDE_M / 8.0; 2]);
    _ = write!(svg, "<path class=\"cross\" d=\"M{:.1} {y:.1}h8M{x:.1} {:.1}v8\"/>", x - 4.0, y - 4.0);
    let title = format!("{0} x {0}, {1}", row.dots, Unit::Metres.text(row.diameter_m.unwrap_or(0.0)));
    format!(
        "<section><h4>{}</h4><svg class=\"chart contacts\" viewBox=\"0 0 {SIDE} {SIDE}\" role=\"img\" aria-label=\"{}\">{svg}</svg></section>",
        escaped(&title),
        escaped(&title)
    )
}

fn all(report: &Report) -> String {
    let heads = [
        "bond",
        "diameter, mm",
        "error of the paper's solver, mm",
        "SR",
        "place, mm",
        "two points, mm",
        "S/N, dB",
        "largest density, A/m2",
    ];
    let row = |row: &Row| {
        let [diameter, error, resolution, place, two_points, signal, density] = figures(row);
        let mm = |value: Option<f64>| number(value, 1e3);
        let plain = |value: Option<f64>| number(value, 1.0);
        vec![
            row.name(),
            mm(diameter),
            mm(error),
            plain(resolution),
            mm(place),
            mm(two_points),
            plain(signal),
            plain(density),
        ]
    };
    let rows: Vec<_> = report.rows.iter().map(row).collect();
    tactomo_study::page::folded("All figures", &table(&heads, &rows))
}
