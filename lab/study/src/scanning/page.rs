//! The report as a page.

use super::table::title;
use super::{Choice, Point, Report, SPEEDS_M_PER_S};
use crate::page::{Axis, Chart, Mark, Series, Unit, folded, html, machine, table};

/// Errors below this show there (m).
const FLOOR_M: f64 = 1e-6;
/// Width and height of a chart (px).
const SIZE: [f64; 2] = [430.0, 300.0];
/// Rows of the frames whose marks are large: those of live's adaptive plans.
const MAIN_ROWS: usize = 2;
const CHOICES: [Choice; 4] = [Choice::Whole, Choice::Adaptive, Choice::InTurn, Choice::Corners];

/// What errors are counted from.
#[derive(Clone, Copy, PartialEq)]
enum Against {
    Arrived,
    Middle,
}

/// A self-contained HTML page.
pub fn page(report: &Report) -> String {
    let parts = [
        "<h1>Which rows to scan</h1>".to_owned(),
        "<p class=\"lead-in\">A serial line carries so many rows a second, whatever they are: as few whole frames, or as many frames of some \
         rows. Further <b>right are more answers a second</b>, further <b>down is more accurate</b>.</p>"
            .to_owned(),
        legend(),
        rows_of_charts(report, Against::Arrived),
        "<h2>But for the way meanwhile</h2>\n<p class=\"quiet\">The same answers, against where the contacts were in the middle of the \
         time in which the frame's rows were read.</p>"
            .to_owned(),
        rows_of_charts(report, Against::Middle),
        folded("All figures", &figures(report)),
        footer(report),
    ];
    html("Tactomo: which rows to scan", &parts)
}

/// The charts alone, for a document.
pub fn picture(report: &Report) -> String {
    html("Tactomo: which rows to scan", &[legend(), rows_of_charts(report, Against::Arrived)])
}

fn class(choice: Choice) -> &'static str {
    match choice {
        Choice::Whole => "linear",
        Choice::Adaptive => "contacts",
        Choice::InTurn => "image",
        Choice::Corners => "learned",
    }
}

fn legend() -> String {
    let item = |choice: Choice| {
        let what = match choice {
            Choice::Whole => "whole frames",
            Choice::Adaptive => {
                "8, 4, 3, 2 (large) or 1 row a frame, of the adaptive grounds: all in turn for what stands, for what moves those that tell most"
            }
            Choice::InTurn => "the same of all grounds in turn",
            Choice::Corners => "of the four corners",
        };
        format!("<li class=\"{}\">{what}</li>", class(choice))
    };
    let bound = "<li class=\"bound\">Cramér-Rao bound of the rows that tell most: no unbiased method is better</li>";
    format!("<ul class=\"legend\">{}{bound}</ul>", CHOICES.map(item).concat())
}

/// A row of charts for each speed, a chart for each number of contacts. Charts of a row have the same axes.
fn rows_of_charts(report: &Report, against: Against) -> String {
    let of = |speed_m_per_s: f64| {
        let charts = report.contacts.iter().map(|contacts| series(report, *contacts, speed_m_per_s, against));
        let charts: Vec<Vec<Series>> = charts.collect();
        let marks = || charts.iter().flatten().flat_map(|series| &series.marks);
        let x =
            Axis::over("frames a second", Unit::Plain, report.points.iter().map(|point| point.frames_per_s), 1.0, 1.0);
        let y = Axis::over("", Unit::Metres, marks().map(|mark| mark.y), FLOOR_M, 1.0);
        let chart = |(contacts, series): (usize, &Vec<Series>)| Chart {
            title: title(contacts, speed_m_per_s),
            subtitle: subtitle(speed_m_per_s, against).to_owned(),
            x: x.clone(),
            y: y.clone(),
            series: series.clone(),
            has_front: false,
            guide: None,
            level: None,
            size: SIZE,
        };
        let charts: String = report.contacts.iter().copied().zip(&charts).map(|of| chart(of).svg() + "\n").collect();
        format!("<div class=\"charts\">{charts}</div>")
    };
    let speeds = SPEEDS_M_PER_S.into_iter().filter(|speed| against == Against::Arrived || *speed > 0.0);
    speeds.map(of).collect()
}

fn subtitle(speed_m_per_s: f64, against: Against) -> &'static str {
    match against {
        _ if speed_m_per_s == 0.0 => "error · bound of all rows until then",
        Against::Arrived => "error when the frame has arrived · bound of its rows alone",
        Against::Middle => "error in the middle of the rows · bound of these alone",
    }
}

fn series(report: &Report, contacts: usize, speed_m_per_s: f64, against: Against) -> Vec<Series> {
    let points = |choice: Choice| report.of(contacts, speed_m_per_s).filter(move |point| point.choice == choice);
    let mark = |point: &Point, y: f64| Mark { x: point.frames_per_s, y, tooltip: tooltip(point) };
    let error_m = |point: &Point| if against == Against::Arrived { point.arrived_m } else { point.middle_m };
    let of = |choice: Choice| Series {
        // The legend names the others: labels would be in each other's way.
        name: if choice == Choice::Whole { choice.name().to_owned() } else { String::new() },
        class: class(choice),
        marks: points(choice).map(|point| mark(point, error_m(point))).collect(),
        main: points(choice).position(|point| point.rows == MAIN_ROWS).unwrap_or(0),
        is_joined: true,
    };
    let bounded = points(Choice::Adaptive).chain(points(Choice::Whole));
    let bound = Series {
        name: String::new(),
        class: "bound",
        marks: bounded.map(|point| mark(point, point.bound_all_m.unwrap_or(point.bound_rows_m))).collect(),
        main: usize::MAX,
        is_joined: true,
    };
    CHOICES.map(of).into_iter().chain([bound]).collect()
}

fn tooltip(point: &Point) -> String {
    let text = |metres: f64| Unit::Metres.text(metres);
    let all = point.bound_all_m.map_or_else(String::new, |all_m| format!(", of all rows {}", text(all_m)));
    format!(
        "{}, {} rows a frame, {:.0} frames/s, {} old: error {}, {} in the middle of the rows; count right in {:.0} %; bound of the rows {}{all}",
        point.choice.name(),
        point.rows,
        point.frames_per_s,
        Unit::Seconds.text(point.age_s),
        text(point.arrived_m),
        text(point.middle_m),
        100.0 * point.count_right,
        text(point.bound_rows_m),
    )
}

fn figures(report: &Report) -> String {
    let heads = [
        "",
        "grounds",
        "rows",
        "frames/s",
        "age, ms",
        "arrived, mm",
        "middle, mm",
        "count right",
        "arrived of these, mm",
        "bound of rows, mm",
        "of all rows, mm",
    ];
    let mm = |metres: f64| format!("{:.3}", 1e3 * metres);
    let row = |point: &Point| {
        vec![
            title(point.contacts, point.speed_m_per_s),
            point.choice.name().to_owned(),
            point.rows.to_string(),
            format!("{:.0}", point.frames_per_s),
            format!("{:.2}", 1e3 * point.age_s),
            mm(point.arrived_m),
            mm(point.middle_m),
            format!("{:.0} %", 100.0 * point.count_right),
            point.right_m.map_or_else(|| "-".to_owned(), mm),
            mm(point.bound_rows_m),
            point.bound_all_m.map_or_else(|| "-".to_owned(), mm),
        ]
    };
    table(&heads, &report.points.iter().map(row).collect::<Vec<_>>())
}

fn footer(report: &Report) -> String {
    let text = format!(
        "{} scenes of each number of contacts, on {}, which the solver of contacts knows exactly ({} model); seed {}. All contacts touch at once, and stand or go \
         round together. Readings come from a finer model than the one that is inverted, asked every half millimetre of the way and interpolated by cubics, at the time of each row, with the \
         converter's noise and steps, less a baseline. A row takes 148 µs, the wire carries 92160 bytes a second, a whole frame has 380 of them; a frame is read while the one before is sent, and the solver's own time does not count, but a search is made at most every 4 ms. \
         Adaptive grounds are chosen as in live, at most every 40 ms, for which the board stops for 1.5 ms: all in turn for what stands or has just come, and for what moves those that tell most of it, with every fourth row one of all in turn. Contacts that stand: the last answer within 50 ms of the touch; that move: all answers \
         from 50 to 120 ms. Error: mean distance of contacts found from those that are there, where one missed or invented counts {:.0} mm (OSPA of order 1). The bound is a root mean square of errors; their mean may be a tenth to a fifth below it.",
        report.scenes,
        report.detector,
        report.model,
        report.seed,
        report.reach_m * 1e3
    );
    format!("<h2>How it was measured</h2>\n<p class=\"note\">{text}</p>\n{}", machine(&report.machine, &report.command))
}
