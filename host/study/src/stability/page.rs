//! The report as a page.

use super::bounds::{BoundChart, BoundCurve};
use super::{Breakdown, CellReport, Report, SolverRow, SweepReport};
use crate::page::{Axis, Cell, Chart, Heat, Mark, Row, Series, Unit, html, machine};
use tactomo_touch::solve::Method;

/// Errors below this show there (m).
const FLOOR_M: f64 = 1e-6;

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
    let Some(all) = report.sweeps.iter().max_by_key(|sweep| sweep.solvers.len()) else { return String::new() };
    let rows = report.sweeps.iter().map(|sweep| Row {
        name: sweep.title.clone(),
        cells: all.solvers.iter().map(|solver| overview_cell(sweep, &solver.solver)).collect(),
    });
    Heat {
        title: format!("{}: first break of each solver", report.detector),
        note: "The mildest point of each sweep that breaks a solver: its error is above 15 % of the mean distance of electrodes and twice that at \
               the harmless point, or it miscounts, slows down or answers with no finite number. Where it holds: its largest error."
            .to_owned(),
        columns: all.solvers.iter().map(|row| row.solver.clone()).collect(),
        rows: rows.collect(),
        is_whole: true,
    }
    .html()
}

fn overview_cell(sweep: &SweepReport, solver: &str) -> Cell {
    let Some(row) = sweep.solvers.iter().find(|row| row.solver == solver) else { return Cell::default() };
    let cells = || row.cells.iter().flatten();
    if cells().next().is_none() {
        return cell(&None);
    }
    let Some(found) = &row.breaks else {
        let worst_m = cells().filter_map(|cell| cell.error_m).fold(0.0, f64::max);
        return Cell {
            level: cells().map(|cell| cell.level).max(),
            text: "holds".to_owned(),
            detail: format!("{} mm", millimetres(worst_m)),
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
        tooltip: format!("holds at {:.0} % of the points", 100.0 * found.survives),
    }
}

fn heat(sweep: &SweepReport) -> Heat {
    let row = |row: &SolverRow| Row { name: row.solver.clone(), cells: row.cells.iter().map(cell).collect() };
    Heat {
        title: sweep.title.clone(),
        note: sweep.note.clone(),
        columns: sweep.points.iter().map(|point| point.label.clone()).collect(),
        rows: sweep.solvers.iter().map(row).collect(),
        is_whole: false,
    }
}

fn cell(cell: &Option<CellReport>) -> Cell {
    let Some(cell) = cell else {
        let tooltip = "cannot be made for this model".to_owned();
        return Cell { text: "n/a".to_owned(), tooltip, ..Cell::default() };
    };
    let number = cell.error_m.map_or_else(|| "–".to_owned(), millimetres);
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

/// A distance (m) in millimetres, without the unit.
fn millimetres(metres: f64) -> String {
    if metres < 9.95e-4 { format!("{:.2}", metres * 1e3) } else { format!("{:.1}", metres * 1e3) }
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
        size: [430.0, 380.0],
    }
}

fn curve(curve: &BoundCurve) -> Series {
    let method = curve.solver.as_deref().and_then(|name| name.parse::<Method>().ok());
    let mark = |[x, y]: &[f64; 2]| Mark { x: *x, y: *y, tooltip: format!("{}: {}", x, Unit::Metres.text(*y)) };
    Series {
        name: curve.solver.clone().unwrap_or_else(|| "noise limit".to_owned()),
        class: method.map_or("bound", |method| method.family().class()),
        marks: curve.points.iter().map(mark).collect(),
        main: curve.points.len() / 2,
        is_joined: true,
    }
}

fn footer(report: &Report) -> String {
    format!(
        "<h2>How it was measured</h2>\n<p class=\"note\">Detector {}; {} places at each point, {} frames at each; seed {}. A light contact is 0.03 sheet \
         conductances, a firm one 0.3. Readings come from a finer model than any that is inverted, with the converter's noise and steps. A contact is \
         missed or invented if it has no partner within the mean distance of electrodes, {:.1} mm. Each solver has its defaults.</p>\n{}",
        report.detector,
        report.places,
        report.frames,
        report.seed,
        report.reach_m * 1e3,
        machine(&report.machine, &report.command)
    )
}
