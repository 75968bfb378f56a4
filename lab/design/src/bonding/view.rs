//! What the study shows.

use tactomo_study::view::{Axis, Chart, Format, MM, Map, PLAIN, Series, TEXT, Table, Unit, View};

use super::claims::series;
use super::{Bar, GRIDS, Glue, Report, Row};

/// Diameters whose currents are drawn, by their place.
const DRAWN: [usize; 3] = [1, 4, 9];
/// Side of a detector (m).
const SIDE_M: f64 = 0.060;
/// Places that a section through a bar is drawn at, across and up: odd, so that the bond is a row of its own.
const PLACES: [usize; 2] = [81, 61];
/// Lines of equal potential, 0.05 V apart.
const LINES: usize = 19;
const DENSITY: Format = Format::new("A/m2", "a_per_m2");
/// Grids and glues: their colour.
const BONDS: [(usize, Glue, &str); 4] = [
    (GRIDS[0], Glue::Conducting, "paper"),
    (GRIDS[1], Glue::Conducting, "contacts"),
    (GRIDS[0], Glue::AcrossOnly, "bound"),
    (GRIDS[1], Glue::AcrossOnly, "linear"),
];

/// Errors over the dots' diameter, the currents through the dots, and a bar that one dot joins.
pub fn view(report: &Report) -> View {
    let lead = "Two layers of sample B joined by 5 x 5 or 7 x 7 dots of conductive glue: errors of places over the dots' diameter, up to dots that touch, \
                and the current through the dots.";
    let currents = "Current density of each dot, of a contact in the middle, with the electrode beside it grounded; light is more. Hover for the values.";
    let bars = "A bar with 1 V from top to bottom: two halves of a conductor of 1 S/m that one dot of glue joins, a dot's share of the bond, as a cylinder. \
                Wider dots let more current through the bond, and less through each square metre of dot. Lines are 0.05 V apart.";
    let charts = [
        chart(report, "Error of the paper's solver", Unit::Metres, |row| row.position_error_m),
        chart(report, "Standard error of a place", Unit::Metres, |row| row.limit.place_m),
        chart(report, "Largest current density of a dot, A/m2", Unit::Plain, Row::largest_density_a_per_m2),
    ];
    let drawn = GRIDS.iter().flat_map(|dots| {
        let all: Vec<&Row> = series(&report.rows, *dots, Glue::Conducting).collect();
        DRAWN.into_iter().filter_map(move |index| all.get(index).map(|row| of_dots(row))).collect::<Vec<_>>()
    });
    let sections = DRAWN.into_iter().filter_map(|index| report.bars.get(index)).map(section);
    report
        .course
        .view("How layers are joined", lead)
        .figures("", charts)
        .figures(currents, drawn)
        .figures(bars, sections)
        .figures("", [density(report)])
        .with(figures(report))
}

/// A figure over the dots' diameter.
fn chart(report: &Report, title: &str, unit: Unit, value: fn(&Row) -> Option<f64>) -> Chart {
    let line = |(dots, glue, class): (usize, Glue, &'static str)| {
        let points = series(&report.rows, dots, glue).filter_map(|row| Some((row.diameter_m?, value(row))));
        let name = format!("{dots} x {dots}{}", if glue == Glue::AcrossOnly { ", only across" } else { "" });
        let line = Series::line(name, class, points);
        let thirds = if glue == Glue::AcrossOnly { 1 } else { 2 };
        Series { main: Some(thirds * line.marks.len() / 3), ..line }
    };
    let touching = report.rows.iter().find(|row| row.glue.is_none()).and_then(value);
    let subtitle =
        touching.map_or_else(String::new, |value| format!("where the layers touch all over: {}", unit.text(value)));
    let axes = [
        Axis::log("diameter of a dot", Unit::Metres).decades(0.6),
        Axis::log("", unit).decades(0.4).reaching(touching),
    ];
    Chart::new(title, subtitle, axes, BONDS.map(line)).sized([400.0, 330.0])
}

/// Current density over the dots' diameter: over the bond, and over the dot.
fn density(report: &Report) -> Chart {
    let per_grid = report.bars.len() / GRIDS.len();
    let of = |grid: usize, what: &str, class: &'static str, value: fn(&Bar) -> f64| {
        let bars = report.bars.iter().skip(grid * per_grid).take(per_grid);
        Series::line(format!("{0} x {0}, {what}", GRIDS[grid]), class, bars.map(|bar| (bar.dot_diameter_m, value(bar))))
    };
    let series = [
        of(0, "bond", "paper", |bar| bar.over_bond_a_per_m2),
        of(1, "bond", "contacts", |bar| bar.over_bond_a_per_m2),
        of(0, "dot", "bound", |bar| bar.over_dot_a_per_m2),
        of(1, "dot", "linear", |bar| bar.over_dot_a_per_m2),
    ];
    let axes = [Axis::log("diameter of a dot", Unit::Metres).decades(0.6), Axis::log("", Unit::Plain).decades(0.4)];
    Chart::new("Mean current density in a bar, A/m2", "over the bond, and over the dot", axes, series)
        .sized([400.0, 330.0])
}

/// Values at so many places across and up, between two ends of each axis (m).
fn map(title: String, subtitle: &str, [x_m, y_m]: [Vec<f64>; 2], value: impl Fn([f64; 2]) -> Option<f64>) -> Map {
    Map {
        title,
        subtitle: subtitle.to_owned(),
        axes: ["x", "y"].map(|title| Axis::linear(title, Unit::Metres)),
        rows: y_m.iter().map(|y_m| x_m.iter().map(|x_m| value([*x_m, *y_m])).collect()).collect(),
        ticks: [x_m, y_m],
        empty: "",
        is_log: false,
        range: None,
        format: DENSITY,
        contours: 0,
        disc: None,
        aspect: 1.0,
        marks: Vec::new(),
    }
}

/// Dots coloured by their current density.
fn of_dots(row: &Row) -> Map {
    let diameter_m = row.diameter_m.unwrap_or(0.0);
    let pitch_m = SIDE_M / row.dots as f64;
    let middles_m: Vec<f64> = (0..row.dots).map(|index| (index as f64 + 0.5) * pitch_m - SIDE_M / 2.0).collect();
    let at = |[x_m, y_m]: [f64; 2]| {
        let is_here = |[at_x_m, at_y_m]: [f64; 2]| (at_x_m - x_m).hypot(at_y_m - y_m) < pitch_m / 2.0;
        row.currents.iter().find(|current| is_here(current.centre_m)).map(|current| current.density_a_per_m2)
    };
    let title = format!("{0} x {0}, {1}", row.dots, Unit::Metres.text(diameter_m));
    // The electrode that is grounded: in the second column and row of four.
    let marks = vec![([0.0; 2], "contact".to_owned()), ([-SIDE_M / 8.0; 2], "grounded".to_owned())];
    Map {
        disc: Some(diameter_m / pitch_m),
        marks,
        ..map(title, "A/m2 in each dot", [middles_m.clone(), middles_m], at)
    }
}

/// Potentials in a section through a bar. What does not conduct is on either side of the dot: there the potential jumps, and is left open.
fn section(bar: &Bar) -> Map {
    let even = |count: usize, half_m: f64| {
        (0..count).map(move |at| half_m * (2.0 * at as f64 / (count - 1) as f64 - 1.0)).collect::<Vec<_>>()
    };
    let at = |[x_m, y_m]: [f64; 2]| {
        let is_open = y_m == 0.0 && x_m.abs() > bar.dot_diameter_m / 2.0;
        (!is_open).then(|| if y_m == 0.0 { 0.5 } else { bar.at_v(x_m, y_m) })
    };
    let title = format!("dot of {}", Unit::Metres.text(bar.dot_diameter_m));
    let places_m = [even(PLACES[0], bar.radius_m), even(PLACES[1], bar.height_m / 2.0)];
    let format = Format::new("V", "v").digits(2);
    let aspect = bar.height_m / (2.0 * bar.radius_m);
    Map { contours: LINES, format, aspect, ..map(title, "potential, V", places_m, at) }
}

/// A row for each bond.
fn figures(report: &Report) -> Table {
    Table::of("", &report.rows)
        .group("bond", |row| row.name())
        .column("diameter", MM, |row| row.diameter_m)
        .detail("dots", PLAIN.digits(0), |row| row.dots)
        .detail("glue", TEXT, |row| row.glue.map_or("none", Glue::title))
        .column("position error", MM, |row| row.position_error_m)
        .column("SR", PLAIN, |row| row.imaging.spatial_resolution)
        .column("place", MM, |row| row.limit.place_m)
        .column("two points", MM, |row| row.limit.two_points_m)
        .column("signal to noise", Format::new("dB", "db").digits(0), |row| row.limit.signal_to_noise_db)
        .column("largest density", DENSITY, |row| row.largest_density_a_per_m2())
        .note(
            "position error: of the paper's solver; largest density: mean over a dot, of a contact in the middle with an electrode beside it grounded",
        )
        .data()
        .into()
}
