//! What the study shows.

use tactomo_study::view::{Axis, Chart, Format, MM, PLAIN, Series, TEXT, Table, Unit, View, same_axis};

use super::{Report, Row, SolverRow};

/// An error of a solver (m).
type ErrorM = fn(&SolverRow) -> f64;
/// What solvers take the detector for.
const MODELS: [(&str, ErrorM); 2] =
    [("Taken for a thin shell", |row| row.on_shell_m), ("Inverted as a slab", |row| row.on_slab_m)];

/// Readings against the thin shell's, and which solvers fail because of it.
pub fn view(report: &Report) -> View {
    let lead = "How far a detector of 1, 2, 4, 8 or 16 mm is from the thin shell that the paper's solver takes it for, and which solvers fail because \
                of it.";
    let vectors = "Readings of one contact at a side, each vector over its largest reading: the slab's upwards over the shell's. On the dashed line the \
                   shell would be right.";
    let fail = "Which solvers fail because of it: mean error in the middle, at a side and in a corner, one noisy frame each, a contact missed or invented \
                counted as the distance of electrodes; readings come from a finer slab.";
    let mut solvers = MODELS.map(|(title, error_m)| of_solvers(report, title, error_m));
    same_axis(&mut solvers, 1);
    report
        .course
        .view("How thick", lead)
        .figures(vectors, report.rows.iter().map(self::vectors))
        .figures("", readings(report))
        .figures(fail, solvers)
        .with(figures(report))
        .with(errors(report))
}

/// The normalised vector of a thickness over that of the shell.
fn vectors(row: &Row) -> Chart {
    let [slab, shell] = &row.normalised;
    let axis =
        |title: &str| Axis::linear(title, Unit::Plain).reaching(slab.iter().chain(shell).copied().chain([0.0, 1.0]));
    let series = [
        Series::dots("", "linear", shell.iter().copied().zip(slab.iter().copied())).unlabelled(),
        Series::line("", "bound", [[0.0; 2], [1.0; 2]]).undotted(),
    ];
    let subtitle = format!("correlation {:.4} over all nine places", row.correlation);
    Chart::new(Unit::Metres.text(row.thickness_m), subtitle, [axis("shell, normalised"), axis("")], series)
        .sized([300.0, 280.0])
}

/// What of the readings changes with thickness.
fn readings(report: &Report) -> [Chart; 3] {
    type Line = (&'static str, &'static str, fn(&Row) -> f64);
    let chart = |title: &str, subtitle: &str, lines: &[Line]| {
        let line = |(name, class, value): &Line| {
            Series::line(*name, class, report.rows.iter().map(|row| (row.thickness_m, value(row)))).labelled_last()
        };
        let y = Axis::linear("", Unit::Plain).reaching([0.0]);
        Chart::new(title, subtitle, [thickness(), y], lines.iter().map(line)).sized([330.0, 280.0])
    };
    [
        chart(
            "Correlation",
            "with the thin shell of the same sheet conductance",
            &[("", "linear", |row| row.correlation)],
        ),
        chart(
            "Largest reading",
            "V",
            &[("slab", "linear", |row| row.largest_v), ("shell", "paper", |row| row.shell_largest_v)],
        ),
        chart(
            "Mean absolute error",
            "of readings over the largest one",
            &[("", "linear", |row| row.mean_absolute_error)],
        ),
    ]
}

fn thickness() -> Axis {
    Axis::log("thickness", Unit::Metres).floor(1e-5)
}

/// Each solver with its rows, from the thinnest.
fn by_solver(report: &Report) -> Vec<Vec<&SolverRow>> {
    let first = report.rows.first().map_or(&[][..], |row| &row.solvers);
    let of = |solver: &SolverRow| {
        report.rows.iter().flat_map(|row| &row.solvers).filter(|row| row.solver == solver.solver).collect()
    };
    first.iter().map(of).collect()
}

fn of_solvers(report: &Report, title: &str, error_m: ErrorM) -> Chart {
    let series = by_solver(report).into_iter().filter_map(|rows| {
        let points = report.rows.iter().zip(&rows).map(|(row, own)| (row.thickness_m, error_m(own)));
        Some(Series::line(rows.first()?.solver, rows.first()?.family, points).labelled_last())
    });
    let axes = [thickness(), Axis::log("", Unit::Metres).floor(1e-5)];
    Chart::new(title, "mean error", axes, series).sized([520.0, 400.0])
}

/// A row for each thickness.
fn figures(report: &Report) -> Table {
    let volts = Format::new("V", "v");
    let mut table = Table::of("Readings", &report.rows)
        .column("thickness", MM.digits(0), |row| row.thickness_m)
        .column("correlation", PLAIN.digits(4), |row| row.correlation)
        .column("largest", volts, |row| row.largest_v)
        .column("shell largest", volts, |row| row.shell_largest_v)
        .column("mean absolute error", PLAIN.digits(4), |row| row.mean_absolute_error);
    for index in 0..report.rows.first().map_or(0, |row| row.solvers.len()) {
        let name = report.rows[0].solvers[index].solver;
        let error = |error_m: ErrorM| move |row: &&Row| row.solvers.get(index).map(error_m);
        table = table.detail(format!("{name} on shell"), MM, error(MODELS[0].1));
        table = table.detail(format!("{name} on slab"), MM, error(MODELS[1].1));
    }
    table.data().into()
}

/// A row for each solver, a column for each thickness.
fn errors(report: &Report) -> Table {
    let fails = |error_m: ErrorM| move |rows: &Vec<&SolverRow>| report.fails_at_m(rows.first()?.solver, error_m);
    let mut table = Table::of(
        "Mean error, mm, of solvers that take the detector for a shell / that invert the slab",
        by_solver(report),
    )
    .column("solver", TEXT, |rows| rows.first().map_or("", |row| row.solver));
    for (index, row) in report.rows.iter().enumerate() {
        table = table.column(format!("{:.0} mm", row.thickness_m * 1e3), TEXT, |rows: &Vec<&SolverRow>| {
            let [shell, slab] = MODELS.map(|(_, error_m)| MM.text(rows.get(index).map(|row| error_m(row))));
            format!("{shell} / {slab}")
        });
    }
    let note = format!(
        "A solver fails from a mean error of {:.2} mm on, 15 % of the distance of electrodes; a dash: nowhere.",
        report.fails_from_m * 1e3
    );
    table
        .column("fails from, as a shell", MM.digits(0), fails(MODELS[0].1))
        .column("as a slab", MM.digits(0), fails(MODELS[1].1))
        .note(note)
        .into()
}
