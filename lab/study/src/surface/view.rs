//! What the report shows.

use super::{PlaceReport, Report, SolverReport, Spread};
use crate::view::{Axis, Figures, Format, MM, Map, PLAIN, Rows, TEXT, Table, Unit, View};

/// Errors up to this have one colour (m).
const FINE_M: f64 = 1e-4;
/// Amplitude responses that are too low and too high by a factor of two or more have one colour each.
const AMPLITUDES: [f64; 2] = [0.5, 2.0];
const TWO: Format = PLAIN.digits(2);
const MILLIMETRES: Format = MM.digits(2);

/// What a solver shows over the surface, of each figure: its name, what it is written as, and how it is had.
type Column = (&'static str, Format, fn(&SolverReport) -> Option<Spread>);

const COLUMNS: [Column; 6] = [
    ("error", MILLIMETRES, |solver| solver.error_m),
    ("amplitude response", TWO, |solver| solver.amplitude_response),
    ("position error", MILLIMETRES, |solver| solver.position_error_m),
    ("resolution", TWO, |solver| solver.resolution),
    ("shape deformation", TWO, |solver| solver.shape_deformation),
    ("ringing", TWO, |solver| solver.ringing),
];

/// Maps of error and amplitude of each solver, and GREIT's figures.
pub fn view(report: &Report) -> View {
    let whose = report.as_built.map_or_else(String::new, |seed| format!(", as built with seed {seed}"));
    let title = format!("One press, place by place: {}{whose}", report.detector);
    let lead = "The same press at each place, one after the other: a cell of a map is where it was. **A good solver has one colour all over.** Dots are \
                electrodes.";
    let error = "How far off contacts are (mm), where one missed or invented counts the mean distance of electrodes. **Dark is right.**";
    let amplitude = "The image's whole conductance over that of the press: GREIT's amplitude response. **1, in the middle of the scale, is right**; what is \
                     off by a factor of two or more has the colours of the ends.";
    let errors = report.solvers.iter().map(|solver| errors(report, solver));
    let amplitudes = report.solvers.iter().map(|solver| amplitudes(report, solver));
    let view = View::new(title, lead)
        .heading("How far off")
        .with(Figures::of(error, errors))
        .heading("How strong")
        .with(Figures::of(amplitude, amplitudes))
        .heading("GREIT's figures of merit")
        .with(figures(report))
        .folded("All figures", [data(report)]);
    View { method: method(report), ..view }.without(&report.missing)
}

fn errors(report: &Report, solver: &SolverReport) -> Map {
    let subtitle = told("median", solver.error_m, MM.digits(2), " mm");
    let range = [FINE_M, report.reach_m];
    map(report, solver, subtitle, MM.digits(1), range, |place| place.error_m)
}

fn amplitudes(report: &Report, solver: &SolverReport) -> Map {
    let subtitle = told("median", solver.amplitude_response, TWO, "");
    map(report, solver, subtitle, TWO, AMPLITUDES, |place| place.greit.map(|greit| greit.amplitude_response))
}

fn map(
    report: &Report,
    solver: &SolverReport,
    subtitle: String,
    format: Format,
    range: [f64; 2],
    of: fn(&PlaceReport) -> Option<f64>,
) -> Map {
    let [columns, rows] = report.grid_m.each_ref().map(Vec::len);
    let mut values = vec![vec![None; columns]; rows];
    for place in &solver.places {
        let [column, row] = place.at;
        values[row][column] = of(place);
    }
    Map {
        title: solver.solver.clone(),
        subtitle,
        axes: ["x", "y"].map(|title| Axis::linear(title, Unit::Metres)),
        ticks: report.grid_m.clone(),
        rows: values,
        empty: "nothing shown, or not pressed",
        is_log: true,
        range: Some(range),
        format,
        contours: 0,
        disc: None,
        aspect: length_m(&report.grid_m[1]) / length_m(&report.grid_m[0]),
        marks: report.electrodes_m.iter().map(|at_m| (*at_m, String::new())).collect(),
    }
}

/// Length of cells with such middles, which are two at least (m).
fn length_m(middles_m: &[f64]) -> f64 {
    middles_m.windows(2).map(|pair| pair[1] - pair[0]).sum::<f64>() * middles_m.len() as f64
        / (middles_m.len() - 1).max(1) as f64
}

/// A median with what most places have, in words.
fn told(name: &str, spread: Option<Spread>, format: Format, unit: &str) -> String {
    spread.map_or_else(|| "shows nothing".to_owned(), |spread| format!("{name} {}{unit}", between(spread, format)))
}

fn between(Spread { p10, median, p90 }: Spread, format: Format) -> String {
    let [low, middle, high] = [p10, median, p90].map(|value| format.text(Some(value)));
    format!("{middle} ({low} to {high})")
}

fn figures(report: &Report) -> Table {
    let solvers = Table::of("", &report.solvers).column("solver", TEXT, |solver| solver.solver.as_str());
    let with = |table: Rows<_>, (name, format, of): Column| {
        let head = if format.unit.is_empty() { name.to_owned() } else { format!("{name}, {}", format.unit) };
        table.column(head, TEXT, move |solver: &&SolverReport| {
            of(solver).map_or_else(|| "-".to_owned(), |spread| between(spread, format))
        })
    };
    COLUMNS
        .into_iter()
        .fold(solvers, with)
        .note(
            "The median over all places, and what a tenth of them is below and above. Error: of contacts, as in the maps. Amplitude response: 1 is right. \
             Position error: how much nearer to the middle the image is than the press; 0 is right. Resolution: the root of the share of the surface that is at \
             a quarter of the image's highest value or above; small is sharp. Shape deformation: the share of that part that is outside of a disc; 0 is round. \
             Ringing: what is below zero, over what the disc holds; 0 is none. Of solvers without an image the contacts are drawn as discs.",
        )
        .into()
}

/// The same as numbers.
fn data(report: &Report) -> Table {
    let solvers = Table::of("", &report.solvers).column("solver", TEXT, |solver| solver.solver.as_str());
    let with = |table: Rows<_>, (name, format, of): Column| {
        let value = |of_spread: fn(Spread) -> f64| move |solver: &&SolverReport| of(solver).map(of_spread);
        table
            .column(name, format, value(|spread| spread.median))
            .column(format!("{name} p10"), format, value(|spread| spread.p10))
            .column(format!("{name} p90"), format, value(|spread| spread.p90))
    };
    COLUMNS.into_iter().fold(solvers, with).data().into()
}

fn method(report: &Report) -> String {
    let places = report.solvers.first().map_or(0, |solver| solver.places.len());
    format!(
        "{places} places, each pressed once by {} sheet conductances over a radius of {:.2} mm; each a cold start of one frame. \
         Readings are simulated on a finer model than any that is inverted, with the converter's noise and steps, less a baseline; seed {}. The figures \
         are those of A. Adler et al., \"GREIT: a unified approach to 2D linear EIT reconstruction of lung images\", Physiological Measurement 30 (2009) \
         S35. `--json` has every place.",
        report.sheets,
        1e3 * report.radius_m,
        report.seed
    )
}
