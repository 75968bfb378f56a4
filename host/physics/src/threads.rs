//! Work on several cores.

use std::thread;

/// A function of each of some things, in their order, on as many threads as there are cores.
pub fn map<T: Sync, R: Send>(all: &[T], function: impl Fn(&T) -> R + Sync) -> Vec<R> {
    map_on(cores(), all, function)
}

/// How many cores there are.
pub fn cores() -> usize {
    thread::available_parallelism().map_or(1, usize::from)
}

/// The same on at most so many threads.
pub fn map_on<T: Sync, R: Send>(cores: usize, all: &[T], function: impl Fn(&T) -> R + Sync) -> Vec<R> {
    let cores = cores.min(all.len());
    if cores < 2 {
        return all.iter().map(function).collect();
    }
    // Every so-manieth to each, for neighbours cost alike.
    let of_core = &|core: usize| all.iter().skip(core).step_by(cores).map(&function).collect::<Vec<_>>();
    let mut parts: Vec<_> = thread::scope(|scope| {
        let workers: Vec<_> = (1..cores).map(|core| scope.spawn(move || of_core(core))).collect();
        let mut parts = vec![of_core(0)];
        for worker in workers {
            match worker.join() {
                Ok(part) => parts.push(part),
                Err(panic) => std::panic::resume_unwind(panic),
            }
        }
        parts.into_iter().map(Vec::into_iter).collect()
    });
    (0..all.len()).filter_map(|index| parts[index % cores].next()).collect()
}
