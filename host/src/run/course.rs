//! The course of the readings: their mean at every frame that comes, whether it is solved or not, for its spectrum and for a chart.
//!
//! The mean of all readings takes one addition a reading, needs no baseline and no solver, and has 1/16 of the noise of one reading.

use std::collections::VecDeque;
use std::fmt;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use tactomo_physics::readings::Readings;
use tactomo_touch::vibration::{Peak, Samples, Spectrum};

/// Points of the chart: one each so long (us), the mean of the frames in it, which takes off what is too fast for a chart.
pub const POINT_US: u64 = 4000;
/// Points kept: of two seconds.
const POINTS: usize = 500;

/// What frames the board sends, shared by the reader, who adds to it, and whoever looks. Clones are of the same course.
#[derive(Clone, Default)]
pub struct Course(Arc<Mutex<State>>);

#[derive(Default)]
struct State {
    samples: Samples,
    /// Means of whole points (V), and the number that the next one has.
    points: VecDeque<f32>,
    next: u64,
    /// The point that is not whole yet: its place in board time, sum and count.
    place: u64,
    sum: f64,
    count: u32,
}

impl Course {
    /// Takes a frame, measured at this board time (us).
    pub fn add(&self, board_time_us: u64, readings: &Readings) {
        let volts = readings.volts();
        let mean_v = volts.iter().sum::<f64>() / volts.len().max(1) as f64;
        self.lock().add(board_time_us, mean_v);
    }

    /// The spectrum of the last seconds (V); `None` while there are too few frames.
    pub fn spectrum(&self) -> Option<Spectrum> {
        // A copy, so that the reader does not wait for the transform.
        let samples = self.lock().samples.clone();
        samples.spectrum()
    }

    /// The frequency that stands out, if one does.
    pub fn peak(&self) -> Option<Peak> {
        self.spectrum()?.peak
    }

    /// The points from number `from` on that are kept (V), and the number after them.
    pub fn points_since(&self, from: u64) -> (Vec<f32>, u64) {
        let state = self.lock();
        let first = state.next - state.points.len() as u64;
        let skipped = from.saturating_sub(first) as usize;
        (state.points.iter().copied().skip(skipped).collect(), state.next)
    }

    fn lock(&self) -> MutexGuard<'_, State> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl State {
    fn add(&mut self, board_time_us: u64, mean_v: f64) {
        self.samples.add(1e-6 * board_time_us as f64, mean_v);
        let place = board_time_us / POINT_US;
        if place != self.place && self.count > 0 {
            let point = (self.sum / f64::from(self.count)) as f32;
            // Where no frame came for some points, the last value stands; a clock that begins again goes on.
            let points = place.saturating_sub(self.place).clamp(1, POINTS as u64);
            self.points.extend(std::iter::repeat_n(point, points as usize));
            self.next += points;
            self.points.drain(..self.points.len().saturating_sub(POINTS));
            (self.sum, self.count) = (0.0, 0);
        }
        self.place = place;
        self.sum += mean_v;
        self.count += 1;
    }
}

impl fmt::Debug for Course {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.debug_struct("Course").field("points", &self.lock().next).finish_non_exhaustive()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn frame(volts: f64) -> Readings {
        Readings::from_fn(4, |g, e| if g == e { 0.0 } else { volts })
    }

    #[test]
    fn points_are_means_and_each_is_given_once() {
        let course = Course::default();
        // Five frames in each point; the mean of 16 readings of which 12 are `volts` is three quarters of that.
        for i in 0..50_u64 {
            course.add(800 * i, &frame((i % 5) as f64));
        }
        let (points, next) = course.points_since(0);
        assert_eq!((points.len(), next), (9, 9));
        assert!(points.iter().all(|point| (point - 1.5).abs() < 1e-6), "{points:?}");
        assert_eq!(course.points_since(7).0.len(), 2);
        assert_eq!(course.points_since(next), (Vec::new(), 9));
    }

    #[test]
    fn memory_is_bounded_over_gaps_and_clocks_that_begin_again() {
        let course = Course::default();
        for time_us in [0, 4000, 3_600_000_000, 3_600_004_000, 10, 5000] {
            course.add(time_us, &frame(1.0));
        }
        let (points, next) = course.points_since(0);
        assert!(points.len() == POINTS && next > POINTS as u64);
        (0..10_000_u64).for_each(|i| course.add(5000 + 832 * i, &frame(1.0)));
        assert_eq!(course.points_since(0).0.len(), POINTS);
    }

    #[test]
    fn what_swings_is_found_in_frames_that_nobody_solves() {
        let course = Course::default();
        for i in 0..4000_u64 {
            let time_s = 832e-6 * i as f64;
            course.add(832 * i, &frame(0.3 + 0.01 * (std::f64::consts::TAU * 15.0 * time_s).sin()));
        }
        let peak = course.peak().unwrap();
        assert!((peak.frequency_hz - 15.0).abs() < 0.01 && (peak.amplitude_v - 0.0075).abs() < 2e-4, "{peak:?}");
    }
}
