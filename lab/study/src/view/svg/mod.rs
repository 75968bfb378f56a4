//! Figures as SVG.

mod chart;
mod colour;
mod label;
mod map;
mod scale;

use super::figure::{Chart, Map};
use super::html::{STYLE, escaped};

/// Room between texts below an axis (px).
const GAP: f64 = 4.0;

/// A figure as SVG, for a page with the style sheet.
pub(super) fn of_chart(chart: &Chart) -> String {
    chart::Drawing::of(chart).svg()
}

/// A map as SVG, for a page with the style sheet.
pub(super) fn of_map(map: &Map) -> String {
    map::Drawing::of(map).svg()
}

/// A map as an SVG file, which needs nothing else.
pub fn standalone(map: &Map) -> String {
    let style = format!(" xmlns=\"http://www.w3.org/2000/svg\" font-family=\"sans-serif\"><style>{STYLE}</style>");
    of_map(map).replacen('>', &style, 1) + "\n"
}

/// The beginning of a figure: its frame, title and subtitle.
fn opened(class: &str, [width, height]: [f64; 2], title: &str, subtitle: &str) -> String {
    let [title, subtitle] = [title, subtitle].map(escaped);
    format!(
        "<svg class=\"{class}\" viewBox=\"0 0 {width} {height}\" role=\"img\" aria-label=\"{title}\">\n\
         <text class=\"title\" x=\"0\" y=\"15\">{title}</text><text class=\"subtitle\" x=\"0\" y=\"32\">{subtitle}</text>\n"
    )
}

/// A line of text of an axis, anchored at `start`, `middle` or `end`.
fn tick([x, y]: [f64; 2], anchor: &str, text: &str) -> String {
    format!("<text class=\"tick\" x=\"{x:.1}\" y=\"{y:.1}\" text-anchor=\"{anchor}\">{}</text>\n", escaped(text))
}

/// Texts below an axis at a height, where they are to the right, but for those that would run into the one before.
fn ticks_below(ticks: impl IntoIterator<Item = (f64, String)>, y: f64) -> String {
    let (mut svg, mut free_from) = (String::new(), f64::NEG_INFINITY);
    for (x, text) in ticks {
        let half = label::Labels::width(&text).max(40.0) / 2.0;
        if x - half > free_from {
            svg += &tick([x, y], "middle", &text);
            free_from = x + half + GAP;
        }
    }
    svg
}
