//! Charts of marks between two axes.

use std::fmt::Write;

use super::super::figure::{Chart, Mark, Series};
use super::super::html::escaped;
use super::label::Labels;
use super::scale::Scale;
use super::{opened, tick, ticks_below};

/// Room around the plot: left, top, right, bottom (px).
const ROOM: [f64; 4] = [58.0, 44.0, 14.0, 42.0];
/// A chart wider than this has room for the names of all marks on one spot (px).
const ROOMY: f64 = 350.0;
/// Marks nearer than this have one label (px).
const ONE_SPOT: f64 = 14.0;

/// A chart with its axes found.
pub(super) struct Drawing<'a> {
    chart: &'a Chart,
    x: Scale,
    y: Scale,
}

impl<'a> Drawing<'a> {
    /// Of a chart.
    pub fn of(chart: &'a Chart) -> Self {
        let [x, y] = [0, 1].map(|axis: usize| Scale::of(&chart.axes[axis], chart.values(axis)));
        Self { chart, x, y }
    }

    /// The chart as SVG, for a page with the style sheet.
    pub fn svg(&self) -> String {
        let Chart { title, subtitle, size, series, .. } = self.chart;
        let mut svg = opened("chart", *size, title, subtitle);
        self.axes(&mut svg);
        let front = if self.chart.has_front { self.front() } else { Vec::new() };
        self.front_line(&front, &mut svg);
        // What leads is drawn last, over the others, but is labelled first; what has no name is behind all.
        let mut order: Vec<_> = series.iter().filter(|series| !series.marks.is_empty()).collect();
        order.sort_by_key(|series| (!series.name.is_empty(), self.leads(series, &front)));
        order.iter().for_each(|series| self.draw(series, &front, &mut svg));
        self.labels(order.iter().rev().copied(), &front, &mut svg);
        svg + "</svg>"
    }

    fn plot(&self) -> [f64; 4] {
        let [width, height] = self.chart.size;
        [ROOM[0], ROOM[1], width - ROOM[2], height - ROOM[3]]
    }

    fn at(&self, x: f64, y: f64) -> [f64; 2] {
        let [left, top, right, bottom] = self.plot();
        [left + (right - left) * self.x.share(x), bottom - (bottom - top) * self.y.share(y)]
    }

    fn axes(&self, svg: &mut String) {
        let [left, top, right, bottom] = self.plot();
        for (value, text) in self.y.ticks() {
            let [_, y] = self.at(self.x.range[0], value);
            _ = write!(svg, "<path class=\"grid\" d=\"M{left} {y:.1}H{right}\"/>");
            *svg += &tick([left - 6.0, y + 4.0], "end", &text);
        }
        let ticks: Vec<_> =
            self.x.ticks().into_iter().map(|(value, text)| (self.at(value, self.y.range[0])[0], text)).collect();
        for (x, _) in &ticks {
            _ = write!(svg, "<path class=\"grid\" d=\"M{x:.1} {top}V{bottom}\"/>");
        }
        *svg += &ticks_below(ticks, bottom + 16.0);
        *svg += &tick([right, bottom + 33.0], "end", &self.chart.axes[0].title);
        if let Some((value, why)) = self.chart.guide.as_ref().filter(|(value, _)| self.x.has(*value)) {
            let [x, _] = self.at(*value, self.y.range[0]);
            _ = write!(svg, "<path class=\"guide\" d=\"M{x:.1} {top}V{bottom}\"/>");
            *svg += &tick([x + 5.0, top + 10.0], "start", why);
        }
        if let Some((value, why)) = self.chart.level.as_ref().filter(|(value, _)| self.y.has(*value)) {
            let [_, y] = self.at(self.x.range[0], *value);
            _ = write!(svg, "<path class=\"guide\" d=\"M{left} {y:.1}H{right}\"/>");
            *svg += &tick([right, y - 4.0], "end", why);
        }
        if self.chart.has_front {
            _ = writeln!(svg, "<text class=\"better\" x=\"{left}\" y=\"{}\">↙ better</text>", bottom + 33.0);
        }
    }

    /// Marks that no other beats, from the left: each is lower than all before it.
    fn front(&self) -> Vec<[f64; 2]> {
        let marks = self.chart.series.iter().flat_map(|series| &series.marks);
        let mut all: Vec<_> = marks.map(|mark| [mark.x, mark.y]).collect();
        all.sort_by(|a, b| a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1])));
        let mut lowest = f64::INFINITY;
        all.retain(|[_, y]| {
            let leads = *y < lowest;
            lowest = lowest.min(*y);
            leads
        });
        all
    }

    fn leads(&self, series: &Series, front: &[[f64; 2]]) -> bool {
        !self.chart.has_front || series.marks.iter().any(|mark| front.contains(&[mark.x, mark.y]))
    }

    fn front_line(&self, front: &[[f64; 2]], svg: &mut String) {
        let Some(first) = front.first() else { return };
        let [_, top, right, _] = self.plot();
        let mut path = format!("M{:.1} {top}", self.at(first[0], first[1])[0]);
        for [x, y] in front.iter().map(|at| self.at(at[0], at[1])) {
            _ = write!(path, "H{x:.1}V{y:.1}");
        }
        _ = writeln!(svg, "<path class=\"front\" d=\"{path}H{right}\"/>");
    }

    fn draw(&self, series: &Series, front: &[[f64; 2]], svg: &mut String) {
        let behind = if self.leads(series, front) { "" } else { " behind" };
        _ = writeln!(svg, "<g class=\"{}{behind}\">", series.class);
        if series.is_joined {
            let points: Vec<_> = series
                .marks
                .iter()
                .map(|mark| self.at(mark.x, mark.y))
                .map(|[x, y]| format!("{x:.1},{y:.1}"))
                .collect();
            _ = writeln!(svg, "<polyline points=\"{}\"/>", points.join(" "));
        }
        // The main mark is drawn last, over the others.
        let mut marks: Vec<_> = series.marks.iter().enumerate().filter(|_| series.is_dotted).collect();
        marks.sort_by_key(|(index, _)| Some(*index) == series.main);
        for (index, mark) in marks {
            let [x, y] = self.at(mark.x, mark.y);
            let radius = if series.is_large || Some(index) == series.main { 5.0 } else { 2.5 };
            _ = writeln!(
                svg,
                "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"{radius}\"><title>{}</title></circle>",
                escaped(&self.tooltip(series, mark))
            );
        }
        *svg += "</g>\n";
    }

    /// What a mark is, and what else there is to say.
    fn tooltip(&self, series: &Series, mark: &Mark) -> String {
        let [x, y] =
            [(0, mark.x), (1, mark.y)].map(|(axis, value): (usize, f64)| self.chart.axes[axis].unit.text(value));
        let parts = [&series.name, &format!("{x}, {y}"), &mark.note];
        parts.into_iter().filter(|part| !part.is_empty()).map(String::as_str).collect::<Vec<_>>().join(": ")
    }

    /// One label for marks of a class that lie on one spot.
    fn labels<'s>(&self, series: impl Iterator<Item = &'s Series>, front: &[[f64; 2]], svg: &mut String) {
        let mut spots: Vec<Spot> = Vec::new();
        for series in series {
            let Some(mark) = series.main.and_then(|main| series.marks.get(main)) else { continue };
            let (at, leads) = (self.at(mark.x, mark.y), self.leads(series, front));
            let near = |spot: &&mut Spot| spot.class == series.class && distance(spot.at, at) < ONE_SPOT;
            match spots.iter_mut().find(near) {
                Some(spot) => spot.add(&series.name, leads),
                None => spots.push(Spot { at, class: series.class, names: vec![series.name.clone()], leads }),
            }
        }
        let small = self.chart.series.iter().flat_map(|series| &series.marks).map(|mark| self.at(mark.x, mark.y));
        let mut labels = Labels::new(self.plot(), spots.iter().map(|spot| spot.at), small);
        let [_, top, right, _] = self.plot();
        if let Some((value, why)) = &self.chart.guide {
            let left = self.at(*value, self.y.range[0])[0] + 5.0;
            // Clear of the line itself too.
            labels.keep_clear([left - 8.0, left + Labels::width(why)], top + 10.0);
        }
        if let Some((value, why)) = &self.chart.level {
            labels.keep_clear([right - Labels::width(why), right], self.at(self.x.range[0], *value)[1] - 4.0);
        }
        for spot in &spots {
            let text = spot.text(if self.chart.size[0] > ROOMY { usize::MAX } else { 1 });
            let place = labels.place(spot.at, &text);
            if place.is_far {
                let (to, y) = (place.left + 4.0, place.baseline - 4.0);
                _ = write!(svg, "<path class=\"lead\" d=\"M{:.1} {:.1}L{to:.1} {y:.1}\"/>", spot.at[0], spot.at[1]);
            }
            _ = writeln!(
                svg,
                "<text class=\"label {}{}\" x=\"{:.1}\" y=\"{:.1}\">{}</text>",
                spot.class,
                if spot.leads { "" } else { " behind" },
                place.left,
                place.baseline,
                escaped(&text)
            );
        }
    }
}

/// Marks on one spot, for their label.
struct Spot {
    at: [f64; 2],
    class: &'static str,
    names: Vec<String>,
    leads: bool,
}

impl Spot {
    fn add(&mut self, name: &str, leads: bool) {
        self.names.push(name.to_owned());
        self.leads |= leads;
    }

    /// Names, the first ones if there are more than `most`, and how many are left out.
    fn text(&self, most: usize) -> String {
        let names = &self.names[..self.names.len().min(most)];
        let left_out = self.names.len() - names.len();
        names.join(" · ") + &if left_out > 0 { format!(" +{left_out}") } else { String::new() }
    }
}

fn distance(a: [f64; 2], b: [f64; 2]) -> f64 {
    (a[0] - b[0]).hypot(a[1] - b[1])
}

#[cfg(test)]
mod tests {
    use super::super::super::figure::{Axis, Unit};
    use super::*;

    fn chart(points: &[[f64; 2]]) -> Chart {
        let axis = || Axis::log("x", Unit::Plain).within([1.0, 100.0]);
        let series = points.iter().map(|&[x, y]| Series::dots(format!("<&{x}"), "linear", [[x, y]]));
        Chart { has_front: true, ..Chart::new("t", "", [axis(), axis()], series).sized([400.0, 300.0]) }
    }

    #[test]
    fn the_front_is_what_nothing_beats() {
        let chart =
            chart(&[[10.0, 10.0], [2.0, 50.0], [20.0, 20.0], [50.0, 2.0], [2.0, 60.0], [60.0, 2.0], [5.0, f64::NAN]]);
        assert_eq!(Drawing::of(&chart).front(), [[2.0, 50.0], [10.0, 10.0], [50.0, 2.0]]);
    }

    #[test]
    fn values_lie_where_their_logarithms_do() {
        let chart = chart(&[]);
        let [x, y] = Drawing::of(&chart).at(10.0, 10.0);
        assert!((x - (58.0 + 386.0) / 2.0).abs() < 1e-9 && (y - (44.0 + 258.0) / 2.0).abs() < 1e-9);
        assert_eq!(Drawing::of(&chart).at(1e9, 0.0), [386.0, 258.0], "what is beyond an axis lies on its end");
    }

    #[test]
    fn a_level_is_a_line_across_where_its_value_is() {
        let with = |value| Chart { level: Some((value, "the <middle>".to_owned())), ..chart(&[[10.0, 10.0]]) };
        let svg = |value| Drawing::of(&with(value)).svg();
        assert!(svg(10.0).contains("M58 151.0H386") && svg(10.0).contains("the &lt;middle&gt;"));
        assert!(!svg(1000.0).contains("the &lt;middle"), "a value beyond the axis has no line");
    }

    #[test]
    fn labels_keep_clear_of_what_the_lines_say() {
        let label = |chart: &Chart| {
            let svg = Drawing::of(chart).svg();
            let found = svg.lines().find(|line| line.contains("class=\"label")).map(str::to_owned);
            found.unwrap_or_default()
        };
        let mut one = chart(&[[10.0, 90.0]]);
        let free = label(&one);
        one.guide = Some((9.0, "a line that matters".to_owned()));
        assert_ne!(label(&one), free, "{free}");
    }

    #[test]
    fn what_is_beaten_steps_back_and_texts_are_harmless() {
        let chart = chart(&[[10.0, 10.0], [20.0, 20.0]]);
        let svg = Drawing::of(&chart).svg();
        assert_eq!(svg.matches("<g class=\"linear behind\">").count(), 1);
        assert!(svg.contains("&lt;&amp;10: 10, 10") && svg.starts_with("<svg") && svg.ends_with("</svg>"));
    }
}
