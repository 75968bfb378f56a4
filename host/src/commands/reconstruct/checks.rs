//! What makes a file doubtful as a whole, by its own readings.

use tactomo::board::frames::FileFrame;
use tactomo::detector::Detector;
use tactomo::readings::Readings;
use tactomo::solve::{TableDoubt, table_doubt};

use super::reader::Rest;
use super::units::Unit;

/// A reading is not near zero above this share of the drive: that of a grounded pad is, unless a converter's floor hides it.
const NEAR_ZERO: f64 = 0.03;
/// A reading is below zero beyond this share of the drive: offsets are less.
const BELOW_ZERO: f64 = 0.01;

/// How a table is given.
#[derive(Clone, Copy)]
pub struct TableChecks {
    /// Its unit.
    pub unit: Unit,
    /// Frames that are the baseline, if that is said.
    pub rest: Option<u32>,
}

/// What is doubtful in a file.
pub struct Doubts {
    checks: TableChecks,
    table: Option<TableDoubt>,
    /// The drive that it should have (V).
    drive_v: f64,
    /// The smallest of all readings, if no grounded pad is near zero (V).
    floor_v: Option<f64>,
    below: Option<Below>,
}

/// Readings below those at rest.
#[derive(Clone, Copy)]
struct Below {
    frames: usize,
    /// How far the lowest is below (V).
    lowest_v: f64,
    /// Whether any is below zero before the baseline is taken off.
    is_negative: bool,
}

impl TableChecks {
    /// What makes frames of a table (V) doubtful.
    pub fn doubts(self, frames: &[FileFrame], mut rest: Rest, detector: &Detector) -> Doubts {
        let touches: Vec<Readings> = frames.iter().filter_map(|frame| rest.take(frame)?.readings()).collect();
        let least_v = frames.iter().flat_map(|frame| &frame.volts).copied().fold(f64::INFINITY, f64::min);
        Doubts {
            table: table_doubt(&touches, detector),
            drive_v: detector.drive_v,
            floor_v: Some(least_v).filter(|least_v| *least_v > NEAR_ZERO * detector.drive_v),
            ..self.none()
        }
    }

    /// No doubt.
    pub fn none(self) -> Doubts {
        Doubts { checks: self, table: None, drive_v: 0.0, floor_v: None, below: None }
    }
}

impl Doubts {
    /// Takes note of a frame whose readings are so far below those at rest (V), if they are, and of what they were before the baseline was taken
    /// off (V).
    pub fn note(&mut self, below_v: Option<f64>, used_v: &[f64]) {
        let Some(below_v) = below_v else { return };
        let is_negative = used_v.iter().any(|volts| *volts < -BELOW_ZERO * self.drive_v.max(1.0));
        let before = self.below.unwrap_or(Below { frames: 0, lowest_v: 0.0, is_negative: false });
        self.below = Some(Below {
            frames: before.frames + 1,
            lowest_v: before.lowest_v.max(below_v),
            is_negative: before.is_negative || is_negative,
        });
    }

    /// Whether no answer is to be believed.
    pub fn is_of_all(&self) -> bool {
        self.table.is_some()
    }

    /// What is wrong with a table as a whole, in words, with what to do.
    pub fn of_table(&self) -> impl Iterator<Item = String> {
        let table = self.table.map(|doubt| self.words(doubt));
        let floor = self.floor_v.map(|floor_v| {
            format!(
                "no reading is below {floor_v:.3} V, though a grounded pad's is nearly 0: a converter with a floor? What is below it is not known then: give the \
                 recording itself, or what `tactomo export --to npz --fields readings` makes of it, which has the floor in it"
            )
        });
        [table, floor].into_iter().flatten()
    }

    fn words(&self, doubt: TableDoubt) -> String {
        match doubt {
            TableDoubt::Exchanged => "rows and columns seem to be exchanged, so no answer is right: a row has the readings of all electrodes while one is \
                                      grounded, one ground after the other; transpose each frame"
                .to_owned(),
            TableDoubt::Drive { fits_v } => format!(
                "taken as {}, the readings agree with each other only for a drive of {fits_v:.2} V, and the detector has {} V, so no conductance is right: are \
                 they in another unit (--unit V or mV; --adc BITS,FULL_SCALE_V for codes), or is drive_v of the detector another?",
                self.checks.unit.name(),
                self.drive_v
            ),
        }
    }

    /// What is wrong with the frames that were solved, in words, with what to do.
    pub fn of_frames(&self) -> Option<String> {
        let Below { frames, lowest_v, is_negative } = self.below?;
        let what = format!(
            "readings of {frames} frame{} are below the baseline, by up to {lowest_v:.3} V, which nothing that touches makes them",
            if frames == 1 { "" } else { "s" }
        );
        Some(match (is_negative, self.checks.rest) {
            (true, _) => format!("{what}: wrong sign? Where the reference is reversed, give the readings times -1"),
            (false, Some(rest)) => format!(
                "{what}: something pressed in the first {rest} frames, which --rest takes for rest. Begin the file, and --rest, with frames in which nothing \
                 touches (--rest 0 takes nothing off)"
            ),
            (false, None) => {
                format!(
                    "{what}: something pressed while the baseline was taken: give --rest a number of frames at the start in which nothing touches"
                )
            }
        })
    }
}
