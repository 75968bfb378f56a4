//! What the report shows.

use super::{Choice, Point, Report, SPEEDS_M_PER_S};
use crate::view::{Axis, Chart, Figures, Format, MM, Mark, PERCENT, PLAIN, Series, TEXT, Table, Unit, View, same_axis};

/// Rows of the frames whose marks are large: those of live's adaptive plans.
const MAIN_ROWS: usize = 2;
/// How grounds are chosen: its colour, and what it is.
const CHOICES: [(Choice, &str, &str); 4] = [
    (Choice::Whole, "linear", "whole frames"),
    (
        Choice::Adaptive,
        "contacts",
        "8, 4, 3, 2 (large) or 1 row a frame, of the adaptive grounds: all in turn for what stands, for what moves those that tell most",
    ),
    (Choice::InTurn, "image", "the same of all grounds in turn"),
    (Choice::Corners, "learned", "of the four corners"),
];
const BOUND: &str = "Cramér-Rao bound of the rows that tell most: no unbiased method is better";
const MILLISECONDS: Format = Format { factor: 1e3, ..Format::new("ms", "s").digits(2) };

/// Charts of frames a second against error, and all figures.
pub fn view(report: &Report) -> View {
    let lead = "A serial line carries so many rows a second, whatever they are: as few whole frames, or as many frames of some rows. \
                Further **right are more answers a second**, further **down is more accurate**.";
    let meanwhile = "But for the way meanwhile: the same answers, against where the contacts were in the middle of the time in which the frame's rows \
                     were read.";
    let legend = CHOICES.map(|(_, class, what)| (class, what.to_owned())).into_iter();
    let arrived =
        charts(report, |_| "error when the frame has arrived · bound of its rows alone", |point| point.arrived_m);
    let middle = charts(report, |_| "error in the middle of the rows · bound of these alone", |point| point.middle_m);
    let view = View::new("Which rows to scan", lead)
        .with(Figures {
            legend: legend.chain([("bound", BOUND.to_owned())]).collect(),
            ..Figures::of("", arrived.concat())
        })
        .figures(meanwhile, middle[1..].concat())
        .with(figures(report));
    View { method: method(report), ..view }
}

/// What touches, for people.
fn title(contacts: usize, speed_m_per_s: f64) -> String {
    let contacts = if contacts == 1 { "1 contact".to_owned() } else { format!("{contacts} contacts") };
    match speed_m_per_s {
        0.0 => format!("{contacts}, 50 ms after the touch"),
        speed => format!("{contacts} at {speed} m/s"),
    }
}

impl Report {
    /// Points of so many contacts at a speed.
    pub(super) fn of(&self, contacts: usize, speed_m_per_s: f64) -> impl Iterator<Item = &Point> {
        let wanted = move |point: &&Point| point.contacts == contacts && point.speed_m_per_s == speed_m_per_s;
        self.points.iter().filter(wanted)
    }
}

/// Charts for each speed, one for each number of contacts. Those of a speed have the same axes.
fn charts(report: &Report, subtitle: fn(f64) -> &'static str, error_m: fn(&Point) -> f64) -> Vec<Vec<Chart>> {
    let of = |speed_m_per_s: f64| {
        let subtitle = match speed_m_per_s {
            0.0 => "error · bound of all rows until then",
            speed => subtitle(speed),
        };
        let chart = |contacts: &usize| {
            let rates = report.points.iter().map(|point| point.frames_per_s);
            let axes =
                [Axis::log("frames a second", Unit::Plain).floor(1.0).reaching(rates), Axis::log("", Unit::Metres)];
            let series = series(report, *contacts, speed_m_per_s, error_m);
            Chart::new(title(*contacts, speed_m_per_s), subtitle, axes, series).sized([430.0, 300.0])
        };
        let mut charts: Vec<Chart> = report.contacts.iter().map(chart).collect();
        same_axis(&mut charts, 1);
        charts
    };
    SPEEDS_M_PER_S.map(of).into()
}

fn series(report: &Report, contacts: usize, speed_m_per_s: f64, error_m: fn(&Point) -> f64) -> Vec<Series> {
    let points = |choice: Choice| report.of(contacts, speed_m_per_s).filter(move |point| point.choice == choice);
    let mark = |point: &Point, y: f64| Mark { note: note(point), ..Mark::from([point.frames_per_s, y]) };
    let of = |(choice, class, _): (Choice, &'static str, &str)| {
        // The legend names the others: labels would be in each other's way.
        let name = if choice == Choice::Whole { choice.name() } else { "" };
        let line = Series::line(name, class, points(choice).map(|point| mark(point, error_m(point))));
        Series { main: points(choice).position(|point| point.rows == MAIN_ROWS).or(Some(0)), ..line }
    };
    let bounded = points(Choice::Adaptive).chain(points(Choice::Whole));
    let bounds = bounded.map(|point| mark(point, point.bound_all_m.unwrap_or(point.bound_rows_m)));
    CHOICES.map(of).into_iter().chain([Series::line("", "bound", bounds).unlabelled()]).collect()
}

fn note(point: &Point) -> String {
    let text = |metres: f64| Unit::Metres.text(metres);
    let all = point.bound_all_m.map_or_else(String::new, |all_m| format!(", of all rows {}", text(all_m)));
    format!(
        "{}, {} rows a frame, {} old: error {}, {} in the middle of the rows; count right in {:.0} %; bound of the rows {}{all}",
        point.choice.name(),
        point.rows,
        Unit::Seconds.text(point.age_s),
        text(point.arrived_m),
        text(point.middle_m),
        100.0 * point.count_right,
        text(point.bound_rows_m),
    )
}

fn figures(report: &Report) -> Table {
    let mm = MM.digits(3);
    let title = format!(
        "{}: {} model, {} scenes of each number of contacts; one missed or invented counts {:.0} mm",
        report.detector,
        report.model,
        report.scenes,
        report.reach_m * 1e3
    );
    Table::of(title, &report.points)
        .group("contacts", |point| self::title(point.contacts, point.speed_m_per_s))
        .column("grounds", TEXT, |point| point.choice.name())
        .column("rows", PLAIN.digits(0), |point| point.rows)
        .column("frames/s", PLAIN.digits(0), |point| point.frames_per_s)
        .column("age", MILLISECONDS, |point| point.age_s)
        .column("arrived", mm, |point| point.arrived_m)
        .column("middle", mm, |point| point.middle_m)
        .column("count right", PERCENT, |point| point.count_right)
        .column("arrived of these", mm, |point| point.right_m)
        .column("bound of rows", mm, |point| point.bound_rows_m)
        .column("of all rows", mm, |point| point.bound_all_m)
        .note(
            "age: from the middle of a frame's rows to its arrival; arrived, middle: mean error against where contacts are at either; count right: answers \
             with none missed, invented or too far off; bounds: Cramer-Rao, mean distance, of a frame's rows, and of all rows since the touch, radii known to a factor of two",
        )
        .data()
        .into()
}

fn method(report: &Report) -> String {
    format!(
        "{} scenes of each number of contacts, on {}, which the solver of contacts knows exactly ({} model); seed {}. All contacts touch at once, and \
         stand or go round together. Readings come from a finer model than the one that is inverted, asked every half millimetre of the way and \
         interpolated by cubics, at the time of each row, with the converter's noise and steps, less a baseline. A row takes 146 µs, the wire carries \
         92160 bytes a second, a whole frame has 210 of them; a frame is read while the one before is sent, readings of rows that are read again until then \
         count once, and the solver's own time does not count, \
         but a search is made at most every 4 ms. Adaptive grounds are chosen as in live, at most every 40 ms, for which the board stops for 1.5 ms: all \
         in turn for what stands or has just come, and for what moves those that tell most of it, with every fourth row one of all in turn. Contacts \
         that stand: the last answer within 50 ms of the touch; that move: all answers from 50 to 120 ms. Error: mean distance of contacts found from \
         those that are there, where one missed or invented counts {:.0} mm (OSPA of order 1). The bound is the mean distance of \
         normal errors with the covariance of the Cramer-Rao bound, radii known to a factor of two.",
        report.scenes,
        report.detector,
        report.model,
        report.seed,
        report.reach_m * 1e3
    )
}
