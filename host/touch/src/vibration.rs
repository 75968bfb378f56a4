//! Vibration: the amplitude spectrum of a value over the last seconds, sampled at every frame.
//!
//! Frames may be missing, so samples are brought to even times by straight lines between them; their trend is taken off, and a Hann window
//! keeps what is slow and large from leaking over all frequencies. Amplitudes are of a sine: a swing of 1 V to either side reads 1 V.

use std::collections::VecDeque;
use std::f64::consts::TAU;

use realfft::RealFftPlanner;
use serde::Serialize;

/// Time that a spectrum is of (s): then lines 0.5 Hz apart are two.
const WINDOW_S: f64 = 4.0;
/// Samples kept at most: those of 2000 frames/s.
const MOST: usize = 8192;
/// A spectrum is of this time and of so many samples at least.
const SHORTEST_S: f64 = 0.5;
const FEWEST: usize = 32;
/// Samples further apart than this do not belong together (s).
const GAP_S: f64 = 0.1;
/// Highest frequency that is given (Hz), if frames come fast enough for it.
const HIGHEST_HZ: f64 = 100.0;
/// A peak is above this frequency (Hz): what a hand does of itself is slower.
const LOWEST_PEAK_HZ: f64 = 5.0;
/// Its amplitude over the largest of all, at least: of a press that lands in 0.3 s, ripples of 1e-4 of it stand out too.
const LEAST: f64 = 2e-3;
/// A peak is so many times the median of what is on both sides of it, this far away (steps of a spectrum: Hann's own width, and further). Noise has
/// amplitudes of Rayleigh's distribution, in which five medians have a probability of `2^-25`.
const STANDS_OUT: f64 = 5.0;
const BESIDE: std::ops::RangeInclusive<usize> = 3..=10;

/// The values of the last seconds.
///
/// ```
/// use tactomo_touch::vibration::Samples;
///
/// let mut samples = Samples::default();
/// for frame in 0..400 {
///     let time_s = f64::from(frame) / 200.0;
///     samples.add(time_s, 0.1 + 0.01 * (std::f64::consts::TAU * 30.0 * time_s).sin());
/// }
/// let peak = samples.spectrum().and_then(|spectrum| spectrum.peak);
/// assert!(peak.is_some_and(|peak| (peak.frequency_hz - 30.0).abs() < 1.0));
/// ```
#[derive(Clone, Debug, Default)]
pub struct Samples(VecDeque<[f64; 2]>);

/// How large a value swings at each frequency.
#[derive(Clone, Debug, PartialEq)]
pub struct Spectrum {
    /// From one frequency to the next (Hz).
    pub step_hz: f64,
    /// Amplitudes, from frequency 0 to half the frame rate, or 100 Hz.
    pub amplitudes: Vec<f64>,
    /// The frequency that stands out, if one does.
    pub peak: Option<Peak>,
}

/// A frequency that stands out.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Peak {
    /// Frequency (Hz).
    pub frequency_hz: f64,
    /// Amplitude of the mean reading (V).
    pub amplitude_v: f64,
}

impl Samples {
    /// Takes a value at a time (s). What was before a gap is forgotten.
    pub fn add(&mut self, time_s: f64, value: f64) {
        let is_next = |[last_s, _]: &[f64; 2]| time_s > *last_s && time_s - last_s < GAP_S;
        if !self.0.back().is_none_or(is_next) {
            self.0.clear();
        }
        self.0.push_back([time_s, value]);
        while self.0.len() > MOST || self.0.front().is_some_and(|[first_s, _]| time_s - first_s > WINDOW_S) {
            self.0.pop_front();
        }
    }

    /// Their spectrum; `None` while there are too few.
    pub fn spectrum(&self) -> Option<Spectrum> {
        let count = self.0.len();
        let span_s = self.0.back()?[0] - self.0.front()?[0];
        if count < FEWEST || span_s < SHORTEST_S {
            return None;
        }
        let step_s = span_s / (count - 1) as f64;
        let mut values = self.even(step_s);
        take_trend_off(&mut values);
        let step_hz = 1.0 / (count as f64 * step_s);
        let given = 1 + ((0.5 / step_s).min(HIGHEST_HZ) / step_hz) as usize;
        let amplitudes: Vec<f64> = amplitudes(&mut values).into_iter().take(given).collect();
        let peak = peak(&amplitudes, step_hz);
        Some(Spectrum { step_hz, amplitudes, peak })
    }

    /// As many values at even times.
    fn even(&self, step_s: f64) -> Vec<f64> {
        let first_s = self.0[0][0];
        let mut after = 1;
        let at = |index: usize| {
            let time_s = first_s + index as f64 * step_s;
            while after + 1 < self.0.len() && self.0[after][0] < time_s {
                after += 1;
            }
            let ([from_s, from], [to_s, to]) = (self.0[after - 1], self.0[after]);
            from + (to - from) * ((time_s - from_s) / (to_s - from_s)).clamp(0.0, 1.0)
        };
        (0..self.0.len()).map(at).collect()
    }
}

/// Takes off the straight line that fits best.
fn take_trend_off(values: &mut [f64]) {
    let count = values.len() as f64;
    let place = |index: usize| index as f64 - (count - 1.0) / 2.0;
    let mean = values.iter().sum::<f64>() / count;
    let by_place: f64 = values.iter().enumerate().map(|(i, value)| place(i) * value).sum();
    let slope = by_place / (0..values.len()).map(|i| place(i).powi(2)).sum::<f64>();
    values.iter_mut().enumerate().for_each(|(i, value)| *value -= mean + slope * place(i));
}

/// Amplitudes under a Hann window.
fn amplitudes(values: &mut [f64]) -> Vec<f64> {
    let count = values.len();
    let window = |i: usize| 0.5 - 0.5 * (TAU * (i as f64 + 0.5) / count as f64).cos();
    values.iter_mut().enumerate().for_each(|(i, value)| *value *= window(i));
    let transform = RealFftPlanner::new().plan_fft_forward(count);
    let mut bins = transform.make_output_vec();
    // Fails for other lengths only.
    if transform.process(values, &mut bins).is_err() {
        return Vec::new();
    }
    // The window's mean is a half, and a sine is shared by two frequencies.
    bins.iter().map(|bin| 4.0 * bin.norm() / count as f64).collect()
}

/// The largest amplitude that stands out, by the parabola through the logarithms of it and its neighbours.
fn peak(amplitudes: &[f64], step_hz: f64) -> Option<Peak> {
    let lowest = ((LOWEST_PEAK_HZ / step_hz) as usize).max(*BESIDE.end());
    let candidates = lowest..amplitudes.len().saturating_sub(1);
    let least = LEAST * amplitudes.iter().copied().fold(0.0, f64::max);
    let stands_out = |i: &usize| {
        let beside = |side: fn(usize, usize) -> Option<usize>| {
            BESIDE.filter_map(move |far| amplitudes.get(side(*i, far)?).copied())
        };
        let mut around: Vec<f64> = beside(usize::checked_sub).chain(beside(usize::checked_add)).collect();
        around.sort_unstable_by(f64::total_cmp);
        let is_top = amplitudes[*i] >= amplitudes[i - 1] && amplitudes[*i] > amplitudes[i + 1];
        is_top
            && amplitudes[*i] > least
            && amplitudes[*i] > STANDS_OUT * around.get(around.len() / 2).copied().unwrap_or(f64::INFINITY)
    };
    let top = candidates.filter(stands_out).max_by(|a, b| amplitudes[*a].total_cmp(&amplitudes[*b]))?;
    let [before, at, after] = [top - 1, top, top + 1].map(|i| amplitudes[i].max(f64::MIN_POSITIVE).ln());
    let off = (0.5 * (before - after) / (before - 2.0 * at + after)).clamp(-0.5, 0.5);
    let height = at - 0.25 * (before - after) * off;
    Some(Peak { frequency_hz: (top as f64 + off) * step_hz, amplitude_v: height.exp() })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Time between two frames of the simulated board (s).
    const FRAME_S: f64 = 832e-6;

    fn samples(seconds: f64, mut value: impl FnMut(f64) -> f64) -> Samples {
        let mut samples = Samples::default();
        (0..(seconds / FRAME_S) as usize).for_each(|i| samples.add(i as f64 * FRAME_S, value(i as f64 * FRAME_S)));
        samples
    }

    fn noise() -> impl FnMut() -> f64 {
        let mut random = fastrand::Rng::with_seed(2);
        move || 2e-4 * (random.f64() - 0.5)
    }

    #[test]
    fn a_sine_is_found_with_its_frequency_and_amplitude_on_a_slow_press() {
        for frequency_hz in [7.3, 12.0, 43.21, 97.0] {
            let mut noise = noise();
            let value =
                |t: f64| 0.3 + 0.1 * (1.1 * t).sin() + 0.02 * t + 5e-4 * (TAU * frequency_hz * t).sin() + noise();
            let spectrum = samples(6.0, value).spectrum().unwrap();
            let peak = spectrum.peak.unwrap();
            assert!((peak.frequency_hz / frequency_hz - 1.0).abs() < 2e-3, "{peak:?} of {frequency_hz} Hz");
            assert!((peak.amplitude_v / 5e-4 - 1.0).abs() < 0.05, "{peak:?}");
            let end_hz = (spectrum.amplitudes.len() - 1) as f64 * spectrum.step_hz;
            assert!((end_hz - HIGHEST_HZ).abs() < spectrum.step_hz + 1e-9, "{end_hz} Hz");
        }
    }

    #[test]
    fn missing_frames_do_not_move_it() {
        let mut samples = Samples::default();
        let mut random = fastrand::Rng::with_seed(3);
        for i in (0..4000).filter(|_| random.f64() > 0.2) {
            let time_s = f64::from(i) * FRAME_S;
            samples.add(time_s, (TAU * 12.0 * time_s).sin());
        }
        let peak = samples.spectrum().unwrap().peak.unwrap();
        assert!((peak.frequency_hz - 12.0).abs() < 0.03 && (peak.amplitude_v - 1.0).abs() < 0.03, "{peak:?}");
    }

    #[test]
    fn noise_and_single_presses_have_no_peak() {
        let mut noise = noise();
        assert_eq!(samples(5.0, |_| noise()).spectrum().unwrap().peak, None);
        let press = |t: f64| if (1.5..2.7).contains(&t) { 0.4 } else { 0.0 } + noise();
        assert_eq!(samples(5.0, press).spectrum().unwrap().peak, None);
        // A hand that is laid down in 0.3 s, and lifted.
        let ramp = |t: f64| t.clamp(0.0, 1.0).powi(2) * (3.0 - 2.0 * t.clamp(0.0, 1.0));
        let hand = |t: f64| 0.5 * ramp((t - 1.4) / 0.3) * (1.0 - ramp((t - 4.2) / 0.3)) + 0.02 * noise();
        assert_eq!(samples(5.0, hand).spectrum().unwrap().peak, None);
        // A finger that taps, five times a second and not evenly.
        let taps = |t: f64| 0.2 * (0.5 + 0.5 * (TAU * (2.5 * t + 0.3 * (3.1 * t).sin())).cos()).powi(4) + noise();
        assert_eq!(samples(5.0, taps).spectrum().unwrap().peak, None);
        assert_eq!(samples(5.0, |_| 0.0).spectrum().unwrap().peak, None);
    }

    #[test]
    fn it_ends_at_half_the_frame_rate() {
        let mut samples = Samples::default();
        (0..200).for_each(|i| samples.add(0.02 * f64::from(i), (0.4 * TAU * f64::from(i)).sin()));
        let spectrum = samples.spectrum().unwrap();
        assert!((spectrum.amplitudes.len() - 1) as f64 * spectrum.step_hz <= 25.0);
        assert!((spectrum.peak.unwrap().frequency_hz - 20.0).abs() < 0.05, "{:?}", spectrum.peak);
    }

    #[test]
    fn memory_is_bounded_and_what_was_before_a_gap_forgotten() {
        let mut samples = samples(20.0, |_| 1.0);
        assert!(samples.0.len() <= MOST && (samples.0.len() as f64 * FRAME_S - WINDOW_S).abs() < 0.01);
        samples.add(100.0, 1.0);
        assert_eq!(samples.0.len(), 1);
        assert_eq!(samples.spectrum(), None);
        samples.add(50.0, 1.0);
        assert_eq!(samples.0.len(), 1, "a clock that began again");
        (0..20_000).for_each(|i| samples.add(50.0 + 1e-5 * f64::from(i + 1), 1.0));
        assert_eq!(samples.0.len(), MOST);
    }
}
