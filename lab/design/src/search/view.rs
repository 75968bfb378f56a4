//! What the answer shows.

use tactomo_physics::detector::short;
use tactomo_study::view::{Axis, Chart, MM, PLAIN, Series, Style, TEXT, Table, Unit, View};

use super::{Answer, Choice, Compared, Costliest, Rating, Unmet, Wish, Wishes};

/// Candidates that miss a wish by more than this factor are in no chart.
const FAR: f64 = 5.0;

/// What to order, and the front of what can be had.
pub fn view(answer: &Answer) -> View {
    let wishes = &answer.wishes;
    let wanted = |wish: Wish| match wish {
        Wish::Frames => wish.wished(wishes.wanted(wish)),
        _ => format!("{} {}", wish.name(), wish.wished(wishes.wanted(wish))),
    };
    let [width_mm, height_mm] = wishes.size_m.map(|side_m| short(side_m * 1e3));
    let tried = format!(
        "Wanted: {width_mm} x {height_mm} mm, {}, at most {} electrodes, read by the board {}. {} of {} candidates were tried; {} of the {} best meet all wishes as \
         built.",
        Wish::ALL.map(wanted).join(", "),
        wishes.electrodes,
        wishes.board.name,
        answer.tried,
        answer.candidates,
        answer.meeting,
        answer.rated
    );
    let had = "Every candidate that was rated as built and comes within a factor of five; numbers are the choices above. Left and down is better; the dashed line joins those that no other beats \
               in both.";
    let charts = [
        chart(answer, Wish::Place, ("time of a frame", Unit::Seconds), Wish::Frames, |frames_per_s| 1.0 / frames_per_s),
        chart(answer, Wish::TwoPoints, ("error of places", Unit::Metres), Wish::Place, |place_m| place_m),
        chart(answer, Wish::Place, ("1 / force at saturation, 1/N", Unit::Plain), Wish::Largest, |largest_n| {
            1.0 / largest_n
        }),
    ];
    let mut view = View::new("Which detector to order", "").text(tried);
    if answer.is_stopped {
        view = view.text("**Stopped before the end**: the answer is of what was tried.");
    }
    view = advice(answer).into_iter().fold(view, |view, line| view.text(format!("**{line}**"))).with(choices(answer));
    if let Some(compared) = &answer.compared {
        view = view.text(of_compared(compared, answer.rated));
    }
    if let Some(lightest) = lightest(answer) {
        view = view.text(lightest);
    }
    let method = format!(
        "Places are the error that half of presses have less than, by Cramer and Rao's bounds of one frame for a ball of {} mm pressed with {} N, with the board's \
         noise and floor and the detector's tolerances, without calibration; two points likewise: what noise allows, which auto does not reach; forces run from \
         the lightest that auto finds to nine tenths of the drive, by the measured law of \
         contact. In {:.1} s.",
        2e3 * wishes.tip_m,
        PLAIN.text(Some(wishes.middle_n())),
        answer.seconds
    );
    View { method, ..view.heading("What can be had").figures(had, charts) }
}

fn choices(answer: &Answer) -> Table {
    Table::of("", answer.choices.iter().enumerate())
        .column("detector", TEXT, |(index, choice)| format!("{}. {}", index + 1, choice.name))
        .column("why", TEXT, |(_, choice)| choice.reason.as_str())
        .column("gives", TEXT, |(_, choice)| gives(&choice.rating))
        .column("places by auto on one as built", MM, |(_, choice)| choice.place_found_m)
        .style(Style::Prose)
        .into()
}

/// What is impossible, and what to relax.
fn advice(answer: &Answer) -> Vec<String> {
    let impossible = answer.impossible.iter().map(|unmet| format!("impossible with these foams: {}", of_unmet(unmet)));
    let relax =
        answer.relax.iter().map(|unmet| format!("with all other wishes kept, {}: relax that one", of_unmet(unmet)));
    let nearest = (answer.meeting == 0)
        .then(|| format!("of the {} rated as built none meets all wishes: choice 1 is the nearest", answer.rated));
    let misses_light = |choice: &Choice| choice.rating.margin(Wish::Smallest, &answer.wishes) < 0.0;
    let floor = (answer.wishes.board.has_floor() && answer.choices.first().is_some_and(misses_light)).then(|| {
        format!(
            "the floor of the converters of {} hides light presses: lift its ground and say so, --ground 0.25, or take a board without a floor",
            answer.wishes.board.name
        )
    });
    impossible.chain(nearest).chain(relax).chain(answer.costliest.as_ref().map(of_costliest)).chain(floor).collect()
}

/// The smallest force that the board sees, on the choices' best and on the detector that is compared.
fn lightest(answer: &Answer) -> Option<String> {
    let Wishes { board, tip_m, .. } = &answer.wishes;
    let best = answer.choices.first().map(|choice| ("choice 1", &choice.rating));
    let compared = answer.compared.as_ref().map(|compared| (compared.name.as_str(), &compared.rating));
    let seen = |(name, rating): (&str, &Rating)| {
        Some(format!("{} N on {name}", PLAIN.text(Some(rating.smallest_n.filter(|force_n| force_n.is_finite())?))))
    };
    let seen: Vec<String> = best.into_iter().chain(compared).filter_map(seen).collect();
    let hides = match board.floor_v() {
        floor_v if floor_v > 0.0 => format!("the floor of its converters ({floor_v:.2} V), or of noise"),
        _ => "noise".to_owned(),
    };
    (!seen.is_empty()).then(|| {
        format!(
            "The smallest force that the board {} sees, of a ball of {} mm: {}. What presses more lightly does not rise out of {hides}.",
            board.name,
            2e3 * tip_m,
            seen.join(", ")
        )
    })
}

fn of_costliest(costliest: &Costliest) -> String {
    let Costliest { wish, wanted, by, given, others_missed } = costliest;
    let given = given.map_or_else(|| "tells nothing of it".to_owned(), |given| format!("gives {}", wish.text(given)));
    format!(
        "the wish that costs most is {} {}: without it, all others would be missed by a factor of {others_missed:.1} at most (by {by}, which {given})",
        wish.name(),
        wish.wished(*wanted)
    )
}

fn of_unmet(unmet: &Unmet) -> String {
    format!(
        "{} is at best {}, where {} is wanted (by {})",
        unmet.wish.name(),
        unmet.wish.text(unmet.best),
        unmet.wish.wished(unmet.wanted),
        unmet.by
    )
}

fn gives(rating: &Rating) -> String {
    let given = |before: &str, wish: Wish| match rating.given(wish) {
        Some(given) if given.is_finite() => format!("{before}{}", wish.text(given)),
        Some(_) => format!("{before}any"),
        None => "not told".to_owned(),
    };
    format!(
        "{}{}; places {}; two points {}; {}; {} electrodes; {} mm thick; {} V",
        given("", Wish::Smallest),
        given(" to ", Wish::Largest),
        given("to ", Wish::Place),
        given("at best ", Wish::TwoPoints),
        given("", Wish::Frames),
        rating.electrodes,
        super::space::plain(rating.thickness_m * 1e3),
        rating.drive_v
    )
}

fn of_compared(compared: &Compared, rated: usize) -> String {
    format!(
        "{}: {}; {}. {} of the {rated} best candidates meet the wishes better, {} are nowhere worse",
        compared.name,
        if compared.meets_all { "meets all wishes" } else { "does not meet all wishes" },
        gives(&compared.rating),
        compared.better,
        compared.beaten_by
    )
}

/// A wish upwards over another one to the right, of which `less` makes what is better the less it is.
fn chart(answer: &Answer, wish: Wish, (title, unit): (&str, Unit), other: Wish, less: impl Fn(f64) -> f64) -> Chart {
    let wanted = |wish: Wish| answer.wishes.wanted(wish);
    // What misses by far would only make the axes longer.
    let is_near = |rating: &Rating| Wish::ALL.iter().all(|wish| rating.margin(*wish, &answer.wishes) > -FAR.ln());
    let point = |rating: &Rating| {
        // What nothing saturates has no place on such an axis.
        let x = rating.given(other).map(&less).filter(|x| *x > 0.0);
        (x.unwrap_or(f64::NAN), rating.given(wish).filter(|_| is_near(rating)))
    };
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
    let [guide, level] = [less(wanted(other)), wanted(wish)].map(|value| Some((value, "wanted".to_owned())));
    Chart { has_front: true, guide, level, ..Chart::new(wish.name(), format!("{title} to the right"), axes, series) }
}
