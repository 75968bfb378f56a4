//! Block sparse Bayesian learning: the 16 grounds are 16 looks at the contacts.
//!
//! Whatever the force, the readings of ground `g` are linear in the currents `x_g` that the contacts then carry: `y_g = L_g Q x_g`
//! ([`crate::solve::fit::linear`]), with `Q` of 16 rows. The currents change from ground to ground, the places do not: many measurement
//! vectors of one support. A contact covers a block of surface, a bump of known shape around any node of a coarse mesh, so `x_g`
//! are amounts of such bumps. The prior of the amounts is normal with variance `gamma_k` for bump `k`, the same for all looks, and
//! `gamma` is what makes the readings likeliest (Tipping's sparse Bayesian learning for many vectors: Wipf and Rao, "An empirical
//! Bayesian strategy for solving the simultaneous sparse approximation problem", 2007; with blocks that overlap: Zhang and Rao,
//! "Extension of SBL algorithms for the recovery of block sparse signals with intra-block correlation", 2013). Each step is
//!
//! ```text
//! S_g = sigma^2 + L_g (Q G Q') L_g'    v_g = L_g' S_g^-1 y_g
//! gamma_k <- gamma_k sqrt( q_k' (sum_g v_g v_g') q_k / q_k' (sum_g L_g' S_g^-1 L_g) q_k )
//! ```
//!
//! which lowers `sum_g log det S_g + y_g' S_g^-1 y_g` (convex bounding: Wipf and Nagarajan, "Iterative reweighted l1 and l2 methods",
//! 2010). All is of 16 dimensions, so that a step costs about as much as an image. The image is the mean of `x_g` over the looks,
//! each scaled by its load as Tikhonov's is.

use nalgebra::{Cholesky, DMatrix, DVector};

use crate::solve::answer::{Flags, Solution, SolveError, check};
use crate::solve::fit::balance;
use crate::solve::fit::linear::{readings_of_sources, sources_of_nodes};
use crate::solve::fit::locate::Locator;
use crate::solve::problem::Problem;
use crate::solve::solver::Solver;
use tactomo_physics::forward::{ForwardError, ImageMesh};
use tactomo_physics::readings::Readings;
use tactomo_physics::space;

/// Bumps, about.
const BUMPS: usize = 900;
/// Radius of a bump (standard deviation), in mean distances of electrodes.
const RADIUS: f64 = 0.1;
/// What the model does not know, as a share of the readings' root mean square.
const UNKNOWN_SHARE: f64 = 0.003;
/// Steps of a frame.
const STEPS: usize = 40;
/// A step that changes no variance by more than this share of the largest is the last.
const SETTLED_VARIANCE: f64 = 1e-3;

/// Block sparse Bayesian learning.
pub struct Bsbl {
    drive_v: f64,
    noise_v: f64,
    /// `L_g` for each ground (V).
    looks: Vec<DMatrix<f64>>,
    /// `q_k` of each bump of 1 S: sources x bumps.
    bumps: DMatrix<f64>,
    /// Of each bump: nodes and the density there (S/m2 for 1 S).
    shapes: Vec<Vec<(u32, f32)>>,
    nodes: usize,
    locator: Locator,
}

/// What the looks say, given the variances.
struct Evidence {
    /// `v_g`, a column each.
    pulls: DMatrix<f64>,
    /// `sum_g L_g' S_g^-1 L_g`.
    weights: DMatrix<f64>,
}

impl Bsbl {
    /// Makes it ready for a problem.
    ///
    /// # Errors
    /// [`ForwardError`] if the model cannot give a coarse mesh.
    pub fn new(problem: &Problem) -> Result<Self, ForwardError> {
        let jacobian = &problem.jacobian;
        let mesh = &jacobian.image_mesh;
        let electrodes = jacobian.electrodes();
        let all = readings_of_sources(jacobian);
        let looks = (0..electrodes).map(|g| all.rows(g * electrodes, electrodes).into_owned()).collect();
        let coarse = problem.model.on_image_of(BUMPS.min(mesh.nodes_m.len()))?;
        let radius_m = RADIUS * problem.spacing_m();
        let shapes = shapes(coarse.image_mesh(), mesh, radius_m);
        let sources = sources_of_nodes(jacobian);
        let mut bumps = DMatrix::zeros(electrodes, shapes.len());
        for (mut bump, shape) in bumps.column_iter_mut().zip(&shapes) {
            for &(node, density) in shape {
                bump += sources.row(node as usize).transpose() * f64::from(density);
            }
        }
        Ok(Self {
            drive_v: jacobian.detector.drive_v,
            noise_v: jacobian.detector.adc.deviation_v(),
            looks,
            bumps,
            shapes,
            nodes: mesh.nodes_m.len(),
            locator: Locator::new(mesh, &jacobian.detector),
        })
    }

    /// Rows of readings (V), within the drive, each scaled by its load.
    fn rows(&self, readings: &Readings) -> Vec<DVector<f64>> {
        let mut volts: Vec<f64> =
            readings.volts().iter().map(|volts| volts.clamp(-self.drive_v, self.drive_v)).collect();
        balance::balance(&mut volts, self.looks.len(), self.drive_v);
        volts.chunks_exact(self.looks.len()).map(DVector::from_column_slice).collect()
    }

    /// `Q G Q'`.
    fn prior(&self, variances: &DVector<f64>) -> DMatrix<f64> {
        let mut scaled = self.bumps.clone();
        for (mut column, variance) in scaled.column_iter_mut().zip(variances) {
            column *= *variance;
        }
        scaled * self.bumps.transpose()
    }

    fn evidence(&self, rows: &[DVector<f64>], variances: &DVector<f64>, deviation_v: f64) -> Option<Evidence> {
        let size = self.looks.len();
        let prior = self.prior(variances);
        let mut pulls = DMatrix::zeros(size, size);
        let mut weights = DMatrix::zeros(size, size);
        for (g, (look, row)) in self.looks.iter().zip(rows).enumerate() {
            let mut covariance = look * &prior * look.transpose();
            (0..size).for_each(|e| covariance[(e, e)] += deviation_v * deviation_v);
            let factor = Cholesky::new(covariance)?;
            pulls.set_column(g, &look.tr_mul(&factor.solve(row)));
            weights += look.tr_mul(&factor.solve(look));
        }
        Some(Evidence { pulls, weights })
    }

    /// One over the variance of an even prior: so that the looks are as large as it says.
    fn begin(&self, rows: &[DVector<f64>]) -> DVector<f64> {
        let even = self.prior(&DVector::from_element(self.shapes.len(), 1.0));
        let foretold: f64 = self.looks.iter().map(|look| (look * &even * look.transpose()).trace()).sum();
        let found: f64 = rows.iter().map(|row| row.norm_squared()).sum();
        DVector::from_element(self.shapes.len(), found / foretold.max(f64::MIN_POSITIVE))
    }

    /// Learns the variances; the mean amount of each bump (S) and whether the end was reached.
    fn learn(&self, rows: &[DVector<f64>], deviation_v: f64) -> (DVector<f64>, bool) {
        let mut variances = self.begin(rows);
        let mut settled = false;
        for _ in 0..STEPS {
            let Some(evidence) = self.evidence(rows, &variances, deviation_v) else { break };
            let pulls = self.bumps.tr_mul(&evidence.pulls);
            let weights = self.bumps.component_mul(&(&evidence.weights * &self.bumps));
            let largest = variances.amax();
            let mut change = 0.0f64;
            for (k, variance) in variances.iter_mut().enumerate() {
                let ratio = pulls.row(k).norm_squared() / weights.column(k).sum().max(f64::MIN_POSITIVE);
                let next = *variance * ratio.sqrt();
                change = change.max((next - *variance).abs());
                *variance = if next.is_finite() { next } else { 0.0 };
            }
            settled = change < SETTLED_VARIANCE * largest;
            if settled {
                break;
            }
        }
        (self.amounts(rows, &variances, deviation_v), settled)
    }

    /// Mean over the looks of the likeliest amounts (S), where above zero.
    fn amounts(&self, rows: &[DVector<f64>], variances: &DVector<f64>, deviation_v: f64) -> DVector<f64> {
        let Some(evidence) = self.evidence(rows, variances, deviation_v) else {
            return DVector::zeros(variances.len());
        };
        let means = self.bumps.tr_mul(&evidence.pulls.column_mean());
        means.zip_map(variances, |mean, variance| (mean * variance).max(0.0))
    }

    fn image(&self, amounts: &DVector<f64>) -> Vec<f32> {
        let mut image = vec![0.0; self.nodes];
        for (shape, &amount) in self.shapes.iter().zip(amounts) {
            shape.iter().for_each(|&(node, density)| image[node as usize] += density * amount as f32);
        }
        image
    }

    /// Root mean square of what the amounts leave of the rows (V).
    fn left_v(&self, rows: &[DVector<f64>], amounts: &DVector<f64>) -> f64 {
        let sources = &self.bumps * amounts;
        let squares: f64 = self.looks.iter().zip(rows).map(|(look, row)| (row - look * &sources).norm_squared()).sum();
        squares.sqrt() / rows.len() as f64
    }
}

impl Solver for Bsbl {
    fn name(&self) -> &'static str {
        "bsbl"
    }

    fn solve(&mut self, readings: &Readings) -> Result<Solution, SolveError> {
        check(readings, self.looks.len())?;
        let rows = self.rows(readings);
        let is_rest = self.locator.is_rest(readings);
        let size_v = (rows.iter().map(|row| row.norm_squared()).sum::<f64>()).sqrt() / rows.len() as f64;
        let deviation_v = self.noise_v.hypot(UNKNOWN_SHARE * size_v);
        let (amounts, settled) =
            if is_rest { (DVector::zeros(self.shapes.len()), true) } else { self.learn(&rows, deviation_v) };
        let image = self.image(&amounts);
        Ok(Solution {
            contacts: if is_rest { Vec::new() } else { self.locator.peaks(&image) },
            image_s_per_m2: Some(image),
            residual: Some(self.left_v(&rows, &amounts) / self.noise_v),
            flags: Flags { unfinished: !settled, ..Flags::default() },
            ..Solution::default()
        })
    }
}

/// Bumps around the nodes of a coarse mesh, on a finer one: normal, of an integral of 1 within the detector.
fn shapes(coarse: &ImageMesh, mesh: &ImageMesh, radius_m: f64) -> Vec<Vec<(u32, f32)>> {
    let bump = |centre: usize| {
        let at = coarse.place_m(centre);
        let height = |node: usize| (-0.5 * (space::distance(mesh.place_m(node), at) / radius_m).powi(2)).exp();
        let heights = (0..mesh.nodes_m.len()).map(|node| (node, height(node))).filter(|(_, height)| *height > 1e-3);
        let heights: Vec<_> = heights.collect();
        let whole_m2: f64 = heights.iter().map(|&(node, height)| height * mesh.node_areas_m2[node]).sum();
        heights.into_iter().map(|(node, height)| (node as u32, (height / whole_m2) as f32)).collect()
    };
    (0..coarse.nodes_m.len()).map(bump).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use tactomo_physics::detector::Detector;
    use tactomo_physics::forward::shell::Shell;
    use tactomo_physics::forward::{ForwardModel, Resolution, Slab, readings_v};
    use tactomo_physics::scene::Contact;
    use tactomo_physics::simulate::{Noise, measured};

    fn problem() -> Problem {
        let detector = Detector::preset(Detector::DEFAULT).unwrap();
        Problem::new(Box::new(Slab::new(&detector).unwrap()) as Box<dyn ForwardModel>)
    }

    #[test]
    fn two_firm_contacts_are_distinguished() {
        let detector = Detector::preset(Detector::DEFAULT).unwrap();
        let slab = Slab::with_resolution(&detector, Resolution::FINE).unwrap();
        let truth = [Contact::flat(0.012, 0.005, 0.002, 5e-4), Contact::flat(-0.013, -0.007, 0.002, 5e-4)];
        let exact = readings_v(&slab.impedance_ohm(&truth).unwrap(), &detector);
        let readings = measured(&exact, &detector.adc, &mut Noise::new(1));
        let mut solver = Bsbl::new(&problem()).unwrap();
        let found = solver.solve(&readings).unwrap().contacts;
        assert_eq!(found.len(), 2, "{found:?}");
        for contact in truth {
            let off = |found: &crate::solve::FoundContact| (found.x_m - contact.x_m).hypot(found.y_m - contact.y_m);
            assert!(found.iter().map(off).fold(f64::INFINITY, f64::min) < 0.003, "{found:?}");
        }
    }

    #[test]
    fn the_currents_of_a_firm_contact_are_linear_in_each_look() {
        let detector = Detector::preset(Detector::DEFAULT).unwrap();
        let shell = Shell::with_nodes(&detector, 900).unwrap();
        let node = 300;
        let image_s = shell.image_mesh().image_with([(node, 1.0)]);
        let fields = shell.image_fields(&image_s).unwrap();
        let readings = readings_v(&fields.impedance_ohm, &detector);
        let problem = Problem::new(Box::new(shell) as Box<dyn ForwardModel>);
        let solver = Bsbl::new(&problem).unwrap();
        let area_m2 = problem.jacobian.image_mesh.node_areas_m2[node];
        let unit = sources_of_nodes(&problem.jacobian).row(node).transpose() / area_m2;
        for (g, look) in solver.looks.iter().enumerate() {
            let row = DVector::from_fn(16, |e, _| readings.at(g, e));
            let one = look * &unit;
            let current = one.dot(&row) / one.norm_squared();
            assert!((row - one * current).amax() < 1e-6 * detector.drive_v, "ground {g}");
        }
    }
}
