//! What the answer shows.

use tactomo_physics::detector::short;
use tactomo_study::view::{Axis, Chart, MM, PLAIN, Series, Style, TEXT, Table, Unit, View};

use super::super::Reached;
use super::{Answer, Choice, Compared, Rating, Unmet, Wish};

/// What to order, and the front of what can be had.
pub fn view(answer: &Answer) -> View {
    let wishes = &answer.wishes;
    let wanted = |wish: Wish| match wish {
        Wish::Frames => wish.text(wishes.wanted(wish)),
        _ => format!("{} {}", wish.name(), wish.text(wishes.wanted(wish))),
    };
    let [width_mm, height_mm] = wishes.size_m.map(|side_m| short(side_m * 1e3));
    let tried = format!(
        "Wanted: {width_mm} x {height_mm} mm, {}, at most {} electrodes. {} of {} candidates were tried, {} of them meet all wishes.",
        Wish::ALL.map(wanted).join(", "),
        wishes.electrodes,
        answer.tried,
        answer.candidates,
        answer.meeting
    );
    let had = "Every candidate that was tried; numbers are the choices above. Left and down is better; the dashed line joins those that no other beats \
               in both.";
    let charts = [
        chart(answer, Wish::Place, ("time of a frame", Unit::Seconds), |rating| Some(1.0 / rating.frames_per_s)),
        chart(answer, Wish::TwoPoints, ("error of places", Unit::Metres), |rating| rating.place_m),
        chart(answer, Wish::Place, ("1 / force at saturation, 1/N", Unit::Plain), |rating| {
            Some(1.0 / rating.largest_n?)
        }),
    ];
    let mut view = View::new("Which detector to order", "").text(tried);
    if answer.is_stopped {
        view = view.text("**Stopped before the end**: the answer is of what was tried.");
    }
    view = advice(answer).into_iter().fold(view, |view, line| view.text(format!("**{line}**"))).with(choices(answer));
    if let Some(compared) = &answer.compared {
        view = view.text(of_compared(compared, answer.tried));
    }
    let method = format!(
        "Places and two points are Cramer and Rao's bounds of one frame for a ball of {} mm pressed with {} N; forces run from three standard errors of \
         noise to nine tenths of the drive, Hertz on the foams' elasticities, without the mesh that a press must bend first. Frames a second are an \
         ESP32's at 921 600 baud. In {:.1} s.",
        2e3 * wishes.tip_m,
        PLAIN.text(Some((wishes.smallest_n * wishes.largest_n).sqrt())),
        answer.seconds
    );
    View { method, ..view.heading("What can be had").figures(had, charts) }
}

fn choices(answer: &Answer) -> Table {
    let auto = |choice: &Choice| reached(&choice.reached);
    Table::of("", answer.choices.iter().enumerate())
        .column("detector", TEXT, |(index, choice)| format!("{}. {}", index + 1, choice.name))
        .column("why", TEXT, |(_, choice)| choice.reason.as_str())
        .column("gives", TEXT, |(_, choice)| gives(&choice.rating))
        .column("places by auto, one frame", TEXT, |(_, choice)| auto(choice))
        .column("as built, not calibrated and tolerances ignored", TEXT, |(_, choice)| reached(&choice.as_built))
        .style(Style::Prose)
        .into()
}

/// What is impossible, and what to relax.
fn advice(answer: &Answer) -> Vec<String> {
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

fn gives(rating: &Rating) -> String {
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
        super::space::plain(rating.thickness_m * 1e3),
        rating.drive_v
    )
}

fn reached(reached: &Reached) -> String {
    let found = if reached.found < 1.0 { format!(" ({:.0} % found)", 100.0 * reached.found) } else { String::new() };
    format!("{} mm{found}", MM.text(reached.place_m))
}

fn of_compared(compared: &Compared, tried: usize) -> String {
    format!(
        "{}: {}; {}. {} of the {tried} candidates meet the wishes better, {} are nowhere worse",
        compared.name,
        if compared.meets_all { "meets all wishes" } else { "does not meet all wishes" },
        gives(&compared.rating),
        compared.better,
        compared.beaten_by
    )
}

fn chart(answer: &Answer, wish: Wish, (title, unit): (&str, Unit), x: fn(&Rating) -> Option<f64>) -> Chart {
    let point = |rating: &Rating| (x(rating).unwrap_or(f64::NAN), rating.given(wish));
    let tried = Series::dots("", "bound", answer.all.iter().map(point)).unlabelled();
    let chosen = answer
        .choices
        .iter()
        .enumerate()
        .map(|(index, choice)| Series::dots((index + 1).to_string(), "auto", [point(&choice.rating)]));
    let compared =
        answer.compared.iter().map(|compared| Series::dots(compared.name.as_str(), "paper", [point(&compared.rating)]));
    let axes = [Axis::log(title, unit).decades(0.6), Axis::log("", Unit::Metres).decades(0.6)];
    let series = std::iter::once(tried).chain(chosen).chain(compared);
    Chart { has_front: true, ..Chart::new(wish.name(), format!("{title} to the right"), axes, series) }
}
