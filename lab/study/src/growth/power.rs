//! Powers that are fitted to costs.

/// A power of the size that a cost grows by: least squares of the logarithms.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Power {
    /// The exponent.
    pub exponent: f64,
    /// Its standard error, from how far the logarithms are off the line; `None` of two sizes, which any line meets.
    pub standard_error: Option<f64>,
    /// The cost of a size of one, as the line has it.
    pub factor: f64,
}

impl Power {
    /// Of sizes with their costs; `None` if there are not two sizes, or if one costs nothing.
    pub fn of(points: impl Iterator<Item = [f64; 2]>) -> Option<Self> {
        let points: Vec<[f64; 2]> = points.map(|point| point.map(f64::ln)).collect();
        let count = points.len() as f64;
        let [mean_x, mean_y] = [0, 1].map(|axis: usize| points.iter().map(|point| point[axis]).sum::<f64>() / count);
        let square = points.iter().map(|[x, _]| (x - mean_x).powi(2)).sum::<f64>();
        let product = points.iter().map(|[x, y]| (x - mean_x) * (y - mean_y)).sum::<f64>();
        let exponent = product / square;
        let left = points.iter().map(|[x, y]| (y - mean_y - exponent * (x - mean_x)).powi(2)).sum::<f64>();
        let standard_error = (points.len() > 2).then(|| (left / (count - 2.0) / square).sqrt());
        let factor = (mean_y - exponent * mean_x).exp();
        (exponent.is_finite() && factor.is_finite()).then_some(Self { exponent, standard_error, factor })
    }

    /// What the line says of a size.
    pub fn at(&self, size: f64) -> f64 {
        self.factor * size.powf(self.exponent)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_power_is_found_and_its_error_is_that_of_the_textbook() {
        let exact = Power::of([1.0, 2.0, 8.0].into_iter().map(|x: f64| [x, 3.0 * x.powi(2)])).unwrap();
        assert!((exact.exponent - 2.0).abs() < 1e-12 && (exact.at(4.0) - 48.0).abs() < 1e-9);
        assert!(exact.standard_error.unwrap() < 1e-9);
        // Logarithms to the base e of 0, 1, 2 and of 0, 1, 1: a slope of 1/2, off by 1/6, -1/3, 1/6.
        let bent =
            Power::of([[0, 0], [1, 1], [2, 1]].into_iter().map(|at| at.map(|log| f64::from(log).exp()))).unwrap();
        assert!((bent.exponent - 0.5).abs() < 1e-12);
        assert!((bent.standard_error.unwrap() - (1.0_f64 / 12.0).sqrt()).abs() < 1e-12);
    }

    #[test]
    fn one_size_and_no_cost_have_no_power() {
        assert_eq!(Power::of([[2.0, 3.0]].into_iter()), None);
        assert_eq!(Power::of([[2.0, 0.0], [3.0, 0.0]].into_iter()), None);
        assert!(Power::of([[2.0, 3.0], [4.0, 6.0]].into_iter()).unwrap().standard_error.is_none());
    }
}
