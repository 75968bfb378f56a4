//! Image of contact conductance on the full contact physics, by damped Gauss-Newton steps.
//!
//! The image is on a coarse mesh of its own, where each node's conductance is an unknown that cannot be negative and a prior
//! prefers little conductance ([`descent`]). Readings are reduced to their independent numbers ([`data`]). From one frame to the
//! next the descent goes on where it was; the first one begins at even contact all over.

mod data;
mod descent;

use std::sync::Arc;

use nalgebra::DVector;

use self::descent::Scene;
pub(crate) use self::descent::{Complexity, Descent};
use crate::solve::answer::{Flags, Solution, SolveError, check};
use crate::solve::fit::evidence::misfit_limit;
use crate::solve::fit::interpolate::Interpolation;
use crate::solve::fit::linear::full_v;
use crate::solve::fit::locate::Locator;
use crate::solve::fit::policy;
use crate::solve::problem::Problem;
use crate::solve::solver::Solver;
use tactomo_physics::forward::{ForwardError, Patches, readings_v};
use tactomo_physics::readings::Readings;

/// Even contacts that a first frame is compared with: roots of the conductance of a node, in units of the sheet conductance.
const EVEN: [f64; 12] = [0.003, 0.006, 0.01, 0.015, 0.02, 0.03, 0.045, 0.07, 0.1, 0.15, 0.25, 0.5];
/// Error of the model on the coarse mesh, as a share of the largest reading, that is no misfit.
const COARSE_MODEL_ERROR: f64 = 0.0007;

/// How an image is found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NonlinearSettings {
    /// Nodes of the coarse mesh, about.
    pub nodes: usize,
    /// Weight of the prior: what a sheet conductance of contact costs, as a sum of squares of standard deviations.
    pub sparsity: f64,
    /// Error of the forward model, as a share of the largest reading.
    pub model_error: f64,
    /// Images looked at in a first frame, at most.
    pub first_looks: usize,
    /// Images looked at in a further frame, at most.
    pub looks: usize,
}

impl Default for NonlinearSettings {
    /// Best for images of hands and objects on a slab: `examples/images.rs`.
    fn default() -> Self {
        Self { nodes: 400, sparsity: 3.0, model_error: 0.0, first_looks: 60, looks: 4 }
    }
}

/// Makes an image by the full contact physics. Clones share what does not change from frame to frame.
#[derive(Clone)]
pub struct Nonlinear {
    shared: Arc<Shared>,
    last: Option<Descent>,
}

/// What does not change from frame to frame.
struct Shared {
    problem: Problem,
    settings: NonlinearSettings,
    scene: Scene,
    to_image: Interpolation,
    /// Area of each node of the coarse mesh (m2).
    areas_m2: Vec<f64>,
    locator: Locator,
    noise_v: f64,
    /// Readings from here on are saturated (V).
    full_v: f64,
    /// Readings at even contact, for each of [`EVEN`].
    even: Vec<Readings>,
}

/// Readings to fit.
struct Target {
    volts: Vec<f64>,
    /// One over the standard deviation of each (1/V); zero for those that say nothing.
    weights: Vec<f64>,
}

impl Shared {
    /// Makes it ready for a problem.
    ///
    /// # Errors
    /// [`ForwardError`] if the model cannot give a coarse image.
    fn new(problem: &Problem, settings: NonlinearSettings) -> Result<Self, ForwardError> {
        let coarse = problem.model.on_image_of(settings.nodes)?;
        let detector = problem.detector().clone();
        let mesh = coarse.image_mesh();
        let areas_m2 = mesh.node_areas_m2.clone();
        let mean_m2 = areas_m2.iter().sum::<f64>() / areas_m2.len() as f64;
        let unit_s = areas_m2.iter().map(|area_m2| detector.sheet_conductance_s() * area_m2 / mean_m2).collect();
        let full_v = full_v(&detector);
        let noise_v = detector.adc.deviation_v();
        let to_image = Interpolation::new(mesh, &problem.jacobian.image_mesh);
        let locator = Locator::new(&problem.jacobian.image_mesh, &detector);
        let patches = Patches::of(&*coarse)?;
        let scene = Scene { patches, detector, unit_s, sparsity: settings.sparsity };
        let even = EVEN.iter().filter_map(|&root| scene.image(DVector::from_element(areas_m2.len(), root)));
        let even = even.map(|image| readings_v(&image.fields.impedance_ohm, &scene.detector)).collect();
        Ok(Self { problem: problem.clone(), settings, scene, to_image, areas_m2, locator, noise_v, full_v, even })
    }

    /// What is fitted, if the readings can be those of the detector.
    fn checked(&self, readings: &Readings) -> Result<Target, SolveError> {
        check(readings, self.scene.detector.electrodes.len())?;
        Ok(self.target(&self.problem.completed(readings)))
    }

    fn target(&self, readings: &Readings) -> Target {
        let drive_v = self.scene.detector.drive_v;
        let volts: Vec<f64> = readings.volts().iter().map(|volts| volts.clamp(-drive_v, 2.0 * drive_v)).collect();
        let deviation_v = self.noise_v.hypot(self.settings.model_error * readings.largest_v().min(drive_v));
        let weight = |volts: &f64| if *volts < self.full_v { 1.0 / deviation_v } else { 0.0 };
        let weights = volts.iter().map(weight).collect();
        Target { volts, weights }
    }

    /// Even contact all over that is nearest to the readings.
    fn begin(&self, target: &Target) -> Option<Descent> {
        let misfit = |readings: &Readings| -> f64 {
            let left = target.volts.iter().zip(readings.volts()).zip(&target.weights);
            left.map(|((volts, even), weight)| ((volts - even) * weight).powi(2)).sum()
        };
        let nearest = self.even.iter().zip(EVEN).min_by(|a, b| misfit(a.0).total_cmp(&misfit(b.0)))?.1;
        self.scene.image(DVector::from_element(self.areas_m2.len(), nearest)).map(Descent::new)
    }

    /// Mean square of what an image leaves, in deviations.
    fn left(&self, descent: &Descent, target: &Target) -> f64 {
        self.scene.misfit(target, &descent.image.fields) / target.counted().max(1) as f64
    }

    fn solution(&self, descent: &Descent, target: &Target) -> Solution {
        let image_s = self.scene.image_s(&descent.image.roots);
        let densities: Vec<f32> = image_s.iter().zip(&self.areas_m2).map(|(s, area_m2)| (s / area_m2) as f32).collect();
        let image = self.to_image.apply(&densities);
        let counted = target.counted();
        let left = self.left(descent, target);
        let deviation_v = 1.0 / target.weights.iter().copied().fold(0.0, f64::max).max(1.0);
        let flags = Flags {
            saturated: counted < target.volts.len(),
            misfit: left > self.misfit_limit(target),
            unfinished: !descent.settled,
            ..Flags::default()
        };
        Solution {
            contacts: self.locator.peaks(&image),
            image_s_per_m2: Some(image),
            residual: Some(left.sqrt() * deviation_v / self.noise_v),
            flags,
            ..Solution::default()
        }
    }

    /// Mean square of what is left, in what noise makes, above which the readings do not fit.
    fn misfit_limit(&self, target: &Target) -> f64 {
        let model_v = COARSE_MODEL_ERROR * target.volts.iter().copied().fold(0.0, f64::max);
        misfit_limit(target.counted() as f64) * (1.0 + (model_v / self.noise_v).powi(2))
    }

    fn nothing(&self, target: &Target) -> Solution {
        let squares: f64 = target.volts.iter().map(|volts| (volts / self.noise_v).powi(2)).sum();
        Solution {
            image_s_per_m2: Some(self.to_image.apply(&vec![0.0; self.areas_m2.len()])),
            residual: Some((squares / target.volts.len() as f64).sqrt()),
            ..Solution::default()
        }
    }
}

impl Target {
    /// Readings that say something.
    fn counted(&self) -> usize {
        self.weights.iter().filter(|weight| **weight > 0.0).count()
    }
}

impl Nonlinear {
    /// Makes it ready for a problem.
    ///
    /// # Errors
    /// [`ForwardError`] if the model cannot give a coarse image.
    pub fn new(problem: &Problem, settings: NonlinearSettings) -> Result<Self, ForwardError> {
        Ok(Self { shared: Arc::new(Shared::new(problem, settings)?), last: None })
    }

    /// Goes on with the image of the frame before; whether it no longer explains the readings as the last one that was begun anew did.
    pub(crate) fn follow(&mut self, readings: &Readings) -> Result<(Solution, bool), SolveError> {
        let target = self.shared.checked(readings)?;
        let Some(mut descent) = self.last.take() else { return Ok((self.shared.nothing(&target), true)) };
        descent.run(&self.shared.scene, &target, self.shared.settings.looks);
        let solution = self.shared.solution(&descent, &target);
        let left = self.shared.left(&descent, &target);
        // The warm start has to be given up: what is left is no noise, and much more than a fresh start left.
        let is_lost = left > self.shared.misfit_limit(&target) && left > policy::IMAGE_WORSE * descent.begun;
        // A first frame of a finger that lands may leave much; what later ones leave counts.
        descent.begun = descent.begun.min(left);
        self.last = Some(descent);
        Ok((solution, is_lost))
    }

    /// The image that was followed last, as a solution for the readings that it was brought to.
    pub(crate) fn solution(&self, readings: &Readings) -> Result<Solution, SolveError> {
        let target = self.shared.checked(readings)?;
        Ok(match &self.last {
            Some(descent) => self.shared.solution(descent, &target),
            None => self.shared.nothing(&target),
        })
    }

    /// Finds the image anew, from even contact or from where the last one is, whichever is nearer.
    pub(crate) fn begin(&mut self, readings: &Readings) -> Result<Solution, SolveError> {
        let target = self.shared.checked(readings)?;
        let shared = &self.shared;
        let last = self.last.take().map(Descent::cooled);
        let nearer = |a: &Descent, b: &Descent| shared.left(a, &target).total_cmp(&shared.left(b, &target));
        let Some(mut descent) = shared.begin(&target).into_iter().chain(last).min_by(nearer) else {
            return Ok(shared.nothing(&target));
        };
        descent.run(&shared.scene, &target, shared.settings.first_looks);
        descent.begun = shared.left(&descent, &target);
        let solution = shared.solution(&descent, &target);
        self.last = Some(descent);
        Ok(solution)
    }

    /// The image that is followed.
    pub(crate) fn descent(&self) -> Option<&Descent> {
        self.last.as_ref()
    }

    /// What the image that is followed makes of the readings (V), and how much it says.
    pub(crate) fn explains(&self, readings: &Readings) -> Result<Option<(Vec<f64>, Complexity)>, SolveError> {
        let target = self.shared.checked(readings)?;
        let scene = &self.shared.scene;
        Ok(self.last.as_ref().map(|descent| {
            let volts = readings_v(&descent.image.fields.impedance_ohm, &scene.detector).volts().to_vec();
            (volts, descent.complexity(scene, &target))
        }))
    }

    /// Goes on from an image of some frames ago.
    pub(crate) fn go_on_from(&mut self, descent: Option<Descent>) {
        self.last = descent;
    }

    /// Whether readings are no more than noise and quantisation.
    pub(crate) fn is_rest(&self, readings: &Readings) -> bool {
        self.shared.locator.is_rest(&self.shared.problem.completed(readings))
    }
}

impl Solver for Nonlinear {
    fn name(&self) -> &'static str {
        "nonlinear"
    }

    fn solve(&mut self, readings: &Readings) -> Result<Solution, SolveError> {
        let target = self.shared.checked(readings)?;
        if self.is_rest(readings) {
            self.last = None;
            return Ok(self.shared.nothing(&target));
        }
        let (solution, is_lost) = self.follow(readings)?;
        if is_lost { self.begin(readings) } else { Ok(solution) }
    }

    fn reset(&mut self) {
        self.last = None;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::metrics::{Comparison, truth_s_per_m2};
    use tactomo_physics::detector::Detector;
    use tactomo_physics::forward::{ForwardModel, Resolution, Slab, touched_impedance_ohm};
    use tactomo_physics::scene::{Contact, Shape, Touch};
    use tactomo_physics::simulate::{Noise, measured};

    fn detector() -> Detector {
        Detector::preset(Detector::DEFAULT).unwrap()
    }

    fn problem() -> Problem {
        Problem::new(Box::new(Slab::new(&detector()).unwrap()) as Box<dyn ForwardModel>)
    }

    /// As a slab of finer pads, contacts and grid than those inverted reads it, with the converter's noise.
    fn readings(touches: &[Touch]) -> Readings {
        let detector = detector();
        let fine = Slab::with_resolution(&detector, Resolution::FINE).unwrap().on_image(3721);
        let exact = readings_v(&touched_impedance_ohm(&fine, touches).unwrap(), &detector);
        measured(&exact, &detector.adc, &mut Noise::new(3))
    }

    fn ring() -> Touch {
        Touch::flat(
            [0.002, -0.003],
            Shape::Ring { radius_m: 0.013, width_m: 0.003 },
            2.0 * detector().sheet_conductance_s(),
        )
    }

    #[test]
    fn a_ring_has_a_hole_and_its_conductance() {
        let (problem, ring) = (problem(), ring());
        let mut solver = Nonlinear::new(&problem, NonlinearSettings::default()).unwrap();
        let solution = solver.solve(&readings(std::slice::from_ref(&ring))).unwrap();
        let image = solution.image_s_per_m2.unwrap();
        let mesh = &problem.jacobian.image_mesh;
        let truth = truth_s_per_m2(mesh, std::slice::from_ref(&ring)).unwrap();
        let alike = Comparison::new(mesh, 0.002).of(&truth, &image).correlation.unwrap();
        assert!(alike > 0.7, "{alike}");
        assert!(image.iter().all(|&value| value >= 0.0));
        let conductance_s: f64 = image.iter().zip(&mesh.node_areas_m2).map(|(&c, a)| f64::from(c) * a).sum();
        assert!((conductance_s / ring.conductance_s - 1.0).abs() < 0.1, "{conductance_s}");
        assert!(solution.residual.unwrap() < 2.0 && !solution.flags.misfit && !solution.flags.saturated);
    }

    #[test]
    fn further_frames_of_the_same_scene_fit_better_in_few_looks() {
        let settings = NonlinearSettings { first_looks: 12, ..NonlinearSettings::default() };
        let mut solver = Nonlinear::new(&problem(), settings).unwrap();
        let readings = readings(&[ring()]);
        let first = solver.solve(&readings).unwrap();
        assert!(first.flags.unfinished);
        let later = (0..5).map(|_| solver.solve(&readings).unwrap().residual.unwrap()).last().unwrap();
        assert!(later < first.residual.unwrap(), "{later}");
    }

    #[test]
    fn a_press_elsewhere_leaves_nothing_of_the_one_before() {
        let problem = problem();
        let mut solver = Nonlinear::new(&problem, NonlinearSettings::default()).unwrap();
        let places = [[0.018, 0.015], [-0.02, 0.004], [0.003, -0.02], [-0.015, 0.02]];
        for [x_m, y_m] in places {
            let press =
                Touch::flat([x_m, y_m], Shape::Disc { radius_m: 0.005 }, 3.0 * detector().sheet_conductance_s());
            let image = solver.solve(&readings(&[press])).unwrap().image_s_per_m2.unwrap();
            let mesh = &problem.jacobian.image_mesh;
            let of = |node: usize| f64::from(image[node]) * mesh.node_areas_m2[node];
            let is_far = |node: &usize| {
                let [x, y] = mesh.nodes_m[*node];
                (x - x_m).hypot(y - y_m) > 0.015
            };
            let far_s: f64 = (0..image.len()).filter(is_far).map(of).sum();
            let all_s: f64 = (0..image.len()).map(of).sum();
            assert!(far_s < 0.02 * all_s, "{far_s} of {all_s} S are elsewhere");
        }
    }

    #[test]
    fn readings_of_no_scene_and_of_the_drive_itself_are_flagged() {
        let mut solver = Nonlinear::new(&problem(), NonlinearSettings::default()).unwrap();
        let contact = Contact::flat(0.004, -0.011, 0.003, 1e-3);
        let mut swapped = readings(&[contact.into()]);
        for g in 0..16 {
            swapped.volts_mut().swap(16 * g + 3, 16 * g + 9);
        }
        assert!(solver.solve(&swapped).unwrap().flags.misfit);
        solver.reset();
        let full = Readings::from_fn(16, |g, e| if g == e { 0.0 } else { 2.0 });
        assert!(solver.solve(&full).unwrap().flags.saturated);
    }
}
