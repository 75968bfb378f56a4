//! From a board's frame to volts, and from volts to touch.

use std::time::Duration;

use tactomo_protocol::{Frame, Hello};

use crate::detector::Detector;
use crate::readings::Readings;
use crate::solve::{Solution, SolveError, Solver};

use super::rest::Rest;

/// Readings at rest above this share of the drive are told: something may press.
const PRESSED_SHARE: f64 = 0.05;

/// A board that does not fit the detector.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "the board scans {board} electrodes, but the detector {detector} has {expected}: choose the detector that is connected \
     with `--detector`"
)]
pub struct Mismatch {
    /// Electrodes that the board scans.
    board: usize,
    /// Name of the detector.
    detector: String,
    /// Its electrodes.
    expected: usize,
}

/// `detector` as `board` measures it: drive voltage and ADC are the board's, who knows them.
///
/// # Errors
/// [`Mismatch`] if the board scans another number of electrodes.
pub fn as_measured(detector: &Detector, board: &Hello) -> Result<Detector, Mismatch> {
    let (found, expected) = (usize::from(board.electrodes), detector.electrodes.len());
    if found != expected {
        return Err(Mismatch { board: found, detector: detector.name.clone(), expected });
    }
    let mut measured = detector.clone();
    measured.drive_v = f64::from(board.drive_mv) * 1e-3;
    measured.adc.bits = board.adc_bits;
    measured.adc.full_scale_v = f64::from(board.adc_full_scale_mv) * 1e-3;
    Ok(measured)
}

/// Makes readings and touch of frames.
pub struct Interpreter {
    /// Volts of one ADC code.
    volts_per_code: f64,
    drive_v: f64,
    rest: Rest,
    solver: Option<Box<dyn Solver>>,
    readings: Readings,
    touch: Readings,
}

impl Interpreter {
    /// For frames of `detector`, as [measured](as_measured); without a solver nothing is found.
    pub fn new(detector: &Detector, solver: Option<Box<dyn Solver>>) -> Self {
        let electrodes = detector.electrodes.len();
        let nothing = Readings::from_fn(electrodes, |_, _| 0.0);
        Self {
            volts_per_code: detector.adc.full_scale_v / f64::from(1u32 << detector.adc.bits.min(31)),
            drive_v: detector.drive_v,
            rest: Rest::new(electrodes * electrodes),
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
    use tactomo_protocol::{FrameHead, Settings};

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
    fn the_board_knows_its_drive_and_its_converter() {
        let preset = Detector::preset(Detector::DEFAULT).unwrap();
        let measured = as_measured(&preset, &hello(16)).unwrap();
        assert_eq!((measured.drive_v, measured.adc.bits, measured.adc.full_scale_v), (1.5, 10, 1.024));
        let mismatch = as_measured(&preset, &hello(32)).unwrap_err().to_string();
        assert!(mismatch.contains("32") && mismatch.contains("square-60 has 16"), "{mismatch}");
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
