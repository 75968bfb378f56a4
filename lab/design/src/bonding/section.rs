//! A section through a bar: lines of equal potential, and the scale of their colours.

use std::fmt::Write;

use tactomo_study::page::{Unit, colour, escaped};

use super::Bar;

/// Drawing of the bar, and room for its scale (px).
const WIDTH: f64 = 240.0;
const HEIGHT: f64 = 170.0;
const SCALE: f64 = 56.0;
/// Squares that lines are sought in, across and up.
const SQUARES: [usize; 2] = [80, 60];
/// Distance of the lines (V), and the drive.
const STEP_V: f64 = 0.05;
const DRIVE_V: f64 = 1.0;

/// The section, with its title.
pub(super) fn section(bar: &Bar) -> String {
    let title = escaped(&format!("dot of {}", Unit::Metres.text(bar.dot_diameter_m)));
    let mut svg = format!("<rect class=\"grid\" width=\"{WIDTH}\" height=\"{HEIGHT}\"/>");
    let count = (DRIVE_V / STEP_V).round() as usize;
    for line in 1..count {
        let level_v = line as f64 * STEP_V;
        let path = contour(bar, level_v);
        _ = write!(svg, "<path class=\"potential\" style=\"stroke:{}\" d=\"{path}\"/>", colour::of_share(level_v));
    }
    // What does not conduct is on either side of the dot.
    let dot = bar.dot_diameter_m / 2.0 / bar.radius_m * WIDTH / 2.0;
    let middle = HEIGHT / 2.0;
    _ = write!(
        svg,
        "<path class=\"cross\" d=\"M0 {middle}H{:.1}M{:.1} {middle}H{WIDTH}\"/>{}",
        WIDTH / 2.0 - dot,
        WIDTH / 2.0 + dot,
        scale()
    );
    format!(
        "<section><h4>{title}</h4><svg class=\"chart\" viewBox=\"0 -6 {} {}\" role=\"img\" aria-label=\"potentials, {title}\">{svg}\
         <text class=\"tick\" x=\"0\" y=\"{}\">{} wide, {} high</text></svg></section>",
        WIDTH + SCALE,
        HEIGHT + 28.0,
        HEIGHT + 16.0,
        Unit::Metres.text(2.0 * bar.radius_m),
        Unit::Metres.text(bar.height_m)
    )
}

/// Where the potential is a level: each square by the sides that the line crosses.
fn contour(bar: &Bar, level_v: f64) -> String {
    let [columns, rows] = SQUARES;
    let at = |column: usize, row: usize| {
        let [x, y] = [column as f64 / columns as f64, row as f64 / rows as f64];
        // The bond itself is the upper half's, and the lower one's just below.
        bar.at_v((2.0 * x - 1.0) * bar.radius_m, (0.5 - y) * bar.height_m) - level_v
    };
    let mut path = String::new();
    for row in 0..rows {
        // No line runs across the bond: beside the dot the potential jumps there.
        if row == rows / 2 {
            continue;
        }
        for column in 0..columns {
            let corners = [[0, 0], [1, 0], [1, 1], [0, 1]].map(|[dx, dy]: [usize; 2]| [column + dx, row + dy]);
            let heights = corners.map(|[x, y]| at(x, y));
            let ends: Vec<[f64; 2]> = (0..4)
                .filter_map(|side| {
                    let next = (side + 1) % 4;
                    let [a, b] = [heights[side], heights[next]];
                    let share = a / (a - b);
                    let between = |axis: usize| {
                        let [from, to] = [corners[side][axis] as f64, corners[next][axis] as f64];
                        from + share * (to - from)
                    };
                    let size = [WIDTH / columns as f64, HEIGHT / rows as f64];
                    ((a >= 0.0) != (b >= 0.0)).then(|| [0, 1].map(|axis| between(axis) * size[axis]))
                })
                .collect();
            for pair in ends.chunks_exact(2) {
                _ = write!(path, "M{:.1} {:.1}L{:.1} {:.1}", pair[0][0], pair[0][1], pair[1][0], pair[1][1]);
            }
        }
    }
    path
}

/// A bar from 0 to 1 V in the lines' colours.
fn scale() -> String {
    let (left, steps) = (WIDTH + 12.0, 25);
    let height = HEIGHT / f64::from(steps);
    let mut svg = String::new();
    for step in 0..steps {
        let top = HEIGHT - f64::from(step + 1) * height;
        let fill = colour::of_share((f64::from(step) + 0.5) / f64::from(steps));
        _ = write!(
            svg,
            "<rect x=\"{left}\" y=\"{top:.1}\" width=\"9\" height=\"{:.1}\" fill=\"{fill}\"/>",
            height + 0.3
        );
    }
    for (share, text) in [(0.0, "0 V"), (0.5, "0.5 V"), (1.0, "1 V")] {
        let y = HEIGHT * (1.0 - share) + 4.0;
        _ = write!(svg, "<text class=\"tick\" x=\"{}\" y=\"{y:.1}\">{text}</text>", left + 13.0);
    }
    svg
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_section_has_a_line_for_each_twentieth_of_the_drive_and_a_scale_in_volts() {
        let svg = section(&Bar::of(0.012, 0.005, 0.004));
        assert_eq!(svg.matches("class=\"potential\"").count(), 19);
        assert!(svg.contains(">1 V<") && svg.contains("dot of 4 mm") && svg.contains("10 mm high"), "{svg}");
        assert!(!svg.contains("NaN"));
    }
}
