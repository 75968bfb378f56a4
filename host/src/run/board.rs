//! What belongs to one detector: its baseline, the watch over its electrodes, and what follows touch on it.

use std::sync::Arc;

use tactomo_board::baseline::Baseline;
use tactomo_physics::detector::Detector;
use tactomo_physics::readings::Readings;
use tactomo_touch::solve::{ElectrodeWatch, Followed, Follower, Method, SolveError};

use super::inbox::Taken;
use super::maker::Order;

/// One detector at work.
pub(super) struct BoardState {
    /// As it is described, and as it is solved for: calibrated, or the same.
    pub description: Arc<Detector>,
    pub detector: Arc<Detector>,
    pub baseline: Baseline,
    pub watch: ElectrodeWatch,
    /// `None` until the first solver is made.
    pub follower: Option<Box<dyn Follower>>,
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

impl BoardState {
    /// Begins with a detector as it is described and as it is solved for.
    pub fn new(description: Arc<Detector>, detector: Arc<Detector>, baseline: Baseline) -> Self {
        Self { baseline, watch: ElectrodeWatch::new(&detector), description, detector, follower: None, rows_us: None }
    }

    /// The solver of a method for this detector as it is.
    pub fn order(&self, method: Method) -> Order {
        Order { method, detector: Arc::clone(&self.detector), faulty: self.watch.faulty().clone() }
    }

    /// Readings less the baseline.
    pub fn less_rest(&self, readings: &Readings) -> Readings {
        let mut touch = readings.clone();
        self.baseline.subtract(readings.volts(), touch.volts_mut());
        touch
    }

    /// The same as no channel differs from others.
    pub fn touch(&self, readings: &Readings) -> Readings {
        let mut touch = self.less_rest(readings);
        touch.correct_channels(&self.detector);
        touch
    }

    /// Takes note of a frame: what it says of the baseline and of the electrodes. Of rows, once all were read.
    pub fn note(&mut self, frame: &Taken) -> Noted {
        if frame.rows.is_empty() {
            let (time_s, left_out) = (1e-6 * frame.board_time_us as f64, self.left_out());
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

    /// The follower's answer to a frame with such readings less the baseline; `None` while there is no follower.
    pub fn follow(&mut self, frame: &Taken, touch: &Readings) -> Result<Option<Followed>, SolveError> {
        let rows: Vec<(Readings, u64)> =
            frame.rows.iter().map(|rows| (self.touch(&rows.readings), rows.time_us)).collect();
        let Some(follower) = &mut self.follower else { return Ok(None) };
        if rows.is_empty() {
            self.rows_us = None;
            return follower.follow(touch).map(Some);
        }
        let mut followed = None;
        for (rows, time_us) in rows {
            let before_us = self.rows_us.replace(time_us).unwrap_or(time_us);
            let elapsed_s = 1e-6 * time_us.saturating_sub(before_us) as f64;
            followed = Some(follower.follow_rows(&rows, touch, elapsed_s)?);
        }
        Ok(followed)
    }
}
