//! How fast the linear image is: `cargo run --release --package tactomo-lab --example speed -- [NODES]`.
//!
//! Makes the thin shell of `square-60` on about so many nodes and the linear image for it, and images a frame many times, on one core.
//! Prints `{nodes, set_up_s, image_us, frame_us}`: medians of processor time, from the detector to the first frame, for the image of readings
//! as they are, and for a frame as users get it: the force taken out first, the image, and the contacts in it.
//! `tools/compare_pyeit.py` sets it against pyEIT.

use std::hint::black_box;

use anyhow::{Context, Result};
use tactomo_physics::detector::Detector;
use tactomo_physics::forward::jacobian::Jacobian;
use tactomo_physics::forward::shell::Shell;
use tactomo_physics::forward::{ForwardModel, readings_v};
use tactomo_physics::scene::Contact;
use tactomo_study::stopwatch::timed;
use tactomo_touch::solve::{Lambda, Solver, Tikhonov, Variant};

const SET_UPS: usize = 15;
const FRAMES: usize = 2000;

fn main() -> Result<()> {
    let nodes =
        std::env::args().nth(1).map_or(Ok(2000), |nodes| nodes.parse()).context("a number of nodes is needed")?;
    let detector = Detector::preset(Detector::DEFAULT).context("no preset")?.taken_as_exact();
    let shell = Shell::with_nodes(&detector, nodes)?;
    let impedance_ohm = shell.impedance_ohm(&[Contact::flat(0.009, -0.006, 0.003, 2e-4)])?;
    let readings = readings_v(&impedance_ohm, &detector);
    let solver = |variant| -> Result<Tikhonov> {
        let jacobian = Jacobian::of(&Shell::with_nodes(&detector, nodes)?);
        Ok(Tikhonov::new(&jacobian, Lambda::default(), variant))
    };
    let set_up_us = median_us(SET_UPS, || solver(Variant::Balanced).map(|solver| drop(black_box(solver))))?;
    let as_read = solver(Variant::Paper)?;
    let image_us = median_us(FRAMES, || {
        black_box(as_read.image_s_per_m2(black_box(&readings))?);
        Ok(())
    })?;
    let mut balanced = solver(Variant::Balanced)?;
    let frame_us = median_us(FRAMES, || {
        black_box(balanced.solve(black_box(&readings))?);
        Ok(())
    })?;
    let nodes = shell.image_mesh().nodes_m.len();
    let set_up_s = set_up_us * 1e-6;
    println!(
        "{{\"nodes\": {nodes}, \"set_up_s\": {set_up_s:.6}, \"image_us\": {image_us:.3}, \"frame_us\": {frame_us:.3}}}"
    );
    Ok(())
}

fn median_us(times: usize, mut run: impl FnMut() -> Result<()>) -> Result<f64> {
    let one = |_| {
        let (done, taken) = timed(&mut run);
        done.map(|()| taken.as_secs_f64() * 1e6)
    };
    let mut all = (0..times).map(one).collect::<Result<Vec<_>>>()?;
    all.sort_by(f64::total_cmp);
    Ok(all[times / 2])
}
