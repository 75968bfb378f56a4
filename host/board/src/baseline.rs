//! The readings with nothing on the detector, which are subtracted from all others.
//!
//! Without contact an ideal detector reads 0 V everywhere; a real one has the offset of its converter, a few codes, or some leakage. So a
//! baseline is small, and never a press: frames that are larger are not taken for one.

use tactomo_physics::detector::{Adc, Detector};

/// Frames that are averaged: the noise of their mean is a sixth of a frame's.
pub const FRAMES: u32 = 32;

/// Codes of a converter that may be its offset: data sheets of simple converters give 2 to 4.
const OFFSET_CODES: f64 = 4.0;
/// Share of the drive that leakage may be, unless a person says that nothing presses. A contact of 0.003 sheet conductances reads as much, a
/// tenth of the lightest that solvers find well.
const LEAKAGE: f64 = 0.005;
/// Share of the drive above which something presses, whatever a person says.
const PRESSED: f64 = 0.05;

/// Deviations of its noise that the largest of a frame's readings may be beyond the limit: that of 256 is 2.8 in the mean, and beyond 6 once in
/// two million frames.
const DEVIATIONS: f64 = 6.0;

/// Mean readings of a detector that nothing touches.
#[derive(Clone, Debug)]
pub struct Baseline {
    mean_v: Vec<f64>,
    sum_v: Vec<f64>,
    /// Frames that are averaged, and those still to come.
    frames: u32,
    missing: u32,
    /// Largest mean that is taken for a baseline (V): by itself, and when it is asked for.
    largest_v: [f64; 2],
    /// Standard deviation of a frame's reading (V).
    noise_v: f64,
    state: BaselineState,
    /// Whether it was ever taken.
    held: bool,
}

/// How the baseline stands.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum BaselineState {
    /// It is being taken for the first time; until then it is zero.
    #[default]
    Starting,
    /// It is taken.
    Held,
    /// Something has pressed since the start, with readings up to this (V): it stays zero until nothing does.
    Pressed(f64),
    /// It is being taken anew; until then the one before holds.
    Renewing,
    /// It was to be taken anew while something pressed, with readings up to this (V): the one before stays.
    Refused(f64),
}

impl Baseline {
    /// Zero, until the first frames that nothing presses in have given the true one.
    pub fn new(detector: &Detector) -> Self {
        let count = detector.electrodes.len().pow(2);
        let Adc { full_scale_v, bits, .. } = detector.adc;
        let code_v = full_scale_v / f64::from(1u32 << bits.min(31));
        let by_itself_v = (OFFSET_CODES * code_v).max(LEAKAGE * detector.drive_v);
        let largest_v = [by_itself_v, by_itself_v.max(PRESSED * detector.drive_v)];
        Self { largest_v, noise_v: detector.adc.deviation_v(), ..Self::over(FRAMES, count) }
    }

    /// The mean of so many frames of `count` readings, whatever they are; of none it stays zero.
    pub fn over(frames: u32, count: usize) -> Self {
        let state = if frames == 0 { BaselineState::Held } else { BaselineState::Starting };
        let zeros = vec![0.0; count];
        Self {
            mean_v: zeros.clone(),
            sum_v: zeros,
            frames,
            missing: frames,
            largest_v: [f64::INFINITY; 2],
            noise_v: 0.0,
            state,
            held: frames == 0,
        }
    }

    /// Takes the mean anew from the frames to come; until then the old one holds.
    pub fn renew(&mut self) {
        self.begin();
        self.state = BaselineState::Renewing;
    }

    /// How it stands.
    pub fn state(&self) -> BaselineState {
        self.state
    }

    /// Takes the mean `readings_v` of `frames` frames into account, if the baseline is being taken; whether its state has changed.
    /// Readings of the electrodes `left_out` say nothing.
    pub fn add(&mut self, readings_v: &[f64], frames: u32, left_out: &[usize]) -> bool {
        if self.missing == 0 || frames == 0 || readings_v.len() != self.sum_v.len() {
            return false;
        }
        let before = self.state;
        let most_v = self.largest_v[usize::from(self.state == BaselineState::Renewing)];
        let largest_v = largest_v(readings_v, left_out);
        // A press that begins in the last of the frames hardly shows in their mean.
        if largest_v > most_v + DEVIATIONS * self.noise_v / f64::from(frames).sqrt() {
            self.refuse(largest_v);
            return self.state != before;
        }
        let frames = frames.min(self.missing);
        self.sum_v.iter_mut().zip(readings_v).for_each(|(sum, volts)| *sum += f64::from(frames) * volts);
        self.missing -= frames;
        if self.missing > 0 {
            return false;
        }
        let mean_v: Vec<f64> = self.sum_v.iter().map(|sum| sum / f64::from(self.frames)).collect();
        let mean_largest_v = self::largest_v(&mean_v, left_out);
        if mean_largest_v > most_v {
            self.refuse(mean_largest_v);
        } else {
            (self.mean_v, self.state, self.held) = (mean_v, BaselineState::Held, true);
        }
        self.state != before
    }

    /// Something presses, with readings up to this (V).
    fn refuse(&mut self, largest_v: f64) {
        self.state = match self.state {
            BaselineState::Renewing => BaselineState::Refused(largest_v),
            BaselineState::Starting => BaselineState::Pressed(largest_v),
            before => before,
        };
        self.missing = 0;
        if !self.held {
            // The press may end: the next frames are looked at too.
            self.begin();
        }
    }

    fn begin(&mut self) {
        self.sum_v.fill(0.0);
        self.missing = self.frames;
    }

    /// Puts `readings_v` less the baseline into `touch_v`.
    pub fn subtract(&self, readings_v: &[f64], touch_v: &mut [f64]) {
        let pairs = readings_v.iter().zip(&self.mean_v);
        touch_v.iter_mut().zip(pairs).for_each(|(touch, (volts, rest))| *touch = volts - rest);
    }
}

/// Largest of readings (V), row by row, but for those of electrodes that are left out.
fn largest_v(readings_v: &[f64], left_out: &[usize]) -> f64 {
    let electrodes = readings_v.len().isqrt().max(1);
    let counts = |index: usize| !left_out.contains(&(index / electrodes)) && !left_out.contains(&(index % electrodes));
    readings_v.iter().enumerate().filter(|(index, _)| counts(*index)).map(|(_, volts)| volts.abs()).fold(0.0, f64::max)
}

impl BaselineState {
    /// Whether the baseline is being taken.
    pub fn is_taking(&self) -> bool {
        matches!(self, Self::Starting | Self::Renewing)
    }

    /// What a person should know of it, in a sentence.
    pub fn notice(&self) -> Option<String> {
        let mv = |volts: &f64| (1e3 * volts).round();
        match self {
            Self::Starting | Self::Held | Self::Renewing => None,
            Self::Pressed(largest_v) => Some(format!(
                "Something pressed at the start (readings up to {} mV): it is shown as touch, and the baseline is 0 mV until nothing presses.",
                mv(largest_v)
            )),
            Self::Refused(largest_v) => Some(format!(
                "Not re-zeroed: something presses (readings up to {} mV). Let go, then re-zero.",
                mv(largest_v)
            )),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn baseline() -> Baseline {
        Baseline::new(&Detector::preset(Detector::DEFAULT).unwrap())
    }

    fn even(volts: f64) -> Vec<f64> {
        vec![volts; 256]
    }

    fn touch_v(baseline: &Baseline, volts: f64) -> f64 {
        let mut touch_v = even(0.0);
        baseline.subtract(&even(volts), &mut touch_v);
        touch_v[77]
    }

    fn add(baseline: &mut Baseline, volts: f64, frames: u32) {
        for _ in 0..frames {
            baseline.add(&even(volts), 1, &[]);
        }
    }

    #[test]
    fn the_mean_of_the_first_frames_is_subtracted() {
        let mut baseline = baseline();
        add(&mut baseline, 0.002, FRAMES / 2);
        assert_eq!((baseline.state(), touch_v(&baseline, 1.0)), (BaselineState::Starting, 1.0));
        assert!(baseline.add(&even(0.004), FRAMES / 2, &[]), "means of several frames count as many");
        assert_eq!(baseline.state(), BaselineState::Held);
        assert!((touch_v(&baseline, 1.0) - 0.997).abs() < 1e-12);
        assert!(!baseline.add(&even(0.005), 99, &[]), "it stays");
    }

    #[test]
    fn a_press_is_never_the_baseline() {
        let mut baseline = baseline();
        add(&mut baseline, 1.5, 3 * FRAMES);
        assert_eq!((baseline.state(), touch_v(&baseline, 1.5)), (BaselineState::Pressed(1.5), 1.5));
        assert!(baseline.state().notice().is_some_and(|notice| notice.contains("1500 mV")));
        // It is taken as soon as nothing presses.
        add(&mut baseline, 0.003, 2 * FRAMES);
        assert!(baseline.state() == BaselineState::Held && touch_v(&baseline, 0.003).abs() < 1e-12);
    }

    #[test]
    fn a_press_that_begins_while_the_baseline_is_taken_is_none_of_it() {
        let mut baseline = baseline();
        add(&mut baseline, 0.001, FRAMES - 1);
        add(&mut baseline, 0.3, 1);
        assert_eq!((baseline.state(), touch_v(&baseline, 0.3)), (BaselineState::Pressed(0.3), 0.3));
    }

    #[test]
    fn a_broken_wire_is_no_press() {
        let mut baseline = baseline();
        let floating: Vec<f64> = (0..256).map(|i| if i / 16 == 3 || i % 16 == 3 { 0.6 } else { 0.002 }).collect();
        for _ in 0..FRAMES {
            baseline.add(&floating, 1, &[3]);
        }
        assert_eq!(baseline.state(), BaselineState::Held);
    }

    #[test]
    fn a_person_may_take_leakage_for_the_baseline_but_no_press() {
        let mut baseline = baseline();
        add(&mut baseline, 0.001, FRAMES);
        baseline.renew();
        add(&mut baseline, 0.6, FRAMES);
        let refused = matches!(baseline.state(), BaselineState::Refused(volts) if (volts - 0.6).abs() < 1e-9);
        assert!(refused && (touch_v(&baseline, 0.6) - 0.599).abs() < 1e-12);
        baseline.renew();
        assert!(baseline.state().is_taking());
        add(&mut baseline, 0.05, FRAMES);
        assert!(baseline.state() == BaselineState::Held && touch_v(&baseline, 0.05).abs() < 1e-12);
    }

    #[test]
    fn frames_that_a_person_says_are_the_baseline_are() {
        let mut baseline = Baseline::over(2, 256);
        add(&mut baseline, 1.0, 2);
        assert_eq!((baseline.state(), touch_v(&baseline, 1.0)), (BaselineState::Held, 0.0));
        assert_eq!(touch_v(&Baseline::over(0, 256), 1.0), 1.0);
    }
}
