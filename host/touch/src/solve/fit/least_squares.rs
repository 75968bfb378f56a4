//! Nonlinear least squares by Levenberg's and Marquardt's method (Marquardt, *SIAM J. Appl. Math.* 11, 1963).
//!
//! Near a point, residuals are taken as linear in the parameters. With `J` the derivatives of the model, weighted, and `r` the weighted residuals, a step
//! `s` solves `(J' J + d diag(J' J)) s = J' r`. The damping `d` grows tenfold when a step is rejected, and shrinks to a tenth after one that is
//! accepted. Bounds of parameters and of steps are kept by who moves the point: a step that is cut short is still accepted or rejected by its sum.

use nalgebra::{Cholesky, DMatrix, DVector};

/// Normal equations at a point.
#[derive(Clone, Debug)]
pub(crate) struct NormalEquations {
    /// `J' J`.
    pub matrix: DMatrix<f64>,
    /// `J' r`: half of the negative derivative of the sum of squares.
    pub gradient: DVector<f64>,
}

impl NormalEquations {
    /// Of derivatives, a column for each parameter, and residuals.
    pub fn of(slopes: &DMatrix<f64>, residuals: &DVector<f64>) -> Self {
        Self { matrix: slopes.tr_mul(slopes), gradient: slopes.tr_mul(residuals) }
    }

    /// The step with such a damping; `None` if the damped matrix is not positive definite.
    pub fn step(&self, damping: f64) -> Option<DVector<f64>> {
        let mut damped = self.matrix.clone();
        (0..damped.nrows()).for_each(|i| damped[(i, i)] *= 1.0 + damping);
        Some(Cholesky::new(damped)?.solve(&self.gradient))
    }

    /// By how much a step lowers the sum of squares where residuals are linear.
    pub fn gain(&self, step: &DVector<f64>) -> f64 {
        2.0 * step.dot(&self.gradient) - step.dot(&(&self.matrix * step))
    }
}

/// Covariance of parameters whose normal equations have such a matrix; `None` where they are not determined.
pub(crate) fn covariance(matrix: &DMatrix<f64>) -> Option<DMatrix<f64>> {
    Some(Cholesky::new(matrix.clone())?.inverse())
}

/// How steps are damped.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Schedule {
    /// Damping of the first step, as a share of the diagonal.
    pub first: f64,
    /// Smallest damping.
    pub least: f64,
    /// Tries of one step, each damped ten times more than the one before.
    pub tries: usize,
}

/// Damping of a descent on its way.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Damping {
    schedule: Schedule,
    now: f64,
}

/// What became of a step.
pub(crate) enum Trial<T> {
    /// It leads to a better point.
    Accepted(T),
    /// It leads nowhere: a shorter one is tried.
    Rejected,
    /// No step from here is worth it.
    Enough,
}

impl Damping {
    /// Begins a descent.
    pub fn new(schedule: Schedule) -> Self {
        Self { now: schedule.first, schedule }
    }

    /// The first step that is accepted; `None` if there is none.
    pub fn step<T>(
        &mut self,
        equations: &NormalEquations,
        mut trial: impl FnMut(&DVector<f64>) -> Trial<T>,
    ) -> Option<T> {
        for _ in 0..self.schedule.tries {
            match equations.step(self.now).map_or(Trial::Rejected, |step| trial(&step)) {
                Trial::Accepted(next) => {
                    self.now = (self.now * 0.1).max(self.schedule.least);
                    return Some(next);
                }
                Trial::Rejected => self.now *= 10.0,
                Trial::Enough => return None,
            }
        }
        None
    }
}

/// A sum of squares to be lowered.
pub(crate) trait LeastSquares {
    /// Parameters with what follows from them.
    type Point;

    /// Sum of squares at a point.
    fn sum(&self, at: &Self::Point) -> f64;

    /// Normal equations at a point.
    fn equations(&self, at: &Self::Point) -> NormalEquations;

    /// The point after a step, cut to the bounds that there are; `None` if it makes no sense.
    fn moved(&mut self, from: &Self::Point, step: &DVector<f64>) -> Option<Self::Point>;

    /// Whether a point with a sum of `after` is taken in place of one with `before`.
    fn is_better(before: f64, after: f64) -> bool {
        after < before
    }

    /// Whether a step is too small to be worth trying; then the descent ends.
    fn is_negligible(&self, _at: &Self::Point, _equations: &NormalEquations, _step: &DVector<f64>) -> bool {
        false
    }

    /// Whether there is more to gain after a step that was accepted; `equations` are those before it.
    fn goes_on(&self, before: &Self::Point, after: &Self::Point, equations: &NormalEquations) -> bool;
}

/// Where a descent ended.
#[derive(Clone, Debug)]
pub(crate) struct Minimum<P> {
    /// The point.
    pub at: P,
    /// The matrix of the normal equations where the last step began; none without a step.
    pub matrix: Option<DMatrix<f64>>,
    /// Whether further steps would gain little.
    pub settled: bool,
}

/// Descends from a point, in at most so many steps.
pub(crate) fn minimise<L: LeastSquares>(
    problem: &mut L,
    start: L::Point,
    steps: usize,
    schedule: Schedule,
) -> Minimum<L::Point> {
    let mut damping = Damping::new(schedule);
    let mut minimum = Minimum { at: start, matrix: None, settled: false };
    for _ in 0..steps {
        let at = &minimum.at;
        let (equations, before) = (problem.equations(at), problem.sum(at));
        let next = damping.step(&equations, |step| {
            if problem.is_negligible(at, &equations, step) {
                return Trial::Enough;
            }
            let next = problem.moved(at, step).filter(|next| L::is_better(before, problem.sum(next)));
            next.map_or(Trial::Rejected, Trial::Accepted)
        });
        minimum.settled = next.as_ref().is_none_or(|next| !problem.goes_on(at, next, &equations));
        minimum.at = next.unwrap_or(minimum.at);
        minimum.matrix = Some(equations.matrix);
        if minimum.settled {
            break;
        }
    }
    minimum
}

#[cfg(test)]
mod tests {
    use super::*;

    const SCHEDULE: Schedule = Schedule { first: 1e-3, least: 1e-9, tries: 8 };

    /// Rosenbrock's valley, `(1 - x)^2 + 100 (y - x^2)^2`, with an upper bound of `x`.
    struct Valley {
        most: f64,
        rejected: usize,
    }

    impl LeastSquares for Valley {
        type Point = [f64; 2];

        fn sum(&self, [x, y]: &[f64; 2]) -> f64 {
            (1.0 - x).powi(2) + 100.0 * (y - x * x).powi(2)
        }

        fn equations(&self, [x, y]: &[f64; 2]) -> NormalEquations {
            let slopes = DMatrix::from_row_slice(2, 2, &[1.0, 0.0, -20.0 * x, 10.0]);
            NormalEquations::of(&slopes, &DVector::from_column_slice(&[1.0 - x, -10.0 * (y - x * x)]))
        }

        fn moved(&mut self, from: &[f64; 2], step: &DVector<f64>) -> Option<[f64; 2]> {
            let next = [(from[0] + step[0]).min(self.most), from[1] + step[1]];
            self.rejected += usize::from(self.sum(&next) >= self.sum(from));
            Some(next)
        }

        fn goes_on(&self, before: &[f64; 2], after: &[f64; 2], _equations: &NormalEquations) -> bool {
            self.sum(before) - self.sum(after) > 1e-12 * self.sum(before)
        }
    }

    #[test]
    fn rosenbrocks_valley_is_followed_to_its_end() {
        let mut valley = Valley { most: f64::INFINITY, rejected: 0 };
        let minimum = minimise(&mut valley, [-1.2, 1.0], 60, SCHEDULE);
        assert!(minimum.settled && minimum.at.iter().all(|value| (value - 1.0).abs() < 1e-9), "{:?}", minimum.at);
        assert!(valley.rejected > 0, "the valley bends: full steps lead out of it");
        let short = minimise(&mut valley, [-1.2, 1.0], 3, SCHEDULE);
        assert!(!short.settled && valley.sum(&short.at) < valley.sum(&[-1.2, 1.0]));
    }

    #[test]
    fn a_bound_holds_and_the_rest_is_fitted() {
        let mut valley = Valley { most: 0.5, rejected: 0 };
        let Minimum { at: [x, y], .. } = minimise(&mut valley, [-1.2, 1.0], 200, SCHEDULE);
        assert!(x == 0.5 && (y - 0.25).abs() < 1e-3, "{x} {y}");
    }

    #[test]
    fn parameters_that_are_not_distinguished_share_a_step_and_have_no_covariance() {
        let slopes = DMatrix::from_row_slice(3, 2, &[1.0, 1.0, 2.0, 2.0, 2.0, 2.0]);
        let equations = NormalEquations::of(&slopes, &DVector::from_column_slice(&[1.0, 2.0, 2.0]));
        assert!(equations.step(0.0).is_none() && covariance(&equations.matrix).is_none());
        let step = Damping::new(SCHEDULE).step(&equations, |step| Trial::Accepted(step.clone())).unwrap();
        assert!((step[0] - step[1]).abs() < 1e-9 && (step.sum() - 1.0).abs() < 1e-3, "{step}");
        assert!((equations.gain(&step) - 9.0).abs() < 1e-4, "all of the sum of squares");
    }

    #[test]
    fn damping_grows_with_rejected_steps_and_ends() {
        let slopes = DMatrix::identity(2, 2);
        let equations = NormalEquations::of(&slopes, &DVector::from_column_slice(&[1.0, 2.0]));
        let mut damping = Damping::new(SCHEDULE);
        let mut lengths = Vec::new();
        let none: Option<()> = damping.step(&equations, |step| {
            lengths.push(step.norm());
            Trial::Rejected
        });
        assert!(none.is_none() && lengths.len() == SCHEDULE.tries);
        assert!(lengths.is_sorted_by(|a, b| a > b), "{lengths:?}");
        assert!((covariance(&equations.matrix).unwrap() - slopes).norm() < 1e-12);
    }
}
