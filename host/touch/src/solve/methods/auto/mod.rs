//! No more model than the scene needs.
//!
//! Nothing, one contact, two, up to six, a line, a ring, an image: what explains the readings at the lowest price ([`Evidence`]) is the
//! answer, and the solution says which and why. What is known is followed from frame to frame, which costs least, and searched anew
//! only when it no longer explains the readings, or now and then. A touch of which nothing is found yet is shown by its linear image.

mod first_look;
mod search;
#[cfg(test)]
mod tests;
mod tracker;
mod words;

use std::sync::Arc;

use self::first_look::FirstLook;
use self::search::AutoSearch;
use self::tracker::AutoTracker;
use crate::solve::answer::{FoundContact, Solution, SolveError};
use crate::solve::before::adaptive_mean::Mean;
use crate::solve::fit::evidence::Evidence;
use crate::solve::fit::policy;
use crate::solve::fit::target::Target;
use crate::solve::methods::contacts::{
    ContactFinder, ContactHypothesis, ContactSearch, ContactSettings, ContactTracker,
};
use crate::solve::methods::image::{Complexity, Descent, Nonlinear, NonlinearSettings};
use crate::solve::methods::shapes::{ShapeFinder, ShapeTracker, StripFit};
use crate::solve::problem::Problem;
use crate::solve::solver::{Parts, Solver, Tracker, follow_and_search, follow_rows_and_search};
use tactomo_physics::forward::ForwardError;
use tactomo_physics::geometry;
use tactomo_physics::readings::Readings;

/// Chooses the model of the scene.
pub struct Auto {
    tracker: AutoTracker,
    search: AutoSearch,
}

/// What is inside a [`Hypothesis`](crate::solve::solver::Hypothesis) of this method.
#[derive(Clone, Debug, Default)]
struct FrameHypothesis {
    /// Contacts: the answer, or what is kept beside it.
    contacts: Option<Box<ContactHypothesis>>,
    /// What explains the frame better than they do, and why it is believed.
    whole: Option<(Whole, String)>,
    /// The shape that explains the frame nearly as well, where contacts are the answer.
    rival: Option<Rival>,
    /// The mean of the frames up to it as far as they stood still.
    mean: Option<Mean>,
}

/// A shape that may be there in place of the contacts that are believed.
#[derive(Clone, Copy, Debug)]
struct Rival {
    name: &'static str,
    /// Its probability.
    share: f64,
    /// How many contacts it is in place of, and how far apart the outermost are (m).
    contacts: usize,
    across_m: f64,
}

impl Rival {
    fn of(shape: &StripFit, evidence: Evidence, contacts: &[FoundContact]) -> Self {
        let name = if shape.strip().is_line() { "line" } else { "ring" };
        let (across_m, _) = across_m(contacts);
        Self { name, share: shape.evidence().share_against(&evidence), contacts: contacts.len(), across_m }
    }

    /// Whether these are still the contacts that it was compared with: as many, and as far apart as far as is known. Fingers that spread are no line.
    fn is_of(&self, contacts: &[FoundContact]) -> bool {
        let (across_m, error_m) = across_m(contacts);
        contacts.len() == self.contacts && (across_m - self.across_m).abs() <= policy::SPREAD_DEVIATIONS * error_m
    }
}

/// How far apart the outermost of some contacts are, and the standard error of that (m).
fn across_m(contacts: &[FoundContact]) -> (f64, f64) {
    let variance_m2 = |contact: &FoundContact| {
        contact.uncertainty.map_or(f64::INFINITY, |errors| errors.x_m * errors.x_m + errors.y_m * errors.y_m)
    };
    let pairs = contacts.iter().enumerate().flat_map(|(k, one)| contacts[..k].iter().map(move |other| (one, other)));
    let ways = pairs.map(|(one, other)| {
        let way_m = geometry::distance([one.x_m, one.y_m], [other.x_m, other.y_m]);
        (way_m, (variance_m2(one) + variance_m2(other)).sqrt())
    });
    ways.max_by(|a, b| a.0.total_cmp(&b.0)).unwrap_or_default()
}

/// What touches as one, rather than as contacts.
#[derive(Clone, Debug)]
enum Whole {
    /// A line or a ring.
    Shape(Box<StripFit>),
    /// An image.
    Image(Box<Descent>),
}

impl Auto {
    /// Makes it ready for a problem.
    ///
    /// # Errors
    /// [`ForwardError`] if the model cannot be had on a coarser image.
    pub fn new(problem: &Problem) -> Result<Self, ForwardError> {
        // A model without fields of single contacts has images only.
        let contacts = ContactFinder::new(problem, ContactSettings::of(problem)).ok().map(Arc::new);
        let shapes = match contacts {
            Some(_) => ShapeFinder::new(problem)?.map(Arc::new),
            None => None,
        };
        let image = Nonlinear::new(problem, NonlinearSettings::default())?;
        let tracker = AutoTracker::new(
            problem.detector(),
            contacts.clone().map(ContactTracker::new),
            shapes.clone().map(ShapeTracker::new),
            image.clone(),
            FirstLook::new(problem),
        );
        let search = AutoSearch::new(contacts, shapes, image);
        Ok(Self { tracker, search })
    }
}

impl Solver for Auto {
    fn name(&self) -> &'static str {
        "auto"
    }

    fn solve(&mut self, readings: &Readings) -> Result<Solution, SolveError> {
        follow_and_search(&mut self.tracker, &mut self.search, readings)
    }

    fn solve_rows(&mut self, rows: &Readings, latest: &Readings, elapsed_s: f64) -> Result<Solution, SolveError> {
        follow_rows_and_search(&mut self.tracker, &mut self.search, (rows, latest), elapsed_s)
    }

    fn reset(&mut self) {
        self.tracker.reset();
        self.search.reset();
    }

    fn split(self: Box<Self>) -> Parts {
        Parts { tracker: Box::new(self.tracker), search: Some(Box::new(self.search)) }
    }
}

/// What an image leaves of a frame, by the errors that contacts are judged by; `None` without an image.
fn image_evidence(image: &Nonlinear, readings: &Readings, target: &Target) -> Result<Option<Evidence>, SolveError> {
    let explains = image.explains(readings)?;
    Ok(explains.map(|(volts, Complexity { determined, price })| {
        let cost = target.cost(&volts);
        Evidence { cost, price, parameters: determined }
    }))
}
