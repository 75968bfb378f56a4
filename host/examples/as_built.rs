//! What a detector that is not quite the one described does to a solver: `cargo run --release --package tactomo --example as_built -- [SEED]`.

use std::error::Error;

use tactomo::detector::Detector;
use tactomo::forward::readings_v;
use tactomo::scene::Contact;
use tactomo::simulate::{drawn, finer_model};
use tactomo::solve::{Method, Problem};

fn main() -> Result<(), Box<dyn Error>> {
    let seed = std::env::args().nth(1).map_or(Ok(7), |text| text.parse())?;
    let described = Detector::default();
    let built = drawn(&described, seed);
    let press = Contact::flat(0.012, -0.008, 0.003, 3e-4);
    let readings = readings_v(&finer_model(&built, &[], 0)?.impedance_ohm(&[press])?, &described);
    // By its description, with its tolerances; and as it was built, which a calibration finds.
    for (whose, detector) in [("described", described), ("built", built)] {
        let mut solver = Method::Contacts.build(&Problem::of(&detector)?)?;
        let solution = solver.solve(&readings)?;
        let found = solution.contacts.first().ok_or("nothing is found")?;
        let off_mm = 1e3 * (found.x_m - press.x_m).hypot(found.y_m - press.y_m);
        let sigma_mm = found.uncertainty.map_or(f64::NAN, |sigma| 1e3 * sigma.x_m.hypot(sigma.y_m));
        println!("as {whose}: off by {off_mm:.3} mm, standard error {sigma_mm:.3} mm");
    }
    Ok(())
}
