//! How many presses a calibration needs: error against rubbed presses, at several noises.

use super::{BuiltError, Figures, Plan, run};
use tactomo_physics::detector::Adc;

/// Rubbed presses; none leaves the description.
const FRAMES: [usize; 5] = [0, 5, 20, 100, 1000];
/// Noises of the converter (LSB): a third, once and three times the default's.
const NOISES_LSB: [f64; 3] = [0.5, 1.5, 5.0];

/// What came out for every noise and number of presses.
#[derive(Clone, Debug, serde::Serialize)]
pub struct OverFrames {
    /// How to run it again.
    pub command: String,
    /// Name of the description.
    pub detector: String,
    /// How many detectors were drawn.
    pub detectors: usize,
    /// Single presses tried on each.
    pub presses: usize,
    /// Rubbed presses.
    pub frames: Vec<usize>,
    /// One for each solver and noise.
    pub curves: Vec<Curve>,
}

/// A solver at a noise.
#[derive(Clone, Debug, serde::Serialize)]
pub struct Curve {
    /// Name of the solver.
    pub solver: &'static str,
    /// Noise of the converter (LSB), which solvers and calibrations know.
    pub noise_lsb: f64,
    /// One for each number of rubbed presses.
    pub points: Vec<Point>,
}

/// A number of rubbed presses.
#[derive(Clone, Debug, serde::Serialize)]
pub struct Point {
    /// The number; at 0 solvers know the description.
    pub frames: usize,
    /// Detectors whose calibration was refused, which leaves them the description.
    pub refused: usize,
    /// Figures of single presses.
    #[serde(flatten)]
    pub figures: Figures,
}

/// Tries solvers on the same detectors and presses after rubs of several lengths, at several noises; other fields of the plan are as in [`run`].
///
/// # Errors
/// As for [`run`].
pub fn over_frames(plan: &Plan, command: &str, progress: &(dyn Fn(&str) + Sync)) -> Result<OverFrames, BuiltError> {
    let mut curves = Vec::new();
    for noise_lsb in NOISES_LSB {
        let mut of_noise: Vec<Curve> = Vec::new();
        for frames in FRAMES {
            progress(&format!("{frames} rubbed presses at {noise_lsb} LSB"));
            let mut plan = Plan { rub: frames, ..plan.clone() };
            plan.detector.adc = Adc { noise_lsb, ..plan.detector.adc };
            let report = run(&plan, command, progress)?;
            for row in report.rows.into_iter().filter(|row| row.contacts == 1) {
                let point = Point { frames, refused: report.refused.len(), figures: row.figures };
                match of_noise.iter_mut().find(|curve| curve.solver == row.solver) {
                    Some(curve) => curve.points.push(point),
                    None => of_noise.push(Curve { solver: row.solver, noise_lsb, points: vec![point] }),
                }
            }
        }
        curves.extend(of_noise);
    }
    curves.sort_by_key(|curve| plan.methods.iter().position(|method| method.name() == curve.solver));
    Ok(OverFrames {
        command: command.to_owned(),
        detector: plan.detector.name.clone(),
        detectors: plan.detectors,
        presses: plan.presses,
        frames: FRAMES.to_vec(),
        curves,
    })
}
