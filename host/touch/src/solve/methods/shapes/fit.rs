//! A strip fitted to readings: Levenberg's and Marquardt's steps on the full contact physics.
//!
//! With `F` the potentials under the nodes that conduct, a parameter `p` changes the impedances by `-F' diag(dC/dp) F`. The change of the
//! nodes' conductances `C` is the difference of two strips, which costs next to nothing.

use nalgebra::{DMatrix, DVector};

use super::strip::{Course, Ground, Strip};
use crate::solve::fit::evidence::Evidence;
use crate::solve::fit::least_squares::{LeastSquares, Minimum, NormalEquations, Schedule, covariance, minimise};
use crate::solve::fit::target::Target;
use tactomo_physics::detector::Detector;
use tactomo_physics::forward::{ContactFields, ForwardModel, readings_v};
use tactomo_physics::geometry::Point;

/// Differences: of places in usual widths, and of logarithms.
const DIFFERENCE: f64 = 1e-5;
/// Longest step of a coordinate, in mean distances of electrodes, and of a logarithm. A longer one is taken as a whole as much shorter, which keeps
/// its direction: with each parameter cut by itself, lines left for where the sum of squares is higher than on the way.
const LONGEST_WAY: f64 = 0.5;
const LONGEST_LOG: f64 = 0.5;
const SCHEDULE: Schedule = Schedule { first: 1e-3, least: 1e-6, tries: 5 };
/// Share of the sum that a step gains below which it is the last.
const LEAST_GAIN: f64 = 2e-3;
/// A descent that is so many times above its bound may hope for a factor that is this power of what its last step brought, and where that was cut short,
/// of what a whole one would have: without regard to that, lines that would have fitted were given up after their first step.
const FAR: f64 = 100.0;
const HOPE: f64 = 12.0;
/// Narrowest strip, in usual widths: below, the readings no longer tell.
const NARROWEST: f64 = 0.02;
/// Widest strip, in mean distances of electrodes: what is wider is a disc's or an image's business.
const WIDEST: f64 = 0.7;
/// How far a line ends beyond an edge is not known; so far is taken as usual (usual widths), as a standard deviation.
const BEYOND: f64 = 0.5;
/// Rows of residuals for what is known before: width, conductance, and each coordinate of a line's ends.
pub(super) const PRIOR_ROWS: usize = 6;

/// A strip that fits best.
#[derive(Clone, Debug)]
pub(crate) struct StripFit {
    pub(super) laid: Laid,
    /// What it leaves of the frame, and what it takes for that.
    evidence: Evidence,
    /// Of the parameters, in the order of [`Strip::layout`].
    pub covariance: Option<DMatrix<f64>>,
    pub settled: bool,
}

/// A strip on a model, with what that makes of it.
#[derive(Clone, Debug)]
pub(super) struct Laid {
    pub strip: Strip,
    /// Conductance of each node (S).
    image_s: Vec<f64>,
    /// At the nodes that conduct.
    fields: ContactFields,
    volts: Vec<f64>,
}

impl StripFit {
    /// The strip.
    pub fn strip(&self) -> &Strip {
        &self.laid.strip
    }

    /// What it leaves of the frame, and what it takes for that.
    pub fn evidence(&self) -> Evidence {
        self.evidence
    }
}

/// What is known of strips before anything is read.
#[derive(Clone, Copy, Debug)]
pub(super) struct Usual {
    /// Width (m), and the standard deviation of its logarithm.
    pub width_m: f64,
    pub width_deviation: f64,
    /// Conductance (S), and the standard deviation of its logarithm.
    pub conductance_s: f64,
    pub conductance_deviation: f64,
    /// Mean distance of electrodes (m).
    pub spacing_m: f64,
    /// Corners of the detector's box.
    pub bounds_m: [Point; 2],
    /// Area that strips can be on (m2).
    pub area_m2: f64,
}

impl Usual {
    /// Of a circle: the shorter side of the detector (m).
    pub fn largest_radius_m(&self) -> f64 {
        let [low, high] = self.bounds_m;
        (high[0] - low[0]).min(high[1] - low[1])
    }
}

/// What fits need beside the target.
pub(super) struct StripFitter<'a> {
    pub model: &'a dyn ForwardModel,
    pub ground: &'a Ground,
    /// The detector as measured.
    pub detector: &'a Detector,
    pub usual: &'a Usual,
}

/// A strip with what it leaves of readings.
pub(super) struct Look {
    laid: Laid,
    /// Whitened; then those of what is known before.
    pub residuals: DVector<f64>,
}

/// A fitter on its way to a target.
struct Descent<'a> {
    fitter: &'a StripFitter<'a>,
    target: &'a Target,
    /// It is given up where it will hardly come below this sum.
    most: f64,
    /// What was taken of the step that was tried last.
    share: f64,
}

impl LeastSquares for Descent<'_> {
    type Point = Look;

    fn sum(&self, at: &Look) -> f64 {
        at.residuals.norm_squared()
    }

    fn equations(&self, at: &Look) -> NormalEquations {
        NormalEquations::of(&self.fitter.slopes(&at.laid, self.target), &at.residuals)
    }

    fn moved(&mut self, from: &Look, step: &DVector<f64>) -> Option<Look> {
        self.share = self.fitter.share_of(&from.laid.strip, step.as_slice());
        let laid = self.fitter.lay(from.laid.strip.moved((step * self.share).as_slice()))?;
        Some(self.fitter.look(laid, self.target))
    }

    fn is_negligible(&self, at: &Look, equations: &NormalEquations, step: &DVector<f64>) -> bool {
        equations.gain(step) < LEAST_GAIN * self.sum(at)
    }

    fn goes_on(&self, before: &Look, after: &Look, _equations: &NormalEquations) -> bool {
        let (before, after) = (self.sum(before), self.sum(after));
        let hoped = after * (after / before).powf(HOPE / self.share);
        let may_come_below = after < FAR * self.most || hoped < self.most;
        before - after >= LEAST_GAIN * before && may_come_below
    }
}

impl StripFitter<'_> {
    /// A strip on the model; `None` if it makes no sense there.
    pub fn lay(&self, strip: Strip) -> Option<Laid> {
        let strip = self.limited(strip);
        let image_s = self.ground.conductances_s(&strip);
        let fields = self.model.touched_fields(&image_s).ok()?;
        let volts = readings_v(&fields.impedance_ohm, self.detector).volts().to_vec();
        volts.iter().all(|volts| volts.is_finite()).then_some(Laid { strip, image_s, fields, volts })
    }

    /// The nearest minimum from a start, in at most so many steps.
    pub fn fit(&self, start: Laid, target: &Target, steps: usize) -> StripFit {
        self.fit_below(f64::INFINITY, start, target, steps)
    }

    /// The same, given up where it will hardly come below a sum of squares.
    pub fn fit_below(&self, most: f64, start: Laid, target: &Target, steps: usize) -> StripFit {
        let start = self.look(start, target);
        let found = minimise(&mut Descent { fitter: self, target, most, share: 1.0 }, start, steps, SCHEDULE);
        let Minimum { at: look, matrix, settled } = found;
        let (Look { laid, residuals }, matrix) = (look, matrix.as_ref());
        let cost = residuals.rows(0, laid.volts.len()).norm_squared();
        let price = self.usual.price(&laid.strip, residuals.norm_squared() - cost, matrix);
        let evidence = Evidence { cost, price, parameters: laid.strip.parameters() as f64 };
        StripFit { laid, evidence, covariance: matrix.and_then(covariance), settled }
    }

    pub fn look(&self, laid: Laid, target: &Target) -> Look {
        let (strip, usual) = (&laid.strip, self.usual);
        let mut residuals = target.residuals(&laid.volts);
        residuals.push(-(strip.width_m / usual.width_m).ln() / usual.width_deviation);
        residuals.push(-(strip.conductance_s / usual.conductance_s).ln() / usual.conductance_deviation);
        residuals.extend(self.beyond(strip).map(|deviations| -deviations));
        Look { residuals: DVector::from_vec(residuals), laid }
    }

    /// How far the ends of a line are beyond the edges, in deviations.
    fn beyond(&self, strip: &Strip) -> [f64; PRIOR_ROWS - 2] {
        let Course::Line(ends_m) = strip.course else { return [0.0; PRIOR_ROWS - 2] };
        std::array::from_fn(|coordinate| {
            let (at_m, axis) = (ends_m[coordinate / 2][coordinate % 2], coordinate % 2);
            let inside_m = at_m.clamp(self.usual.bounds_m[0][axis], self.usual.bounds_m[1][axis]);
            (at_m - inside_m) / (BEYOND * self.usual.width_m)
        })
    }

    /// Derivatives of what the residuals are the distance to, by the parameters.
    pub fn slopes(&self, laid: &Laid, target: &Target) -> DMatrix<f64> {
        let (layout, readings) = (laid.strip.layout(), laid.volts.len());
        let target = target.at(&laid.volts);
        let mut slopes = DMatrix::zeros(readings + PRIOR_ROWS, laid.strip.parameters());
        let touched: Vec<_> = (0..laid.image_s.len()).filter(|node| laid.image_s[*node] > 0.0).collect();
        for (parameter, mut slope) in slopes.column_iter_mut().enumerate() {
            let is_place = parameter < layout.coordinates;
            let mut step = vec![0.0; laid.strip.parameters()];
            step[parameter] = if is_place { DIFFERENCE * self.usual.width_m } else { DIFFERENCE };
            let moved = laid.strip.moved(&step);
            let change_s =
                |node: &usize| (self.ground.conductance_s(&moved, *node) - laid.image_s[*node]) / step[parameter];
            let changes_s = DVector::from_iterator(touched.len(), touched.iter().map(change_s));
            let slope = &mut slope.as_mut_slice()[..readings];
            self.readings_slope(&laid.fields, &changes_s, slope);
            target.whiten(slope);
        }
        slopes[(readings, layout.width)] = 1.0 / self.usual.width_deviation;
        slopes[(readings + 1, layout.conductance)] = 1.0 / self.usual.conductance_deviation;
        for (coordinate, _) in self.beyond(&laid.strip).iter().enumerate().filter(|(_, beyond)| **beyond != 0.0) {
            slopes[(readings + 2 + coordinate, coordinate)] = 1.0 / (BEYOND * self.usual.width_m);
        }
        slopes
    }

    /// Changes of the readings (V) with changes of the conductances of the nodes that conduct (S): of
    /// `V[g][e] = Vcc (1 - Z[e][g] / (Z[g][g] + R))`.
    fn readings_slope(&self, fields: &ContactFields, changes_s: &DVector<f64>, slope: &mut [f64]) {
        let mut scaled = fields.nodes_ohm.clone();
        scaled.column_iter_mut().for_each(|mut column| column.component_mul_assign(changes_s));
        let change_ohm = -fields.nodes_ohm.tr_mul(&scaled);
        let impedance_ohm = &fields.impedance_ohm;
        let n = impedance_ohm.nrows();
        for (g, row) in slope.chunks_exact_mut(n).enumerate() {
            let load_ohm = impedance_ohm[(g, g)] + self.detector.on_resistance_ohm;
            for (e, value) in row.iter_mut().enumerate() {
                let share = impedance_ohm[(e, g)] / load_ohm;
                *value = -self.detector.drive_v * (change_ohm[(e, g)] - share * change_ohm[(g, g)]) / load_ohm;
            }
        }
    }

    /// What of a step is taken: all of it, unless it is too long.
    fn share_of(&self, strip: &Strip, step: &[f64]) -> f64 {
        let coordinates = strip.layout().coordinates;
        let limit =
            |parameter: usize| if parameter < coordinates { LONGEST_WAY * self.usual.spacing_m } else { LONGEST_LOG };
        step.iter().enumerate().map(|(parameter, step)| limit(parameter) / step.abs()).fold(1.0, f64::min)
    }

    /// The strip within what is possible.
    fn limited(&self, mut strip: Strip) -> Strip {
        let [low, high] = self.usual.bounds_m;
        let inside = |at: Point| [0, 1].map(|axis| at[axis].clamp(low[axis], high[axis]));
        let mut widest_m = WIDEST * self.usual.spacing_m;
        match &mut strip.course {
            Course::Line(_) => {}
            Course::Ring { centre_m, radius_m } => {
                *centre_m = inside(*centre_m);
                *radius_m = radius_m.clamp(NARROWEST * self.usual.width_m, self.usual.largest_radius_m());
                widest_m = widest_m.min(2.0 * *radius_m);
            }
        }
        strip.width_m = strip.width_m.clamp(NARROWEST * self.usual.width_m, widest_m);
        strip
    }
}
