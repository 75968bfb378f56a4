//! Errors as they are, beside what they are in terms of a solver's own harmless error.

use super::breakdown::CellReport;
use super::report::{ErrorCurve, ErrorRange, SweepReport};
use crate::score::quantiles;

/// Errors at which the shares of points beyond them are given (m).
const ERRORS_M: [f64; 12] = [1e-5, 2e-5, 5e-5, 1e-4, 2e-4, 5e-4, 1e-3, 2e-3, 5e-3, 1e-2, 2e-2, 5e-2];

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

/// A curve for each solver.
pub(super) fn curves(sweeps: &[SweepReport]) -> Vec<ErrorCurve> {
    let rows = || sweeps.iter().flat_map(|sweep| &sweep.solvers);
    let mut solvers: Vec<&str> = Vec::new();
    for row in rows() {
        if !solvers.contains(&row.solver.as_str()) {
            solvers.push(&row.solver);
        }
    }
    let of = |solver: &&str| {
        let cells = rows().filter(|row| row.solver == **solver).flat_map(|row| row.cells.iter().flatten());
        ErrorCurve::of(solver, cells)
    };
    solvers.iter().map(of).collect()
}

impl ErrorCurve {
    fn of<'a>(solver: &str, cells: impl Iterator<Item = &'a CellReport>) -> Self {
        // What it refused altogether has no error, and is as bad as any.
        let error_m = |cell: &CellReport| cell.error_m.or((cell.failed > 0.0).then_some(f64::INFINITY));
        let errors_m: Vec<f64> = cells.filter_map(error_m).collect();
        let beyond = |limit_m: f64| {
            errors_m.iter().filter(|error_m| **error_m > limit_m).count() as f64 / errors_m.len().max(1) as f64
        };
        let points = ERRORS_M.map(|limit_m| [limit_m, beyond(limit_m)]).to_vec();
        Self { solver: solver.to_owned(), count: errors_m.len(), points }
    }

    /// Share of the points at which the error is at most this (m), one of those that are given.
    pub(super) fn within(&self, limit_m: f64) -> Option<f64> {
        self.points.iter().find(|[error_m, _]| *error_m == limit_m).map(|[_, beyond]| 1.0 - beyond)
    }
}

#[cfg(test)]
mod tests {
    use super::super::report::{PointReport, SolverRow};
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

    #[test]
    fn curves_count_the_points_of_all_sweeps_and_refusals_as_far_off() {
        let refused = Some(CellReport { failed: 1.0, ..CellReport::default() });
        let shape = Some(CellReport::default());
        let sweep = |cells: Vec<Option<CellReport>>| SweepReport {
            title: String::new(),
            note: String::new(),
            points: vec![PointReport { label: String::new(), severity: 0.0 }],
            solvers: vec![SolverRow { solver: "tv".to_owned(), cells, errors: ErrorRange::default(), breaks: None }],
            calibrated: Vec::new(),
        };
        let curves = curves(&[sweep(vec![cell(0.4), cell(3.0), None]), sweep(vec![refused, shape, cell(1.0)])]);
        assert_eq!(curves.len(), 1);
        assert_eq!((curves[0].solver.as_str(), curves[0].count), ("tv", 4));
        let within = [5e-4, 1e-3, 5e-3, 5e-2].map(|limit_m| curves[0].within(limit_m));
        assert_eq!(within, [Some(0.25), Some(0.5), Some(0.75), Some(0.75)]);
    }
}
