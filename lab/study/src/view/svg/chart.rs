//! Charts of marks between two axes.

use std::f64::consts::TAU;
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
/// Radius of a main mark and of others, and of those of which a share is filled (px).
const RADII: [f64; 2] = [5.0, 2.5];
const FILLED_RADII: [f64; 2] = [6.0, 4.0];
/// Labels keep so far from a bar where there is room (px).
const BAR: f64 = 1.0;

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
        if let Some((value, _)) = self.level() {
            let [_, y] = self.at(self.x.range[0], *value);
            _ = write!(svg, "<path class=\"guide\" d=\"M{left} {y:.1}H{right}\"/>");
        }
        if self.chart.has_front {
            _ = writeln!(svg, "<text class=\"better\" x=\"{left}\" y=\"{}\">↙ better</text>", bottom + 33.0);
        }
    }

    /// A level that is within the axis.
    fn level(&self) -> Option<&(f64, String)> {
        self.chart.level.as_ref().filter(|(value, _)| self.y.has(*value))
    }

    /// What a level says, above its line on the side where fewer marks are near: from where to where, on which baseline.
    fn level_text(&self) -> Option<([f64; 2], f64, &str)> {
        let (value, why) = self.level()?;
        let [left, _, right, _] = self.plot();
        let [_, y] = self.at(self.x.range[0], *value);
        let width = Labels::width(why);
        let marks = || self.chart.series.iter().flat_map(|series| &series.marks).map(|mark| self.at(mark.x, mark.y));
        let near = |from: f64, to: f64| {
            marks().filter(|[x, mark_y]| (from..to).contains(x) && (y - 30.0..y + 10.0).contains(mark_y)).count()
        };
        let is_left = near(left, left + width) < near(right - width, right);
        let from = if is_left { left + 4.0 } else { right - width };
        Some(([from, from + width], y - 4.0, why))
    }

    /// Marks that no other beats, from the left: each is lower than all before it.
    fn front(&self) -> Vec<[f64; 2]> {
        let marks = || self.chart.series.iter().flat_map(|series| &series.marks);
        let has_asides = marks().any(|mark| mark.filled.is_some());
        let counted = marks().filter(|mark| mark.filled.is_some() || !has_asides);
        let mut all: Vec<_> = counted.map(|mark| [mark.x, mark.y]).collect();
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
            let of = usize::from(!series.is_large && Some(index) != series.main);
            self.bars(mark, svg);
            let title = format!("<title>{}</title>", escaped(&self.tooltip(series, mark)));
            match mark.filled {
                Some(share) => *svg += &filled([x, y], FILLED_RADII[of], share, &title),
                None => {
                    let radius = RADII[of];
                    _ = writeln!(svg, "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"{radius}\">{title}</circle>");
                }
            }
        }
        *svg += "</g>\n";
    }

    /// From where to where a mark is spread.
    fn bars(&self, mark: &Mark, svg: &mut String) {
        let Some([[left, y], [right, _], [x, bottom], [_, top]]) = self.ends(mark) else { return };
        _ = writeln!(svg, "<path class=\"bar\" d=\"M{left:.1} {y:.1}H{right:.1}M{x:.1} {bottom:.1}V{top:.1}\"/>");
    }

    /// Where the bars of a mark end: left, right, bottom, top.
    fn ends(&self, mark: &Mark) -> Option<[[f64; 2]; 4]> {
        let [along, up] = mark.spread?;
        Some([self.at(along[0], mark.y), self.at(along[1], mark.y), self.at(mark.x, up[0]), self.at(mark.x, up[1])])
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
        let large = self.chart.series.iter().filter(|series| series.is_large).flat_map(|series| &series.marks);
        let taken = spots.iter().map(|spot| spot.at).chain(large.map(|mark| self.at(mark.x, mark.y)));
        let mut labels = Labels::new(self.plot(), taken, small);
        let marks = self.chart.series.iter().flat_map(|series| &series.marks);
        for [[left, y], [right, _], [x, bottom], [_, top]] in marks.filter_map(|mark| self.ends(mark)) {
            labels.avoid([left, y - BAR, right, y + BAR]);
            labels.avoid([x - BAR, top, x + BAR, bottom]);
        }
        let [_, top, ..] = self.plot();
        if let Some((value, why)) = &self.chart.guide {
            let left = self.at(*value, self.y.range[0])[0] + 5.0;
            // Clear of the line itself too.
            labels.keep_clear([left - 8.0, left + Labels::width(why)], top + 10.0);
        }
        if let Some(([from, to], baseline, why)) = self.level_text() {
            labels.keep_clear([from, to], baseline);
            let (x, anchor) = if from < self.plot()[0] + 10.0 { (from, "start") } else { (to, "end") };
            _ = writeln!(
                svg,
                "<text class=\"told\" x=\"{x:.1}\" y=\"{baseline:.1}\" text-anchor=\"{anchor}\">{}</text>",
                escaped(why)
            );
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

/// A mark of which a share is filled, clockwise from its top.
fn filled([x, y]: [f64; 2], radius: f64, share: f64, title: &str) -> String {
    if share >= 1.0 {
        return format!("<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"{radius}\">{title}</circle>\n");
    }
    let mut mark = format!("<circle class=\"ring\" cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"{radius}\">{title}</circle>");
    if share > 0.0 {
        let (sin, cos) = (TAU * share).sin_cos();
        let (to_x, to_y, is_long) = (x + radius * sin, y - radius * cos, u8::from(share > 0.5));
        let arc = format!("V{:.1}A{radius} {radius} 0 {is_long} 1 {to_x:.1} {to_y:.1}Z", y - radius);
        _ = write!(mark, "<path class=\"wedge\" d=\"M{x:.1} {y:.1}{arc}\">{title}</path>");
    }
    mark + "\n"
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
    fn marks_have_bars_and_are_filled_as_far_as_they_were_right() {
        let with = |filled| {
            let mut chart = chart(&[[10.0, 10.0]]);
            let mark = &mut chart.series[0].marks[0];
            (mark.filled, mark.spread) = (Some(filled), Some([[1.0, 100.0], [5.0, 20.0]]));
            Drawing::of(&chart).svg()
        };
        let [wrong, half, right] = [0.0, 0.5, 1.0].map(with);
        assert!(right.contains("M58.0 151.0H386.0M222.0 183.2V118.8"), "{right}");
        assert!(!right.contains("ring") && !wrong.contains("wedge") && wrong.contains("class=\"ring\""));
        assert!(half.contains("d=\"M222.0 151.0V145.0A6 6 0 0 1 222.0 157.0Z\""), "{half}");
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
