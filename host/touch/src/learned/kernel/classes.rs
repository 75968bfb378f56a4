//! Presses by the size of their readings: noise is a larger share of light ones, so what is usual is what others of about the same size have.

/// Most classes.
const MOST: usize = 6;
/// Presses in each, at least.
const FEWEST_PRESSES: usize = 50;
/// Of the presses taught, so many are within what is usual.
const USUAL: f64 = 0.99;
/// What is new is beyond the usual by this factor. Measured on public sensors: single presses are flagged in 0 - 2 % then.
const BEYOND: f64 = 1.2;

/// Classes of presses of as many each.
#[derive(Clone, Debug, PartialEq)]
pub struct Classes {
    /// Smallest size (V) of each; they rise.
    pub smallest_v: Vec<f64>,
}

impl Classes {
    /// For presses of these sizes (V).
    pub fn of(sizes_v: &[f64]) -> Self {
        let mut sorted = sizes_v.to_vec();
        sorted.sort_by(f64::total_cmp);
        let count = (sorted.len() / FEWEST_PRESSES).clamp(1, MOST);
        Self { smallest_v: (0..count).map(|class| sorted[class * sorted.len() / count]).collect() }
    }

    /// Number of classes.
    pub fn count(&self) -> usize {
        self.smallest_v.len()
    }

    /// Which one readings of a size (V) are in.
    pub fn class(&self, size_v: f64) -> usize {
        self.smallest_v.partition_point(|smallest_v| *smallest_v <= size_v).saturating_sub(1)
    }

    /// What is new in each class, by what presses of these sizes have.
    pub fn limits(&self, sizes_v: &[f64], values: &[f64]) -> Vec<f64> {
        let mut of_class = vec![Vec::new(); self.count()];
        sizes_v.iter().zip(values).for_each(|(size_v, value)| of_class[self.class(*size_v)].push(*value));
        let limit = |mut values: Vec<f64>| {
            values.sort_by(f64::total_cmp);
            let last = values.len().saturating_sub(1);
            values.get((USUAL * last as f64).ceil() as usize).map_or(f64::MAX, |usual| BEYOND * usual)
        };
        of_class.into_iter().map(limit).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn limits_are_those_of_presses_of_the_same_size() {
        let sizes_v: Vec<f64> = (0..400).map(|i| f64::from(i % 200)).collect();
        let values: Vec<f64> =
            sizes_v.iter().enumerate().map(|(i, v)| if *v < 100.0 { 5.0 } else { i as f64 % 3.0 }).collect();
        let classes = Classes::of(&sizes_v);
        let limits = classes.limits(&sizes_v, &values);
        assert_eq!((classes.count(), classes.class(-1.0), classes.class(1e9)), (6, 0, 5));
        assert!((limits[0] - 6.0).abs() < 1e-12 && (limits[5] - 2.4).abs() < 1e-12, "{limits:?}");
    }

    #[test]
    fn one_press_that_is_far_off_does_not_make_everything_usual() {
        let mut values = vec![1.0; 300];
        values[17] = 1e6;
        let sizes_v = vec![1.0; 300];
        let classes = Classes { smallest_v: vec![1.0] };
        assert_eq!(classes.limits(&sizes_v, &values), [1.2]);
    }
}
