use proptest::prelude::*;

use super::*;
use crate::detector::Electrode;
use crate::detector::Layer;
use crate::hertz::{self, Skin};
use crate::space;

const DOCUMENTATION: &str = include_str!("../../../../../docs/detector.md");

/// The TOML blocks of the documentation.
fn examples() -> impl Iterator<Item = &'static str> {
    DOCUMENTATION.split("```toml\n").skip(1).filter_map(|rest| rest.split("```").next())
}

const SQUARE: &str = "\
[outline]
size_m = [0.06, 0.06]

[[layers]]
thickness_m = 0.005
conductivity_s_per_m = 0.2273

[electrodes]
grid = [4, 4]
diameter_m = 0.004
";

fn error(replaced: &str, by: &str) -> String {
    assert!(SQUARE.contains(replaced));
    Detector::from_toml(&SQUARE.replace(replaced, by), "square").unwrap_err().to_string()
}

#[test]
fn the_documented_examples_are_detectors() {
    let detectors: Vec<_> = examples().map(|text| Detector::from_toml(text, "example").unwrap()).collect();
    assert!(detectors.len() >= 2);
    assert!(detectors.iter().any(|detector| !detector.outline.holes.is_empty()));
    for detector in detectors {
        assert_eq!(Detector::from_toml(&detector.to_toml(), "").unwrap(), detector);
    }
}

#[test]
fn a_short_file_is_the_preset() {
    let preset = Detector::preset("square-60").unwrap();
    let unknown = Detector { skin: None, ..preset.clone() };
    assert_eq!(Detector::from_toml(SQUARE, "square-60").unwrap(), unknown, "nothing says how soft it is");
    let material = SQUARE.replace("conductivity_s_per_m = 0.2273", "material = \"A\"");
    assert_eq!(Detector::from_toml(&material, "square-60").unwrap(), preset);
}

#[test]
fn presets_go_through_toml_unchanged() {
    for name in Detector::preset_names() {
        let detector = Detector::preset(name).unwrap();
        let text = detector.to_toml();
        assert!(text.contains("grid = ["), "{text}");
        assert_eq!(Detector::from_toml(&text, "other").unwrap(), detector);
    }
}

#[test]
fn a_wrong_value_is_named_with_its_line_and_what_is_allowed() {
    assert_eq!(
        error("thickness_m = 0.005", "thickness_m = -5"),
        "line 5: layers[0].thickness_m is -5.0, but has to be from 1e-6 to 10.0"
    );
    assert_eq!(
        error("grid = [4, 4]", "grid = [9, 9]"),
        "line 9: electrodes.grid is [9, 9], but columns times rows has to be 4 to 32"
    );
    assert!(error("diameter_m = 0.004", "diameter_m = nan").starts_with("line 10: electrodes.diameter_m is NaN"));
    assert!(error("size_m = [0.06, 0.06]", "size_m = [0.06, inf]").starts_with("line 2: outline.size_m[1] is inf"));
    assert!(error("diameter_m = 0.004", "diameter_m = 0.02").starts_with("line 8: electrodes.positions_m[0] puts"));
    assert!(error("conductivity_s_per_m = 0.2273", "").starts_with("line 4: layers[0] has to have one of"));
    assert!(error("conductivity_s_per_m = 0.2273", "material = \"AB\"").starts_with("line 6: layers[0].material is"));
    assert!(error("size_m", "holes_m = []\ncorners_m").contains("TOML parse error at line 3"));
}

#[test]
fn unknown_missing_and_mistyped_fields_are_named() {
    let unknown = error("diameter_m", "diametre_m");
    assert!(unknown.contains("line 10") && unknown.contains("unknown field `diametre_m`"), "{unknown}");
    assert!(unknown.contains("`diameter_m`"), "{unknown}");
    assert!(error("[outline]\nsize_m = [0.06, 0.06]", "").contains("outline or surface has to be there"));
    let mistyped = error("0.005", "\"five\"");
    assert!(mistyped.contains("line 5") && mistyped.contains("expected f64"), "{mistyped}");
}

#[test]
fn a_polygon_is_turned_and_moved_to_the_origin_with_its_electrodes() {
    let text = SQUARE
        .replace("size_m = [0.06, 0.06]", "corners_m = [[0, 0], [0, 0.06], [0.06, 0.06], [0.06, 0]]")
        .replace("grid = [4, 4]", "positions_m = [[0.01, 0.01], [0.05, 0.01], [0.01, 0.05], [0.05, 0.05]]");
    let detector = Detector::from_toml(&text, "moved").unwrap();
    assert_eq!(detector.outline, Outline::rectangle(0.06, 0.06));
    assert!((detector.electrodes[0].x_m + 0.02).abs() < 1e-12 && (detector.electrodes[1].x_m - 0.02).abs() < 1e-12);
}

#[test]
fn pads_may_have_contact_impedances_of_their_own() {
    let ohm_m2: Vec<f64> = (1..=16).map(|k| 1e-5 * f64::from(k)).collect();
    let with = |numbers: &[f64]| {
        let line = format!("diameter_m = 0.004\ncontact_impedances_ohm_m2 = {numbers:?}");
        Detector::from_toml(&SQUARE.replace("diameter_m = 0.004", &line), "spread")
    };
    let detector = with(&ohm_m2).unwrap();
    assert_eq!(detector.electrodes[2].contact_impedance_ohm_m2, Some(ohm_m2[2]));
    assert_eq!(Detector::from_toml(&detector.to_toml(), "").unwrap(), detector);
    let error = |numbers: &[f64]| with(numbers).unwrap_err().to_string();
    assert!(
        error(&ohm_m2[..3]).contains("electrodes.contact_impedances_ohm_m2 has 3 numbers"),
        "{}",
        error(&ohm_m2[..3])
    );
    let negative: Vec<f64> = ohm_m2.iter().map(|ohm_m2| -ohm_m2).collect();
    assert!(error(&negative).contains("electrodes.contact_impedances_ohm_m2[0] is -1e-5"), "{}", error(&negative));
}

#[test]
fn a_file_that_is_missing_or_no_text_says_so() {
    let missing = Detector::read(Path::new("no/such.toml")).unwrap_err().to_string();
    assert!(missing.starts_with("cannot read the detector no/such.toml: No such file"), "{missing}");
    assert!(Detector::read(Path::new(".")).is_err());
}

/// Laws of force of odd numbers, their parameters independent.
fn laws() -> impl Strategy<Value = ForceLaw> {
    let numbers = (1e-9..1.0f64, 0.1..3.0f64, prop::option::of(1e-3..1e6f64), prop::option::of(1e-3..1e3f64));
    (numbers, prop::array::uniform3(0.0..1.0f64), prop::array::uniform2(0.0..0.5f64), 1e-3..1.0f64, 0..100usize)
        .prop_map(|(numbers, variances, [scatter, hysteresis], least_n, presses)| {
            let (conductance_at_1_n_s, exponent, series_ohm, maximum_n) = numbers;
            let size = if series_ohm.is_some() { 3 } else { 2 };
            let row = |i: usize| (0..size).map(|j| if i == j { variances[i] } else { 0.0 }).collect();
            let covariance = (0..size).map(row).collect();
            let range_n = [least_n, 50.0 * least_n];
            ForceLaw {
                conductance_at_1_n_s,
                exponent,
                series_ohm,
                covariance,
                scatter,
                hysteresis,
                range_n,
                maximum_n,
                presses,
            }
        })
}

/// Skins of odd numbers.
fn skins() -> impl Strategy<Value = Skin> {
    let film = (1.0..1e9f64).prop_map(|unit_pa| hertz::Surface::Film { unit_pa });
    let ideal = (1e-9..1.0f64).prop_map(|depth_m| hertz::Surface::Ideal { depth_m });
    (1e3..1e9f64, -0.9..0.5f64, prop_oneof![film, ideal]).prop_map(|(young_pa, poisson, surface)| Skin {
        young_pa,
        poisson,
        surface,
    })
}

/// Detectors of odd numbers: a star about the origin, with a hole or without, and electrodes on a ring.
fn detectors() -> impl Strategy<Value = Detector> {
    let star = prop::collection::vec(0.04..0.08f64, 3..40);
    let layers = prop::collection::vec((1e-4..0.01f64, 1e-3..100.0f64, 1e-3..100.0f64), 1..5);
    let rest = (1e-6..1e-3f64, 0.1..10.0f64, 0.0..100.0f64, 1..=24u8, any::<bool>());
    (star, layers, 4..=32usize, "[^\\p{Cc}]{1,30}", rest, (prop::option::of(laws()), prop::option::of(skins())))
        .prop_filter_map("not buildable", |parts| {
            let (star, layers, count, name, (impedance, drive_v, on_resistance_ohm, bits, hole), (force, skin)) = parts;
            let ring = |count: usize, index: usize| (std::f64::consts::TAU * index as f64 / count as f64).sin_cos();
            let outer = star.iter().enumerate().map(|(i, radius)| {
                let (sin, cos) = ring(star.len(), i);
                [radius * cos, radius * sin]
            });
            let pad = |index: usize| {
                let (sin, cos) = ring(count, index);
                Electrode::flat(0.018 * cos, 0.018 * sin, 1e-3 + 1e-5 * index as f64)
            };
            let holes = if hole { vec![vec![[0.0, 0.0], [0.0, 1e-3], [1e-3, 0.0]]] } else { vec![] };
            let mut outline = Outline { outer: outer.collect(), holes };
            let shift_m = outline.centre();
            let mut electrodes: Vec<_> = (0..count).map(pad).collect();
            electrodes.iter_mut().for_each(|pad| (pad.x_m, pad.y_m) = (pad.x_m + shift_m[0], pad.y_m + shift_m[1]));
            let layer =
                |(thickness_m, bottom_s_per_m, top_s_per_m)| Layer::graded(thickness_m, [bottom_s_per_m, top_s_per_m]);
            let detector = Detector {
                name,
                outline,
                surface: None,
                unevenness: crate::detector::Unevenness::default(),
                tolerances: crate::detector::Tolerances::default(),
                converters: Vec::new(),
                calibration: None,
                layers: layers.into_iter().map(layer).collect(),
                electrodes,
                contact_impedance_ohm_m2: impedance,
                drive_v,
                ground_v: 0.0,
                on_resistance_ohm,
                adc: Adc { bits, ..Adc::default() },
                force,
                skin,
                correction: None,
            };
            detector.check().is_ok().then_some(detector)
        })
}

#[test]
fn a_lifted_ground_is_given_as_a_meter_shows_it() {
    let lifted = |drive_v: f64| {
        let text = Detector { drive_v, ground_v: 0.25, ..Detector::default() }.to_toml();
        (text.clone(), Detector::from_toml(&text, ""))
    };
    let (text, read) = lifted(1.75);
    assert!(text.contains("drive_v = 2.0\nground_v = 0.25\n"), "{text}");
    let read = read.unwrap();
    assert_eq!((read.drive_v, read.ground_v), (1.75, 0.25));
    let wrong = lifted(-0.05).1.unwrap_err().to_string();
    assert!(wrong.contains("drive_v is 0.2, but has to be above ground_v, which is 0.25"), "{wrong}");
}

proptest! {
    #[test]
    fn any_detector_goes_through_toml_unchanged(detector in detectors()) {
        prop_assert_eq!(Detector::from_toml(&detector.to_toml(), "").unwrap(), detector);
    }

    #[test]
    fn no_text_panics(text in "\\PC{0,200}") {
        let _ = Detector::from_toml(&text, "any");
    }

    #[test]
    fn no_damage_to_a_file_panics(at in 0usize..1000, length in 0usize..6, put in "[-0-9.eE\\[\\],naif\"=\n]{0,6}") {
        let text = examples().last().unwrap();
        let clip = |at: usize| (0..=at.min(text.len())).rev().find(|at| text.is_char_boundary(*at)).unwrap();
        let (start, end) = (clip(at % text.len()), clip(at % text.len() + length));
        let damaged = [&text[..start], &put, &text[end..]].concat();
        if let Ok(detector) = Detector::from_toml(&damaged, "damaged") {
            prop_assert_eq!(Detector::from_toml(&detector.to_toml(), "").unwrap(), detector);
        }
    }
}

#[test]
fn a_law_of_force_is_checked_with_its_line() {
    let law = "\n[force]\nconductance_at_1_n_s = 2e-3\nexponent = 0.66\ncovariance = [[4e-4, 1e-4], [1e-4, 9e-4]]\nscatter = 0.05\n\
               hysteresis = 0.03\nrange_n = [0.5, 5]\npresses = 10\n";
    let with = |law: &str| Detector::from_toml(&format!("{SQUARE}{law}"), "square");
    let detector = with(law).unwrap();
    let force = detector.force.as_ref().unwrap();
    assert_eq!((force.exponent, force.series_ohm, force.limit_n()), (0.66, None, 5.0));
    assert!(detector.to_toml().contains("exponent = 0.66 # standard error 0.03"), "{}", detector.to_toml());
    assert_eq!(Detector::from_toml(&detector.to_toml(), "").unwrap(), detector);
    assert_eq!(detector.in_material(&"B".parse().unwrap()).unwrap().force, None, "it was that of another material");
    let error = |from: &str, to: &str| with(&law.replace(from, to)).unwrap_err().to_string();
    assert_eq!(error("0.66", "-1"), "line 14: force.exponent is -1.0, but has to be from 0.01 to 10.0");
    assert!(
        error("[0.5, 5]", "[5, 0.5]").starts_with("line 18: force.range_n[1] is 0.5"),
        "{}",
        error("[0.5, 5]", "[5, 0.5]")
    );
    assert!(error("exponent", "power").contains("unknown field `power`"));
    assert!(error("presses = 10\n", "").contains("missing field `presses`"));
    assert!(error("[[4e-4, 1e-4], [1e-4, 9e-4]]", "[[4e-4]]").contains("force.covariance has to have a row"));
}

#[test]
fn a_correction_is_checked_with_its_line_and_belongs_to_its_material() {
    let table = "\n[correction.place]\nlength_m = 0.03\ndeviation_m = 1e-3\nnoise_m = 1e-4\nclaimed_share = 0.5\n\
                 found_m = [[0.01, 0.02], [0.0, -0.01]]\nerrors_m = [[1e-3, 0.0], [0.0, 2e-3]]\n\
                 standard_errors_m = [[1e-4, 1e-4], [1e-4, 1e-4]]\n";
    let with = |table: &str| Detector::from_toml(&format!("{SQUARE}{table}"), "square");
    let detector = with(table).unwrap();
    assert_eq!(detector.correction.as_ref().map(Correction::presses), Some(2));
    assert_eq!(Detector::from_toml(&detector.to_toml(), "").unwrap(), detector);
    assert!(detector.facts().contains(&("corrected", "by 2 known presses".to_owned())));
    assert_eq!(detector.taken_as_exact().correction, None, "there is nothing to correct");
    let error = |from: &str, to: &str| with(&table.replace(from, to)).unwrap_err().to_string();
    assert_eq!(
        error("length_m = 0.03", "length_m = 0"),
        "line 13: correction.place.length_m is 0.0, but has to be from 1e-5 to 100.0"
    );
    assert!(error("[1e-3, 0.0], ", "").ends_with("correction.place.errors_m has 1 presses, but found_m has 2"));
    assert!(error("noise_m", "noise").contains("unknown field `noise`"));
    assert_eq!(
        detector.in_material(&"B".parse().unwrap()).unwrap().correction,
        None,
        "it was that of another material"
    );
}

fn example(name: &str) -> std::path::PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../examples/detectors").join(name)
}

#[test]
fn examples_are_read_and_written_alike() {
    for name in ["fingertip.toml", "l-shape.toml"] {
        let path = example(name);
        let detector = Detector::read(&path).unwrap();
        let folder = path.parent().unwrap();
        let again = Detector::from_toml_in(folder, &detector.to_toml(), "else").unwrap();
        assert_eq!(again.surface, detector.surface);
        for (ours, theirs) in again.electrodes.iter().zip(&detector.electrodes) {
            assert!(space::distance(ours.place_m(), theirs.place_m()) < 1e-9, "{name}");
        }
    }
}

#[test]
fn a_curved_detector_is_whole_with_its_surface_as_text() {
    let detector = Detector::read(&example("fingertip.toml")).unwrap();
    let surface = detector.surface.as_ref().unwrap();
    let again = Detector::from_toml_and_obj(&detector.to_toml(), &surface.to_obj(), "else").unwrap();
    let read = again.surface.as_ref().unwrap();
    assert_eq!((&again.name, &read.triangles, &read.file), (&detector.name, &surface.triangles, &surface.file));
    for (ours, theirs) in read.nodes_m.iter().zip(&surface.nodes_m) {
        assert!(space::distance(*ours, *theirs) < 1e-15);
    }
    for (ours, theirs) in again.electrodes.iter().zip(&detector.electrodes) {
        assert!(space::distance(ours.place_m(), theirs.place_m()) < 1e-12);
    }
    let (toml, file) = detector.to_files("tip-cal");
    let (name, obj) = file.unwrap();
    assert!(name == "tip-cal.obj" && toml.contains("surface = \"tip-cal.obj\""), "{toml}");
    assert_eq!(obj, surface.to_obj());
    let wrong = Detector::from_toml_and_obj(&detector.to_toml(), "v 1 2", "else").unwrap_err().to_string();
    assert!(wrong.contains("surface"), "{wrong}");
}

#[test]
fn text_opens_no_file_whatever_it_names() {
    let text = std::fs::read_to_string(example("fingertip.toml")).unwrap();
    let there = example("fingertip.obj").display().to_string();
    for file in [&there, "fingertip.obj", "/dev/zero", "no-such.obj"] {
        let wrong = Detector::from_toml(&text.replace("fingertip.obj", file), "x").unwrap_err().to_string();
        assert!(wrong.contains("only a detector's own file may name another one") && wrong.contains(file), "{wrong}");
    }
    let device = text.replace("fingertip.obj", "/dev/zero");
    let wrong = Detector::from_toml_in(Path::new(""), &device, "x").unwrap_err().to_string();
    assert!(wrong.contains("it is no regular file"), "{wrong}");
}

#[test]
fn errors_of_surfaces_name_electrode_file_and_unit() {
    let path = example("fingertip.toml");
    let text = std::fs::read_to_string(&path).unwrap();
    let error = |from: &str, to: &str| {
        assert!(text.contains(from));
        Detector::from_toml_in(path.parent().unwrap(), &text.replace(from, to), "x").unwrap_err().to_string()
    };
    let far = error("[-0.00263, -0.00144, 0.00742]", "[-0.00263, -0.00144, 0.01242]");
    assert!(far.contains("electrodes.positions_m[15] puts electrode 15 4.") && far.contains("mm away"), "{far}");
    assert!(error("\"mm\"", "\"m\"").contains("see surface_unit"));
    assert!(error("\"mm\"", "\"parsec\"").contains("surface_unit"));
    assert!(error("fingertip.obj", "no-such.obj").contains("no-such.obj"));
    assert!(error(", 0.00742],", "],").contains("has 2 numbers, but has to be [x, y, z]"));
    assert!(error("surface = \"fingertip.obj\"", "").contains("outline or surface has to be there"));
}
