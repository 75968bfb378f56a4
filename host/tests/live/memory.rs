//! Memory stays flat, however long the picture runs. For an hour's worth of frames:
//! `TACTOMO_FRAMES=3600000 cargo test --release -p tactomo --test live memory -- --nocapture` (some minutes).

use std::sync::Arc;

use crate::fake::{FakeBoard, Patient, ends, options, solving};
use tactomo::forward::jacobian::Jacobian;
use tactomo::forward::shell::Shell;
use tactomo::run::options::{MakeSolver, RunOptions};
use tactomo::solve::{Lambda, Tikhonov, Variant};

/// Resident memory of this process (kB).
fn resident_kb() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap();
    let line = status.lines().find(|line| line.starts_with("VmRSS:")).unwrap();
    line.split_whitespace().nth(1).unwrap().parse().unwrap()
}

/// Resident memory (kB) after `frames` frames through the whole pipeline, a page looking on.
fn resident_after(frames: u64) -> u64 {
    let make: MakeSolver = Arc::new(|order| {
        let jacobian = Jacobian::of(&Shell::new(&order.detector)?);
        Ok(Box::new(Tikhonov::new(&jacobian, Lambda::default(), Variant::Balanced)))
    });

    let (ends, _page) = ends();
    let mut source = Patient(Some(FakeBoard { skip_every: 1000, junk_every: 1000, ..FakeBoard::new(frames) }));
    let summary =
        tactomo::run::run(&mut source, RunOptions { solving: Some(solving(make)), ..options() }, ends).unwrap();
    assert_eq!(summary.frames, frames);
    let resident_kb = resident_kb();
    eprintln!(
        "{frames} frames: {resident_kb} kB resident, {:.0} frames/s, {:?}",
        summary.frames_per_s, summary.latency_us
    );
    resident_kb
}

/// Frames to run: a few seconds' worth, or `TACTOMO_FRAMES`.
fn frames() -> u64 {
    std::env::var("TACTOMO_FRAMES").map_or(12_000, |frames| frames.parse().unwrap())
}

#[test]
fn memory_is_flat() {
    let first_kb = resident_after(2_000);
    let last_kb = resident_after(frames());
    assert!(last_kb < first_kb + 8_000, "{first_kb} kB after 2000 frames, then {last_kb} kB");
    assert!(last_kb < 100_000, "{last_kb} kB");
}
