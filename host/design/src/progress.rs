//! How far a study is, and the end that Ctrl-C gives it.

use std::sync::atomic::AtomicBool;
use std::time::{Duration, Instant};

use tactomo_physics::threads::map_until;

/// What a study tells while it runs, and what stops it.
#[derive(Clone, Copy)]
pub struct Progress<'a> {
    /// Set to end after what is begun; what is done is kept.
    pub stop: &'a AtomicBool,
    /// Told, on any thread, what is done.
    pub say: &'a (dyn Fn(&Step) + Sync),
}

/// How far a study is.
#[derive(Clone, Debug, PartialEq)]
pub struct Step {
    /// Of what, in a word or two.
    pub what: &'static str,
    /// How many are done.
    pub done: usize,
    /// Of how many.
    pub all: usize,
    /// Time that is left if all take alike.
    pub left: Duration,
}

impl Progress<'_> {
    /// A function of each of some things on all cores, in their order; `None` of what was not begun when it was stopped.
    pub fn map<T: Sync, R: Send>(
        &self,
        what: &'static str,
        all: &[T],
        function: impl Fn(&T) -> R + Sync,
    ) -> Vec<Option<R>> {
        let start = Instant::now();
        let done = |done: usize| {
            let left = start.elapsed().mul_f64((all.len() - done) as f64 / done.max(1) as f64);
            (self.say)(&Step { what, done, all: all.len(), left });
        };
        map_until(all, self.stop, &done, function)
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
        let progress = Progress { stop: &stop, say: &|step| steps.lock().unwrap().push(step.clone()) };
        let doubled = progress.map("numbers", &[1, 2, 3], |x| 2 * x);
        assert_eq!(doubled, [Some(2), Some(4), Some(6)]);
        let mut steps = steps.into_inner().unwrap();
        steps.sort_by_key(|step| step.done);
        assert_eq!(steps.iter().map(|step| step.done).collect::<Vec<_>>(), [1, 2, 3]);
        assert!(steps[2].left.is_zero() && steps[2].all == 3 && steps[2].what == "numbers");
    }
}
