//! The fast half: follows whichever model was chosen last, and contacts beside it.

use super::first_look::FirstLook;
use super::words::{as_contacts, as_whole, nothing};
use super::{
    ContactHypothesis, ContactTracker, Evidence, FrameHypothesis, Nonlinear, Rival, ShapeTracker, Solution, SolveError,
    Target, Whole, image_evidence,
};
use crate::solve::answer::{Alternative, FoundContact, check};
use crate::solve::before::adaptive_mean::{AdaptiveMean, Mean};
use crate::solve::fit::policy;
use crate::solve::methods::image::Descent;
use crate::solve::methods::shapes::StripFit;
use crate::solve::solver::{Followed, Hypothesis, Tracker};
use tactomo_physics::detector::Detector;
use tactomo_physics::readings::Readings;

/// Follows whichever model was chosen last.
pub(super) struct AutoTracker {
    electrodes: usize,
    /// What stands still is averaged, for all models alike.
    average: AdaptiveMean,
    contacts: Option<ContactTracker>,
    shapes: Option<ShapeTracker>,
    image: Nonlinear,
    first_look: FirstLook,
    answer: Answer,
    /// What else the contacts that were searched may be.
    rival: Option<Rival>,
    /// Frames for which nothing is searched while an image is the answer, and how many it will be next time.
    skip: u32,
    patience: u32,
}

/// What the answer is, and why it is not contacts.
#[derive(Clone, Debug, Default)]
enum Answer {
    #[default]
    Contacts,
    Shape(String),
    Image(String),
}

impl Answer {
    fn why(&self) -> Option<&str> {
        match self {
            Self::Contacts => None,
            Self::Shape(why) | Self::Image(why) => Some(why),
        }
    }
}

impl AutoTracker {
    pub fn new(
        detector: &Detector,
        contacts: Option<ContactTracker>,
        shapes: Option<ShapeTracker>,
        image: Nonlinear,
        first_look: FirstLook,
    ) -> Self {
        let (electrodes, average) = (detector.electrodes.len(), AdaptiveMean::new(detector.adc.deviation_v()));
        Self {
            electrodes,
            average,
            contacts,
            shapes,
            image,
            first_look,
            answer: Answer::Contacts,
            rival: None,
            skip: 0,
            patience: policy::IMAGE_PATIENCE[0],
        }
    }

    /// What the errors of averaged readings are like, by what `found` or else what is followed was compared by; `None` if the model has no contacts.
    fn target(&self, mean: &Mean, found: Option<&ContactHypothesis>) -> Result<Option<Target>, SolveError> {
        let of = |contacts: &ContactTracker| {
            let error = found.and_then(ContactHypothesis::error).or(contacts.error());
            contacts.finder().target_of(mean, error)
        };
        self.contacts.as_ref().map(of).transpose()
    }

    /// The latest readings while contacts go by rows, as they would be for them now.
    fn latest(&self) -> Option<Mean> {
        self.contacts.as_ref().and_then(ContactTracker::latest)
    }

    /// Derivatives of the readings by the parameters of the contacts that are followed (V).
    fn slopes_v(contacts: Option<&ContactTracker>) -> &[Vec<f64>] {
        contacts.map_or(&[], ContactTracker::slopes_v)
    }

    /// Brings the contacts to the frame; as what they are if they are the answer.
    fn follow_contacts(&mut self, readings: &Readings, target: Option<&Target>) -> Followed {
        let (Some(contacts), Some(target)) = (&mut self.contacts, target) else {
            let search = !self.image.is_rest(readings);
            return Followed { solution: nothing(Solution::default(), search), search };
        };
        let search = contacts.follow(target);
        // That more frames of the same are looked at casts no doubt on what is shown.
        let is_doubted = search && !contacts.has_news();
        let solution = contacts.solution(target);
        Followed { solution: self.as_contacts(solution, is_doubted), search }
    }

    /// The solution of contacts with the shape that there may be in place of them, until they have come or gone, or moved apart.
    fn as_contacts(&mut self, mut solution: Solution, search: bool) -> Solution {
        self.rival = self.rival.filter(|rival| rival.is_of(&solution.contacts));
        let rival = self.rival.filter(|rival| solution.certainty.is_some() && rival.share >= policy::NAMED_SHARE);
        let share = 1.0 - rival.map_or(0.0, |rival| rival.share);
        solution.certainty = solution.certainty.map(|certainty| share * certainty);
        let of_less = |other: Alternative| Alternative { certainty: share * other.certainty, ..other };
        solution.alternative = solution.alternative.map(of_less).filter(|other| other.certainty >= policy::NAMED_SHARE);
        as_contacts(solution, rival, search)
    }

    fn follow_shape(&mut self, target: &Target) -> Option<Followed> {
        let shapes = self.shapes.as_mut()?;
        let search = shapes.follow(target);
        Some(Followed { solution: shapes.solution(target)?, search })
    }

    fn follow_image(&mut self, readings: &Readings) -> Result<Followed, SolveError> {
        let (solution, is_lost) = self.image.follow(readings)?;
        let search = is_lost || self.skip == 0;
        self.skip = self.skip.saturating_sub(1);
        Ok(Followed { solution, search })
    }

    /// A shape or an image with the contacts beside it.
    fn beside(&mut self, Followed { solution, mut search }: Followed, target: Option<&Target>, why: &str) -> Followed {
        if let (Some(contacts), Some(target)) = (&mut self.contacts, target) {
            contacts.follow(target);
            search |= contacts.finder().is_outdated(target);
        }
        Followed { solution: self.with_contacts(solution, target, why), search }
    }

    /// A shape or an image that was brought to a frame with the contacts that were too, and how sure a shape is against these.
    fn with_contacts(&mut self, mut solution: Solution, target: Option<&Target>, why: &str) -> Solution {
        if let (Some(contacts), Some(target)) = (&mut self.contacts, target) {
            solution.contacts = contacts.solution(target).contacts;
            let by_shape = self.shapes.as_ref().and_then(ShapeTracker::evidence).filter(|_| solution.shape.is_some());
            if let (Some(by_shape), false) = (by_shape, solution.flags.is_doubtful()) {
                let untried = if target.error().is_some() { policy::UNTRIED_SHARE } else { 0.0 };
                let share = by_shape.share_against(&contacts.evidence(target));
                let other = Alternative { contacts: solution.contacts.len(), certainty: 1.0 - share };
                solution.certainty = Some(share.min(1.0 - untried));
                solution.alternative = Some(other).filter(|other| other.certainty >= policy::NAMED_SHARE);
            }
        }
        as_whole(solution, why)
    }

    /// Goes on from a shape that was found, if it explains the frame better than the one that is followed; what that leaves.
    fn adopt_shape(&mut self, found: Option<&StripFit>, target: &Target) -> Option<Evidence> {
        let shapes = self.shapes.as_mut()?;
        shapes.follow(target);
        if let Some(found) = found {
            shapes.adopt(found, target);
        }
        shapes.evidence()
    }

    /// Goes on from an image that was found, if it explains the frame better than the one that is followed; what that leaves.
    fn adopt_image(
        &mut self,
        found: Option<Descent>,
        readings: &Readings,
        target: &Target,
    ) -> Result<Option<Evidence>, SolveError> {
        self.image.follow(readings)?;
        let before = (image_evidence(&self.image, readings, target)?, self.image.descent().cloned());
        let Some(found) = found else { return Ok(before.0) };
        self.image.go_on_from(Some(found));
        self.image.follow(readings)?;
        let after = image_evidence(&self.image, readings, target)?;
        if lower(before.0, after).is_some_and(|lowest| Some(lowest) != after) {
            self.image.go_on_from(before.1);
            return Ok(before.0);
        }
        Ok(after)
    }

    /// Makes one of the models that were brought to a frame the answer, and lets go of the others.
    fn take(&mut self, answer: Answer) {
        if !matches!(answer, Answer::Shape(_))
            && let Some(shapes) = &mut self.shapes
        {
            shapes.let_go();
        }
        match &answer {
            Answer::Image(_) => {
                self.skip = self.patience;
                self.patience = (2 * self.patience).min(policy::IMAGE_PATIENCE[1]);
            }
            _ => {
                self.image.go_on_from(None);
                (self.skip, self.patience) = (0, policy::IMAGE_PATIENCE[0]);
            }
        }
        self.answer = answer;
    }

    /// The answer to a frame that it was brought to, with the contacts beside it; `search` is whether contacts have to be searched again.
    fn answered(&mut self, readings: &Readings, target: &Target, search: bool) -> Result<Followed, SolveError> {
        let (whole, search) = match (&self.answer, &self.shapes) {
            (Answer::Shape(why), Some(shapes)) => {
                (shapes.solution(target).map(|shape| (shape, why.clone())), shapes.has_lost(target))
            }
            (Answer::Image(why), _) => (Some((self.image.solution(readings)?, why.clone())), self.skip == 0),
            _ => (None, search),
        };
        let search = search || self.contacts.as_ref().is_some_and(|contacts| contacts.finder().is_outdated(target));
        let solution = match (whole, &mut self.contacts) {
            (Some((whole, why)), _) => self.with_contacts(whole, Some(target), &why),
            (None, Some(contacts)) => {
                let solution = contacts.solution(target);
                self.as_contacts(solution, search)
            }
            (None, None) => nothing(Solution::default(), search),
        };
        self.first_look.of(Followed { solution, search }, readings)
    }

    /// Goes on from an image where the model has no contacts.
    fn adopt_alone(&mut self, whole: Option<(Whole, String)>, readings: &Readings) -> Result<Followed, SolveError> {
        if let Some((Whole::Image(descent), why)) = whole {
            self.image.go_on_from(Some(*descent));
            self.take(Answer::Image(why));
        }
        self.follow_mean(&Mean::of_frame(readings))
    }

    fn follow_mean(&mut self, mean: &Mean) -> Result<Followed, SolveError> {
        let readings = &mean.readings;
        let target = self.target(mean, None)?;
        if !matches!(self.answer, Answer::Contacts) && self.image.is_rest(readings) {
            // The contacts beside it explain nothing of that.
            self.contacts.iter_mut().for_each(ContactTracker::let_go);
            self.take(Answer::Contacts);
        }
        let whole = match (self.answer.clone(), &target) {
            (Answer::Shape(why), Some(target)) => self.follow_shape(target).zip(Some(why)),
            (Answer::Image(why), _) => Some((self.follow_image(readings)?, why)),
            _ => None,
        };
        match whole {
            Some((followed, why)) => Ok(self.beside(followed, target.as_ref(), &why)),
            None => {
                let is_gone = !matches!(self.answer, Answer::Contacts);
                self.take(Answer::Contacts);
                let followed = self.follow_contacts(readings, target.as_ref());
                self.first_look.of(Followed { search: followed.search || is_gone, ..followed }, readings)
            }
        }
    }
}

/// The one of lower score.
fn lower(one: Option<Evidence>, other: Option<Evidence>) -> Option<Evidence> {
    one.into_iter().chain(other).min_by(|a, b| a.score().total_cmp(&b.score()))
}

impl Tracker for AutoTracker {
    fn follow(&mut self, readings: &Readings) -> Result<Followed, SolveError> {
        check(readings, self.electrodes)?;
        self.average.add_beside(readings, Self::slopes_v(self.contacts.as_ref()));
        self.follow_mean(&self.average.mean_or(readings))
    }

    fn follow_rows(&mut self, rows: &Readings, latest: &Readings, elapsed_s: f64) -> Result<Followed, SolveError> {
        match (&self.answer, &mut self.contacts) {
            (Answer::Contacts, Some(contacts)) => {
                self.average.reset();
                let Followed { solution, search } = contacts.follow_rows(rows, elapsed_s)?;
                let solution = self.as_contacts(solution, search);
                self.first_look.of(Followed { solution, search }, latest)
            }
            _ => self.follow(latest),
        }
    }

    fn adopt(&mut self, hypothesis: Hypothesis, readings: &Readings) -> Result<Followed, SolveError> {
        check(readings, self.electrodes)?;
        let hypothesis: FrameHypothesis = hypothesis.known();
        match self.latest() {
            Some(latest) => self.average.add(&latest.readings),
            None => self.average.add_beside(readings, Self::slopes_v(self.contacts.as_ref())),
        }
        self.contacts.iter_mut().for_each(|contacts| contacts.searched_in(hypothesis.mean.as_ref()));
        let mean = self.average.mean_or(readings);
        let readings = &mean.readings;
        let Some(target) = self.target(&mean, hypothesis.contacts.as_deref())? else {
            return self.adopt_alone(hypothesis.whole, readings);
        };
        // What is followed and what was found some frames ago are all brought to this frame: the lowest score is believed. Where no
        // reading stands out there may be a very light contact still.
        let FrameHypothesis { contacts: found, whole, rival, mean: searched } = hypothesis;
        self.rival = rival;
        let frames = searched.map_or(1, |mean| mean.frames);
        let whole = whole.filter(|_| !self.image.is_rest(readings));
        let search =
            self.contacts.as_mut().is_some_and(|contacts| contacts.adopt(found.map(|found| *found), frames, &target));
        let (shape, image, new_why) = match whole {
            Some((Whole::Shape(fit), why)) => (Some(fit), None, Some(why)),
            Some((Whole::Image(descent), why)) => (None, Some(*descent), Some(why)),
            None => (None, None, None),
        };
        let why = new_why.or_else(|| self.answer.why().map(str::to_owned)).unwrap_or_default();
        let by_contacts = self.contacts.as_ref().map(|contacts| contacts.evidence(&target));
        let by_shape = self.adopt_shape(shape.as_deref(), &target);
        let by_image = self.adopt_image(image, readings, &target)?;
        let best = lower(lower(by_contacts, by_shape), by_image);
        self.take(match best {
            best if best == by_contacts => Answer::Contacts,
            best if best == by_shape => Answer::Shape(why),
            _ => Answer::Image(why),
        });
        self.answered(readings, &target, search)
    }

    fn telling_grounds(&self, count: usize) -> Option<Vec<usize>> {
        let contacts = self.contacts.as_ref().filter(|_| matches!(self.answer, Answer::Contacts))?;
        contacts.telling_grounds(count)
    }

    fn has_news(&self) -> bool {
        matches!(self.answer, Answer::Contacts) && self.contacts.as_ref().is_some_and(ContactTracker::has_news)
    }

    fn hypothesis(&self) -> Hypothesis {
        let whole = match &self.answer {
            Answer::Contacts => None,
            Answer::Shape(why) => {
                let shape = self.shapes.as_ref().and_then(ShapeTracker::found).cloned();
                shape.map(|fit| (Whole::Shape(Box::new(fit)), why.clone()))
            }
            Answer::Image(why) => {
                self.image.descent().cloned().map(|descent| (Whole::Image(Box::new(descent)), why.clone()))
            }
        };
        let contacts = self.contacts.as_ref().and_then(ContactTracker::found).map(Box::new);
        Hypothesis::of(FrameHypothesis {
            contacts,
            whole,
            rival: self.rival,
            mean: self.latest().or_else(|| self.average.mean()),
        })
    }

    fn inherit(&mut self, before: &[FoundContact]) {
        if let Some(contacts) = &mut self.contacts {
            contacts.inherit(before);
        }
    }

    fn reset(&mut self) {
        if let Some(contacts) = &mut self.contacts {
            contacts.reset();
        }
        self.average.reset();
        self.rival = None;
        self.take(Answer::Contacts);
    }
}
