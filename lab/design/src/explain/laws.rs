//! Laws of contact: what a foam under the indenter conducts at a force.
//!
//! Each has its parameters in logarithms. None has any that belongs to one foam: a table of eleven samples could not tell them.

use std::f64::consts::PI;

use tactomo_physics::hertz::{POISSON, SURFACE_DEPTH_M};

use super::super::press::INDENTER_DIAMETER_M;
use super::bench::Bench;

/// A law, and what it says.
#[derive(Clone, Copy)]
pub struct Law {
    /// In a few words.
    pub name: &'static str,
    /// Its formula, with its parameters.
    pub formula: &'static str,
    /// Where it is from.
    pub source: &'static str,
    /// Where fits begin: logarithms of its parameters.
    pub starts: &'static [&'static [f64]],
    /// Conductance (S) and radius (m) of a sample's contact for such parameters and a force (N).
    pub contact: fn(&Bench, &[f64], f64) -> [f64; 2],
}

const RADIUS_M: f64 = INDENTER_DIAMETER_M / 2.0;
const AREA_M2: f64 = PI * RADIUS_M * RADIUS_M;
const MEGA: f64 = 1e6;

/// All that are tried. The first is the ideal one, which has nothing to fit.
pub const LAWS: [Law; 9] = [
    Law {
        name: "ideal",
        formula: "C = sigma pi a^2 / l, l = 0.5 mm",
        source: "Hertz's area under a ball of 5 mm, all of which conducts: the paper's eqs. (1) to (3)",
        starts: &[&[]],
        contact: |bench, _, force_n| hertz(bench, SURFACE_DEPTH_M, force_n),
    },
    Law {
        name: "ideal, any depth",
        formula: "C = sigma pi a^2 / l",
        source: "the same",
        starts: &[&[-7.6], &[-4.0]],
        contact: |bench, p, force_n| hertz(bench, p[0].exp(), force_n),
    },
    Law {
        name: "rough, on the foam",
        formula: "C = k sigma F / E",
        source: "real area in proportion to the force, on the foam: Greenwood and Williamson 1966, Barber 2003; flat punch",
        starts: &[&[6.0], &[9.0]],
        contact: |bench, p, force_n| {
            flat(p[0].exp() * bench.top.conductivity_s_per_m * force_n / bench.top.elasticity_pa)
        },
    },
    Law {
        name: "rough, on a film",
        formula: "C = k F / E",
        source: "the same through a film that conducts whatever the foam does: Holm, Electric Contacts, 1967",
        starts: &[&[3.0], &[5.0]],
        contact: |bench, p, force_n| flat(p[0].exp() * force_n / bench.top.elasticity_pa),
    },
    Law {
        name: "mesh, on a film",
        formula: "C = k (F / (f E) - 1)^2",
        source: "a mesh that foam has to bulge through, and a film that conducts with the pressure beyond: the paper's figure 1(E)",
        starts: &[&[-13.6, -0.9], &[-10.0, 0.3]],
        contact: |bench, p, force_n| {
            flat(p[0].exp() * beyond(force_n / (p[1].exp() * bench.top.elasticity_pa / MEGA)).powi(2))
        },
    },
    Law {
        name: "threshold, on a film",
        formula: "C = k (F / f - 1)^2",
        source: "the same, of a mesh or sheet that has to be bent, however soft the foam",
        starts: &[&[-9.5, 0.4], &[-8.0, 0.0]],
        contact: |_, p, force_n| flat(p[0].exp() * beyond(force_n / p[1].exp()).powi(2)),
    },
    Law {
        name: "cube, on the foam",
        formula: "C = k sigma F^3 / E^(3/2)",
        source: "as the next, if it conducted as the foam does",
        starts: &[&[-12.0], &[-9.0]],
        contact: |bench, p, force_n| flat(p[0].exp() * bench.top.conductivity_s_per_m * cube(bench, force_n)),
    },
    Law {
        name: "cube, on a film",
        formula: "C = k F^3 / E^(3/2)",
        source: "found here: a film that conducts as the power 3/2 of the energy F^2 / E that the press stores",
        starts: &[&[-13.9], &[-12.5]],
        contact: |bench, p, force_n| flat(p[0].exp() * cube(bench, force_n)),
    },
    Law {
        name: "any power, on a film",
        formula: "C = k F^n / E^q",
        source: "whether 3 and 3/2 are more than round numbers",
        starts: &[&[-13.9, 3.0, 1.5], &[-10.0, 1.5, 0.5]],
        contact: |bench, p, force_n| {
            flat(p[0].exp() * force_n.powf(p[1]) / (bench.top.elasticity_pa / MEGA).powf(p[2]))
        },
    },
];

/// The law that is used everywhere, by its place.
pub const CHOSEN: usize = 7;

/// The energy per volume at which a film conducts 1 S/m2 (J/m3), for the factor `k` of the [chosen](CHOSEN) law in S, N and MPa: what
/// [`Surface::measured`](tactomo_physics::hertz::Surface::measured) has.
pub fn unit_energy_j_per_m3(log_k: f64) -> f64 {
    // C = A (F / (A u))^3 with u^2 = w E.
    (1.0 / (AREA_M2 * AREA_M2 * log_k.exp())).powf(2.0 / 3.0) / MEGA
}

fn hertz(bench: &Bench, depth_m: f64, force_n: f64) -> [f64; 2] {
    let plane_pa = bench.young_pa / (1.0 - POISSON * POISSON);
    let radius_m = (0.75 * force_n * RADIUS_M / plane_pa).cbrt().min(RADIUS_M);
    [bench.top.conductivity_s_per_m * PI * radius_m * radius_m / depth_m, radius_m]
}

fn flat(conductance_s: f64) -> [f64; 2] {
    [conductance_s, RADIUS_M]
}

/// How far something is beyond 1.
fn beyond(ratio: f64) -> f64 {
    (ratio - 1.0).max(0.0)
}

/// `F^3 / E^(3/2)` in N and MPa.
fn cube(bench: &Bench, force_n: f64) -> f64 {
    force_n.powi(3) / (bench.top.elasticity_pa / MEGA).powf(1.5)
}
