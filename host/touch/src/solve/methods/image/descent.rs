//! Damped Gauss-Newton steps towards the conductances that explain the readings.
//!
//! Unknown is the root `x` of each node's conductance, `C = x^2` in units of the sheet conductance, so that no conductance is negative.
//! The sum minimised is `|L^-1 M' dV|^2 + s |x|^2` ([`super::data`]); as `|x|^2` is the total conductance, the prior is that of sparse
//! images (the l1 norm of what cannot be negative), and in `x` it is quadratic. A step solves
//! `(A' A + (s + d)) dx = A' r - s x` with `A` the data's derivatives and `d` the damping (Levenberg; the damping follows the
//! ratio of the gain to that foretold, Nielsen, "Damping parameter in Marquardt's method", 1999). Nodes whose conductance
//! vanishes drop out, and come back where the sum would fall with more: so a step costs what the touched surface costs.

use nalgebra::{DMatrix, DVector};

use super::Target;
use super::data::Data;
use tactomo_physics::algebra::{Cholesky, gram, gram_of_rows};
use tactomo_physics::detector::Detector;
use tactomo_physics::forward::{ContactFields, Patches, readings_v};

/// Roots below this share of the largest are taken as none: together they conduct less than noise shows.
const SMALLEST: f64 = 3e-3;
/// Root with which a node comes back, as a share of the largest.
const SEED: f64 = 1e-2;
/// Largest change of a root in a step: beyond the sheet conductance a contact is nearly a short circuit.
const LARGEST_STEP: f64 = 1.0;
/// Largest root: a conductance that makes no difference to a better one.
const LARGEST: f64 = 10.0;
/// First damping, as a share of the largest square of a column of `A`.
const FIRST_DAMPING: f64 = 1e-2;
/// Damping grows by this after a step that was none, and shrinks by that after one that went as foretold.
const GROWTH: f64 = 4.0;
const SHRINKAGE: f64 = 0.3;
/// Steps that gain less than this share of the sum are the last.
const SETTLED: f64 = 2e-3;

/// What does not change from frame to frame.
pub(super) struct Scene {
    pub patches: Patches,
    pub detector: Detector,
    /// Conductance of each node for a root of 1 (S): a sheet conductance for a node of mean area.
    pub unit_s: Vec<f64>,
    /// Weight `s` of the prior.
    pub sparsity: f64,
}

/// An image on the way, with its fields.
#[derive(Clone, Debug)]
pub(super) struct Image {
    /// Roots of the conductances.
    pub roots: DVector<f64>,
    pub fields: ContactFields,
}

/// How far a descent came.
#[derive(Clone, Debug)]
pub(crate) struct Descent {
    pub(super) image: Image,
    damping: Option<f64>,
    /// Whether further steps would gain little.
    pub(super) settled: bool,
    /// Mean square that it left when it was last begun anew.
    pub(super) begun: f64,
}

/// How much an image says.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Complexity {
    /// Numbers that the readings determine.
    pub determined: f64,
    /// What saying them costs, in squares of deviations.
    pub price: f64,
}

impl Scene {
    /// Conductances (S).
    pub fn image_s(&self, roots: &DVector<f64>) -> Vec<f64> {
        roots.iter().zip(&self.unit_s).map(|(root, unit_s)| root * root * unit_s).collect()
    }

    /// An image with its fields; `None` if nothing conducts.
    pub fn image(&self, roots: DVector<f64>) -> Option<Image> {
        let fields = self.patches.fields(&self.image_s(&roots))?;
        Some(Image { roots, fields })
    }

    /// Sum of squares of what is left of the readings, in deviations.
    pub fn misfit(&self, target: &Target, fields: &ContactFields) -> f64 {
        let model = readings_v(&fields.impedance_ohm, &self.detector);
        let left = target.volts.iter().zip(model.volts()).zip(&target.weights);
        left.map(|((volts, model), weight)| ((volts - model) * weight).powi(2)).sum()
    }

    fn sum(&self, target: &Target, image: &Image) -> f64 {
        self.misfit(target, &image.fields) + self.sparsity * image.roots.norm_squared()
    }
}

impl Descent {
    /// How many numbers the readings determine of the image, and what it costs to say them.
    pub(super) fn complexity(&self, scene: &Scene, target: &Target) -> Complexity {
        Linear::new(scene, target, &self.image).complexity()
    }

    /// Begins at an image.
    pub(super) fn new(image: Image) -> Self {
        Self { image, damping: None, settled: false, begun: f64::INFINITY }
    }

    /// The same image with the damping of a first step.
    pub(super) fn cooled(self) -> Self {
        Self::new(self.image)
    }

    /// Steps until it settles or has looked at so many images.
    pub(super) fn run(&mut self, scene: &Scene, target: &Target, mut looks: usize) {
        self.settled = false;
        let mut now = scene.sum(target, &self.image);
        while looks > 0 && !self.settled {
            let model = Linear::new(scene, target, &self.image);
            let mut damping = self.damping.unwrap_or_else(|| model.first_damping());
            loop {
                looks -= 1;
                let better = model.step(damping).and_then(|step| model.gain(scene, target, &step, now));
                if let Some(Gain { image, sum, ratio }) = better {
                    damping *= if ratio > 0.75 {
                        SHRINKAGE
                    } else if ratio < 0.25 {
                        2.0
                    } else {
                        1.0
                    };
                    self.settled = now - sum < SETTLED * now;
                    (self.image, now) = (image, sum);
                    break;
                }
                damping *= GROWTH;
                if looks == 0 {
                    break;
                }
            }
            self.damping = Some(damping.clamp(f64::MIN_POSITIVE, f64::MAX));
        }
    }
}

/// The readings near an image.
struct Linear {
    /// Nodes that conduct, or would better.
    nodes: Vec<usize>,
    /// Their roots.
    roots: DVector<f64>,
    /// All roots as they are.
    all: DVector<f64>,
    /// `A`: data x nodes.
    derivatives: DMatrix<f64>,
    /// `A' r - s x`.
    pull: DVector<f64>,
    sparsity: f64,
    /// `A' A` or, if the data are fewer, `A A'`: lower triangle.
    squares: DMatrix<f64>,
}

/// A step that was worth it.
struct Gain {
    image: Image,
    sum: f64,
    /// Over that foretold.
    ratio: f64,
}

impl Linear {
    fn new(scene: &Scene, target: &Target, image: &Image) -> Self {
        let data = Data::new(target, &image.fields.impedance_ohm, &scene.detector);
        let slopes_per_s = data.slopes_per_s(&image.fields);
        let wanted = |node: usize| slopes_per_s[node] * scene.unit_s[node] + scene.sparsity < 0.0;
        let nodes: Vec<_> = (0..image.roots.len()).filter(|&node| image.roots[node] != 0.0 || wanted(node)).collect();
        let seed = SEED * image.roots.amax();
        let root = |&node: &usize| if image.roots[node] == 0.0 { seed } else { image.roots[node] };
        let roots = DVector::from_iterator(nodes.len(), nodes.iter().map(root));
        let mut derivatives = DMatrix::zeros(data.len(), nodes.len());
        for ((mut column, &node), root) in derivatives.column_iter_mut().zip(&nodes).zip(&roots) {
            data.derivative(&image.fields, node, 2.0 * root * scene.unit_s[node], column.as_mut_slice());
        }
        let pull = derivatives.tr_mul(&data.residual) - &roots * scene.sparsity;
        let squares = if nodes.len() <= data.len() { gram(&derivatives) } else { gram_of_rows(&derivatives) };
        let all = image.roots.clone();
        Self { nodes, roots, all, derivatives, pull, sparsity: scene.sparsity, squares }
    }

    fn first_damping(&self) -> f64 {
        let largest = self.derivatives.column_iter().map(|column| column.norm_squared()).fold(0.0, f64::max);
        FIRST_DAMPING * largest
    }

    /// With `l` the eigenvalues of `A' A`, the trace of `A (A' A + s)^-1 A'` is the sum of `l / (l + s)`, what the prior leaves of as many
    /// unknowns; and twice the logarithm of the evidence loses the sum of `ln(1 + l / s)` and `s |x|^2` (Laplace's approximation).
    fn complexity(&self) -> Complexity {
        let size = self.squares.nrows();
        let mut matrix = self.squares.clone();
        (0..size).for_each(|i| matrix[(i, i)] += self.sparsity);
        let prior = self.sparsity * self.roots.norm_squared();
        let Ok(factor) = Cholesky::new(matrix) else {
            return Complexity { determined: size as f64, price: f64::INFINITY };
        };
        let over_prior: f64 = factor.diagonal().iter().map(|l| 2.0 * l.ln() - self.sparsity.ln()).sum();
        let left = self.sparsity * factor.inverse_diagonal().sum();
        Complexity { determined: size as f64 - left, price: prior + over_prior }
    }

    /// `(A' A + (s + d))^-1` times the pull, in the smaller of both spaces.
    fn step(&self, damping: f64) -> Option<DVector<f64>> {
        let (data, nodes) = self.derivatives.shape();
        let ridge = self.sparsity + damping;
        let mut matrix = self.squares.clone();
        (0..matrix.nrows()).for_each(|i| matrix[(i, i)] += ridge);
        let factor = Cholesky::new(matrix).ok()?;
        let solved = |mut right: DVector<f64>| {
            factor.solve(&mut right);
            right
        };
        let mut step = if nodes <= data {
            solved(self.pull.clone())
        } else {
            // (A' A + r)^-1 b = (b - A' (A A' + r)^-1 A b) / r.
            (&self.pull - self.derivatives.tr_mul(&solved(&self.derivatives * &self.pull))) / ridge
        };
        let largest = step.amax();
        if largest > LARGEST_STEP {
            step *= LARGEST_STEP / largest;
        }
        step.iter().all(|change| change.is_finite()).then_some(step)
    }

    /// The image after a step, if that lowers the sum.
    fn gain(&self, scene: &Scene, target: &Target, step: &DVector<f64>, now: f64) -> Option<Gain> {
        let mut roots = self.all.clone();
        for (k, &node) in self.nodes.iter().enumerate() {
            roots[node] = (self.roots[k] + step[k]).clamp(-LARGEST, LARGEST);
        }
        let floor = SMALLEST * roots.amax();
        roots.iter_mut().filter(|root| root.abs() < floor).for_each(|root| *root = 0.0);
        let image = scene.image(roots)?;
        let sum = scene.sum(target, &image);
        let along = &self.derivatives * step;
        let foretold = 2.0 * self.pull.dot(step) - along.norm_squared() - self.sparsity * step.norm_squared();
        (sum < now).then(|| Gain { image, sum, ratio: (now - sum) / foretold.max(f64::MIN_POSITIVE) })
    }
}
