//! Neumann function between points of one surface of the bare slab.
//!
//! `N(x, x') = sum_mn c_mn G(k_mn) cos cos cos cos / (Lx Ly)` converges slowly: `G ~ 1 / (sigma k)`. As in Ewald's sums,
//! `G = G exp(-k^2 R^2 / 4) + G (1 - exp(-k^2 R^2 / 4))`. The first part has few modes, and as `cos a cos b` is a sum of two
//! cosines it is four look-ups in one table. The second fades within a few `R` or thicknesses: a function of the distance
//! alone, summed over those mirror images that are near.

use std::f64::consts::PI;
use std::sync::{LazyLock, OnceLock};

use nalgebra::{DMatrix, DVector, DVectorView};

use super::disc::{DiscSelf, even_ohm};
use super::quadrature::panels;
use super::spline::{Grid, signs};

/// `k R` at which the smooth part's factor has fallen to 2e-5.
const SMOOTH_END: f64 = 6.6;

/// Table steps in a split length.
const STEPS_IN_SPLIT: f64 = 4.0;

/// Split lengths in which a singular point source is spread, so that sources may touch.
const SPREAD_SHARE: f64 = 0.08;

/// The near part is dropped where it has fallen to this share of `1 / (2 pi sigma R)`.
const NEAR_END: f64 = 1e-5;

/// Steps of the near part's table.
const NEAR_STEPS: usize = 256;

/// One surface of the slab.
#[derive(Clone, Debug)]
pub(super) struct SurfaceGreen {
    size_m: [f64; 2],
    split_m: f64,
    grid: Grid,
    smooth: Vec<f64>,
    near: NearPart,
    spectrum: NearSpectrum,
}

impl SurfaceGreen {
    /// Makes the tables: `response` is the surface's potential per normal current density for a wave number, `floating` what
    /// is left of it at zero, `sheet_s` the sheet conductance, `sigma` the conductivity at the surface.
    pub fn new(size_m: [f64; 2], split_m: f64, surface: &Surface<impl Fn(f64) -> f64>) -> Self {
        let grid = Grid::new(size_m, split_m / STEPS_IN_SPLIT);
        let area_m2 = size_m[0] * size_m[1];
        // The near part's own mean belongs to mode 0; the smooth part carries the rest of the floating response.
        let mean = surface.floating - split_m * split_m / (4.0 * surface.sheet_s);
        let end = SMOOTH_END / split_m;
        let amplitude = |mode: [usize; 2]| {
            let k = grid.wave_number(0, mode[0]).hypot(grid.wave_number(1, mode[1]));
            let value = match k {
                0.0 => mean,
                _ if k < end => (surface.response)(k) * (-0.25 * (k * split_m).powi(2)).exp(),
                _ => 0.0,
            };
            signs(mode) / area_m2 * value
        };
        let [m, n] = [0, 1].map(|axis| (0..=grid.modes(axis)).filter(|m| grid.wave_number(axis, *m) < end).count());
        let smooth = grid.series(&DMatrix::from_fn(n, m, |n, m| amplitude([m, n])));
        Self {
            size_m,
            split_m,
            grid,
            smooth,
            near: NearPart::new(split_m, surface),
            spectrum: NearSpectrum::new(split_m, surface),
        }
    }

    /// Split length `R` (m).
    pub fn split_m(&self) -> f64 {
        self.split_m
    }

    /// Distance beyond which the near part is nothing (m).
    pub fn reach_m(&self) -> f64 {
        self.near.reach_m
    }

    /// Smooth part between two points (ohm); coordinates from the corner (m).
    pub fn smooth_ohm(&self, a: [f64; 2], b: [f64; 2]) -> f64 {
        let taps = |axis: usize| [self.grid.taps(axis, a[axis] - b[axis]), self.grid.taps(axis, a[axis] + b[axis])];
        let (x, y) = (taps(0), taps(1));
        let stride = self.grid.nodes(1);
        let mut sum = 0.0;
        for (row, y_weights) in &y {
            // Four sums side by side, for the processor to do at once.
            let mut lanes = [0.0; 4];
            for (column, x_weights) in &x {
                for (i, weight) in x_weights.iter().enumerate() {
                    let start = (column + i) * stride + row;
                    let line = &self.smooth[start..start + 4];
                    lanes.iter_mut().zip(line).for_each(|(lane, value)| *lane += weight * value);
                }
            }
            sum += lanes.iter().zip(y_weights).map(|(lane, weight)| lane * weight).sum::<f64>();
        }
        0.25 * sum
    }

    /// Smooth part between two points (ohm), and its derivatives by the first one's place (ohm/m).
    fn smooth_with_slopes(&self, a: [f64; 2], b: [f64; 2]) -> [f64; 3] {
        let taps =
            |axis: usize| [a[axis] - b[axis], a[axis] + b[axis]].map(|u_m| self.grid.taps_with_slopes(axis, u_m));
        let (x, y) = (taps(0), taps(1));
        let stride = self.grid.nodes(1);
        let mut sums = [0.0; 3];
        for ((row, y_weights), y_slopes) in &y {
            // Four sums side by side, for the processor to do at once.
            let mut lanes = [[0.0; 4]; 2];
            for ((column, x_weights), x_slopes) in &x {
                for (i, (weight, slope)) in x_weights.iter().zip(x_slopes).enumerate() {
                    let start = (column + i) * stride + row;
                    for (lane, value) in self.smooth[start..start + 4].iter().enumerate() {
                        lanes[0][lane] += weight * value;
                        lanes[1][lane] += slope * value;
                    }
                }
            }
            for lane in 0..4 {
                sums[0] += lanes[0][lane] * y_weights[lane];
                sums[1] += lanes[1][lane] * y_weights[lane];
                sums[2] += lanes[0][lane] * y_slopes[lane];
            }
        }
        sums.map(|sum| 0.25 * sum)
    }

    /// The kernel between a point and another one with its mirror images (ohm), and its derivatives by the first one's place (ohm/m); `same` as
    /// for [`images_ohm`](Self::images_ohm).
    pub fn with_slopes(&self, images: &[Image], same: bool, a: [f64; 2], b: [f64; 2]) -> [f64; 3] {
        let mut all = self.smooth_with_slopes(a, b);
        for image in images.iter().filter(|image| !(same && image.in_place())) {
            let at = image.of(b);
            let way_m = [a[0] - at[0], a[1] - at[1]];
            let distance_m = way_m[0].hypot(way_m[1]);
            let [value, slope] = self.near.with_slope(distance_m);
            all[0] += value;
            (0..2).for_each(|axis| all[1 + axis] += slope * way_m[axis] / distance_m.max(f64::MIN_POSITIVE));
        }
        all
    }

    /// Near part between a point and mirror images of another (ohm); `same`: both are on one disc, of which the singular part is left out.
    pub fn images_ohm(&self, images: &[Image], same: bool, a: [f64; 2], b: [f64; 2]) -> f64 {
        let others = images.iter().filter(|image| !(same && image.in_place()));
        let distance_m = |image: &Image| {
            let at = image.of(b);
            ((a[0] - at[0]).powi(2) + (a[1] - at[1]).powi(2)).sqrt()
        };
        others.map(|image| self.near.at(distance_m(image))).sum()
    }

    /// Self-impedance of a disc on this surface, without the smooth part.
    pub fn disc_self(&self, radius_m: f64) -> DiscSelf {
        DiscSelf::new(radius_m, self.spectrum.sigma, |ln_k| self.spectrum.at(ln_k))
    }

    /// Self-impedance of an even current over a disc (ohm), without the smooth part.
    pub fn even_disc_ohm(&self, radius_m: f64) -> f64 {
        even_ohm(radius_m, self.spectrum.sigma, |ln_k| self.spectrum.at(ln_k))
    }

    /// Mirror images that bring a disc at `b` within reach of a disc at `a`; `gap_m` is added to the reach.
    pub fn images(&self, a: [f64; 2], b: [f64; 2], gap_m: f64) -> Vec<Image> {
        images(self.size_m, a, b, self.reach_m() + gap_m)
    }
}

/// Mirror images in the walls of a rectangle that bring `b` within a distance of `a` (m).
pub(super) fn images(size_m: [f64; 2], a: [f64; 2], b: [f64; 2], reach_m: f64) -> Vec<Image> {
    // Along one direction: sign and offset.
    let along = |axis: usize| {
        let period_m = 2.0 * size_m[axis];
        let turns = (reach_m / period_m) as i32 + 1;
        (-turns..=turns)
            .flat_map(move |turn| [[1.0, f64::from(turn) * period_m], [-1.0, f64::from(turn) * period_m]])
            .filter(move |[sign, offset_m]| (a[axis] - (sign * b[axis] + offset_m)).abs() < reach_m)
    };
    let mut found = Vec::new();
    for [sign_x, offset_x_m] in along(0) {
        for [sign_y, offset_y_m] in along(1) {
            let image = Image { sign: [sign_x, sign_y], offset_m: [offset_x_m, offset_y_m] };
            let at = image.of(b);
            if (a[0] - at[0]).powi(2) + (a[1] - at[1]).powi(2) < reach_m * reach_m {
                found.push(image);
            }
        }
    }
    found
}

/// One mirror image of the plane in the slab's walls.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Image {
    sign: [f64; 2],
    offset_m: [f64; 2],
}

impl Image {
    /// Where the image of a point is (m).
    pub fn of(&self, point: [f64; 2]) -> [f64; 2] {
        [0, 1].map(|axis| self.sign[axis] * point[axis] + self.offset_m[axis])
    }

    /// Of both directions there, seen from here.
    pub fn sign(&self) -> [f64; 2] {
        self.sign
    }

    /// Whether this is the point itself.
    fn in_place(&self) -> bool {
        self.sign == [1.0, 1.0] && self.offset_m == [0.0, 0.0]
    }
}

/// A surface by its response.
pub(super) struct Surface<F: Fn(f64) -> f64> {
    /// Potential per normal current density (ohm m2) for a wave number (1/m).
    pub response: F,
    /// What is left of it at 0 after `1 / (sheet conductance k^2)` (ohm m2).
    pub floating: f64,
    /// Sheet conductance (S).
    pub sheet_s: f64,
    /// Conductivity at the surface (S/m).
    pub sigma: f64,
}

/// The near part by distance, as `r h(r)`, which is regular.
#[derive(Clone, Debug)]
struct NearPart {
    reach_m: f64,
    spread_m: f64,
    values: Vec<f64>,
}

impl NearPart {
    fn new(split_m: f64, surface: &Surface<impl Fn(f64) -> f64>) -> Self {
        let spread_m = SPREAD_SHARE * split_m;
        let spectrum = Spectrum::new(split_m, spread_m, surface);
        let scale = NEAR_END / (2.0 * PI * surface.sigma * split_m);
        let is_end = |reach: &Reach| {
            let near =
                |(share, waves): (f64, DVectorView<'_, f64>)| spectrum.near_ohm(waves, share * reach.splits * split_m);
            AROUND.into_iter().zip(reach.around.column_iter()).all(|pair| near(pair).abs() <= scale)
        };
        let reach = (0..REACHES.len()).map(Reach::of).find(|reach| is_end(reach));
        let reach = reach.unwrap_or_else(|| Reach::of(REACHES.len() - 1));
        let reach_m = reach.splits * split_m;
        let step_m = reach_m / NEAR_STEPS as f64;
        // Beyond the end the function is taken as nothing; the last step leads there.
        let near =
            |(i, waves): (usize, DVectorView<'_, f64>)| i as f64 * step_m * spectrum.near_ohm(waves, i as f64 * step_m);
        let values = reach.waves().column_iter().enumerate().map(near).chain([0.0]).collect();
        Self { reach_m, spread_m, values }
    }

    fn at(&self, distance_m: f64) -> f64 {
        self.with_slope(distance_m)[0]
    }

    /// At a distance (ohm), and its derivative (ohm/m).
    #[inline]
    fn with_slope(&self, distance_m: f64) -> [f64; 2] {
        let spread_m = distance_m.max(self.spread_m);
        let at = spread_m / self.reach_m * NEAR_STEPS as f64;
        let cell = at as usize;
        if cell >= NEAR_STEPS {
            return [0.0; 2];
        }
        let rise = self.values[cell + 1] - self.values[cell];
        let value = (self.values[cell] + rise * (at - cell as f64)) / spread_m;
        let slope = (rise * NEAR_STEPS as f64 / self.reach_m - value) / spread_m;
        [value, if distance_m > self.spread_m { slope } else { 0.0 }]
    }
}

/// The near part by wave number, relative to the half-space's `1 / (sigma k)` and less it: a table over `ln k`.
#[derive(Clone, Debug)]
struct NearSpectrum {
    sigma: f64,
    first_ln_k: f64,
    values: Vec<f64>,
}

/// Steps of that table, and how many of them make a factor of e.
const SPECTRUM_STEPS: [usize; 2] = [512, 32];

impl NearSpectrum {
    fn new(split_m: f64, surface: &Surface<impl Fn(f64) -> f64>) -> Self {
        let first_ln_k = -split_m.ln() - 8.0;
        let values = (0..=SPECTRUM_STEPS[0])
            .map(|i| {
                let k = (first_ln_k + i as f64 / SPECTRUM_STEPS[1] as f64).exp();
                (surface.response)(k) * surface.sigma * k * -(-0.25 * (k * split_m).powi(2)).exp_m1() - 1.0
            })
            .collect();
        Self { sigma: surface.sigma, first_ln_k, values }
    }

    fn at(&self, ln_k: f64) -> f64 {
        let at = ((ln_k - self.first_ln_k) * SPECTRUM_STEPS[1] as f64).clamp(0.0, SPECTRUM_STEPS[0] as f64 - 1.0);
        let (cell, part) = (at as usize, at.fract());
        self.values[cell] + (self.values[cell + 1] - self.values[cell]) * part
    }
}

/// Quadrature of the near part's Hankel transform, less its `1 / (sigma k)`, which has a closed form.
struct Spectrum {
    split_m: f64,
    sigma: f64,
    /// Of each of the [`NODES`].
    weights: DVector<f64>,
}

/// Wave numbers, times the split length, and their weights.
static NODES: LazyLock<Vec<[f64; 2]>> = LazyLock::new(|| {
    // Eight points in a panel resolve J0(k r) over ten radians: fine panels where the layers speak, for a reach of ten split lengths and more, and
    // wider ones for the tail that only a gradient has.
    let edges: Vec<f64> = (0..16).map(|i| 0.5 * f64::from(i)).chain((8..=64).map(f64::from)).collect();
    panels(&edges, 8)
});

/// A distance that the near part may reach, in split lengths, and `J0` of the way there for each of the [`NODES`]. In split lengths both are the
/// same for all slabs, so they are made once.
struct Reach {
    splits: f64,
    /// Of the shares [`AROUND`] the end: `nodes x shares`.
    around: DMatrix<f64>,
    /// Of the steps of a table: `nodes x steps`.
    waves: OnceLock<DMatrix<f64>>,
}

/// Shares of a reach at which the near part has to be nothing: three, so that a zero crossing is not taken for the end.
const AROUND: [f64; 3] = [0.9, 1.0, 1.1];
/// The shortest reach, in split lengths, and how many times longer the next one is; the last of them is 32.
const SHORTEST_REACH: f64 = 3.0;
const NEXT_REACH: f64 = 1.15;
static REACHES: [OnceLock<Reach>; 18] = [const { OnceLock::new() }; 18];

impl Reach {
    fn of(number: usize) -> &'static Self {
        REACHES[number].get_or_init(|| {
            let splits = SHORTEST_REACH * NEXT_REACH.powi(number as i32);
            let around = bessel(AROUND.len(), |i| AROUND[i] * splits);
            Self { splits, around, waves: OnceLock::new() }
        })
    }

    fn waves(&self) -> &DMatrix<f64> {
        self.waves.get_or_init(|| bessel(NEAR_STEPS, |i| self.splits * i as f64 / NEAR_STEPS as f64))
    }
}

/// `J0` of each of the [`NODES`] at some distances, in split lengths.
fn bessel(count: usize, splits: impl Fn(usize) -> f64) -> DMatrix<f64> {
    DMatrix::from_fn(NODES.len(), count, |node, i| libm::j0(NODES[node][0] * splits(i)))
}

impl Spectrum {
    fn new(split_m: f64, spread_m: f64, surface: &Surface<impl Fn(f64) -> f64>) -> Self {
        let window = |k: f64| (-0.25 * (k * spread_m).powi(2)).exp() - (-0.25 * (k * split_m).powi(2)).exp();
        let weight = |[at, weight]: &[f64; 2]| {
            let k = at / split_m;
            weight / split_m * k * ((surface.response)(k) - 1.0 / (surface.sigma * k)) * window(k) / (2.0 * PI)
        };
        Self { split_m, sigma: surface.sigma, weights: NODES.iter().map(weight).collect::<Vec<_>>().into() }
    }

    /// At a distance, by `J0` of it and of each node.
    fn near_ohm(&self, waves: DVectorView<'_, f64>, distance_m: f64) -> f64 {
        // The integral of exp(-k^2 R^2 / 4) J0(k r) over k.
        let s = distance_m * distance_m / (2.0 * self.split_m * self.split_m);
        let smooth = PI.sqrt() / self.split_m * scaled_bessel_i0(s);
        let closed = (1.0 / distance_m.max(1e-9 * self.split_m) - smooth) / (2.0 * PI * self.sigma);
        self.weights.dot(&waves) + closed
    }
}

/// `exp(-x) I0(x)`, by its power series or, for large `x`, its asymptotic one.
fn scaled_bessel_i0(x: f64) -> f64 {
    let mut term = 1.0;
    let mut sum = 1.0;
    if x < 18.0 {
        for i in 1..80 {
            term *= x * x / 4.0 / f64::from(i * i);
            sum += term;
        }
        return sum * (-x).exp();
    }
    for i in 1..12 {
        let odd = f64::from(2 * i - 1);
        term *= odd * odd / (f64::from(8 * i) * x);
        sum += term;
    }
    sum / (2.0 * PI * x).sqrt()
}
