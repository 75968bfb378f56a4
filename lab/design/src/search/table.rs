//! The answer as text.

use std::fmt::Write;

use super::super::Reached;
use super::super::text::number;
use super::{Answer, Compared, Rating, Unmet, Wish};

/// What was found, for a terminal.
pub fn table(answer: &Answer) -> String {
    let mut text = format!(
        "{} of {} candidates tried in {:.0} s{}; {} meet all wishes\n\n",
        answer.tried,
        answer.candidates,
        answer.seconds,
        if answer.is_stopped { ", stopped before the end" } else { "" },
        answer.meeting
    );
    for line in advice(answer) {
        _ = writeln!(text, "{line}");
    }
    for (index, choice) in answer.choices.iter().enumerate() {
        _ = writeln!(text, "{}. {}\n   {}\n   {}", index + 1, choice.name, choice.reason, gives(&choice.rating));
        _ = writeln!(
            text,
            "   places by auto, one frame: {}; as built, not calibrated and tolerances ignored: {}",
            reached(&choice.reached),
            reached(&choice.as_built)
        );
    }
    if let Some(compared) = &answer.compared {
        _ = writeln!(text, "\n{}", of_compared(compared, answer.tried));
    }
    text
}

/// What is impossible, and what to relax.
pub(super) fn advice(answer: &Answer) -> Vec<String> {
    let impossible = answer.impossible.iter().map(|unmet| format!("impossible with these foams: {}", of_unmet(unmet)));
    let nothing = answer.meeting == 0 && answer.impossible.is_empty() && answer.relax.is_empty();
    let relax =
        answer.relax.iter().map(|unmet| format!("with all other wishes kept, {}: relax that one", of_unmet(unmet)));
    let several = nothing.then(|| {
        "no candidate meets all wishes, nor all but one: relax two of those that the choices below miss".to_owned()
    });
    impossible.chain(relax).chain(several).collect()
}

fn of_unmet(unmet: &Unmet) -> String {
    format!(
        "{} is at best {}, where {} is wanted (by {})",
        unmet.wish.name(),
        unmet.wish.text(unmet.best),
        unmet.wish.text(unmet.wanted),
        unmet.by
    )
}

pub(super) fn gives(rating: &Rating) -> String {
    let given = |wish: Wish| match rating.given(wish) {
        Some(given) if given.is_finite() => wish.text(given),
        Some(_) => "any".to_owned(),
        None => "not told".to_owned(),
    };
    format!(
        "{} to {}; places to {}; two points {}; {}; {} electrodes; {} mm thick; {} V",
        given(Wish::Smallest),
        given(Wish::Largest),
        given(Wish::Place),
        given(Wish::TwoPoints),
        given(Wish::Frames),
        rating.electrodes,
        super::super::text::plain(rating.thickness_m * 1e3),
        rating.drive_v
    )
}

pub(super) fn reached(reached: &Reached) -> String {
    let found = if reached.found < 1.0 { format!(" ({:.0} % found)", 100.0 * reached.found) } else { String::new() };
    format!("{} mm{found}", number(reached.place_m, 1e3))
}

pub(super) fn of_compared(compared: &Compared, tried: usize) -> String {
    format!(
        "{}: {}; {}. {} of the {tried} candidates meet the wishes better, {} are nowhere worse",
        compared.name,
        if compared.meets_all { "meets all wishes" } else { "does not meet all wishes" },
        gives(&compared.rating),
        compared.better,
        compared.beaten_by
    )
}
