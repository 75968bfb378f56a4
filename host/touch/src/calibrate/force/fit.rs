//! A law fitted to presses: Levenberg's and Marquardt's steps, within a mixture of presses that agree and outliers.
//!
//! Fitted is `ln S`, since hysteresis, scatter and the solver's error are shares of the conductance. With `x = ln a + gamma ln F`
//!
//! ```text
//! ln S = x - ln(1 + R e^x) + h d + noise,   d = -1 loading, +1 unloading, 0 unknown,
//! ```
//!
//! whose noise has the variance `s^2 + v`: `s` is the scatter from press to press, which is fitted, `v` the solver's own. One press in twenty is
//! taken to be anything, by a factor of `e` or so ([`OUTLIERS`], [`WIDE`]): a press slipped, a figure mistyped. Probabilities of that and the scatter
//! are found in turns with the parameters (expectation and maximisation), which makes a likelihood of it that laws are compared by.

use nalgebra::{DMatrix, DVector};

use super::{Candidate, Direction, ForcePress, Law};
use crate::solve::fit::least_squares::{LeastSquares, NormalEquations, Schedule, covariance, minimise};

/// Share of presses that may be anything, and how far off they are (of `ln S`).
const OUTLIERS: f64 = 0.05;
const WIDE: f64 = 1.0;
/// Presses that are off by no more than three times this (of `ln S`) agree, however near the others are to the law: foams press back 10 % less
/// when they are let go, and of ten presses nine may have been made the one way.
const USUAL: f64 = 0.1;
/// Smallest scatter: kitchen scales show a gram in some hundreds, and no press is repeated better.
const SMALLEST_SCATTER: f64 = 0.005;
/// Starts of the saturation: largest conductance found over that at which the law saturates.
const STARTS: [f64; 4] = [0.1, 0.5, 0.8, 0.97];
/// Smallest saturation that is followed: the rest is none.
const LEAST: f64 = 1e-6;
/// Turns of expectation and maximisation, and steps in each.
const TURNS: usize = 200;
const STEPS: usize = 30;
const SCHEDULE: Schedule = Schedule { first: 1e-3, least: 1e-9, tries: 8 };
/// What a turn has to gain (of -2 ln likelihood), or the sum of squares as a share of it, to be followed by another.
const SMALL: f64 = 1e-9;
/// Presses that a start looks at: slopes are those of all pairs.
const PAIRED: usize = 200;

/// A law, with or without curves of their own for loading and unloading.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Form {
    pub law: Law,
    pub hysteresis: bool,
    /// What is known of it, if the tip is.
    pub known: Option<Known>,
}

/// What is known of a law where tip and foam are.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Known {
    /// The exponent, unless it is fitted.
    pub exponent: Option<f64>,
    /// The constriction at 1 N, as much of it as changes with the width of the contact (ohm). The resistance in series is fitted as a factor of that and of `around_ohm`.
    pub under_ohm: f64,
    /// The rest of it (ohm).
    pub around_ohm: f64,
    /// Exponent by which the width of the contact grows with the force.
    pub width_exponent: f64,
}

impl Form {
    /// Smallest product of the resistance in series and the unit of conductance that is followed.
    fn least(&self, ln_unit_s: f64) -> f64 {
        if self.known.is_some() { LEAST * ln_unit_s.exp() } else { LEAST }
    }

    /// The exponent, where that is known.
    fn exponent(&self) -> Option<f64> {
        self.known.and_then(|known| known.exponent)
    }

    /// What the resistance in series is a factor of, under such a press (ohm): all alike where nothing is known.
    fn series_ohm(&self, point: &Point) -> f64 {
        let ohm = |known: Known| known.around_ohm + known.under_ohm * (-known.width_exponent * point.ln_force).exp();
        self.known.map_or(1.0, ohm)
    }
}

/// A press, in logarithms.
#[derive(Clone, Copy, Debug)]
pub(super) struct Point {
    ln_force: f64,
    ln_conductance: f64,
    /// Variance of the logarithm of the conductance by the solver's own account.
    variance: f64,
    /// -1 loading, +1 unloading.
    direction: f64,
}

/// A fitted form.
#[derive(Clone, Debug)]
pub(super) struct Fitted {
    pub bic: f64,
    form: Form,
    parameters: Parameters,
    /// Inverse of the normal equations, in the order of [`Parameters::slopes`], with the allowance for the parameters fitted.
    covariance: DMatrix<f64>,
    /// Variance beyond the solver's own, with that allowance.
    scatter: f64,
    /// Probability of each press that it agrees.
    agree: Vec<f64>,
}

/// `ln a`, `gamma`, `ln (R S)` with the largest conductance `S`, `h`.
#[derive(Clone, Copy, Debug)]
struct Parameters {
    form: Form,
    ln_unit_s: f64,
    ln_a: f64,
    exponent: f64,
    ln_series: f64,
    hysteresis: f64,
}

impl Point {
    pub fn of(press: &ForcePress) -> Self {
        Self {
            ln_force: press.force_n.ln(),
            ln_conductance: press.conductance_s.ln(),
            variance: (press.deviation_s / press.conductance_s).powi(2),
            direction: match press.direction {
                None => 0.0,
                Some(Direction::Loading) => -1.0,
                Some(Direction::Unloading) => 1.0,
            },
        }
    }
}

/// Fits a form to presses; `None` if they are too few for it or it makes no sense of them.
pub(super) fn fit(points: &[Point], form: Form) -> Option<Fitted> {
    let starts = starts(points, form);
    let fits = starts.into_iter().filter_map(|start| descend(points, start));
    fits.min_by(|a, b| a.bic.total_cmp(&b.bic))
}

impl Parameters {
    fn count(&self) -> usize {
        2 + usize::from(self.form.law == Law::Saturating) + usize::from(self.form.hysteresis)
    }

    /// How many of them are fitted.
    fn fitted(&self) -> usize {
        self.count() - usize::from(self.form.exponent().is_some())
    }

    /// `R e^x`.
    fn load(&self, point: &Point) -> f64 {
        match self.form.law {
            Law::Power => 0.0,
            Law::Saturating => self.form.series_ohm(point) * (self.ln_series + self.own(point) - self.ln_unit_s).exp(),
        }
    }

    fn own(&self, point: &Point) -> f64 {
        self.ln_a + self.exponent * point.ln_force
    }

    /// What is left of a press.
    fn residual(&self, point: &Point) -> f64 {
        let law = self.own(point) - self.load(point).ln_1p();
        point.ln_conductance - law - self.hysteresis * point.direction
    }

    /// Derivatives of what `ln S` should be: by `ln a`, the exponent, the logarithm of the series resistance and the hysteresis, those
    /// that there are.
    fn slopes(&self, point: &Point) -> Vec<f64> {
        let load = self.load(point);
        let own = 1.0 / (1.0 + load);
        let by_exponent = if self.form.exponent().is_some() { 0.0 } else { own * point.ln_force };
        let mut slopes = vec![own, by_exponent];
        if self.form.law == Law::Saturating {
            slopes.push(-load * own);
        }
        if self.form.hysteresis {
            slopes.push(point.direction);
        }
        slopes
    }

    fn moved(&self, step: &DVector<f64>) -> Self {
        let mut moved = *self;
        moved.ln_a += step[0];
        moved.exponent += step[1];
        if self.form.law == Law::Saturating {
            moved.ln_series = (self.ln_series + step[2].clamp(-2.0, 2.0)).max(self.form.least(self.ln_unit_s).ln());
        }
        if self.form.hysteresis {
            moved.hysteresis += step[step.len() - 1];
        }
        moved
    }
}

/// Where to begin: lines through most of the presses.
fn starts(points: &[Point], form: Form) -> Vec<Parameters> {
    let ln_unit_s = points.iter().map(|point| point.ln_conductance).fold(f64::NEG_INFINITY, f64::max);
    let start = |share: f64| {
        // Of the constriction that is known, or of all.
        let share = if form.known.is_some() { share * ln_unit_s.exp() } else { share };
        // 1 / S less what is in series, as a power of the force.
        let own = |point: &Point| {
            let series = share * form.series_ohm(point);
            let own = (-(point.ln_conductance - ln_unit_s)).exp() - series;
            (own > 0.01 * series).then(|| [point.ln_force, ln_unit_s - own.ln()])
        };
        let [ln_a, exponent] = line(&points.iter().filter_map(own).collect::<Vec<_>>(), form.exponent())?;
        let ln_series = share.max(form.least(ln_unit_s)).ln();
        Some(Parameters { form, ln_unit_s, ln_a, exponent, ln_series, hysteresis: 0.0 })
    };
    match form.law {
        Law::Power => start(0.0).into_iter().collect(),
        Law::Saturating => STARTS.iter().filter_map(|share| start(*share)).collect(),
    }
}

/// The line through points with that slope or with the median of all slopes (Theil, Sen), which a few odd points do not turn; `None` of fewer than two.
fn line(points: &[[f64; 2]], slope: Option<f64>) -> Option<[f64; 2]> {
    let step = points.len().div_ceil(PAIRED).max(1);
    let some: Vec<_> = points.iter().step_by(step).collect();
    let pairs = some.iter().enumerate().flat_map(|(i, a)| some[..i].iter().map(move |b| (*a, *b)));
    let slopes = pairs.filter(|(a, b)| (a[0] - b[0]).abs() > 1e-9).map(|(a, b)| (a[1] - b[1]) / (a[0] - b[0]));
    let slope = slope.or_else(|| median(slopes))?;
    let height = median(points.iter().map(|point| point[1] - slope * point[0]))?;
    Some([height, slope])
}

fn median(values: impl Iterator<Item = f64>) -> Option<f64> {
    let mut values: Vec<f64> = values.collect();
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied()
}

/// A mixture on its way.
struct Mixture<'a> {
    points: &'a [Point],
    parameters: Parameters,
    scatter: f64,
    agree: Vec<f64>,
}

fn descend(points: &[Point], start: Parameters) -> Option<Fitted> {
    let residuals = points.iter().map(|point| start.residual(point).abs());
    // Of a normal distribution, the median distance is 0.6745 deviations.
    let scatter = (median(residuals)? / 0.6745).max(SMALLEST_SCATTER);
    let mut mixture = Mixture { points, parameters: start, scatter, agree: vec![1.0; points.len()] };
    let mut before = f64::INFINITY;
    for _ in 0..TURNS {
        let after = mixture.expect();
        if !after.is_finite() || (before - after).abs() < SMALL {
            break;
        }
        before = after;
        mixture.maximise();
    }
    mixture.finish()
}

impl Mixture<'_> {
    /// Probabilities that presses agree; -2 ln likelihood, of what each of them rather is.
    fn expect(&mut self) -> f64 {
        // -2 ln of a normal density.
        let of = |square: f64, variance: f64| square / variance + (std::f64::consts::TAU * variance).ln();
        let mut sum = 0.0;
        for (point, agree) in self.points.iter().zip(&mut self.agree) {
            let (square, variance) = (self.parameters.residual(point).powi(2), self.scatter.powi(2) + point.variance);
            let usual = of(square, variance.max(USUAL * USUAL)) - 2.0 * (1.0 - OUTLIERS).ln();
            let odd = of(square, variance + WIDE * WIDE) - 2.0 * OUTLIERS.ln();
            *agree = 1.0 / (1.0 + (0.5 * (usual - odd)).exp());
            sum += *agree * (of(square, variance) - 2.0 * (1.0 - OUTLIERS).ln()) + (1.0 - *agree) * odd;
        }
        sum
    }

    fn weight(&self, index: usize) -> f64 {
        self.agree[index] / (self.scatter.powi(2) + self.points[index].variance)
    }

    /// The parameters, then the scatter, that these probabilities make likeliest.
    fn maximise(&mut self) {
        self.parameters = minimise(self, self.parameters, STEPS, SCHEDULE).at;
        // Where sum p (r^2 / u^2 - 1 / u) with u = s^2 + v is zero, as a fixed point.
        let (mut above, mut below) = (0.0, 0.0);
        for (index, point) in self.points.iter().enumerate() {
            let weight = self.weight(index) / (self.scatter.powi(2) + point.variance);
            above += weight * (self.parameters.residual(point).powi(2) - point.variance);
            below += weight;
        }
        self.scatter = (above / below.max(f64::MIN_POSITIVE)).max(0.0).sqrt().max(SMALLEST_SCATTER);
    }

    fn normal(&self, parameters: &Parameters) -> NormalEquations {
        let size = parameters.count();
        let (mut matrix, mut gradient) = (DMatrix::zeros(size, size), DVector::zeros(size));
        for (index, point) in self.points.iter().enumerate() {
            let slopes = DVector::from_vec(parameters.slopes(point));
            matrix.ger(self.weight(index), &slopes, &slopes, 1.0);
            gradient.axpy(self.weight(index) * parameters.residual(point), &slopes, 1.0);
        }
        NormalEquations { matrix, gradient }
    }

    fn finish(mut self) -> Option<Fitted> {
        let likelihood = self.expect();
        let (count, size) = (self.points.len() as f64, self.parameters.fitted());
        let kept: f64 = self.agree.iter().sum();
        if !likelihood.is_finite() || kept <= size as f64 {
            return None;
        }
        // Parameters take up scatter: the rest is from so many fewer presses.
        let allowance = kept / (kept - size as f64);
        let mut matrix = self.normal(&self.parameters).matrix;
        if self.parameters.form.exponent().is_some() {
            // Beside nothing: any number does.
            matrix[(1, 1)] = 1.0;
        }
        let mut covariance = covariance(&matrix)? * allowance;
        if self.parameters.form.exponent().is_some() {
            covariance[(1, 1)] = 0.0;
        }
        Some(Fitted {
            bic: likelihood + (size + 1) as f64 * count.ln(),
            form: self.parameters.form,
            parameters: self.parameters,
            covariance,
            scatter: self.scatter * allowance.sqrt(),
            agree: self.agree,
        })
    }
}

impl LeastSquares for Mixture<'_> {
    type Point = Parameters;

    fn sum(&self, at: &Parameters) -> f64 {
        let square = |(index, point): (usize, &Point)| self.weight(index) * at.residual(point).powi(2);
        self.points.iter().enumerate().map(square).sum()
    }

    fn equations(&self, at: &Parameters) -> NormalEquations {
        let mut equations = self.normal(at);
        // A parameter that no press tells stays where it is.
        (0..at.count()).for_each(|i| equations.matrix[(i, i)] += f64::MIN_POSITIVE);
        equations
    }

    fn moved(&mut self, from: &Parameters, step: &DVector<f64>) -> Option<Parameters> {
        Some(from.moved(step))
    }

    fn goes_on(&self, before: &Parameters, after: &Parameters, _equations: &NormalEquations) -> bool {
        let now = self.sum(before);
        now - self.sum(after) > SMALL * now
    }
}

impl Fitted {
    pub fn candidate(&self) -> Candidate {
        Candidate { law: self.form.law, hysteresis: self.form.hysteresis, bic: self.bic }
    }

    /// Presses that rather do not agree.
    pub fn outliers(&self) -> Vec<usize> {
        (0..self.agree.len()).filter(|press| self.agree[*press] < 0.5).collect()
    }

    /// Presses that agree, less the parameters that were fitted to them.
    pub fn freedom(&self) -> f64 {
        self.agree.iter().sum::<f64>() - self.parameters.fitted() as f64
    }

    /// How far a press is from the law, in standard deviations.
    pub fn deviations(&self, press: &ForcePress) -> f64 {
        let point = Point::of(press);
        self.parameters.residual(&point) / (self.scatter.powi(2) + point.variance).sqrt()
    }

    pub fn form(&self) -> Form {
        self.form
    }

    /// Conductance at 1 N but for what is in series (S), and its standard error.
    pub fn conductance_at_1_n_s(&self) -> [f64; 2] {
        let a_s = self.parameters.ln_a.exp();
        [a_s, a_s * self.covariance[(0, 0)].sqrt()]
    }

    /// Exponent, and its standard error.
    pub fn exponent(&self) -> [f64; 2] {
        [self.parameters.exponent, self.covariance[(1, 1)].sqrt()]
    }

    /// Resistance in series (ohm), or the factor of what is known of it, and its standard error.
    pub fn series(&self) -> Option<[f64; 2]> {
        let ohm = (self.parameters.ln_series - self.parameters.ln_unit_s).exp();
        (self.form.law == Law::Saturating).then(|| [ohm, ohm * self.covariance[(2, 2)].sqrt()])
    }

    /// What a press of such a force should conduct (S), in the middle between loading and unloading.
    pub fn conductance_s(&self, press: &ForcePress) -> f64 {
        let point = Point { direction: 0.0, ..Point::of(press) };
        press.conductance_s * (-self.parameters.residual(&point)).exp()
    }

    pub fn scatter(&self) -> f64 {
        self.scatter
    }

    /// Half the width between loading and unloading.
    pub fn hysteresis(&self) -> f64 {
        self.parameters.hysteresis.abs()
    }

    /// Covariance of `ln a`, the exponent and, if the law saturates, the resistance in series (ohm), so many times.
    pub fn covariance(&self, times: f64) -> Vec<Vec<f64>> {
        let units = [1.0, 1.0, self.series().map_or(1.0, |[ohm, _]| ohm)];
        let size = if self.form.law == Law::Saturating { 3 } else { 2 };
        let at = |i: usize, j: usize| times * units[i] * units[j] * self.covariance[(i, j)];
        (0..size).map(|i| (0..size).map(|j| at(i.min(j), i.max(j))).collect()).collect()
    }
}
