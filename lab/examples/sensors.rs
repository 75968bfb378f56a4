//! Presses on six kinds of made-up sensors: `cargo run --release --package tactomo-lab --example sensors -- FOLDER [SEED [TAUGHT [UNSEEN]]]`.
//!
//! Writes `KIND-SEED-taught.npz` and `KIND-SEED-unseen.npz` for each kind, presses of one run mixed, as `tactomo-lab learn` reads them. They differ in their
//! pattern of drive and read, in the law of their force, in sensitivities, noise and drift. None of them is a detector of this program, nor is
//! its model: electrodes stand on the rim of a disc, between whose points a current's field is that of logarithms, and a press is a patch
//! that conducts better (dipole of a small inclusion); or there are no electrodes but a grid of cells. `tools/compare_sklearn.py` learns from the same presses.

use std::error::Error;
use std::f64::consts::{PI, TAU};
use std::fs::File;
use std::path::Path;

use tactomo_physics::simulate::Noise;
use tactomo_table::NpzWriter;

const TAUGHT: usize = 1800;
const UNSEEN: usize = 400;
/// Radius of the discs (m).
const RADIUS_M: f64 = 0.05;
/// Presses reach so much of the radius.
const REACH: f64 = 0.9;
/// Forces (N).
const FORCES_N: [f64; 2] = [0.3, 8.0];
/// Of a robot that presses with about the same force everywhere (N).
const STEADY_N: [f64; 2] = [2.0, 2.4];

type Point = [f64; 2];

/// A press: its middle (m) and its force (N).
struct Press {
    at_m: Point,
    z_m: f64,
    force_n: f64,
}

/// A kind of sensor: what it reads of a press at a time from 0 to 1, with its noise.
struct Kind {
    name: &'static str,
    make: fn(&mut Noise) -> Sensor,
}

type Sensor = Box<dyn FnMut(&Press, f64, &mut Noise) -> Vec<f64>>;

const KINDS: [Kind; 6] = [
    Kind { name: "opposite", make: opposite },
    Kind { name: "adjacent", make: adjacent },
    Kind { name: "grounded", make: grounded },
    Kind { name: "cells", make: cells },
    Kind { name: "amplified", make: amplified },
    Kind { name: "dome", make: dome },
];

fn main() -> Result<(), Box<dyn Error>> {
    let mut words = std::env::args().skip(1);
    let folder = words.next().ok_or("a folder is needed")?;
    let mut number = |otherwise: u64| words.next().map_or(Ok(otherwise), |word| word.parse());
    let (seed, taught, unseen) = (number(1)?, number(TAUGHT as u64)? as usize, number(UNSEEN as u64)? as usize);
    std::fs::create_dir_all(&folder)?;
    for kind in &KINDS {
        let mut noise = Noise::new(seed);
        let mut random = fastrand::Rng::with_seed(seed ^ 0x5eed);
        let mut sensor = (kind.make)(&mut noise);
        let count = taught + unseen;
        let presses: Vec<Press> = (0..count).map(|_| press(&mut random, kind.name)).collect();
        let time = |index: usize| index as f64 / count as f64;
        let readings: Vec<Vec<f64>> =
            presses.iter().enumerate().map(|(index, press)| sensor(press, time(index), &mut noise)).collect();
        let mut order: Vec<usize> = (0..count).collect();
        random.shuffle(&mut order);
        for (name, part) in [("taught", &order[..taught]), ("unseen", &order[taught..])] {
            let path = Path::new(&folder).join(format!("{}-{seed}-{name}.npz", kind.name));
            write(&path, part, &presses, &readings, &mut noise)?;
        }
    }
    Ok(())
}

fn write(
    path: &Path,
    part: &[usize],
    presses: &[Press],
    readings: &[Vec<f64>],
    noise: &mut Noise,
) -> Result<(), Box<dyn Error>> {
    let mut file = NpzWriter::new(File::create(path)?);
    let column = |of: fn(&Press) -> f64| part.iter().map(|&index| of(&presses[index])).collect::<Vec<f64>>();
    file.add("x_m", &[part.len()], &column(|press| press.at_m[0]))?;
    file.add("y_m", &[part.len()], &column(|press| press.at_m[1]))?;
    // A robot's own reading of a height that is always the same, to a micrometre.
    let z_m: Vec<f64> = column(|press| press.z_m).iter().map(|z_m| z_m + 1e-6 * noise.normal()).collect();
    file.add("z_m", &[part.len()], &z_m)?;
    file.add("force_n", &[part.len()], &column(|press| press.force_n))?;
    let channels = readings[0].len();
    let rows: Vec<f64> = part.iter().flat_map(|&index| readings[index].iter().copied()).collect();
    file.add("readings_v", &[part.len(), channels], &rows)?;
    Ok(file.finish()?)
}

/// Anywhere within reach, at any force; on a dome higher in the middle; steady where channels are amplified.
fn press(random: &mut fastrand::Rng, kind: &str) -> Press {
    let (radius_m, angle) = (REACH * RADIUS_M * random.f64().sqrt(), TAU * random.f64());
    let [least_n, most_n] = if kind == "amplified" { STEADY_N } else { FORCES_N };
    let force_n = least_n * (most_n / least_n).powf(random.f64());
    let at_m = [radius_m * angle.cos(), radius_m * angle.sin()];
    let z_m = if kind == "dome" { 0.02 * (1.0 - (radius_m / RADIUS_M).powi(2)) } else { 0.0 };
    Press { at_m, z_m, force_n }
}

/// 16 electrodes on the rim.
fn electrode(index: usize) -> Point {
    let angle = TAU * (index % 16) as f64 / 16.0;
    [RADIUS_M * angle.cos(), RADIUS_M * angle.sin()]
}

/// Drives and reads that have no electrode in common: `apart` electrodes between the two of a drive, neighbours are read.
fn pairs(apart: usize) -> Vec<[[usize; 2]; 2]> {
    let all = (0..16).flat_map(|drive| (0..16).map(move |read| (drive, read)));
    let pairs = all.map(|(drive, read)| [[drive, (drive + apart) % 16], [read, (read + 1) % 16]]);
    pairs.filter(|[drive, read]| drive.iter().all(|electrode| !read.contains(electrode))).collect()
}

/// Gradient (1/m) of the potential between two electrodes of a disc, over the sheet's resistance and the current.
fn gradient(at_m: Point, pair: [usize; 2]) -> Point {
    let one = |index: usize| {
        let rim_m = electrode(index);
        let (x, y) = (at_m[0] - rim_m[0], at_m[1] - rim_m[1]);
        // A pad of 2 mm, not a point.
        let square = x * x + y * y + 4e-6;
        [x / (PI * square), y / (PI * square)]
    };
    let (source, sink) = (one(pair[0]), one(pair[1]));
    [sink[0] - source[0], sink[1] - source[1]]
}

/// What a patch that conducts better does to the voltages between pairs: the mean over seven points of it.
fn inclusion(at_m: Point, radius_m: f64, pairs: &[[[usize; 2]; 2]]) -> Vec<f64> {
    let ring = (0..6).map(|i| TAU * f64::from(i) / 6.0);
    let ring = ring.map(|angle| [at_m[0] + 0.7 * radius_m * angle.cos(), at_m[1] + 0.7 * radius_m * angle.sin()]);
    let points: Vec<Point> = ring.chain([at_m]).collect();
    let volts = |[drive, read]: &[[usize; 2]; 2]| {
        let product = |point: &Point| {
            let (a, b) = (gradient(*point, *drive), gradient(*point, *read));
            a[0] * b[0] + a[1] * b[1]
        };
        radius_m * radius_m * points.iter().map(product).sum::<f64>() / points.len() as f64
    };
    pairs.iter().map(volts).collect()
}

/// Opposite drive, neighbours read: 192 channels. Firmer presses are wider (Hertz), and saturate; 1 mV of noise.
fn opposite(_: &mut Noise) -> Sensor {
    let pairs = pairs(8);
    Box::new(move |press, _, noise| {
        let radius_m = 0.003 * press.force_n.cbrt();
        let gain = 20.0 * press.force_n / (press.force_n + 3.0);
        inclusion(press.at_m, radius_m, &pairs).iter().map(|volts| gain * volts + 1e-3 * noise.normal()).collect()
    })
}

/// Neighbours drive, neighbours read: 208 channels, far less sensitive in the middle. Gains differ by 10 %, noise has a share of each reading.
fn adjacent(noise: &mut Noise) -> Sensor {
    let pairs = pairs(1);
    let gains: Vec<f64> = pairs.iter().map(|_| 1.0 + 0.1 * noise.normal()).collect();
    Box::new(move |press, _, noise| {
        let strength = 60.0 * press.force_n.powf(0.6);
        let volts = inclusion(press.at_m, 0.004, &pairs);
        let noisy = |(volts, gain): (&f64, &f64)| {
            strength * gain * volts * (1.0 + 0.01 * noise.normal()) + 3e-4 * noise.normal()
        };
        volts.iter().zip(&gains).map(noisy).collect()
    })
}

/// One electrode grounded, twelve read: 192 channels, whose currents saturate as a contact conducts better; read to 12 bits with 1.5 steps of noise.
fn grounded(_: &mut Noise) -> Sensor {
    let potential = |a: Point, b: Point| -(((a[0] - b[0]).hypot(a[1] - b[1])).max(0.001) / RADIUS_M).ln() / PI;
    Box::new(move |press, _, noise| {
        let at_m = press.at_m;
        let mut readings = Vec::with_capacity(192);
        for g in 0..16 {
            let ground = electrode(g);
            let resistance =
                6.0 / press.force_n + potential(at_m, at_m) + potential(ground, ground) - 2.0 * potential(ground, at_m);
            for e in (2..14).map(|away| electrode(g + away)) {
                let transfer =
                    potential(e, at_m) - potential(e, ground) - potential(ground, at_m) + potential(ground, ground);
                let step_v = 3.3 / 4096.0;
                let volts = 2.0 * transfer / resistance + 1.5 * step_v * noise.normal();
                readings.push((volts / step_v).round() * step_v);
            }
        }
        readings
    })
}

/// A grid of 16 x 12 cells that feel pressure, with sensitivities and exponents of their own, five of them dead.
fn cells(noise: &mut Noise) -> Sensor {
    let sensitivities: Vec<f64> =
        (0..192).map(|cell| if cell % 40 == 7 { 0.0 } else { (0.3 * noise.normal()).exp() }).collect();
    let exponents: Vec<f64> = (0..192).map(|_| 0.8 + 0.1 * noise.normal()).collect();
    Box::new(move |press, _, noise| {
        let cell = |index: usize| {
            let place = [index % 16, index / 16].map(|i| i as f64);
            let centre_m = [(place[0] / 15.0 - 0.5) * 2.0 * RADIUS_M, (place[1] / 11.0 - 0.5) * 2.0 * RADIUS_M];
            let square = (press.at_m[0] - centre_m[0]).powi(2) + (press.at_m[1] - centre_m[1]).powi(2);
            let width_m = 0.005 + 0.002 * press.force_n.cbrt();
            let pressure = press.force_n * (-0.5 * square / (width_m * width_m)).exp();
            let felt = sensitivities[index] * pressure.powf(exponents[index]);
            3.0 * felt / (felt + 5.0) + 0.01 * noise.normal()
        };
        (0..192).map(cell).collect()
    })
}

/// As `cells`, each with an amplifier of its own, of a factor from 1 to 1000, and all noise before it; pressed steadily.
fn amplified(noise: &mut Noise) -> Sensor {
    let mut cells = cells(noise);
    let factor = |cell: usize| 1000f64.powf((0.618_034 * cell as f64).fract());
    Box::new(move |press, time, noise| {
        cells(press, time, noise).iter().enumerate().map(|(cell, volts)| factor(cell) * volts).collect()
    })
}

/// As `opposite` on a dome that conducts unevenly, whose channels drift, whose force creeps and whose places are known to 0.3 mm.
fn dome(noise: &mut Noise) -> Sensor {
    let pairs = pairs(8);
    let bends: Vec<[f64; 3]> = (0..6).map(|_| [(); 3].map(|()| noise.normal())).collect();
    let drifts: Vec<f64> = pairs.iter().map(|_| 4e-3 * noise.normal()).collect();
    Box::new(move |press, time, noise| {
        let is_at: Point = press.at_m.map(|at| at + 3e-4 * noise.normal());
        let bend = |axis: usize| -> f64 {
            let wave = |[a, b, c]: &[f64; 3]| 0.0015 * (40.0 * (a * is_at[axis] + b * is_at[1 - axis]) + 3.0 * c).sin();
            bends[3 * axis..][..3].iter().map(wave).sum()
        };
        let bent_m = [is_at[0] + bend(0), is_at[1] + bend(1)];
        let force_n = press.force_n * (1.0 + 0.05 * noise.normal()).abs();
        let gain = 20.0 * force_n / (force_n + 3.0);
        let volts = inclusion(bent_m, 0.003 * force_n.cbrt(), &pairs);
        volts.iter().zip(&drifts).map(|(volts, drift)| gain * volts + time * drift + 1e-3 * noise.normal()).collect()
    })
}
