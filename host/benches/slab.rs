//! The slab model: making it, and its readings.

use divan::Bencher;
use tactomo::detector::Detector;
use tactomo::forward::{ForwardModel, Slab, readings_v};
use tactomo::scene::Contact;

fn main() {
    divan::main();
}

fn detector() -> Detector {
    Detector::preset(Detector::DEFAULT).unwrap_or_else(|| unreachable!("the default is a preset"))
}

fn slab() -> Slab {
    Slab::new(&detector()).unwrap_or_else(|error| unreachable!("{error}"))
}

fn bonded(preset: &str) -> Slab {
    let detector = Detector::preset(preset).unwrap_or_else(|| unreachable!("{preset} is a preset"));
    Slab::new(&detector).unwrap_or_else(|error| unreachable!("{error}"))
}

/// Contacts of 2 mm radius in a row across the detector.
fn contacts(count: usize) -> Vec<Contact> {
    let place = |i: usize| 0.05 * ((i as f64 + 0.5) / count as f64 - 0.5);
    (0..count).map(|i| Contact::flat(place(i), 0.3 * place(i), 0.002, 1e-3)).collect()
}

/// All fields of square-60 on its image grid, ready to solve with.
#[divan::bench]
fn fields_of_square_60(bencher: Bencher) {
    bencher.bench(slab);
}

/// Readings for a number of contacts.
#[divan::bench(args = [1, 2, 5])]
fn readings(bencher: Bencher, count: usize) {
    let (slab, contacts) = (slab(), contacts(count));
    bencher.bench(|| slab.impedance_ohm(&contacts).map(|z| readings_v(&z, slab.detector())));
}

/// Readings for an image of conductance on all of its nodes.
#[divan::bench(args = [100, 400, 900])]
fn image(bencher: Bencher, nodes: usize) {
    let slab = slab().on_image(nodes);
    let image_s = vec![1e-5; slab.image_mesh().nodes_m.len()];
    bencher.bench(|| slab.image_fields(&image_s).map(|fields| readings_v(&fields.impedance_ohm, slab.detector())));
}

/// All fields of two layers joined by dots of glue, ready to solve with.
#[divan::bench(args = ["BB-5x5", "BB-7x7"])]
fn fields_of_bonded(bencher: Bencher, preset: &str) {
    bencher.bench(|| bonded(preset));
}

/// Readings for a number of contacts on a detector of 49 dots.
#[divan::bench(args = [1, 2, 5])]
fn readings_of_bonded(bencher: Bencher, count: usize) {
    let (slab, contacts) = (bonded("BB-7x7"), contacts(count));
    bencher.bench(|| slab.impedance_ohm(&contacts).map(|z| readings_v(&z, slab.detector())));
}
