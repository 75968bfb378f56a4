//! Time of a simulated frame: scenes on the default detector, and the measurement alone.

use divan::{Bencher, black_box};
use nalgebra::DMatrix;
use tactomo::detector::Detector;
use tactomo::scene::{Hand, Scene, SceneName};
use tactomo::simulate::{Fault, Measurement, Physics, Simulation};

fn main() {
    divan::main();
}

fn detector() -> Detector {
    Detector::preset(Detector::DEFAULT).unwrap_or_else(|| panic!("the default preset"))
}

fn faults(texts: &[&str]) -> Vec<Fault> {
    texts.iter().map(|text| text.parse().unwrap_or_else(|error| panic!("{error}"))).collect()
}

/// A frame of a scene, with the mouse pressing at another place each time, so that nothing stays as it was.
#[divan::bench(args = ["rest", "single", "five-fingers", "ring"])]
fn frame(bencher: Bencher, name: &str) {
    let detector = detector();
    let name: SceneName = name.parse().unwrap_or_else(|error| panic!("{error}"));
    let hand = Hand::relative(&detector);
    let scene = Scene::new(name, &detector, hand, 1);
    let mut simulation = Simulation::new(&detector, scene, &[], 1).unwrap_or_else(|error| panic!("{error}"));
    let controls = simulation.controls();
    let mut x_m = -0.02;
    simulation.readings_v(1.0);
    bencher.bench_local(|| {
        x_m += 1e-5;
        controls.press(hand.tip([x_m, 0.01], 0.3, 1.0).disc().into_iter().collect());
        simulation.readings_v(black_box(1.0))
    });
}

/// Wires, faults, noise and converter of a frame.
#[divan::bench(args = [false, true])]
fn measurement(bencher: Bencher, faulty: bool) {
    let faults = if faulty { faults(&["open:3", "short:2,7", "swap:1,5", "gain:4:0.8"]) } else { Vec::new() };
    let mut measurement = Measurement::new(&detector(), &faults, 1).unwrap_or_else(|error| panic!("{error}"));
    let impedance_ohm = DMatrix::from_fn(16, 16, |i, j| 400.0 + if i == j { 100.0 } else { 0.0 });
    bencher.bench_local(|| measurement.readings_v(Some(black_box(&impedance_ohm))));
}
