//! Detectors that are not as they are described: pads and places that differ.

use super::Fault;
use super::noise::{Noise, Stream};
use crate::detector::{Detector, Parameter, Problem, Tolerances};

/// Halvings of the way from a pad's place as drawn to the one described, after which they are one.
const HALVINGS: usize = 60;

/// `detector` as its faults make it: of another conductivity, or one that differs from place to place, with contact impedances that differ
/// from pad to pad. `seed` chooses what is large and what small.
pub fn as_built(detector: &Detector, faults: &[Fault], seed: u64) -> Detector {
    let mut detector = detector.clone();
    for fault in faults {
        match *fault {
            Fault::Conductivity { factor } => scale(&mut detector, factor),
            Fault::ContactSpread { deviation } => spread_contacts(&mut detector, deviation, seed),
            Fault::Uneven { deviation } => detector = uneven(&detector, deviation, seed),
            _ => {}
        }
    }
    detector
}

/// A detector as it may have been built by a description: each of its parameters off by its tolerance, and `seed` chooses by how much. What
/// is returned is exact: it is what was built, which solvers do not know. Pads stay apart and within the outline. Converters, if the board that
/// measures it is known, have gain and bow of one chip in place of the deviations.
pub fn drawn(detector: &Detector, seed: u64) -> Detector {
    let mut noise = Noise::of(seed, Stream::AsBuilt);
    let mut built = detector.stepped(&steps(detector, &detector.tolerances, &mut noise));
    settle(&mut built, detector);
    let code_v = detector.adc.lsb_v();
    for pad in &mut built.electrodes {
        pad.offset_v += detector.tolerances.offset_lsb * code_v * noise.normal();
    }
    for converter in &mut built.converters {
        converter.gain_share *= noise.normal();
        converter.bow_v *= noise.normal();
    }
    Detector { calibration: None, correction: None, tolerances: Tolerances::EXACT, ..built }
}

/// Why no detector as built can be drawn.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum CannotDraw {
    /// What is left unknown of a calibrated detector is less than its tolerances.
    #[error(
        "{detector} is calibrated, so what was built is not drawn around it but around the description that it was calibrated from: give that \
         one's `detector show DESCRIPTION --as-built {seed}` as a file, --as-built FILE"
    )]
    Calibrated {
        /// Its name.
        detector: String,
        /// The seed that was asked for.
        seed: u64,
    },
    /// It is as it is described.
    #[error("{0} has tolerances of nothing, so there is nothing to draw: see [tolerances]")]
    Exact(String),
    /// What was drawn is no detector.
    #[error("{detector} as built with seed {seed} is no detector: narrow its [tolerances] or give another seed")]
    Wrong {
        /// Its name.
        detector: String,
        /// The seed that was asked for.
        seed: u64,
        /// What is wrong.
        source: Problem,
    },
}

/// The detector that [`drawn`] gives, where there is one.
///
/// # Errors
/// [`CannotDraw`], which says what to do.
pub fn try_drawn(detector: &Detector, seed: u64) -> Result<Detector, CannotDraw> {
    let name = || detector.name.clone();
    if detector.calibration.is_some() {
        return Err(CannotDraw::Calibrated { detector: name(), seed });
    }
    if detector.tolerances.is_exact() {
        return Err(CannotDraw::Exact(name()));
    }
    let built = drawn(detector, seed);
    match built.check() {
        Ok(()) => Ok(built),
        Err(source) => Err(CannotDraw::Wrong { detector: name(), seed, source }),
    }
}

/// The detector that [`try_drawn`] gives; if so many standard deviations of that tolerance are given, its top conducts better than its bottom by these
/// in place of what is drawn.
///
/// # Errors
/// As for [`try_drawn`].
pub fn drawn_top_over_bottom(detector: &Detector, seed: u64, deviations: Option<f64>) -> Result<Detector, CannotDraw> {
    let Some(deviations) = deviations else { return try_drawn(detector, seed) };
    let tolerances = Tolerances { top_over_bottom_factor: 1.0, ..detector.tolerances };
    let built = try_drawn(&Detector { tolerances, ..detector.clone() }, seed)?;
    let step = deviations * detector.tolerances.top_over_bottom_factor.ln();
    Ok(built.stepped(&[(Parameter::TopOverBottom, step)]))
}

/// A step of every parameter but the offsets, which are the board's, and the driving layer, which is a [`Fault`].
fn steps(detector: &Detector, tolerances: &Tolerances, noise: &mut Noise) -> Vec<(Parameter, f64)> {
    let step = |parameter: Parameter| (parameter, tolerances.deviation(detector, parameter) * noise.normal());
    let is_drawn = |parameter: &Parameter| !matches!(parameter, Parameter::Offset(_) | Parameter::DrivingSheet);
    let all = Parameter::all(detector, 0.0).into_iter().filter(is_drawn);
    // What is exact stays as it is described, to the digit.
    all.map(step).filter(|(_, step)| *step != 0.0).collect()
}

/// `detector` with a conductivity whose logarithm differs by that standard deviation over the plane, as tolerances draw it.
fn uneven(detector: &Detector, deviation: f64, seed: u64) -> Detector {
    let tolerances = Tolerances { uneven_share: deviation, ..Tolerances::EXACT };
    detector.stepped(&steps(detector, &tolerances, &mut Noise::of(seed, Stream::Uneven)))
}

/// Moves pads that have no room half way back to where they are described, until all have.
fn settle(built: &mut Detector, described: &Detector) {
    for _ in 0..HALVINGS {
        let moved: Vec<usize> = (0..built.electrodes.len()).filter(|e| !built.has_room_for(*e)).collect();
        if moved.is_empty() {
            return;
        }
        for e in moved {
            let [at_m, told_m] = [&*built, described].map(|detector| detector.electrodes[e].place_m());
            built.put_electrode(e, [0, 1, 2].map(|axis| 0.5 * (at_m[axis] + told_m[axis])));
        }
    }
}

fn scale(detector: &mut Detector, factor: f64) {
    for layer in &mut detector.layers {
        layer.bottom_s_per_m *= factor;
        layer.top_s_per_m *= factor;
    }
}

fn spread_contacts(detector: &mut Detector, deviation: f64, seed: u64) {
    let mut noise = Noise::of(seed, Stream::ContactSpread);
    let common_ohm_m2 = detector.contact_impedance_ohm_m2;
    for pad in &mut detector.electrodes {
        *pad.contact_impedance_ohm_m2.get_or_insert(common_ohm_m2) *= (deviation * noise.normal()).exp();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::forward::shell::Shell;
    use crate::forward::{ForwardModel, Slab};
    use crate::scene::Contact;

    #[test]
    fn contact_impedances_spread_as_asked_and_the_same_for_a_seed() {
        let mut detector = Detector::preset(Detector::DEFAULT).unwrap();
        detector.electrodes = vec![detector.electrodes[0]; 2000];
        let of = |seed| as_built(&detector, &[Fault::ContactSpread { deviation: 0.2 }], seed);
        let log = |pad| (of(3).pad_impedance_ohm_m2(pad) / detector.contact_impedance_ohm_m2).ln();
        let logs: Vec<f64> = of(3).electrodes.iter().map(log).collect();
        let mean = logs.iter().sum::<f64>() / 2000.0;
        let deviation = (logs.iter().map(|log| (log - mean).powi(2)).sum::<f64>() / 2000.0).sqrt();
        // Four standard errors: 0.2 / sqrt(2000), and that over the square root of two.
        assert!(mean.abs() < 0.018 && (deviation - 0.2).abs() < 0.0127, "{mean} {deviation}");
        assert_eq!(of(3), of(3));
        assert_ne!(of(3), of(4));
        assert_eq!(as_built(&detector, &[], 3), detector);
    }

    #[test]
    fn a_detector_as_built_has_its_top_over_its_bottom_as_asked_and_the_rest_as_it_was() {
        let described = Detector::default();
        let ratio = |detector: &Detector| detector.layers[0].top_s_per_m / detector.layers[0].bottom_s_per_m;
        let usual = try_drawn(&described, 9).unwrap();
        let factor = described.tolerances.top_over_bottom_factor;
        for deviations in [-2.0, 0.0, 3.0] {
            let built = drawn_top_over_bottom(&described, 9, Some(deviations)).unwrap();
            assert!((ratio(&built) / ratio(&described) / factor.powf(deviations) - 1.0).abs() < 1e-9);
            assert!((built.sheet_conductance_s() / usual.sheet_conductance_s() - 1.0).abs() < 1e-9);
            assert_eq!((&built.electrodes, &built.unevenness), (&usual.electrodes, &usual.unevenness));
        }
    }

    #[test]
    fn another_conductivity_is_that_of_every_layer() {
        let detector = Detector::preset(Detector::DEFAULT).unwrap();
        let built = as_built(&detector, &[Fault::Conductivity { factor: 0.5 }], 1);
        assert_eq!(built.sheet_conductance_s(), 0.5 * detector.sheet_conductance_s());
        assert_eq!(built.electrodes, detector.electrodes);
    }

    #[test]
    fn pads_that_all_changed_alike_are_a_detector_that_did() {
        let alike = Detector { contact_impedance_ohm_m2: 1e-3, ..Detector::preset(Detector::DEFAULT).unwrap() };
        let mut each = Detector::preset(Detector::DEFAULT).unwrap();
        each.electrodes.iter_mut().for_each(|pad| pad.contact_impedance_ohm_m2 = Some(1e-3));
        let press = Contact::flat(0.004, -0.011, 0.003, 1e-3);
        let slab = |detector| Slab::new(detector).unwrap().impedance_ohm(&[press]).unwrap();
        assert_eq!(slab(&alike), slab(&each));
        let shell = |detector| Shell::new(detector).unwrap().impedance_ohm(&[press]).unwrap();
        assert_eq!(shell(&alike), shell(&each));
    }

    #[test]
    fn one_worse_pad_shows_in_its_own_impedance_by_the_most() {
        let mut detector = Detector::preset(Detector::DEFAULT).unwrap();
        let press = Contact::flat(0.004, -0.011, 0.003, 1e-3);
        let slab = |detector: &Detector| Slab::new(detector).unwrap().impedance_ohm(&[press]).unwrap();
        let before = slab(&detector);
        detector.electrodes[5].contact_impedance_ohm_m2 = Some(1e-3);
        let change = slab(&detector) - before;
        // dZ/dz is the mean square of the current density: at least that of a current spread evenly over the pad, more where it is
        // crowded at the edge, as it is before.
        let even_ohm = (1e-3 - 1e-5) / (std::f64::consts::PI * 0.002f64.powi(2));
        let own = change[(5, 5)] / even_ohm;
        assert!(own > 1.0 && own < 1.5, "{own}");
        let others = (0..256).filter(|k| *k != 5 * 17).map(|k| change[k].abs()).fold(0.0, f64::max);
        assert!(others < 0.05 * even_ohm, "{others} {even_ohm}");
    }

    /// Standard deviation of what a function gives of the detectors drawn at 400 seeds, and the mean.
    fn over_seeds(described: &Detector, of: impl Fn(&Detector) -> f64) -> [f64; 2] {
        let all: Vec<f64> = (0..400).map(|seed| of(&drawn(described, seed))).collect();
        let mean = all.iter().sum::<f64>() / 400.0;
        [(all.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / 400.0).sqrt(), mean]
    }

    #[test]
    fn detectors_are_drawn_with_the_deviations_of_their_tolerances() {
        let described = Detector::default();
        let is = |of: &dyn Fn(&Detector) -> f64, deviation: f64| {
            let [found, mean] = over_seeds(&described, of);
            // Four standard errors of the deviation and of the mean, of 400 normal numbers.
            assert!((found / deviation - 1.0).abs() < 4.0 / 800f64.sqrt(), "{found} {deviation}");
            assert!(mean.abs() < 4.0 * deviation / 20.0, "{mean} {deviation}");
        };
        is(&|built| (built.thickness_m() / described.thickness_m()).ln(), 0.1);
        is(&|built| (built.layers[0].top_s_per_m / built.layers[0].bottom_s_per_m).ln(), 2f64.ln());
        let per_m = |detector: &Detector| detector.sheet_conductance_s() / detector.thickness_m();
        is(&|built| (per_m(built) / per_m(&described)).ln(), 0.2);
        is(&|built| built.electrodes[5].x_m - described.electrodes[5].x_m, 3e-4);
        is(&|built| built.electrodes[9].y_m - described.electrodes[9].y_m, 3e-4);
        is(&|built| (built.contact_impedance_ohm_m2 / described.contact_impedance_ohm_m2).ln(), 3f64.ln());
        is(&|built| (built.pad_impedance_ohm_m2(&built.electrodes[2]) / built.contact_impedance_ohm_m2).ln(), 0.3);
        is(&|built| built.electrodes[2].gain.ln(), 0.003);
        is(&|built| built.electrodes[2].offset_v, 2.0 * described.adc.lsb_v());
        is(&|built| (built.on_resistance_ohm / described.on_resistance_ohm).ln(), 0.25);
        let mode = Parameter::Uneven([1, 1]);
        is(&|built| built.unevenness.log_amplitudes[1][1], described.tolerances.deviation(&described, mode));
    }

    #[test]
    fn a_seed_is_one_detector_and_what_is_drawn_is_exact() {
        let described = Detector::default();
        assert_eq!(drawn(&described, 7), drawn(&described, 7));
        assert_ne!(drawn(&described, 7), drawn(&described, 8));
        assert!(drawn(&described, 7).tolerances.is_exact());
        let exact = described.taken_as_exact();
        assert_eq!(drawn(&exact, 7), exact);
    }

    #[test]
    fn pads_stay_apart_and_on_the_detector_however_far_they_may_be() {
        let examples = |name| format!("{}/../examples/detectors/{name}", env!("CARGO_MANIFEST_DIR"));
        let files = ["fingertip.toml", "l-shape.toml"].map(|name| Detector::read(examples(name).as_ref()).unwrap());
        let presets = Detector::preset_names().filter_map(Detector::preset);
        for mut described in files.into_iter().chain(presets) {
            described.tolerances.electrodes_m = 0.01;
            for seed in 0..10 {
                let built = drawn(&described, seed);
                assert_eq!(built.check(), Ok(()), "{} {seed}", described.name);
                assert_ne!(
                    built.electrodes[0].place_m(),
                    described.electrodes[0].place_m(),
                    "{} {seed}",
                    described.name
                );
            }
        }
    }

    #[test]
    fn a_detector_as_built_reads_otherwise_than_the_one_on_paper() {
        let described = Detector::default();
        let press = Contact::flat(0.004, -0.011, 0.003, 1e-3);
        let slab = |detector: &Detector| Slab::new(detector).unwrap().impedance_ohm(&[press]).unwrap();
        let (paper, bench) = (slab(&described), slab(&drawn(&described, 1)));
        assert!((&paper - &bench).amax() > 0.02 * paper.amax());
        assert!((&bench - bench.transpose()).amax() < 1e-9 * bench.amax());
    }

    #[test]
    fn unevenness_over_seeds_is_that_asked_for_and_smooth_over_a_quarter_of_the_side() {
        const SEEDS: u64 = 2000;
        let described = Detector::preset(Detector::DEFAULT).unwrap();
        let fault = [Fault::Uneven { deviation: 0.2 }];
        let built: Vec<Detector> = (0..SEEDS).map(|seed| as_built(&described, &fault, seed)).collect();
        let covariance = |a: [f64; 2], b: [f64; 2]| {
            let product = |built: &Detector| built.log_unevenness(a) * built.log_unevenness(b);
            built.iter().map(product).sum::<f64>() / SEEDS as f64
        };
        // It is larger at the walls, where all cosines are: that over the plane is the one asked for.
        let points =
            (0..9).flat_map(|i| (0..9).map(move |j| [i, j].map(|k| 0.06 * ((f64::from(k) + 0.5) / 9.0 - 0.5))));
        let deviation = (points.map(|at_m| covariance(at_m, at_m)).sum::<f64>() / 81.0).sqrt();
        // Four standard errors of the root of a mean square at one place, which are more than those of 81.
        let error = (2.0 / SEEDS as f64).sqrt();
        assert!((deviation / 0.2 - 1.0).abs() < 2.0 * error, "{deviation}");
        // The mean over the plane is left out, as that is the conductivity: what is far apart shows by how much.
        let (here, far) = ([0.0, 0.0], covariance([0.0, 0.0], [-0.03, 0.03]));
        let correlation = (covariance(here, [0.015, 0.0]) - far) / (covariance(here, here) - far);
        // 15 mm is the length itself: exp(-1/2). Four standard errors of a mean of products.
        assert!((correlation - (-0.5f64).exp()).abs() < 4.0 * error, "{correlation}");
    }

    #[test]
    fn unevenness_of_nothing_is_none_and_of_a_seed_one() {
        let described = Detector::default();
        let of = |deviation, seed| as_built(&described, &[Fault::Uneven { deviation }], seed);
        assert_eq!(of(0.0, 1), described);
        assert_eq!(of(0.2, 1), of(0.2, 1));
        assert_ne!(of(0.2, 1), of(0.2, 2));
        let even = Detector { unevenness: described.unevenness.clone(), ..of(0.2, 1) };
        assert_eq!(even, described, "nothing else differs");
    }
}
