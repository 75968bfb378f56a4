//! Images of conductivity in a round tank, on the thin shell: `cargo run --release --package tactomo-lab --example tank -- FRAMES OUT`.
//!
//! Tanks of electrical impedance tomography have what our sensors lack, readings that were measured with a known answer. Nothing lies on a tank, so its
//! readings are no contacts, and none of our solvers applies; but the fields of the shell do. Of a current between one pair of neighbours and a
//! voltage between another, the conductivity of a triangle changes the voltage by `-grad u . grad w` times its area, by the fields `u` and `w` of
//! both pairs (Geselowitz, "An application of electrocardiographic lead theory to impedance plethysmography", 1971). The image is one step of
//! Gauss and Newton, `W^-1 J' (J W^-1 J' + l)^-1 d`, of relative changes `d` of readings, `W` the diagonal of `J' J` to the power 0.5 and
//! `l` 0.01, which `tools/compare_tank.py` has pyEIT take too.
//!
//! FRAMES is NPZ with `frames`, rows of 208 relative changes: the drives (1, 2), (2, 3), ... in turn and for each the pairs of neighbours that have no
//! electrode in common with it, by number. Electrodes are 16 on the rim, the first at the top and the others clockwise; lengths are in radii of the
//! tank. OUT is NPZ with `rest`, 208 readings of the even tank over those of a sheet of 1 S, `nodes`, `triangles`, `image` (a value a triangle, a
//! row a frame: the change of the conductivity over it).

use std::f64::consts::{FRAC_PI_2, PI, TAU};
use std::fs::File;
use std::path::Path;

use anyhow::{Context, Result, bail, ensure};
use nalgebra::{Cholesky, DMatrix, Vector2};
use tactomo_physics::detector::{Detector, Electrode, Layer, Outline};
use tactomo_physics::forward::ForwardModel;
use tactomo_physics::forward::shell::Shell;
use tactomo_physics::geometry;
use tactomo_table::{NpzWriter, Table};

const ELECTRODES: usize = 16;
const READINGS: usize = 208;
/// As many nodes as give about as many triangles as pyEIT's mesh of size 0.06.
const NODES: usize = 1000;
/// Corners of the outline.
const CORNERS: usize = 128;
/// Width of an electrode on the wall: 1 cm in a tank of 20 cm.
const WIDTH: f64 = 0.1;
/// Radius of a pad inside that touches the wall and is as large to the current: with their mirror images in it, two discs that touch have the logarithmic
/// capacity `pi r / 2`, a plate has `width / 4`.
const PAD: f64 = WIDTH / (2.0 * PI);
/// How far the middle of a pad is from the rim, in its radii: the mesh wants 1.05 of them to the outline, whose sides are nearer than its corners.
const INSIDE: f64 = 1.08;
const POWER: f64 = 0.5;
const LAMBDA: f64 = 0.01;

fn main() -> Result<()> {
    let mut words = std::env::args().skip(1);
    let (frames, out) = words.next().zip(words.next()).context("two files are needed: FRAMES and OUT")?;
    let frames = frames_of(Path::new(&frames))?;
    let shell = Shell::with_nodes(&tank()?, NODES)?;
    let (mesh, triangles) = (shell.image_mesh(), triangles(&shell));
    let (rest, jacobian) = (rest(&shell), jacobian(&shell, &triangles));
    let image = image(&jacobian, &rest, &frames)?;
    let mut file = NpzWriter::new(File::create(out)?);
    file.add("rest", &[READINGS], &rest)?;
    file.add("nodes", &[mesh.nodes_m.len(), 2], &mesh.nodes_m.concat())?;
    let corners: Vec<f64> = triangles.iter().flatten().map(|&corner| f64::from(corner)).collect();
    file.add("triangles", &[triangles.len(), 3], &corners)?;
    file.add("image", &[frames.ncols(), triangles.len()], image.as_slice())?;
    file.finish()?;
    Ok(())
}

/// `readings x frames`.
fn frames_of(path: &Path) -> Result<DMatrix<f64>> {
    let frames = Table::read(path)?.array(&["frames"]).map_err(anyhow::Error::msg)?;
    ensure!(
        frames.columns() == READINGS,
        "{} has {}, rows of {READINGS} are needed",
        path.display(),
        frames.shape_text()
    );
    Ok(DMatrix::from_column_slice(READINGS, frames.rows(), &frames.values))
}

fn tank() -> Result<Detector> {
    let at = |radius: f64, angle: f64| [radius * angle.cos(), radius * angle.sin()];
    let outer = (0..CORNERS).map(|corner| at(1.0, TAU * corner as f64 / CORNERS as f64)).collect();
    let mut detector = Detector::preset(Detector::DEFAULT).context("no preset")?.taken_as_exact();
    let pad = detector.electrodes[0];
    detector.electrodes = (0..ELECTRODES)
        .map(|electrode| {
            let [x_m, y_m] = at(1.0 - INSIDE * PAD, FRAC_PI_2 - TAU * electrode as f64 / ELECTRODES as f64);
            Electrode { x_m, y_m, radius_m: PAD, ..pad }
        })
        .collect();
    detector.outline = Outline { outer, holes: Vec::new() };
    detector.layers = vec![Layer::uniform(1.0, 1.0)];
    Ok(detector)
}

fn pair(first: usize) -> [usize; 2] {
    [first, (first + 1) % ELECTRODES]
}

/// Drives and reads that have no electrode in common.
fn readings() -> impl Iterator<Item = [[usize; 2]; 2]> {
    let all = (0..ELECTRODES).flat_map(|drive| (0..ELECTRODES).map(move |read| [pair(drive), pair(read)]));
    all.filter(|[drive, read]| drive.iter().all(|electrode| !read.contains(electrode)))
}

/// Voltages of the even tank for a current of 1 A (V).
fn rest(shell: &Shell) -> Vec<f64> {
    let pads = shell.electrode_fields_ohm();
    let volts = |[drive, read]: [[usize; 2]; 2]| {
        let at = |electrode: usize| pads[(electrode, drive[0])] - pads[(electrode, drive[1])];
        at(read[0]) - at(read[1])
    };
    readings().map(volts).collect()
}

/// Those that are under no pad: a pad conducts, and what is under it changes nothing.
fn triangles(shell: &Shell) -> Vec<[u32; 3]> {
    let mesh = shell.image_mesh();
    let is_free = |corners: &&[u32; 3]| {
        let [a, b, c] = corners.map(|node| mesh.nodes_m[node as usize]);
        let middle = [0, 1].map(|axis| (a[axis] + b[axis] + c[axis]) / 3.0);
        let pads = &shell.detector().electrodes;
        pads.iter().all(|pad| geometry::distance(middle, [pad.x_m, pad.y_m]) > pad.radius_m)
    };
    mesh.triangles.iter().filter(is_free).copied().collect()
}

/// Change of the voltages by the logarithm of each triangle's conductivity: `readings x triangles`.
fn jacobian(shell: &Shell, triangles: &[[u32; 3]]) -> DMatrix<f64> {
    let (mesh, fields) = (shell.image_mesh(), shell.fields_ohm());
    let readings: Vec<_> = readings().collect();
    let mut jacobian = DMatrix::zeros(readings.len(), triangles.len());
    for (index, corners) in triangles.iter().enumerate() {
        let [a, b, c] = corners.map(|node| mesh.nodes_m[node as usize]);
        let area = geometry::cross(a, b, c).abs() / 2.0;
        let of = |electrode: usize| {
            gradient(corners.map(|node| (mesh.nodes_m[node as usize], fields[(node as usize, electrode)])), area)
        };
        let gradients: Vec<_> = (0..ELECTRODES).map(of).collect();
        let between = |[a, b]: [usize; 2]| gradients[a] - gradients[b];
        for (row, [drive, read]) in readings.iter().enumerate() {
            jacobian[(row, index)] = -area * between(*drive).dot(&between(*read));
        }
    }
    jacobian
}

/// Gradient of what is linear between corners with such values.
fn gradient(corners: [([f64; 2], f64); 3], area: f64) -> Vector2<f64> {
    let opposite = |corner: usize| {
        let ([a, b], value) = ([corners[(corner + 1) % 3].0, corners[(corner + 2) % 3].0], corners[corner].1);
        Vector2::new(a[1] - b[1], b[0] - a[0]) * value
    };
    (opposite(0) + opposite(1) + opposite(2)) / (2.0 * area)
}

/// `triangles x frames`.
fn image(jacobian: &DMatrix<f64>, rest: &[f64], frames: &DMatrix<f64>) -> Result<DMatrix<f64>> {
    let relative =
        DMatrix::from_fn(jacobian.nrows(), jacobian.ncols(), |row, column| jacobian[(row, column)] / rest[row]);
    let weights: Vec<f64> = relative.column_iter().map(|column| column.norm_squared().powf(POWER)).collect();
    let over = DMatrix::from_fn(relative.ncols(), relative.nrows(), |triangle, row| {
        relative[(row, triangle)] / weights[triangle]
    });
    let system = &relative * &over + LAMBDA * DMatrix::identity(relative.nrows(), relative.nrows());
    let Some(factor) = Cholesky::new(system) else { bail!("the readings do not determine an image") };
    Ok(over * factor.solve(frames))
}
