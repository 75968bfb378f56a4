//! Frames to train the solver `network` with: `cargo run --release --package tactomo-lab --example network_data -- OUT.npz [DETECTOR [DETECTORS [SCENES [SEED]]]]`.
//!
//! Draws so many detectors from the tolerances of DETECTOR (a preset or a file; by default `square-60`, 1500 of them), each under so many
//! scenes (30), simulates them finer than anything that is inverted, and measures them with the converter's noise, less a baseline.
//! Around a calibrated detector they are drawn from a fifth of the tolerances, to fine-tune with. `tools/train_network.py` reads what is written:
//!
//! | array | shape | what |
//! |---|---|---|
//! | `readings_v` | frames x n x n | whole frames, or what is left of them [completed](Problem::completed) |
//! | `view` | frames | 0 whole, 1 four grounds, 2 four grounds and four electrodes, 3 a converter's floor |
//! | `scene` | frames | which row of the following |
//! | `detector` | scenes | which of the drawn ones |
//! | `image_s_per_m2` | scenes x side x side | true contact conductance per area on a grid over the outline's box, edges included, x fastest |
//! | `contacts` | scenes x 5 x 3 | x, y (m) and conductance (S) of contacts, zero where there are no more |
//! | `count` | scenes | number of contacts; -1 if what touches is one shape |
//! | `size_m`, `electrodes_m`, `thickness_m`, `sheet_s`, `drive_v`, `lsb_v` | | of the detector described |

mod scenes;

use std::fs::File;
use std::io::BufWriter;
use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread;

use anyhow::{Context, Result, anyhow, ensure};
use tactomo_physics::detector::Detector;
use tactomo_physics::forward::{ForwardModel, ImageMesh, Slab};
use tactomo_physics::readings::{Range, Readings};
use tactomo_study::Experiment;
use tactomo_table::NpzWriter;
use tactomo_touch::metrics::truth_s_per_m2;

use self::scenes::{Drawn, Scenes};

/// Nodes along a side of the true images.
const SIDE: usize = 32;
/// Most contacts of a scene.
const MOST: usize = 5;
/// Detectors and scenes of studies have small seeds: these are others.
const SEEDS_FROM: u64 = 1 << 32;
/// What a rub of 20 s leaves of the tolerances, at most: 2 % of the thickness of 10 %.
const CALIBRATED_SHARE: f64 = 0.2;
/// Floors of converters (V): about that of an ESP32.
const FLOORS_V: [f64; 2] = [0.1, 0.18];

/// What one scene gives.
struct Row {
    /// Each with its view.
    frames: Vec<(u8, Readings)>,
    detector: usize,
    image_s_per_m2: Vec<f32>,
    contacts: Option<Vec<[f64; 3]>>,
}

fn main() -> Result<()> {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let number = |index: usize, default: u64| -> Result<u64> {
        words.get(index).map_or(Ok(default), |word| word.parse().with_context(|| format!("`{word}` is no number")))
    };
    let out = words.first().context("a name for the file is needed: OUT.npz")?;
    ensure!(!Path::new(out).exists(), "{out} exists already: give another name");
    let name = words.get(1).map_or(Detector::DEFAULT, String::as_str);
    let mut detector = match Detector::preset(name) {
        Some(preset) => preset,
        None => Detector::read(name.as_ref())?,
    };
    if detector.calibration.is_some() {
        detector.tolerances = detector.tolerances.times(CALIBRATED_SHARE);
    }
    let (detectors, scenes, seed) = (number(2, 1500)? as usize, number(3, 30)? as usize, number(4, 1)?);
    let rows = simulated(&detector, detectors, scenes, SEEDS_FROM + seed * (1 << 20))?;
    write(out.as_ref(), &detector, &rows).with_context(|| format!("cannot write {out}"))
}

/// All scenes on all detectors, those of one after the other.
fn simulated(detector: &Detector, detectors: usize, scenes: usize, seed: u64) -> Result<Vec<Row>> {
    let nominal = Experiment::new(detector)?;
    let mesh = Slab::new(detector)?.on_image(SIDE * SIDE).image_mesh().clone();
    ensure!(mesh.nodes_m.len() == SIDE * SIDE, "a square detector is needed");
    let next = AtomicUsize::new(0);
    let work = || -> Result<Vec<Row>> {
        let mut rows = Vec::new();
        loop {
            let index = next.fetch_add(1, Ordering::Relaxed);
            if index >= detectors {
                return Ok(rows);
            }
            rows.extend(of_detector(&nominal, &mesh, index, scenes, seed + index as u64)?);
            if index % 10 == 9 {
                eprintln!("{} of {detectors} detectors", index + 1);
            }
        }
    };
    let parts: Vec<Result<Vec<Row>>> = thread::scope(|scope| {
        let threads: Vec<_> =
            (0..thread::available_parallelism().map_or(1, usize::from)).map(|_| scope.spawn(work)).collect();
        threads.into_iter().map(|thread| thread.join().unwrap_or_else(|_| Err(anyhow!("a thread panicked")))).collect()
    });
    let mut rows: Vec<Row> = parts.into_iter().collect::<Result<Vec<_>>>()?.into_iter().flatten().collect();
    rows.sort_by_key(|row| row.detector);
    Ok(rows)
}

fn of_detector(nominal: &Experiment, mesh: &ImageMesh, index: usize, scenes: usize, seed: u64) -> Result<Vec<Row>> {
    let built = nominal.as_built(seed)?;
    let mut random = fastrand::Rng::with_seed(seed);
    let mut drawn = Scenes::new(&nominal.detector, random.u64(..));
    let row = |_| {
        let Drawn { touches, contacts } = drawn.draw();
        let frame = built.frames(std::slice::from_ref(&touches), random.u64(..))?.remove(0);
        let less = less_of(nominal, &frame.readings, &mut random);
        Ok(Row {
            frames: std::iter::once((0, frame.readings)).chain(less).collect(),
            detector: index,
            image_s_per_m2: truth_s_per_m2(mesh, &touches)?,
            contacts,
        })
    };
    (0..scenes).map(row).collect()
}

/// What a shorter scan or a converter with a floor leaves of a frame, completed, with its view.
fn less_of(nominal: &Experiment, whole: &Readings, random: &mut fastrand::Rng) -> Option<(u8, Readings)> {
    let n = whole.electrodes();
    let [grounds, electrodes] = [(); 2].map(|()| four(n, random));
    let floor_v = FLOORS_V[0] + (FLOORS_V[1] - FLOORS_V[0]) * random.f64();
    let (view, less) = match random.u8(0..4) {
        // The grounds of `--scan four`, or others.
        0 => (1, whole.clone().hiding(|g, _| !g.is_multiple_of(n / 4 + 1))),
        1 => (1, whole.clone().hiding(|g, _| !grounds.contains(&g))),
        2 => (2, whole.clone().hiding(|g, e| !grounds.contains(&g) || !electrodes.contains(&e))),
        _ => (3, whole.clone().within(&vec![Range { floor_v, ceiling_v: f64::INFINITY }; n])),
    };
    Some((view, nominal.problem.completed(&less).into_owned()))
}

/// Four of so many.
fn four(n: usize, random: &mut fastrand::Rng) -> Vec<usize> {
    let mut all: Vec<usize> = (0..n).collect();
    random.shuffle(&mut all);
    all.truncate(4);
    all
}

fn write(path: &Path, detector: &Detector, rows: &[Row]) -> Result<()> {
    let n = detector.electrodes.len();
    let mut npz = NpzWriter::new(BufWriter::new(File::create_new(path)?));
    let frames: Vec<_> =
        rows.iter().enumerate().flat_map(|(i, row)| row.frames.iter().map(move |frame| (i, frame))).collect();
    let volts: Vec<f64> = frames.iter().flat_map(|(_, (_, readings))| readings.volts().iter().copied()).collect();
    npz.add("readings_v", &[frames.len(), n, n], &volts)?;
    npz.add("view", &[frames.len()], &frames.iter().map(|(_, (view, _))| f64::from(*view)).collect::<Vec<_>>())?;
    npz.add("scene", &[frames.len()], &frames.iter().map(|(scene, _)| *scene as f64).collect::<Vec<_>>())?;
    npz.add("detector", &[rows.len()], &rows.iter().map(|row| row.detector as f64).collect::<Vec<_>>())?;
    let images: Vec<f64> = rows.iter().flat_map(|row| row.image_s_per_m2.iter().copied().map(f64::from)).collect();
    npz.add("image_s_per_m2", &[rows.len(), SIDE, SIDE], &images)?;
    let contacts: Vec<f64> = rows.iter().flat_map(|row| padded(row.contacts.as_deref().unwrap_or_default())).collect();
    npz.add("contacts", &[rows.len(), MOST, 3], &contacts)?;
    let count = |row: &Row| row.contacts.as_ref().map_or(-1.0, |contacts| contacts.len() as f64);
    npz.add("count", &[rows.len()], &rows.iter().map(count).collect::<Vec<_>>())?;
    npz.add("size_m", &[2], &detector.outline.size_m())?;
    let electrodes_m: Vec<f64> = detector.electrodes.iter().flat_map(|pad| [pad.x_m, pad.y_m]).collect();
    npz.add("electrodes_m", &[n, 2], &electrodes_m)?;
    npz.add("thickness_m", &[1], &[detector.thickness_m()])?;
    npz.add("sheet_s", &[1], &[detector.sheet_conductance_s()])?;
    npz.add("drive_v", &[1], &[detector.drive_v])?;
    npz.add("lsb_v", &[1], &[detector.adc.lsb_v()])?;
    Ok(npz.finish()?)
}

fn padded(contacts: &[[f64; 3]]) -> impl Iterator<Item = f64> {
    (0..MOST).flat_map(|index| contacts.get(index).copied().unwrap_or_default())
}
