//! The report as a page.

use super::bounds::{BoundChart, BoundCurve};
use super::table::millimetres;
use super::{Breakdown, CellReport, ErrorCurve, Report, SolverRow, SweepReport};
use crate::page::{Axis, Cell, Chart, Heat, Mark, Row, Series, Unit, html, machine};
use tactomo_touch::solve::Method;

/// Errors below this show there (m).
const FLOOR_M: f64 = 1e-6;
/// Shares of points below this show there.
const FLOOR_SHARE: f64 = 0.01;

const READ: &str = "<p class=\"lead-in\">Green holds, red is useless. <b class=\"flag\">⚑</b> marks where the solver itself reports that something is wrong: \
    <b>red without a flag is the danger</b>.</p>\n\
    <p><span class=\"key h0\">below 3 %</span><span class=\"key h1\">10 %</span><span class=\"key h2\">30 %</span>\
    <span class=\"key h3\">60 %</span><span class=\"key h4\">above</span> error, as a share of the mean distance of electrodes.</p>";

/// A self-contained HTML page.
pub fn page(report: &Report) -> String {
    let mut parts = vec![
        "<h1>Where solvers break</h1>".to_owned(),
        READ.to_owned(),
        overview(report),
        "<h2>How far off</h2>".to_owned(),
        errors(report),
        "<h2>Against what noise allows</h2>".to_owned(),
        bounds(report),
        "<h2>Every point</h2>".to_owned(),
        "<p>Mean error in mm, where a contact missed or invented counts the mean distance of electrodes. − contacts are missed, + contacts are \
         invented, slow: a frame takes far longer, ∅ refused, NaN not finite.</p>"
            .to_owned(),
    ];
    let heats: String = report.sweeps.iter().map(|sweep| heat(sweep).html() + "\n").collect();
    parts.push(format!("<div class=\"heats\">{heats}</div>"));
    parts.push(footer(report));
    html("Tactomo: where solvers break", &parts)
}

/// A row for each solver, a column for each sweep.
fn overview(report: &Report) -> String {
    let title = format!("{}{}: first break of each solver", report.detector, report.whose());
    let note = "The mildest point of each sweep that breaks a solver: its error is above 15 % of the mean distance of electrodes and twice its own at \
                the harmless point, or it miscounts, slows down or answers with no finite number. Where it holds: its error in mm at the harmless \
                point and its largest, for what is off by 5 mm from the start holds up to 10.";
    sweeps_by_solvers(report, title, note, overview_cell)
}

/// A map of the width of the page: a row for each sweep, a column for each solver.
fn sweeps_by_solvers(report: &Report, title: String, note: &str, cell: fn(&SolverRow) -> Cell) -> String {
    let Some(all) = report.sweeps.iter().max_by_key(|sweep| sweep.solvers.len()) else { return String::new() };
    let cell_of = |rows: &[SolverRow], solver: &str| {
        rows.iter().find(|row| row.solver == solver).map_or_else(Cell::default, |row| {
            if row.cells.iter().any(Option::is_some) { cell(row) } else { self::cell(&None) }
        })
    };
    let row = |name: String, solvers: &[SolverRow]| Row {
        name,
        cells: all.solvers.iter().map(|solver| cell_of(solvers, &solver.solver)).collect(),
    };
    let rows = report.sweeps.iter().flat_map(|sweep| {
        let after =
            (!sweep.calibrated.is_empty()).then(|| row(format!("{}, calibrated", sweep.title), &sweep.calibrated));
        std::iter::once(row(sweep.title.clone(), &sweep.solvers)).chain(after)
    });
    Heat {
        title,
        note: note.to_owned(),
        columns: all.solvers.iter().map(|row| row.solver.clone()).collect(),
        rows: rows.collect(),
        is_whole: true,
    }
    .html()
}

/// Colour of a row's worst cell.
fn worst_level(row: &SolverRow) -> Option<u8> {
    row.cells.iter().flatten().map(|cell| cell.level).max()
}

fn overview_cell(row: &SolverRow) -> Cell {
    let errors = [row.errors.harmless_m, row.errors.largest_m].map(|error_m| error_m.map_or_else(dash, millimetres));
    let [harmless, largest] = errors;
    let Some(found) = &row.breaks else {
        return Cell {
            level: worst_level(row),
            text: "holds".to_owned(),
            detail: format!("{harmless} – {largest}"),
            ..Cell::default()
        };
    };
    let level = match found.survives {
        0.6.. => 2,
        0.35.. => 3,
        _ => 4,
    };
    Cell {
        level: Some(level),
        text: found.at.clone(),
        detail: found.how.name().to_owned(),
        is_flagged: found.is_reported,
        tooltip: format!(
            "holds at {:.0} % of the points; {harmless} mm at the harmless point, {largest} mm at most",
            100.0 * found.survives
        ),
    }
}

fn dash() -> String {
    "–".to_owned()
}

/// Errors in millimetres, whatever they are at the harmless point.
fn errors(report: &Report) -> String {
    let title = format!("{}: errors of each solver, mm", report.detector);
    let note = "The median over the points of each sweep; below it, that at the harmless point and the largest. Colours are of the largest.";
    let map = sweeps_by_solvers(report, title, note, |row| {
        let [harmless, median, largest] = [row.errors.harmless_m, row.errors.median_m, row.errors.largest_m]
            .map(|error_m| error_m.map_or_else(dash, millimetres));
        Cell { level: worst_level(row), text: median, detail: format!("{harmless} – {largest}"), ..Cell::default() }
    });
    // What is missed or invented counts the mean distance of electrodes: no error is beyond it.
    let series: Vec<Series> = report.errors.iter().map(|curve| error_series(curve, report.reach_m)).collect();
    let marks = || series.iter().flat_map(|series| &series.marks);
    let chart = Chart {
        title: "How often which error is exceeded".to_owned(),
        subtitle: "share of the points of all sweeps".to_owned(),
        x: Axis::over("error", Unit::Metres, marks().map(|mark| mark.x), FLOOR_M, 1.0),
        y: Axis::over("", Unit::Plain, marks().map(|mark| mark.y), FLOOR_SHARE, 1.0),
        series,
        has_front: false,
        guide: None,
        level: None,
        size: [640.0, 460.0],
    };
    format!("{map}\n<div class=\"single\">{}</div>", chart.svg())
}

fn error_series(curve: &ErrorCurve, reach_m: f64) -> Series {
    let mark = |[error_m, share]: &[f64; 2]| Mark {
        x: *error_m,
        y: *share,
        tooltip: format!(
            "{}: above {} at {:.0} % of {} points",
            curve.solver,
            Unit::Metres.text(*error_m),
            100.0 * share,
            curve.count
        ),
    };
    let marks: Vec<Mark> = curve.points.iter().filter(|[error_m, _]| *error_m < reach_m).map(mark).collect();
    // The label is where half of the points are worse.
    let main = marks.iter().position(|mark| mark.y < 0.5).unwrap_or(marks.len().saturating_sub(1));
    Series { name: curve.solver.clone(), class: class(&curve.solver), marks, main, is_joined: true }
}

/// Class of a solver's colour.
fn class(solver: &str) -> &'static str {
    solver.parse::<Method>().map_or("bound", |method| method.family().class())
}

fn heat(sweep: &SweepReport) -> Heat {
    let row = |name: String, row: &SolverRow| Row { name, cells: row.cells.iter().map(cell).collect() };
    let rows = sweep.solvers.iter().enumerate().flat_map(|(index, solver)| {
        let after = sweep.calibrated.get(index).map(|after| row(format!("{}, calibrated", solver.solver), after));
        std::iter::once(row(solver.solver.clone(), solver)).chain(after)
    });
    Heat {
        title: sweep.title.clone(),
        note: sweep.note.clone(),
        columns: sweep.points.iter().map(|point| point.label.clone()).collect(),
        rows: rows.collect(),
        is_whole: false,
    }
}

fn cell(cell: &Option<CellReport>) -> Cell {
    let Some(cell) = cell else {
        let tooltip = "cannot be made for this model".to_owned();
        return Cell { text: "n/a".to_owned(), tooltip, ..Cell::default() };
    };
    let number = cell.error_m.map_or_else(dash, millimetres);
    let marks = [
        (cell.not_finite > 0.0, " NaN"),
        (cell.failed > 0.0, " ∅"),
        (cell.missed >= 0.25, " −"),
        (cell.invented >= 0.25, " +"),
        (cell.broken == Some(Breakdown::Slow), " slow"),
    ];
    let marks: String = marks.into_iter().filter(|(is, _)| *is).map(|(_, mark)| mark).collect();
    Cell {
        level: Some(cell.level),
        text: number + &marks,
        detail: String::new(),
        is_flagged: cell.is_reported(),
        tooltip: format!(
            "count right in {:.0} % of frames, missed {:.2}, invented {:.2}, conductance off by {}, p99 {}, flagged in {:.0} % of frames",
            100.0 * cell.count_right.unwrap_or(0.0),
            cell.missed,
            cell.invented,
            cell.conductance_error.map_or_else(|| "–".to_owned(), |error| format!("{:.0} %", 100.0 * error)),
            Unit::Seconds.text(cell.p99_us * 1e-6),
            100.0 * cell.flagged
        ),
    }
}

fn bounds(report: &Report) -> String {
    let charts: String = report.bounds.charts.iter().map(|chart| bound_chart(chart).svg() + "\n").collect();
    format!(
        "<p>Error of each solver, and the Cramer-Rao bound (dashed): no unbiased method can have a smaller root-mean-square error with this converter's \
         noise. Where a solver is far above it, its model or its start is what limits it; below it, guesses are biased. Contacts missed or invented \
         count the mean distance of electrodes.</p>\n<div class=\"charts\">{charts}</div>"
    )
}

fn bound_chart(report: &BoundChart) -> Chart {
    let of =
        |axis: usize| report.curves.iter().flat_map(move |curve| curve.points.iter().map(move |point| point[axis]));
    let (unit, what) = match report.is_distance {
        true => (Unit::Metres, "distance"),
        false => (Unit::Plain, "sheet conductances"),
    };
    Chart {
        title: report.title.clone(),
        subtitle: "mean error".to_owned(),
        x: Axis::over(what, unit, of(0), FLOOR_M, 1.0),
        y: Axis::over("", Unit::Metres, of(1), FLOOR_M, 1.0),
        series: report.curves.iter().map(curve).collect(),
        has_front: false,
        guide: None,
        level: None,
        size: [430.0, 380.0],
    }
}

fn curve(curve: &BoundCurve) -> Series {
    let mark = |[x, y]: &[f64; 2]| Mark { x: *x, y: *y, tooltip: format!("{}: {}", x, Unit::Metres.text(*y)) };
    Series {
        name: curve.solver.clone().unwrap_or_else(|| "noise limit".to_owned()),
        class: curve.solver.as_deref().map_or("bound", class),
        marks: curve.points.iter().map(mark).collect(),
        main: curve.points.len() / 2,
        is_joined: true,
    }
}

fn footer(report: &Report) -> String {
    format!(
        "<h2>How it was measured</h2>\n<p class=\"note\">Detector {}{}; {} places at each point, {} frames at each; seed {}. A light contact is 0.03 sheet \
         conductances, a firm one 0.3. Readings come from a finer model than any that is inverted, with the converter's noise and steps. A contact is \
         missed or invented if it has no partner within the mean distance of electrodes, {:.1} mm. Each solver has its defaults.</p>\n{}",
        report.detector,
        report.whose(),
        report.places,
        report.frames,
        report.seed,
        report.reach_m * 1e3,
        machine(&report.machine, &report.command)
    )
}
