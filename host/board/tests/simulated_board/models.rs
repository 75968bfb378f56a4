//! What models of boards read, how fast, and what their converters see.

use tactomo_board::inputs::BoardInputs;
use tactomo_board::link::{Control, Link};
use tactomo_board::measured::{Volts, as_measured};
use tactomo_board::session::RequestedSettings;
use tactomo_board::simulated::{BoardModel, Options, SimulatedBoard, SimulatedBoardError};
use tactomo_physics::detector::Detector;
use tactomo_physics::readings::Readings;
use tactomo_physics::scene::{Contact, Hand, Scene, SceneName};
use tactomo_physics::simulate::{Physics, Simulation};
use tactomo_protocol::{Frame, Status};

use crate::host::{Host, detector};

/// The same voltage everywhere (V), which rises with time (V/s).
#[derive(Clone, Copy)]
struct Rising(f64, f64);

impl Physics for Rising {
    fn readings_v(&mut self, time_s: f64) -> Readings {
        Readings::from_fn(16, |_, _| self.0 + self.1 * time_s)
    }
}

fn model(model: BoardModel, seed: u64, physics: impl Physics + 'static) -> Host {
    let board = SimulatedBoard::start(&detector(), Box::new(physics), Options { seed, model });
    Host::new(board.unwrap(), RequestedSettings::default())
}

/// Frames of a board at a constant voltage (V).
fn frames_at(board: BoardModel, volts: f64, seed: u64) -> Vec<Frame> {
    let mut host = model(board, seed, Rising(volts, 0.0));
    host.frames_more(10);
    host.frames
}

#[test]
fn boards_scan_as_fast_as_their_budgets_say() {
    // Settle, conversions and the firmware's work of sixteen rows (`docs/firmware.md`).
    let budgets_us = [(BoardModel::Ideal, 832.0), (BoardModel::Esp32, 2334.0), (BoardModel::Esp32c3, 15_015.0)];
    for (board, budget_us) in budgets_us {
        let mut host = model(board, 1, Rising(0.5, 0.0));
        host.frames_more(40);
        let mut scans_us: Vec<f64> = host.frames.windows(2).map(|pair| scan_us(&pair[0], &pair[1])).collect();
        scans_us.sort_by(f64::total_cmp);
        let median_us = scans_us[scans_us.len() / 2];
        assert!((median_us / budget_us - 1.0).abs() < 0.01, "{board:?}: {median_us} us a scan");
    }
}

#[test]
fn boards_tell_their_names_and_what_their_converters_can_see() {
    let hello = |board| {
        let mut host = model(board, 1, Rising(0.0, 0.0));
        host.exchange_until("hello", |host| host.hello.is_some());
        let hello = host.hello.unwrap();
        let ranges: Vec<_> = hello.ranges.iter().map(|range| (range.electrodes, range.floor, range.ceiling)).collect();
        (hello.board.to_string(), hello.adc_full_scale_mv, ranges)
    };
    assert_eq!(hello(BoardModel::Ideal), ("simulated".to_owned(), 3300, vec![(16, 0, 4095)]));
    let esp32 = vec![(6, 142, 3100), (10, 128, 3100)];
    assert_eq!(hello(BoardModel::Esp32), ("esp32 (simulated)".to_owned(), 4096, esp32));
    assert_eq!(hello(BoardModel::Esp32c3), ("esp32c3 (simulated)".to_owned(), 4096, vec![(16, 0, 2500)]));
}

/// What the firmware reads, with noise and the chip's own errors averaged out, against what foams of little conductivity let through; and what the
/// settings that are advised make of it.
#[test]
fn a_foam_of_little_conductivity_lags_until_the_settings_suit_it() {
    /// Electrodes by turns at 0.5 and 1.5 V.
    #[derive(Clone, Copy)]
    struct Turns;
    impl Physics for Turns {
        fn readings_v(&mut self, _time_s: f64) -> Readings {
            Readings::from_fn(16, |g, e| if (g + e) % 2 == 0 { 0.5 } else { 1.5 })
        }
    }
    // Largest lag of the mean reading of an electrode, of a step of 1 V from one to the next (mV).
    let lag_mv = |board, foam: &str, settings| {
        let foam = detector().in_material(&foam.parse().unwrap()).unwrap();
        let options = Options { seed: 3, model: board };
        let board = SimulatedBoard::start(&foam, Box::new(Turns), options).unwrap();
        let mut host = Host::new(board, settings);
        host.exchange_until("its settings", |host| host.session.refusal().is_none() && host.frames.len() > 5);
        host.frames.clear();
        host.frames_more(40);
        let mean = |cell: usize| {
            let codes = host
                .frames
                .iter()
                .map(|frame| f64::from(frame.readings[cell]) / f64::from(1 << frame.head.fraction_bits));
            codes.sum::<f64>() / host.frames.len() as f64
        };
        // High and low of one electrode differ by a volt where nothing lags; a chip's gain and bow are a per cent of that.
        (0..15).map(|g| (1000.0 - (mean(16 * g + 5) - mean(16 * (g + 1) + 5)).abs()).abs()).fold(0.0, f64::max)
    };
    let need = |board: &str, foam: &str| {
        let pad_ohm = detector().in_material(&foam.parse().unwrap()).unwrap().largest_pad_ohm();
        BoardInputs::of(board).unwrap().need(pad_ohm).unwrap()
    };
    for (name, board, foam, lags_mv) in [
        ("esp32", BoardModel::Esp32, "C", 60.0),
        ("esp32c3", BoardModel::Esp32c3, "C", 300.0),
        ("esp32c3", BoardModel::Esp32c3, "D", 25.0),
    ] {
        let asked = |select_us, settle_us, discarded| RequestedSettings {
            select_us: Some(select_us),
            settle_us: Some(settle_us),
            discarded: Some(discarded),
            ..RequestedSettings::default()
        };
        let as_it_was = if name == "esp32c3" { asked(2, 20, 0) } else { RequestedSettings::default() };
        let before_mv = lag_mv(board, foam, as_it_was);
        let need = need(name, foam);
        let after_mv = lag_mv(board, foam, asked(need.select_us, need.settle_us, need.discarded));
        assert!(before_mv > lags_mv && after_mv < 30.0, "{name}, {foam}: {before_mv} mV, then {after_mv} mV");
        assert!(lag_mv(board, "A", RequestedSettings::default()) < 30.0, "{name}");
    }
}

/// Board time of a scan, of the frames that went lost between too.
fn scan_us(one: &Frame, next: &Frame) -> f64 {
    let scans = next.head.sequence.wrapping_sub(one.head.sequence);
    f64::from(next.head.time_us - one.head.time_us) / f64::from(scans)
}

#[test]
fn the_line_of_the_esp32_carries_every_scan() {
    // Above 2.05 V a frame is twelve bits a reading: 398 to 400 bytes as it is, of which the line carries 230 a second.
    let mut host = model(BoardModel::Esp32, 1, Rising(2.5, 0.0));
    host.frames_more(300);
    let [first, last] = [&host.frames[100], &host.frames[299]].map(|frame| frame.head);
    let frames_per_s = 199.0 / (f64::from(last.time_us - first.time_us) * 1e-6);
    assert!(frames_per_s > 415.0, "{frames_per_s}");
    assert_eq!(last.sequence - first.sequence, 199, "none is dropped");
}

#[test]
fn floors_and_ceilings_show_in_the_readings() {
    let ends = |board, volts| {
        let frame = frames_at(board, volts, 3).remove(5);
        let row = frame.readings[32..48].to_vec();
        assert!(frame.readings.chunks(16).all(|other| other == row), "noise does not reach in");
        (row[0], row[5], row[6], row[15])
    };
    assert_eq!(ends(BoardModel::Esp32, 0.05), (142, 142, 128, 128));
    assert_eq!(ends(BoardModel::Esp32, 3.3), (3100, 3100, 3100, 3100));
    assert_eq!(ends(BoardModel::Esp32c3, -0.1), (0, 0, 0, 0));
    assert_eq!(ends(BoardModel::Esp32c3, 2.7), (2500, 2500, 2500, 2500));
    let head = |volts| frames_at(BoardModel::Esp32, volts, 3)[5].head;
    assert_eq!([head(3.3), head(2.0)].map(|head| head.status), [Status::SATURATED, Status::default()]);
}

#[test]
fn above_a_lifted_ground_nothing_is_at_the_floor() {
    let lifted = Detector { drive_v: 1.75, ground_v: 0.25, ..detector() };
    for board in [BoardModel::Ideal, BoardModel::Esp32] {
        let scene = Scene::new(SceneName::Rest, &lifted, Hand::relative(&lifted), 1);
        let simulation = Simulation::new(&lifted, scene, &[], 1).unwrap();
        let options = Options { seed: 4, model: board };
        let board = SimulatedBoard::simulate(&lifted, simulation, options).unwrap();
        let mut host = Host::new(board, RequestedSettings::default());
        host.frames_more(20);
        let hello = host.hello.clone().unwrap();
        assert_eq!(hello.drive_mv, 2000);
        let measured = as_measured(&lifted, &hello).unwrap();
        assert_eq!((measured.drive_v, measured.ground_v), (1.75, 0.25));
        let volts = Volts::of(&hello).above(measured.ground_v);
        for frame in &host.frames {
            let readings = volts.readings(frame).unwrap();
            assert!(readings.all_say().is_empty());
            // Noise of 5 mV, a gain of 1 % and the bow of a chip.
            assert!(readings.volts().iter().all(|volts| volts.abs() < 0.04), "{readings:?}");
        }
        // On the ground of the converter all the same would be below the floor.
        let contact = Contact::flat(0.01, 0.005, 0.003, 2e-5);
        host.board.control(&Control::Press(vec![contact])).unwrap();
        let largest_v = |host: &Host| volts.readings(host.frames.last().unwrap()).unwrap().largest_v();
        host.exchange_until("a light press", |host| largest_v(host) > 0.03);
        assert!(largest_v(&host) < 0.1, "{}", largest_v(&host));
    }
}

#[test]
fn a_seed_repeats_a_board_and_another_is_another_chip() {
    for board in [BoardModel::Esp32, BoardModel::Esp32c3] {
        let codes = |seed| frames_at(board, 1.0, seed)[0].readings.to_vec();
        assert_eq!(codes(5), codes(5));
        // A chip's gain is in the mean of a frame.
        let mean = |codes: Vec<u16>| codes.into_iter().map(f64::from).sum::<f64>() / 256.0;
        let means: Vec<f64> = (1..8).map(|seed| mean(codes(seed))).collect();
        let spread = means.iter().copied().fold(f64::MIN, f64::max) - means.iter().copied().fold(f64::MAX, f64::min);
        assert!(spread > 4.0 && means.iter().all(|mean| (mean - 1000.0).abs() < 60.0), "{means:?}");
    }
}

#[test]
fn the_scene_moves_on_while_a_real_board_scans() {
    // 10 V/s over fifteen rows of 944 us, and the ideal board's noise.
    let risen = |board| {
        let mut host = model(board, 2, Rising(0.5, 10.0));
        host.frames_more(6);
        let row = |frame: &Frame, ground: usize| {
            frame.readings[16 * ground..][..16].iter().map(|code| f64::from(*code)).sum::<f64>() / 16.0
        };
        // Where the machine is too slow the board's clock jumps, and never back; near the ceiling nothing rises.
        let in_range = host.frames.iter().filter(|frame| row(frame, 15) < 2300.0);
        in_range.map(|frame| row(frame, 15) - row(frame, 0)).fold(f64::INFINITY, f64::min)
    };
    assert!((risen(BoardModel::Esp32c3) - 141.5).abs() < 8.0, "{} mV", risen(BoardModel::Esp32c3));
    assert!(risen(BoardModel::Ideal).abs() < 3.0, "{} codes", risen(BoardModel::Ideal));
}

#[test]
fn a_board_takes_no_more_electrodes_than_it_has_inputs_for() {
    let wide = Detector::preset("display-140x70").unwrap();
    let start = |model| SimulatedBoard::start(&wide, Box::new(Rising(0.0, 0.0)), Options { seed: 1, model }).err();
    let error = start(BoardModel::Esp32).unwrap();
    assert!(matches!(error, SimulatedBoardError::Electrodes { electrodes: 32, most: 16, .. }), "{error}");
    assert!(start(BoardModel::Ideal).is_none());
}
