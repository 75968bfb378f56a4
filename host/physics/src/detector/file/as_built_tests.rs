//! What a file says of how a detector may differ from it, or does: there and back, and what is wrong in it.

use proptest::prelude::*;

use super::*;
use crate::detector::{CalibratedParameter, Calibration, Parameter};
use crate::simulate::drawn;

const SQUARE: &str = "\
uneven_log_amplitudes = [[0.0, 0.03], [-0.05]]

[outline]
size_m = [0.06, 0.06]

[[layers]]
thickness_m = 0.005
conductivity_s_per_m = 0.2273

[electrodes]
grid = [2, 2]
diameter_m = 0.004
gains = [1.0, 0.997, 1.004, 1.0]

[tolerances]
thickness_share = 0.02
electrodes_m = 1e-4

[calibration]
board = \"esp32 \\\"A\\\"\"
date = \"2025-03-01\"
frames = 1200
presses = 40
place_error_m = 1.6e-4
parameters = [\"thickness\", \"x:3\", \"uneven:1,0\", \"gain:2\"]
standard_errors = [0.01, 1e-4, 0.02, 1e-3]
left_at_prior = [\"gain:2\"]
directions = [[0.01, 1e-5, 0.0, 0.0], [0.0, 0.0, 0.02, -1e-3]]
";

fn square() -> Detector {
    Detector::from_toml(SQUARE, "square").unwrap()
}

/// The message about a text in which something is replaced.
fn error(replaced: &str, by: &str) -> String {
    assert!(SQUARE.contains(replaced), "{replaced}");
    Detector::from_toml(&SQUARE.replace(replaced, by), "square").unwrap_err().to_string()
}

#[test]
fn unevenness_gains_tolerances_and_calibration_are_read() {
    let detector = square();
    let modes: Vec<_> = detector.unevenness.modes().collect();
    assert_eq!(modes, [([0, 1], 0.03), ([1, 0], -0.05)]);
    assert_eq!(detector.electrodes.iter().map(|pad| pad.gain).collect::<Vec<_>>(), [1.0, 0.997, 1.004, 1.0]);
    let given = Tolerances { thickness_share: 0.02, electrodes_m: 1e-4, ..Tolerances::default() };
    assert_eq!(detector.tolerances, given, "what is not given is the default");
    let calibration = detector.calibration.unwrap();
    assert_eq!((calibration.board.as_deref(), calibration.date.as_str()), (Some("esp32 \"A\""), "2025-03-01"));
    assert_eq!((calibration.frames, calibration.presses, calibration.place_error_m), (1200, 40, Some(1.6e-4)));
    let known = |parameter, standard_error, is_prior| CalibratedParameter { parameter, standard_error, is_prior };
    assert_eq!(
        calibration.parameters,
        [
            known(Parameter::Thickness, 0.01, false),
            known(Parameter::ElectrodeX(3), 1e-4, false),
            known(Parameter::Uneven([1, 0]), 0.02, false),
            known(Parameter::Gain(2), 1e-3, true),
        ]
    );
    assert_eq!(calibration.directions[1], [0.0, 0.0, 0.02, -1e-3]);
}

#[test]
fn the_documented_tables_are_read() {
    let documentation = include_str!("../../../../../docs/detector.md");
    let fragments = documentation.split("```toml fragment\n").skip(1).filter_map(|rest| rest.split("```").next());
    let sixteen = Detector::default().to_toml().replace("name = \"square-60\"\n", "");
    let with = |fragment: &str| {
        let (top, table) = if fragment.starts_with('[') { ("", fragment) } else { (fragment, "") };
        Detector::from_toml(&[top, &sixteen, "\n", table].concat(), "documented").unwrap()
    };
    let all: Vec<Detector> = fragments.map(with).collect();
    assert!(all.iter().any(|detector| !detector.unevenness.is_even()));
    assert!(all.iter().any(|detector| detector.tolerances != Tolerances::default()));
    assert!(all.iter().any(|detector| detector.calibration.is_some()));
    let defaults = Tolerances::default();
    for (name, value) in defaults.named() {
        let row = documentation.lines().find(|line| line.starts_with(&format!("| `{name}` |"))).unwrap();
        let documented: f64 = row.split('|').nth(3).unwrap().trim().parse().unwrap();
        assert_eq!(documented, value, "{row}");
    }
}

#[test]
fn all_of_it_is_written_as_it_is_read() {
    let detector = square();
    assert_eq!(Detector::from_toml(&detector.to_toml(), "else").unwrap(), detector);
    let plain = Detector::default().to_toml();
    let names = ["tolerances", "calibration", "gains", "offsets_v", "uneven_log_amplitudes"];
    assert!(names.iter().all(|name| !plain.contains(name)), "defaults are not written: {plain}");
}

#[test]
fn a_wrong_value_is_named_with_its_line_and_what_is_allowed() {
    assert_eq!(
        error("thickness_share = 0.02", "thickness_share = -0.02"),
        "line 16: tolerances.thickness_share is -0.02, but has to be from 0.0 to 1.0"
    );
    assert_eq!(
        error("electrodes_m = 1e-4", "contact_impedance_factor = 0.3"),
        "line 17: tolerances.contact_impedance_factor is 0.3, but has to be from 1.0 to 1000.0"
    );
    let unknown = error("thickness_share", "thickness_m");
    assert!(unknown.contains("line 16") && unknown.contains("unknown field `thickness_m`"), "{unknown}");
    assert!(unknown.contains("`uneven_share`"), "{unknown}");
    assert!(error("0.997", "nan").starts_with("line 13: electrodes.gains[1] is NaN, but has to be from 0.5 to 2.0"));
    assert!(error("1.004, 1.0]", "1.004]").starts_with("line 13: electrodes.gains has 3 numbers"));
    assert!(error("0.03", "3.0").starts_with("line 1: uneven_log_amplitudes is 3.0, but has to be from -1.0 to 1.0"));
    let ten = format!("uneven_log_amplitudes = [{:?}]", [0.01; 10]);
    let many = error("uneven_log_amplitudes = [[0.0, 0.03], [-0.05]]", &ten);
    assert!(many.starts_with("line 1: uneven_log_amplitudes has 10 amplitudes along a side, but may have 9"), "{many}");
}

#[test]
fn a_wrong_calibration_is_named_with_its_line_and_what_is_allowed() {
    let parameters = error("\"x:3\"", "\"x:4\"");
    assert_eq!(
        parameters,
        "line 25: calibration.parameters names `x:4`, but the detector has 4 electrodes, counted from 0"
    );
    assert!(error("\"x:3\"", "\"z:3\"").starts_with("line 25: calibration.parameters `z:3` is no parameter of"));
    let waves = error("uneven:1,0", "uneven:999999999999,0");
    assert!(waves.contains("line 25") && waves.contains("up to 8 half waves"), "{waves}");
    assert!(error("[0.01, 1e-4, 0.02, 1e-3]", "[0.01]").contains("line 26: calibration.standard_errors has 1 numbers"));
    assert!(error("[0.01, 1e-4,", "[-0.01, 1e-4,").contains("line 26: calibration.standard_errors holds -0.01"));
    assert!(error("[0.01, 1e-5, 0.0, 0.0]", "[0.01, inf, 0.0, 0.0]").contains("line 28: calibration.directions holds"));
    assert!(error("[\"gain:2\"]", "[\"gain:1\"]").contains("line 27: calibration.left_at_prior names \"gain:1\""));
    assert!(error("frames = 1200", "frames = -1").contains("line 22"));
    assert!(error("date = \"2025-03-01\"\n", "").contains("missing field `date`"));
    let of_places = error("place_error_m = 1.6e-4", "place_error_m = -1.0");
    assert_eq!(of_places, "line 24: calibration.place_error_m has to be a length above 0");
}

#[test]
fn what_is_drawn_goes_through_toml_unchanged() {
    for seed in 0..20 {
        let built = drawn(&Detector::default(), seed);
        let again = Detector::from_toml(&built.to_toml(), "else").unwrap();
        assert_eq!(again, built, "seed {seed}");
        assert!(again.electrodes.iter().any(|pad| pad.offset_v != 0.0));
    }
}

fn calibrations() -> impl Strategy<Value = Calibration> {
    let parameter = prop_oneof![
        Just(Parameter::Thickness),
        Just(Parameter::Pads),
        [0..9usize, 0..9usize].prop_map(Parameter::Uneven),
        (0..16usize).prop_map(Parameter::ElectrodeX),
        (0..16usize).prop_map(Parameter::Gain),
    ];
    // As many digits as are written.
    let number = || (-999..999i32, -9..2i32).prop_map(|(digits, power)| format!("{digits}e{power}").parse().unwrap());
    let known = (parameter, number().prop_map(f64::abs), any::<bool>());
    let known = known.prop_map(|(parameter, standard_error, is_prior)| CalibratedParameter {
        parameter,
        standard_error,
        is_prior,
    });
    let parameters = prop::collection::vec(known, 1..8).prop_map(|mut known| {
        // A parameter is there once.
        let mut seen = Vec::new();
        known.retain(|known| {
            !seen.contains(&known.parameter) && {
                seen.push(known.parameter);
                true
            }
        });
        known
    });
    let directions = parameters.prop_flat_map(move |known| {
        let direction = prop::collection::vec(number(), known.len());
        (Just(known), prop::collection::vec(direction, 0..4))
    });
    (directions, prop::option::of("\\PC{0,20}"), "\\PC{0,12}", 0..100_000usize).prop_map(
        |((parameters, directions), board, date, frames)| Calibration {
            sensor: board.clone().filter(|_| frames % 3 == 0),
            description: board.clone().filter(|_| frames % 5 == 0),
            board,
            date,
            frames,
            presses: frames / 7,
            place_error_m: (frames % 2 == 0).then_some(1e-6 * (frames + 1) as f64),
            parameters,
            directions,
        },
    )
}

proptest! {
    #[test]
    fn any_calibration_goes_through_toml_unchanged(calibration in calibrations()) {
        let detector = Detector { calibration: Some(calibration), ..Detector::default() };
        prop_assert_eq!(Detector::from_toml(&detector.to_toml(), "").unwrap(), detector);
    }

    /// Whatever numbers a file has, it is a detector or a message; and what a detector may be asked for is no panic.
    #[test]
    fn absurd_numbers_never_panic(which in 0..40usize, number in absurd(), seed in any::<u64>()) {
        let damaged = with_number(SQUARE, which, &number);
        if let Ok(detector) = Detector::from_toml(&damaged, "absurd") {
            // What a calibration says is written with few digits.
            let again = Detector::from_toml(&detector.to_toml(), "").unwrap();
            prop_assert_eq!(again.to_toml(), detector.to_toml());
            let _ = (detector.summary(), detector.facts(), detector.to_svg(), detector.unknowns());
            let built = drawn(&detector, seed);
            let _ = (built.check(), built.to_toml(), built.unknowns());
            if let Some(unknown) = detector.unknowns().directions.first() {
                let _ = detector.stepped(unknown).check();
            }
        }
    }
}

fn absurd() -> impl Strategy<Value = String> {
    const FIXED: &[&str] = &[
        "0",
        "0.0",
        "-0.0",
        "1",
        "-1",
        "nan",
        "inf",
        "-inf",
        "1e308",
        "-1e308",
        "5e-324",
        "1e-300",
        "1e9",
        "1e-9",
        "1e3",
        "0.5",
        "9223372036854775807",
        "-9223372036854775808",
        "4294967296",
        "255",
        "256",
    ];
    prop_oneof![prop::sample::select(FIXED).prop_map(str::to_owned), any::<f64>().prop_map(|x| format!("{x:?}"))]
}

/// A text with one of its numbers replaced.
fn with_number(text: &str, which: usize, number: &str) -> String {
    let is_part = |c: char| c.is_ascii_digit() || matches!(c, '.' | '-' | 'e');
    let mut spans = Vec::new();
    let mut start = None;
    let mut before = ' ';
    for (at, c) in text.char_indices() {
        let begins = c.is_ascii_digit() || (c == '-' && matches!(before, ' ' | '['));
        match start {
            None if begins && matches!(before, ' ' | '[') => start = Some(at),
            Some(from) if !is_part(c) => {
                spans.push((from, at));
                start = None;
            }
            _ => {}
        }
        before = c;
    }
    let (from, to) = spans[which % spans.len()];
    [&text[..from], number, &text[to..]].concat()
}
