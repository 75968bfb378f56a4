//! Axes of charts.

/// What an axis counts, for its ticks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unit {
    /// Seconds.
    Seconds,
    /// Metres.
    Metres,
    /// Plain numbers.
    Plain,
}

/// An axis, logarithmic unless it is linear.
#[derive(Clone, Debug, PartialEq)]
pub struct Axis {
    /// What it shows.
    pub title: String,
    /// In what.
    pub unit: Unit,
    /// Smallest and largest value; of a logarithmic axis both above zero.
    pub range: [f64; 2],
    /// Whether it is even in the values, not in their logarithms.
    pub is_linear: bool,
}

impl Axis {
    /// An axis over all of some values with a little room, at least `decades` long, from no less than `floor`. Values below show at the floor.
    pub fn over(title: &str, unit: Unit, values: impl IntoIterator<Item = f64>, floor: f64, decades: f64) -> Self {
        let [low, high] = values
            .into_iter()
            .filter(|value| value.is_finite())
            .map(|value| value.max(floor).log10())
            .fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], value| [low.min(value), high.max(value)]);
        let [low, high] = if low > high { [floor.log10(), floor.log10()] } else { [low, high] };
        let missing = (decades - (high - low)).max(0.0) / 2.0 + 0.04 * (high - low).max(decades);
        Self {
            title: title.to_owned(),
            unit,
            range: [low - missing, high + missing].map(|log| 10f64.powf(log)),
            is_linear: false,
        }
    }

    /// A linear axis over all of some values, with a little room.
    pub fn linear(title: &str, unit: Unit, values: impl IntoIterator<Item = f64>) -> Self {
        let finite = values.into_iter().filter(|value| value.is_finite());
        let [low, high] = finite.fold([f64::INFINITY, f64::NEG_INFINITY], |[a, b], value| [a.min(value), b.max(value)]);
        let [low, high] = if low > high { [0.0, 1.0] } else { [low, high] };
        let room = if high > low { 0.04 * (high - low) } else { 0.5 * high.abs().max(1.0) };
        Self { title: title.to_owned(), unit, range: [low - room, high + room], is_linear: true }
    }

    /// Where a value lies, 0 to 1; beyond an end, at it.
    pub fn share(&self, value: f64) -> f64 {
        if self.is_linear {
            let [low, high] = self.range;
            return ((value - low) / (high - low)).clamp(0.0, 1.0);
        }
        let [low, high] = self.range.map(f64::log10);
        ((value.max(f64::MIN_POSITIVE).log10() - low) / (high - low)).clamp(0.0, 1.0)
    }

    /// Values of ticks, with their text: decades, and twos and fives where there are few of those.
    pub fn ticks(&self) -> Vec<(f64, String)> {
        let [low, high] = self.range;
        if self.is_linear {
            return self.even_ticks();
        }
        let decades = (high / low).log10();
        let steps: &[f64] = match decades {
            ..1.3 => &[1.0, 2.0, 3.0, 5.0, 7.0],
            1.3..2.3 => &[1.0, 2.0, 5.0],
            2.3..3.2 => &[1.0, 3.0],
            _ => &[1.0],
        };
        let first = low.log10().floor() as i32;
        (first..=high.log10().ceil() as i32)
            .flat_map(|decade| steps.iter().map(move |step| step * 10f64.powi(decade)))
            .filter(|value| (low..=high).contains(value))
            .map(|value| (value, self.unit.text(value)))
            .collect()
    }
}

impl Axis {
    /// Four to eight values, a one, two or five of a decade apart.
    fn even_ticks(&self) -> Vec<(f64, String)> {
        let [low, high] = self.range;
        let decade = 10f64.powf(((high - low) / 4.0).log10().floor());
        let step = [5.0, 2.0, 1.0].map(|times| times * decade).into_iter().find(|step| 4.0 * step <= high - low);
        let step = step.unwrap_or(decade);
        let first = (low / step).ceil() as i64;
        (first..=(high / step).floor() as i64)
            .map(|index| index as f64 * step)
            .map(|value| (value, self.unit.text(value)))
            .collect()
    }
}

impl Unit {
    /// A value with its unit, as short as it can be.
    pub fn text(self, value: f64) -> String {
        let scales: &[(f64, &str)] = match self {
            Self::Seconds => &[(1.0, "s"), (1e-3, "ms"), (1e-6, "µs"), (1e-9, "ns")],
            Self::Metres => &[(1.0, "m"), (1e-3, "mm"), (1e-6, "µm")],
            Self::Plain => return short(value),
        };
        // Millimetres read better than micrometres down to a hundredth.
        let from = if self == Self::Metres { 0.01 } else { 1.0 };
        let (scale, name) = scales
            .iter()
            .find(|(scale, _)| value >= 0.999 * from * scale)
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
            (Unit::Metres, 0.0001, "0.1 mm"),
            (Unit::Metres, 2e-5, "0.02 mm"),
            (Unit::Plain, 0.3, "0.3"),
            (Unit::Plain, 200.0, "200"),
        ] {
            assert_eq!(unit.text(value), text);
        }
    }

    #[test]
    fn an_axis_holds_its_values_and_is_even_in_logarithms() {
        let axis = Axis::over("t", Unit::Seconds, [1e-5, 1e-3, f64::NAN], 1e-9, 1.0);
        assert!(axis.range[0] < 1e-5 && axis.range[1] > 1e-3);
        assert!((axis.share(1e-4) - 0.5).abs() < 1e-9);
        assert_eq!((axis.share(0.0), axis.share(1.0)), (0.0, 1.0));
        let texts: Vec<_> = axis.ticks().into_iter().map(|(_, text)| text).collect();
        assert_eq!(texts.first().map(String::as_str), Some("10 µs"));
        assert!(texts.contains(&"100 µs".to_owned()));
    }

    #[test]
    fn a_linear_axis_is_even_and_may_go_below_zero() {
        let axis = Axis::linear("share", Unit::Plain, [-1.0, 1.0]);
        assert!((axis.share(0.0) - 0.5).abs() < 1e-12);
        let ticks: Vec<_> = axis.ticks().into_iter().map(|(_, text)| text).collect();
        assert_eq!(ticks, ["-1", "-0.5", "0", "0.5", "1"]);
    }

    #[test]
    fn an_axis_of_nothing_or_one_value_still_has_a_length() {
        for values in [vec![], vec![1e-3]] {
            let axis = Axis::over("x", Unit::Metres, values, 1e-5, 1.0);
            assert!(axis.range[1] / axis.range[0] >= 10.0 * (1.0 - 1e-9), "{axis:?}");
        }
    }
}
