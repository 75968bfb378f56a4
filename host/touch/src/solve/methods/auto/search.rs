//! The thorough half: which model explains a frame at the lowest price.

use std::ops::ControlFlow;
use std::sync::Arc;

use super::words::instead_of;
use super::{
    ContactFinder, ContactHypothesis, ContactSearch, Evidence, FrameHypothesis, Nonlinear, Rival, ShapeFinder,
    Solution, SolveError, Target, Whole, image_evidence,
};
use crate::solve::before::adaptive_mean::Mean;
use crate::solve::fit::approximation::ApproximationError;
use crate::solve::fit::policy;
use crate::solve::methods::shapes::StripFit;
use crate::solve::solver::{Hypothesis, Search};
use tactomo_physics::readings::Readings;

/// Chooses the model.
pub(super) struct AutoSearch {
    pub(super) finder: Option<Arc<ContactFinder>>,
    shapes: Option<Arc<ShapeFinder>>,
    image: Nonlinear,
}

impl AutoSearch {
    pub fn new(finder: Option<Arc<ContactFinder>>, shapes: Option<Arc<ShapeFinder>>, image: Nonlinear) -> Self {
        Self { finder, shapes, image }
    }

    pub fn reset(&mut self) {
        self.image.go_on_from(None);
    }

    /// The line or ring that explains a frame best, if there may be one.
    fn shape(&self, contacts: (&Solution, Evidence), from: Option<&StripFit>, target: &Target) -> Option<StripFit> {
        let (solution, evidence) = contacts;
        let shapes = self.shapes.as_ref()?;
        let may_be = shapes.may_be(&solution.contacts) || evidence.is_misfit(target.count()) || from.is_some();
        may_be.then(|| shapes.search(&solution.contacts, from, target, evidence.score()))?
    }

    /// The line or ring that explains a frame where the contacts so far do not: each more of them, by the model itself, takes longer than to look for it.
    fn early(
        &self,
        search: &ContactSearch,
        contacts: &ContactHypothesis,
        from: Option<&StripFit>,
        mean: &Mean,
    ) -> Option<StripFit> {
        let finder = self.finder.as_ref()?;
        let target = finder.target_of(mean, contacts.error()).ok()?;
        // A single contact stands for a line or a ring if it is as wide as may be; else a second one is nearer.
        let may_be = contacts.count() > 1 || finder.is_widest(contacts);
        if !may_be || !finder.evidence_of_found(contacts).is_misfit(target.count()) {
            return None;
        }
        self.surely(search, contacts, from, mean)
    }

    /// The line or ring that explains a frame better than contacts, and so well that nothing could do much better.
    fn surely(
        &self,
        search: &ContactSearch,
        contacts: &ContactHypothesis,
        from: Option<&StripFit>,
        mean: &Mean,
    ) -> Option<StripFit> {
        let finder = self.finder.as_ref()?;
        let target = finder.target_of(mean, contacts.error()).ok()?;
        let solution = search.solution(contacts, mean).ok().filter(|_| !is_partial(&target))?;
        let evidence = finder.evidence_of_found(contacts);
        let shape = self.shape((&solution, evidence), from, &target)?;
        let is_better = shape.evidence().score() < evidence.score();
        (is_better && !shape.evidence().may_be_better(1.0, target.count())).then_some(shape)
    }

    /// The line or ring that was followed, if it still explains a frame with what readings may be off by together where it is now; and contacts
    /// that stand for it. `error` is what they were off by so far.
    fn renewed(
        &self,
        search: &ContactSearch,
        from: &StripFit,
        error: Option<&Arc<ApproximationError>>,
        mean: &Mean,
    ) -> Option<(ContactHypothesis, StripFit)> {
        let finder = self.finder.as_ref()?;
        let contacts = finder.standing(from.strip().discs(finder.most()), error, mean)?;
        let shape = self.surely(search, &contacts, Some(from), mean)?;
        Some((contacts, shape))
    }

    /// The image that explains a frame, from the one that was followed if it was one.
    fn image(&mut self, from: Option<(Whole, String)>, readings: &Readings) -> Result<Option<Whole>, SolveError> {
        self.image.go_on_from(match from {
            Some((Whole::Image(descent), _)) => Some(*descent),
            _ => None,
        });
        self.image.begin(readings)?;
        Ok(self.image.descent().cloned().map(|descent| Whole::Image(Box::new(descent))))
    }

    /// All that there is to know without contacts.
    fn image_alone(&mut self, from: FrameHypothesis, readings: &Readings) -> Result<FrameHypothesis, SolveError> {
        if self.image.is_rest(readings) {
            return Ok(FrameHypothesis::default());
        }
        let why = "this model has no fields of single contacts".to_owned();
        let whole = self.image(from.whole, readings)?.map(|image| (image, why));
        Ok(FrameHypothesis { whole, ..FrameHypothesis::default() })
    }

    /// What explains the frame as a whole better than contacts do, if anything; else a shape that nearly does.
    pub(super) fn whole(
        &mut self,
        (contacts, solution): (Evidence, &Solution),
        from: Option<(Whole, String)>,
        target: &Target,
        readings: &Readings,
    ) -> Result<(Option<Whole>, Option<Rival>), SolveError> {
        if self.image.is_rest(readings) || is_partial(target) {
            return Ok((None, None));
        }
        let shape = self.shape((solution, contacts), shape_of(from.as_ref()), target);
        let (shape, rival) = match shape {
            Some(shape) if shape.evidence().score() < contacts.score() => (Some(shape), None),
            other => (None, other.map(|shape| Rival::of(&shape, contacts, &solution.contacts))),
        };
        let best = shape.as_ref().map_or(contacts, StripFit::evidence);
        let shape = shape.map(|fit| Whole::Shape(Box::new(fit)));
        // Of a provisional target nothing is claimed that another model could do better than.
        let noise_share = if target.is_provisional() { 1.0 } else { (target.noise_v / target.deviation_v()).powi(2) };
        let count = solution.contacts.len();
        let is_doubtful = count >= policy::SUSPICIOUS_CONTACTS && best.may_be_better(noise_share, target.count());
        // As many as are looked for stand for more.
        let is_full = self.finder.as_ref().is_some_and(|finder| count >= finder.most());
        if !(is_doubtful || is_full || best.is_misfit(target.count())) {
            return Ok((shape, rival));
        }
        let image = self.image(from, readings)?;
        let evidence = image_evidence(&self.image, readings, target)?;
        let Some(by_image) = evidence.map(|evidence| evidence.score()).filter(|score| *score < best.score()) else {
            return Ok((shape, rival));
        };
        let shape = self.shape_of_image(readings, target, by_image)?;
        Ok((shape.map(|fit| Whole::Shape(Box::new(fit))).or(image), None))
    }

    /// The line or ring that an image stands for, if it explains the frame better: contacts that explain nothing do not lead to it.
    fn shape_of_image(&self, readings: &Readings, target: &Target, score: f64) -> Result<Option<StripFit>, SolveError> {
        let (Some(shapes), Some(image)) = (&self.shapes, self.image.solution(readings)?.image_s_per_m2) else {
            return Ok(None);
        };
        let shape = shapes.search(&shapes.contacts_of(&image), None, target, score);
        Ok(shape.filter(|shape| shape.evidence().score() < score))
    }
}

/// The line or ring that was followed.
fn shape_of(from: Option<&(Whole, String)>) -> Option<&StripFit> {
    match from {
        Some((Whole::Shape(fit), _)) => Some(fit),
        _ => None,
    }
}

/// Whether so few rows were read that any shape explains them.
fn is_partial(target: &Target) -> bool {
    2 * target.known() < target.readings().volts().len()
}

impl Search for AutoSearch {
    fn search(
        &mut self,
        from: Hypothesis,
        readings: &Readings,
        found: &mut dyn FnMut(Hypothesis) -> ControlFlow<()>,
    ) -> Result<Hypothesis, SolveError> {
        let mut from: FrameHypothesis = from.known();
        let mean = from.mean.take().unwrap_or_else(|| Mean::of_frame(readings));
        let readings = &mean.readings;
        let Some(finder) = self.finder.clone() else { return self.image_alone(from, readings).map(Hypothesis::of) };
        let FrameHypothesis { contacts, whole: from, rival: before, .. } = from;
        let search = ContactSearch::new(Arc::clone(&finder));
        if let Some((Whole::Shape(fit), why)) = &from {
            let error = contacts.as_ref().and_then(|contacts| contacts.error());
            if let Some((contacts, shape)) = self.renewed(&search, fit, error, &mean) {
                let (contacts, whole) = (Some(Box::new(contacts)), Some((Whole::Shape(Box::new(shape)), why.clone())));
                return Ok(Hypothesis::of(FrameHypothesis { contacts, whole, rival: None, mean: Some(mean) }));
            }
        }
        let contacts = contacts.filter(|_| from.is_none());
        let is_of_key_frames = contacts.as_ref().is_some_and(|contacts| contacts.is_of_key_frames());
        let (mut early, mut is_past) = (None, false);
        let mut better = |better: ContactHypothesis| {
            early = self.early(&search, &better, shape_of(from.as_ref()), &mean);
            if early.is_some() {
                return ControlFlow::Break(());
            }
            // A picture does not change to contacts that may not explain it.
            if from.is_none() {
                let contacts = Some(Box::new(better));
                let lead = FrameHypothesis { contacts, mean: Some(mean.clone()), ..FrameHypothesis::default() };
                is_past = found(Hypothesis::of(lead)).is_break();
            }
            if is_past { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        };
        let contacts = search.contacts(contacts.map(|found| *found), &mean, &mut better)?;
        let Some((contacts, solution)) = contacts else {
            return Ok(Hypothesis::of(FrameHypothesis { mean: Some(mean), ..FrameHypothesis::default() }));
        };
        let target = finder.target_of(&mean, contacts.error())?;
        let (whole, rival) = match early {
            Some(shape) => (Some(Whole::Shape(Box::new(shape))), None),
            // Whether they are contacts at all is not asked by every look at more frames of them, nor of a frame that is past.
            None if is_of_key_frames || is_past => (None, before),
            None => self.whole((finder.evidence_of_found(&contacts), &solution), from, &target, readings)?,
        };
        let whole = whole.map(|whole| (whole, instead_of(&solution)));
        Ok(Hypothesis::of(FrameHypothesis { contacts: Some(Box::new(contacts)), whole, rival, mean: Some(mean) }))
    }
}
