//! Sweeps of a fault over all electrodes.

use super::sweep::{Bench, Point, Sweep};
use crate::simulate::Fault;
use crate::study::data::StudyError;
use crate::study::scenes::SceneKind;

/// A kind of fault: what is wrong with an electrode, and the next one.
type Kind = (&'static str, &'static str, fn(usize, usize) -> Fault);

const KINDS: [Kind; 5] = [
    ("A dead electrode", "Its wire is broken.", |electrode, _| Fault::Open { electrode }),
    ("Two electrodes shorted", "With the next one.", |electrode, next| Fault::Short {
        electrodes: [electrode, next],
        ohm: 0.0,
    }),
    ("Two electrodes exchanged", "With the next one.", |electrode, next| Fault::Swap { channels: [electrode, next] }),
    ("A channel of the wrong sign", "Full scale less the voltage.", |channel, _| Fault::Invert { channel }),
    ("A channel of the wrong gain", "0.8 of the voltage.", |channel, _| Fault::Gain { channel, factor: 0.8 }),
];

/// All of them.
pub fn sweeps(bench: &Bench) -> Result<Vec<Sweep>, StudyError> {
    KINDS.into_iter().map(|kind| sweep(bench, kind)).collect()
}

fn sweep(bench: &Bench, (title, note, fault): Kind) -> Result<Sweep, StudyError> {
    let count = bench.sound.detector.electrodes.len();
    let electrodes: Vec<usize> = (0..count).collect();
    let point = |label: String, severity: f64, faults: &[Fault]| -> Result<Point, StudyError> {
        bench.point(label, severity, bench.sound.with_faults(faults, bench.plan.seed)?, SceneKind::Firm)
    };
    let mut points = vec![point("none".to_owned(), 0.0, &[])?];
    for electrode in bench.some(&electrodes) {
        points.push(point(format!("no. {electrode}"), 1.0, &[fault(*electrode, (electrode + 1) % count)])?);
    }
    let note = format!("{note} On a firm contact, each electrode in turn, counted from 0.");
    Ok(Sweep { title, note, points })
}
