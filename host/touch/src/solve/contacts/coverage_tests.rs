//! Whether contacts that are followed by rows are as near to the truth as their standard errors say.
//!
//! Each press has a place, noise, and converters of its own, and is on the finer model or on a detector as built. What it is inverted with
//! knows none of them.

use super::*;
use crate::solve::follow::follow_rows_and_search;
use crate::solve::{Parts, Solver};
use crate::solve::latest::Latest;
use tactomo_physics::detector::{Adc, ConverterErrors, Detector};
use tactomo_physics::forward::{Resolution, Slab, readings_v};
use tactomo_physics::hertz::Hertz;
use tactomo_physics::readings::Range;
use tactomo_physics::scene::{Contact, Fingertip, Hand};
use tactomo_physics::simulate::{Noise, drawn};

/// Frames of two rows a second on the ESP32's line, and the time from one row to the next (s).
const FRAME_S: f64 = 7e-4;
const ROW_S: f64 = 148e-6;
const ROWS: usize = 2;
/// Frames from one plan to the next, about 40 ms.
const PLAN: usize = 57;
/// Frames from a touch to the answer that is judged, about 200 ms.
const FRAMES: usize = 285;
/// From one place to the next at which voltages of a contact that moves are computed (m).
const STEP_M: f64 = 2e-4;

/// What measures.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Board {
    /// The converter of the detector's description.
    Ideal,
    /// The figures of the simulated ESP32, which are in its Hello.
    Esp32,
}

impl Board {
    /// A detector as the board measures it.
    fn measuring(self, mut detector: Detector) -> Detector {
        match self {
            Self::Ideal => detector.adc.noise_lsb = 1.5,
            Self::Esp32 => {
                detector.adc = Adc { bits: 12, full_scale_v: 4.096, noise_lsb: 5.0 };
                let converter = |channels: usize, floor_v: f64| ConverterErrors {
                    channels,
                    gain_share: 0.01,
                    bow_v: 0.012,
                    range_v: [floor_v, 3.1],
                };
                detector.converters = vec![converter(6, 0.142), converter(10, 0.128)];
            }
        }
        detector
    }
}

/// One board, with the errors of its chip.
struct Chip<'a> {
    detector: &'a Detector,
    /// As it was built.
    built: &'a Detector,
    /// Gain and bow of each converter, in standard deviations.
    errors: Vec<[f64; 2]>,
    ranges: Vec<Range>,
    noise: Noise,
}

impl<'a> Chip<'a> {
    fn drawn(detector: &'a Detector, built: &'a Detector, seed: u64) -> Self {
        let mut noise = Noise::new(seed);
        let errors = detector.converters.iter().map(|_| [noise.normal(), noise.normal()]).collect();
        // As near to its ends as its noise a reading says no more than a bound.
        let margin_v = 2.0 * detector.adc.noise_lsb * detector.adc.lsb_v();
        let range = |converter: &ConverterErrors| {
            let [floor_v, ceiling_v] = converter.range_v;
            let range = Range { floor_v: floor_v + margin_v, ceiling_v: ceiling_v - margin_v };
            std::iter::repeat_n(range, converter.channels)
        };
        let ranges = detector.converters.iter().flat_map(range).collect();
        Self { detector, built, errors, ranges, noise }
    }

    /// What it reads (V).
    fn read_v(&mut self, e: usize, volts: f64) -> f64 {
        let adc = &self.detector.adc;
        let pad = &self.built.electrodes[e];
        let volts = pad.gain * volts + pad.offset_v;
        let mut read_v = volts;
        let mut first = 0;
        for (converter, [gain, bow]) in self.detector.converters.iter().zip(&self.errors) {
            if (first..first + converter.channels).contains(&e) {
                let [low_v, high_v] = converter.range_v;
                let share = ((volts - low_v) / (high_v - low_v)).clamp(0.0, 1.0);
                let bow_v = converter.bow_v * bow * 4.0 * share * (1.0 - share);
                read_v = volts * (1.0 + converter.gain_share * gain) + bow_v;
            }
            first += converter.channels;
        }
        let noisy = (read_v / adc.lsb_v() + adc.noise_lsb * self.noise.normal()).round();
        noisy.clamp(0.0, f64::from((1 << adc.bits) - 1)) * adc.lsb_v()
    }

    /// A frame of some rows.
    fn frame(&mut self, grounds: &[usize], row_v: &dyn Fn(usize, usize) -> Vec<f64>) -> Readings {
        let n = self.detector.electrodes.len();
        let mut volts = vec![0.0; n * n];
        for (row, g) in grounds.iter().copied().enumerate() {
            let all = row_v(row, g);
            (0..n).for_each(|e| volts[g * n + e] = self.read_v(e, all[e]));
        }
        let all = Readings::from_fn(n, |g, e| volts[g * n + e]);
        let all = if self.ranges.is_empty() { all } else { all.within(&self.ranges) };
        all.hiding(|g, _| !grounds.contains(&g))
    }
}

/// What is pressed, and what is inverted with.
struct Bench {
    /// As it is known.
    told: Detector,
    problem: Problem,
    built: Vec<Slab>,
}

/// A press that is judged.
#[derive(Clone, Copy, Debug)]
struct Press {
    force_n: f64,
    speed_m_per_s: f64,
    seed: u64,
}

/// How far places were off, in x and y, and what was claimed (m).
#[derive(Debug, Default)]
struct Coverage {
    pairs_m: Vec<[f64; 2]>,
    missed: usize,
}

impl Coverage {
    fn within(&self, sigmas: f64) -> f64 {
        let inside = self.pairs_m.iter().filter(|[off_m, sigma_m]| off_m.abs() < sigmas * sigma_m).count();
        inside as f64 / self.pairs_m.len() as f64
    }

    /// Root mean square of what is claimed over that of what it is.
    fn caution(&self) -> f64 {
        let [off, sigma] = [0, 1].map(|which| self.pairs_m.iter().map(|pair| pair[which].powi(2)).sum::<f64>());
        (sigma / off).sqrt()
    }

    fn root_mm(&self, which: usize) -> f64 {
        1e3 * (self.pairs_m.iter().map(|pair| pair[which].powi(2)).sum::<f64>() / self.pairs_m.len() as f64).sqrt()
    }
}

impl Bench {
    fn new(board: Board, built: impl IntoIterator<Item = u64>) -> Self {
        let told = board.measuring(Detector::preset(Detector::DEFAULT).unwrap());
        let built: Vec<Slab> = built
            .into_iter()
            .map(|seed| Slab::with_resolution(&drawn(&told, seed), Resolution::FINE).unwrap())
            .collect();
        match built.is_empty() {
            true => {
                let told = told.taken_as_exact();
                let exact = Slab::with_resolution(&told, Resolution::FINE).unwrap();
                Self { problem: Problem::of(&told).unwrap(), told, built: vec![exact] }
            }
            false => Self { problem: Problem::of(&told).unwrap(), told, built },
        }
    }

    /// What is found of a press, and where it is.
    fn followed(&self, press: Press, at: &[usize]) -> Vec<(Contact, Option<FoundContact>)> {
        let n = self.told.electrodes.len();
        let mut random = fastrand::Rng::with_seed(press.seed);
        let model = &self.built[press.seed as usize % self.built.len()];
        let [x_m, y_m] = [0, 1].map(|_| 0.044 * (random.f64() - 0.5));
        let hertz = Hertz::of_sample_a(&self.told);
        let tip = Fingertip { hertz, force_n: press.force_n, radius_m: Fingertip::fitting_m(&self.told) };
        let from = Hand::in_newtons(&self.told, tip).tip([x_m, y_m], 1.0, 1.0).disc().unwrap();
        let angle = std::f64::consts::TAU * random.f64();
        // Back and forth over a centimetre, so that it stays on the detector.
        let contact = |way_m: f64| {
            let way_m = 0.005 * (way_m / 0.005).sin();
            Contact { x_m: from.x_m + way_m * angle.cos(), y_m: from.y_m + way_m * angle.sin(), ..from }
        };
        let all_m = press.speed_m_per_s * FRAME_S * (FRAMES + 2) as f64;
        let knots: Vec<Readings> = (0..=(all_m / STEP_M).ceil() as usize + 1)
            .map(|knot| {
                readings_v(&model.impedance_ohm(&[contact(STEP_M * knot as f64)]).unwrap(), model.detector())
            })
            .collect();
        let mut chip = Chip::drawn(&self.told, model.detector(), press.seed);
        let solver = Contacts::new(&self.problem, ContactSettings::of(&self.problem)).unwrap();
        let Parts { mut follower, searcher } = Box::new(solver).split();
        let mut searcher = searcher.unwrap();
        let mut latest = Latest::new(n);
        let (mut focus, mut next) = (follower.telling_grounds(3).unwrap(), 0);
        let mut answers = Vec::new();
        for frame in 0..FRAMES {
            let grounds: Vec<usize> = (0..ROWS)
                .map(|_| {
                    next += 1;
                    if next % 4 == 0 { next / 4 % n } else { focus[(next - next / 4) % focus.len()] }
                })
                .collect();
            let way_m = |row: usize| press.speed_m_per_s * (FRAME_S * frame as f64 + ROW_S * row as f64);
            let row_v = |row: usize, g: usize| {
                let knot = way_m(row) / STEP_M;
                let [one, other] = [0, 1].map(|more| &knots[knot as usize + more]);
                (0..n).map(|e| one.at(g, e) + knot.fract() * (other.at(g, e) - one.at(g, e))).collect()
            };
            let rows = chip.frame(&grounds, &row_v);
            latest.add(&rows, FRAME_S, None);
            let latest_v = latest.readings(f64::MAX, None);
            let solution = follow_rows_and_search(&mut *follower, &mut *searcher, (&rows, &latest_v), FRAME_S).unwrap();
            if frame % PLAN == 0 || frame == 7 {
                focus = follower.telling_grounds(3).unwrap();
                focus.sort_unstable();
            }
            if at.contains(&frame) {
                let truth = contact(0.5 * (way_m(0) + way_m(ROWS - 1)));
                let found = if solution.contacts.len() == 1 { Some(solution.contacts[0]) } else { None };
                answers.push((truth, found));
            }
        }
        answers
    }
}

fn coverage(answers: &[(Contact, Option<FoundContact>)]) -> Coverage {
    let mut coverage = Coverage::default();
    for (truth, found) in answers {
        let Some(found) = found else {
            coverage.missed += 1;
            continue;
        };
        let sigma = found.uncertainty.unwrap();
        coverage.pairs_m.push([found.x_m - truth.x_m, sigma.x_m]);
        coverage.pairs_m.push([found.y_m - truth.y_m, sigma.y_m]);
    }
    coverage
}

#[test]
fn measure() {
    let seed0: u64 = std::env::var("SEED").map_or(0, |s| s.parse().unwrap());
    let count: u64 = std::env::var("COUNT").map_or(50, |s| s.parse().unwrap());
    let at = [14, 71, 142, 284];
    let only = std::env::var("ONLY").unwrap_or_default();
    for board in [Board::Ideal, Board::Esp32] {
        for built in [0, 10] {
            if !format!("{board:?}{built}").contains(&only) {
                continue;
            }
            let bench = Bench::new(board, (0..built).map(|b| b + 3));
            for (force_n, speed) in [(0.05, 0.0), (0.5, 0.0), (3.0, 0.0), (0.5, 0.05), (3.0, 0.2)] {
                if !format!("{board:?}{built} {force_n} {speed}").contains(&std::env::var("PRESS").unwrap_or_default()) {
                    continue;
                }
                let begin = std::time::Instant::now();
                let all: Vec<_> = (0..count)
                    .map(|seed| bench.followed(Press { force_n, speed_m_per_s: speed, seed: seed0 + seed }, &at))
                    .collect();
                print!("{board:?} built {built} {force_n} N {speed} m/s:");
                for k in 0..at.len() {
                    let c = coverage(&all.iter().map(|a| a[k]).collect::<Vec<_>>());
                    print!(
                        "  [{:.0} ms: {:.2} {:.2} off {:.4} sigma {:.4} x{:.2} missed {}]",
                        at[k] as f64 * FRAME_S * 1e3,
                        c.within(1.0),
                        c.within(2.0),
                        c.root_mm(0),
                        c.root_mm(1),
                        c.caution(),
                        c.missed
                    );
                }
                println!(" {:.1} s", begin.elapsed().as_secs_f64());
            }
        }
    }
}
