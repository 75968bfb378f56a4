//! The study as parts of a page.

use tactomo_study::page::{Axis, Chart, Mark, Series, Unit, table};

use super::super::text::number;
use super::{Group, Report, Row};

/// Errors below this show there (m).
const FLOOR_M: f64 = 1e-6;

/// A line of the charts: name, class, and the figure (m).
type Line = (&'static str, &'static str, fn(&Row) -> Option<f64>);

/// What is varied in a chart: the group, the title of its axis, the value and its unit.
type Varied = (Group, &'static str, fn(&Row) -> f64, Unit);

const LINES: [Line; 5] = [
    ("median", "linear", |row| row.everywhere.map(|spread| spread.median_m)),
    ("nine tenths", "learned", |row| row.everywhere.map(|spread| spread.p90_m)),
    ("rms", "bound", |row| row.everywhere.map(|spread| spread.rms_m)),
    ("auto", "auto", |row| row.reached.place_m),
    ("two points", "image", |row| row.limit.two_points_m),
];

pub(super) fn parts(report: &Report) -> Vec<String> {
    let charts: [Varied; 3] = [
        (Group::Number, "electrodes", |row| row.layout.count() as f64, Unit::Plain),
        (Group::Diameter, "diameter", |row| row.diameter_m, Unit::Metres),
        (Group::Pitch, "pitch", pitch_m, Unit::Metres),
    ];
    let charts: String =
        charts.into_iter().map(|(group, title, x, unit)| chart(report, group, title, x, unit).svg() + "\n").collect();
    let tables: String = Group::ALL.into_iter().map(|group| rows(report, group)).collect();
    vec![
        "<p class=\"quiet\">Standard error of a place with one frame, over the whole surface: half of the places are told better than the median, nine tenths better than the next line, \
         and the root mean square is ruled by the few worst places, which are corners; what `auto` reaches with one frame at the nine places; and the least distance of two points \
         told apart.</p>"
            .to_owned(),
        format!("<div class=\"charts small\">{charts}</div>"),
        tables,
    ]
}

fn pitch_m(row: &Row) -> f64 {
    let [a, b] = [0, 1].map(|index| row.layout.electrodes([0.06, 0.06], row.diameter_m / 2.0)[index]);
    (a.x_m - b.x_m).hypot(a.y_m - b.y_m)
}

fn chart(report: &Report, group: Group, title: &str, x: fn(&Row) -> f64, unit: Unit) -> Chart {
    let own = || report.rows.iter().filter(move |row| row.group == group);
    let series = LINES.map(|(name, class, figure)| {
        let mark = |row: &Row| {
            let y = figure(row)?;
            Some(Mark { x: x(row), y, tooltip: format!("{}, {name}: {}", row.name, Unit::Metres.text(y)) })
        };
        let marks: Vec<_> = own().filter_map(mark).collect();
        Series { name: name.to_owned(), class, main: marks.len() / 2, marks, is_joined: true }
    });
    let errors: Vec<f64> = report.rows.iter().flat_map(|row| LINES.map(|(.., figure)| figure(row))).flatten().collect();
    Chart {
        title: group.title().to_owned(),
        subtitle: "places, two points".to_owned(),
        x: Axis::over(title, unit, own().map(x), FLOOR_M, 0.6),
        y: Axis::over("", Unit::Metres, errors, FLOOR_M, 1.0),
        series: series.into(),
        has_front: false,
        guide: None,
        level: None,
        size: [380.0, 340.0],
    }
}

fn rows(report: &Report, group: Group) -> String {
    let row = |row: &Row| {
        let mm = |value: Option<f64>| number(value, 1e3);
        vec![
            row.name.clone(),
            row.conversions.to_string(),
            mm(row.limit.place_m),
            mm(row.everywhere.map(|spread| spread.median_m)),
            mm(row.everywhere.map(|spread| spread.p90_m)),
            mm(row.everywhere.map(|spread| spread.rms_m)),
            mm(row.median_in_same_time_m),
            mm(row.reached.place_m),
            mm(row.limit.two_points_m),
            format!("{:.0}", row.limit.signal_to_noise_db),
        ]
    };
    let rows: Vec<_> = report.rows.iter().filter(|row| row.group == group).map(row).collect();
    let heads = [
        group.title(),
        "conversions",
        "nine places, mm",
        "everywhere: median, mm",
        "nine tenths, mm",
        "rms, mm",
        "median in same time, mm",
        "auto, mm",
        "two points, mm",
        "S/N, dB",
    ];
    table(&heads, &rows)
}
