//! Figures as data: charts of marks between two axes, and maps of values over a grid.

use super::table::Format;

/// Marks between two axes; with a front, further left and further down is better.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Chart {
    /// What it shows, in a few words.
    pub title: String,
    /// A line below the title.
    pub subtitle: String,
    /// To the right, and upwards.
    pub axes: [Axis; 2],
    /// What is in it.
    pub series: Vec<Series>,
    /// Whether marks that no other beats in both directions are joined, and what is beaten steps back. Where marks are [filled](Mark::filled), others are
    /// asides, and do not count.
    pub has_front: bool,
    /// A value to the right that matters, and why.
    pub guide: Option<(f64, String)>,
    /// A value upwards that matters, and why.
    pub level: Option<(f64, String)>,
    /// Width and height (px).
    pub size: [f64; 2],
}

/// An axis, logarithmic unless it is linear. It reaches as far as the marks.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Axis {
    /// What it shows.
    pub title: String,
    /// In what.
    pub unit: Unit,
    /// Whether it is even in the values, not in their logarithms.
    pub is_linear: bool,
    /// Values below show there, on a logarithmic axis.
    pub floor: f64,
    /// How long a logarithmic axis is at least.
    pub decades: f64,
    /// Values that it reaches too.
    pub reaches: Vec<f64>,
    /// Smallest and largest value, where they do not follow from the marks.
    pub range: Option<[f64; 2]>,
    /// Names of the values 0, 1 and so on, in place of numbers.
    pub names: Vec<String>,
}

/// What an axis counts, for its ticks.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Unit {
    /// Seconds.
    Seconds,
    /// Metres.
    Metres,
    /// Bytes.
    Bytes,
    /// Plain numbers.
    Plain,
}

/// Marks that belong together.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Series {
    /// Its label.
    pub name: String,
    /// Class that gives it its colour: one of the style sheet's.
    pub class: &'static str,
    /// Its marks, in order.
    pub marks: Vec<Mark>,
    /// The mark that has the label; others are small.
    pub main: Option<usize>,
    /// Whether its marks are joined.
    pub is_joined: bool,
    /// Whether its marks are drawn.
    pub is_dotted: bool,
    /// Whether all its marks are as large as the main one.
    pub is_large: bool,
}

/// A mark.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Mark {
    /// To the right.
    pub x: f64,
    /// Upwards.
    pub y: f64,
    /// What else there is to say.
    pub note: String,
    /// From where to where it is spread to the right and upwards, as bars.
    pub spread: Option<[[f64; 2]; 2]>,
    /// Which share of it is filled: of what was right.
    pub filled: Option<f64>,
}

/// Values at the nodes of a grid that is even along both axes, as colours with contour lines.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Map {
    /// What it shows.
    pub title: String,
    /// A line below: what is better.
    pub subtitle: String,
    /// To the right, and upwards.
    pub axes: [Axis; 2],
    /// Values of both axes, rising.
    pub ticks: [Vec<f64>; 2],
    /// A row for each value of the upward axis, from the lowest; `None` where there is no figure: such cells are grey.
    pub rows: Vec<Vec<Option<f64>>>,
    /// What a cell without a figure is.
    pub empty: &'static str,
    /// Whether colours follow the logarithm.
    pub is_log: bool,
    /// Values that have the first and the last colour, and what is beyond them too; `None` for the smallest and the largest.
    pub range: Option<[f64; 2]>,
    /// How values are written.
    pub format: Format,
    /// Contour lines between the smallest and the largest value.
    pub contours: usize,
    /// Diameter of a cell that is a disc, as a share of its width; cells are squares without.
    pub disc: Option<f64>,
    /// Height over width.
    pub aspect: f64,
    /// Points on it, with their names.
    pub marks: Vec<([f64; 2], String)>,
}

impl Chart {
    /// Of some series, between an axis to the right and one upwards.
    pub fn new(
        title: impl Into<String>,
        subtitle: impl Into<String>,
        axes: [Axis; 2],
        series: impl IntoIterator<Item = Series>,
    ) -> Self {
        Self {
            title: title.into(),
            subtitle: subtitle.into(),
            axes,
            series: series.into_iter().collect(),
            has_front: false,
            guide: None,
            level: None,
            size: [430.0, 380.0],
        }
    }

    /// With a width and a height (px).
    #[must_use]
    pub fn sized(self, size: [f64; 2]) -> Self {
        Self { size, ..self }
    }

    /// What its marks have along an axis, with the ends of their bars.
    pub(super) fn values(&self, axis: usize) -> impl Iterator<Item = f64> {
        let of = move |mark: &Mark| {
            let ends = mark.spread.map(|spread| spread[axis]);
            std::iter::once([mark.x, mark.y][axis]).chain(ends.into_iter().flatten())
        };
        self.series.iter().flat_map(|series| &series.marks).flat_map(of)
    }
}

/// Gives charts the same axis to the right (0) or upwards (1), so that they can be compared.
pub fn same_axis<'a>(charts: impl IntoIterator<Item = &'a mut Chart>, axis: usize) {
    let mut charts: Vec<&mut Chart> = charts.into_iter().collect();
    let own = |chart: &&mut Chart| chart.values(axis).chain(chart.axes[axis].reaches.clone()).collect::<Vec<_>>();
    let all: Vec<f64> = charts.iter().flat_map(own).collect();
    charts.iter_mut().for_each(|chart| chart.axes[axis].reaches.extend(&all));
}

impl Axis {
    /// A logarithmic one, at least a decade long.
    pub fn log(title: impl Into<String>, unit: Unit) -> Self {
        let (decades, floor) = (1.0, 1e-6);
        let (reaches, range, names) = (Vec::new(), None, Vec::new());
        Self { title: title.into(), unit, is_linear: false, floor, decades, reaches, range, names }
    }

    /// A linear one.
    pub fn linear(title: impl Into<String>, unit: Unit) -> Self {
        Self { is_linear: true, ..Self::log(title, unit) }
    }

    /// Of things that have names and no values.
    pub fn named(title: impl Into<String>, names: impl IntoIterator<Item = String>) -> Self {
        let names: Vec<String> = names.into_iter().collect();
        let last = names.len().saturating_sub(1) as f64;
        Self { names, ..Self::linear(title, Unit::Plain).within([-0.5, last + 0.5]) }
    }

    /// At least so long.
    #[must_use]
    pub fn decades(self, decades: f64) -> Self {
        Self { decades, ..self }
    }

    /// Showing what is below this there.
    #[must_use]
    pub fn floor(self, floor: f64) -> Self {
        Self { floor, ..self }
    }

    /// Reaching some values too.
    #[must_use]
    pub fn reaching(mut self, values: impl IntoIterator<Item = f64>) -> Self {
        self.reaches.extend(values);
        self
    }

    /// From end to end of a range.
    #[must_use]
    pub fn within(self, range: [f64; 2]) -> Self {
        Self { range: Some(range), ..self }
    }
}

impl Series {
    /// Marks that are joined; the one in the middle has the label.
    pub fn line(
        name: impl Into<String>,
        class: &'static str,
        marks: impl IntoIterator<Item = impl Into<Mark>>,
    ) -> Self {
        let dots = Self::dots(name, class, marks);
        Self { main: Some(dots.marks.len() / 2), is_joined: true, ..dots }
    }

    /// Marks alone; a single one has the label. What is open has no mark.
    pub fn dots(
        name: impl Into<String>,
        class: &'static str,
        marks: impl IntoIterator<Item = impl Into<Mark>>,
    ) -> Self {
        let marks = marks.into_iter().map(Into::into);
        let marks: Vec<Mark> = marks.filter(|mark| mark.x.is_finite() && mark.y.is_finite()).collect();
        let main = (marks.len() == 1).then_some(0);
        Self { name: name.into(), class, marks, main, is_joined: false, is_dotted: true, is_large: false }
    }

    /// With the label at the last mark.
    #[must_use]
    pub fn labelled_last(self) -> Self {
        Self { main: self.marks.len().checked_sub(1), ..self }
    }

    /// With large marks.
    #[must_use]
    pub fn large(self) -> Self {
        Self { is_large: true, ..self }
    }

    /// Without a label, and with small marks only.
    #[must_use]
    pub fn unlabelled(self) -> Self {
        Self { main: None, ..self }
    }

    /// Without marks: what joins them alone.
    #[must_use]
    pub fn undotted(self) -> Self {
        Self { main: None, is_dotted: false, ..self }
    }
}

impl<Y: Into<Option<f64>>> From<(f64, Y)> for Mark {
    fn from((x, y): (f64, Y)) -> Self {
        Self::from([x, y.into().unwrap_or(f64::NAN)])
    }
}

impl From<[f64; 2]> for Mark {
    fn from([x, y]: [f64; 2]) -> Self {
        Self { x, y, note: String::new(), spread: None, filled: None }
    }
}

impl Unit {
    /// A value with its unit, as short as it can be.
    pub fn text(self, value: f64) -> String {
        if value == 0.0 {
            return "0".to_owned();
        }
        let scales: &[(f64, &str)] = match self {
            Self::Seconds => &[(1.0, "s"), (1e-3, "ms"), (1e-6, "µs"), (1e-9, "ns")],
            Self::Bytes => &[(1e9, "GB"), (1e6, "MB"), (1e3, "kB"), (1.0, "B")],
            Self::Metres => &[(1.0, "m"), (1e-3, "mm"), (1e-6, "µm")],
            Self::Plain => return short(value),
        };
        // Millimetres read better than micrometres down to a hundredth.
        let from = if self == Self::Metres { 0.01 } else { 1.0 };
        let (scale, name) = scales
            .iter()
            .find(|(scale, _)| value.abs() >= 0.999 * from * scale)
            .or(scales.last())
            .copied()
            .unwrap_or((1.0, ""));
        let (scale, name) =
            if self == Self::Metres && scale == 1.0 && value < 1.0 { (1e-3, "mm") } else { (scale, name) };
        format!("{} {name}", short(value / scale))
    }
}

/// A number without digits that say nothing.
fn short(value: f64) -> String {
    let digits = (1 - value.abs().max(1e-12).log10().floor() as i32).clamp(0, 12) as usize;
    let text = format!("{value:.digits$}");
    match text.contains('.') {
        true => text.trim_end_matches('0').trim_end_matches('.').to_owned(),
        false => text,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_have_their_short_text() {
        for (unit, value, text) in [
            (Unit::Seconds, 1e-5, "10 µs"),
            (Unit::Seconds, 0.002, "2 ms"),
            (Unit::Seconds, 1.0, "1 s"),
            (Unit::Metres, 0.01, "10 mm"),
            (Unit::Metres, -0.01, "-10 mm"),
            (Unit::Metres, 0.0001, "0.1 mm"),
            (Unit::Metres, 2e-5, "0.02 mm"),
            (Unit::Metres, 0.0, "0"),
            (Unit::Plain, 0.3, "0.3"),
            (Unit::Plain, 200.0, "200"),
        ] {
            assert_eq!(unit.text(value), text);
        }
    }
}
