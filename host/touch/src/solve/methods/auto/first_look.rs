//! What is shown of a touch until a search has found what it is: the linear image. A frame of it takes some 20 us; a search takes 5 ms to 100 ms, and longer
//! where it shares a processor.

use crate::solve::answer::SolveError;
use crate::solve::fit::lambda::Lambda;
use crate::solve::methods::linear::{Tikhonov, Variant};
use crate::solve::problem::Problem;
use crate::solve::solver::Followed;
use tactomo_physics::readings::Readings;

/// Makes the linear image of what nothing is known of yet.
pub(super) struct FirstLook {
    problem: Problem,
    linear: Tikhonov,
}

impl FirstLook {
    /// Makes it ready for a problem.
    pub fn new(problem: &Problem) -> Self {
        let linear = Tikhonov::new(&problem.jacobian, Lambda::default(), Variant::Balanced);
        Self { problem: problem.clone(), linear }
    }

    /// An answer to readings; with their image if something touches and nothing is found of it yet.
    pub fn of(&self, mut followed: Followed, readings: &Readings) -> Result<Followed, SolveError> {
        let solution = &mut followed.solution;
        let is_nothing = solution.contacts.is_empty() && solution.image_s_per_m2.is_none();
        if is_nothing && solution.flags.unfinished {
            let image = self.linear.image_s_per_m2(&self.problem.completed(readings))?;
            // Contacts conduct: what linear theory has below zero is its error.
            solution.image_s_per_m2 = Some(image.iter().map(|density| density.max(0.0)).collect());
        }
        Ok(followed)
    }
}
