//! Work on several cores.

use std::cell::Cell;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::thread;

thread_local! {
    static LEAVES_A_CORE: Cell<bool> = const { Cell::new(false) };
}

/// A function of each of some things, in their order, on as many threads as there are cores.
pub fn map<T: Sync, R: Send>(all: &[T], function: impl Fn(&T) -> R + Sync) -> Vec<R> {
    map_on(cores(), all, function)
}

/// How many cores there are for the work of this thread.
pub fn cores() -> usize {
    let all = thread::available_parallelism().map_or(1, usize::from);
    if LEAVES_A_CORE.get() { all.saturating_sub(1).max(1) } else { all }
}

/// From now on leaves a core to others, whatever this thread works on: a live picture needs one.
pub fn leave_a_core() {
    LEAVES_A_CORE.set(true);
}

/// What a function makes of each, in their order, on at most so many threads.
pub fn map_on<T: Sync, R: Send>(cores: usize, all: &[T], function: impl Fn(&T) -> R + Sync) -> Vec<R> {
    map_until(cores, all, &AtomicBool::new(false), &|_| {}, function).into_iter().flatten().collect()
}

/// What a function makes of each, in their order, on at most so many threads until `stop` is set: `None` of what was not begun by then. `done`
/// gets, on any of the threads, this one among them, how many are done.
pub fn map_until<T: Sync, R: Send>(
    cores: usize,
    all: &[T],
    stop: &AtomicBool,
    done: &(dyn Fn(usize) + Sync),
    function: impl Fn(&T) -> R + Sync,
) -> Vec<Option<R>> {
    let (next, finished) = (AtomicUsize::new(0), AtomicUsize::new(0));
    // Each takes the next one that nobody has taken, for some take longer than others.
    let take = || {
        let mut results = Vec::new();
        while !stop.load(Ordering::Relaxed) {
            let index = next.fetch_add(1, Ordering::Relaxed);
            let Some(thing) = all.get(index) else { break };
            results.push((index, function(thing)));
            done(finished.fetch_add(1, Ordering::Relaxed) + 1);
        }
        results
    };
    let cores = cores.min(all.len());
    let mut results: Vec<Option<R>> = all.iter().map(|_| None).collect();
    thread::scope(|scope| {
        let workers: Vec<_> = (1..cores).map(|_| scope.spawn(take)).collect();
        let mut found = take();
        for worker in workers {
            found.extend(worker.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic)));
        }
        found.into_iter().for_each(|(index, result)| results[index] = Some(result));
    });
    results
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn results_are_in_order_however_long_each_takes() {
        let all: Vec<u64> = (0..100).collect();
        let slow_first = |value: &u64| {
            thread::sleep(std::time::Duration::from_micros(200 - 2 * value));
            value * value
        };
        assert_eq!(map(&all, slow_first), all.iter().map(|value| value * value).collect::<Vec<_>>());
        assert!(map(&[], |_: &u8| 0).is_empty());
    }

    #[test]
    fn what_was_not_begun_when_it_stops_is_missing_and_the_rest_is_there() {
        let (stop, most) = (AtomicBool::new(false), AtomicUsize::new(0));
        let all: Vec<usize> = (0..1000).collect();
        let done = |count: usize| {
            most.fetch_max(count, Ordering::Relaxed);
            stop.store(count >= 10, Ordering::Relaxed);
        };
        let found = map_until(cores(), &all, &stop, &done, |value| *value);
        let there: Vec<_> = found.iter().flatten().copied().collect();
        assert_eq!(there, (0..there.len()).collect::<Vec<_>>());
        assert!((10..900).contains(&there.len()) && most.load(Ordering::Relaxed) == there.len(), "{}", there.len());
    }
}
