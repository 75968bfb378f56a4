//! What the report shows.

use super::judge::TrueContact;
use super::rows::{ContactFigures, Quantiles, Row, SceneFigures};
use super::{Report, Trial};
use crate::view::{Cell, Format, MM, PERCENT, PLAIN, TEXT, Table, US, Value, View};
use tactomo_touch::solve::FoundContact;

const MILLISECONDS: Format = Format { factor: 1e-3, ..Format::new("ms", "us").digits(1) };

/// A row for each case and solver, or for each class where there is one case; then what is claimed, and the worst scenes.
pub fn view(report: &Report) -> View {
    let of_scenes = |value: fn(&SceneFigures) -> Option<f64>| {
        move |row: &&Row| match row.scenes.as_ref().and_then(value) {
            Some(value) => Value::Number(value),
            None => Value::Text(String::new()),
        }
    };
    let of = |value: fn(&ContactFigures) -> Option<f64>| move |row: &&Row| value(&row.contacts);
    let high = |pair: Option<Quantiles>| pair.map(|pair| pair.high);
    let median = |pair: Option<Quantiles>| pair.map(|pair| pair.median);
    let (whole, two) = (PLAIN.digits(0), PLAIN.digits(2));
    let title = format!(
        "{}: {} scenes of each case, seed {}, judged at frame {}",
        report.solvers.join(", "),
        report.scenes,
        report.seed,
        report.frames
    );
    let is_shown = |row: &&Row| report.cases.len() == 1 || row.class == "all";
    let table = Table::of("", report.rows.iter().filter(is_shown))
        .column("case", TEXT, |row| row.case.clone())
        .column("solver", TEXT, |row| row.solver.clone())
        .column("", TEXT, |row| row.class)
        .column("scenes", whole, of_scenes(|scenes| Some(scenes.scenes as f64)))
        .column("count", PERCENT, of_scenes(|scenes| Some(scenes.count_right)))
        .column("right", PERCENT, of_scenes(|scenes| Some(scenes.all_found)))
        .column("search", PERCENT, of_scenes(|scenes| Some(scenes.search)))
        .column("misfit", PERCENT, of_scenes(|scenes| Some(scenes.misfit)))
        .column("warned", PERCENT, of_scenes(|scenes| scenes.warned))
        .column("cold", MILLISECONDS, of_scenes(|scenes| Some(scenes.cold_us.median)))
        .column("p95", MILLISECONDS, of_scenes(|scenes| Some(scenes.cold_us.high)))
        .column("next", US.digits(0), of_scenes(|scenes| Some(scenes.next_us.median)))
        .column("p95", US.digits(0), of_scenes(|scenes| Some(scenes.next_us.high)))
        .column("over tikhonov", two, of_scenes(|scenes| Some(scenes.over_tikhonov[0])))
        .column("next", two, of_scenes(|scenes| Some(scenes.over_tikhonov[1])))
        .column("visible", whole, |row| row.contacts.visible)
        .column("found", PERCENT, of(|contacts| contacts.found))
        .column("error", MM.digits(3), move |row| median(row.contacts.error_m))
        .column("p90", MM.digits(3), move |row| high(row.contacts.error_m))
        .column("over bound", two, move |row| median(row.contacts.over_bound))
        .column("p90", two, move |row| high(row.contacts.over_bound))
        .column("xy, 1 s", PERCENT, of(|contacts| contacts.place_within.map(|[one, _]| one)))
        .column("2 s", PERCENT, of(|contacts| contacts.place_within.map(|[_, two]| two)))
        .column("ln C, 1 s", PERCENT, of(|contacts| contacts.conductance_within.map(|[one, _]| one)))
        .column("2 s", PERCENT, of(|contacts| contacts.conductance_within.map(|[_, two]| two)))
        .note(
            "count: as many found as are there; right: all visible found and none invented, and of the kind that touches; search: wrong though what touches explains the \
             readings better by a nat and more, by the solver's own evidence; warned: of those that are wrong, \
             flagged or with the right number as alternative; cold, next: time of the first frame and of later ones, over tikhonov: in that solver's on the \
             same frames; visible: the bound on ln C is below 0.2; xy, ln C: within 1 and 2 claimed standard errors",
        )
        .data();
    let claims = Table::of("What is claimed of the count", &report.claims)
        .column("case", TEXT, |claims| claims.case.clone())
        .column("solver", TEXT, |claims| claims.solver.clone())
        .column("claimed", TEXT, |claims| match claims.least {
            Some(least) => format!("{:.0} % or more", 100.0 * least),
            None => "nothing".to_owned(),
        })
        .column("scenes", whole, |claims| claims.scenes)
        .column("mean claim", PERCENT, |claims| claims.claimed)
        .column("right", PERCENT, |claims| claims.right)
        .note("right: as many found as are there, but for invisible ones");
    let view = View::new(title, "").with(table).with(claims);
    let view = match report.threads {
        ..=1 => view,
        threads => view
            .text(format!("Times are too long: {threads} scenes were tried at a time, which share caches and cores.")),
    };
    report.worst.iter().fold(view, |view, trial| view.with(worst(trial)))
}

/// A scene with what was found of each contact, lengths in mm; contacts as `--contact` takes them.
fn worst(trial: &Trial) -> Table {
    let judged = &trial.judged;
    let title = format!(
        "{}, {}, scene {} on {}: {} there, {} visible, {} found, {} invented; residual {}{}{}",
        trial.solver,
        trial.case,
        trial.scene,
        trial.detector,
        judged.truth.len(),
        judged.visible().count(),
        judged.found.len(),
        judged.invented.len(),
        PLAIN.digits(2).text(judged.residual),
        if judged.misfit { ", misfit" } else { "" },
        match trial.behind_nats {
            Some(nats) => format!("; what is there explains {nats:.1} nats more"),
            None => String::new(),
        }
    );
    let there = judged.truth.iter().map(|truth| (Some(truth), truth.found.map(|found| &judged.found[found.index])));
    let invented = judged.invented.iter().map(|index| (None, Some(&judged.found[*index])));
    type Pair<'a> = (Option<&'a TrueContact>, Option<&'a FoundContact>);
    let of = |value: fn(&TrueContact) -> Option<f64>| {
        move |(truth, _): &Pair| Cell { value: truth.and_then(value).into(), ..Cell::default() }
    };
    Table::of(title, there.chain(invented))
        .column("there", TEXT, |(truth, _)| truth.map_or("nothing".to_owned(), of_truth))
        .cells("bound", MM.digits(3), of(|truth| truth.bound.map(|bound| bound.position_m)))
        .cells("ln C", PLAIN.digits(3), of(|truth| truth.bound.map(|bound| bound.conductance)))
        .column("found", TEXT, |(_, found)| found.map_or("missed".to_owned(), of_found))
        .cells("off", MM.digits(2), of(|truth| truth.found.map(|found| found.error_m)))
        .cells("in bounds", PLAIN.digits(1), of(|truth| truth.found.and_then(|found| found.over_bound)))
        .note(judged.choice.as_deref().unwrap_or_default())
        .into()
}

fn of_truth(truth: &TrueContact) -> String {
    let contact = &truth.contact;
    let [x, y, radius] = [contact.x_m, contact.y_m, contact.radius_m].map(|metres| 1e3 * metres);
    format!("{x:.2},{y:.2},{radius:.2},{:.3e}", contact.conductance_s)
}

fn of_found(found: &FoundContact) -> String {
    let radius = MM.digits(2).text(found.radius_m);
    let text = format!("{:.2},{:.2},{radius},{:.3e}", 1e3 * found.x_m, 1e3 * found.y_m, found.conductance_s);
    found.uncertainty.map_or(text.clone(), |errors| {
        let relative = errors.conductance_s / found.conductance_s;
        format!("{text} +- {:.3},{:.3}, ln C {relative:.3}", 1e3 * errors.x_m, 1e3 * errors.y_m)
    })
}
