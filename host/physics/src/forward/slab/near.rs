//! Fields of pads on the top of a layer that is thin against them.
//!
//! Through a thin layer a pad's rim is seen sharply, and a table of its field all over the top would need steps as fine as the thickness. As in
//! [`green`](super::green), the response across is split by `exp(-k^2 R^2 / 4)`, here with `R` about a pad's radius: the smooth part has few modes,
//! and the rest fades within a few `R`. There the field of the density `R_n^m(rho) cos(m theta) / (pi a^2)` at `(r, theta)` is, on a plane without
//! ends,
//!
//! ```text
//! (-1)^((n - m) / 2) cos(m theta) / pi  integral tb(k) (1 - exp(-k^2 R^2 / 4)) J_(n+1)(k a) / (k a) J_m(k r) k dk
//! ```
//!
//! a function of the distance alone, that pads of one radius and contact share. Mirror images in the walls do the rest. The orders that are [eliminated on the
//! disc](DiscSelf::with_higher) reach the top of so thin a layer, too, so each density has those that come with it: current crowds at a wide pad's
//! rim as far in as the layer is thick.

use std::f64::consts::PI;
use std::sync::OnceLock;

use nalgebra::{DMatrix, DVector};

use super::disc::{DiscBasis, DiscSelf, MAX_DEGREE, MAX_ORDER};
use super::driving::Covered;
use super::green::{Image, images};
use super::pads::Pad;
use super::quadrature::panels;

/// Radii of a pad that its near field reaches at most: the lesser is enough for most.
const REACHES: [f64; 2] = [5.25, 10.5];

/// Radians of the two Bessel functions' product that a panel of eight points resolves.
const PANEL: f64 = 10.0;

/// `k a` that a table resolves; each next one twice as much.
const COARSEST: f64 = 32.0;
const LEVELS: usize = 4;

/// Steps of a table for each unit of `k a` and radius: three in the finest wave, of which `exp(-across)` is left.
const STEPS: f64 = 0.5;

/// `k R` of the wave that tells what the near part has at zero.
const LONG: f64 = 0.03;

/// What the near part of the response across has at wave number zero (ohm m2): the part of the mean that the smooth part lacks.
pub(super) fn near_at_zero(covered: &Covered<'_>, split_m: f64) -> f64 {
    near_response(covered, split_m, LONG / split_m)
}

fn near_response(covered: &Covered<'_>, split_m: f64, k: f64) -> f64 {
    -covered.response(k).tb * (-0.25 * (k * split_m).powi(2)).exp_m1()
}

/// Near fields of pads.
#[derive(Clone, Debug)]
pub(super) struct NearFields {
    densities: usize,
    sources: Vec<Source>,
    profiles: Vec<Profile>,
    /// What each density adds to the fields that are tabulated: `fields x densities`, density by density.
    shares: Vec<f32>,
    fields: usize,
}

/// A pad or a mirror image of one.
#[derive(Clone, Debug)]
struct Source {
    centre_m: [f64; 2],
    sign: [f64; 2],
    pad: usize,
    profile: usize,
}

/// Fields of the densities of pads of one radius, by distance.
#[derive(Clone, Debug)]
struct Profile {
    /// One of the pads that it is of.
    pad: Pad,
    reach_m: f64,
    steps_per_m: f64,
    /// Orders of the densities, without those that differ by the sine.
    orders: Vec<[usize; 2]>,
    /// Order by order at each step, from one step before the middle.
    values: Vec<f64>,
}

impl NearFields {
    /// Those of pads on a rectangle; `shares` is `fields x (pads x densities)`.
    pub fn new(
        pads: &[Pad],
        basis: &'static DiscBasis,
        covered: &Covered<'_>,
        split_m: f64,
        across: f64,
        own: impl Fn(f64) -> DiscSelf,
        shares: &DMatrix<f64>,
    ) -> Self {
        let mut profiles: Vec<Profile> = Vec::new();
        let mut sources = Vec::new();
        for (pad, at) in pads.iter().enumerate() {
            let known = profiles.iter().position(|profile| profile.pad.is_like(at));
            let profile = known.unwrap_or(profiles.len());
            if known.is_none() {
                profiles.push(Profile::new(at, basis, &own(at.radius_m), covered, split_m, across));
            }
            let of = |image: Image| Source { centre_m: image.of(at.centre_m), sign: image.sign(), pad, profile };
            sources.extend(reaching(covered.size_m(), at.centre_m, profiles[profile].reach_m).into_iter().map(of));
        }
        let shares_of = shares.iter().map(|share| *share as f32).collect();
        Self { densities: basis.len(), sources, profiles, shares: shares_of, fields: shares.nrows() }
    }

    /// Adds the near fields at a point of the top, from the corner (m), times a factor.
    pub fn add(&self, at_m: [f64; 2], factor: f32, out: &mut [f32]) {
        for source in &self.sources {
            let profile = &self.profiles[source.profile];
            let way_m = [0, 1].map(|axis| source.sign[axis] * (at_m[axis] - source.centre_m[axis]));
            let square_m2 = way_m[0] * way_m[0] + way_m[1] * way_m[1];
            if square_m2 >= profile.reach_m * profile.reach_m {
                continue;
            }
            let mut columns = self.shares[source.pad * self.densities * self.fields..].chunks_exact(self.fields);
            profile.at(way_m, square_m2.sqrt(), |value| {
                let value = factor * value as f32;
                let column = columns.next().unwrap_or_default();
                out.iter_mut().zip(column).for_each(|(sum, share)| *sum += value * share);
            });
        }
    }
}

/// Mirror images of a place on a rectangle, itself among them, from which something reaches into it.
fn reaching(size_m: [f64; 2], centre_m: [f64; 2], reach_m: f64) -> Vec<Image> {
    let middle_m = size_m.map(|size_m| size_m / 2.0);
    let nearest = |image: &Image| {
        let at = image.of(centre_m);
        [0, 1].map(|axis| ((at[axis] - middle_m[axis]).abs() - middle_m[axis]).max(0.0))
    };
    let mut all = images(size_m, middle_m, centre_m, reach_m + middle_m[0].hypot(middle_m[1]));
    all.retain(|image| {
        let [x_m, y_m] = nearest(image);
        x_m.hypot(y_m) < reach_m
    });
    all
}

impl Profile {
    fn new(pad: &Pad, basis: &DiscBasis, own: &DiscSelf, covered: &Covered<'_>, split_m: f64, across: f64) -> Self {
        let radius_m = pad.radius_m;
        let waves = Waves::of(across * radius_m / covered.thickness_m(), reach(split_m / radius_m, across));
        let mut orders: Vec<[usize; 2]> = Vec::new();
        for density in basis.densities() {
            if !orders.contains(&[density.n, density.m]) {
                orders.push([density.n, density.m]);
            }
        }
        let response = |[ka, weight]: &[f64; 2]| weight * near_response(covered, split_m, ka / radius_m);
        let responses: Vec<f64> = waves.points.iter().map(response).collect();
        let steps = waves.steps();
        let mut values = vec![0.0; orders.len() * (steps + 3)];
        for (d, &[n, m]) in orders.iter().enumerate() {
            let mut weights = DVector::zeros(responses.len());
            for (n, share) in own.with_higher([n, m], basis.degree(), pad.resistance_ohm()) {
                let factor = share * if (n - m).is_multiple_of(4) { 1.0 } else { -1.0 } / (PI * radius_m * radius_m);
                let means = responses.iter().zip(waves.means(n));
                weights
                    .iter_mut()
                    .zip(means)
                    .for_each(|(weight, (response, mean))| *weight += factor * response * mean);
            }
            let along = waves.waves(m).tr_mul(&weights);
            let parity = if m % 2 == 0 { 1.0 } else { -1.0 };
            values[d] = parity * along[1];
            along.iter().enumerate().for_each(|(step, value)| values[(step + 1) * orders.len() + d] = *value);
        }
        let rows = || values.chunks_exact(orders.len()).map(|row| row.iter().fold(0.0, |a: f64, b| a.max(b.abs())));
        let end = (-across).exp() * rows().fold(0.0, f64::max);
        let last = rows().rposition(|value| value > end).unwrap_or(0).min(steps - 2);
        values.truncate((last + 3) * orders.len());
        let steps_per_m = waves.steps_per_radius / radius_m;
        let reach_m = (last - 1).max(1) as f64 / steps_per_m;
        Self { pad: *pad, reach_m, steps_per_m, orders, values }
    }

    /// Tells the field of each density in turn, at a way from the middle (m) and its length.
    #[inline]
    fn at(&self, way_m: [f64; 2], distance_m: f64, mut tell: impl FnMut(f64)) {
        let at = distance_m * self.steps_per_m;
        let cell = at as usize;
        let weights = cubic(at - cell as f64);
        let rows = &self.values[cell * self.orders.len()..][..4 * self.orders.len()];
        let unit = way_m.map(|way_m| way_m / distance_m.max(f64::MIN_POSITIVE));
        for (d, [_, m]) in self.orders.iter().enumerate() {
            let value: f64 =
                weights.iter().enumerate().map(|(i, weight)| weight * rows[i * self.orders.len() + d]).sum();
            let [mut cos, mut sin] = [1.0, 0.0];
            for _ in 0..*m {
                [cos, sin] = [cos * unit[0] - sin * unit[1], sin * unit[0] + cos * unit[1]];
            }
            tell(value * cos);
            if *m > 0 {
                tell(value * sin);
            }
        }
    }
}

/// Lagrange's weights of four values, `t` of the way from the second to the third.
#[inline]
fn cubic(t: f64) -> [f64; 4] {
    let (a, b, c) = (t + 1.0, t - 1.0, t - 2.0);
    [-t * b * c / 6.0, a * b * c / 2.0, -a * t * c / 2.0, a * t * b / 6.0]
}

/// Radii of a pad within which its near field falls to `exp(-across)`, for a split length in radii: what is split off a point source is
/// `E1(r^2 / R^2)` on a sheet.
fn reach(split: f64, across: f64) -> f64 {
    1.0 + across.sqrt() * split
}

/// The longest split length, in radii of a pad, whose near field is not cut off.
pub(super) fn longest_split(across: f64) -> f64 {
    (REACHES[REACHES.len() - 1] - 1.0) / across.sqrt()
}

/// Quadrature over `k a`, and the Bessel functions there: with the radius as unit they are the same for all slabs, so they are made once.
struct Waves {
    /// `k a`, and `k a d(k a)`.
    points: Vec<[f64; 2]>,
    reach: f64,
    steps_per_radius: f64,
    means: [OnceLock<Vec<f64>>; MAX_ORDER + 1],
    waves: [OnceLock<DMatrix<f64>>; MAX_DEGREE + 1],
}

impl Waves {
    /// That goes as far as a `k a` and a reach in radii, or as far as there is any.
    fn of(most: f64, reach: f64) -> &'static Self {
        static ALL: [[OnceLock<Waves>; LEVELS]; REACHES.len()] =
            [const { [const { OnceLock::new() }; LEVELS] }; REACHES.len()];
        let which = REACHES.iter().position(|longest| *longest >= reach).unwrap_or(REACHES.len() - 1);
        let reach = REACHES[which];
        let end = |level: usize| COARSEST * f64::from(1_u32 << level);
        let level = (0..LEVELS - 1).find(|level| end(*level) >= most).unwrap_or(LEVELS - 1);
        ALL[which][level].get_or_init(|| {
            let panel = PANEL / (reach + 1.0);
            let edges: Vec<f64> = (0..=(end(level) / panel).ceil() as usize).map(|i| panel * i as f64).collect();
            Self {
                points: panels(&edges, 8).into_iter().map(|[ka, weight]| [ka, ka * weight]).collect(),
                reach,
                steps_per_radius: STEPS * end(level),
                means: [const { OnceLock::new() }; MAX_ORDER + 1],
                waves: [const { OnceLock::new() }; MAX_DEGREE + 1],
            }
        })
    }

    fn steps(&self) -> usize {
        (self.reach * self.steps_per_radius) as usize
    }

    /// `J_(n+1)(k a) / (k a)`.
    fn means(&self, n: usize) -> &[f64] {
        self.means[n].get_or_init(|| self.points.iter().map(|[ka, _]| libm::jn(n as i32 + 1, *ka) / ka).collect())
    }

    /// `J_m(k r)` at each step: `points x (steps + 2)`.
    fn waves(&self, m: usize) -> &DMatrix<f64> {
        self.waves[m].get_or_init(|| {
            DMatrix::from_fn(self.points.len(), self.steps() + 2, |point, step| {
                libm::jn(m as i32, self.points[point][0] * step as f64 / self.steps_per_radius)
            })
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::detector::{Detector, Layer, Outline};
    use crate::forward::driving::DrivingLayer;
    use crate::forward::slab::green::SurfaceGreen;
    use crate::forward::slab::stacks::bottom_surface;
    use crate::forward::slab::{Resolution, Slab};
    use crate::forward::{ForwardModel, readings_v};
    use crate::scene::Contact;

    const SIZE_M: [f64; 2] = [0.06, 0.04];

    fn pad(centre_m: [f64; 2]) -> Pad {
        Pad { centre_m, radius_m: 0.002, contact_impedance_ohm_m2: 0.0 }
    }

    fn covered(layers: &[Layer]) -> Covered<'_> {
        Covered::new(layers, SIZE_M, DrivingLayer::default())
    }

    fn own(layers: &[Layer]) -> DiscSelf {
        let kernel = SurfaceGreen::new(SIZE_M, 0.002, &bottom_surface(covered(layers)));
        kernel.disc_self(0.002)
    }

    #[test]
    fn all_of_a_near_field_is_what_it_has_at_wave_number_zero() {
        let layers = [Layer::uniform(0.0007, 0.25)];
        let basis = DiscBasis::of_degree(0);
        for split_m in [0.002, 0.003] {
            let profile = Profile::new(&pad([0.0; 2]), basis, &own(&layers), &covered(&layers), split_m, 11.0);
            let step_m = 0.25 / profile.steps_per_m;
            let rings = (0..(profile.reach_m / step_m) as usize).map(|i| (i as f64 + 0.5) * step_m);
            let mut sum = 0.0;
            for distance_m in rings {
                profile.at([distance_m, 0.0], distance_m, |value| sum += 2.0 * PI * distance_m * step_m * value);
            }
            let expected = near_at_zero(&covered(&layers), split_m);
            assert!((sum / expected - 1.0).abs() < 1e-3, "{sum} {expected}");
            // Of a sheet: R^2 / (4 S).
            assert!((expected * 4.0 * 0.25 * 0.0007 / (split_m * split_m) - 1.0).abs() < 1e-3, "{expected}");
        }
    }

    #[test]
    fn walls_send_back_what_would_pass_them() {
        let layers = [Layer::uniform(0.0007, 0.25)];
        let basis = DiscBasis::of_degree(2);
        let count = basis.len();
        let fields = |pads: &[Pad]| {
            let shares = DMatrix::from_fn(1, pads.len() * count, |_, density| 1.0 + (density % count) as f64);
            NearFields::new(pads, basis, &covered(&layers), 0.0025, 11.0, |_| own(&layers), &shares)
        };
        let value = |near: &NearFields, at_m: [f64; 2]| {
            let mut out = [0.0];
            near.add(at_m, 1.0, &mut out);
            out[0]
        };
        let corner = fields(&[pad([0.0023, 0.0374])]);
        assert_eq!(corner.sources.len(), 4);
        for [x_m, y_m] in [[0.001, 0.038], [0.0004, 0.0395]] {
            let [here, beyond_x, beyond_y] =
                [[x_m, y_m], [-x_m, y_m], [x_m, 0.08 - y_m]].map(|at_m| value(&corner, at_m));
            assert!(here != 0.0 && (here / beyond_x - 1.0).abs() < 1e-5 && (here / beyond_y - 1.0).abs() < 1e-5);
        }
        assert_eq!(value(&corner, [0.03, 0.02]), 0.0);
    }

    /// Where fields are split is a choice of the computation alone; and without a split, with points and steps that resolve the thickness, they
    /// are the same.
    #[test]
    fn readings_do_not_hang_on_the_split() {
        let mut detector = Detector::preset("fingertip-10").unwrap();
        detector.layers = vec![Layer::uniform(0.0003, 0.25)];
        detector.electrodes.truncate(6);
        detector.electrodes.iter_mut().for_each(|pad| pad.radius_m = 0.0006);
        detector.electrodes[4].radius_m = 0.0008;
        let finest = Resolution { pad_degree: 4, ..Resolution::STANDARD };
        let slab = |resolution| Slab::with_resolution(&detector, resolution).unwrap();
        let [near, far] = [1.25, 2.4].map(|split_in_pad| slab(Resolution { split_in_pad, ..finest }));
        let whole = Resolution { split_in_pad: 0.01, split_in_pitch: 0.0, steps_in_pad: 30, ..finest };
        let whole = slab(Resolution { pad_degree: 8, ..whole });
        let off = |a: &Slab, b: &Slab, at_m: [f64; 2]| {
            let contact = Contact::flat(at_m[0], at_m[1], 0.0004, 1e-4);
            let [a, b] = [a, b].map(|slab| {
                let impedance_ohm = slab.impedance_ohm(&[contact]).unwrap();
                assert!((&impedance_ohm - impedance_ohm.transpose()).amax() < 1e-9 * impedance_ohm.amax());
                readings_v(&impedance_ohm, &detector)
            });
            a.volts().iter().zip(b.volts()).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max) / b.largest_v()
        };
        let pads = detector.electrodes.iter().map(|pad| [pad.x_m + 0.0003, pad.y_m - 0.0002]);
        for at_m in pads.chain([[0.0, 0.0], [0.0021, -0.0033], [-0.0049, 0.0048]]) {
            assert!(off(&near, &far, at_m) < 1e-4, "{at_m:?}: {}", off(&near, &far, at_m));
            assert!(off(&near, &whole, at_m) < 1e-3, "{at_m:?}: {}", off(&near, &whole, at_m));
        }
    }

    /// Above a pad that is wide against the layer, and at its rim, where current crowds: few densities with the higher ones that come with them are as
    /// good as many. Without the higher ones, slopes would be off by half of themselves at half a radius, and by a tenth at the rim.
    #[test]
    fn at_wide_pads_readings_change_with_the_place_as_with_many_densities() {
        let mut detector = Detector::preset("square-60").unwrap();
        detector.outline = Outline::rectangle(0.03, 0.03);
        detector.layers = vec![Layer::uniform(0.0004, 0.25)];
        detector.electrodes.truncate(4);
        let corners =
            [[-1.0, -1.0], [1.0, -1.0], [-1.0, 1.0], [1.0, 1.0]].map(|at: [f64; 2]| at.map(|side| 7e-3 * side));
        detector.electrodes.iter_mut().zip(corners).for_each(|(pad, at)| [pad.x_m, pad.y_m] = at);
        let slab =
            |pad_degree| Slab::with_resolution(&detector, Resolution { pad_degree, ..Resolution::STANDARD }).unwrap();
        let slabs = [2, MAX_DEGREE].map(slab);
        for radii in [0.5, 0.75, 1.0, 1.25, 2.0] {
            let [few, many] = [0, 1].map(|which| {
                let volts = |radii: f64| {
                    let contact = Contact::flat(-7e-3 + 0.002 * radii, -7e-3, 0.001, 5e-5);
                    let readings = readings_v(&slabs[which].impedance_ohm(&[contact]).unwrap(), &detector);
                    DVector::from_column_slice(readings.volts())
                };
                [volts(radii), volts(radii + 0.05) - volts(radii)]
            });
            let off = [0, 1].map(|which| (&few[which] - &many[which]).norm() / many[which].norm());
            // Up to 0.006 and 0.09.
            assert!(off[0] < 0.01 && off[1] < 0.12, "{radii}: {off:?}");
        }
    }
}
