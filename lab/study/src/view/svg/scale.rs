//! Where values lie along an axis.

use super::super::figure::{Axis, Unit};

/// An axis with its ends.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Scale {
    /// Smallest and largest value; of a logarithmic axis both above zero.
    pub range: [f64; 2],
    unit: Unit,
    is_linear: bool,
    names: Vec<String>,
}

impl Scale {
    /// Over all of some values with a little room, unless the axis says from where to where.
    pub fn of(axis: &Axis, values: impl IntoIterator<Item = f64>) -> Self {
        let values = values.into_iter().chain(axis.reaches.iter().copied()).filter(|value| value.is_finite());
        let extent = |[low, high]: [f64; 2], value: f64| [low.min(value), high.max(value)];
        let nothing = [f64::INFINITY, f64::NEG_INFINITY];
        let around = if axis.is_linear {
            let [low, high] = values.fold(nothing, extent);
            let [low, high] = if low > high { [0.0, 1.0] } else { [low, high] };
            let room = if high > low { 0.04 * (high - low) } else { 0.5 * high.abs().max(1.0) };
            [low - room, high + room]
        } else {
            let [low, high] = values.map(|value| value.max(axis.floor).log10()).fold(nothing, extent);
            let [low, high] = if low > high { [axis.floor.log10(); 2] } else { [low, high] };
            let missing = (axis.decades - (high - low)).max(0.0) / 2.0 + 0.04 * (high - low).max(axis.decades);
            [low - missing, high + missing].map(|log| 10f64.powf(log))
        };
        Self {
            range: axis.range.unwrap_or(around),
            unit: axis.unit,
            is_linear: axis.is_linear,
            names: axis.names.clone(),
        }
    }

    /// Whether a value is within its ends.
    pub fn has(&self, value: f64) -> bool {
        (self.range[0]..=self.range[1]).contains(&value)
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
        if !self.names.is_empty() {
            return self.names.iter().enumerate().map(|(index, name)| (index as f64, name.clone())).collect();
        }
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_axis_holds_its_values_and_is_even_in_logarithms() {
        let axis = Scale::of(&Axis::log("t", Unit::Seconds).floor(1e-9), [1e-5, 1e-3, f64::NAN]);
        assert!(axis.range[0] < 1e-5 && axis.range[1] > 1e-3);
        assert!((axis.share(1e-4) - 0.5).abs() < 1e-9);
        assert_eq!((axis.share(0.0), axis.share(1.0)), (0.0, 1.0));
        let texts: Vec<_> = axis.ticks().into_iter().map(|(_, text)| text).collect();
        assert_eq!(texts.first().map(String::as_str), Some("10 µs"));
        assert!(texts.contains(&"100 µs".to_owned()));
    }

    #[test]
    fn a_linear_axis_is_even_and_may_go_below_zero() {
        let axis = Scale::of(&Axis::linear("share", Unit::Plain), [-1.0, 1.0]);
        assert!((axis.share(0.0) - 0.5).abs() < 1e-12);
        let ticks: Vec<_> = axis.ticks().into_iter().map(|(_, text)| text).collect();
        assert_eq!(ticks, ["-1", "-0.5", "0", "0.5", "1"]);
    }

    #[test]
    fn things_without_values_have_their_names() {
        let axis = Scale::of(&Axis::named("", ["a", "b"].map(str::to_owned)), [0.0, 1.0]);
        assert_eq!(axis.ticks(), [(0.0, "a".to_owned()), (1.0, "b".to_owned())]);
        assert_eq!((axis.share(0.0), axis.share(1.0)), (0.25, 0.75));
    }

    #[test]
    fn an_axis_of_nothing_or_one_value_still_has_a_length() {
        for values in [vec![], vec![1e-3]] {
            let axis = Scale::of(&Axis::log("x", Unit::Metres).floor(1e-5), values);
            assert!(axis.range[1] / axis.range[0] >= 10.0 * (1.0 - 1e-9), "{axis:?}");
        }
    }
}
