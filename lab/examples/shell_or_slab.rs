//! Where the thin shell is good enough: its error in the readings against the slab, over thickness and gradient.
//!
//! `cargo run --release --package tactomo-lab --example shell_or_slab -- [PAD_DEGREE]` prints one line for each thickness; the columns are ratios of the
//! conductivity at the top to that at the bottom. The slab resolves densities of `PAD_DEGREE` on its pads, 3 unless said.

use tactomo_physics::detector::{Detector, Layer};
use tactomo_physics::forward::shell::Shell;
use tactomo_physics::forward::{ForwardError, ForwardModel, Resolution, Slab, readings_v};
use tactomo_physics::scene::Contact;

/// Thicknesses (mm).
const THICKNESSES_MM: [f64; 8] = [0.25, 0.5, 1.0, 2.0, 4.0, 5.0, 8.0, 16.0];

/// Conductivity at the top over that at the bottom.
const RATIOS: [f64; 5] = [0.01, 0.1, 1.0, 10.0, 100.0];

/// Geometric mean of the conductivities (S/m).
const CONDUCTIVITY_S_PER_M: f64 = 0.2;

fn main() -> Result<(), ForwardError> {
    let degree = std::env::args().nth(1).and_then(|degree| degree.parse().ok()).unwrap_or(3);
    println!("error of the shell, % of the largest reading; top over bottom conductivity:");
    println!("{:>8} {}", "mm", RATIOS.map(|ratio| format!("{ratio:>8}")).concat());
    for thickness_mm in THICKNESSES_MM {
        let errors = RATIOS.map(|ratio| error(thickness_mm * 1e-3, ratio, degree));
        let cells = errors.into_iter().collect::<Result<Vec<_>, _>>()?;
        println!(
            "{thickness_mm:>8} {}",
            cells.iter().map(|error| format!("{:8.1}", 100.0 * error)).collect::<String>()
        );
    }
    Ok(())
}

/// Largest difference of a reading over the largest reading, worst of three contacts of 0.3 sheet conductances.
fn error(thickness_m: f64, ratio: f64, pad_degree: usize) -> Result<f64, ForwardError> {
    let mut detector = Detector::preset(Detector::DEFAULT).unwrap_or_else(|| unreachable!("the default is a preset"));
    let [bottom_s_per_m, top_s_per_m] = [-0.5, 0.5].map(|power| CONDUCTIVITY_S_PER_M * ratio.powf(power));
    detector.layers = vec![Layer::graded(thickness_m, [bottom_s_per_m, top_s_per_m])];
    let slab = Slab::with_resolution(&detector, Resolution { pad_degree, ..Resolution::FINE })?;
    let shell = Shell::with_nodes(&detector, 10_000)?;
    let conductance_s = 0.3 * detector.sheet_conductance_s();
    let places_m = [[0.001, 0.002], [-0.012, 0.007], [0.021, -0.017]];
    let mut worst = 0.0_f64;
    for [x_m, y_m] in places_m {
        let contacts = [Contact::flat(x_m, y_m, 0.003, conductance_s)];
        let [a, b] = [&shell as &dyn ForwardModel, &slab].map(|model| model.impedance_ohm(&contacts));
        let (a, b) = (readings_v(&a?, &detector), readings_v(&b?, &detector));
        let largest_v = a.volts().iter().zip(b.volts()).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        worst = worst.max(largest_v / b.largest_v());
    }
    Ok(worst)
}
