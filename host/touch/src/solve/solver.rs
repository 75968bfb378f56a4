//! What a method is to those who run it: a solver, or its two halves.
//!
//! One half follows what is known from frame to frame, fast, and one searches thoroughly, slowly. Offline they take turns on every frame. Live, each
//! has a thread of its own: the tracker answers at the board's rate, and goes on from what a search has found once that explains the present better.

use std::any::Any;
use std::ops::ControlFlow;
use std::sync::Arc;

use crate::solve::answer::{FoundContact, Solution, SolveError};
use tactomo_physics::readings::Readings;
use tactomo_physics::scene::Contact;

/// A method that reads touch from the readings of a frame.
///
/// ```
/// use tactomo_physics::{detector::Detector, forward::readings_v, scene::Contact, simulate::finer_model};
/// use tactomo_touch::solve::{Method, Problem};
///
/// let detector = Detector::default().taken_as_exact();
/// let press = Contact::flat(0.009, -0.006, 0.003, 2e-4);
/// let readings = readings_v(&finer_model(&detector, &[], 0)?.impedance_ohm(&[press])?, &detector);
///
/// let mut solver = Method::Contacts.build(&Problem::of(&detector)?)?;
/// let solution = solver.solve(&readings)?;
/// assert_eq!(solution.contacts.len(), 1);
/// assert!((solution.contacts[0].x_m - press.x_m).abs() < 1e-3);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub trait Solver: Send + 'static {
    /// Name on the command line.
    fn name(&self) -> &'static str;

    /// What the readings, less the baseline, say of the contacts.
    ///
    /// # Errors
    /// [`SolveError`] if the readings cannot be those of the detector the solver was made for.
    fn solve(&mut self, readings: &Readings) -> Result<Solution, SolveError>;

    /// What rows of readings that come `elapsed_s` (s) after those before say, the others of which say [nothing](tactomo_physics::readings::Says);
    /// `latest` are the latest of all. A solver that does not go by rows takes those.
    ///
    /// # Errors
    /// [`SolveError`] if the readings cannot be those of the detector the solver was made for.
    fn solve_rows(&mut self, rows: &Readings, latest: &Readings, elapsed_s: f64) -> Result<Solution, SolveError> {
        let _ = (rows, elapsed_s);
        self.solve(latest)
    }

    /// By how much more the best of some explanations, each fitted from where its contacts are, explains readings than the last answer does, which was to these: as a
    /// logarithm of the evidence (nats), below zero if none does. It tells whether a search is to blame for an answer. `None` of a solver without evidence for what it has not
    /// searched. The frames before are forgotten.
    ///
    /// # Errors
    /// [`SolveError`] if the readings cannot be those of the detector.
    fn explained_better(
        &mut self,
        readings: &Readings,
        explanations: &[Vec<Contact>],
    ) -> Result<Option<f64>, SolveError> {
        let _ = (readings, explanations);
        Ok(None)
    }

    /// Forgets the frames before, from which some solvers start: the next answer is that of a new solver.
    fn reset(&mut self) {}

    /// The halves of it that a live picture runs side by side: by default all of it in the tracker.
    fn split(self: Box<Self>) -> Parts {
        Parts { tracker: Box::new(Direct(self)), search: None }
    }
}

/// Follows what is known from frame to frame.
pub trait Tracker: Send {
    /// The answer for the next frame.
    ///
    /// # Errors
    /// [`SolveError`] if the readings cannot be those of the detector.
    fn follow(&mut self, readings: &Readings) -> Result<Followed, SolveError>;

    /// The answer for rows of readings that come `elapsed_s` (s) after those before, the others of which say
    /// [nothing](tactomo_physics::readings::Says); `latest` are the latest of all, which are taken by a tracker that does not go by rows.
    ///
    /// # Errors
    /// [`SolveError`] if the readings cannot be those of the detector.
    fn follow_rows(&mut self, rows: &Readings, latest: &Readings, elapsed_s: f64) -> Result<Followed, SolveError> {
        let _ = (rows, elapsed_s);
        self.follow(latest)
    }

    /// Goes on from what a search has found, if that explains these readings better than what is followed; the answer for these
    /// readings, which are those of the frame that was followed last, or of the next one.
    ///
    /// # Errors
    /// [`SolveError`] if the readings cannot be those of the detector.
    fn adopt(&mut self, hypothesis: Hypothesis, readings: &Readings) -> Result<Followed, SolveError>;

    /// The grounds whose rows tell most of what is followed, so many of them, some perhaps more than once; where nothing touches, those that
    /// see a touch come. `None` where whole frames tell it best.
    fn telling_grounds(&self, count: usize) -> Option<Vec<usize>> {
        let _ = count;
        None
    }

    /// Whether a search has something to look at that none has seen, so that it need not wait.
    fn has_news(&self) -> bool {
        false
    }

    /// What is followed: where a search may begin.
    fn hypothesis(&self) -> Hypothesis;

    /// Goes on from contacts that another tracker found before, and from their numbers.
    fn inherit(&mut self, before: &[FoundContact]) {
        let _ = before;
    }

    /// Forgets the frames before.
    fn reset(&mut self);
}

/// Searches what explains a frame.
pub trait Search: Send {
    /// What explains `readings`, or the mean that `from` has of them and of those before; `from` is what was followed up to now, and
    /// explains them partly. What is better than nothing on the way there goes to `found`, which breaks where nothing better is of use any more.
    ///
    /// # Errors
    /// [`SolveError`] if the readings cannot be those of the detector.
    fn search(
        &mut self,
        from: Hypothesis,
        readings: &Readings,
        found: &mut dyn FnMut(Hypothesis) -> ControlFlow<()>,
    ) -> Result<Hypothesis, SolveError>;
}

/// The answer of a tracker.
#[derive(Clone, Debug, PartialEq)]
pub struct Followed {
    /// What is known now.
    pub solution: Solution,
    /// Whether a search may find something better.
    pub search: bool,
}

/// The halves of a solver.
pub struct Parts {
    /// Answers at once.
    pub tracker: Box<dyn Tracker>,
    /// Answers thoroughly; none where the tracker's answers are.
    pub search: Option<Box<dyn Search>>,
}

impl Parts {
    /// All of a solver in the tracker: every answer is thorough.
    pub fn whole(solver: Box<dyn Solver>) -> Self {
        Self { tracker: Box::new(Direct(solver)), search: None }
    }
}

/// What explains a frame, handed from the search to the tracker and back. What is inside only the method knows whose half made it.
#[derive(Clone, Debug, Default)]
pub struct Hypothesis(Option<Arc<dyn Any + Send + Sync>>);

impl Hypothesis {
    /// A hypothesis of a method's own kind.
    pub(crate) fn of<T: Any + Send + Sync>(known: T) -> Self {
        Self(Some(Arc::new(known)))
    }

    /// What is known, if it is of this kind; else nothing.
    pub(crate) fn known<T: Any + Send + Sync + Clone + Default>(self) -> T {
        self.0.and_then(|known| known.downcast().ok()).map(Arc::unwrap_or_clone).unwrap_or_default()
    }
}

/// One frame by both halves, one after the other: the thorough answer.
pub(crate) fn follow_and_search(
    tracker: &mut dyn Tracker,
    search: &mut dyn Search,
    readings: &Readings,
) -> Result<Solution, SolveError> {
    let followed = tracker.follow(readings)?;
    if !followed.search {
        return Ok(followed.solution);
    }
    let hypothesis = search.search(tracker.hypothesis(), readings, &mut |_| ControlFlow::Continue(()))?;
    Ok(tracker.adopt(hypothesis, readings)?.solution)
}

/// Rows of readings by both halves, one after the other: the thorough answer.
pub(crate) fn follow_rows_and_search(
    tracker: &mut dyn Tracker,
    search: &mut dyn Search,
    (rows, latest): (&Readings, &Readings),
    elapsed_s: f64,
) -> Result<Solution, SolveError> {
    let followed = tracker.follow_rows(rows, latest, elapsed_s)?;
    if !followed.search {
        return Ok(followed.solution);
    }
    let hypothesis = search.search(tracker.hypothesis(), latest, &mut |_| ControlFlow::Continue(()))?;
    Ok(tracker.adopt(hypothesis, latest)?.solution)
}

/// A solver whose every answer is thorough, as a tracker.
pub(crate) struct Direct<S: ?Sized>(pub Box<S>);

impl<S: Solver + ?Sized> Tracker for Direct<S> {
    fn follow(&mut self, readings: &Readings) -> Result<Followed, SolveError> {
        Ok(Followed { solution: self.0.solve(readings)?, search: false })
    }

    fn follow_rows(&mut self, rows: &Readings, latest: &Readings, elapsed_s: f64) -> Result<Followed, SolveError> {
        Ok(Followed { solution: self.0.solve_rows(rows, latest, elapsed_s)?, search: false })
    }

    fn adopt(&mut self, _hypothesis: Hypothesis, readings: &Readings) -> Result<Followed, SolveError> {
        self.follow(readings)
    }

    fn hypothesis(&self) -> Hypothesis {
        Hypothesis::default()
    }

    fn reset(&mut self) {
        self.0.reset();
    }
}
