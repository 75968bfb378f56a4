//! How many unknowns readings tell: singular values of the linearised readings of a detector, beside the coefficients of presses.
//!
//! A light press adds an image `c` of conductance, which changes the readings by `J c` and noise. With `J = U S V'`, each coefficient
//! `u_i' b` of a change `b` is `s_i v_i' c` and noise. As far as coefficients fall with the singular values, readings tell the images `v_i`.
//! Where they stay at the noise, readings tell nothing, whatever a solver makes of them: the discrete Picard condition (P. C. Hansen, "The discrete
//! Picard condition for discrete ill-posed problems", BIT 30 (1990) 658).

mod spectrum;
mod view;

use nalgebra::DMatrix;

use tactomo_physics::detector::Detector;
use tactomo_physics::forward::jacobian::Jacobian;
use tactomo_physics::geometry;
use tactomo_physics::scene::Touch;

use self::spectrum::Directions;
pub use self::spectrum::Spectrum;
pub use self::view::view;
use crate::experiment::{Experiment, Frame, StudyError};
use crate::machine::Machine;
use crate::scenes::SceneKind;

/// Nodes of the images.
const NODES: usize = 600;
/// Frames of the firm press alone that are averaged before the light ones come: as many as a baseline has.
const BEFORE: usize = 32;
/// A light press is at least so far from the firm one, in mean distances of electrodes.
const APART: f64 = 0.5;

/// What is tried.
#[derive(Clone, Debug)]
pub struct Plan {
    /// The detectors, flat ones.
    pub detectors: Vec<Detector>,
    /// Light presses on each.
    pub presses: usize,
    /// Where places and noise start.
    pub seed: u64,
}

/// What came out.
#[derive(Clone, Debug, serde::Serialize)]
pub struct Report {
    /// Where it ran.
    pub machine: Machine,
    /// How to run it again.
    pub command: String,
    /// Light presses on each detector.
    pub presses: usize,
    /// Where places and noise start.
    pub seed: u64,
    /// The detectors.
    pub detectors: Vec<DetectorReport>,
}

/// What a detector tells.
#[derive(Clone, Debug, serde::Serialize)]
pub struct DetectorReport {
    /// Its name.
    pub detector: String,
    /// The model that is linearised.
    pub model: String,
    /// Its electrodes.
    pub electrodes: usize,
    /// Independent numbers in a frame: readings depend on the symmetric impedances alone.
    pub independent: usize,
    /// Standard deviation of a reading by noise and rounding (V).
    pub noise_v: f64,
    /// Of light presses where nothing else touches.
    pub alone: Spectrum,
    /// Of light presses beside a firm one, about which the readings are linearised.
    pub beside_firm: Spectrum,
}

/// Decomposes what some detectors read.
///
/// # Errors
/// [`StudyError`] if a detector cannot be modelled or is curved.
pub fn run(plan: &Plan, command: &str, say: &mut dyn FnMut(&str)) -> Result<Report, StudyError> {
    let mut detectors = Vec::with_capacity(plan.detectors.len());
    for detector in &plan.detectors {
        say(&detector.name);
        detectors.push(of_detector(plan, detector)?);
    }
    let command = command.to_owned();
    Ok(Report { machine: Machine::this(), command, presses: plan.presses, seed: plan.seed, detectors })
}

fn of_detector(plan: &Plan, detector: &Detector) -> Result<DetectorReport, StudyError> {
    let experiment = Experiment::new(detector)?;
    let model = experiment.problem.model.on_image_of(NODES)?;
    let mesh = model.image_mesh();
    let (firm, light) = presses(&experiment, plan);
    let strength_s_per_m = strength_s_per_m(&light, mesh.node_areas_m2.iter().sum());
    let (noise_v, electrodes) = (detector.adc.deviation_v(), detector.electrodes.len());
    let spectrum = |tangent_v_per_s: DMatrix<f64>, before: &[Touch]| {
        let directions = Directions::of(tangent_v_per_s, &mesh.node_areas_m2);
        let changes_v = changes_v(&experiment, before, &light, plan.seed)?;
        Ok::<_, StudyError>(directions.spectrum(&changes_v, strength_s_per_m, noise_v))
    };
    let touched = model.image_fields(&mesh.conductances_s(std::slice::from_ref(&firm))?)?;
    Ok(DetectorReport {
        detector: detector.name.clone(),
        model: experiment.model.clone(),
        electrodes,
        independent: electrodes * (electrodes + 1) / 2,
        noise_v,
        alone: spectrum(Jacobian::of(&*model).dense(), &[])?,
        beside_firm: spectrum(touched.readings_jacobian_v_per_s(model.detector()), &[firm])?,
    })
}

/// A firm press, and light ones apart from it.
fn presses(experiment: &Experiment, plan: &Plan) -> (Touch, Vec<Touch>) {
    let one = |kind: SceneKind, seed: u64| kind.frames(&experiment.detector, seed, 1).into_iter().flatten().next();
    let seeds = (1..).map(|index| plan.seed.wrapping_mul(1_000_003).wrapping_add(index));
    let firm = one(SceneKind::Firm, plan.seed).unwrap_or_else(|| unreachable!("a firm contact"));
    let apart_m = APART * experiment.reach_m();
    let is_apart = |light: &Touch| geometry::distance(light.centre_m, firm.centre_m) >= apart_m;
    let light = seeds.filter_map(|seed| one(SceneKind::Light, seed)).filter(is_apart).take(plan.presses).collect();
    (firm, light)
}

/// Root mean square over all places of `v' c` for a press that is small against an image `v`, whose square has the integral 1 (S/m): its
/// conductance over the root of the area.
fn strength_s_per_m(presses: &[Touch], area_m2: f64) -> f64 {
    presses.iter().map(|touch| touch.conductance_s).sum::<f64>() / presses.len().max(1) as f64 / area_m2.sqrt()
}

/// By how much each press changes the readings (V), where something else touched before.
fn changes_v(
    experiment: &Experiment,
    before: &[Touch],
    presses: &[Touch],
    seed: u64,
) -> Result<Vec<Vec<f64>>, StudyError> {
    let with = |press: &Touch| before.iter().chain([press]).cloned().collect();
    let mut touches = vec![before.to_vec(); BEFORE];
    touches.extend(presses.iter().map(with));
    let frames = experiment.frames(&touches, seed)?;
    let (before, after) = frames.split_at(BEFORE);
    let mean_v = |index: usize| before.iter().map(|frame| frame.readings.volts()[index]).sum::<f64>() / BEFORE as f64;
    let count = before.first().map_or(0, |frame| frame.readings.volts().len());
    let before_v: Vec<f64> = (0..count).map(mean_v).collect();
    let change = |frame: &Frame| {
        frame.readings.volts().iter().zip(&before_v).map(|(after, before)| after - before).collect::<Vec<f64>>()
    };
    Ok(after.iter().map(change).collect())
}

#[cfg(test)]
mod tests {
    use std::sync::LazyLock;

    use super::*;
    use crate::view::{csv, page};

    /// One run for all tests.
    static REPORT: LazyLock<Report> = LazyLock::new(|| {
        let detectors = vec![Detector::preset("square-50").unwrap()];
        run(&Plan { detectors, presses: 60, seed: 3 }, "", &mut |_| {}).unwrap()
    });

    #[test]
    fn nothing_touched_there_are_as_many_patterns_as_electrodes_and_a_press_gives_more() {
        let of = &REPORT.detectors[0];
        assert_eq!((of.alone.singular_values.len(), of.electrodes, of.independent), (16, 16, 136));
        let more = of.beside_firm.singular_values.len();
        assert!((17..=136).contains(&more), "{more}");
        assert!((of.alone.outside - 1.0).abs() < 0.1, "{}", of.alone.outside);
    }

    #[test]
    fn coefficients_follow_the_singular_values_down_to_the_noise() {
        let of = &REPORT.detectors[0];
        for spectrum in [&of.alone, &of.beside_firm] {
            for (value, typical) in spectrum.singular_values.iter().zip(&spectrum.typical).take(16) {
                assert!((0.5..2.0).contains(&(typical / value.hypot(1.0))), "{value} {typical}");
            }
        }
        // Behind those that are told is noise alone: the root mean square of 60 is within a third of 1.
        let weak = of.beside_firm.singular_values.iter().position(|value| *value < 0.03).unwrap();
        assert!(of.beside_firm.typical[weak..].iter().all(|typical| (typical - 1.0).abs() < 0.34));
    }

    #[test]
    fn each_state_has_a_chart_and_a_row() {
        let views = [view(&REPORT)];
        let page = page(&views, "");
        for state in ["square-50: light presses alone", "square-50: light presses beside a firm one"] {
            assert_eq!(page.matches(&format!("aria-label=\"{state}\"")).count(), 1, "{state}");
        }
        assert_eq!(csv(&views).lines().count(), 3);
    }
}
