//! From a board's frame to volts, and from volts to touch.

use std::time::Duration;

use tactomo_protocol::Frame;

use tactomo_physics::detector::Detector;
use tactomo_physics::readings::Readings;
use tactomo_touch::solve::{Solution, SolveError, Solver};

use tactomo_board::baseline::Baseline;

/// Readings at rest above this share of the drive are told: something may press.
const PRESSED_SHARE: f64 = 0.05;

/// Makes readings and touch of frames.
pub struct Interpreter {
    /// Volts of one ADC code.
    volts_per_code: f64,
    drive_v: f64,
    rest: Baseline,
    solver: Option<Box<dyn Solver>>,
    readings: Readings,
    touch: Readings,
}

impl Interpreter {
    /// For frames of `detector`, as [measured](tactomo_board::measured::as_measured); without a solver nothing is found.
    pub fn new(detector: &Detector, solver: Option<Box<dyn Solver>>) -> Self {
        let electrodes = detector.electrodes.len();
        let nothing = Readings::from_fn(electrodes, |_, _| 0.0);
        Self {
            volts_per_code: detector.adc.full_scale_v / f64::from(1u32 << detector.adc.bits.min(31)),
            drive_v: detector.drive_v,
            rest: Baseline::new(electrodes * electrodes),
            solver,
            readings: nothing.clone(),
            touch: nothing,
        }
    }

    /// What `frame` says of the touch; `None` if it has not the readings of the detector.
    ///
    /// # Errors
    /// [`SolveError`] if the solver cannot answer.
    pub fn interpret(&mut self, frame: &Frame) -> Result<Option<Solution>, SolveError> {
        if frame.readings.len() != self.readings.volts().len() {
            return Ok(None);
        }
        let volts_per_unit = self.volts_per_code / f64::from(1u32 << frame.head.fraction_bits.min(31));
        let units = frame.readings.iter().map(|units| f64::from(*units));
        self.readings.volts_mut().iter_mut().zip(units).for_each(|(volts, units)| *volts = units * volts_per_unit);
        if self.rest.add(self.readings.volts()) {
            self.check_rest();
        }
        self.rest.subtract(self.readings.volts(), self.touch.volts_mut());
        let Some(solver) = &mut self.solver else { return Ok(Some(Solution::default())) };
        solver.solve(&self.touch).map(Some)
    }

    fn check_rest(&self) {
        let largest_v = self.rest.largest_v();
        if largest_v > PRESSED_SHARE * self.drive_v {
            tracing::warn!(
                "the readings at rest reach {:.0} mV: if something presses, let go and re-zero",
                largest_v * 1e3
            );
        }
    }

    /// Readings of the last frame (V), as measured.
    pub fn readings(&self) -> &Readings {
        &self.readings
    }

    /// Goes on with another solver; the readings at rest stay.
    pub fn change_solver(&mut self, solver: Box<dyn Solver>) {
        self.solver = Some(solver);
    }

    /// Asks the solver for answers [within a period](Solver::keep_within).
    pub fn keep_within(&mut self, period: Option<Duration>) {
        if let Some(solver) = &mut self.solver {
            solver.keep_within(period);
        }
    }

    /// Takes the readings at rest anew from the frames to come.
    pub fn rezero(&mut self) {
        self.rest.renew();
    }

    /// Whether the readings at rest are being taken.
    pub fn is_rezeroing(&self) -> bool {
        self.rest.is_renewing()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tactomo_board::measured::as_measured;
    use tactomo_protocol::{FrameHead, Hello, Settings};

    /// Finds a contact with the largest reading as its conductance.
    struct Largest;

    impl Solver for Largest {
        fn name(&self) -> &'static str {
            "largest"
        }

        fn solve(&mut self, readings: &Readings) -> Result<Solution, SolveError> {
            let image = vec![readings.largest_v() as f32];
            Ok(Solution { image_s_per_m2: Some(image), ..Solution::default() })
        }
    }

    fn hello(electrodes: u8) -> Hello {
        Hello {
            firmware_version: "0.1.0".try_into().unwrap_or_default(),
            board: "test".try_into().unwrap_or_default(),
            electrodes,
            adc_bits: 10,
            adc_full_scale_mv: 1024,
            drive_mv: 1500,
            settings: Settings::default(),
        }
    }

    fn frame(code: u16, fraction_bits: u8) -> Frame {
        let head = FrameHead { fraction_bits, ..FrameHead::default() };
        Frame { head, readings: std::iter::repeat_n(code, 256).collect() }
    }

    #[test]
    fn codes_become_volts_and_the_rest_is_subtracted() {
        let detector = as_measured(&Detector::preset(Detector::DEFAULT).unwrap(), &hello(16)).unwrap();
        let mut interpreter = Interpreter::new(&detector, Some(Box::new(Largest)));
        while interpreter.is_rezeroing() {
            interpreter.interpret(&frame(20, 0)).unwrap();
        }
        let solution = interpreter.interpret(&frame(0x110, 2)).unwrap().unwrap();
        assert!((interpreter.readings().at(3, 5) - 0.068).abs() < 1e-12, "272 quarters of a millivolt");
        assert_eq!(solution.image_s_per_m2, Some(vec![0.048]));
        interpreter.rezero();
        assert!(interpreter.is_rezeroing());
    }

    #[test]
    fn a_frame_of_another_board_is_left_out() {
        let detector = Detector::preset("display-140x70").unwrap();
        let mut interpreter = Interpreter::new(&detector, None);
        assert_eq!(interpreter.interpret(&frame(1, 0)), Ok(None));
    }
}
