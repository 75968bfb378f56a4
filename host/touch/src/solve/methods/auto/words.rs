//! What was chosen, in words.

use super::Rival;
use crate::solve::answer::{Alternative, Calibrated, Choice, FoundShape, Solution};

/// The solution of contacts, and what it is; there may be a shape in place of them.
pub(super) fn as_contacts(solution: Solution, rival: Option<Rival>, search: bool) -> Solution {
    if solution.contacts.is_empty() {
        return nothing(solution, search);
    }
    let found = solution.contacts.len();
    let what =
        either(found, solution.alternative) + &rival.map(|rival| format!(" or a {}", rival.name)).unwrap_or_default();
    let others = [
        solution.alternative.map(|other| (other.contacts.to_string(), other.certainty)),
        rival.map(|rival| (format!("a {}", rival.name), rival.share)),
    ];
    let sure = solution.certainty.map(|certainty| sure(&found.to_string(), certainty, others));
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
    let name = solution.shape.as_ref().map_or("image", FoundShape::name);
    let what = match solution.alternative {
        Some(Alternative { contacts, .. }) => format!("{name} or {}", counted(contacts)),
        None => name.to_owned(),
    };
    let other = solution.alternative.map(|other| (counted(other.contacts), other.certainty));
    let sure = solution.certainty.map(|certainty| sure(&format!("a {name}"), certainty, [other, None]));
    let figures = solution.shape.as_ref().map(|shape| format!("{}; ", figures(shape))).unwrap_or_default();
    let why = format!("{}; {figures}{why}{}", left(&solution), sure.unwrap_or_default());
    chosen(solution, what, why)
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

/// How sure what was found is, and what else it may be.
fn sure(found: &str, certainty: f64, others: [Option<(String, f64)>; 2]) -> String {
    let percent = |share: f64| format!("{:.0} %", 100.0 * share);
    let others = others.into_iter().flatten();
    let others: String = others.map(|(other, share)| format!(", {} of {other}", percent(share))).collect();
    let of_found = if others.is_empty() { String::new() } else { format!(" of {found}") };
    format!("; {} sure{of_found}{others}", percent(certainty))
}

fn counted(contacts: usize) -> String {
    if contacts == 1 { "1 contact".to_owned() } else { format!("{contacts} contacts") }
}
