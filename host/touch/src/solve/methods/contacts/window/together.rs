//! One explanation of several frames: places and radii of contacts that all have in common, and strengths that are each frame's own.
//!
//! Least squares by Levenberg's and Marquardt's method. Frames' own parameters are eliminated (Schur's complement), and the detector's steps are
//! at their best for whatever contacts there are, as readings are linear in them.

use std::f64::consts::TAU;
use std::ops::AddAssign;

use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

use super::super::discs::{DiscFit, PARAMETERS, STAYING, among, place_m, share_of};
use super::AS_IT_IS;
use super::frames::{Frame, Window, across};
use crate::solve::fit::least_squares::{Damping, NormalEquations, Schedule, Trial};
use crate::solve::fit::policy;
use tactomo_physics::scene::Contact;
use tactomo_physics::space;

/// Steps at most, and squares that one has to be expected to gain. Errors that frames share make long valleys: with 20 steps that gain 0.5 at least a
/// finger that has moved ends 6 mm off.
const STEPS: usize = 80;
const WORTH: f64 = 0.1;
/// What of frames' own steps is tried after a try that led nowhere.
const SHORTER: f64 = 0.3;
const SCHEDULE: Schedule = Schedule { first: 1e-3, least: 1e-7, tries: 6 };

/// How contacts may differ from frame to frame besides in strength.
#[derive(Clone, Copy)]
pub(super) enum Motion {
    /// Not at all.
    Still,
    /// Places, by this standard deviation of each coordinate (m).
    Moving(f64),
    /// Places likewise, and radii.
    Growing(f64),
}

impl Motion {
    fn spread_m(self) -> Option<f64> {
        match self {
            Self::Still => None,
            Self::Moving(spread_m) | Self::Growing(spread_m) => Some(spread_m),
        }
    }
}

/// Contacts in each frame.
#[derive(Clone)]
pub(super) struct Point {
    pub fits: Vec<DiscFit>,
    /// Sum of squares that is left of all frames with the likeliest detector.
    pub cost: f64,
    /// Sum of squares of what is known before.
    known: f64,
}

/// Normal equations of what all frames have in common, and what takes a step of that to each frame's own.
struct Equations {
    common: NormalEquations,
    /// The step of what is each frame's own, one frame after the other, where what they have in common stays.
    own: DVector<f64>,
    /// How much less that is by a step of what they have in common.
    own_by_common: DMatrix<f64>,
    /// What is each frame's own.
    inner: Cholesky<f64, Dyn>,
}

impl Equations {
    /// By how much whole steps of what frames have in common, and of what is each frame's own, lower the sum of squares if readings are linear.
    fn gains(&self) -> Option<[f64; 2]> {
        let own = self.inner.l().tr_mul(&self.own).norm_squared();
        Some([self.common.step(0.0)?.dot(&self.common.gradient), own])
    }

    /// Whether steps are worth nothing more: of frames' own parameters, a square each, which noise makes of them.
    fn are_settled(&self) -> Option<bool> {
        let [common, own] = self.gains()?;
        Some(common < WORTH && own < self.own.nrows() as f64)
    }
}

/// An explanation of all frames.
#[derive(Clone)]
pub(super) struct Together {
    pub at: Point,
    pub ln_evidence: f64,
    /// Information about what all frames have in common.
    common: Cholesky<f64, Dyn>,
}

impl Point {
    /// What a descent lowers.
    pub fn squares(&self) -> f64 {
        self.cost + self.known
    }

    pub fn contacts(&self) -> Vec<Vec<Contact>> {
        self.fits.iter().map(|fit| fit.contacts.clone()).collect()
    }
}

impl Together {
    pub fn count(&self) -> usize {
        self.at.fits.first().map_or(0, |fit| fit.contacts.len())
    }

    /// Information about places and radii alone, whatever else frames have in common.
    pub fn staying(&self) -> Option<DMatrix<f64>> {
        let staying: Vec<usize> = (0..STAYING * self.count()).map(among).collect();
        let covariance = self.common.inverse().select_rows(&staying).select_columns(&staying);
        Some(Cholesky::new(covariance)?.inverse())
    }

    /// Mean of the logarithm of each contact's conductance (S).
    pub fn levels(&self) -> Vec<f64> {
        (0..self.count()).map(|k| mean_of(&self.at.fits, k, &ln_conductance)).collect()
    }
}

impl Window<'_> {
    /// The contacts that explain all frames best, from some in each frame; `None` if that makes no sense.
    pub fn explained(&self, start: Vec<Vec<Contact>>, motion: Motion) -> Option<Together> {
        let mut at = self.with_slopes(start, motion)?;
        let mut equations = self.equations(&at, motion)?;
        let mut damping = Damping::new(SCHEDULE);
        let mut is_renewed = true;
        for _ in 0..STEPS {
            if equations.are_settled()? {
                break;
            }
            // What is each frame's own is not damped: each try takes less of that.
            let mut of_own = 1.0;
            let next = damping.step(&equations.common, |step| {
                let next = self.moved(&at, &equations, (step, of_own), motion);
                of_own *= SHORTER;
                next.filter(|next| next.squares() < at.squares()).map_or(Trial::Rejected, Trial::Accepted)
            });
            let gained = next.as_ref().map_or(0.0, |next| at.squares() - next.squares());
            at = next.unwrap_or(at);
            if gained < WORTH {
                // The derivatives may be too old for a step that lowers anything.
                if is_renewed {
                    break;
                }
                at = self.with_slopes(at.contacts(), motion)?;
            }
            is_renewed = gained < WORTH;
            equations = self.equations(&at, motion)?;
        }
        self.judged(at, &equations, motion)
    }

    /// Contacts in each frame, with derivatives taken there.
    fn with_slopes(&self, contacts: Vec<Vec<Contact>>, motion: Motion) -> Option<Point> {
        let pairs = contacts.into_iter().zip(&self.frames);
        let fits = pairs.map(|(contacts, frame)| self.fitter.fit(contacts, &frame.target, AS_IT_IS));
        self.at(fits.collect::<Option<_>>()?, motion)
    }

    fn at(&self, fits: Vec<DiscFit>, motion: Motion) -> Option<Point> {
        let (residuals, squares) = self.residuals(&fits);
        let pull = self.pull(&residuals)?;
        let cost = squares - pull.dot(&self.factor.solve(&pull));
        let known = self.known(&fits, motion);
        (cost + known).is_finite().then_some(Point { fits, cost, known })
    }

    /// Sum of squares of what is known before.
    fn known(&self, fits: &[DiscFit], motion: Motion) -> f64 {
        let common: f64 = (0..fits[0].contacts.len()).flat_map(|k| self.unusual(fits, k)).map(|off| off * off).sum();
        let own = |(index, fit): (usize, &DiscFit)| -> f64 {
            let off = self.off(fits, index, motion);
            let (_, scales) = self.own_parameters(fit, motion);
            off.iter().zip(&scales).map(|(off, scale)| (off / scale).powi(2)).sum()
        };
        common + fits.iter().enumerate().map(own).sum::<f64>()
    }

    /// How far mean strength and radius of a contact are from what is usual, in standard deviations.
    fn unusual(&self, fits: &[DiscFit], k: usize) -> [f64; 2] {
        [
            (mean_of(fits, k, &ln_conductance) - self.fitter.sheet_s.ln()) / policy::CONDUCTANCE_DEVIATION,
            (mean_of(fits, k, &ln_radius) - self.fitter.usual_radius_m.ln()) / self.fitter.radius_deviation,
        ]
    }

    /// Which parameters of a frame's contacts are its own, and the standard deviation of each before.
    fn own_parameters(&self, fit: &DiscFit, motion: Motion) -> (Vec<usize>, Vec<f64>) {
        let (units_m, mut parameters, mut deviations) = (fit.units_m(), Vec::new(), Vec::new());
        for (k, unit_m) in units_m.iter().enumerate() {
            parameters.push(PARAMETERS * k + 2);
            deviations.push(policy::STRENGTH_DEVIATION / (1.0 + fit.constriction(k)));
            if let Some(spread_m) = motion.spread_m() {
                parameters.extend([PARAMETERS * k, PARAMETERS * k + 1]);
                deviations.extend([spread_m / unit_m; 2]);
            }
            if let Motion::Growing(_) = motion {
                parameters.push(PARAMETERS * k + 3);
                deviations.push(policy::GROWTH_DEVIATION);
            }
        }
        (parameters, deviations)
    }

    /// How far a frame's own parameters are from their means over all frames.
    fn off(&self, fits: &[DiscFit], index: usize, motion: Motion) -> Vec<f64> {
        let fit = &fits[index];
        let mut all = Vec::new();
        for (k, contact) in fit.contacts.iter().enumerate() {
            let mean = |of: &dyn Fn(&Contact) -> f64| mean_of(fits, k, of);
            all.push((contact.conductance_s.ln() - mean(&ln_conductance)) / (1.0 + fit.constriction(k)));
            if motion.spread_m().is_some() {
                let (along, unit_m) = fit.along(k);
                let mean_m = [0, 1, 2].map(|axis| mean(&|contact| place_m(contact)[axis]));
                let way_m = space::sub(place_m(contact), mean_m);
                all.extend(along.map(|direction| space::dot(direction, way_m) / unit_m));
            }
            if let Motion::Growing(_) = motion {
                all.push(contact.radius_m.ln() - mean(&ln_radius));
            }
        }
        all
    }

    fn equations(&self, at: &Point, motion: Motion) -> Option<Equations> {
        let (discs, unknowns) = (PARAMETERS * at.fits[0].contacts.len(), self.of_detector.nrows());
        let size = discs + unknowns;
        let (mut matrix, mut gradient) = (DMatrix::zeros(size, size), DVector::zeros(size));
        // What is known before is one of each unknown of the detector.
        matrix.view_mut((discs, discs), (unknowns, unknowns)).copy_from(&self.of_detector);
        let slopes = |(fit, frame): (&DiscFit, &Frame)| frame.target.at(&fit.volts).whitened_columns(fit.slopes_v());
        let slopes: Vec<_> = at.fits.iter().zip(&self.frames).map(slopes).collect();
        let across = across(&self.between, &slopes);
        let (residuals, _) = self.residuals(&at.fits);
        let own_parameters: Vec<_> = at.fits.iter().map(|fit| self.own_parameters(fit, motion)).collect();
        let mut inner = self.information_of_own(&slopes, &own_parameters);
        let own_size = inner.nrows() / at.fits.len();
        let (mut coupling, mut own_pull) = (DMatrix::zeros(inner.nrows(), size), DVector::zeros(inner.nrows()));
        for index in 0..at.fits.len() {
            let slopes = slopes[index].transpose();
            let mut rows = DMatrix::zeros(discs, size);
            rows.columns_mut(0, discs).copy_from(&(&slopes * &across[index]));
            rows.columns_mut(discs, unknowns).copy_from(&(&slopes * &self.patterns[index]));
            matrix.rows_mut(0, discs).add_assign(&rows);
            let pull = &slopes * &residuals[index];
            gradient.rows_mut(0, discs).add_assign(&pull);
            let (parameters, deviations) = &own_parameters[index];
            let first = own_size * index;
            coupling.rows_mut(first, own_size).copy_from(&rows.select_rows(parameters));
            own_pull.rows_mut(first, own_size).copy_from(&pull.select_rows(parameters));
            for (i, (deviation, off)) in deviations.iter().zip(self.off(&at.fits, index, motion)).enumerate() {
                inner[(first + i, first + i)] += deviation.powi(-2);
                own_pull[first + i] -= off * deviation.powi(-2);
            }
        }
        let factor = Cholesky::new(inner)?;
        let (own, own_by_common) = (factor.solve(&own_pull), factor.solve(&coupling));
        matrix.gemm_tr(-1.0, &coupling, &own_by_common, 1.0);
        gradient.gemv_tr(-1.0, &coupling, &own, 1.0);
        gradient.rows_mut(discs, unknowns).add_assign(&self.pull(&residuals)?);
        for row in discs..size {
            (0..discs).for_each(|column| matrix[(row, column)] = matrix[(column, row)]);
        }
        self.add_known(at, &mut matrix, &mut gradient);
        Some(Equations { common: NormalEquations { matrix, gradient }, own, own_by_common, inner: factor })
    }

    /// Information of all frames about what is each frame's own, one frame after the other.
    fn information_of_own(&self, slopes: &[DMatrix<f64>], own: &[(Vec<usize>, Vec<f64>)]) -> DMatrix<f64> {
        let slopes: Vec<_> = slopes.iter().zip(own).map(|(all, (own, _))| all.select_columns(own)).collect();
        let size = slopes.first().map_or(0, DMatrix::ncols);
        let mut inner = DMatrix::zeros(size * slopes.len(), size * slopes.len());
        for (i, j) in (0..slopes.len()).flat_map(|i| (0..slopes.len()).map(move |j| (i, j))) {
            inner.view_mut((size * i, size * j), (size, size)).gemm_tr(
                self.between[(i, j)],
                &slopes[i],
                &slopes[j],
                0.0,
            );
        }
        inner
    }

    /// Adds what is known before of what all frames have in common.
    fn add_known(&self, at: &Point, matrix: &mut DMatrix<f64>, gradient: &mut DVector<f64>) {
        let fit = &at.fits[0];
        for k in 0..fit.contacts.len() {
            let place = fit.along(k).1.powi(2) / self.fitter.place_variance_m2;
            (0..2).for_each(|axis| matrix[(PARAMETERS * k + axis, PARAMETERS * k + axis)] += place);
            let (level, radius) = (PARAMETERS * k + 2, PARAMETERS * k + 3);
            let by_level = (1.0 + fit.constriction(k)) / policy::CONDUCTANCE_DEVIATION;
            matrix[(level, level)] += by_level * by_level;
            let [strength_off, radius_off] = self.unusual(&at.fits, k);
            gradient[level] -= by_level * strength_off;
            let by_radius = 1.0 / self.fitter.radius_deviation;
            matrix[(radius, radius)] += by_radius * by_radius;
            gradient[radius] -= by_radius * radius_off;
        }
    }

    /// All frames' contacts after a step of what they have in common, and of each frame's own that follows, with so much of what that would take besides.
    fn moved(
        &self,
        at: &Point,
        equations: &Equations,
        (step, of_own): (&DVector<f64>, f64),
        motion: Motion,
    ) -> Option<Point> {
        let own = &equations.own * of_own - &equations.own_by_common * step;
        let of_frame = |(index, fit): (usize, &DiscFit)| {
            let mut all = step.rows(0, PARAMETERS * fit.contacts.len()).into_owned();
            let (parameters, _) = self.own_parameters(fit, motion);
            let own = own.rows(parameters.len() * index, parameters.len());
            parameters.iter().zip(own.iter()).for_each(|(parameter, own)| all[*parameter] += own);
            all
        };
        let steps: Vec<_> = at.fits.iter().enumerate().map(of_frame).collect();
        // Where one frame's step is too long all are as much shorter, or what all frames have in common would part.
        let share = steps.iter().map(|step| share_of(step.as_slice())).fold(1.0, f64::min);
        let moved = |((fit, step), frame): ((&DiscFit, &DVector<f64>), &Frame)| {
            self.fitter.next(fit, self.fitter.moved(fit, (step * share).as_slice()), &frame.target)
        };
        let fits = at.fits.iter().zip(&steps).zip(&self.frames).map(moved).collect::<Option<_>>()?;
        self.at(fits, motion)
    }

    /// By how much more than noise alone makes of it the sum of squares would be lowered if what stays moved: Rao's score, less what is expected of it.
    pub fn gain_by_motion(&self, still: &Together, motion: Motion) -> Option<f64> {
        let of = |motion| {
            let equations = self.equations(&still.at, motion)?;
            Some(equations.gains()?.iter().sum::<f64>() - self.determined(&still.at, &equations, motion))
        };
        Some(of(motion)? - of(Motion::Still)?)
    }

    /// How many of frames' own parameters the readings determine, which explain as many squares of noise: what is known of them before does the rest.
    fn determined(&self, at: &Point, equations: &Equations, motion: Motion) -> f64 {
        let before = at.fits.iter().flat_map(|fit| self.own_parameters(fit, motion).1);
        let after = equations.inner.inverse().diagonal();
        before.zip(after.iter()).map(|(before, after)| 1.0 - after / (before * before)).sum()
    }

    /// An explanation with the logarithm of its evidence.
    fn judged(&self, at: Point, equations: &Equations, motion: Motion) -> Option<Together> {
        let Point { fits, cost, known } = &at;
        let count = fits[0].contacts.len();
        let (_, deviations) = self.own_parameters(&fits[0], motion);
        let peak = -(policy::CONDUCTANCE_DEVIATION * TAU.sqrt()).ln() - policy::FEWER_NATS;
        let peaks_of_own: f64 = fits
            .iter()
            .map(|fit| self.own_parameters(fit, motion).1.iter().map(|one| -(one * TAU.sqrt()).ln()).sum::<f64>())
            .sum();
        let from_logs: f64 = (0..count).map(|k| fits[0].constriction(k).ln_1p()).sum();
        let orders: f64 = (1..=count).map(|k| (k as f64).ln()).sum();
        let parameters = PARAMETERS * count + fits.len() * deviations.len();
        let common = Cholesky::new(equations.common.matrix.clone())?;
        let ln_evidence = -0.5 * (cost + known)
            + count as f64 * peak
            + self.finder.prior.ln_peak_of_staying(&fits[0].units_m())
            + from_logs
            + peaks_of_own
            + orders
            + 0.5 * parameters as f64 * TAU.ln()
            - 0.5 * (equations.inner.ln_determinant() + common.ln_determinant());
        Some(Together { ln_evidence, common, at })
    }
}

fn ln_conductance(contact: &Contact) -> f64 {
    contact.conductance_s.ln()
}

fn ln_radius(contact: &Contact) -> f64 {
    contact.radius_m.ln()
}

/// Mean of something of a contact over all frames.
fn mean_of(fits: &[DiscFit], k: usize, of: &dyn Fn(&Contact) -> f64) -> f64 {
    fits.iter().map(|fit| of(&fit.contacts[k])).sum::<f64>() / fits.len() as f64
}
