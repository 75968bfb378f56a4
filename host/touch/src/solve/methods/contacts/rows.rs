//! Contacts followed by rows of readings as they come, of scans that read some rows at a time.
//!
//! What is followed was searched in all readings. From then on each frame of a few rows moves it by what is new in them ([`MultipleModels`]). What
//! all readings are off by together, as those of a detector that is not known exactly are, was found with the contacts, and is taken off.

use super::discrepancy::Discrepancy;
use super::discs::{DiscFit, DiscFitter, Effort};
use super::multiple_models::{MultipleModels, Rows};
use super::systematic_error::SystematicError;
use super::{ContactFinder, ContactHypothesis};
use crate::solve::fit::dot::dot;
use crate::solve::fit::policy;
use crate::solve::fit::target::Target;
use tactomo_physics::readings::Readings;
use tactomo_physics::scene::Contact;

use nalgebra::{Cholesky, DMatrix, DVector};

/// Steps of a frame at most, and the way, in radii or logarithms, that needs no further one.
const FRAME_STEPS: usize = 3;
const SMALL_WAY: f64 = 0.1;

/// Of a contact that has just come.
const GLIMPSE: Effort = Effort { steps: 4, gain: 1.0, share: 0.05 };

/// What is known besides the contacts that are followed.
#[derive(Clone, Debug)]
pub(super) struct RowState {
    filters: MultipleModels,
    /// What model and board are off by goes into the parameters however many rows come.
    systematic_error: SystematicError,
    discrepancy: Discrepancy,
    /// Frames in a row that do not fit.
    unfit: u32,
    /// Logarithm of the odds for there being nothing, of late.
    gone: f64,
}

/// What has come of a frame.
pub(super) enum Step {
    /// The contacts, and whether they have to be searched.
    Followed(Box<ContactHypothesis>, Box<RowState>, bool),
    /// Nothing touches any more.
    Gone,
    /// They could not be brought to the frame.
    Lost,
}

impl RowState {
    /// From an explanation by all readings of `target`.
    pub fn new(finder: &ContactFinder, found: &ContactHypothesis, target: &Target) -> Self {
        Self {
            filters: MultipleModels::new(found.fit.normal.clone()),
            systematic_error: SystematicError::new(&found.fit, target),
            discrepancy: finder.discrepancy(&found.fit, target),
            unfit: 0,
            gone: 0.0,
        }
    }

    /// Whether what is followed fits the newest rows.
    pub fn fits(&self) -> bool {
        self.unfit == 0
    }

    /// Whether what is followed is believed to move; `None` as long as too few rows have come to tell.
    pub fn moves(&self) -> Option<bool> {
        self.filters.moves()
    }

    /// What all readings are off by.
    pub fn discrepancy(&self) -> &Discrepancy {
        &self.discrepancy
    }

    /// Whether contacts that predict such readings (V) have gone so far that a whole frame has to tell anew what readings are off by.
    pub fn is_stale(&self, volts: &[f64]) -> bool {
        self.discrepancy.is_stale(volts)
    }
}

impl ContactFinder {
    /// What rows are fitted as, less what all readings are off by; where that is not known yet of a detector, each by itself may be.
    pub(super) fn target_of_rows(&self, rows: &Readings, discrepancy: Option<&Discrepancy>) -> Target {
        let Some(discrepancy) = discrepancy.filter(|discrepancy| !discrepancy.is_nothing()) else {
            return Target::provisional(rows, 1, &self.errors);
        };
        let mut less = rows.clone();
        less.volts_mut()
            .iter_mut()
            .zip(discrepancy.left_v())
            .for_each(|(volts, discrepancy_v)| *volts -= discrepancy_v);
        Target::of_mean(&less, 1, &self.errors, None).with_model_error(discrepancy.new_v())
    }

    /// Brings contacts to rows that come `elapsed_s` (s) after those before.
    pub(super) fn step(&self, last: ContactHypothesis, mut state: RowState, target: &Target, elapsed_s: f64) -> Step {
        if state.filters.predict(elapsed_s, &last.fit.units_m()).is_none() {
            return Step::Lost;
        }
        let Some(mut fit) = self.moved_by(last.fit.clone(), &mut state.filters, target) else { return Step::Lost };
        let counted = target.at(&fit.volts).count() as f64;
        let noise = counted + policy::MISFIT_DEVIATIONS * (2.0 * counted).sqrt();
        state.unfit = if fit.cost > noise { state.unfit + 1 } else { 0 };
        // What is gone shows in the rows alone: what they say for it is what a contact of that kind would have taken off.
        state.gone = (state.gone + 0.5 * (fit.cost - target.cost_of_nothing())).max(0.0);
        if state.gone > policy::GONE_NATS || self.is_vanishing(&fit) {
            return Step::Gone;
        }
        let search = state.unfit >= policy::UNFIT_FRAMES;
        state.discrepancy.follow(&fit.volts);
        if state.discrepancy.is_outdated() {
            state.discrepancy = self.discrepancy_at(&state.discrepancy, &fit).unwrap_or(state.discrepancy);
        }
        state.systematic_error.add(&fit, target, &self.errors, &state.discrepancy);
        let known = state.filters.information();
        let stays = state.systematic_error.covariance(&fit);
        let covariance = || Some(Cholesky::new(Cholesky::new(known.clone())?.inverse() + stays)?.inverse());
        (fit.normal, fit.settled) = (covariance().unwrap_or_else(|| known.clone()), true);
        Step::Followed(Box::new(ContactHypothesis { fit, ..last }), Box::new(state), search)
    }

    /// A first, rough contact in rows where something stands out: of completed readings, and of those that were read, where noise is not taken for a
    /// pattern.
    pub(super) fn glimpsed(&self, target: &Target) -> Option<ContactHypothesis> {
        let found = self.roughly_from(self.begun(target)?, target)?;
        (target.cost_of_nothing() - found.fit.cost >= policy::FIRST_GAIN).then_some(found)
    }

    /// What these contacts are in another frame, roughly.
    pub(super) fn roughly_from(&self, begun: Vec<Contact>, target: &Target) -> Option<ContactHypothesis> {
        let rough = DiscFitter { model: &*self.rough, ..self.disc_fitter() };
        let first = rough.fit(begun, target, GLIMPSE)?;
        let fit = self.disc_fitter().fit(first.contacts, target, Effort { steps: 1, ..GLIMPSE })?;
        Some(ContactHypothesis::of(fit, target))
    }

    /// Whether what is followed has become so light that it cannot be distinguished from nothing.
    fn is_vanishing(&self, fit: &DiscFit) -> bool {
        let least_s = policy::VANISHING_SHEETS * self.sheet_s;
        fit.contacts.iter().all(|contact| contact.conductance_s < least_s)
    }

    /// A fit moved to what its filters believe after the rows of a target.
    fn moved_by(&self, mut fit: DiscFit, filters: &mut MultipleModels, target: &Target) -> Option<DiscFit> {
        let fitter = self.disc_fitter();
        for step in 0..FRAME_STEPS {
            let units_m = fit.units_m();
            let mut tried = filters.clone();
            let way = tried.update(&rows_of(&fit, target))?;
            let contacts: Vec<Contact> = fitter.moved(&fit, way.as_slice());
            let next = fitter.next(&fit, contacts, target)?;
            // A step that was too long or led beyond what makes sense was cut: the filters know what is left of it.
            let gone = DVector::from_vec(fit.way_to(&next.contacts));
            if step + 1 == FRAME_STEPS || way.amax() < SMALL_WAY {
                tried.shift(&(&gone - way));
                tried.rescale(&units_m, &next.units_m());
                *filters = tried;
                return Some(next);
            }
            // A long way: once more from there, where the readings are linear.
            filters.shift(&gone);
            filters.rescale(&units_m, &next.units_m());
            fit = next;
        }
        None
    }
}

/// What the rows of a target say at the contacts of a fit.
fn rows_of(fit: &DiscFit, target: &Target) -> Rows {
    let residuals = target.residuals(&fit.volts);
    let active = target.at(&fit.volts);
    let slopes: Vec<Vec<f64>> = fit.slopes_v().iter().map(|slope| active.whitened(slope)).collect();
    let size = slopes.len();
    let mut information = DMatrix::zeros(size, size);
    for (i, j) in (0..size).flat_map(|i| (0..=i).map(move |j| (i, j))) {
        let product = dot(&slopes[i], &slopes[j]);
        (information[(i, j)], information[(j, i)]) = (product, product);
    }
    let pull = DVector::from_iterator(size, slopes.iter().map(|slope| dot(slope, &residuals)));
    Rows { information, pull, cost: dot(&residuals, &residuals) }
}
