//! Least squares of a few discs: Levenberg and Marquardt's method on their places, conductances and radii, with the forward model
//! itself.
//!
//! Derivatives are kept as long as the discs are near to where they were taken: then a step costs one answer of the forward model,
//! and a very small one none, as the readings follow the derivatives.

mod fit;
mod place_cost;
mod slopes;
mod still;

use std::sync::Arc;

use nalgebra::{DMatrix, DVector};

pub(super) use self::fit::DiscFit;
pub(super) use self::place_cost::PlaceCost;
use self::slopes::Slopes;
pub(super) use self::still::{STAYING, Still, among};
use super::on_detector::is_near_edge;
use crate::solve::fit::dot::dot;
use crate::solve::fit::least_squares::{Damping, NormalEquations, Schedule, Trial, covariance};
use crate::solve::fit::policy;
use crate::solve::fit::target::Target;
use crate::solve::problem::Problem;
use tactomo_physics::detector::Detector;
use tactomo_physics::forward::spots::SpotFields;
use tactomo_physics::forward::{ForwardModel, readings_v};
use tactomo_physics::scene::Contact;
use tactomo_physics::space::{self, Place};

/// Parameters of a disc: its place along two directions in radii, logarithm of the conductance of the contact with the crowded current
/// under it, logarithm of the radius.
///
/// A firm disc that is narrower and conducts better acts nearly as before: what counts is the resistance `A = 1/C + S r0 / r`, where `S`,
/// of the crowded current under the disc of radius `r0`, is found from the derivatives by conductance and radius. In `A` and `r` the
/// readings are nearly linear, and the valley of fits that are nearly as good is straight.
pub(super) const PARAMETERS: usize = 4;
/// Longest way in a step, in radii, and longest changes of the logarithms of a conductance and of a radius: where contacts are too
/// few, a fit would make them as wide as it can, at the highest cost.
const LONGEST_WAY: f64 = 2.0;
const LONGEST_CONDUCTANCE: f64 = 1.0;
const LONGEST_RADIUS: f64 = 0.25;
/// A fit that may gain no more than this is settled, however it ended: it is within one standard error of the best.
const SETTLED: f64 = 1.0;
/// Share of the expected gain that a step has to bring, or derivatives are taken anew.
const TRUE: f64 = 0.5;
/// Widest radius of a disc, in halves of the side of a square of the detector's area, or of its outline's shorter side: what is wider
/// is an image's business.
const WIDEST: f64 = 0.6;
const SCHEDULE: Schedule = Schedule { first: 1e-3, least: 1e-7, tries: 6 };
/// Smallest radius, in usual ones.
const NARROWEST: f64 = 0.05;

/// How far a fit goes.
#[derive(Clone, Copy, Debug)]
pub(super) struct Effort {
    /// Steps at most.
    pub steps: usize,
    /// Ends where a step is expected to lower the sum of squares by less,
    pub gain: f64,
    /// or by less than this share of what noise does not explain.
    pub share: f64,
}

/// What disc fits need beside the target.
pub(super) struct DiscFitter<'a> {
    pub model: &'a dyn ForwardModel,
    pub usual_radius_m: f64,
    /// Standard deviation of the logarithm of a radius before anything is read.
    pub radius_deviation: f64,
    pub sheet_s: f64,
    /// Variance of each coordinate of a place (m2) before anything is read.
    pub place_variance_m2: f64,
    /// Where a disc may be.
    pub fields: &'a dyn SpotFields,
    /// Widest radius (m).
    pub widest_m: f64,
    /// The detector as measured.
    pub detector: &'a Detector,
}

/// Widest radius of a disc on a detector (m).
pub(super) fn widest_m(problem: &Problem) -> f64 {
    let area_m2: f64 = problem.jacobian.image_mesh.node_areas_m2.iter().sum();
    let [width_m, height_m] = problem.detector().outline.size_m();
    0.5 * WIDEST * area_m2.sqrt().min(width_m).min(height_m)
}

impl DiscFitter<'_> {
    /// The nearest minimum from a start; `None` if the start makes no sense.
    pub fn fit(&self, start: Vec<Contact>, target: &Target, effort: Effort) -> Option<DiscFit> {
        self.fit_still(start, None, target, effort)
    }

    /// The same of contacts that stay where they are.
    pub fn fit_still(
        &self,
        start: Vec<Contact>,
        still: Option<Arc<Still>>,
        target: &Target,
        effort: Effort,
    ) -> Option<DiscFit> {
        let start = start.into_iter().map(|contact| self.held(contact)).collect();
        self.descend(self.anew(start, still, target)?, target, effort)
    }

    /// The nearest minimum for other readings from a fit to some.
    pub fn go_on(&self, from: &DiscFit, target: &Target, effort: Effort) -> Option<DiscFit> {
        let (contacts, volts) = (from.contacts.clone(), from.volts.clone());
        self.descend(self.at((contacts, volts), Arc::clone(&from.slopes), from.still.clone(), target)?, target, effort)
    }

    fn descend(&self, mut fit: DiscFit, target: &Target, effort: Effort) -> Option<DiscFit> {
        let mut damping = Damping::new(SCHEDULE);
        let mut gained = f64::INFINITY;
        for done in 0..=effort.steps {
            let equations = NormalEquations { matrix: fit.normal.clone(), gradient: self.gradient(&fit, target) };
            let possible = equations.step(0.0).map(|step| equations.gradient.dot(&step));
            // A fit that is far off is wrong: it need not be wrong to many digits.
            let enough = effort.gain.max(effort.share * (fit.objective() - target.count() as f64));
            if possible.is_some_and(|possible| possible < enough) {
                fit.settled = true;
                break;
            }
            if done == effort.steps {
                // Where a contact is at a bound, what would be possible beyond it is not.
                fit.settled = possible.is_some_and(|possible| possible.min(gained) < SETTLED);
                break;
            }
            let Some((next, expected)) = self.step(&fit, target, &equations, &mut damping) else {
                // The derivatives may be too old for a step that lowers anything.
                if fit.contacts != fit.slopes.at {
                    fit = self.anew(fit.contacts, fit.still, target)?;
                    continue;
                }
                fit.settled = true;
                break;
            };
            gained = fit.objective() - next.objective();
            fit = next;
            if gained < TRUE * expected && fit.contacts != fit.slopes.at {
                fit = self.anew(fit.contacts, fit.still, target)?;
            }
        }
        fit.place_costs = self.place_costs(&fit, target);
        Some(fit)
    }

    /// What a fit would leave with each contact elsewhere, of those near edges.
    fn place_costs(&self, fit: &DiscFit, target: &Target) -> Vec<Option<PlaceCost>> {
        let Some(covariance) = fit.covariance() else { return Vec::new() };
        let is_near = |k: usize| is_near_edge(fit, k, &covariance, self.fields);
        let near: Vec<bool> = (0..fit.contacts.len()).map(is_near).collect();
        if !near.contains(&true) {
            return Vec::new();
        }
        let gradient = self.gradient(fit, target);
        if near.len() == 1 {
            return vec![self.place_cost(fit, target, &gradient)];
        }
        let step = &covariance * gradient;
        let of = |(k, is_near): (usize, bool)| is_near.then(|| self.linear_place_cost(fit, k, &covariance, &step));
        near.into_iter().enumerate().map(|near| of(near).flatten()).collect()
    }

    /// A step that lowers what is left, and by how much it was expected to; `None` if there is none.
    fn step(
        &self,
        fit: &DiscFit,
        target: &Target,
        equations: &NormalEquations,
        damping: &mut Damping,
    ) -> Option<(DiscFit, f64)> {
        damping.step(equations, |step| {
            let contacts = self.moved(fit, step.as_slice());
            match self.next(fit, contacts, target) {
                Some(next) if next.objective() <= fit.objective() => Trial::Accepted((next, equations.gain(step))),
                _ => Trial::Rejected,
            }
        })
    }

    /// A fit at other contacts: with the derivatives that there are, unless it is far from where they were taken.
    pub fn next(&self, fit: &DiscFit, contacts: Vec<Contact>, target: &Target) -> Option<DiscFit> {
        let offset = fit.slopes.offset(&contacts);
        if fit.is_far(&offset) {
            return self.anew(contacts, fit.still.clone(), target);
        }
        let volts = match fit.is_linear(&offset) {
            true => {
                let mut volts = fit.slopes.volts.clone();
                for (slope, offset) in fit.slopes.by.iter().zip(&offset) {
                    volts.iter_mut().zip(slope).for_each(|(volts, slope)| *volts += offset * slope);
                }
                volts
            }
            false => self.volts(&contacts)?,
        };
        let (cost, known) = (target.cost(&volts), self.known(&contacts, fit.still.as_deref()));
        let (slopes, normal, still) = (Arc::clone(&fit.slopes), fit.normal.clone(), fit.still.clone());
        cost.is_finite().then_some(DiscFit {
            contacts,
            volts,
            cost,
            known,
            still,
            slopes,
            normal,
            place_costs: Vec::new(),
            settled: false,
        })
    }

    /// A fit with derivatives taken where it is.
    fn anew(&self, contacts: Vec<Contact>, still: Option<Arc<Still>>, target: &Target) -> Option<DiscFit> {
        let slopes = Arc::new(self.slopes(contacts)?);
        self.at((slopes.at.clone(), slopes.volts.clone()), slopes, still, target)
    }

    fn at(
        &self,
        (contacts, volts): (Vec<Contact>, Vec<f64>),
        slopes: Arc<Slopes>,
        still: Option<Arc<Still>>,
        target: &Target,
    ) -> Option<DiscFit> {
        let (cost, known) = (target.cost(&volts), self.known(&contacts, still.as_deref()));
        let normal = self.normal(&slopes, still.as_deref(), target);
        cost.is_finite().then_some(DiscFit {
            contacts,
            volts,
            cost,
            known,
            still,
            slopes,
            normal,
            place_costs: Vec::new(),
            settled: false,
        })
    }

    /// Covariance of a fit's parameters if its errors were those of another target; `None` where they are not determined.
    pub fn covariance(&self, fit: &DiscFit, target: &Target) -> Option<DMatrix<f64>> {
        covariance(&self.normal(&fit.slopes, fit.still.as_deref(), target))
    }

    fn normal(&self, slopes: &Slopes, still: Option<&Still>, target: &Target) -> DMatrix<f64> {
        let size = slopes.by.len();
        let whitened = target.at(&slopes.volts).whitened_columns(&slopes.by);
        let mut normal = DMatrix::zeros(size, size);
        for i in 0..size {
            for j in 0..=i {
                let product = dot(whitened.column(i).as_slice(), whitened.column(j).as_slice());
                (normal[(i, j)], normal[(j, i)]) = (product, product);
            }
        }
        for (k, contact) in slopes.at.iter().enumerate() {
            let place = contact.radius_m * contact.radius_m / self.place_variance_m2;
            (0..2).for_each(|i| normal[(PARAMETERS * k + i, PARAMETERS * k + i)] += place);
            let weight = self.usual_strength(still, k)[1].powi(-2);
            let [by_first, by_second] = by_parameters(slopes.constriction[k]);
            let (c, r) = (PARAMETERS * k + 2, PARAMETERS * k + 3);
            normal[(c, c)] += by_first * by_first * weight;
            normal[(c, r)] += by_first * by_second * weight;
            normal[(r, c)] += by_first * by_second * weight;
            normal[(r, r)] += by_second * by_second * weight;
            if still.is_none() {
                normal[(r, r)] += self.radius_deviation.powi(-2);
            }
        }
        if let Some(still) = still {
            still.add_to_normal(&mut normal, &slopes.units_m());
        }
        normal
    }

    /// Half of the negative derivative of what the fit lowers.
    fn gradient(&self, fit: &DiscFit, target: &Target) -> DVector<f64> {
        let mut residuals = target.residuals(&fit.volts);
        target.whiten_transposed(&mut residuals);
        let mut gradient: Vec<_> = fit.slopes.by.iter().map(|slope| dot(slope, &residuals)).collect();
        for (k, contact) in fit.contacts.iter().enumerate() {
            let still = fit.still.as_deref();
            let pull = self.unusual_strength(contact, still, k) / self.usual_strength(still, k)[1];
            let [by_first, by_second] = by_parameters(fit.slopes.constriction[k]);
            gradient[PARAMETERS * k + 2] -= by_first * pull;
            gradient[PARAMETERS * k + 3] -= by_second * pull;
            if still.is_none() {
                gradient[PARAMETERS * k + 3] -= self.unusual_radius(contact) / self.radius_deviation;
            }
        }
        if let Some(still) = &fit.still {
            still.add_to_gradient(&mut gradient, &fit.contacts, &fit.units_m());
        }
        gradient.into()
    }

    /// Mean and standard deviation of the logarithm of a contact's conductance (S) before anything is read.
    pub fn usual_strength(&self, still: Option<&Still>, k: usize) -> [f64; 2] {
        match still {
            Some(still) => [still.level(k), policy::STRENGTH_DEVIATION],
            None => [self.sheet_s.ln(), policy::CONDUCTANCE_DEVIATION],
        }
    }

    /// How far a contact's conductance is from what is usual, in standard deviations.
    fn unusual_strength(&self, contact: &Contact, still: Option<&Still>, k: usize) -> f64 {
        let [usual, deviation] = self.usual_strength(still, k);
        (contact.conductance_s.ln() - usual) / deviation
    }

    /// The same of its radius, where nothing else is known of that.
    fn unusual_radius(&self, contact: &Contact) -> f64 {
        (contact.radius_m / self.usual_radius_m).ln() / self.radius_deviation
    }

    fn known(&self, contacts: &[Contact], still: Option<&Still>) -> f64 {
        let strengths =
            contacts.iter().enumerate().map(|(k, contact)| self.unusual_strength(contact, still, k).powi(2));
        let staying = match still {
            Some(still) => still.cost(contacts),
            None => contacts.iter().map(|contact| self.unusual_radius(contact).powi(2)).sum(),
        };
        strengths.sum::<f64>() + staying
    }

    /// Readings of the forward model (V).
    pub fn volts(&self, contacts: &[Contact]) -> Option<Vec<f64>> {
        let impedance_ohm = self.model.impedance_ohm(contacts).ok()?;
        Some(readings_v(&impedance_ohm, self.detector).volts().to_vec())
    }

    /// Contacts after a step in their parameters.
    pub fn moved(&self, fit: &DiscFit, step: &[f64]) -> Vec<Contact> {
        let (steps, _) = step.as_chunks::<PARAMETERS>();
        let moved = |(k, contact): (usize, &Contact)| {
            let unit = fit.slopes.at[k];
            self.stepped(contact, unit.radius_m, fit.constriction(k), &steps[k])
        };
        fit.contacts.iter().enumerate().map(moved).collect()
    }

    /// A contact after a step in its parameters: the unit of its place (m), and the resistance of the crowded current under it
    /// over its own.
    fn stepped(&self, contact: &Contact, unit_m: f64, constriction: f64, step: &[f64; PARAMETERS]) -> Contact {
        let [first, second, by_s, by_m] = step;
        let shorten = (LONGEST_WAY / first.hypot(*second)).min(1.0) * unit_m;
        let factor = |log: f64, longest: f64| log.clamp(-longest, longest).exp();
        let (from_m, along) = self.fields.footing(place_m(contact));
        let to_m = space::moved(from_m, [shorten * first, shorten * second], along);
        let ([x_m, y_m, z_m], _) = self.fields.footing(to_m);
        let wider = factor(*by_m, LONGEST_RADIUS);
        // Of the contact's own, in what it was: no step makes it much better at once.
        let ohm = (1.0 + constriction) / factor(*by_s, LONGEST_CONDUCTANCE) - constriction / wider;
        let ohm = ohm.max((-LONGEST_CONDUCTANCE).exp());
        self.held(Contact {
            x_m,
            y_m,
            z_m,
            conductance_s: contact.conductance_s / ohm,
            radius_m: wider * contact.radius_m,
        })
    }

    /// A contact with conductance and radius held within what makes sense.
    pub fn held(&self, contact: Contact) -> Contact {
        let [least, most] = policy::CONDUCTANCES_SHEETS.map(|sheets| sheets * self.sheet_s);
        Contact {
            conductance_s: contact.conductance_s.clamp(least, most),
            radius_m: contact.radius_m.clamp(NARROWEST * self.usual_radius_m, self.widest_m),
            ..contact
        }
    }
}

/// Derivatives of the logarithm of a conductance by the last two parameters.
pub(super) fn by_parameters(constriction: f64) -> [f64; 2] {
    [1.0 + constriction, -constriction]
}

pub(super) fn place_m(contact: &Contact) -> Place {
    [contact.x_m, contact.y_m, contact.z_m]
}
