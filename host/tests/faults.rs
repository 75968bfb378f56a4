//! Faults of wires on every simulated board: what is left answers as the healthy board does, and exchanged wires are told.
//!
//! Frames are those of the firmware on the simulated pins; the watch and the solvers are those of live and `reconstruct`.
#![allow(clippy::unwrap_used, reason = "a test that unwraps fails where it should, and says where")]

use std::sync::LazyLock;
use std::time::{Duration, Instant};

use nalgebra::DMatrix;
use tactomo::board::link::Link;
use tactomo::board::measured::{Volts, as_measured};
use tactomo::board::session::{RequestedSettings, Session, send};
use tactomo::board::simulated::{BoardModel, Options, SimulatedBoard};
use tactomo::detector::Detector;
use tactomo::forward::{ForwardModel, touched_impedance_ohm};
use tactomo::readings::Readings;
use tactomo::scene::{Contact, Hand, Scene, SceneName};
use tactomo::simulate::{Fault, Measurement, Physics, finer_model};
use tactomo::solve::{
    ElectrodeFault, ElectrodeWatch, FaultTolerant, FaultyElectrodes, FoundContact, FoundShape, Look, Method, Problem,
    Solver, faulty_electrodes, without,
};
use tactomo_physics::threads;
use tactomo_protocol::{BoardMessage, BoardReceiver};

/// Frames of each board: an electrode is left out after 8 that show it, and the rest is averaged.
const FRAMES: usize = 24;
/// Frames that are solved, of these.
const SOLVED: usize = 6;
const PATIENCE: Duration = Duration::from_secs(60);
/// Length of a press, where there are several (s).
const PRESS_S: f64 = 0.5;
/// Frames from one that is answered to the next: on a slow machine `live` answers no more of them.
const ANSWER_EVERY: usize = 4;
/// Exchanged wires are named at most this long after the first frame that is pressed (s).
const NAMED_WITHIN_S: f64 = 2.0;

/// A steady press, behind wires that may be faulty.
struct Pressed {
    impedance_ohm: DMatrix<f64>,
    wires: Measurement,
}

impl Physics for Pressed {
    fn readings_v(&mut self, _time_s: f64) -> Readings {
        self.wires.pad_voltages(Some(&self.impedance_ohm))
    }
}

/// Presses one after another, behind wires that may be faulty.
struct Pressing {
    impedances_ohm: Vec<DMatrix<f64>>,
    wires: Measurement,
}

impl Physics for Pressing {
    fn readings_v(&mut self, time_s: f64) -> Readings {
        let press = (time_s / PRESS_S) as usize % self.impedances_ohm.len();
        self.wires.pad_voltages(Some(&self.impedances_ohm[press]))
    }
}

/// A detector with its models: one that is pressed, and one that is inverted.
struct Bench {
    fine: Box<dyn ForwardModel>,
    problem: Problem,
}

/// The default detector, for all tests.
static BENCH: LazyLock<Bench> = LazyLock::new(|| Bench::of(&Detector::default()));

impl Bench {
    fn of(detector: &Detector) -> Self {
        Self { fine: finer_model(detector, &[], 1).unwrap(), problem: Problem::of(detector).unwrap() }
    }

    /// Impedances under what touches at the start of a scene.
    fn touched_ohm(&self, scene: SceneName, seed: u64) -> DMatrix<f64> {
        let detector = self.fine.detector();
        let touches = Scene::new(scene, detector, Hand::relative(detector), seed).at(0.0);
        touched_impedance_ohm(&*self.fine, &touches).unwrap()
    }

    /// Wires with such a fault.
    fn wires(&self, fault: Option<&str>) -> Measurement {
        let faults: Vec<Fault> = fault.map(|fault| fault.parse().unwrap()).into_iter().collect();
        Measurement::new(self.problem.detector(), &faults, 1).unwrap()
    }

    /// Frames of a board with such a fault, and the problem as that board measures it.
    fn frames(&self, model: BoardModel, impedance_ohm: &DMatrix<f64>, fault: Option<&str>) -> (Problem, Vec<Readings>) {
        let pressed = Pressed { impedance_ohm: impedance_ohm.clone(), wires: self.wires(fault) };
        let (problem, frames) = self.recorded(model, Box::new(pressed), |frames| frames.len() == FRAMES);
        (problem, frames.into_iter().map(|(_, readings)| readings).collect())
    }

    /// Frames of a board until there are enough, each with the board's time since the first (s), and the problem as that board measures it.
    fn recorded(
        &self,
        model: BoardModel,
        physics: Box<dyn Physics>,
        is_enough: impl Fn(&[(f64, Readings)]) -> bool,
    ) -> (Problem, Vec<(f64, Readings)>) {
        let detector = self.problem.detector();
        let mut board = SimulatedBoard::start(detector, physics, Options { seed: 1, model }).unwrap();
        let (mut session, mut receiver) = (Session::new(RequestedSettings::default()), BoardReceiver::default());
        let (mut problem, mut frames, mut volts) = (self.problem.clone(), Vec::new(), None);
        let (begun, mut first_us) = (Instant::now(), None);
        loop {
            assert!(begun.elapsed() < PATIENCE, "{model:?}: no frames");
            if let Some(command) = session.command(Instant::now()) {
                send(&mut board, &command).unwrap();
            }
            let mut buffer = [0; 4096];
            let count = board.read(&mut buffer).unwrap();
            let mut input = &buffer[..count];
            while let Some(message) = receiver.receive(&mut input) {
                match message {
                    Ok(BoardMessage::Hello(hello)) => {
                        session.hello(&hello, Instant::now());
                        problem = self.problem.measured_as(&as_measured(detector, &hello).unwrap());
                        volts = Some(Volts::of(&hello));
                    }
                    Ok(BoardMessage::Frame(frame)) => {
                        session.frame(Instant::now());
                        let Some(readings) = volts.as_ref().and_then(|volts: &Volts| volts.readings(&frame)) else {
                            continue;
                        };
                        let since = *first_us.get_or_insert(frame.head.time_us);
                        frames.push((1e-6 * f64::from(frame.head.time_us.wrapping_sub(since)), readings));
                        if is_enough(&frames) {
                            return (problem, frames);
                        }
                    }
                    _ => {}
                }
            }
        }
    }
}

/// The contacts of the last frames of some, without the electrodes that the first ones show to be faulty, and what is wrong with these.
fn answered(problem: &Problem, frames: &[Readings]) -> (Vec<FoundContact>, Vec<(usize, ElectrodeFault)>) {
    let mut watch = ElectrodeWatch::new(problem.detector());
    // The press is steady, and so is what a solver that takes all wires to be sound makes of it.
    let taken_as_sound = without(Method::Auto, problem, watch.faulty()).unwrap().solve(&frames[0]).unwrap();
    for frame in frames {
        watch.note(frame);
        watch.answered(&taken_as_sound);
    }
    let mut solver = without(Method::Auto, problem, watch.faulty()).unwrap();
    let mut contacts = Vec::new();
    for frame in &frames[frames.len() - SOLVED..] {
        let solution = solver.solve(frame).unwrap();
        assert!(solution.certainty.is_none() || !solution.flags.is_doubtful(), "{solution:?}");
        contacts = solution.contacts;
    }
    (contacts, watch.faulty().faults.clone())
}

fn faults_of(fault: &str, kind: ElectrodeFault) -> Vec<(usize, ElectrodeFault)> {
    let (_, electrodes) = fault.split_once(':').unwrap();
    let mut all: Vec<usize> = electrodes.split(',').map(|e| e.parse().unwrap()).collect();
    all.sort_unstable();
    all.into_iter().map(|e| (e, kind)).collect()
}

/// Standard deviations between two places.
fn apart(one: &FoundContact, other: &FoundContact) -> f64 {
    let errors = [one, other].map(|contact| contact.uncertainty.unwrap());
    let off = |a: f64, b: f64, errors: [f64; 2]| (a - b) / errors[0].hypot(errors[1]);
    let x = off(one.x_m, other.x_m, errors.map(|error| error.x_m));
    let y = off(one.y_m, other.y_m, errors.map(|error| error.y_m));
    x.hypot(y)
}

/// `open:E` and `short:E,F` for each electrode `E` end with the answer of the healthy board.
fn left_out_everywhere(model: BoardModel) {
    let impedance_ohm = BENCH.touched_ohm(SceneName::Single, 1);
    // Of all faults: what a board says of itself does not depend on them.
    let (problem, healthy) = BENCH.frames(model, &impedance_ohm, None);
    let (expected, none) = answered(&problem, &healthy);
    assert_eq!((expected.len(), none), (1, vec![]), "{model:?}");
    let cases: Vec<_> = (0..16)
        .flat_map(|e| {
            let other = (e + 1) % 16;
            [(format!("open:{e}"), ElectrodeFault::Open), (format!("short:{e},{other}"), ElectrodeFault::Shorted)]
        })
        .collect();
    let wrong = |(fault, kind): &(String, ElectrodeFault)| {
        let (_, frames) = BENCH.frames(model, &impedance_ohm, Some(fault));
        let (found, faults) = answered(&problem, &frames);
        let is_as_healthy = found.len() == 1 && apart(&found[0], &expected[0]) < 3.0;
        let is_right = is_as_healthy && faults == faults_of(fault, *kind);
        (!is_right).then(|| (fault.clone(), faults, found))
    };
    let wrong: Vec<_> = threads::map(&cases, wrong).into_iter().flatten().collect();
    assert!(wrong.is_empty(), "{model:?}: healthy {expected:?}, but {wrong:#?}");
}

#[test]
fn open_and_shorted_electrodes_change_no_answer_of_the_ideal_board() {
    left_out_everywhere(BoardModel::Ideal);
}

#[test]
fn open_and_shorted_electrodes_change_no_answer_of_the_esp32() {
    left_out_everywhere(BoardModel::Esp32);
}

#[test]
fn open_and_shorted_electrodes_change_no_answer_of_the_esp32c3() {
    left_out_everywhere(BoardModel::Esp32c3);
}

/// Two pads across the strip read the same under a press at its far end, and the ESP32's converters do not tell that they are not grounded together.
#[test]
fn across_a_narrow_strip_no_wires_touch() {
    let bench = Bench::of(&Detector::preset("strip-13x60").unwrap());
    let detector = bench.problem.detector();
    let press =
        |y_mm: f64, sheets: f64| Contact::flat(0.0, 1e-3 * y_mm, 0.002, sheets * detector.sheet_conductance_s());
    let places = [-24.0, -12.0, 12.0, 24.0];
    let presses: Vec<_> = places.iter().flat_map(|y_mm| [0.03, 0.1, 0.3].map(|sheets| press(*y_mm, sheets))).collect();
    let suspected = threads::map(&presses, |press| {
        let impedance_ohm = bench.fine.impedance_ohm(&[*press]).unwrap();
        let (problem, frames) = bench.frames(BoardModel::Esp32, &impedance_ohm, None);
        let mut solver = FaultTolerant::new(Method::Auto, &problem).unwrap();
        frames.iter().for_each(|readings| drop(solver.solve(readings).unwrap()));
        assert!(solver.excluded().is_empty(), "{press:?}: {:?}", solver.excluded());
        let alone = faulty_electrodes(&frames[FRAMES - 1], problem.detector()).unwrap_or_default();
        alone.iter().any(|(_, fault)| *fault == ElectrodeFault::Shorted)
    });
    assert!(suspected.contains(&true), "the readings alone say nothing of touching wires, so this tests nothing");
}

/// Pairs of neighbours, of electrodes far apart, and across the ESP32's converters.
const EXCHANGED: [[usize; 2]; 7] = [[5, 6], [0, 1], [1, 9], [3, 12], [10, 14], [4, 11], [7, 8]];

#[test]
fn exchanged_wires_are_told_by_most_presses_on_every_board() {
    let faulty = FaultyElectrodes::default();
    let cases: Vec<_> = EXCHANGED.into_iter().enumerate().collect();
    threads::map(&cases, |&(index, [a, b])| {
        let model = BoardModel::ALL[index % BoardModel::ALL.len()];
        let told: Vec<_> = (1..=3)
            .map(|seed| {
                let impedance_ohm = BENCH.touched_ohm(SceneName::Single, seed);
                let (problem, frames) = BENCH.frames(model, &impedance_ohm, Some(&format!("swap:{a},{b}")));
                Look::Exchanged.run(&problem, &faulty, &frames[FRAMES - 1])
            })
            .collect();
        let right = told.iter().filter(|pair| **pair == Some([a, b])).count();
        assert!(right >= 2 && told.iter().flatten().all(|pair| *pair == [a, b]), "{model:?} {a},{b}: {told:?}");
    });
}

/// Counted in the board's time and in answers, one to [`ANSWER_EVERY`] frames: it is when the solver looks that is tested, not this machine.
/// It looks after as many answers whatever is exchanged: each board is tried with one pair.
#[test]
fn exchanged_wires_are_named_within_two_seconds_of_presses() {
    let impedances_ohm: Vec<_> = (1..=4).map(|seed| BENCH.touched_ohm(SceneName::Single, seed)).collect();
    let cases: Vec<_> = BoardModel::ALL.into_iter().zip(EXCHANGED).collect();
    threads::map(&cases, |&(model, [a, b])| {
        let wires = BENCH.wires(Some(&format!("swap:{a},{b}")));
        let pressing = Pressing { impedances_ohm: impedances_ohm.clone(), wires };
        let is_enough = |frames: &[(f64, Readings)]| frames.last().is_some_and(|(time_s, _)| *time_s > NAMED_WITHIN_S);
        let (problem, frames) = BENCH.recorded(model, Box::new(pressing), is_enough);
        let mut solver = FaultTolerant::new(Method::Auto, &problem).unwrap();
        let named = frames.iter().step_by(ANSWER_EVERY).enumerate().find_map(|(answer, (time_s, readings))| {
            solver.solve(readings).unwrap();
            (!solver.excluded().is_empty()).then_some((answer, *time_s))
        });
        let expected = [a, b].map(|e| (e, ElectrodeFault::Exchanged));
        assert_eq!(solver.excluded(), expected, "{model:?} {a},{b}: named {named:?} in {} frames", frames.len());
    });
}

#[test]
fn a_wide_press_is_a_contact_and_a_ring_a_ring() {
    threads::map(&[1, 2, 3], |&seed| {
        for (scene, is_ring) in [(SceneName::Wide, false), (SceneName::Ring, true)] {
            let (problem, frames) = BENCH.frames(BoardModel::Esp32, &BENCH.touched_ohm(scene, seed), None);
            let mut solver = Method::Auto.build(&problem).unwrap();
            let shapes = frames.iter().map(|frame| solver.solve(frame).unwrap().shape);
            let shapes: Vec<_> = shapes.collect();
            for shape in &shapes {
                if let Some(FoundShape::Ring(ring)) = shape {
                    assert!(ring.radius_m > 1.5 * ring.width_m, "{scene}, seed {seed}: {ring:?}");
                }
            }
            let rings = shapes.iter().filter(|shape| matches!(shape, Some(FoundShape::Ring(_)))).count();
            let right = if is_ring { rings } else { FRAMES - rings };
            assert!(10 * right >= 9 * FRAMES, "{scene}, seed {seed}: {shapes:?}");
        }
    });
}
