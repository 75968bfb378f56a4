//! Presses on a detector: single ones of any strength, and pairs of a light and a firm one.

use tactomo_physics::detector::Detector;
use tactomo_physics::scene::Contact;

/// Radii (m), and conductances of single presses, in sheet conductances.
const RADII_M: [f64; 2] = [2e-3, 3.5e-3];
const SHEETS: [f64; 2] = [0.05, 5.0];
/// Conductances of a pair, in sheet conductances, and their least distance (m).
const PAIR_SHEETS: [f64; 2] = [0.3, 3.0];
const PAIR_APART_M: f64 = 10e-3;
/// From the outline's box, at least (m).
const MARGIN_M: f64 = 4e-3;
/// For so many single presses there is one pair.
const SINGLES: usize = 4;

/// So many single presses, and then pairs.
pub(crate) fn random(detector: &Detector, presses: usize, seed: u64) -> Vec<Vec<Contact>> {
    let mut random = fastrand::Rng::with_seed(seed);
    let sheet_s = detector.sheet_conductance_s();
    let mut press = |sheets: Option<f64>| {
        let [low, high] = detector.outline.bounds();
        let [x_m, y_m] = [0, 1].map(|axis| {
            let (from_m, to_m) = (low[axis] + MARGIN_M, high[axis] - MARGIN_M);
            from_m + (to_m - from_m) * random.f64()
        });
        let any = SHEETS[0] * (SHEETS[1] / SHEETS[0]).powf(random.f64());
        let radius_m = RADII_M[0] + (RADII_M[1] - RADII_M[0]) * random.f64();
        Contact::flat(x_m, y_m, radius_m, sheets.unwrap_or(any) * sheet_s)
    };
    let mut all: Vec<_> = (0..presses).map(|_| vec![press(None)]).collect();
    for _ in 0..presses / SINGLES {
        let first = press(Some(PAIR_SHEETS[0]));
        let far = |other: &Contact| (other.x_m - first.x_m).hypot(other.y_m - first.y_m) > PAIR_APART_M;
        let second = std::iter::repeat_with(|| press(Some(PAIR_SHEETS[1]))).find(far);
        all.push(std::iter::once(first).chain(second).collect());
    }
    all
}
