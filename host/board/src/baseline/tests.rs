//! Baselines of a detector whose offsets and leakage drift, and on which something is put down. It is a finer slab than the one whose
//! patterns are known.

use std::sync::LazyLock;

use super::*;
use tactomo_physics::detector::Detector;
use tactomo_physics::forward::{DrivingLayer, ForwardModel, Resolution, Slab, readings_v};
use tactomo_physics::readings::Readings;
use tactomo_physics::scene::{Contact, Shape, Touch};
use tactomo_physics::simulate::{Noise, measured};

static FINE: LazyLock<Slab> =
    LazyLock::new(|| Slab::with_resolution(&detector(), Resolution::FINE).unwrap().on_image(900));
static JACOBIAN: LazyLock<Arc<Jacobian>> =
    LazyLock::new(|| Arc::new(Jacobian::of(&Slab::new(&detector()).unwrap().on_image(900))));
/// A place where things are put down.
const HERE: [f64; 2] = [0.013, -0.007];

fn detector() -> Detector {
    let mut detector = Detector::preset(Detector::DEFAULT).unwrap();
    detector.adc.noise_lsb = 1.5;
    detector
}

/// Readings of a detector that leaks so many sheet conductances (V), by the converter and drive of the one that is described.
fn leaking_v(built: &Detector, sheets: f64, contacts: &[Contact]) -> Vec<f64> {
    let driving = DrivingLayer { leak_s: sheets * built.sheet_conductance_s(), ..DrivingLayer::default() };
    let slab = Slab::under(built, Resolution::FINE, driving).unwrap();
    readings_v(&slab.impedance_ohm(contacts).unwrap(), &detector()).volts().to_vec()
}

fn image_v(image_s: &[f64]) -> Vec<f64> {
    readings_v(&FINE.image_impedance_ohm(image_s).unwrap(), &detector()).volts().to_vec()
}

/// Readings of a contact of so many sheet conductances (V).
fn contact_v(sheets: f64) -> Vec<f64> {
    if sheets <= 0.0 {
        return vec![0.0; 256];
    }
    let contact = Contact::flat(HERE[0], HERE[1], 0.003, sheets * detector().sheet_conductance_s());
    readings_v(&FINE.impedance_ohm(&[contact]).unwrap(), &detector()).volts().to_vec()
}

/// A detector and its baseline.
struct Fixture {
    baseline: Baseline,
    noise: Noise,
    /// Offsets of the channels (codes), and readings by leakage (V), which drift by a factor.
    offsets: [f64; 16],
    leakage_v: Vec<f64>,
    factor: f64,
    time_s: f64,
    /// Time from frame to frame (s).
    step_s: f64,
}

impl Fixture {
    /// With leakage of so many sheet conductances.
    fn new(step_s: f64, leakage: f64) -> Self {
        // From -2.5 to 3.5 codes.
        let offsets = std::array::from_fn(|e| 0.4 * (7 * e % 16) as f64 - 2.5);
        let baseline = Baseline::new(Arc::clone(&JACOBIAN), 1);
        let leakage_v = if leakage > 0.0 { leaking_v(&detector(), leakage, &[]) } else { vec![0.0; 256] };
        Self { baseline, noise: Noise::new(4), offsets, leakage_v, factor: 1.0, time_s: 0.0, step_s }
    }

    /// True readings with a touch (V).
    fn true_v(&self, touch_v: &[f64]) -> Vec<f64> {
        let lsb_v = detector().adc.lsb_v();
        let at = |i: usize| lsb_v * self.offsets[i % 16] + self.factor * self.leakage_v[i] + touch_v[i];
        (0..256).map(at).collect()
    }

    fn measured_v(&mut self, touch_v: &[f64]) -> Vec<f64> {
        let true_v = self.true_v(touch_v);
        let readings = Readings::new(16, true_v).unwrap();
        measured(&readings, &detector().adc, &mut self.noise).volts().to_vec()
    }

    /// Frames with a touch (V); whether the state has changed.
    fn touch(&mut self, touch_v: &[f64], frames: u32) -> bool {
        let mut changed = false;
        for _ in 0..frames {
            let readings_v = self.measured_v(touch_v);
            changed |= self.baseline.add(&readings_v, 1, self.time_s, &[]);
            self.time_s += self.step_s;
        }
        changed
    }

    fn rest(&mut self, frames: u32) -> bool {
        self.touch(&[0.0; 256], frames)
    }

    /// Error of what is taken off (codes, root of the mean square) of readings that are large.
    fn error_lsb(&self) -> f64 {
        let offset_v = self.baseline.rest.offset_v();
        let true_v = self.true_v(&[0.0; 256]);
        let squares: f64 = offset_v.iter().zip(&true_v).map(|(a, b)| (a - b).powi(2)).sum();
        (squares / 256.0).sqrt() / detector().adc.lsb_v()
    }

    /// Contact that was learned (sheet conductances): what of a contact's pattern is in what is taken off.
    fn learned(&self) -> f64 {
        let of_one_v: Vec<f64> = contact_v(0.003).iter().map(|volts| volts / 0.003).collect();
        let square: f64 = of_one_v.iter().map(|volts| volts * volts).sum();
        let off = self.baseline.rest.mean_v().iter().zip(self.true_v(&[0.0; 256]));
        off.zip(&of_one_v).map(|((mean, truth), one)| (mean - truth.max(0.0)) * one).sum::<f64>() / square
    }
}

#[test]
fn offsets_and_leakage_are_the_baseline() {
    for leakage in [0.0, 0.01, 0.05] {
        let mut fixture = Fixture::new(1e-3, leakage);
        assert!(fixture.rest(FRAMES), "it is taken");
        assert_eq!((fixture.baseline.state(), fixture.baseline.state().notice()), (BaselineState::Held, None));
        // Noise of 32 frames; of offsets far below zero nothing is seen.
        assert!(fixture.error_lsb() < 0.6, "{leakage}: {}", fixture.error_lsb());
        assert!((fixture.baseline.leakage_sheets() - leakage).abs() < 0.03 * leakage + 3e-4);
        fixture.rest(20 * FRAMES);
        assert!(fixture.error_lsb() < 0.4, "{leakage}: {}", fixture.error_lsb());
    }
}

/// A detector with a builder's tolerances.
fn as_built(seed: u64) -> Detector {
    let (mut noise, mut built) = (Noise::new(seed), detector());
    for layer in &mut built.layers {
        let [thicker, better, gradient] = [0.1, 0.2, 0.7].map(|deviation: f64| (deviation * noise.normal()).exp());
        layer.thickness_m *= thicker;
        layer.bottom_s_per_m *= better / gradient.sqrt();
        layer.top_s_per_m *= better * gradient.sqrt();
    }
    for pad in &mut built.electrodes {
        pad.x_m += 3e-4 * noise.normal();
        pad.y_m += 3e-4 * noise.normal();
    }
    built
}

#[test]
fn leakage_of_a_detector_that_is_not_as_described_is_told_from_touch_and_mostly_taken_off_under_it() {
    for seed in 0..6 {
        for sheets in [0.01, 0.05] {
            let built = as_built(seed);
            let mut fixture = Fixture { leakage_v: leaking_v(&built, sheets, &[]), ..Fixture::new(1e-3, 0.0) };
            fixture.rest(10 * FRAMES);
            assert_eq!(fixture.baseline.state(), BaselineState::Held, "{seed} {sheets}");
            let press = [Contact::flat(HERE[0], HERE[1], 0.003, built.sheet_conductance_s())];
            let (touch_v, both_v) = (leaking_v(&built, 0.0, &press), leaking_v(&built, sheets, &press));
            let besides_v: Vec<f64> = both_v.iter().zip(&fixture.leakage_v).map(|(both, rest)| both - rest).collect();
            let (both_v, mut found_v) = (fixture.true_v(&besides_v), vec![0.0; 256]);
            fixture.baseline.subtract(&both_v, &mut found_v);
            let off = |volts: &[f64]| volts.iter().zip(&touch_v).map(|(a, b)| (a - b).powi(2)).sum::<f64>();
            // Two or three in a hundred of a detector that is as described.
            let share = (off(&found_v) / off(&besides_v)).sqrt();
            assert!(share < 0.2, "{seed} {sheets}: {share}");
        }
    }
}

#[test]
fn until_it_is_taken_the_mean_of_what_has_come_is_taken_off() {
    let mut fixture = Fixture::new(1e-3, 0.02);
    fixture.rest(FRAMES / 2);
    let (frame_v, mut touch_v) = (fixture.measured_v(&[0.0; 256]), vec![0.0; 256]);
    fixture.baseline.subtract(&frame_v, &mut touch_v);
    let largest_v = touch_v.iter().map(|volts| volts.abs()).fold(0.0, f64::max);
    assert!(fixture.baseline.state().is_taking() && largest_v < 7e-3, "{largest_v} of 50 mV of leakage");
}

#[test]
fn a_press_at_the_start_is_never_the_baseline() {
    for sheets in [0.006, 0.03, 3.0] {
        let (mut fixture, touch_v) = (Fixture::new(1e-3, 0.0), contact_v(sheets));
        fixture.touch(&touch_v, 5 * FRAMES);
        assert!(
            matches!(fixture.baseline.state(), BaselineState::Pressed(_)),
            "{sheets}: {:?}",
            fixture.baseline.state()
        );
        assert_eq!(fixture.baseline.rest.mean_v(), [0.0; 256]);
        if sheets > 0.1 {
            fixture.baseline.renew();
            fixture.touch(&touch_v, 2 * FRAMES);
            assert!(matches!(fixture.baseline.state(), BaselineState::Refused(_)), "the answer stays");
        }
        // It is taken as soon as nothing presses.
        fixture.rest(2 * FRAMES);
        assert!(fixture.baseline.state() == BaselineState::Held && fixture.error_lsb() < 0.6, "{sheets}");
    }
}

#[test]
fn a_press_that_begins_while_the_baseline_is_taken_is_none_of_it() {
    let (mut fixture, touch_v) = (Fixture::new(1e-3, 0.0), contact_v(0.3));
    fixture.rest(FRAMES - 1);
    fixture.touch(&touch_v, 1);
    assert!(matches!(fixture.baseline.state(), BaselineState::Pressed(_)));
    fixture.rest(FRAMES);
    assert!(fixture.error_lsb() < 0.6, "{}", fixture.error_lsb());
}

#[test]
fn a_day_of_drift_is_followed_and_is_no_touch() {
    let mut fixture = Fixture::new(10.0, 0.02);
    fixture.rest(2 * FRAMES);
    let mut worst = 0.0_f64;
    for frame in 0..8640 {
        fixture.offsets.iter_mut().enumerate().for_each(|(e, offset)| *offset += [5.0, -0.5, 4.0][e % 3] / 8640.0);
        fixture.factor += 0.2 / 8640.0;
        assert!(!fixture.rest(1), "{:?} after {frame}", fixture.baseline.state());
        worst = worst.max(if frame > 256 { fixture.error_lsb() } else { 0.0 });
    }
    // Noise of 256 frames, and a lag of 43 minutes.
    assert!(worst < 0.4 && (fixture.baseline.leakage_sheets() - 0.024).abs() < 5e-4, "{worst}");
}

#[test]
fn slow_hands_are_not_learned() {
    // A fiftieth of a sheet conductance within five minutes, then held, at 100 frames/s.
    let mut fixture = Fixture::new(0.01, 0.0);
    fixture.rest(20 * FRAMES);
    let before = fixture.learned();
    let steps: Vec<Vec<f64>> = (0..=300).map(|second| contact_v(0.02 * f64::from(second) / 300.0)).collect();
    for touch_v in &steps {
        fixture.touch(touch_v, 100);
    }
    fixture.touch(&steps[300], 3000);
    assert!((fixture.learned() - before).abs() < 3e-4, "{}", fixture.learned() - before);
}

#[test]
fn what_is_too_slow_for_that_is_learned_up_to_a_limit_and_reported() {
    // Half a tenth of a sheet conductance within ten hours.
    let mut fixture = Fixture::new(10.0, 0.0);
    fixture.rest(10 * FRAMES);
    let full_v: Vec<f64> = contact_v(0.001).iter().map(|volts| 50.0 * volts).collect();
    for frame in 0..3600 {
        let touch_v: Vec<f64> = full_v.iter().map(|volts| volts * f64::from(frame) / 3600.0).collect();
        fixture.touch(&touch_v, 1);
    }
    let state = fixture.baseline.state();
    let told = matches!(state, BaselineState::Drifted(_) | BaselineState::Lasting);
    assert!(told && fixture.learned() < 0.005, "{state:?} {}", fixture.learned());
}

#[test]
fn a_cup_for_an_hour_is_not_learned_and_afterwards_what_has_drifted_is() {
    let mut fixture = Fixture::new(0.1, 0.01);
    fixture.rest(20 * FRAMES);
    let rim =
        Touch::flat([0.004, 0.002], Shape::Ring { radius_m: 0.02, width_m: 0.002 }, detector().sheet_conductance_s());
    let cup_v = image_v(&FINE.image_mesh().conductances_s(&[rim]).unwrap());
    let before_v = fixture.baseline.rest.mean_v().to_vec();
    for _ in 0..60 {
        fixture.offsets.iter_mut().for_each(|offset| *offset += 2.0 / 60.0);
        fixture.touch(&cup_v, 600);
    }
    assert_eq!(fixture.baseline.rest.mean_v(), before_v, "nothing is taken under load");
    assert_eq!(fixture.baseline.state(), BaselineState::Lasting);
    assert!(fixture.error_lsb() > 1.5);
    fixture.rest(40);
    assert!(fixture.baseline.state() == BaselineState::Held && fixture.error_lsb() < 0.7, "{}", fixture.error_lsb());
}

#[test]
fn a_very_light_touch_at_the_start_is_forgotten_when_it_is_lifted() {
    let mut fixture = Fixture::new(1e-3, 0.0);
    fixture.touch(&contact_v(0.002), FRAMES);
    assert_eq!(fixture.baseline.state(), BaselineState::Held, "a tenth of the lightest that solvers find well");
    fixture.rest(3 * FRAMES);
    assert!(
        fixture.error_lsb() < 0.6 && fixture.learned().abs() < 3e-4,
        "{} {}",
        fixture.error_lsb(),
        fixture.learned()
    );
}

#[test]
fn a_person_may_take_a_light_touch_for_the_baseline_but_no_press() {
    let mut fixture = Fixture::new(1e-3, 0.0);
    fixture.rest(FRAMES);
    let before_v = fixture.baseline.rest.mean_v().to_vec();
    fixture.baseline.renew();
    assert!(fixture.baseline.state().is_taking());
    fixture.touch(&contact_v(0.3), FRAMES);
    let refused = matches!(fixture.baseline.state(), BaselineState::Refused(volts) if volts > 0.1);
    assert!(refused && fixture.baseline.rest.mean_v() == before_v);
    fixture.rest(2 * FRAMES);
    assert_eq!(fixture.baseline.state(), BaselineState::Held, "once nothing presses");
    fixture.baseline.renew();
    fixture.touch(&contact_v(0.01), FRAMES);
    let BaselineState::Doubtful(place_m) = fixture.baseline.state() else { panic!("{:?}", fixture.baseline.state()) };
    assert!((place_m[0] - HERE[0]).hypot(place_m[1] - HERE[1]) < 0.006, "{place_m:?}");
    fixture.rest(3 * FRAMES);
    assert!(fixture.baseline.state() == BaselineState::Held && fixture.learned().abs() < 3e-4, "{}", fixture.learned());
}

#[test]
fn a_broken_wire_is_no_press() {
    let mut fixture = Fixture::new(1e-3, 0.0);
    for _ in 0..2 * FRAMES {
        let mut readings_v = fixture.measured_v(&[0.0; 256]);
        let floats = |i: &usize| i / 16 == 3 || i % 16 == 3;
        (0..256).filter(floats).for_each(|i| readings_v[i] = 0.6);
        fixture.baseline.add(&readings_v, 1, 0.0, &[3]);
    }
    assert_eq!(fixture.baseline.state(), BaselineState::Held);
}

#[test]
fn more_noise_than_the_description_says_is_no_press() {
    let mut fixture = Fixture::new(1e-3, 0.0);
    let mut noise = Noise::new(2);
    for _ in 0..20 * FRAMES {
        let true_v = fixture.true_v(&[0.0; 256]).iter().map(|volts| volts + 3e-3 * noise.normal()).collect();
        let readings = Readings::new(16, true_v).unwrap();
        let readings_v = measured(&readings, &detector().adc, &mut fixture.noise).volts().to_vec();
        fixture.baseline.add(&readings_v, 1, fixture.time_s, &[]);
        fixture.time_s += 1e-3;
    }
    assert_eq!(fixture.baseline.state(), BaselineState::Held);
    assert!(fixture.error_lsb() < 0.8, "{}", fixture.error_lsb());
}

#[test]
fn leakage_is_taken_off_under_load_where_a_person_says_what_is_the_baseline() {
    let press = [Contact::flat(HERE[0], HERE[1], 0.003, detector().sheet_conductance_s())];
    let (rest_v, both_v) = (leaking_v(&detector(), 0.02, &[]), leaking_v(&detector(), 0.02, &press));
    let touch_v = leaking_v(&detector(), 0.0, &press);
    let mut noise = Noise::new(3);
    let adc = detector().adc;
    let mut read_v = |volts: &[f64]| measured(&Readings::from_fn(16, |g, e| volts[16 * g + e]), &adc, &mut noise);
    let (mut told, mut live) = (Baseline::told(Arc::clone(&JACOBIAN), 1, 40), Baseline::new(Arc::clone(&JACOBIAN), 1));
    for frame in 0..40 {
        let readings = read_v(&rest_v);
        told.add(readings.volts(), 1, 1e-3 * f64::from(frame), &[]);
        live.add(readings.volts(), 1, 1e-3 * f64::from(frame), &[]);
    }
    let mut left_v = [&told, &live].map(|baseline| {
        let mut left_v = vec![0.0; 256];
        baseline.subtract(&both_v, &mut left_v);
        left_v.iter_mut().zip(&touch_v).for_each(|(left, touch)| *left -= touch);
        left_v.iter().map(|volts| volts.abs()).fold(0.0, f64::max)
    });
    let least_v = both_v.iter().zip(&rest_v).zip(&touch_v).map(|((both, rest), touch)| (both - rest - touch).abs());
    let by_rest_alone_v = least_v.fold(0.0, f64::max);
    assert!(left_v[0] < 0.2 * by_rest_alone_v && left_v[1] < 0.2 * by_rest_alone_v, "{left_v:?} {by_rest_alone_v}");
    left_v.sort_by(f64::total_cmp);
    assert!(left_v[1] - left_v[0] < 1e-3, "{left_v:?}");
    // Frames that something presses in are the baseline too, if a person says so; of leakage they tell nothing.
    let mut pressed = Baseline::told(Arc::clone(&JACOBIAN), 1, 2);
    (0..2).for_each(|_| _ = pressed.add(&both_v, 1, 0.0, &[]));
    assert_eq!((pressed.leakage_sheets(), pressed.state()), (0.0, BaselineState::Held));
}

#[test]
fn what_was_never_cut_off_has_no_hidden_offset() {
    // Readings that something was taken off already: noise about zero, on both sides.
    let mut noise = Noise::new(5);
    let mut told = Baseline::told(Arc::clone(&JACOBIAN), 1, 64);
    for _ in 0..64 {
        let readings_v: Vec<f64> = (0..256).map(|_| 1.5e-3 * noise.normal()).collect();
        told.add(&readings_v, 1, 0.0, &[]);
    }
    let mut touch_v = vec![0.0; 256];
    told.subtract(&[0.5; 256], &mut touch_v);
    assert!(touch_v.iter().all(|volts| (volts - 0.5).abs() < 1e-3), "{:?}", &touch_v[..4]);
}

#[test]
fn frames_that_a_person_says_are_the_baseline_are() {
    let mut baseline = Baseline::over(2, 4);
    let mut touch_v = [0.0; 4];
    baseline.add(&[1.0; 4], 1, 0.0, &[]);
    baseline.subtract(&[1.0; 4], &mut touch_v);
    assert_eq!((baseline.state(), touch_v), (BaselineState::Starting, [1.0; 4]));
    assert!(baseline.add(&[2.0; 4], 1, 0.0, &[]));
    baseline.subtract(&[1.0; 4], &mut touch_v);
    assert_eq!((baseline.state(), touch_v), (BaselineState::Held, [-0.5; 4]));
    Baseline::over(0, 4).subtract(&[1.0; 4], &mut touch_v);
    assert_eq!(touch_v, [1.0; 4]);
}
