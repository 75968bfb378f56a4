//! Cost of the thin shell: `cargo bench --package tactomo --bench shell`.
//!
//! Arguments are nodes of the mesh, about, on the detector `square-60`.

use divan::{Bencher, black_box};
use tactomo::detector::Detector;
use tactomo::forward::jacobian::Jacobian;
use tactomo::forward::shell::{Mesh, Shell};
use tactomo::forward::{ForwardModel, readings_v};
use tactomo::readings::Readings;
use tactomo::scene::Contact;
use tactomo::solve::{Lambda, Solver, Tikhonov, Variant};

const NODES: [usize; 5] = [500, 2000, 5000, 20_000, 50_000];
const CONTACT: Contact = Contact::flat(0.004, -0.009, 0.003, 1e-3);

fn main() {
    divan::main();
}

fn detector() -> Detector {
    Detector::preset(Detector::DEFAULT).unwrap_or_else(|| panic!("no preset"))
}

fn shell(nodes: usize) -> Shell {
    Shell::with_nodes(&detector(), nodes).unwrap_or_else(|error| panic!("{error}"))
}

fn readings() -> Readings {
    let shell = shell(5000);
    let impedance_ohm = shell.impedance_ohm(&[CONTACT]).unwrap_or_else(|error| panic!("{error}"));
    readings_v(&impedance_ohm, shell.detector())
}

/// Triangles alone.
#[divan::bench(args = NODES)]
fn mesh(bencher: Bencher, nodes: usize) {
    let detector = detector();
    bencher.bench(|| Mesh::new(black_box(&detector), nodes));
}

/// From the description of the detector to the Jacobian's factors: mesh, matrix, factorisation, 16 fields.
#[divan::bench(args = NODES)]
fn jacobian(bencher: Bencher, nodes: usize) {
    let detector = detector();
    bencher.bench(|| Shell::with_nodes(black_box(&detector), nodes));
}

/// From a model to an image operator: two QR and one SVD.
#[divan::bench(args = NODES)]
fn tikhonov(bencher: Bencher, nodes: usize) {
    let jacobian = Jacobian::of(&shell(nodes));
    bencher.bench(|| Tikhonov::new(black_box(&jacobian), Lambda::default(), Variant::Balanced));
}

/// Impedance matrix for one contact that stays where it is: from the fields between the nodes it touches, or, where they are
/// many, a factorisation and 16 solves.
#[divan::bench(args = NODES)]
fn one_contact(bencher: Bencher, nodes: usize) {
    let shell = shell(nodes);
    bencher.bench(|| shell.impedance_ohm(black_box(&[CONTACT])));
}

/// The same for a contact that comes everywhere; what is found out of nodes on the way is kept.
#[divan::bench(args = NODES)]
fn moving_contact(bencher: Bencher, nodes: usize) {
    let shell = shell(nodes);
    let mut angle = 0.0_f64;
    bencher.bench_local(move || {
        angle += 0.005;
        let at = [0.026 * (1.3 * angle).sin(), 0.026 * angle.sin()];
        shell.impedance_ohm(black_box(&[Contact { x_m: at[0], y_m: at[1], ..CONTACT }]))
    });
}

/// Impedance matrix by factorising anew, for comparison.
#[divan::bench(args = NODES)]
fn refactorised_contact(bencher: Bencher, nodes: usize) {
    let shell = shell(nodes);
    let conductances_s = shell.node_conductances_s(&[CONTACT]).unwrap_or_else(|error| panic!("{error}"));
    bencher.bench(|| shell.image_fields(black_box(&conductances_s)));
}

/// Linear image of one frame.
#[divan::bench(args = NODES)]
fn image(bencher: Bencher, nodes: usize) {
    let tikhonov = Tikhonov::new(&Jacobian::of(&shell(nodes)), Lambda::default(), Variant::Balanced);
    let readings = readings();
    bencher.bench(|| tikhonov.image_s_per_m2(black_box(&readings)));
}

/// Linear image of one frame, and the contacts in it.
#[divan::bench(args = NODES)]
fn image_and_contacts(bencher: Bencher, nodes: usize) {
    let mut tikhonov = Tikhonov::new(&Jacobian::of(&shell(nodes)), Lambda::default(), Variant::Balanced);
    let readings = readings();
    bencher.bench_local(|| tikhonov.solve(black_box(&readings)));
}

/// The same image by a dense matrix of `nodes x 256`, for comparison.
#[divan::bench(args = [2000])]
fn image_by_dense_matrix(bencher: Bencher, nodes: usize) {
    let matrix = nalgebra::DMatrix::<f32>::from_element(nodes, 256, 0.5);
    let volts = nalgebra::DVector::<f32>::from_element(256, 0.1);
    bencher.bench(|| black_box(&matrix) * black_box(&volts));
}
