//! A contact that moves, found by whole frames and by rows as they come, on an ESP32's budget.
//!
//! `cargo run --release -p tactomo-touch --example rows -- [SPEED_M_PER_S [SHEETS [SEED]]]`, by default 0.5 m/s, 0.3 sheet conductances, seed 1.
//! A row takes 0.13 ms to read; the wire carries 92 bytes a millisecond. Errors are in mm: against where the contact was in the middle of the
//! frame's rows, and against where it is when the frame has arrived.

use tactomo_physics::detector::Detector;
use tactomo_physics::forward::readings_v;
use tactomo_physics::readings::Readings;
use tactomo_physics::scene::Contact;
use tactomo_physics::simulate::{Noise, finer_model, measured};
use tactomo_touch::solve::{ContactSettings, Contacts, Latest, Problem, Solver};

const ROW_S: f64 = 0.13e-3;
const BYTES_PER_S: f64 = 92_160.0;
const FRAMES: usize = 150;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let argument = |index: usize, default: f64| std::env::args().nth(index).map_or(Ok(default), |text| text.parse());
    let (speed, sheets, seed) = (argument(1, 0.5)?, argument(2, 0.3)?, argument(3, 1.0)? as u64);
    let mut detector = Detector::preset(Detector::DEFAULT).ok_or("no preset")?.taken_as_exact();
    detector.adc.noise_lsb = 1.5;
    let fine = finer_model(&detector, &[], seed)?;
    let problem = Problem::of(&detector)?;
    let whole: Vec<usize> = (0..16).collect();
    println!("{:<28} {:>8} {:>10} {:>10} {:>8} {:>8}", "plan", "per s", "then mm", "arrived mm", "found %", "us");
    for (name, plan, rows) in [
        ("whole", whole.clone(), 16),
        ("four: 0 3 12 15", vec![0, 3, 12, 15], 4),
        ("two: 5 10", vec![5, 10], 2),
        ("one: 5 10 6 9", vec![5, 10, 6, 9], 1),
        ("two of 5 10 6 9 and all", interleaved(), 2),
        ("all, two by two", whole.clone(), 2),
    ] {
        let mut noise = Noise::new(seed);
        let mut solver = Contacts::new(&problem, ContactSettings::of(&problem))?;
        let mut latest = Latest::new(16);
        let bytes = if rows == 16 { 380 } else { 21 + rows + 22 * rows };
        let frame_s = (bytes as f64 / BYTES_PER_S).max(rows as f64 * ROW_S);
        let (mut then, mut arrived, mut found, mut spent) = (0.0, 0.0, 0, std::time::Duration::ZERO);
        let frames = if rows == 16 { FRAMES } else { 4 * FRAMES };
        for frame in 0..frames {
            let start_s = frame as f64 * frame_s;
            let mut readings = Readings::from_fn(16, |_, _| 0.0);
            let mut read = [false; 16];
            for row in 0..rows {
                let g = plan[(frame * rows + row) % plan.len()];
                let truth = contact(&detector, speed, sheets, start_s + row as f64 * ROW_S);
                let exact = readings_v(&fine.impedance_ohm(&[truth])?, &detector);
                let noisy = measured(&exact, &detector.adc, &mut noise);
                (0..16).for_each(|e| readings.volts_mut()[16 * g + e] = noisy.at(g, e));
                read[g] = true;
            }
            let readings = readings.hiding(|g, _| !read[g]);
            latest.add(&readings, frame_s, None);
            let begun = std::time::Instant::now();
            let solution = match rows {
                16 => solver.solve(&readings)?,
                _ => solver.solve_rows(&readings, &latest.readings(1.0, None), frame_s)?,
            };
            spent += begun.elapsed();
            if frame >= frames / 4
                && let [contact_found] = solution.contacts[..]
            {
                let off = |time_s: f64| {
                    let truth = contact(&detector, speed, sheets, time_s);
                    1e3 * (truth.x_m - contact_found.x_m).hypot(truth.y_m - contact_found.y_m)
                };
                let scanned_s = start_s + rows as f64 * ROW_S;
                then += off(start_s + 0.5 * (rows as f64 - 1.0) * ROW_S);
                arrived += off(scanned_s + bytes as f64 / BYTES_PER_S);
                found += 1;
            }
        }
        let counted = (frames - frames / 4) as f64;
        println!(
            "{name:<28} {:>8.0} {:>10.3} {:>10.3} {:>8.0} {:>8.0}",
            1.0 / frame_s,
            then / f64::from(found.max(1)),
            arrived / f64::from(found.max(1)),
            100.0 * f64::from(found) / counted,
            1e6 * spent.as_secs_f64() / frames as f64
        );
    }
    Ok(())
}

/// Two rows a frame, of which every fourth frame has one of all grounds in turn.
fn interleaved() -> Vec<usize> {
    let focus = [5, 10, 6, 9];
    (0..64).map(|row| if row % 4 == 3 { row / 4 } else { focus[row % 3 + usize::from(row % 8 > 3)] }).collect()
}

/// A contact that runs on a circle of 15 mm.
fn contact(detector: &Detector, speed_m_per_s: f64, sheets: f64, time_s: f64) -> Contact {
    let radius_m = 0.015;
    let (sin, cos) = (speed_m_per_s * time_s / radius_m).sin_cos();
    Contact::flat(radius_m * cos, radius_m * sin, 0.0025, sheets * detector.sheet_conductance_s())
}
