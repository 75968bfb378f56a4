//! Maps of a figure over two logarithmic axes, with contour lines.

use std::fmt::Write;

use super::axis::{Axis, Unit};
use super::label::Labels;
use super::{colour, escaped};

/// Room around the map: left, top, right (the scale), bottom (px).
const ROOM: [f64; 4] = [52.0, 44.0, 64.0, 40.0];
/// Side of a map (px).
const SIDE: f64 = 240.0;
/// Colours that cells are drawn in: neighbours of one colour are one rectangle.
const COLOURS: usize = 64;
/// Contour lines between the smallest and the largest value.
const CONTOURS: usize = 5;

/// A map: values at the nodes of a grid that is even in the logarithm of both axes.
#[derive(Clone, Debug)]
pub struct Map {
    /// What it shows.
    pub title: String,
    /// A line below: what is better.
    pub subtitle: String,
    /// What is to the right and what upwards.
    pub axes: [String; 2],
    /// Values of both axes, rising.
    pub ticks: [Vec<f64>; 2],
    /// A row for each value of the upward axis, from the lowest; `None` where there is no figure: such cells are grey.
    pub rows: Vec<Vec<Option<f64>>>,
    /// What a cell without a figure is.
    pub empty: &'static str,
    /// Whether colours follow the logarithm.
    pub is_log: bool,
    /// A value as text.
    pub text: fn(f64) -> String,
    /// Points on it, with their names.
    pub marks: Vec<([f64; 2], String)>,
}

impl Map {
    /// The map as SVG, for a page of this module.
    pub fn svg(&self) -> String {
        let [width, height] = [ROOM[0] + SIDE + ROOM[2], ROOM[1] + SIDE + ROOM[3]];
        let mut svg = format!(
            "<svg class=\"chart map\" viewBox=\"0 0 {width} {height}\" role=\"img\" aria-label=\"{}\">\n\
             <text class=\"title\" x=\"0\" y=\"15\">{}</text><text class=\"subtitle\" x=\"0\" y=\"32\">{}</text>\n",
            escaped(&self.title),
            escaped(&self.title),
            escaped(&self.subtitle)
        );
        let extent = self.extent();
        self.cells(extent, &mut svg);
        self.contours(extent, &mut svg);
        self.axes(&mut svg);
        self.draw_marks(&mut svg);
        self.scale(extent, &mut svg);
        svg + "</svg>"
    }

    fn scaled(&self, value: f64) -> f64 {
        if self.is_log { value.max(f64::MIN_POSITIVE).ln() } else { value }
    }

    /// Smallest and largest value, as colours count them.
    fn extent(&self) -> [f64; 2] {
        let values = self.rows.iter().flatten().flatten().map(|value| self.scaled(*value));
        values.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], value| [low.min(value), high.max(value)])
    }

    fn share(&self, value: f64, [low, high]: [f64; 2]) -> f64 {
        if high > low { (self.scaled(value) - low) / (high - low) } else { 0.5 }
    }

    /// Width and height of a cell (px).
    fn cell(&self) -> [f64; 2] {
        [0, 1].map(|axis: usize| SIDE / self.ticks[axis].len().max(1) as f64)
    }

    fn cells(&self, extent: [f64; 2], svg: &mut String) {
        let [width, height] = self.cell();
        let all = self.rows.len();
        for (row, values) in self.rows.iter().enumerate() {
            let y = ROOM[1] + (all - 1 - row) as f64 * height;
            let colours: Vec<Option<usize>> = values
                .iter()
                .map(|value| value.map(|value| (self.share(value, extent) * (COLOURS - 1) as f64).round() as usize))
                .collect();
            let mut column = 0;
            while column < values.len() {
                // Where cells are few each is one, with its value; where there are many, those of a colour are one.
                let same = colours[column..].iter().take_while(|colour| **colour == colours[column]).count();
                let count = if values.len() <= COLOURS / 2 { 1 } else { same };
                let fill = colours[column]
                    .map_or("var(--grid)".to_owned(), |colour| colour::of_share(colour as f64 / (COLOURS - 1) as f64));
                _ = writeln!(
                    svg,
                    "<rect x=\"{:.1}\" y=\"{y:.1}\" width=\"{:.1}\" height=\"{:.1}\" fill=\"{fill}\"><title>{}</title></rect>",
                    ROOM[0] + column as f64 * width,
                    // A little over the next one, or the page shows between them.
                    count as f64 * width + 0.3,
                    height + 0.3,
                    escaped(&self.tooltip([column, row], values[column]))
                );
                column += count;
            }
        }
    }

    fn tooltip(&self, [column, row]: [usize; 2], value: Option<f64>) -> String {
        let at = |axis: usize, index: usize| Unit::Plain.text(self.ticks[axis].get(index).copied().unwrap_or(0.0));
        let [low, high] = self
            .rows
            .iter()
            .flatten()
            .flatten()
            .fold([f64::INFINITY, f64::NEG_INFINITY], |[a, b], v| [a.min(*v), b.max(*v)]);
        let normalised = |value: f64| if high > low { (value - low) / (high - low) } else { 0.0 };
        let text = |value: f64| format!("{}, normalised {:.2},", (self.text)(value), normalised(value));
        let value = value.map_or(self.empty.to_owned(), text);
        format!("{value} at {} {}, {} {}", self.axes[0], at(0, column), self.axes[1], at(1, row))
    }

    /// A node of the grid on the page (px).
    fn at_node(&self, column: f64, row: f64) -> [f64; 2] {
        let [width, height] = self.cell();
        [ROOM[0] + (column + 0.5) * width, ROOM[1] + (self.rows.len() as f64 - 0.5 - row) * height]
    }

    /// Lines of equal value: each square of four nodes by the sides that a line crosses (marching squares).
    fn contours(&self, [low, high]: [f64; 2], svg: &mut String) {
        for line in 1..=CONTOURS {
            let level = low + (high - low) * line as f64 / (CONTOURS + 1) as f64;
            let mut path = String::new();
            for row in 1..self.rows.len() {
                for column in 1..self.rows[row].len() {
                    self.cross([column, row], level, &mut path);
                }
            }
            if !path.is_empty() {
                let class = if (level - low) / (high - low) > 0.5 { "contour dark" } else { "contour" };
                _ = writeln!(svg, "<path class=\"{class}\" d=\"{path}\"/>");
            }
        }
    }

    fn cross(&self, [column, row]: [usize; 2], level: f64, path: &mut String) {
        let corners = [[0, 0], [1, 0], [1, 1], [0, 1]].map(|[dx, dy]: [usize; 2]| [column - 1 + dx, row - 1 + dy]);
        let values = corners.map(|[x, y]| self.rows.get(y).and_then(|row| row.get(x).copied().flatten()));
        let Some(values) = values.into_iter().collect::<Option<Vec<f64>>>() else { return };
        let heights: Vec<f64> = values.iter().map(|value| self.scaled(*value) - level).collect();
        let mut ends = Vec::new();
        for side in 0..4 {
            let (from, to) = (side, (side + 1) % 4);
            if (heights[from] >= 0.0) != (heights[to] >= 0.0) {
                let share = heights[from] / (heights[from] - heights[to]);
                let between = |axis: usize| {
                    let [a, b] = [corners[from][axis] as f64, corners[to][axis] as f64];
                    a + share * (b - a)
                };
                ends.push(self.at_node(between(0), between(1)));
            }
        }
        for pair in ends.chunks_exact(2) {
            _ = write!(path, "M{:.1} {:.1}L{:.1} {:.1}", pair[0][0], pair[0][1], pair[1][0], pair[1][1]);
        }
    }

    /// The axis through the middles of the first and the last cell.
    fn axis(&self, axis: usize) -> Axis {
        let ticks = &self.ticks[axis];
        let [first, last] = [ticks.first(), ticks.last()].map(|value| value.copied().unwrap_or(1.0));
        let half = (last / first).powf(0.5 / (ticks.len().max(2) - 1) as f64).max(1.0 + 1e-9);
        Axis { title: self.axes[axis].clone(), unit: Unit::Plain, range: [first / half, last * half], is_linear: false }
    }

    fn at(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        [ROOM[0] + SIDE * self.axis(0).share(x), ROOM[1] + SIDE * (1.0 - self.axis(1).share(y))]
    }

    fn axes(&self, svg: &mut String) {
        let [x, y] = [self.axis(0), self.axis(1)];
        let bottom = ROOM[1] + SIDE;
        for (value, text) in x.ticks() {
            let [left, _] = self.at([value, y.range[0]]);
            let y = bottom + 15.0;
            _ = writeln!(
                svg,
                "<text class=\"tick\" x=\"{left:.1}\" y=\"{y}\" text-anchor=\"middle\">{}</text>",
                escaped(&text)
            );
        }
        for (value, text) in y.ticks() {
            let [_, top] = self.at([x.range[0], value]);
            _ = writeln!(
                svg,
                "<text class=\"tick\" x=\"{}\" y=\"{:.1}\" text-anchor=\"end\">{}</text>",
                ROOM[0] - 5.0,
                top + 4.0,
                escaped(&text)
            );
        }
        _ = writeln!(
            svg,
            "<text class=\"tick\" x=\"{}\" y=\"{}\" text-anchor=\"middle\">{}</text>\
             <text class=\"tick\" transform=\"translate(12 {}) rotate(-90)\" text-anchor=\"middle\">{}</text>",
            ROOM[0] + SIDE / 2.0,
            bottom + 31.0,
            escaped(&self.axes[0]),
            ROOM[1] + SIDE / 2.0,
            escaped(&self.axes[1])
        );
    }

    fn draw_marks(&self, svg: &mut String) {
        let places: Vec<[f64; 2]> = self.marks.iter().map(|(at, _)| self.at(*at)).collect();
        let frame = [ROOM[0], ROOM[1], ROOM[0] + SIDE, ROOM[1] + SIDE];
        let mut labels = Labels::new(frame, places.iter().copied(), []);
        for ([x, y], (_, name)) in places.iter().zip(&self.marks) {
            let place = labels.place([*x, *y], name);
            if place.is_far {
                let (to, height) = (place.left + 4.0, place.baseline - 4.0);
                _ = write!(svg, "<path class=\"sample\" d=\"M{x:.1} {y:.1}L{to:.1} {height:.1}\"/>");
            }
            _ = writeln!(
                svg,
                "<circle class=\"sample\" cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"3.2\"/>\
                 <text class=\"sample\" x=\"{:.1}\" y=\"{:.1}\">{}</text>",
                place.left,
                place.baseline,
                escaped(name)
            );
        }
    }

    /// The scale of colours, with the values of the contour lines.
    fn scale(&self, [low, high]: [f64; 2], svg: &mut String) {
        if low > high {
            return;
        }
        let (left, steps) = (ROOM[0] + SIDE + 10.0, 32);
        for step in 0..steps {
            let height = SIDE / f64::from(steps);
            _ = write!(
                svg,
                "<rect x=\"{left}\" y=\"{:.1}\" width=\"9\" height=\"{:.1}\" fill=\"{}\"/>",
                ROOM[1] + SIDE - f64::from(step + 1) * height,
                height + 0.3,
                colour::of_share((f64::from(step) + 0.5) / f64::from(steps))
            );
        }
        for line in 0..=CONTOURS + 1 {
            let share = line as f64 / (CONTOURS + 1) as f64;
            let scaled = low + (high - low) * share;
            let value = if self.is_log { scaled.exp() } else { scaled };
            _ = writeln!(
                svg,
                "<text class=\"tick\" x=\"{}\" y=\"{:.1}\">{}</text>",
                left + 13.0,
                ROOM[1] + SIDE * (1.0 - share) + 4.0,
                escaped(&(self.text)(value))
            );
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn map(rows: Vec<Vec<Option<f64>>>) -> Map {
        let ticks = [rows[0].len(), rows.len()].map(|count| (0..count).map(|k| 10f64.powi(k as i32)).collect());
        Map {
            title: "t <".to_owned(),
            subtitle: String::new(),
            axes: ["x".to_owned(), "y".to_owned()],
            ticks,
            rows,
            empty: "no figure",
            is_log: false,
            text: |value| format!("{value:.1}"),
            marks: vec![([10.0, 1.0], "A".to_owned())],
        }
    }

    #[test]
    fn cells_have_their_values_and_contours_run_between_them() {
        let svg = map(vec![vec![Some(0.0), Some(1.0)], vec![Some(0.0), None]]).svg();
        assert!(
            svg.contains("<title>1.0, normalised 1.00, at x 10, y 1</title>")
                && svg.contains("<title>no figure at x 10, y 10</title>")
        );
        assert!(!svg.contains("class=\"contour"), "a square with a missing corner has no line");
        let svg = map(vec![vec![Some(0.0), Some(1.0)], vec![Some(0.0), Some(1.0)]]).svg();
        assert_eq!(svg.matches("class=\"contour").count(), CONTOURS);
        // The third of five lines is half way between the nodes, which are at a quarter and three quarters.
        let middle = ROOM[0] + SIDE / 2.0;
        assert!(svg.contains(&format!("L{middle:.1}")), "{svg}");
        assert!(svg.contains("t &lt;"));
    }

    #[test]
    fn labels_of_marks_that_are_near_do_not_lie_on_one_another() {
        let mut crowded = map(vec![vec![Some(0.0); 3]; 3]);
        crowded.marks = ["AB", "BA", "AD", "DA"].map(|name| ([10.0, 10.0], name.to_owned())).into();
        let svg = crowded.svg();
        let places: std::collections::BTreeSet<&str> =
            svg.lines().filter_map(|line| line.split("<text class=\"sample\"").nth(1)?.split('>').next()).collect();
        assert_eq!(places.len(), 4, "{places:?}");
    }

    #[test]
    fn marks_lie_where_their_values_do() {
        let map = map(vec![vec![Some(0.0); 3]; 3]);
        assert_eq!(map.at([10.0, 10.0]), [ROOM[0] + SIDE / 2.0, ROOM[1] + SIDE / 2.0]);
        assert_eq!(map.at([1.0, 1.0]), map.at_node(0.0, 0.0));
    }
}
