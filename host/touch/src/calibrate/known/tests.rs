use fastrand::Rng;

use super::*;
use crate::solve::{Corrector, FoundContact, Uncertainty};

/// Standard normal numbers by the sum of twelve.
fn normal(random: &mut Rng) -> f64 {
    (0..12).map(|_| random.f64()).sum::<f64>() - 6.0
}

/// Presses on `square-60`, found with such an error and such noise (m).
fn presses(count: usize, random: &mut Rng, noise_m: f64, error_m: impl Fn([f64; 2]) -> [f64; 2]) -> Vec<KnownPress> {
    let press = |_| {
        let known_m = [0, 1].map(|_| 0.05 * (random.f64() - 0.5));
        let error_m = error_m(known_m);
        KnownPress {
            found_m: [0, 1].map(|axis| known_m[axis] + error_m[axis] + noise_m * normal(random)),
            standard_errors_m: [noise_m; 2],
            known_m,
            log_conductance: None,
        }
    };
    (0..count).map(press).collect()
}

/// A conformal warp, `w = z + a + b z + c z^2` in complex numbers: 1 mm and more near the walls.
fn warp([x, y]: [f64; 2]) -> [f64; 2] {
    let (u, v) = (x / 0.03, y / 0.03);
    [3e-4 + 4e-4 * u - 5e-4 * v + 6e-4 * (u * u - v * v), -2e-4 + 5e-4 * u + 4e-4 * v + 1.2e-3 * u * v]
}

fn corrected(presses: &[KnownPress]) -> Corrected {
    correction(&Detector::default(), presses, &mut |_| ()).unwrap()
}

fn found_contact(press: &KnownPress) -> FoundContact {
    let [x_m, y_m] = press.standard_errors_m;
    let uncertainty = Some(Uncertainty { x_m, y_m, correlation: 0.0, conductance_s: 0.0 });
    FoundContact { uncertainty, ..FoundContact::flat(press.found_m[0], press.found_m[1], 1e-3) }
}

/// What is left of new presses: their mean distance as found and corrected (m), and shares within one and two standard errors.
fn tried(corrected: Corrected, others: &[KnownPress]) -> ([f64; 2], [f64; 2]) {
    let detector = Detector { correction: corrected.correction, ..Detector::default() };
    let corrector = Corrector::of(&detector).unwrap();
    let (mut off_m, mut within) = ([0.0; 2], [0.0; 2]);
    for press in others {
        let (mean_m, deviations_m) = corrector.error_and_deviations(&found_contact(press));
        let left_m = [0, 1].map(|axis| press.error_m()[axis] - mean_m[axis]);
        off_m = [off_m[0] + press.off_m(), off_m[1] + left_m[0].hypot(left_m[1])];
        for axis in 0..2 {
            let sigmas = left_m[axis].abs() / deviations_m[axis];
            within = [within[0] + f64::from(sigmas < 1.0), within[1] + f64::from(sigmas < 2.0)];
        }
    }
    let count = others.len() as f64;
    (off_m.map(|off_m| off_m / count), within.map(|within| within / (2.0 * count)))
}

#[test]
fn a_smooth_warp_is_corrected_with_honest_errors() {
    // Of 60 warps each, mean distance left and shares within one and two: 8 presses 0.27 mm, 0.67, 0.94; 16: 0.18 mm, 0.67, 0.94; 25: 0.15 mm, 0.69, 0.95.
    for (count, limit_m) in [(8, 4e-4), (16, 2.5e-4), (25, 2e-4)] {
        let (mut off_m, mut within, mut asked) = ([0.0; 2], [0.0; 2], 0.0);
        for seed in 0..40 {
            let mut random = Rng::with_seed(seed);
            let found = corrected(&presses(count, &mut random, 1e-4, warp));
            if found.correction.is_none() {
                continue;
            }
            let (of_m, of) = tried(found, &presses(20, &mut random, 1e-4, warp));
            off_m = [0, 1].map(|k| off_m[k] + of_m[k]);
            within = [0, 1].map(|k| within[k] + of[k]);
            asked += 1.0;
        }
        let ([before_m, after_m], [one, two]) = (off_m.map(|off_m| off_m / asked), within.map(|within| within / asked));
        assert!(asked > 35.0 && before_m > 5e-4 && after_m < limit_m, "{count}: {asked}, {before_m} to {after_m}");
        assert!((0.63..0.74).contains(&one) && (0.90..0.98).contains(&two), "{count}: {one}, {two}");
    }
}

#[test]
fn noise_asks_for_no_correction() {
    for count in [3, 4, 6, 10, 25] {
        let asks = |seed: &u64| {
            corrected(&presses(count, &mut Rng::with_seed(*seed), 3e-4, |_| [0.0; 2])).correction.is_some()
        };
        let asked = (0..100).filter(asks).count();
        assert!(asked < 6, "{count} presses: {asked} of 100");
    }
}

#[test]
fn the_error_falls_as_presses_come_and_presses_left_out_tell_it() {
    let mut random = Rng::with_seed(5);
    let all = presses(30, &mut random, 1e-4, warp);
    let mut reported = Vec::new();
    let found = correction(&Detector::default(), &all, &mut |progress| reported.push(*progress)).unwrap();
    assert_eq!(reported, found.progress);
    assert_eq!(reported.iter().map(|progress| progress.presses).collect::<Vec<_>>(), [1, 2, 4, 8, 16]);
    assert!(reported[..2].iter().all(|progress| progress.after_m == progress.before_m), "two presses correct nothing");
    assert!(
        reported[4].after_m < 0.5 * reported[4].before_m && reported[4].after_m < reported[3].after_m,
        "{reported:?}"
    );
    let mean = |all: &[f64]| all.iter().sum::<f64>() / all.len() as f64;
    let left_out_m = mean(&found.left_out_m);
    let evidence = found.place;
    assert!(evidence.is_corrected && evidence.log_evidence_with > evidence.log_evidence_without + 5.0, "{evidence:?}");
    assert_eq!(mean(&found.before_m), mean(&all.iter().map(KnownPress::off_m).collect::<Vec<_>>()));
    // New presses are missed by as much as those that were left out.
    let ([_, off_m], _) = tried(found, &presses(300, &mut random, 1e-4, warp));
    assert!((off_m / left_out_m).ln().abs() < 0.3, "{off_m} {left_out_m}");
}

#[test]
fn conductances_are_corrected_where_forces_are_known_and_presses_are_kept() {
    let mut random = Rng::with_seed(9);
    let mut all = presses(20, &mut random, 1e-4, warp);
    for press in &mut all {
        press.log_conductance = Some([0.3 * (press.found_m[0] / 0.03) + 0.01 * normal(&mut random), 0.005]);
    }
    let found = corrected(&all);
    assert!(found.conductance.unwrap().is_corrected);
    let correction = found.correction.unwrap();
    for (kept, press) in KnownPress::kept(&correction).iter().zip(&all) {
        assert_eq!((kept.found_m, kept.log_conductance), (press.found_m, press.log_conductance));
        assert!((0..2).all(|axis| (kept.known_m[axis] - press.known_m[axis]).abs() < 1e-15));
    }
    let detector = Detector { correction: Some(correction), ..Detector::default() };
    let corrector = Corrector::of(&detector).unwrap();
    let [conductance_s, deviation_s] = corrector.conductance_s([0.01, 0.0], [2e-3, 1e-5]);
    assert!((conductance_s / 2e-3 * 0.1f64.exp() - 1.0).abs() < 0.02, "{conductance_s}");
    assert!(deviation_s > 1e-5 * (-0.1f64).exp() && deviation_s < 0.03 * conductance_s, "{deviation_s}");
    all.iter_mut().for_each(|press| press.log_conductance = Some([0.02 * normal(&mut random), 0.005]));
    let found = corrected(&all);
    assert!(!found.conductance.unwrap().is_corrected && found.correction.unwrap().conductance.is_none());
}

#[test]
fn what_are_no_presses_is_refused() {
    let mut random = Rng::with_seed(2);
    let all = presses(9, &mut random, 1e-4, warp);
    let refused = |change: &dyn Fn(&mut Vec<KnownPress>)| {
        let mut all = all.clone();
        change(&mut all);
        correction(&Detector::default(), &all, &mut |_| ()).unwrap_err()
    };
    assert_eq!(refused(&|all| all.truncate(2)), KnownError::TooFew { found: 2 });
    assert_eq!(refused(&|all| *all = [all[0]; 301].to_vec()), KnownError::TooMany { found: 301 });
    assert!(matches!(refused(&|all| all[4].found_m[1] = f64::NAN), KnownError::Value { press: 4, .. }));
    assert!(matches!(refused(&|all| all[3].standard_errors_m[0] = -1.0), KnownError::Value { press: 3, .. }));
    let reversed = refused(&|all| {
        let known: Vec<_> = all.iter().rev().map(|press| press.known_m).collect();
        all.iter_mut().zip(known).for_each(|(press, known_m)| press.known_m = known_m);
    });
    assert!(matches!(reversed, KnownError::Places { would: WouldFit::Reversed, .. }), "{reversed}");
    assert!(reversed.to_string().contains("they would fit in the reverse order"), "{reversed}");
}

#[test]
fn presses_at_one_place_and_exact_ones_are_no_trouble() {
    let press =
        KnownPress { found_m: [0.01; 2], standard_errors_m: [0.0; 2], known_m: [0.009; 2], log_conductance: None };
    for count in [3, 20] {
        let found = corrected(&vec![press; count]);
        assert!(found.left_out_m.iter().all(|off_m| off_m.is_finite()), "{found:?}");
    }
    let exact = KnownPress { known_m: press.found_m, ..press };
    assert_eq!(corrected(&[exact; 5]).correction, None, "there is nothing to correct");
}
