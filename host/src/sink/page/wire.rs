//! What passes the socket. The page's side is `web/protocol.js`.
//!
//! Program to page, one message at a time, the next only after the page has answered `"taken"`:
//!
//! - [`setup`](super::setup), JSON, once: what does not change while the program runs, and how updates are to be read.
//! - `status`, JSON, four times a second, and ten times while the detector is calibrated: the link, the board, the counts, what is played and
//!   recorded, and how the [calibration](super::calibrating) is.
//! - an update, binary, at most about sixty times a second: the newest answered frame, as in [`update`](super::update).
//!
//! Page to program, JSON: see [`messages`](super::messages).

use std::borrow::Cow;

use serde::Serialize;
use tactomo_protocol::Hello;

use super::calibrating::CalibratingMessage;
use crate::run::{Latency, LinkState, Scan, Snapshot, SolverState};
use tactomo_board::link::Playing;
use tactomo_touch::solve::Method;
use tactomo_touch::vibration::{Peak, Spectrum};

#[derive(Serialize)]
struct StatusMessage<'a> {
    r#type: &'static str,
    link: LinkMessage<'a>,
    hello: Option<HelloMessage<'a>>,
    scan: ScanMessage<'a>,
    solver: Option<SolverStateMessage<'a>>,
    statistics: StatisticsMessage,
    vibration: Option<VibrationMessage>,
    rezeroing: bool,
    rezeros: u64,
    playing: PlayingMessage,
    recording: Option<String>,
    marks: u64,
    refused: Option<&'a str>,
    baseline: Option<&'a str>,
    wires: Option<&'static str>,
    calibration: Option<&'a str>,
    /// What was learned of the detector, as a part of a sentence.
    learned: Option<String>,
    /// The name of the file that was taken from.
    learned_from: Option<Cow<'a, str>>,
    calibrating: Option<CalibratingMessage<'a>>,
}

/// The spectrum of the mean reading.
#[derive(Serialize)]
struct VibrationMessage {
    step_hz: f32,
    amplitudes_v: Vec<f32>,
    peak: Option<Peak>,
}

/// What the link plays.
#[derive(Serialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
enum PlayingMessage {
    Board,
    Simulated {
        scene: String,
        faults: Vec<String>,
    },
    Recording {
        position_s: f64,
        length_s: f64,
        /// `None` for as fast as it can be read.
        speed: Option<f64>,
        paused: bool,
        looped: bool,
        ended: bool,
        /// What is damaged in it, as far as it was played.
        damage: Option<String>,
    },
}

#[derive(Serialize)]
struct LinkMessage<'a> {
    state: &'static str,
    reason: Option<&'a str>,
}

/// Which rows come.
#[derive(Serialize)]
struct ScanMessage<'a> {
    /// As after `--scan`.
    choice: String,
    /// Grounds of the rows that come most; none if whole frames come.
    grounds: &'a [u8],
    /// Whether others have their turn between these.
    others: bool,
}

#[derive(Serialize)]
struct HelloMessage<'a> {
    board: &'a str,
    firmware: &'a str,
    electrodes: u8,
    adc_bits: u8,
    full_scale_v: f64,
    drive_v: f64,
    settle_us: u16,
    averages: u32,
    max_frames_per_s: u16,
    select_us: u16,
    discarded: u8,
}

#[derive(Serialize)]
struct SolverStateMessage<'a> {
    name: &'static str,
    making: Option<&'static str>,
    refused: Option<&'a str>,
}

#[derive(Serialize)]
struct StatisticsMessage {
    frames: u64,
    frames_per_s: f64,
    folded: u64,
    dropped: u64,
    skipped: u64,
    solved_per_s: f64,
    corrupt: u64,
    age_us: Latency,
}

/// The `status` message; `rezeros` counts the re-zeros that pages asked for.
pub(super) fn status(snapshot: &Snapshot, rezeros: u64) -> serde_json::Result<String> {
    let counts = &snapshot.statistics;
    serde_json::to_string(&StatusMessage {
        r#type: "status",
        link: link(&snapshot.link),
        hello: snapshot.hello.as_ref().map(hello),
        scan: scan(&snapshot.scan),
        solver: snapshot.solver.as_ref().map(solver_state),
        statistics: StatisticsMessage {
            frames: counts.frames,
            frames_per_s: counts.frames_per_s,
            folded: counts.folded,
            dropped: counts.dropped,
            skipped: counts.skipped,
            solved_per_s: counts.solved_per_s,
            corrupt: counts.corrupt,
            age_us: counts.age,
        },
        vibration: snapshot.course.spectrum().map(|Spectrum { step_hz, amplitudes, peak }| VibrationMessage {
            step_hz: step_hz as f32,
            amplitudes_v: amplitudes.into_iter().map(|amplitude| amplitude as f32).collect(),
            peak,
        }),
        rezeroing: snapshot.answer.as_ref().is_some_and(|answer| answer.is_taking_baseline),
        rezeros,
        playing: playing(&snapshot.playing),
        recording: snapshot.recording.as_ref().map(|path| path.display().to_string()),
        marks: snapshot.marks,
        refused: snapshot.refused.first(),
        baseline: snapshot.baseline.as_deref(),
        wires: snapshot.wires,
        calibration: snapshot.calibration.as_deref(),
        learned: snapshot.learned.map(|learned| learned.to_string()),
        learned_from: snapshot.learned_from.as_ref().and_then(|file| Some(file.file_name()?.to_string_lossy())),
        calibrating: snapshot.calibrating.as_deref().map(CalibratingMessage::of),
    })
}

fn playing(playing: &Playing) -> PlayingMessage {
    match playing {
        Playing::Board => PlayingMessage::Board,
        Playing::Simulated { scene, faults } => PlayingMessage::Simulated {
            scene: scene.to_string(),
            faults: faults.iter().map(ToString::to_string).collect(),
        },
        Playing::Recording { position_s, length_s, speed, paused, looped, ended, damage } => {
            PlayingMessage::Recording {
                position_s: *position_s,
                length_s: *length_s,
                speed: speed.is_finite().then_some(*speed),
                paused: *paused,
                looped: *looped,
                ended: *ended,
                damage: damage.is_any().then(|| damage.to_string()),
            }
        }
    }
}

fn scan(scan: &Scan) -> ScanMessage<'_> {
    ScanMessage { choice: scan.choice.to_string(), grounds: &scan.grounds, others: scan.others }
}

fn solver_state(state: &SolverState) -> SolverStateMessage<'_> {
    SolverStateMessage {
        name: state.method.name(),
        making: state.making.map(Method::name),
        refused: state.refused.as_deref(),
    }
}

fn link(link: &LinkState) -> LinkMessage<'_> {
    let (state, reason) = match link {
        LinkState::Searching => ("searching", None),
        LinkState::Absent(reason) => ("absent", Some(reason.as_str())),
        LinkState::Waiting => ("waiting", None),
        LinkState::Streaming => ("streaming", None),
        LinkState::Silent(reason) => ("silent", Some(reason.as_str())),
        LinkState::Lost(reason) => ("lost", Some(reason.as_str())),
        LinkState::Ended(reason) => ("ended", Some(reason.as_str())),
    };
    LinkMessage { state, reason }
}

fn hello(hello: &Hello) -> HelloMessage<'_> {
    HelloMessage {
        board: &hello.board,
        firmware: &hello.firmware_version,
        electrodes: hello.electrodes,
        adc_bits: hello.adc_bits,
        full_scale_v: f64::from(hello.adc_full_scale_mv) * 1e-3,
        drive_v: f64::from(hello.drive_mv) * 1e-3,
        settle_us: hello.settings.settle_us,
        averages: 1_u32.checked_shl(hello.settings.average_log2.into()).unwrap_or(0),
        max_frames_per_s: hello.settings.max_frames_per_s,
        select_us: hello.settings.select_us,
        discarded: hello.settings.discarded,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::run::scanning::ScanChoice;
    use tactomo_board::record::Loss;

    fn json(text: serde_json::Result<String>) -> serde_json::Value {
        serde_json::from_str(&text.expect("plain numbers and texts")).expect("JSON")
    }

    #[test]
    fn the_status_says_what_is_played_and_recorded() {
        let playing = Playing::Recording {
            position_s: 1.5,
            length_s: 4.0,
            speed: f64::INFINITY,
            paused: true,
            looped: false,
            ended: false,
            damage: Loss { damaged_places: 2, left_out_bytes: 90, ..Loss::default() },
        };
        let snapshot = Snapshot {
            link: LinkState::Silent("no frames for 2 s".to_owned()),
            playing,
            recording: Some("touch.tactomo".into()),
            scan: Scan { choice: ScanChoice::Adaptive, grounds: vec![5, 10], others: true },
            baseline: Some("Something pressed at the start.".to_owned()),
            wires: Some("Press with one finger."),
            calibration: Some("It was calibrated on another board.".to_owned()),
            ..Snapshot::default()
        };
        let value = json(status(&snapshot, 3));
        assert_eq!(value["link"], serde_json::json!({"state": "silent", "reason": "no frames for 2 s"}));
        assert_eq!(
            value["playing"],
            serde_json::json!({
                "kind": "recording", "position_s": 1.5, "length_s": 4.0, "speed": null, "paused": true, "looped": false,
                "ended": false, "damage": "it is damaged in 2 places (90 bytes left out)"
            })
        );
        assert_eq!(value["recording"], "touch.tactomo");
        assert_eq!(value["scan"], serde_json::json!({"choice": "adaptive", "grounds": [5, 10], "others": true}));
        assert_eq!(value["baseline"], "Something pressed at the start.");
        assert_eq!(value["wires"], "Press with one finger.");
        assert_eq!(value["calibration"], "It was calibrated on another board.");
        assert_eq!(value["rezeros"], 3);
    }
}
