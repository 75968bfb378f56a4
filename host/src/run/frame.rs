//! Frames as they came, and rows of boards that send some at a time.

use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use tactomo_board::clock::Delay;
use tactomo_physics::readings::Readings;
use tactomo_protocol::Status;
use tactomo_touch::solve::Latest;

/// A frame as it came.
#[derive(Clone, Debug, PartialEq)]
pub struct Frame {
    /// Number of the scan since the board started, unwrapped.
    pub sequence: u64,
    /// Board time in the middle of the scan, unwrapped, in microseconds (us).
    pub board_time_us: u64,
    /// When its last byte came.
    pub arrived: Arrival,
    /// How long before that it was scanned, as far as the board's clock is known.
    pub delay: Option<Delay>,
    /// What happened during the scan.
    pub status: Status,
    /// Frames that the link or the board have lost since the run began, up to this one, as the sequence numbers say.
    pub lost: u64,
    /// Readings as measured (V); of rows the latest of each.
    pub measured: Readings,
    /// The same as they are [used](tactomo_board::measured::Volts::used) (V): one that its converter's noise may hide below the floor, or above the
    /// ceiling, is that bound.
    pub used: Readings,
}

impl Frame {
    /// The first of a board, which comes at this time.
    pub fn first(measured: Readings, used: Readings, arrived: Arrival) -> Self {
        Self { sequence: 0, board_time_us: 0, arrived, delay: None, status: Status::default(), lost: 0, measured, used }
    }

    /// Board time in the middle of the scan (s).
    pub fn time_s(&self) -> f64 {
        self.board_time_us as f64 / 1e6
    }

    /// When the middle of the scan was, by the clock of the machine that received it; `None` if the board's clock is not known.
    pub fn scanned(&self) -> Option<HostTime> {
        let Delay { delay_s, error_s } = self.delay?;
        let unix_ns = self.arrived.unix_ns.saturating_add_signed(-((delay_s * 1e9).round() as i64));
        Some(HostTime { unix_ns, error_ns: (error_s * 1e9).ceil() as u64 })
    }

    /// When the middle of the scan was, or, where the board's clock is not known, when it came: nanoseconds since 1970 (ns).
    pub fn stamp_ns(&self) -> u64 {
        self.scanned().map_or(self.arrived.unix_ns, |scanned| scanned.unix_ns)
    }
}

/// A moment by the clock of the machine that received a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct HostTime {
    /// Nanoseconds since 1970 (ns).
    pub unix_ns: u64,
    /// How far that is from the truth at most (ns).
    pub error_ns: u64,
}

/// When the last byte of a frame came.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Arrival {
    /// By the clock of the machine that received it: nanoseconds since 1970 (ns).
    pub unix_ns: u64,
    /// By the clock that ages are told by; none of a frame from a file.
    live: Option<Instant>,
}

impl Arrival {
    /// Of a frame that came at a moment.
    pub fn at(moment: Instant) -> Self {
        let now = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
        Self { live: Some(moment), ..Self::recorded(now.saturating_sub(moment.elapsed())) }
    }

    /// Of a frame from a file, which came so long after 1970.
    pub fn recorded(since_1970: Duration) -> Self {
        Self { unix_ns: u64::try_from(since_1970.as_nanos()).unwrap_or(u64::MAX), live: None }
    }

    /// Time since then; `None` of a frame from a file.
    pub fn age(self, now: Instant) -> Option<Duration> {
        self.live.map(|moment| now.saturating_duration_since(moment))
    }
}

/// Rows of readings that came as a frame.
#[derive(Clone, Debug, PartialEq)]
pub struct Rows {
    /// Readings (V); those that are not in it say nothing.
    pub readings: Readings,
    /// Board time at their start, unwrapped, in microseconds (us).
    pub time_us: u64,
}

/// Whole readings of rows: each as it was read last, however long ago.
#[derive(Clone, Debug)]
pub struct NewestReadings(Latest);

impl NewestReadings {
    /// None was read yet.
    pub fn new(electrodes: usize) -> Self {
        Self(Latest::new(electrodes))
    }

    /// Takes rows.
    pub fn add(&mut self, rows: &Readings) {
        self.0.add(rows, 0.0, None);
    }

    /// All of them (V); those that were never read say nothing.
    pub fn readings(&self) -> Readings {
        self.0.readings(f64::MAX, None)
    }

    /// The same with these rows.
    pub fn with(&mut self, rows: &Readings) -> Readings {
        self.add(rows);
        self.readings()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn moments_are_told_by_the_clock() {
        let now_ns = SystemTime::now().duration_since(UNIX_EPOCH).unwrap().as_nanos() as u64;
        let before = Instant::now().checked_sub(Duration::from_secs(1)).unwrap();
        let told = Arrival::at(before);
        // A second before, within what a busy machine may take from one line to the next.
        assert!(told.unix_ns < now_ns && told.unix_ns + 60_000_000_000 > now_ns, "{told:?} {now_ns}");
        assert_eq!(told.age(before + Duration::from_millis(5)), Some(Duration::from_millis(5)));
        assert_eq!(Arrival::recorded(Duration::from_secs(3)).age(before), None);
    }

    #[test]
    fn each_reading_is_the_newest_however_old() {
        let row = |g: usize, volts: f64| Readings::from_fn(4, |_, _| volts).hiding(|ground, _| ground != g);
        let mut newest = NewestReadings::new(4);
        (0..200).for_each(|_| newest.add(&row(1, 0.1)));
        let all = newest.with(&row(2, 0.2));
        assert_eq!([all.at(1, 3), all.at(2, 0)], [0.1, 0.2]);
        assert!(!all.is_whole(), "two rows were never read");
    }
}
