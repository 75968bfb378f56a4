//! How long a computation takes, whatever else the machine does.

use std::time::Duration;

/// What some work of this thread gave, and how long it took.
///
/// By the thread's own processor time where the system counts it (Linux, macOS), else by the wall clock. On an idle machine both are
/// the same, as solvers neither wait nor start threads. On a busy one the wall clock also counts the time in which others have the processor:
/// 10 ms at once, as much as a thousand frames of a linear image, so that harmless frames looked slow. Two calls of the clock take 0.3 us.
pub fn timed<T>(work: impl FnOnce() -> T) -> (T, Duration) {
    let begin = now();
    let result = work();
    (result, now().saturating_sub(begin))
}

#[cfg(any(target_os = "linux", target_os = "macos"))]
fn now() -> Duration {
    let time = rustix::time::clock_gettime(rustix::time::ClockId::ThreadCPUTime);
    // Both are never below zero, and the second is below 1e9.
    Duration::new(time.tv_sec.unsigned_abs(), time.tv_nsec as u32)
}

#[cfg(not(any(target_os = "linux", target_os = "macos")))]
fn now() -> Duration {
    static START: std::sync::LazyLock<std::time::Instant> = std::sync::LazyLock::new(std::time::Instant::now);
    START.elapsed()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::hint::black_box;
    use std::time::Instant;

    fn work() -> f64 {
        (0..2_000_000).map(|i| black_box(f64::from(i)).sqrt()).sum()
    }

    #[test]
    fn work_takes_time_and_more_work_more() {
        // The least of several: what runs beside it can make it longer, never shorter.
        let least = |times: usize| (0..5).map(|_| timed(|| (0..times).map(|_| work()).sum::<f64>()).1).min().unwrap();
        let (one, four) = (least(1), least(4));
        let ratio = four.as_secs_f64() / one.as_secs_f64();
        assert!(one > Duration::ZERO && (2.0..8.0).contains(&ratio), "{one:?} {four:?}");
    }

    /// Three more threads on each core leave this one a quarter of a core, and what it is timed to have used is no more than half of what passed.
    #[cfg(any(target_os = "linux", target_os = "macos"))]
    #[test]
    fn load_does_not_count() {
        let cores = std::thread::available_parallelism().map_or(1, |count| count.get());
        let begin = Instant::now();
        let until = begin + Duration::from_millis(600);
        let load = move || {
            while Instant::now() < until {
                black_box(work());
            }
        };
        let others: Vec<_> = (0..3 * cores).map(|_| std::thread::spawn(load)).collect();
        let mut counted = Duration::ZERO;
        while Instant::now() < until {
            counted += timed(work).1;
        }
        let passed = begin.elapsed();
        others.into_iter().for_each(|other| other.join().unwrap());
        assert!(counted < passed / 2, "{counted:?} of {passed:?}");
    }

    #[cfg(any(target_os = "linux", target_os = "macos"))]
    #[test]
    fn waiting_does_not_count() {
        let (_, time) = timed(|| std::thread::sleep(Duration::from_millis(50)));
        assert!(time < Duration::from_millis(10), "{time:?}");
    }
}
