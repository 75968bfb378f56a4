//! The linear theory through the few dimensions that readings have: what every linear method shares.
//!
//! An image of contact conductance per area `c` on nodes of areas `A` gives the readings `J A c`. `J` factors into `L`,
//! `256 x 16` (differences of readings), times `Q`, `16 x nodes` (fields, and one row for the total conductance). A prior `W`
//! says how large an image is, `c' W c`. With `L = Q1 R1` and `W^-1 A Q' = V R`, `V' W V = 1`, both thin, the SVD of the
//! `16 x 16` matrix `R1 R'` gives that of `J A` between images measured by `W` and readings. Exact, for any prior; a frame then
//! costs 256 x 16 and 16 x nodes products rather than 256 x nodes.

use nalgebra::DMatrix;

use super::balance;
use crate::solve::answer::{Flags, SolveError, check};
use crate::solve::fit::lambda::Spectrum;
use crate::solve::fit::policy;
use tactomo_physics::detector::Detector;
use tactomo_physics::forward::jacobian::Jacobian;
use tactomo_physics::readings::Readings;

/// Singular value decomposition of `J A`.
pub struct Decomposition {
    /// `electrodes^2 x rank`, orthonormal: what readings can be in the linear theory.
    pub readings: DMatrix<f64>,
    /// Falling. For the prior that is the integral of the image's square: V m / S.
    pub singular_values: Vec<f64>,
    /// `nodes x rank`: the images that give them (S/m2), orthonormal by the prior.
    pub images: DMatrix<f64>,
}

impl Decomposition {
    /// That for images measured by the integral of their square, `c' A c`.
    pub fn of(jacobian: &Jacobian) -> Self {
        let areas_m2 = &jacobian.image_mesh.node_areas_m2;
        Self::with_prior(jacobian, |sources| {
            DMatrix::from_fn(sources.nrows(), sources.ncols(), |node, source| sources[(node, source)] / areas_m2[node])
        })
    }

    /// That for any prior `W`, symmetric and positive definite: `inverse` gives `W^-1` times the columns of a matrix of a row a
    /// node.
    pub fn with_prior(jacobian: &Jacobian, inverse: impl FnOnce(&DMatrix<f64>) -> DMatrix<f64>) -> Self {
        let readings = readings_of_sources(jacobian).qr();
        let sources = sources_of_nodes(jacobian);
        let mut images = inverse(&sources);
        let triangle = orthonormalise(&mut images, sources);
        let mut core = (readings.r() * triangle.transpose()).svd(true, true);
        core.sort_by_singular_values();
        let none = || DMatrix::zeros(0, 0);
        let (u, v_t) = (core.u.unwrap_or_else(none), core.v_t.unwrap_or_else(none));
        Self {
            readings: readings.q() * u,
            singular_values: core.singular_values.iter().copied().collect(),
            images: images * v_t.transpose(),
        }
    }
}

/// Makes the columns `T` of `images` orthonormal by the prior, `V`, and returns `R` of `T = V R`. `duals` is `W T`, so that no
/// product with `W` is needed: Gram and Schmidt's method, twice, which keeps them orthogonal to rounding.
fn orthonormalise(images: &mut DMatrix<f64>, mut duals: DMatrix<f64>) -> DMatrix<f64> {
    let columns = images.ncols();
    let mut triangle = DMatrix::zeros(columns, columns);
    for j in 0..columns {
        for _ in 0..2 {
            for i in 0..j {
                let share = images.column(i).dot(&duals.column(j));
                triangle[(i, j)] += share;
                subtract(images, share, i, j);
                subtract(&mut duals, share, i, j);
            }
        }
        let norm = images.column(j).dot(&duals.column(j)).max(0.0).sqrt();
        triangle[(j, j)] = norm;
        let scale = if norm > 0.0 { 1.0 / norm } else { 0.0 };
        images.column_mut(j).scale_mut(scale);
        duals.column_mut(j).scale_mut(scale);
    }
    triangle
}

/// Takes `share` of column `i` from column `j`, `i` before `j`.
fn subtract(matrix: &mut DMatrix<f64>, share: f64, i: usize, j: usize) {
    let (before, mut from) = matrix.columns_range_pair_mut(i, j);
    from.axpy(-share, &before, 1.0);
}

/// `electrodes^2 x electrodes`: readings (V) for each source. Source `i` is the field at electrode `i` less that at the last,
/// summed over all conductance (A/V of contact times ohm); the last source is the total conductance (S).
pub(crate) fn readings_of_sources(jacobian: &Jacobian) -> DMatrix<f64> {
    let electrodes = jacobian.electrodes();
    let drive_v = jacobian.detector.drive_v;
    DMatrix::from_fn(electrodes * electrodes, electrodes, |row, source| {
        let (g, e) = (row / electrodes, row % electrodes);
        if source == electrodes - 1 {
            drive_v * jacobian.total_ohm(g, e)
        } else {
            drive_v * (f64::from(u8::from(source == e)) - f64::from(u8::from(source == g)))
        }
    })
}

/// `nodes x electrodes`, `A Q'`: what a density of 1 S/m2 at each node gives to each source.
pub(crate) fn sources_of_nodes(jacobian: &Jacobian) -> DMatrix<f64> {
    let electrodes = jacobian.electrodes();
    let fields = &jacobian.fields_ohm;
    let areas_m2 = &jacobian.image_mesh.node_areas_m2;
    DMatrix::from_fn(fields.nrows(), electrodes, |node, source| {
        let ohm = if source == electrodes - 1 { 1.0 } else { fields[(node, source)] - fields[(node, electrodes - 1)] };
        ohm * areas_m2[node]
    })
}

/// Smallest reading (V) that says nothing.
pub(crate) fn full_v(detector: &Detector) -> f64 {
    policy::FULL_SHARE * detector.adc.full_scale_v.min(detector.drive_v)
}

/// Singular images that are added together: a pass over the image costs more than its sums.
const TOGETHER: usize = 4;

/// What is done to the readings before an image is made of them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Force {
    /// It is taken out of them, so that a firm contact is where a light one is. The image of one contact then has the
    /// conductance of contact and detector in series.
    Balanced,
    /// They are taken as they are.
    AsRead,
}

/// The decomposition, ready for frames.
pub struct LinearImage {
    electrodes: usize,
    drive_v: f64,
    noise_v: f64,
    /// Smallest reading (V) that says nothing.
    full_v: f64,
    singular_values: Vec<f64>,
    /// `rank x electrodes^2`, row by row: from readings to coefficients.
    to_coefficients: Vec<f32>,
    nodes: usize,
    /// `nodes x rank`, column by column: from coefficients to the image (S/m2). With columns of zeros up to a multiple of
    /// those that are added together.
    to_image: Vec<f32>,
}

impl LinearImage {
    /// Makes it ready for a detector.
    pub fn new(jacobian: &Jacobian, decomposition: Decomposition) -> Self {
        let Decomposition { readings, singular_values, images } = decomposition;
        let single = |matrix: &DMatrix<f64>| matrix.iter().map(|&value| value as f32).collect::<Vec<f32>>();
        let (nodes, rank) = images.shape();
        let mut to_image = single(&images);
        to_image.resize(nodes * rank.next_multiple_of(TOGETHER), 0.0);
        Self {
            electrodes: jacobian.electrodes(),
            drive_v: jacobian.detector.drive_v,
            noise_v: jacobian.detector.adc.deviation_v(),
            full_v: full_v(&jacobian.detector),
            singular_values,
            to_coefficients: single(&readings),
            nodes,
            to_image,
        }
    }

    /// Singular values of the decomposition, falling.
    pub fn singular_values(&self) -> &[f64] {
        &self.singular_values
    }

    /// The readings in terms of those that images can give.
    ///
    /// Readings are held within the drive voltage, up and down, as voltages less those at rest are.
    ///
    /// # Errors
    /// [`SolveError`] if the readings are of another number of electrodes or not finite.
    pub fn spectrum(&self, readings: &Readings, force: Force) -> Result<Spectrum<'_>, SolveError> {
        check(readings, self.electrodes)?;
        let mut volts = readings.volts().to_vec();
        volts.iter_mut().for_each(|volts| *volts = volts.clamp(-self.drive_v, self.drive_v));
        if force == Force::Balanced {
            balance::balance(&mut volts, self.electrodes, self.drive_v);
        }
        let volts: Vec<f32> = volts.iter().map(|&volts| volts as f32).collect();
        let rows = self.to_coefficients.chunks_exact(volts.len());
        let coefficients_v: Vec<f64> = rows.map(|row| f64::from(dot(row, &volts))).collect();
        let inside_v2: f64 = coefficients_v.iter().map(|value| value * value).sum();
        let all_v2 = f64::from(dot(&volts, &volts));
        Ok(Spectrum {
            singular_values: &self.singular_values,
            coefficients_v,
            outside_v2: (all_v2 - inside_v2).max(0.0),
            readings: volts.len(),
            noise_v: self.noise_v,
        })
    }

    /// What to know of the image of a spectrum.
    pub fn flags(&self, readings: &Readings, spectrum: &Spectrum) -> Flags {
        let beyond = |volts: f64| volts.abs() > self.drive_v;
        let outside_v2 = spectrum.noise_v2();
        let misfit =
            spectrum.outside() > policy::OUTSIDE_SHARE && outside_v2.sqrt() > policy::DOUBT_DEVIATIONS * self.noise_v;
        Flags {
            saturated: readings.largest_v() >= self.full_v,
            misfit: misfit || readings.volts().iter().copied().any(beyond),
            ..Flags::default()
        }
    }

    /// The image of so much of each of its singular images (S/m2 at each node).
    pub fn image_s_per_m2(&self, shares: &[f64]) -> Vec<f32> {
        let mut image = vec![0.0f32; self.nodes];
        for (shares, columns) in shares.chunks(TOGETHER).zip(self.to_image.chunks_exact(TOGETHER * self.nodes)) {
            let [a, b, c, d] = [0, 1, 2, 3].map(|column| &columns[column * self.nodes..][..self.nodes]);
            let [share_a, share_b, share_c, share_d] =
                [0, 1, 2, 3].map(|column| shares.get(column).map_or(0.0, |share| *share as f32));
            for ((((value, a), b), c), d) in image.iter_mut().zip(a).zip(b).zip(c).zip(d) {
                *value += (share_a * a + share_b * b) + (share_c * c + share_d * d);
            }
        }
        image
    }
}

/// Sum of products, in eight lanes so that the processor's vector units can take it.
fn dot(a: &[f32], b: &[f32]) -> f32 {
    let (a_lanes, a_rest) = a.as_chunks::<8>();
    let (b_lanes, b_rest) = b.as_chunks::<8>();
    let mut sums = [0.0f32; 8];
    for (a, b) in a_lanes.iter().zip(b_lanes) {
        for lane in 0..8 {
            sums[lane] += a[lane] * b[lane];
        }
    }
    sums.iter().sum::<f32>() + a_rest.iter().zip(b_rest).map(|(a, b)| a * b).sum::<f32>()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::solve::samples;
    use nalgebra::DVector;

    /// The dense answer to a prior of weights on the diagonal.
    #[test]
    fn a_prior_of_weights_gives_the_dense_solution() {
        let jacobian = samples::jacobian(400);
        let areas_m2 = DVector::from_column_slice(&jacobian.image_mesh.node_areas_m2);
        let weights = DVector::from_fn(areas_m2.len(), |node, _| areas_m2[node] * (1.0 + (node % 7) as f64));
        let decomposition = Decomposition::with_prior(&jacobian, |sources| {
            DMatrix::from_fn(sources.nrows(), sources.ncols(), |node, source| sources[(node, source)] / weights[node])
        });
        let readings = samples::readings(samples::CONTACT);
        let volts = DVector::from_column_slice(readings.volts());
        let lambda = 0.02 * decomposition.singular_values[0];
        let weighted = jacobian.dense() * DMatrix::from_diagonal(&areas_m2);
        let normal = weighted.transpose() * &weighted + DMatrix::from_diagonal(&weights) * lambda.powi(2);
        let dense = normal.cholesky().map(|factor| factor.solve(&(weighted.transpose() * &volts))).unwrap_or_default();
        let inside = decomposition.readings.transpose() * volts;
        let shares = DVector::from_fn(inside.len(), |i, _| {
            let value = decomposition.singular_values[i];
            inside[i] * value / (value * value + lambda * lambda)
        });
        let image = &decomposition.images * shares;
        assert!((&image - &dense).amax() < 1e-8 * dense.amax(), "{}", (&image - &dense).amax());
    }

    #[test]
    fn what_no_image_gives_is_outside() {
        let jacobian = samples::jacobian(400);
        let linear = LinearImage::new(&jacobian, Decomposition::of(&jacobian));
        let node = 123;
        let inside = Readings::from_fn(16, |g, e| 1e-6 * jacobian.volts_per_s(g, e, node));
        let outside = Readings::from_fn(16, |g, e| if (g, e) == (2, 9) { 0.1 } else { 0.0 });
        let share = |readings: &Readings| {
            let spectrum = linear.spectrum(readings, Force::AsRead);
            let all_v2: f64 = readings.volts().iter().map(|volts| volts * volts).sum();
            spectrum.map_or(f64::NAN, |spectrum| spectrum.outside_v2 / all_v2)
        };
        assert!(share(&inside) < 1e-5, "{}", share(&inside));
        assert!(share(&outside) > 0.8, "{}", share(&outside));
    }
}
