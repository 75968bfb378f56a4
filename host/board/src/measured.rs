//! A detector as a board measures it, and the volts of the board's codes.

use std::iter;

use tactomo_physics::detector::{ConverterErrors, Detector};
#[cfg(doc)]
use tactomo_physics::readings::Says;
use tactomo_physics::readings::{Range, Readings};
use tactomo_protocol::{Frame, Hello};

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

/// `detector` as `board` measures it: drive voltage and ADC are the board's, who knows them; whether its ground is lifted the detector tells.
///
/// # Errors
/// [`Mismatch`] if the board scans another number of electrodes.
pub fn as_measured(detector: &Detector, board: &Hello) -> Result<Detector, Mismatch> {
    let (found, expected) = (usize::from(board.electrodes), detector.electrodes.len());
    if found != expected {
        return Err(Mismatch { board: found, detector: detector.name.clone(), expected });
    }
    let mut measured = detector.clone();
    measured.drive_v = volts(board.drive_mv) - detector.ground_v;
    measured.adc.bits = board.adc_bits;
    measured.adc.full_scale_v = volts(board.adc_full_scale_mv);
    let noise_uv = board.ranges.iter().map(|range| range.errors.noise_uv).max().unwrap_or_default();
    if noise_uv > 0 {
        measured.adc.noise_lsb = 1e-6 * f64::from(noise_uv) / measured.adc.lsb_v();
    }
    measured.converters = converters(board, detector.ground_v);
    let runs = board.ranges.iter().enumerate().flat_map(|(index, run)| iter::repeat_n(index, run.electrodes.into()));
    // A channel in no run is on a converter of which nothing is known.
    let converter_of = runs.chain(iter::repeat(board.ranges.len()));
    measured.electrodes.iter_mut().zip(converter_of).for_each(|(pad, converter)| pad.converter = converter);
    Ok(measured)
}

/// What a board tells of its converters' errors; nothing if it knows of none.
fn converters(board: &Hello, ground_v: f64) -> Vec<ConverterErrors> {
    let per_code = volts(board.adc_full_scale_mv) / f64::from(1u32 << board.adc_bits.min(31));
    let of = |range: &tactomo_protocol::Range| ConverterErrors {
        gain_share: 1e-6 * f64::from(range.errors.gain_ppm),
        bow_v: 1e-6 * f64::from(range.errors.bow_uv),
        range_v: [range.floor, range.ceiling].map(|code| f64::from(code) * per_code - ground_v),
    };
    let all: Vec<_> = board.ranges.iter().map(of).collect();
    let is_known = all.iter().any(|converter| converter.gain_share > 0.0 || converter.bow_v > 0.0);
    if is_known { all } else { Vec::new() }
}

/// Volts of whole millivolts: as near as a number gets, so that a board which measures as the description says has its very voltages.
fn volts(millivolts: u16) -> f64 {
    f64::from(millivolts) / 1000.0
}

/// Readings this near to an end of a converter's range count as at it, in standard deviations of its noise: a voltage a little below a floor
/// reads as much above it as noise is. Of a converter whose noise is not known, in codes.
const MARGIN: f64 = 2.0;
const MARGIN_CODES: f64 = 3.0;

/// Makes volts of a board's codes.
#[derive(Clone, Debug, PartialEq)]
pub struct Volts {
    /// Volts of one code.
    per_code: f64,
    electrodes: u8,
    /// What is known of each electrode's range; empty where nothing hides below a floor or above a ceiling.
    ranges: Vec<Range>,
    /// Voltage of a grounded electrode's switch (V), above which readings are given.
    ground_v: f64,
}

impl Volts {
    /// For frames of a board.
    pub fn of(board: &Hello) -> Self {
        let per_code = volts(board.adc_full_scale_mv) / f64::from(1u32 << board.adc_bits.min(31));
        let last = (1u32 << board.adc_bits.min(16)) - 1;
        // Where every code counts, noise cut off at zero is the baseline's business, and the last code that of solvers.
        let range = |range: tactomo_protocol::Range| {
            let margin_v = match range.errors.noise_uv {
                0 => MARGIN_CODES * per_code,
                noise_uv => MARGIN * 1e-6 * f64::from(noise_uv),
            };
            Range {
                floor_v: match range.floor {
                    0 => f64::NEG_INFINITY,
                    floor => f64::from(floor) * per_code + margin_v,
                },
                ceiling_v: match u32::from(range.ceiling) {
                    ceiling if ceiling >= last => f64::INFINITY,
                    ceiling => f64::from(ceiling) * per_code - margin_v,
                },
            }
        };
        let mut ranges: Vec<Range> = (0..board.electrodes).map_while(|e| board.range_of(e)).map(range).collect();
        if ranges.iter().all(|range| range.floor_v.is_infinite() && range.ceiling_v.is_infinite()) {
            ranges.clear();
        }
        Self { per_code, electrodes: board.electrodes, ranges, ground_v: 0.0 }
    }

    /// How codes become volts above a ground that is lifted by `ground_v` (V).
    pub fn above(mut self, ground_v: f64) -> Self {
        let more_v = ground_v - self.ground_v;
        for range in &mut self.ranges {
            (range.floor_v, range.ceiling_v) = (range.floor_v - more_v, range.ceiling_v - more_v);
        }
        Self { ground_v, ..self }
    }

    /// Readings of a frame as they are used (V): see [`measured`](Self::measured) and [`used`](Self::used). `None` if it is a frame of another
    /// board.
    pub fn readings(&self, frame: &Frame) -> Option<Readings> {
        self.measured(frame).map(|measured| self.used(measured))
    }

    /// Readings as measured (V) as they are used: one that is within two deviations of the noise of an end of its converter's range is the bound
    /// there, for it says no more than that.
    pub fn used(&self, measured: Readings) -> Readings {
        if self.ranges.is_empty() { measured } else { measured.within(&self.ranges) }
    }

    /// Readings of a frame as measured (V): each as its converter gave it. Those that the frame does not hold say [nothing](Says::Nothing); of a
    /// cell that it holds several times the mean. `None` if it is a frame of another board.
    pub fn measured(&self, frame: &Frame) -> Option<Readings> {
        let n = usize::from(self.electrodes);
        if frame.scope.electrodes() != self.electrodes || frame.readings.len() != frame.scope.readings() {
            return None;
        }
        let per_unit = self.per_code / f64::from(1u32 << frame.head.fraction_bits.min(31));
        let volt = |units: &u16| f64::from(*units) * per_unit - self.ground_v;
        if frame.scope.is_whole() {
            return Readings::new(n, frame.readings.iter().map(volt).collect());
        }
        let (mut sums_v, mut counts) = (vec![0.0; n * n], vec![0u32; n * n]);
        for ((g, e), units) in frame.scope.cells().zip(&frame.readings) {
            let cell = usize::from(g) * n + usize::from(e);
            sums_v[cell] += volt(units);
            counts[cell] += 1;
        }
        let means_v = sums_v.iter().zip(&counts).map(|(sum, count)| sum / f64::from((*count).max(1)));
        let readings = Readings::new(n, means_v.collect())?;
        Some(readings.hiding(|g, e| counts[g * n + e] == 0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tactomo_physics::detector::Electrode;
    use tactomo_physics::readings::Says;
    use tactomo_protocol::{FrameHead, Scope};

    fn hello(electrodes: u8) -> Hello {
        Hello { adc_bits: 10, adc_full_scale_mv: 1024, drive_mv: 1500, ..Hello::example(electrodes) }
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
    fn a_board_as_described_changes_nothing() {
        let preset = Detector::preset(Detector::DEFAULT).unwrap();
        let board = Hello { adc_bits: 12, adc_full_scale_mv: 3300, drive_mv: 2000, ..hello(16) };
        assert_eq!(as_measured(&preset, &board), Ok(preset));
    }

    #[test]
    fn channels_know_their_converters_and_take_them_along() {
        let errors = tactomo_protocol::ConverterErrors { gain_ppm: 10_000, ..Default::default() };
        let range = |electrodes, floor| tactomo_protocol::Range { electrodes, floor, ceiling: 900, errors };
        let board = Hello { ranges: [range(6, 142), range(9, 128)].into_iter().collect(), ..hello(16) };
        let measured = as_measured(&Detector::default(), &board).unwrap();
        let floors_mv = |detector: &Detector| {
            let floor = |pad: &Electrode| Some((1e3 * detector.converters.get(pad.converter)?.range_v[0]).round());
            detector.electrodes.iter().map(floor).collect::<Vec<_>>()
        };
        let of_all = floors_mv(&measured);
        assert_eq!(
            [of_all[0], of_all[5], of_all[6], of_all[14], of_all[15]],
            [Some(142.0), Some(142.0), Some(128.0), Some(128.0), None]
        );
        for left_out in 0..16 {
            let kept: Vec<usize> = (0..16).filter(|e| *e != left_out).collect();
            let expected: Vec<_> = kept.iter().map(|e| of_all[*e]).collect();
            assert_eq!(floors_mv(&measured.keeping(&kept)), expected, "without {left_out}");
        }
    }

    #[test]
    fn codes_become_volts_and_frames_of_other_boards_nothing() {
        let head = FrameHead { fraction_bits: 2, ..FrameHead::default() };
        let scope = Scope::whole(16).unwrap();
        let frame = Frame { head, scope, readings: std::iter::repeat_n(0x110, 256).collect() };
        let readings = Volts::of(&hello(16)).readings(&frame).unwrap();
        assert!((readings.at(0, 0) - 0.068).abs() < 1e-12, "272 quarters of a millivolt");
        assert!(readings.all_say().is_empty());
        let lifted = Volts::of(&hello(16)).above(0.05).readings(&frame).unwrap();
        assert!((lifted.at(3, 4) - 0.018).abs() < 1e-12);
        assert_eq!(Volts::of(&hello(32)).readings(&frame), None);
    }

    #[test]
    fn rows_say_nothing_of_what_they_do_not_hold() {
        let head = FrameHead::default();
        let scope = Scope::of_rows(16, &[3, 9, 3], 0b110).unwrap();
        let frame = Frame { head, scope, readings: [10, 20, 30, 40, 12, 22].into_iter().collect() };
        let readings = Volts::of(&hello(16)).readings(&frame).unwrap();
        let known: Vec<_> = (0..256).filter(|i| readings.says(i / 16, i % 16) == Says::Voltage).collect();
        assert_eq!(known, [3 * 16 + 1, 3 * 16 + 2, 9 * 16 + 1, 9 * 16 + 2]);
        let volts = known.iter().map(|i| 1e3 * readings.volts()[*i]).collect::<Vec<_>>();
        assert!(volts.iter().zip([11.0, 21.0, 30.0, 40.0]).all(|(a, b)| (a - b).abs() < 1e-9), "{volts:?}");
    }

    #[test]
    fn what_a_converter_cannot_see_is_a_bound() {
        let errors = tactomo_protocol::ConverterErrors { noise_uv: 3000, ..Default::default() };
        let range = |electrodes, floor| tactomo_protocol::Range { electrodes, floor, ceiling: 900, errors };
        let board = Hello { ranges: [range(6, 142), range(10, 128)].into_iter().collect(), ..hello(16) };
        let scope = Scope::whole(16).unwrap();
        let frame = |code: u16| Frame {
            head: FrameHead::default(),
            scope: scope.clone(),
            readings: std::iter::repeat_n(code, 256).collect(),
        };
        let says = |code: u16| {
            let readings = Volts::of(&board).readings(&frame(code)).unwrap();
            [5, 6].map(|e| (readings.says(2, e), (1e3 * readings.at(2, e)).round()))
        };
        use Says::{AtLeast, AtMost, Voltage};
        assert_eq!(says(128), [(AtMost, 148.0), (AtMost, 134.0)]);
        assert_eq!(says(140), [(AtMost, 148.0), (Voltage, 140.0)]);
        assert_eq!(says(500), [(Voltage, 500.0), (Voltage, 500.0)]);
        assert_eq!(says(899), [(AtLeast, 894.0), (AtLeast, 894.0)]);
        let measured = Volts::of(&board).measured(&frame(128)).unwrap();
        assert!(measured.all_say().is_empty() && measured.volts().iter().all(|volts| (volts - 0.128).abs() < 1e-12));
        let lifted = Volts::of(&board).above(0.25).readings(&frame(250)).unwrap();
        assert!(lifted.all_say().is_empty() && lifted.at(1, 1).abs() < 1e-12, "rest is clear of the floor");
    }
}
