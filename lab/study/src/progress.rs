//! How far a study is, and the end that whoever runs it gives it.

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use tactomo_physics::threads::{cores, map_until};

/// What a study tells while it runs, and what stops it.
#[derive(Clone, Copy)]
pub struct Progress<'a> {
    /// Set to end after what is begun; what is done is kept.
    pub stop: &'a AtomicBool,
    /// Told, on any thread, what is done.
    pub say: &'a (dyn Fn(&Step) + Sync),
    /// What was done before of the whole, how large that is, and since when; if this is a part of it.
    whole: Option<(usize, usize, Instant)>,
}

/// How far a study is.
#[derive(Clone, Debug, PartialEq)]
pub struct Step {
    /// Of what, or at what, in a few words.
    pub what: String,
    /// How many are done.
    pub done: usize,
    /// Of how many.
    pub all: usize,
    /// Time that is left if all take alike.
    pub left: Duration,
}

impl<'a> Progress<'a> {
    /// Progress of a whole.
    pub fn new(stop: &'a AtomicBool, say: &'a (dyn Fn(&Step) + Sync)) -> Self {
        Self { stop, say, whole: None }
    }

    /// The same for a part of `all`, of which so many are done.
    #[must_use]
    pub fn part(&self, done: usize, all: usize) -> Self {
        let since = self.whole.map_or_else(Instant::now, |(.., since)| since);
        Self { whole: Some((done, all, since)), ..*self }
    }

    /// Whether it is to end.
    pub fn is_stopped(&self) -> bool {
        self.stop.load(Ordering::Relaxed)
    }

    /// A function of each of some things on all cores, in their order; `None` of what was not begun when it was stopped.
    pub fn map<T: Sync, R: Send>(&self, what: &str, all: &[T], function: impl Fn(&T) -> R + Sync) -> Vec<Option<R>> {
        let progress = Self { whole: self.whole.or(Some((0, all.len(), Instant::now()))), ..*self };
        map_until(cores(), all, self.stop, &|done| progress.tell(what, done), function)
    }

    /// Tells that so much of this part is done, and what that was or is next.
    pub fn tell(&self, what: &str, done: usize) {
        let Some((before, all, start)) = self.whole else { return };
        let done = before + done;
        let left = start.elapsed().mul_f64(all.saturating_sub(done) as f64 / done.max(1) as f64);
        (self.say)(&Step { what: what.to_owned(), done, all, left });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::Mutex;

    #[test]
    fn each_step_is_told_and_the_last_one_has_nothing_left() {
        let steps = Mutex::new(Vec::new());
        let stop = AtomicBool::new(false);
        let say = |step: &Step| steps.lock().unwrap().push(step.clone());
        let progress = Progress::new(&stop, &say);
        let doubled = progress.map("numbers", &[1, 2, 3], |x| 2 * x);
        assert_eq!(doubled, [Some(2), Some(4), Some(6)]);
        let mut steps = steps.into_inner().unwrap();
        steps.sort_by_key(|step| step.done);
        assert_eq!(steps.iter().map(|step| step.done).collect::<Vec<_>>(), [1, 2, 3]);
        assert!(steps[2].left.is_zero() && steps[2].all == 3 && steps[2].what == "numbers");
    }
    #[test]
    fn a_part_goes_on_from_what_was_done_before() {
        let steps = Mutex::new(Vec::new());
        let stop = AtomicBool::new(false);
        let say = |step: &Step| steps.lock().unwrap().push(step.clone());
        Progress::new(&stop, &say).part(6, 10).tell("a sweep", 2);
        let steps = steps.into_inner().unwrap();
        assert_eq!((steps[0].what.as_str(), steps[0].done, steps[0].all), ("a sweep", 8, 10));
    }
}
