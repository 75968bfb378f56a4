//! What the report shows.

use super::bounds::{BoundChart, BoundCurve};
use super::{Break, Breakdown, CellReport, Classes, Margin, Report, SolverRow, SweepReport};
use crate::view::{Axis, Cell, Chart, Figures, MM, Mark, Outcome, PERCENT, Series, Style, TEXT, Table, Unit, View};
use tactomo_touch::solve::Method;

/// Colours of levels, and what they stand for.
const LEVELS: [(&str, &str); 5] = [
    ("h0", "below 3 %"),
    ("h1", "10 %"),
    ("h2", "30 %"),
    ("h3", "60 %"),
    ("h4", "above: error, as a share of the mean distance of electrodes"),
];

/// From this share of wrong answers that nothing is said of, a solver is a danger there.
const OFTEN: f64 = 0.25;
/// What is rarer shows as none: half of a per cent.
const RARE: f64 = 0.005;

/// Where each solver fails and whether it says so, how far off it is, what noise allows, and every point.
pub fn view(report: &Report) -> View {
    let lead = "What is **wrong and says nothing of it is the danger**: solid, with ✕. What is wrong and flagged is striped, with ⚑; ± is wrong, but within three \
                of its own standard errors; ○ is as far off without what is varied. **Click a cell** for its curve.";
    let every = "Mean error in mm, where a contact missed or invented counts the mean distance of electrodes. − \
                 contacts are missed, + contacts are invented, slow: a frame takes far longer, ∅ refused, NaN not finite.";
    let bounds = "Mean error of each solver, and that of normal errors with the covariance of the Cramer-Rao bound (dashed): no unbiased method has a smaller \
                  covariance with this converter's noise, radii known to a factor of two. Where a solver is far above it, its model or its start is what limits \
                  it; below it, guesses are biased. Contacts missed or invented count the mean distance of electrodes.";
    let view = View::new("Where solvers break", lead)
        .with(Figures { legend: outcomes(), ..Figures::of("", [overview(report)]) })
        .heading("How far off")
        .with(Figures {
            legend: LEVELS.map(|(class, what)| (class, what.to_owned())).into(),
            ..Figures::of("", [errors(report)])
        })
        .heading("Against what noise allows")
        .figures(bounds, report.bounds.charts.iter().map(bound_chart))
        .heading("Every point")
        .with(Figures { legend: outcomes(), ..Figures::of(every, report.sweeps.iter().map(heat)) })
        .with(breaks(report));
    View { method: method(report), ..view }.without(&report.missing)
}

fn outcomes() -> Vec<(&'static str, String)> {
    Outcome::ALL.map(|(outcome, what)| (outcome.class(), what.to_owned())).into()
}

/// How a solver fails whose answers are of such classes: silently if any are that, else as most of the wrong ones.
fn outcome(classes: Classes) -> Outcome {
    let Classes { flagged, covered, from_start, silent, .. } = classes;
    match silent {
        OFTEN.. => Outcome::Silent,
        RARE.. => Outcome::SometimesSilent,
        _ if classes.wrong() < RARE => Outcome::Right,
        _ if flagged >= covered.max(from_start) => Outcome::Flagged,
        _ if covered >= from_start => Outcome::Covered,
        _ => Outcome::FromStart,
    }
}

/// Shares of wrong answers in per cent: silent and flagged ones, or the share that most of them are.
fn shares(classes: Classes) -> String {
    let per_cent = |share: f64| format!("{:.0}", 100.0 * share);
    match outcome(classes) {
        Outcome::Right => "0".to_owned(),
        Outcome::Covered => per_cent(classes.covered),
        Outcome::FromStart => per_cent(classes.from_start),
        _ => format!("{} / {}", per_cent(classes.silent), per_cent(classes.flagged)),
    }
}

/// Shares of all classes, for those who ask.
fn all_shares(classes: Classes) -> String {
    let Classes { right, flagged, covered, from_start, silent } = classes;
    let [right, flagged, covered, from_start, silent] =
        [right, flagged, covered, from_start, silent].map(|share| format!("{:.0}", 100.0 * share));
    format!(
        "of frames {right} % right; wrong: {silent} % silently, {flagged} % with a flag, {covered} % within 3 standard errors, {from_start} % from the start"
    )
}

/// How much a solver bears, in multiples of what a good build has.
fn borne(margin: Margin) -> String {
    let times = |amount: f64| {
        let digits = if amount >= 9.95 { 0 } else { 1 };
        format!("{amount:.digits$}")
    };
    match (margin.holds.filter(|amount| *amount > 0.0), margin.breaks) {
        (Some(holds), Some(breaks)) if times(holds) == times(breaks) => format!("{} x", times(holds)),
        (Some(holds), Some(breaks)) => format!("{}–{} x", times(holds), times(breaks)),
        (None, Some(breaks)) => format!("< {} x", times(breaks)),
        (Some(holds), None) => format!("> {} x", times(holds)),
        (None, None) => String::new(),
    }
}

/// All rows of a sweep, those after a calibration behind those before; and what follows the name of the latter.
fn rows(sweep: &SweepReport) -> impl Iterator<Item = (&SolverRow, &'static str)> {
    let after = |index: usize| sweep.calibrated.get(index).map(|row| (row, ", calibrated"));
    sweep.solvers.iter().enumerate().flat_map(move |(index, row)| std::iter::once((row, "")).chain(after(index)))
}

/// A sweep's solvers, before or after a calibration.
type Solvers<'a> = (&'a SweepReport, &'static str, &'a [SolverRow]);

/// A row for each sweep, a column for each solver.
fn sweeps_by_solvers(
    report: &Report,
    title: String,
    note: &str,
    cell: impl Fn(&SweepReport, &SolverRow) -> Cell,
) -> Table {
    let all = report.sweeps.iter().max_by_key(|sweep| sweep.solvers.len());
    let solvers = all.map(|sweep| sweep.solvers.iter().map(|row| row.solver.clone())).into_iter().flatten();
    let rows = |sweep| {
        let SweepReport { solvers, calibrated, .. }: &SweepReport = sweep;
        let rows: [Solvers; 2] = [(sweep, "", solvers), (sweep, ", calibrated", calibrated)];
        rows.into_iter().filter(|(.., rows)| !rows.is_empty())
    };
    let name = |(sweep, suffix, _): &Solvers| format!("{}{suffix}", sweep.title);
    let mut table = Table::of(title, report.sweeps.iter().flat_map(rows)).column("", TEXT, name);
    for solver in solvers {
        table =
            table.cells(solver.clone(), TEXT, |(sweep, _, rows)| match rows.iter().find(|row| row.solver == solver) {
                Some(row) if row.cells.iter().any(Option::is_some) => cell(sweep, row),
                Some(_) => untried(),
                None => Cell::default(),
            });
    }
    table.note(note).style(Style::WholeHeat).into()
}

fn overview(report: &Report) -> Table {
    let title = format!("{}{}: wrong answers, silent / flagged, % of frames", report.detector, report.whose());
    let note = format!(
        "Over all points of a sweep. An answer is wrong if a contact is off by more than {:.2} mm (15 % of the mean distance of electrodes), missed or invented, if it is \
         of another kind than what touches, refused or not finite. Below: the margin to failure, as multiples of what a hobbyist's bench gives \
         (docs/detector.md) or of the described converter's noise: the most that holds and the least at which most answers are wrong; else the mildest \
         such point.",
        1e3 * report.wrong_m
    );
    let wrong_m = report.wrong_m;
    sweeps_by_solvers(report, title, &note, move |sweep, row| {
        let first = row.breaks.as_ref();
        let detail = match (row.margin, first) {
            (Some(margin), _) => borne(margin),
            (None, Some(Break { how: Breakdown::Never, .. })) => Breakdown::Never.name().to_owned(),
            (None, Some(found)) => found.at.clone(),
            (None, None) => "holds".to_owned(),
        };
        let breaks = first.map_or_else(
            || "holds at all points".to_owned(),
            |found| {
                let Break { at, how, survives, .. } = found;
                format!("first breaks at {at} ({}), holds at {:.0} % of the points", how.name(), 100.0 * survives)
            },
        );
        let [harmless, largest] = [row.errors.harmless_m, row.errors.largest_m].map(millimetres);
        Cell {
            value: shares(row.classes).into(),
            detail,
            outcome: Some(outcome(row.classes)),
            tooltip: format!(
                "{}; {breaks}; error in mm, at the harmless point and at most: {harmless} – {largest}",
                all_shares(row.classes)
            ),
            opens: Some(Box::new(curve(sweep, row, wrong_m))),
            ..Cell::default()
        }
    })
}

/// A solver's error over the points of a sweep, and how it fails at each.
fn curve(sweep: &SweepReport, row: &SolverRow, wrong_m: f64) -> Chart {
    let points = || row.cells.iter().enumerate().filter_map(|(index, cell)| Some((index, cell.as_ref()?)));
    let mark = |(index, cell): (usize, &CellReport)| Mark {
        note: format!("{}: {}", sweep.points[index].label, all_shares(cell.classes)),
        ..Mark::from((index as f64, cell.error_m))
    };
    let line = Series::line(row.solver.as_str(), class(&row.solver), points().map(mark)).undotted();
    let told = |outcomes: &[Outcome], class, name: &str| {
        let of = points().filter(|(_, cell)| outcomes.contains(&outcome(cell.classes))).map(mark);
        Series::dots(name, class, of).labelled_last().large()
    };
    let series = [
        line,
        told(&[Outcome::Right], "right", "right"),
        told(&[Outcome::FromStart], "from-start", "from the start"),
        told(&[Outcome::Flagged], "flagged", "flagged"),
        told(&[Outcome::Covered], "covered", "within 3 sigma"),
        told(&[Outcome::SometimesSilent, Outcome::Silent], "silent", "silent"),
    ];
    let axes = [
        Axis::named(sweep.title.as_str(), sweep.points.iter().map(|point| point.label.clone())),
        Axis::log("", Unit::Metres).floor(1e-5),
    ];
    let level = Some((wrong_m, "wrong above".to_owned()));
    let margin = row.margin.map_or_else(String::new, |margin| format!("; margin to failure {}", borne(margin)));
    let subtitle = format!(
        "wrong silently / flagged: {:.0} / {:.0} % of frames{margin}",
        100.0 * row.classes.silent,
        100.0 * row.classes.flagged
    );
    let title = format!("{}: error of {}", sweep.title, row.solver);
    Chart { level, ..Chart::new(title, subtitle, axes, series).sized([520.0, 320.0]) }
}

/// Errors in millimetres, whatever they are at the harmless point.
fn errors(report: &Report) -> Table {
    let title = format!("{}: errors of each solver, mm", report.detector);
    let note = "The median over the points of each sweep; below it, that at the harmless point and the largest. Colours are of the largest.";
    sweeps_by_solvers(report, title, note, |_, row| {
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

/// Where a solver cannot be made for the model.
fn untried() -> Cell {
    Cell { value: "n/a".into(), tooltip: "cannot be made for this model".to_owned(), ..Cell::default() }
}

fn cell(cell: &Option<CellReport>) -> Cell {
    let Some(cell) = cell else { return untried() };
    let marks = [
        (cell.not_finite > 0.0, " NaN"),
        (cell.failed > 0.0, " ∅"),
        (cell.missed - cell.invented >= 0.25, " −"),
        (cell.invented - cell.missed >= 0.25, " +"),
        (cell.broken == Some(Breakdown::Slow), " slow"),
    ];
    let marks: String = marks.into_iter().filter(|(is, _)| *is).map(|(_, mark)| mark).collect();
    Cell {
        value: (millimetres(cell.error_m) + &marks).into(),
        outcome: Some(outcome(cell.classes)),
        tooltip: format!(
            "{}; missed {:.2}, invented {:.2} a frame, conductance off by {} %, p99 {}",
            all_shares(cell.classes),
            cell.missed,
            cell.invented,
            PERCENT.text(cell.conductance_error),
            Unit::Seconds.text(cell.p99_us * 1e-6)
        ),
        ..Cell::default()
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
        .column("right", PERCENT, |(_, row, _)| row.classes.right)
        .column("silent", PERCENT, |(_, row, _)| row.classes.silent)
        .column("flagged", PERCENT, |(_, row, _)| row.classes.flagged)
        .column("within 3 sigma", PERCENT, |(_, row, _)| row.classes.covered)
        .column("from the start", PERCENT, |(_, row, _)| row.classes.from_start)
        .column("bears", TEXT, |(_, row, _)| row.margin.map_or_else(String::new, borne))
        .column("holds at", PERCENT, |(_, row, _)| row.breaks.as_ref().map_or(1.0, |found| found.survives))
        .note(
            "A solver holds as long as most of its answers are right. \
             Light and firm contacts are 0.03 and 0.3 sheet conductances. --json and --out have every point.",
        )
        .data()
        .into()
}

fn method(report: &Report) -> String {
    format!(
        "Detector {}{}; {} places at each point, {} frames at each; seed {}. A light contact is 0.03 sheet conductances, a firm one 0.3. Readings come \
         from a finer model than any that is inverted, with the converter's noise and steps. A contact missed or invented counts \
         the mean distance of electrodes, {:.1} mm. Each solver has its defaults.",
        report.detector,
        report.whose(),
        report.places,
        report.frames,
        report.seed,
        report.reach_m * 1e3
    )
}
