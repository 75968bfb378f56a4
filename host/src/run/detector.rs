//! What belongs to one detector: its baseline, the watch over its electrodes, and what follows touch on it.

use std::collections::VecDeque;
use std::sync::Arc;
use std::time::{Duration, Instant};

use tactomo_board::baseline::BaselineTracker;
use tactomo_physics::detector::Detector;
use tactomo_physics::readings::Readings;
use tactomo_touch::solve::{ElectrodeWatch, Followed, Method, SolveError, Tracker};

use super::frame::{NewestReadings, Rows};
use super::inbox::Taken;
use super::order::Order;

/// Time for which rows that have waited are followed one after the other. A row of a contact takes 0.1 ms; of one that is as wide as a third of
/// the detector, whose fields vary over it, 1 ms to 2 ms, which is more than there is from one to the next: 64 had waited then, and answers
/// were up to 0.9 s old.
const ROW_BY_ROW: Duration = Duration::from_millis(8);

/// One detector at work.
pub(super) struct DetectorState {
    /// As it is solved for: as described, or as a calibration has found it.
    pub detector: Arc<Detector>,
    pub baseline: BaselineTracker,
    pub watch: ElectrodeWatch,
    /// `None` until the first solver is made.
    pub tracker: Option<Box<dyn Tracker>>,
    /// Board time of the rows before (us).
    rows_us: Option<u64>,
}

/// What a frame has changed besides the touch.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Noted {
    /// How the baseline stands.
    pub baseline: bool,
    /// Which electrodes are left out.
    pub electrodes: bool,
}

impl DetectorState {
    /// Begins with a detector as it is solved for.
    pub fn new(detector: Arc<Detector>, baseline: BaselineTracker) -> Self {
        Self { baseline, watch: ElectrodeWatch::new(&detector), detector, tracker: None, rows_us: None }
    }

    /// The solver of a method for this detector as it is.
    pub fn order(&self, method: Method) -> Order {
        Order { method, detector: Arc::clone(&self.detector), faulty: self.watch.faulty().clone() }
    }

    /// Readings less the baseline, as the channels read them.
    pub fn less_baseline(&self, readings: &Readings) -> Readings {
        let mut touch = readings.clone();
        self.baseline.subtract(readings.volts(), touch.volts_mut());
        touch
    }

    /// The same as no channel differs from others.
    pub fn touch(&self, readings: &Readings) -> Readings {
        let mut touch = self.less_baseline(readings);
        touch.correct_channels(&self.detector);
        touch
    }

    /// Takes note of a frame: what it says of the baseline and of the electrodes. Of rows, once all were read.
    pub fn note(&mut self, frame: &Taken) -> Noted {
        if frame.rows.is_empty() {
            let (time_s, left_out) = (1e-6 * frame.newest.board_time_us as f64, self.left_out());
            let baseline = self.baseline.add(&frame.mean.touches_v(), frame.averaged, time_s, &left_out);
            let touch = self.touch(&frame.mean);
            return Noted { baseline, electrodes: self.watch.note(&touch) };
        }
        let mut noted = Noted::default();
        for rows in &frame.rows {
            let left_out = self.left_out();
            let (is_changed, round) = self.baseline.add_rows(&rows.readings, 1e-6 * rows.time_us as f64, &left_out);
            noted.baseline |= is_changed;
            // Readings that were taken while something moved contradict each other without any fault.
            if let Some(round) = round.filter(|_| self.baseline.is_still(self.detector.adc.deviation_v())) {
                let touch = self.touch(&round);
                noted.electrodes |= self.watch.note(&touch);
            }
        }
        noted
    }

    fn left_out(&self) -> Vec<usize> {
        self.watch.faulty().faults.iter().map(|(electrode, _)| *electrode).collect()
    }

    /// The tracker's answer to a frame with such readings less the baseline; `None` while there is no tracker.
    pub fn follow(&mut self, frame: &Taken, touch: &Readings) -> Result<Option<Followed>, SolveError> {
        let mut rows: VecDeque<Rows> = frame.rows.iter().cloned().collect();
        rows.iter_mut().for_each(|rows| rows.readings = self.touch(&rows.readings));
        let Some(tracker) = &mut self.tracker else { return Ok(None) };
        if rows.is_empty() {
            self.rows_us = None;
            return tracker.follow(touch).map(Some);
        }
        let begun = Instant::now();
        let mut followed = None;
        while let Some(Rows { readings, time_us }) = next_rows(&mut rows, begun.elapsed()) {
            let before_us = self.rows_us.replace(time_us).unwrap_or(time_us);
            let elapsed_s = 1e-6 * time_us.saturating_sub(before_us) as f64;
            followed = Some(tracker.follow_rows(&readings, touch, elapsed_s)?);
        }
        Ok(followed)
    }
}

/// The next rows to follow, `spent` after the first of them: where they take too long, all that are left at once.
fn next_rows(rows: &mut VecDeque<Rows>, spent: Duration) -> Option<Rows> {
    let first = rows.pop_front()?;
    if spent < ROW_BY_ROW {
        return Some(first);
    }
    let newest_us = rows.back().map_or(first.time_us, |last| last.time_us);
    let mut newest = NewestReadings::new(first.readings.electrodes());
    std::iter::once(first).chain(rows.drain(..)).for_each(|rows| newest.add(&rows.readings));
    Some(Rows { readings: newest.readings(), time_us: newest_us })
}

#[cfg(test)]
mod tests {
    use super::*;
    use tactomo_physics::readings::Says;

    /// Row `ground` of 4 electrodes.
    fn rows(ground: usize, volts: f64, time_us: u64) -> Rows {
        let says = |g: usize, _| if g == ground { Says::Voltage } else { Says::Nothing };
        let readings = Readings::from_fn(4, |_, _| volts).saying(says);
        Rows { readings, time_us }
    }

    #[test]
    fn rows_that_take_too_long_are_followed_at_once_each_as_it_came_last() {
        let mut waiting = VecDeque::from([rows(0, 0.1, 0), rows(1, 0.2, 700), rows(2, 0.3, 1400), rows(1, 0.4, 2100)]);
        let first = next_rows(&mut waiting, Duration::ZERO).expect("the first");
        assert_eq!((first, waiting.len()), (rows(0, 0.1, 0), 3), "one after the other");
        let rest = next_rows(&mut waiting, ROW_BY_ROW).expect("the others");
        assert_eq!(rest.time_us, 2100);
        let said: Vec<_> = (0..4).map(|ground| rest.readings.says(ground, 0)).collect();
        assert_eq!(said, [Says::Nothing, Says::Voltage, Says::Voltage, Says::Nothing]);
        assert_eq!([rest.readings.at(1, 3), rest.readings.at(2, 0)], [0.4, 0.3]);
        assert_eq!(next_rows(&mut waiting, ROW_BY_ROW), None);
    }
}
