//! The study as parts of a page.

use tactomo_study::page::{Axis, Chart, Mark, Series, Unit, table};

use super::super::text::number;
use super::table::by_solver;
use super::{Report, Row, SolverRow};

/// Errors below this show there (m).
const FLOOR_M: f64 = 1e-5;

pub(super) fn parts(report: &Report) -> Vec<String> {
    let figures = [
        chart(
            report,
            "Correlation",
            "with the thin shell of the same sheet conductance",
            &[("", "linear", |row| row.correlation)],
        ),
        chart(
            report,
            "Largest reading",
            "V",
            &[("slab", "linear", |row| row.largest_v), ("shell", "paper", |row| row.shell_largest_v)],
        ),
        chart(
            report,
            "Mean absolute error",
            "of readings over the largest one",
            &[("", "linear", |row| row.mean_absolute_error)],
        ),
    ];
    let figures: String = figures.iter().map(|chart| chart.svg() + "\n").collect();
    let solvers = [
        solvers(report, "Taken for a thin shell", |row| row.on_shell_m),
        solvers(report, "Inverted as a slab", |row| row.on_slab_m),
    ];
    let solvers: String = solvers.iter().map(|chart| chart.svg() + "\n").collect();
    vec![
        "<h3>Readings against the thin shell's</h3><p class=\"quiet\">Of one contact at a side, each vector over its largest reading: the slab's upwards over the shell's. On the dashed line the \
         shell would be right.</p>"
            .to_owned(),
        format!("<div class=\"charts small\">{}</div>", report.rows.iter().map(|row| vectors(row).svg() + "\n").collect::<String>()),
        format!("<div class=\"charts small\">{figures}</div>"),
        "<h3>Which solvers fail because of it</h3><p class=\"quiet\">Mean error in the middle, at a side and in a corner, one noisy frame each, a contact missed or invented counted as the distance \
         of electrodes; readings come from a finer slab.</p>"
            .to_owned(),
        format!("<div class=\"charts\">{solvers}</div>"),
        errors(report),
    ]
}

/// The normalised vector of a thickness over that of the shell.
fn vectors(row: &Row) -> Chart {
    let [slab, shell] = &row.normalised;
    let mark = |(y, x): (&f64, &f64)| Mark {
        x: *x,
        y: *y,
        tooltip: format!("slab {}, shell {}", number(Some(*y), 1.0), number(Some(*x), 1.0)),
    };
    let readings = slab.iter().zip(shell).map(mark).collect();
    let line = [0.0, 1.0].map(|at| Mark { x: at, y: at, tooltip: "the shell itself".to_owned() });
    let axis = |title: &str| Axis::linear(title, Unit::Plain, slab.iter().chain(shell).copied().chain([0.0, 1.0]));
    Chart {
        title: Unit::Metres.text(row.thickness_m),
        subtitle: format!("correlation {:.4} over all nine places", row.correlation),
        x: axis("shell, normalised"),
        y: axis(""),
        series: vec![
            Series { name: String::new(), class: "linear", marks: readings, main: usize::MAX, is_joined: false },
            Series { name: String::new(), class: "bound", marks: line.into(), main: usize::MAX, is_joined: true },
        ],
        has_front: false,
        guide: None,
        level: None,
        size: [300.0, 280.0],
    }
}

type Value = fn(&Row) -> f64;

fn chart(report: &Report, title: &str, subtitle: &str, lines: &[(&str, &'static str, Value)]) -> Chart {
    let series = lines.iter().map(|(name, class, value)| {
        let mark = |row: &Row| Mark {
            x: row.thickness_m,
            y: value(row),
            tooltip: format!("{}: {} {name}", Unit::Metres.text(row.thickness_m), number(Some(value(row)), 1.0)),
        };
        let marks: Vec<_> = report.rows.iter().map(mark).collect();
        Series { name: (*name).to_owned(), class, main: marks.len().saturating_sub(1), marks, is_joined: true }
    });
    let series: Vec<_> = series.collect();
    let values = series.iter().flat_map(|series| &series.marks).map(|mark| mark.y);
    Chart {
        title: title.to_owned(),
        subtitle: subtitle.to_owned(),
        x: thickness(report),
        y: Axis::linear("", Unit::Plain, values.chain([0.0])),
        series,
        has_front: false,
        guide: None,
        level: None,
        size: [330.0, 280.0],
    }
}

fn thickness(report: &Report) -> Axis {
    Axis::over("thickness", Unit::Metres, report.rows.iter().map(|row| row.thickness_m), FLOOR_M, 1.0)
}

fn solvers(report: &Report, title: &str, error_m: fn(&SolverRow) -> f64) -> Chart {
    let all: Vec<_> =
        report.rows.iter().flat_map(|row| &row.solvers).flat_map(|row| [row.on_shell_m, row.on_slab_m]).collect();
    let series = by_solver(report).into_iter().map(|(name, rows, _)| {
        let mark = |(row, own): (&Row, &SolverRow)| Mark {
            x: row.thickness_m,
            y: error_m(own),
            tooltip: format!("{name} at {}: {}", Unit::Metres.text(row.thickness_m), Unit::Metres.text(error_m(own))),
        };
        let marks: Vec<_> = report.rows.iter().zip(&rows).map(mark).collect();
        let class = rows.first().map_or("linear", |row| row.family);
        Series { name: name.to_owned(), class, main: marks.len().saturating_sub(1), marks, is_joined: true }
    });
    Chart {
        title: title.to_owned(),
        subtitle: "mean error".to_owned(),
        x: thickness(report),
        y: Axis::over("", Unit::Metres, all, FLOOR_M, 1.0),
        series: series.collect(),
        has_front: false,
        guide: None,
        level: None,
        size: [520.0, 400.0],
    }
}

fn errors(report: &Report) -> String {
    let mut heads = vec!["mean error, mm: shell / slab".to_owned()];
    heads.extend(report.rows.iter().map(|row| format!("{:.0} mm", row.thickness_m * 1e3)));
    heads.extend(["fails from, as a shell".to_owned(), "as a slab".to_owned()]);
    let pair =
        |row: &SolverRow| format!("{} / {}", number(Some(row.on_shell_m), 1e3), number(Some(row.on_slab_m), 1e3));
    let rows: Vec<Vec<String>> = by_solver(report)
        .into_iter()
        .map(|(name, rows, fails)| std::iter::once(name.to_owned()).chain(rows.iter().map(pair)).chain(fails).collect())
        .collect();
    let heads: Vec<&str> = heads.iter().map(String::as_str).collect();
    table(&heads, &rows)
        + &format!(
            "<p class=\"note\">A solver fails from a mean error of {:.0} mm on, a fifth of the distance of electrodes.</p>",
            report.fails_from_m * 1e3
        )
}
