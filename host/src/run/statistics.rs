//! Counts, rates and ages of frames and answers, in bounded memory.

use std::time::{Duration, Instant};

use tactomo_protocol::FrameHead;

use super::{Latency, Statistics};

/// Time over which the shown frame rate is taken.
const RATE_OVER: Duration = Duration::from_secs(1);

/// Bits of a latency's mantissa: buckets are 1/32 of their value wide.
const MANTISSA_BITS: u32 = 5;
const BUCKETS: usize = ((u64::BITS - MANTISSA_BITS + 1) as usize) << MANTISSA_BITS;

/// Counts what is received and what becomes of it.
#[derive(Debug, Default)]
pub struct Meter {
    folded: u64,
    dropped: u64,
    corrupt: u64,
    skipped: u64,
    received: Rate,
    solved: Rate,
    age: Histogram,
    latency: Histogram,
}

/// Counts events, and how many there are a second.
#[derive(Clone, Copy, Debug, Default)]
struct Rate {
    count: u64,
    /// When the first and the newest came.
    span: Option<(Instant, Instant)>,
    recent: Option<Recent>,
}

/// Events since `since`, and the rate over the time before.
#[derive(Clone, Copy, Debug)]
struct Recent {
    since: Instant,
    events: u64,
    per_s: f64,
}

impl Meter {
    /// Counts a frame whose last byte came at `received`, after `dropped` missing ones.
    pub fn frame(&mut self, received: Instant, head: &FrameHead, dropped: u64) {
        self.folded += u64::from(head.folded);
        self.dropped += dropped;
        self.received.add(received);
    }

    /// Counts an answer, `latency` after its frame was taken up and `age` after its last byte came; `came` frames had come since the
    /// answer before, none if it is a better one to the same frame.
    pub fn solved(&mut self, came: u32, age: Duration, latency: Duration) {
        self.skipped += u64::from(came.saturating_sub(1));
        self.solved.add(Instant::now());
        self.age.add(age.as_nanos() as u64);
        self.latency.add(latency.as_nanos() as u64);
    }

    /// Counts stretches of bytes that were no message.
    pub fn corrupt(&mut self, stretches: u64) {
        self.corrupt += stretches;
    }

    /// All of it at a moment.
    pub fn statistics(&mut self, now: Instant) -> Statistics {
        Statistics {
            frames: self.received.count,
            frames_per_s: self.received.recent_per_s(now),
            folded: self.folded,
            dropped: self.dropped,
            skipped: self.skipped,
            solved: self.solved.count,
            solved_per_s: self.solved.recent_per_s(now),
            corrupt: self.corrupt,
            age: self.age.summary_us(),
            latency: self.latency.summary_us(),
        }
    }

    /// Frames a second from the first frame to the newest.
    pub fn overall_frames_per_s(&self) -> f64 {
        self.received.overall_per_s()
    }
}

impl Rate {
    fn add(&mut self, at: Instant) {
        self.count += 1;
        let first = self.span.map_or(at, |(first, _)| first);
        self.span = Some((first, at));
        let recent = self.recent.get_or_insert(Recent { since: at, events: 0, per_s: 0.0 });
        recent.events += 1;
        recent.advance(at);
    }

    fn recent_per_s(&mut self, now: Instant) -> f64 {
        self.recent.as_mut().map_or(0.0, |recent| {
            recent.advance(now);
            recent.per_s
        })
    }

    fn overall_per_s(&self) -> f64 {
        let Some((first, last)) = self.span else { return 0.0 };
        let seconds = last.duration_since(first).as_secs_f64();
        if seconds > 0.0 { (self.count - 1) as f64 / seconds } else { 0.0 }
    }
}

impl Recent {
    fn advance(&mut self, now: Instant) {
        let elapsed = now.duration_since(self.since);
        if elapsed >= RATE_OVER {
            *self = Self { since: now, events: 0, per_s: self.events as f64 / elapsed.as_secs_f64() };
        }
    }
}

/// Durations in buckets whose width grows with them: any quantile to 3 %, in 15 kB, for any number of them.
#[derive(Debug)]
struct Histogram {
    buckets: Box<[u64; BUCKETS]>,
    count: u64,
    max_ns: u64,
}

impl Default for Histogram {
    fn default() -> Self {
        Self { buckets: Box::new([0; BUCKETS]), count: 0, max_ns: 0 }
    }
}

impl Histogram {
    fn add(&mut self, ns: u64) {
        self.buckets[bucket(ns)] += 1;
        self.count += 1;
        self.max_ns = self.max_ns.max(ns);
    }

    /// The duration (ns) that `share` of all do not exceed; zero if there are none.
    fn quantile_ns(&self, share: f64) -> u64 {
        let wanted = (share * self.count as f64).ceil() as u64;
        let mut seen = 0;
        let reached = self.buckets.iter().position(|count| {
            seen += count;
            seen >= wanted
        });
        reached.map_or(self.max_ns, last_of).min(self.max_ns)
    }

    fn summary_us(&self) -> Latency {
        let us = |ns: u64| ns as f64 / 1000.0;
        Latency { p50: us(self.quantile_ns(0.5)), p99: us(self.quantile_ns(0.99)), max: us(self.max_ns) }
    }
}

/// Small values have a bucket each; above, the place of the highest bit and the bits after it.
fn bucket(ns: u64) -> usize {
    let shift = (u64::BITS - ns.leading_zeros()).saturating_sub(MANTISSA_BITS + 1);
    ((shift as usize) << MANTISSA_BITS) + (ns >> shift) as usize
}

/// Largest duration (ns) in a bucket.
fn last_of(bucket: usize) -> u64 {
    let shift = (bucket >> MANTISSA_BITS).saturating_sub(1);
    let mantissa = (bucket - (shift << MANTISSA_BITS)) as u128;
    (((mantissa + 1) << shift) - 1) as u64
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn buckets_hold_their_values_to_three_per_cent(ns in any::<u64>()) {
            let last = last_of(bucket(ns));
            prop_assert!(bucket(ns) < BUCKETS);
            prop_assert!(last >= ns && last - ns <= ns / 32, "{ns} is in the bucket up to {last}");
        }

        #[test]
        fn quantiles_are_those_of_the_sorted_values(mut all in prop::collection::vec(0u64..10_000_000, 1..300)) {
            let mut histogram = Histogram::default();
            all.iter().for_each(|ns| histogram.add(*ns));
            all.sort_unstable();
            for share in [0.5, 0.99, 1.0] {
                let exact = all[(share * all.len() as f64).ceil() as usize - 1];
                let found = histogram.quantile_ns(share);
                prop_assert!(found >= exact && found - exact <= exact / 32, "{found} for {exact}");
            }
            prop_assert_eq!(histogram.max_ns, all[all.len() - 1]);
        }
    }

    #[test]
    fn rates_counts_and_ages() {
        let mut meter = Meter::default();
        let start = Instant::now();
        for i in 0..=250 {
            meter.frame(
                start + Duration::from_millis(10 * i),
                &FrameHead { folded: 1, ..FrameHead::default() },
                u64::from(i == 7),
            );
        }
        meter.solved(3, Duration::from_micros(70), Duration::from_micros(20));
        meter.solved(0, Duration::from_micros(90), Duration::from_micros(20));
        meter.corrupt(3);
        let statistics = meter.statistics(start + Duration::from_millis(2500));
        assert_eq!((statistics.frames, statistics.folded, statistics.dropped, statistics.corrupt), (251, 251, 1, 3));
        assert_eq!((statistics.solved, statistics.skipped), (2, 2));
        assert!((statistics.frames_per_s - 100.0).abs() < 1.5, "{}", statistics.frames_per_s);
        assert!((meter.overall_frames_per_s() - 100.0).abs() < 1e-6);
        assert_eq!((statistics.age.max, statistics.latency.max), (90.0, 20.0));
        let quiet = meter.statistics(start + Duration::from_secs(60));
        assert!(quiet.frames_per_s < 2.0, "a silent board has no frame rate");
    }

    #[test]
    fn without_frames_everything_is_zero() {
        let mut meter = Meter::default();
        assert_eq!(meter.statistics(Instant::now()), Statistics::default());
        assert_eq!(meter.overall_frames_per_s(), 0.0);
    }
}
