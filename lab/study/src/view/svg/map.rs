//! Maps of values over a grid, with contour lines.

use std::fmt::Write;

use super::super::figure::{Axis, Map};
use super::super::html::escaped;
use super::label::Labels;
use super::scale::Scale;
use super::{colour, opened, tick, ticks_below};

/// Room around the map: left, top, right (the scale), bottom (px).
const ROOM: [f64; 4] = [52.0, 44.0, 64.0, 40.0];
/// Width of a map (px), of one that is not much higher than wide.
const SIDE: f64 = 240.0;
/// Height of a map over that, at most: what is higher is narrower.
const HIGHEST: f64 = 1.5;
/// Colours that cells are drawn in: neighbours of one colour are one rectangle.
const COLOURS: usize = 64;
/// Values beside the scale of colours, at most.
const WRITTEN: usize = 6;

/// A map with its axes found.
pub(super) struct Drawing<'a> {
    map: &'a Map,
    /// To the right, and upwards.
    axes: [Scale; 2],
    /// Values of the first and the last colour.
    extent: [f64; 2],
    /// Width and height (px).
    width: f64,
    height: f64,
}

impl<'a> Drawing<'a> {
    /// Of a map.
    pub fn of(map: &'a Map) -> Self {
        let values = map.rows.iter().flatten().flatten();
        let extent = values.fold([f64::INFINITY, f64::NEG_INFINITY], |[a, b], value| [a.min(*value), b.max(*value)]);
        let axes = [0, 1].map(|axis: usize| Scale::of(&around(&map.axes[axis], &map.ticks[axis]), []));
        let extent = map.range.unwrap_or(extent);
        let width = SIDE * (HIGHEST / map.aspect).min(1.0);
        Self { map, axes, extent, width, height: width * map.aspect }
    }

    /// The map as SVG, for a page with the style sheet.
    pub fn svg(&self) -> String {
        // As wide as others, so that all have letters of one size.
        let size = [ROOM[0] + SIDE + ROOM[2], ROOM[1] + self.height + ROOM[3]];
        let mut svg = opened("chart map", size, &self.map.title, &self.map.subtitle);
        self.cells(&mut svg);
        self.contours(&mut svg);
        self.ticks(&mut svg);
        self.draw_marks(&mut svg);
        self.scale(&mut svg);
        svg + "</svg>"
    }

    fn scaled(&self, value: f64) -> f64 {
        if self.map.is_log { value.max(f64::MIN_POSITIVE).ln() } else { value }
    }

    /// How far a value is from the smallest to the largest, as colours count.
    fn share(&self, value: f64) -> f64 {
        let [low, high] = self.extent.map(|value| self.scaled(value));
        if high > low { ((self.scaled(value) - low) / (high - low)).clamp(0.0, 1.0) } else { 0.5 }
    }

    /// Width and height of a cell (px).
    fn cell(&self) -> [f64; 2] {
        [self.width / self.map.ticks[0].len().max(1) as f64, self.height / self.map.ticks[1].len().max(1) as f64]
    }

    fn cells(&self, svg: &mut String) {
        let [width, height] = self.cell();
        for (row, values) in self.map.rows.iter().enumerate() {
            let colour =
                |value: &Option<f64>| value.map(|value| (self.share(value) * (COLOURS - 1) as f64).round() as usize);
            let colours: Vec<Option<usize>> = values.iter().map(colour).collect();
            let mut column = 0;
            while column < values.len() {
                // Where cells are few each is one, with its value; where there are many, those of a colour are one.
                let same = colours[column..].iter().take_while(|colour| **colour == colours[column]).count();
                let count = if values.len() <= COLOURS / 2 { 1 } else { same };
                let fill = colours[column]
                    .map_or("var(--grid)".to_owned(), |colour| colour::of_share(colour as f64 / (COLOURS - 1) as f64));
                let [x, y] = self.at_node(column as f64, row as f64);
                let shape = match self.map.disc {
                    Some(disc) => {
                        format!("circle class=\"disc\" cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"{:.1}\"", disc * width / 2.0)
                    }
                    // A little over the next one, or the page shows between them.
                    None => format!(
                        "rect x=\"{:.1}\" y=\"{:.1}\" width=\"{:.1}\" height=\"{:.1}\"",
                        x - width / 2.0,
                        y - height / 2.0,
                        count as f64 * width + 0.3,
                        height + 0.3
                    ),
                };
                let (tooltip, name) =
                    (self.tooltip([column, row], values[column]), shape.split(' ').next().unwrap_or("g"));
                _ = writeln!(svg, "<{shape} style=\"fill:{fill}\"><title>{}</title></{name}>", escaped(&tooltip));
                column += count;
            }
        }
    }

    fn tooltip(&self, [column, row]: [usize; 2], value: Option<f64>) -> String {
        let Map { axes, ticks, format, .. } = self.map;
        let at = |axis: usize, index: usize| {
            let place = axes[axis].unit.text(ticks[axis].get(index).copied().unwrap_or(0.0));
            format!("{} {place}", axes[axis].title)
        };
        let value = match value {
            Some(value) => format!("{} {}", format.text(Some(value)), format.unit),
            None => self.map.empty.to_owned(),
        };
        format!("{} at {}, {}", value.trim_end(), at(0, column), at(1, row))
    }

    /// A node of the grid on the page (px).
    fn at_node(&self, column: f64, row: f64) -> [f64; 2] {
        let [width, height] = self.cell();
        [ROOM[0] + (column + 0.5) * width, ROOM[1] + (self.map.rows.len() as f64 - 0.5 - row) * height]
    }

    /// Lines of equal value: each square of four nodes by the sides that a line crosses (marching squares).
    fn contours(&self, svg: &mut String) {
        let [low, high] = self.extent.map(|value| self.scaled(value));
        for line in 1..=self.map.contours {
            let share = line as f64 / (self.map.contours + 1) as f64;
            let mut path = String::new();
            for row in 1..self.map.rows.len() {
                for column in 1..self.map.rows[row].len() {
                    self.cross([column, row], low + (high - low) * share, &mut path);
                }
            }
            if !path.is_empty() {
                let class = if share > 0.5 { "contour dark" } else { "contour" };
                _ = writeln!(svg, "<path class=\"{class}\" d=\"{path}\"/>");
            }
        }
    }

    fn cross(&self, [column, row]: [usize; 2], level: f64, path: &mut String) {
        let corners = [[0, 0], [1, 0], [1, 1], [0, 1]].map(|[dx, dy]: [usize; 2]| [column - 1 + dx, row - 1 + dy]);
        let values = corners.map(|[x, y]| self.map.rows.get(y).and_then(|row| row.get(x).copied().flatten()));
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

    fn at(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        [ROOM[0] + self.width * self.axes[0].share(x), ROOM[1] + self.height * (1.0 - self.axes[1].share(y))]
    }

    fn ticks(&self, svg: &mut String) {
        let [x, y] = &self.axes;
        let bottom = ROOM[1] + self.height;
        *svg += &ticks_below(
            x.ticks().into_iter().map(|(value, text)| (self.at([value, y.range[0]])[0], text)),
            bottom + 15.0,
        );
        for (value, text) in y.ticks() {
            *svg += &tick([ROOM[0] - 5.0, self.at([x.range[0], value])[1] + 4.0], "end", &text);
        }
        *svg += &tick([ROOM[0] + self.width / 2.0, bottom + 31.0], "middle", &self.map.axes[0].title);
        _ = writeln!(
            svg,
            "<text class=\"tick\" transform=\"translate(12 {}) rotate(-90)\" text-anchor=\"middle\">{}</text>",
            ROOM[1] + self.height / 2.0,
            escaped(&self.map.axes[1].title)
        );
    }

    fn draw_marks(&self, svg: &mut String) {
        let places: Vec<[f64; 2]> = self.map.marks.iter().map(|(at, _)| self.at(*at)).collect();
        let frame = [ROOM[0], ROOM[1], ROOM[0] + self.width, ROOM[1] + self.height];
        let mut labels = Labels::new(frame, places.iter().copied(), []);
        for ([x, y], (_, name)) in places.iter().zip(&self.map.marks) {
            if name.is_empty() {
                _ = writeln!(svg, "<circle class=\"sample\" cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"2.2\"/>");
                continue;
            }
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

    /// The scale of colours, with some values.
    fn scale(&self, svg: &mut String) {
        let [low, high] = self.extent;
        if low > high {
            return;
        }
        let (left, steps) = (ROOM[0] + self.width + 10.0, 32);
        let height = self.height / f64::from(steps);
        for step in 0..steps {
            _ = write!(
                svg,
                "<rect x=\"{left}\" y=\"{:.1}\" width=\"9\" height=\"{:.1}\" fill=\"{}\"/>",
                ROOM[1] + self.height - f64::from(step + 1) * height,
                height + 0.3,
                colour::of_share((f64::from(step) + 0.5) / f64::from(steps))
            );
        }
        for line in 0..=WRITTEN {
            let share = line as f64 / WRITTEN as f64;
            let scaled = self.scaled(low) + (self.scaled(high) - self.scaled(low)) * share;
            let value = if self.map.is_log { scaled.exp() } else { scaled };
            let y = ROOM[1] + self.height * (1.0 - share) + 4.0;
            *svg += &tick([left + 13.0, y], "start", &self.map.format.text(Some(value)));
        }
    }
}

/// An axis from half a step before the first to half a step behind the last of its ticks.
fn around(axis: &Axis, ticks: &[f64]) -> Axis {
    let [first, last] = [ticks.first(), ticks.last()].map(|value| value.copied().unwrap_or(1.0));
    let half = 0.5 / (ticks.len().max(2) - 1) as f64;
    let range = if axis.is_linear {
        let half = ((last - first) * half).max(f64::MIN_POSITIVE);
        [first - half, last + half]
    } else {
        let half = (last / first).powf(half).max(1.0 + 1e-9);
        [first / half, last * half]
    };
    axis.clone().within(range)
}

#[cfg(test)]
mod tests {
    use super::super::super::figure::Unit;
    use super::super::super::table::PLAIN;
    use super::*;

    fn map(rows: Vec<Vec<Option<f64>>>) -> Map {
        let ticks = [rows[0].len(), rows.len()].map(|count| (0..count).map(|k| 10f64.powi(k as i32)).collect());
        Map {
            title: "t <".to_owned(),
            subtitle: String::new(),
            axes: ["x", "y"].map(|title| Axis::log(title, Unit::Plain)),
            ticks,
            rows,
            empty: "no figure",
            is_log: false,
            range: None,
            format: PLAIN.digits(1),
            contours: 5,
            disc: None,
            aspect: 1.0,
            marks: vec![([10.0, 1.0], "A".to_owned())],
        }
    }

    fn svg(map: &Map) -> String {
        Drawing::of(map).svg()
    }

    #[test]
    fn cells_have_their_values_and_contours_run_between_them() {
        let holed = svg(&map(vec![vec![Some(0.0), Some(1.0)], vec![Some(0.0), None]]));
        assert!(holed.contains("<title>1.0 at x 10, y 1</title>"), "{holed}");
        assert!(holed.contains("<title>no figure at x 10, y 10</title>"), "{holed}");
        assert!(!holed.contains("class=\"contour"), "a square with a missing corner has no line");
        let whole = svg(&map(vec![vec![Some(0.0), Some(1.0)], vec![Some(0.0), Some(1.0)]]));
        assert_eq!(whole.matches("class=\"contour").count(), 5);
        // The third of five lines is half way between the nodes, which are at a quarter and three quarters.
        let middle = ROOM[0] + SIDE / 2.0;
        assert!(whole.contains(&format!("L{middle:.1}")) && whole.contains("t &lt;"), "{whole}");
    }

    #[test]
    fn values_beyond_a_range_have_the_colours_of_its_ends() {
        let mut map = map(vec![vec![Some(0.0), Some(0.5), Some(3.0)]]);
        let shares = |map: &Map| [0.0, 0.5, 3.0].map(|value| Drawing::of(map).share(value));
        assert_eq!(shares(&map), [0.0, 0.5 / 3.0, 1.0]);
        map.range = Some([0.5, 1.5]);
        assert_eq!(shares(&map), [0.0, 0.0, 1.0]);
        assert!(svg(&map).contains(">1.5</text>") && !svg(&map).contains(">3.0</text>"));
    }

    #[test]
    fn labels_of_marks_that_are_near_do_not_lie_on_one_another() {
        let mut crowded = map(vec![vec![Some(0.0); 3]; 3]);
        crowded.marks = ["AB", "BA", "AD", "DA"].map(|name| ([10.0, 10.0], name.to_owned())).into();
        let svg = svg(&crowded);
        let places: std::collections::BTreeSet<&str> =
            svg.lines().filter_map(|line| line.split("<text class=\"sample\"").nth(1)?.split('>').next()).collect();
        assert_eq!(places.len(), 4, "{places:?}");
    }

    #[test]
    fn a_narrow_map_is_not_higher_than_a_page_shows() {
        let narrow = Map { aspect: 5.0, ..map(vec![vec![Some(0.0), Some(1.0)]; 10]) };
        let drawing = Drawing::of(&narrow);
        assert_eq!((drawing.width, drawing.height), (SIDE * 0.3, SIDE * 1.5));
    }

    #[test]
    fn marks_lie_where_their_values_do_on_either_kind_of_axis() {
        let mut map = map(vec![vec![Some(0.0); 3]; 3]);
        for middle in [10.0, 50.5] {
            let drawing = Drawing::of(&map);
            let [x, y] = drawing.at([middle, middle]);
            assert!((x - ROOM[0] - SIDE / 2.0).abs() < 1e-9 && (y - ROOM[1] - SIDE / 2.0).abs() < 1e-9);
            assert_eq!(drawing.at([1.0, 1.0]), drawing.at_node(0.0, 0.0));
            map.axes.iter_mut().for_each(|axis| axis.is_linear = true);
        }
    }
}
