//! Contacts of a recording, frame by frame: `cargo run --release --package tactomo --example solve_recording -- FILE.tactomo`.

use std::error::Error;
use std::path::PathBuf;
use std::sync::Arc;

use tactomo::board::baseline::BaselineTracker;
use tactomo::board::frames::FrameFile;
use tactomo::board::measured::as_measured;
use tactomo::solve::{FaultTolerant, Method, Problem, Solver};

fn main() -> Result<(), Box<dyn Error>> {
    let path = PathBuf::from(std::env::args().nth(1).ok_or("give the file of a recording")?);
    let mut file = FrameFile::open(&path, None)?;
    let described = match file.header() {
        Some(header) => header.detector(&path)?.ok_or("its header does not say which detector it is of")?,
        None => return Err("it is a table, which does not say which detector it is of".into()),
    };
    // What the board's Hello says of its converters, a part of the detector from here on.
    let detector = match file.board() {
        Some(board) => {
            let measured = as_measured(&described, board)?;
            file.set_ground(measured.ground_v);
            measured
        }
        None => described,
    };
    let problem = Problem::of(&detector)?;
    let mut baseline = BaselineTracker::new(Arc::clone(&problem.jacobian), 1);
    // It leaves out electrodes that turn out to be broken.
    let mut solver = FaultTolerant::new(Method::Auto, &problem)?;
    while let Some(mut frame) = file.next_frame()? {
        frame.note_rest(&mut baseline);
        let used_v = frame.volts.clone();
        baseline.subtract(&used_v, &mut frame.volts);
        let Some(readings) = frame.readings() else { continue };
        for contact in solver.solve(&readings)?.contacts {
            let time_s = frame.time_s.unwrap_or_default();
            println!("{time_s:8.3} s  {:6.2} {:6.2} mm", 1e3 * contact.x_m, 1e3 * contact.y_m);
        }
    }
    Ok(())
}
