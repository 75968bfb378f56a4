//! What was chosen, in words.

use crate::solve::answer::{Alternative, Calibrated, Choice, FoundShape, Solution};

/// The solution of contacts, and what it is.
pub(super) fn as_contacts(solution: Solution, search: bool) -> Solution {
    if solution.contacts.is_empty() {
        return nothing(solution, search);
    }
    let what = either(solution.contacts.len(), solution.alternative);
    let sure = solution.certainty.map(|certainty| sure(solution.contacts.len(), certainty, solution.alternative));
    let left = left(&solution) + &sure.unwrap_or_default() + &calibrate(&solution);
    let why = if search { format!("{left}; searching for a better answer") } else { left };
    chosen(solution, what, why)
}

/// The solution of nothing; unless something stands out, and is searched.
pub(super) fn nothing(mut solution: Solution, search: bool) -> Solution {
    solution.flags.unfinished |= search;
    let (what, why) = match search {
        true => ("searching", "something touches, and it is not known yet what"),
        false => ("nothing", "no reading stands out of the noise"),
    };
    chosen(solution, what.to_owned(), why.to_owned())
}

/// The solution of a shape or an image, and why it is one.
pub(super) fn as_whole(solution: Solution, why: &str) -> Solution {
    let what = solution.shape.as_ref().map_or("image", FoundShape::name);
    let figures = solution.shape.as_ref().map(|shape| format!("{}; ", figures(shape))).unwrap_or_default();
    let why = format!("{}; {figures}{why}", left(&solution));
    chosen(solution, what.to_owned(), why)
}

/// Why contacts are not the answer.
pub(super) fn instead_of(contacts: &Solution) -> String {
    let left = contacts.residual.unwrap_or_default();
    format!("{} would leave {left:.1}", counted(contacts.contacts.len()))
}

/// What a calibration would bring, if one is asked for.
fn calibrate(solution: &Solution) -> String {
    let Some(Calibrated { now_m, calibrated_m }) = solution.calibrated else { return String::new() };
    let [now_mm, calibrated_mm] = [now_m, calibrated_m].map(|metres| 1e3 * metres);
    format!(
        "; the detector differs from its description: calibrate, and places are known to {calibrated_mm:.2} mm instead of {now_mm:.2} mm"
    )
}

fn left(solution: &Solution) -> String {
    format!("residual {:.1} x noise", solution.residual.unwrap_or_default())
}

fn figures(shape: &FoundShape) -> String {
    let mm = |metres: f64| format!("{:.1} mm", 1e3 * metres);
    match shape {
        FoundShape::Line(line) => format!("{} long, {} wide", mm(line.length_m()), mm(line.width_m)),
        FoundShape::Ring(ring) => format!("radius {}, {} wide", mm(ring.radius_m), mm(ring.width_m)),
    }
}

fn chosen(solution: Solution, what: String, why: String) -> Solution {
    Solution { choice: Some(Choice { what, why }), ..solution }
}

/// How many contacts, if it may be another number too.
fn either(found: usize, alternative: Option<Alternative>) -> String {
    let Some(Alternative { contacts: other, .. }) = alternative else { return counted(found) };
    format!("{} or {}", found.min(other), counted(found.max(other)))
}

/// How sure their number is.
fn sure(found: usize, certainty: f64, alternative: Option<Alternative>) -> String {
    let percent = 100.0 * certainty;
    match alternative {
        Some(Alternative { contacts, certainty }) => {
            format!("; {percent:.0} % sure of {found}, {:.0} % of {contacts}", 100.0 * certainty)
        }
        None => format!("; count {percent:.0} % sure"),
    }
}

fn counted(contacts: usize) -> String {
    if contacts == 1 { "1 contact".to_owned() } else { format!("{contacts} contacts") }
}
