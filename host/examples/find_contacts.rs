//! From a detector's description to contacts in a frame of readings: `cargo run --release --package tactomo --example find_contacts -- [DETECTOR.toml]`.

use std::error::Error;
use std::path::Path;

use tactomo::detector::Detector;
use tactomo::forward::readings_v;
use tactomo::scene::Contact;
use tactomo::simulate::finer_model;
use tactomo::solve::{Method, Problem};

fn main() -> Result<(), Box<dyn Error>> {
    let detector = match std::env::args().nth(1) {
        Some(file) => Detector::read(Path::new(&file))?,
        None => Detector::default(),
    };
    // In place of a board: readings of two presses, by a finer model than the one that is inverted.
    let presses = [Contact::flat(0.009, -0.006, 0.003, 2e-4), Contact::flat(-0.012, 0.01, 0.003, 4e-4)];
    let readings = readings_v(&finer_model(&detector, &[], 0)?.impedance_ohm(&presses)?, &detector);
    let mut solver = Method::Auto.build(&Problem::of(&detector)?)?;
    for contact in solver.solve(&readings)?.contacts {
        let [x_mm, y_mm, conductance_ms] = [contact.x_m, contact.y_m, contact.conductance_s].map(|si| 1e3 * si);
        println!("{x_mm:6.2} {y_mm:6.2} mm  {conductance_ms:.3} mS");
    }
    Ok(())
}
