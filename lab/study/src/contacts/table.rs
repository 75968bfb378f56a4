//! The report as a table.

use std::fmt::Write;

use super::judge::TrueContact;
use super::rows::{ContactFigures, Quantiles, Row, SceneFigures};
use super::{Report, Trial};
use tactomo_touch::solve::FoundContact;

/// Lines for a terminal: a class each, then the worst scenes.
pub fn table(report: &Report) -> String {
    let mut lines = vec![
        format!(
            "{} on {}; {} scenes, seed {}{}, judged at frame {}",
            report.solver,
            report.detectors.join(", "),
            report.scenes,
            report.seed,
            report.as_built.map_or_else(String::new, |seed| format!(", as built with seed {seed}")),
            report.frames
        ),
        format!(
            "{:<20} {:>6} {:>6} {:>6} {:>6} {:>15} {:>15} | {:>7} {:>6} {:>13} {:>13} {:>9} {:>9}",
            "",
            "scenes",
            "count",
            "right",
            "misfit",
            "cold ms, p95",
            "next us, p95",
            "visible",
            "found",
            "error mm, p90",
            "/ bound, p90",
            "xy 1s, 2s",
            "ln C"
        ),
    ];
    lines.extend(report.rows.iter().map(line));
    lines.push(
        "count: as many found as are there; right: all visible found and none invented; visible: the bound on ln C is below 0.2; \
         xy, ln C: within 1 and 2 claimed standard errors. Shares in per cent."
            .to_owned(),
    );
    if report.threads > 1 {
        lines.push(format!(
            "Times are too long: {} scenes were tried at a time, which share caches and cores.",
            report.threads
        ));
    }
    lines.extend(report.worst.iter().map(worst));
    lines.join("\n")
}

fn line(row: &Row) -> String {
    let scenes = row.scenes.as_ref().map_or_else(|| " ".repeat(59), of_scenes);
    format!("{:<20} {scenes} | {}", row.class, of_contacts(&row.contacts)).trim_end().to_owned()
}

fn of_scenes(figures: &SceneFigures) -> String {
    let [count, right, misfit] = [figures.count_right, figures.all_found, figures.misfit].map(percent);
    let cold_ms = [figures.cold_us.median, figures.cold_us.high].map(|us| 1e-3 * us);
    format!(
        "{:>6} {count:>6} {right:>6} {misfit:>6} {:>7.1} {:>7.1} {:>7.0} {:>7.0}",
        figures.scenes, cold_ms[0], cold_ms[1], figures.next_us.median, figures.next_us.high
    )
}

fn of_contacts(figures: &ContactFigures) -> String {
    let pair = |pair: Option<Quantiles>, factor: f64, digits: usize| match pair {
        Some(pair) => format!("{:.digits$} {:>6.digits$}", factor * pair.median, factor * pair.high),
        None => "-".to_owned(),
    };
    let within = |shares: Option<[f64; 2]>| shares.map_or("-".to_owned(), |shares| shares.map(percent).join("  "));
    format!(
        "{:>7} {:>6} {:>13} {:>13} {:>9} {:>9}",
        figures.visible,
        figures.found.map_or("-".to_owned(), percent),
        pair(figures.error_m, 1e3, 3),
        pair(figures.over_bound, 1.0, 2),
        within(figures.place_within),
        within(figures.conductance_within)
    )
}

fn percent(share: f64) -> String {
    format!("{:.0}", 100.0 * share)
}

/// A scene with what was found of each contact, lengths in mm; contacts as `--contact` takes them.
fn worst(trial: &Trial) -> String {
    let judged = &trial.judged;
    let residual = judged.residual.map_or("-".to_owned(), |residual| format!("{residual:.2}"));
    let mut text = format!(
        "\nscene {} on {}: {} there, {} visible, {} found, {} invented; residual {residual}{}\n  {}",
        trial.scene,
        trial.detector,
        judged.truth.len(),
        judged.visible().count(),
        judged.found.len(),
        judged.invented.len(),
        if judged.misfit { ", misfit" } else { "" },
        judged.choice.as_deref().unwrap_or("")
    );
    for contact in &judged.truth {
        let found = contact.found.map(|found| of_found(&judged.found[found.index]));
        // Writing to a string cannot fail.
        let _ = write!(text, "\n  {} -> {}", of_truth(contact), found.as_deref().unwrap_or("missed"));
        if let Some(found) = contact.found {
            let ratio = found.over_bound.map_or("-".to_owned(), |ratio| format!("{ratio:.1}"));
            let _ = write!(text, "  {:.2} mm off, {ratio} bounds", 1e3 * found.error_m);
        }
    }
    for index in &judged.invented {
        let _ = write!(text, "\n  {:<61} -> {}", "nothing", of_found(&judged.found[*index]));
    }
    text
}

fn of_truth(truth: &TrueContact) -> String {
    let contact = &truth.contact;
    let text = format!(
        "{:.2},{:.2},{:.2},{:.3e}",
        1e3 * contact.x_m,
        1e3 * contact.y_m,
        1e3 * contact.radius_m,
        contact.conductance_s
    );
    let bound = match truth.bound {
        Some(bound) => format!("bound {:.3} mm, ln C {:.3}", 1e3 * bound.position_m, bound.conductance),
        None => "no bound".to_owned(),
    };
    format!("{text:<29} {bound:<31}")
}

fn of_found(found: &FoundContact) -> String {
    let radius = found.radius_m.map_or("-".to_owned(), |radius_m| format!("{:.2}", 1e3 * radius_m));
    let mut text = format!("{:.2},{:.2},{radius},{:.3e}", 1e3 * found.x_m, 1e3 * found.y_m, found.conductance_s);
    if let Some(errors) = found.uncertainty {
        let relative = errors.conductance_s / found.conductance_s;
        let _ = write!(text, " +- {:.3},{:.3}, ln C {relative:.3}", 1e3 * errors.x_m, 1e3 * errors.y_m);
    }
    text
}
