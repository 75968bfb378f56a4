//! How strongly the paper's foams answer to one press, before any is cut: `cargo run --release --package tactomo --example compare_foams -- [NEWTONS]`.

use std::error::Error;

use tactomo::detector::{Detector, Stack};
use tactomo::forward::{readings_v, touched_impedance_ohm};
use tactomo::hertz::{Hertz, Skin};
use tactomo::scene::{Fingertip, Hand};
use tactomo::simulate::finer_model;

fn main() -> Result<(), Box<dyn Error>> {
    let force_n = std::env::args().nth(1).map_or(Ok(5.0), |text| text.parse())?;
    for foam in ["A", "B", "C", "D", "BC"] {
        let stack: Stack = foam.parse()?;
        let detector = Detector::default().in_material(&stack)?;
        let hertz = Hertz::new(&detector, Skin::from(&stack))?;
        let fingertip = Fingertip { hertz, force_n, radius_m: 0.008 };
        let press = Hand::in_newtons(&detector, fingertip).tip([0.01, 0.005], 1.0, 1.0);
        let model = finer_model(&detector, &[], 1)?;
        let readings = readings_v(&touched_impedance_ohm(&*model, &[press])?, &detector);
        println!("{foam:2}  largest reading {:6.1} mV", 1e3 * readings.largest_v());
    }
    Ok(())
}
