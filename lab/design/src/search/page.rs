//! The answer as a page.

use tactomo_study::Machine;
use tactomo_study::page::{Axis, Chart, Mark, Series, Unit, escaped, html, machine, table};

use super::table::{advice, gives, of_compared, reached};
use super::{Answer, Rating, Wish};

/// Errors below this show there (m).
const FLOOR_M: f64 = 1e-6;

/// A self-contained HTML page: what to order, and the front of what can be had.
pub fn page(answer: &Answer, command: &str) -> String {
    let wishes = &answer.wishes;
    let wanted: Vec<String> = Wish::ALL
        .into_iter()
        .map(|wish| match wish {
            Wish::Frames => wish.text(wishes.wanted(wish)),
            _ => format!("{} {}", wish.name(), wish.text(wishes.wanted(wish))),
        })
        .collect();
    let [width_mm, height_mm] = wishes.size_m.map(|side_m| side_m * 1e3);
    let mut parts = vec![
        "<h1>Which detector to order</h1>".to_owned(),
        format!(
            "<p class=\"lead-in\">Wanted: {width_mm} x {height_mm} mm, {}, at most {} electrodes. {} of {} candidates were tried, {} of them meet all wishes.</p>",
            wanted.join(", "),
            wishes.electrodes,
            answer.tried,
            answer.candidates,
            answer.meeting
        ),
    ];
    if answer.is_stopped {
        parts.push("<p><b>Stopped before the end</b>: the answer is of what was tried.</p>".to_owned());
    }
    parts.extend(advice(answer).iter().map(|line| format!("<p><b>{}</b></p>", escaped(line))));
    parts.push(choices(answer));
    if let Some(compared) = &answer.compared {
        parts.push(format!("<p>{}.</p>", escaped(&of_compared(compared, answer.tried))));
    }
    let charts = [
        chart(answer, Wish::Place, "time of a frame", |rating| 1.0 / rating.frames_per_s, Unit::Seconds),
        chart(answer, Wish::TwoPoints, "error of places", |rating| rating.place_m.unwrap_or(f64::NAN), Unit::Metres),
        chart(
            answer,
            Wish::Place,
            "1 / force at saturation, 1/N",
            |rating| rating.largest_n.map_or(f64::NAN, |largest_n| 1.0 / largest_n),
            Unit::Plain,
        ),
    ];
    let charts: String = charts.iter().map(|chart| chart.svg() + "\n").collect();
    parts.push(format!(
        "<h2>What can be had</h2><p class=\"quiet\">Every candidate that was tried; numbers are the choices above. Left and down is better; the dashed line joins those that no other beats in \
         both.</p><div class=\"charts\">{charts}</div>"
    ));
    parts.push(format!(
        "<h2>How it was found</h2><p class=\"note\">Places and two points are Cramer and Rao's bounds of one frame for a ball of {} mm pressed with {} N; forces run from three standard errors of \
         noise to nine tenths of the drive, Hertz on the foams' elasticities, without the mesh that a press must bend first. Frames a second are an ESP32's at 921 600 baud. In {:.1} s.</p>{}",
        2e3 * wishes.tip_m,
        super::super::text::number(Some((wishes.smallest_n * wishes.largest_n).sqrt()), 1.0),
        answer.seconds,
        machine(&Machine::this(), command)
    ));
    html("Tactomo: which detector to order", &parts)
}

fn choices(answer: &Answer) -> String {
    let row = |(index, choice): (usize, &super::Choice)| {
        vec![
            format!("{}. {}", index + 1, choice.name),
            choice.reason.clone(),
            gives(&choice.rating),
            reached(&choice.reached),
            reached(&choice.as_built),
        ]
    };
    let rows: Vec<_> = answer.choices.iter().enumerate().map(row).collect();
    let heads = ["detector", "why", "what it gives", "auto", "as built, tolerances ignored"];
    table(&heads, &rows).replace("<table>", "<table class=\"claims\">")
}

fn chart(answer: &Answer, wish: Wish, x_title: &str, x: fn(&Rating) -> f64, x_unit: Unit) -> Chart {
    let y = |rating: &Rating| rating.given(wish).unwrap_or(f64::NAN);
    let mark = |rating: &Rating| {
        let mark = Mark { x: x(rating), y: y(rating), tooltip: gives(rating) };
        (mark.x.is_finite() && mark.y.is_finite()).then_some(mark)
    };
    let all: Vec<Mark> = answer.all.iter().filter_map(mark).collect();
    let (xs, ys) =
        (all.iter().map(|mark| mark.x).collect::<Vec<_>>(), all.iter().map(|mark| mark.y).collect::<Vec<_>>());
    let tried = Series { name: String::new(), class: "bound", main: all.len(), marks: all, is_joined: false };
    let chosen = answer.choices.iter().enumerate().filter_map(|(index, choice)| {
        let marks = vec![mark(&choice.rating)?];
        Some(Series { name: (index + 1).to_string(), class: "auto", marks, main: 0, is_joined: false })
    });
    let compared = answer.compared.iter().filter_map(|compared| {
        let marks = vec![mark(&compared.rating)?];
        Some(Series { name: compared.name.clone(), class: "paper", marks, main: 0, is_joined: false })
    });
    Chart {
        title: wish.name().to_owned(),
        subtitle: format!("{x_title} to the right"),
        x: Axis::over(x_title, x_unit, xs, FLOOR_M, 0.6),
        y: Axis::over("", Unit::Metres, ys, FLOOR_M, 0.6),
        series: std::iter::once(tried).chain(chosen).chain(compared).collect(),
        has_front: true,
        guide: None,
        level: None,
        size: [430.0, 380.0],
    }
}
