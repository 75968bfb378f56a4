//! No more model than the scene needs.
//!
//! Nothing, one contact, two, up to six, a line, a ring, an image: what explains the readings at the lowest price ([`Evidence`]) is the
//! answer, and the solution says which and why. What is known is followed from frame to frame, which costs least, and searched anew
//! only when it no longer explains the readings, or now and then.

mod follower;
mod searcher;
#[cfg(test)]
mod tests;
mod words;

use std::sync::Arc;

use self::follower::AutoFollower;
use self::searcher::AutoSearcher;
use super::contacts::{ContactFinder, ContactFollower, ContactSearcher, Found, Target};
use super::evidence::Evidence;
use super::follow::{Follower, Parts, follow_and_search, follow_rows_and_search};
use super::nonlinear::Complexity;
use super::shapes::{ShapeFinder, ShapeFollower};
use super::{ContactSettings, Nonlinear, NonlinearSettings, Problem, Solution, SolveError, Solver};
use tactomo_physics::forward::ForwardError;
use tactomo_physics::readings::Readings;

/// Chooses the model of the scene.
pub struct Auto {
    follower: AutoFollower,
    searcher: AutoSearcher,
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
        let follower = AutoFollower::new(
            problem.detector(),
            contacts.clone().map(ContactFollower::new),
            shapes.clone().map(ShapeFollower::new),
            image.clone(),
        );
        let searcher = AutoSearcher::new(contacts, shapes, image);
        Ok(Self { follower, searcher })
    }
}

impl Solver for Auto {
    fn name(&self) -> &'static str {
        "auto"
    }

    fn solve(&mut self, readings: &Readings) -> Result<Solution, SolveError> {
        follow_and_search(&mut self.follower, &mut self.searcher, readings)
    }

    fn solve_rows(&mut self, rows: &Readings, latest: &Readings, elapsed_s: f64) -> Result<Solution, SolveError> {
        follow_rows_and_search(&mut self.follower, &mut self.searcher, (rows, latest), elapsed_s)
    }

    fn reset(&mut self) {
        self.follower.reset();
        self.searcher.reset();
    }

    fn split(self: Box<Self>) -> Parts {
        Parts { follower: Box::new(self.follower), searcher: Some(Box::new(self.searcher)) }
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
