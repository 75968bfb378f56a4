//! What the study shows: laws beside each other, the one that is used against the table, and what each cause explains.

use tactomo_study::view::{Cell, Format, PLAIN, Style, TEXT, Table, Value, View};

use super::super::rank::p_text;
use super::{Cause, Chosen, Eighth, Report, SINGLE, Tried};

/// The most that a factor may be off for each colour, from good to bad.
const FACTORS: [f64; 4] = [1.5, 2.0, 4.0, 10.0];
/// The same of a difference of SR or PA.
const DIFFERENCES: [f64; 4] = [0.05, 0.1, 0.2, 0.3];
const FIGURES: [&str; 4] = ["SENS", "FMAX", "SR", "PA"];
const FACTOR: Format = Format::new("", "").digits(1);

/// Laws, predictions, and causes.
pub fn view(report: &Report) -> View {
    let lead = "Why the paper's foams are less sensitive than ideal ones, and in another order: laws of contact fitted to its four single foams, \
                which then have to predict the seven stacks; and what else explains its table II.";
    let view = report.course.view("From the ideal foam to the measured one", lead);
    let view = view.with(laws(report)).folded("Where each law is from", [sources(report)]);
    let view = match &report.chosen {
        Some(chosen) => view.text(sentence(chosen)).with(predicted(report)),
        None => view,
    };
    let view = view.with(left(report));
    (0..FIGURES.len()).fold(view, |view, figure| view.figures(heading(figure), [heat(report, figure)]))
}

/// A rank correlation and its chance.
fn order(of: Option<[f64; 2]>) -> String {
    of.map_or_else(|| "-".to_owned(), |[correlation, chance]| format!("{correlation:+.2} ({})", p_text(chance)))
}

fn laws(report: &Report) -> Table {
    let eighth = |one: &&Tried| match one.eighth {
        Eighth::Derived => "derived",
        Eighth::Printed => "printed",
    };
    Table::of("Laws of contact, fitted to A, B, C and D", &report.laws)
        .column("law", TEXT, |one| one.name)
        .column("", TEXT, |one| one.formula)
        .column("eq. (8)", TEXT, move |one| eighth(one))
        .column("SENS of the stacks off by", FACTOR, |one| one.fitted.left[0])
        .column("FMAX", FACTOR, |one| one.fitted.left[1])
        .column("order of SENS", TEXT, |one| order(one.fitted.order[0]))
        .column("order of FMAX", TEXT, |one| order(one.fitted.order[1]))
        .note(
            "Off by a factor: root mean square of the logarithm, each counted as 20 at most, over the stacks, of which nothing was fitted but the unit of SENS (a median). Order: rank correlation over \
             all samples, and how likely one so strong is by chance. Eq. (8) as it is printed does not follow from (6), but it may be what was computed.",
        )
        .data()
        .into()
}

/// Each law once.
fn sources(report: &Report) -> Table {
    let once = report.laws.iter().filter(|one| one.eighth == Eighth::Printed);
    Table::of("", once.collect::<Vec<_>>())
        .column("law", TEXT, |one| one.name)
        .column("from", TEXT, |one| one.source)
        .style(Style::Prose)
        .into()
}

fn sentence(chosen: &Chosen) -> String {
    let [low, high] = chosen.without_one_j_per_m3.map(|energy| energy / 1e3);
    format!(
        "**{}** is used everywhere. Its form was found with all samples in view. Fitted to all samples its film conducts 1 S/m2 at an energy of {:.1} kJ/m3 (without any one of the samples {low:.1} to {high:.1}); a \
         share of 1 of the drive is {:.2} mV of the paper's reconstructed value, an image's value whose scale its lambda sets.",
        chosen.name,
        chosen.unit_energy_j_per_m3 / 1e3,
        chosen.fitted.unit_mv
    )
}

/// The chosen law, fitted to the single foams with eq. (8) as printed, beside what was measured.
fn predicted(report: &Report) -> Table {
    let chosen = report.chosen.as_ref().map(|chosen| chosen.name);
    let fitted = report.laws.iter().find(|one| Some(one.name) == chosen && one.eighth == Eighth::Printed);
    let rows = report.samples.iter().enumerate().filter_map(|(at, sample)| {
        let errors = fitted?.fitted.errors.get(at)?.as_ref()?;
        Some((at, *sample, *errors))
    });
    Table::of("What that law says, fitted to the single foams alone", rows.collect::<Vec<_>>())
        .column("sample", TEXT, |(_, sample, _)| sample.name)
        .column("", TEXT, |(at, ..)| if *at < SINGLE { "fitted" } else { "predicted" })
        .column("SENS, mV/N", PLAIN, |(_, sample, errors)| sample.sensitivity_mv_per_n * errors[0].exp())
        .column("measured", PLAIN, |(_, sample, _)| sample.sensitivity_mv_per_n)
        .column("FMAX, N", PLAIN, |(_, sample, errors)| sample.maximum_n.map(|newtons| newtons * errors[1].exp()))
        .column("measured, N", TEXT, |(_, sample, _)| sample.maximum_text())
        .into()
}

/// What each step leaves of all four figures.
fn left(report: &Report) -> Table {
    Table::of("What each cause leaves", &report.causes)
        .column("with", TEXT, |cause| cause.name)
        .column("SENS off by", FACTOR, |cause| cause.left[0])
        .column("FMAX off by", FACTOR, |cause| cause.left[1])
        .column("SR off by", PLAIN.digits(2), |cause| cause.left[2])
        .column("samples with it", PLAIN.digits(0), |cause| count(cause, 2))
        .column("PA off by", PLAIN.digits(2), |cause| cause.left[3])
        .column("with it", PLAIN.digits(0), |cause| count(cause, 3))
        .note(
            "Factors (each counted as 20 at most) and differences, root mean square over the samples that have a figure; images that have collapsed have none. The first three rows add up; each later one adds to \
             the third, those with an image to the image too. Rubber and unloading are bounds: the paper has no numbers of them.",
        )
        .into()
}

fn count(cause: &Cause, figure: usize) -> f64 {
    cause.errors.iter().filter(|one| one[figure].is_some()).count() as f64
}

fn heading(figure: usize) -> String {
    let what = if figure < 2 { "simulated over measured" } else { "simulated less measured" };
    format!("{}, {what}: a column for each sample, a row for each cause.", FIGURES[figure])
}

/// A row for each cause, a column for each sample.
fn heat(report: &Report, figure: usize) -> Table {
    let of = |cause: &Cause, at: usize| -> Option<f64> {
        let error = cause.errors.get(at)?[figure]?;
        Some(if figure < 2 { error.exp() } else { error })
    };
    let level = |value: f64| {
        let (off, levels) = if figure < 2 { (value.max(1.0 / value), FACTORS) } else { (value.abs(), DIFFERENCES) };
        levels.iter().position(|most| off <= *most).unwrap_or(levels.len()) as u8
    };
    let mut table = Table::of("", &report.causes).column("with", TEXT, |cause| cause.name);
    for (at, sample) in report.samples.iter().enumerate() {
        table = table.cells(sample.name, TEXT, move |cause| {
            let value = of(cause, at);
            let text = value.map_or_else(|| "-".to_owned(), |value| format!("{value:.2}"));
            Cell { value: Value::from(text), level: value.map(level), ..Cell::default() }
        });
    }
    table.style(Style::Heat).into()
}
