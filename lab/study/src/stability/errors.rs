//! Errors over the points of a sweep.

use super::breakdown::CellReport;
use super::report::ErrorRange;
use crate::score::quantiles;

impl ErrorRange {
    /// Over cells in the order of their points.
    pub(super) fn of(severities: &[f64], cells: &[Option<CellReport>]) -> Self {
        let tried = severities.iter().zip(cells).filter_map(|(severity, cell)| Some((*severity, cell.as_ref()?)));
        let harmless = tried.min_by(|(a, _), (b, _)| a.total_cmp(b));
        let range_m = quantiles(cells.iter().flatten().filter_map(|cell| cell.error_m), [0.5, 1.0]);
        Self {
            harmless_m: harmless.and_then(|(_, cell)| cell.error_m),
            median_m: range_m.map(|[median_m, _]| median_m),
            largest_m: range_m.map(|[_, largest_m]| largest_m),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cell(error_mm: f64) -> Option<CellReport> {
        Some(CellReport { error_m: Some(1e-3 * error_mm), ..CellReport::default() })
    }

    #[test]
    fn the_harmless_point_is_the_least_severe_that_was_tried() {
        let cells = [cell(8.0), None, cell(4.0), cell(6.0)];
        let errors = ErrorRange::of(&[3.0, 0.0, 1.0, 2.0], &cells);
        let expected = ErrorRange { harmless_m: Some(4e-3), median_m: Some(6e-3), largest_m: Some(8e-3) };
        assert_eq!(errors, expected);
        assert_eq!(ErrorRange::of(&[0.0], &[None]), ErrorRange::default());
    }
}
