//! What the report shows.

use super::bounds::{BoundChart, BoundCurve};
use super::{Breakdown, CellReport, Report, SolverRow, SweepReport};
use crate::view::{Axis, Cell, Chart, Figures, MM, PERCENT, Series, Style, TEXT, Table, Unit, View};
use tactomo_touch::solve::Method;

/// Colours of levels, and what they stand for.
const LEVELS: [(&str, &str); 5] = [
    ("h0", "below 3 %"),
    ("h1", "10 %"),
    ("h2", "30 %"),
    ("h3", "60 %"),
    ("h4", "above: error, as a share of the mean distance of electrodes"),
];

/// Where each solver breaks, how far off it is, what noise allows, and every point.
pub fn view(report: &Report) -> View {
    let lead = "Green holds, red is useless. **⚑** marks where the solver itself reports that something is wrong: **red without a flag is the danger**.";
    let every = "Mean error in mm, where a contact missed or invented counts the mean distance of electrodes. − contacts are missed, + contacts are \
                 invented, slow: a frame takes far longer, ∅ refused, NaN not finite.";
    let bounds = "Error of each solver, and the Cramer-Rao bound (dashed): no unbiased method can have a smaller root-mean-square error with this \
                  converter's noise. Where a solver is far above it, its model or its start is what limits it; below it, guesses are biased. Contacts \
                  missed or invented count the mean distance of electrodes.";
    let view = View::new("Where solvers break", lead)
        .with(Figures {
            legend: LEVELS.map(|(class, what)| (class, what.to_owned())).into(),
            ..Figures::of("", [overview(report)])
        })
        .heading("How far off")
        .figures("", [errors(report)])
        .heading("Against what noise allows")
        .figures(bounds, report.bounds.charts.iter().map(bound_chart))
        .heading("Every point")
        .figures(every, report.sweeps.iter().map(heat))
        .with(breaks(report));
    View { method: method(report), ..view }.without(&report.missing)
}

/// All rows of a sweep, those after a calibration behind those before; and what follows the name of the latter.
fn rows(sweep: &SweepReport) -> impl Iterator<Item = (&SolverRow, &'static str)> {
    let after = |index: usize| sweep.calibrated.get(index).map(|row| (row, ", calibrated"));
    sweep.solvers.iter().enumerate().flat_map(move |(index, row)| std::iter::once((row, "")).chain(after(index)))
}

/// A row for each sweep, a column for each solver.
fn sweeps_by_solvers(report: &Report, title: String, note: &str, cell: fn(&SolverRow) -> Cell) -> Table {
    let all = report.sweeps.iter().max_by_key(|sweep| sweep.solvers.len());
    let solvers = all.map(|sweep| sweep.solvers.iter().map(|row| row.solver.clone())).into_iter().flatten();
    let row = |sweep: &SweepReport| {
        let before = (sweep.title.clone(), sweep.solvers.clone());
        let after = (format!("{}, calibrated", sweep.title), sweep.calibrated.clone());
        [before, after].into_iter().filter(|(_, rows)| !rows.is_empty())
    };
    let table = Table::of(title, report.sweeps.iter().flat_map(row)).column("", TEXT, |(name, _)| name.clone());
    let with = |table: crate::view::Rows<(String, Vec<SolverRow>)>, solver: String| {
        let of = |(_, rows): &(String, Vec<SolverRow>)| {
            let row = rows.iter().find(|row| row.solver == solver);
            row.map_or_else(Cell::default, |row| {
                if row.cells.iter().any(Option::is_some) { cell(row) } else { self::cell(&None) }
            })
        };
        table.cells(solver.clone(), TEXT, of)
    };
    solvers.fold(table, with).note(note).style(Style::WholeHeat).into()
}

fn overview(report: &Report) -> Table {
    let title = format!("{}{}: first break of each solver", report.detector, report.whose());
    let note = "The mildest point of each sweep that breaks a solver: its error is above 15 % of the mean distance of electrodes and twice its own at \
                the harmless point, or it miscounts, slows down or answers with no finite number. Where it holds: its error in mm at the harmless \
                point and its largest, for what is off by 5 mm from the start holds up to 10.";
    sweeps_by_solvers(report, title, note, |row| {
        let range = format!("{} – {}", millimetres(row.errors.harmless_m), millimetres(row.errors.largest_m));
        let Some(found) = &row.breaks else {
            return Cell { level: worst_level(row), value: "holds".into(), detail: range, ..Cell::default() };
        };
        let level = match found.survives {
            0.6.. => 2,
            0.35.. => 3,
            _ => 4,
        };
        Cell {
            level: Some(level),
            value: found.at.as_str().into(),
            detail: found.how.name().to_owned(),
            is_flagged: found.is_reported,
            tooltip: format!(
                "holds at {:.0} % of the points; error in mm, at the harmless point and at most: {range}",
                100.0 * found.survives
            ),
        }
    })
}

/// Errors in millimetres, whatever they are at the harmless point.
fn errors(report: &Report) -> Table {
    let title = format!("{}: errors of each solver, mm", report.detector);
    let note = "The median over the points of each sweep; below it, that at the harmless point and the largest. Colours are of the largest.";
    sweeps_by_solvers(report, title, note, |row| {
        let [harmless, median, largest] =
            [row.errors.harmless_m, row.errors.median_m, row.errors.largest_m].map(millimetres);
        let detail = format!("{harmless} – {largest}");
        Cell { level: worst_level(row), value: median.into(), detail, ..Cell::default() }
    })
}

/// Colour of a row's worst cell.
fn worst_level(row: &SolverRow) -> Option<u8> {
    row.cells.iter().flatten().map(|cell| cell.level).max()
}

/// A distance (m) in millimetres, without the unit.
fn millimetres(metres: Option<f64>) -> String {
    metres.map_or_else(
        || "–".to_owned(),
        |metres| {
            if metres < 9.95e-4 { format!("{:.2}", metres * 1e3) } else { format!("{:.1}", metres * 1e3) }
        },
    )
}

/// Class of a solver's colour.
fn class(solver: &str) -> &'static str {
    solver.parse::<Method>().map_or("bound", |method| method.family().class())
}

fn heat(sweep: &SweepReport) -> Table {
    let table = Table::of(sweep.title.as_str(), rows(sweep))
        .column("", TEXT, |(row, suffix)| format!("{}{suffix}", row.solver))
        .note(sweep.note.as_str())
        .style(Style::Heat);
    let points = sweep.points.iter().enumerate();
    let with = |table: crate::view::Rows<_>, (index, point): (usize, &super::PointReport)| {
        table.cells(point.label.as_str(), TEXT, |(row, _): &(&SolverRow, &str)| cell(&row.cells[index]))
    };
    points.fold(table, with).into()
}

fn cell(cell: &Option<CellReport>) -> Cell {
    let Some(cell) = cell else {
        let tooltip = "cannot be made for this model".to_owned();
        return Cell { value: "n/a".into(), tooltip, ..Cell::default() };
    };
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
        value: (millimetres(cell.error_m) + &marks).into(),
        detail: String::new(),
        is_flagged: cell.is_reported(),
        tooltip: format!(
            "count right in {:.0} % of frames, missed {:.2}, invented {:.2}, conductance off by {} %, p99 {}, flagged in {:.0} % of frames",
            100.0 * cell.count_right.unwrap_or(0.0),
            cell.missed,
            cell.invented,
            PERCENT.text(cell.conductance_error),
            Unit::Seconds.text(cell.p99_us * 1e-6),
            100.0 * cell.flagged
        ),
    }
}

fn bound_chart(report: &BoundChart) -> Chart {
    let x = match report.is_distance {
        true => Axis::log("distance", Unit::Metres),
        false => Axis::log("sheet conductances", Unit::Plain),
    };
    let curve = |curve: &BoundCurve| {
        let name = curve.solver.as_deref();
        Series::line(name.unwrap_or("noise limit"), name.map_or("bound", class), curve.points.iter().copied())
    };
    Chart::new(report.title.as_str(), "mean error", [x, Axis::log("", Unit::Metres)], report.curves.iter().map(curve))
}

/// Each solver's errors over each sweep, where it breaks, and how.
fn breaks(report: &Report) -> Table {
    let rows = report.sweeps.iter().flat_map(|sweep| rows(sweep).map(move |(row, suffix)| (sweep, row, suffix)));
    let found = |of: fn(&super::Break) -> String| {
        move |(_, row, _): &(&SweepReport, &SolverRow, &str)| row.breaks.as_ref().map_or(String::new(), of)
    };
    Table::of(format!("{}{}: first breaks", report.detector, report.whose()), rows)
        .group("sweep", |(sweep, ..)| sweep.title.as_str())
        .column("solver", TEXT, |(_, row, suffix)| format!("{}{suffix}", row.solver))
        .column("harmless", MM.digits(2), |(_, row, _)| row.errors.harmless_m)
        .column("median", MM.digits(2), |(_, row, _)| row.errors.median_m)
        .column("largest", MM.digits(2), |(_, row, _)| row.errors.largest_m)
        .column("breaks at", TEXT, found(|found| found.at.clone()))
        .column("how", TEXT, found(|found| found.how.name().to_owned()))
        .column("", TEXT, found(|found| if found.is_reported { "with a flag" } else { "silently" }.to_owned()))
        .column("holds at", PERCENT, |(_, row, _)| row.breaks.as_ref().map_or(1.0, |found| found.survives))
        .note(
            "A solver holds as long as its error is below 15 % of the mean distance of electrodes or twice its own harmless one: see what that is. \
             Light and firm contacts are 0.03 and 0.3 sheet conductances. --json and --out have every point.",
        )
        .data()
        .into()
}

fn method(report: &Report) -> String {
    format!(
        "Detector {}{}; {} places at each point, {} frames at each; seed {}. A light contact is 0.03 sheet conductances, a firm one 0.3. Readings come \
         from a finer model than any that is inverted, with the converter's noise and steps. A contact is missed or invented if it has no partner within \
         the mean distance of electrodes, {:.1} mm. Each solver has its defaults.",
        report.detector,
        report.whose(),
        report.places,
        report.frames,
        report.seed,
        report.reach_m * 1e3
    )
}
