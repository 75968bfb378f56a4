//! Three small charts of a sample: output over force, profile of the image, places.

use std::fmt::Write;

use tactomo_physics::geometry::Point;
use tactomo_study::page::{Axis, Unit, escaped};

use super::Sample;

/// Side of a small chart, and room around its plot: left, top, right, bottom (px).
const SIDE: f64 = 200.0;
const ROOM: [f64; 4] = [34.0, 8.0, 12.0, 34.0];
/// Half of the detector's side (m): places are drawn from -1 to 1.
const HALF_M: f64 = 0.030;
/// Points of a fitted curve.
const CURVE_POINTS: usize = 60;

/// Three small charts of a sample.
pub(super) fn card(sample: &Sample) -> String {
    let name = escaped(sample.measured.name);
    let charts = [force_output(sample), profile(sample), places(sample)];
    let charts: String = charts
        .iter()
        .enumerate()
        .map(|(column, chart)| format!("<g transform=\"translate({} 0)\">{chart}</g>", column as f64 * SIDE))
        .collect();
    format!(
        "<section><h4>{name}</h4><svg class=\"chart\" viewBox=\"0 0 {} {SIDE}\" role=\"img\" aria-label=\"{name}: force and output, profile, places\">{charts}</svg></section>",
        3.0 * SIDE,
    )
}

/// A plot between two axes.
struct Plot {
    x: Axis,
    y: Axis,
}

impl Plot {
    /// From end to end of both ranges.
    fn new(title: &str, x: [f64; 2], y: [f64; 2]) -> Self {
        let axis = |range| Axis { title: title.to_owned(), unit: Unit::Plain, range, is_linear: true };
        Self { x: axis(x), y: axis(y) }
    }

    /// A point (px).
    fn at(&self, x: f64, y: f64) -> (f64, f64) {
        let [left, top, right, bottom] = ROOM;
        (left + self.x.share(x) * (SIDE - left - right), SIDE - bottom - self.y.share(y) * (SIDE - top - bottom))
    }

    /// Its frame, ticks with their values, and what is to the right.
    fn frame(&self) -> String {
        let [left, top, right, bottom] = ROOM;
        let (width, height) = (SIDE - left - right, SIDE - top - bottom);
        let mut svg = format!("<rect class=\"grid\" x=\"{left}\" y=\"{top}\" width=\"{width}\" height=\"{height}\"/>");
        for (value, text) in self.x.ticks() {
            let (x, y) = self.at(value, self.y.range[0]);
            _ = write!(
                svg,
                "<path class=\"grid\" d=\"M{x:.1} {y:.1}v4\"/><text class=\"tick\" x=\"{x:.1}\" y=\"{:.1}\" text-anchor=\"middle\">{}</text>",
                y + 15.0,
                escaped(&text)
            );
        }
        for (value, text) in self.y.ticks() {
            let (x, y) = self.at(self.x.range[0], value);
            _ = write!(
                svg,
                "<path class=\"grid\" d=\"M{x:.1} {y:.1}h-4\"/><text class=\"tick\" x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"end\">{}</text>",
                x - 6.0,
                y + 4.0,
                escaped(&text)
            );
        }
        svg + &format!(
            "<text class=\"tick\" x=\"{}\" y=\"{}\" text-anchor=\"end\">{}</text>",
            SIDE - right,
            SIDE - 4.0,
            escaped(&self.x.title)
        )
    }
}

fn force_output(sample: &Sample) -> String {
    let all = || sample.loading.iter().chain(&sample.unloading);
    let largest = all().map(|[_, output]| *output).fold(f64::MIN_POSITIVE, f64::max);
    let most_n = all().map(|[force, _]| *force).fold(f64::MIN_POSITIVE, f64::max);
    let plot = Plot::new("force, N", [0.0, most_n], [0.0, largest]);
    let mut svg = plot.frame();
    for (points, class) in [(&sample.unloading, "ring"), (&sample.loading, "dot")] {
        for [force_n, output] in points {
            let (x, y) = plot.at(*force_n, *output);
            _ = write!(svg, "<circle class=\"{class}\" cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"1.8\"/>");
        }
    }
    if let Some(fit) = &sample.curve {
        let curve = (0..=CURVE_POINTS).map(|index| {
            let force_n = most_n * index as f64 / CURVE_POINTS as f64;
            plot.at(force_n, fit.curve.output(force_n))
        });
        svg += &line(curve);
    }
    format!("<g class=\"contacts\">{svg}</g>")
}

fn profile(sample: &Sample) -> String {
    let half_mm = HALF_M * 1e3;
    let lowest = sample.profile.iter().map(|[_, share]| *share).fold(0.0, f64::min);
    let plot = Plot::new("x, mm", [-half_mm, half_mm], [lowest, 1.0]);
    let points = sample.profile.iter().map(|[x_m, share]| plot.at(x_m * 1e3, *share));
    format!("<g class=\"linear\">{}{}</g>", plot.frame(), line(points))
}

fn places(sample: &Sample) -> String {
    let plot = Plot::new("half widths", [-1.0, 1.0], [-1.0, 1.0]);
    let on_plot = |[x_m, y_m]: Point| plot.at(x_m / HALF_M, y_m / HALF_M);
    let mut svg = plot.frame();
    for [truth_m, found_m] in &sample.places_m {
        let ((x, y), (to_x, to_y)) = (on_plot(*truth_m), on_plot(*found_m));
        _ = write!(
            svg,
            "<path class=\"cross\" d=\"M{:.1} {y:.1}h6M{x:.1} {:.1}v6\"/><path class=\"lead\" d=\"M{x:.1} {y:.1}L{to_x:.1} {to_y:.1}\"/>\
             <circle class=\"dot\" cx=\"{to_x:.1}\" cy=\"{to_y:.1}\" r=\"2.5\"/>",
            x - 3.0,
            y - 3.0
        );
    }
    format!("<g class=\"paper\">{svg}</g>")
}

fn line(points: impl Iterator<Item = (f64, f64)>) -> String {
    let points: Vec<_> = points.map(|(x, y)| format!("{x:.1},{y:.1}")).collect();
    format!("<polyline points=\"{}\"/>", points.join(" "))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_plot_has_ticks_with_values_on_both_axes_and_says_what_is_to_the_right() {
        let frame = Plot::new("force, N", [0.0, 5.0], [0.0, 0.8]).frame();
        for part in [">0<", ">5<", ">0.8<", "force, N"] {
            assert!(frame.contains(part), "{part}: {frame}");
        }
        assert!(frame.matches("class=\"tick\"").count() >= 9, "{frame}");
    }
}
