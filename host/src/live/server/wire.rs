//! What passes the socket. The page's side is `page/protocol.js`.
//!
//! Program to page, one message at a time, the next only after the page has answered `"taken"`:
//!
//! - `scene`, JSON, once: what does not change while the program runs.
//! - `status`, JSON, four times a second: the link, the board, the counts.
//! - an update, binary, at most about sixty times a second: the newest frame. Little-endian throughout:
//!
//! | bytes | what |
//! |---|---|
//! | 6 x u32 | [`LAYOUT`]; sequence number of the frame; frames received so far (both modulo 2^32); nodes `m`; electrodes `n`; contacts found `k` |
//! | m x f32 | the image: contact conductance per area at each node (S/m2); `m` is 0 if the solver makes no image |
//! | n n x f32 | the readings as measured (V), electrode `e` under ground `g` at `g n + e` |
//! | k x 3 x f32 | the contacts found: x (m), y (m), conductance (S) |
//!
//! Page to program, JSON: `"taken"`, `"rezero"`, `{"press": {"x_m": 0.01, "y_m": 0}}`, `"release"`.

use serde::{Deserialize, Serialize};
use tactomo_protocol::Hello;

use super::Scene;
use crate::detector::Detector;
use crate::live::{FrameSnapshot, Latency, LinkState, Snapshot};

/// Version of the layout of updates; a page of another version says that it must be reloaded.
pub(super) const LAYOUT: u32 = 1;

/// What a page asks.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub(super) enum PageMessage {
    /// The last message is dealt with.
    Taken,
    /// Takes the readings at rest anew.
    Rezero,
    /// Presses on the simulated detector, here (m).
    Press { x_m: f64, y_m: f64 },
    /// Ends the press.
    Release,
}

#[derive(Serialize)]
struct SceneMessage<'a> {
    r#type: &'static str,
    layout: u32,
    detector: &'a str,
    bounds_m: [[f64; 2]; 2],
    outline_m: Vec<&'a [[f64; 2]]>,
    electrodes: Vec<ElectrodeMessage>,
    nodes_m: &'a [[f64; 2]],
    triangles: Vec<[u32; 3]>,
    drive_v: f64,
    sheet_conductance_s: f64,
    solver: &'a str,
    source: &'a str,
    simulated: bool,
}

#[derive(Serialize)]
struct ElectrodeMessage {
    x_m: f64,
    y_m: f64,
    radius_m: f64,
}

/// The `scene` message.
pub(super) fn scene(scene: &Scene) -> serde_json::Result<String> {
    let detector = &scene.detector;
    let loops = std::iter::once(&detector.outline.outer).chain(&detector.outline.holes);
    serde_json::to_string(&SceneMessage {
        r#type: "scene",
        layout: LAYOUT,
        detector: &detector.name,
        bounds_m: detector.outline.bounds(),
        outline_m: loops.map(Vec::as_slice).collect(),
        electrodes: detector
            .electrodes
            .iter()
            .map(|pad| (detector.map_m(pad.place_m()), pad.radius_m))
            .map(|([x_m, y_m], radius_m)| ElectrodeMessage { x_m, y_m, radius_m })
            .collect(),
        nodes_m: &scene.mesh.nodes_m,
        triangles: drawn_triangles(scene),
        drive_v: detector.drive_v,
        sheet_conductance_s: detector.sheet_conductance_s(),
        solver: &scene.solver,
        source: &scene.source,
        simulated: scene.finger.is_some(),
    })
}

/// The triangles of the image that are drawn: on the map of a closed surface those about the lowest point are torn apart.
fn drawn_triangles(scene: &Scene) -> Vec<[u32; 3]> {
    let shows = |node: u32| {
        let surface = scene.detector.surface.as_ref();
        surface.is_none_or(|surface| surface.shows(scene.mesh.nodes_m[node as usize]))
    };
    scene.mesh.triangles.iter().copied().filter(|triangle| triangle.iter().all(|node| shows(*node))).collect()
}

#[derive(Serialize)]
struct StatusMessage<'a> {
    r#type: &'static str,
    link: LinkMessage<'a>,
    hello: Option<HelloMessage<'a>>,
    statistics: StatisticsMessage,
    rezeroing: bool,
    rezeros: u64,
}

#[derive(Serialize)]
struct LinkMessage<'a> {
    state: &'static str,
    reason: Option<&'a str>,
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
}

#[derive(Serialize)]
struct StatisticsMessage {
    frames: u64,
    frames_per_s: f64,
    dropped: u64,
    corrupt: u64,
    latency_us: Latency,
}

/// The `status` message; `rezeros` counts the re-zeros that pages asked for.
pub(super) fn status(snapshot: &Snapshot, rezeros: u64) -> serde_json::Result<String> {
    let counts = &snapshot.statistics;
    serde_json::to_string(&StatusMessage {
        r#type: "status",
        link: link(&snapshot.link),
        hello: snapshot.hello.as_ref().map(hello),
        statistics: StatisticsMessage {
            frames: counts.frames,
            frames_per_s: counts.frames_per_s,
            dropped: counts.dropped,
            corrupt: counts.corrupt,
            latency_us: counts.latency,
        },
        rezeroing: snapshot.frame.as_ref().is_some_and(|frame| frame.rezeroing),
        rezeros,
    })
}

fn link(link: &LinkState) -> LinkMessage<'_> {
    let (state, reason) = match link {
        LinkState::Searching => ("searching", None),
        LinkState::Waiting => ("waiting", None),
        LinkState::Streaming => ("streaming", None),
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
    }
}

/// An update.
pub(super) fn update(frame: &FrameSnapshot, frames: u64, detector: &Detector) -> Vec<u8> {
    let image = frame.solution.image_s_per_m2.as_deref().unwrap_or_default();
    let readings = frame.readings.volts().iter().map(|&volt| volt as f32);
    let contacts = frame.solution.contacts.iter().flat_map(|found| {
        let [x_m, y_m] = detector.map_m([found.x_m, found.y_m, found.z_m]);
        [x_m, y_m, found.conductance_s]
    });
    let counts = [image.len(), frame.readings.electrodes(), frame.solution.contacts.len()];
    // The page counts modulo 2^32.
    let head = [LAYOUT, frame.sequence as u32, frames as u32].into_iter().chain(counts.map(|count| count as u32));
    let values = image.iter().copied().chain(readings).chain(contacts.map(|value| value as f32));
    head.flat_map(u32::to_le_bytes).chain(values.flat_map(f32::to_le_bytes)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::forward::ImageMesh;
    use crate::readings::Readings;
    use crate::solve::{FoundContact, Solution};

    fn small_scene() -> Scene {
        Scene {
            detector: Detector::preset(Detector::DEFAULT).expect("the default is a preset"),
            mesh: ImageMesh {
                nodes_m: vec![[0.0, 0.0], [0.01, 0.0], [0.0, 0.01]],
                places_m: Vec::new(),
                triangles: vec![[0, 1, 2]],
                node_areas_m2: vec![1e-5; 3],
            },
            solver: "tikhonov".to_owned(),
            source: "a \"quoted\" port".to_owned(),
            finger: None,
        }
    }

    fn floats(bytes: &[u8]) -> Vec<f32> {
        bytes.chunks_exact(4).map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect()
    }

    #[test]
    fn an_update_is_laid_out_as_documented() {
        let contact = FoundContact::flat(0.25, -0.5, 2.0);
        let frame = FrameSnapshot {
            sequence: (7 << 32) + 9,
            board_time_us: 0,
            status: Default::default(),
            readings: Readings::from_fn(2, |g, e| (2 * g + e) as f64),
            solution: Solution {
                image_s_per_m2: Some(vec![2.0, 4.0, -8.0]),
                contacts: vec![contact],
                ..Solution::default()
            },
            rezeroing: false,
        };
        let bytes = update(&frame, 300, &small_scene().detector);
        let head: Vec<u8> = [LAYOUT, 9, 300, 3, 2, 1].into_iter().flat_map(u32::to_le_bytes).collect();
        assert_eq!(bytes[..24], head);
        assert_eq!(floats(&bytes[24..]), [2.0, 4.0, -8.0, 0.0, 1.0, 2.0, 3.0, 0.25, -0.5, 2.0]);
    }

    #[test]
    fn the_scene_says_what_the_page_needs() {
        let text = scene(&small_scene()).expect("plain numbers and texts");
        let value: serde_json::Value = serde_json::from_str(&text).expect("JSON");
        assert_eq!(value["electrodes"].as_array().map(Vec::len), Some(16));
        assert_eq!(value["source"], "a \"quoted\" port");
        assert_eq!(value["simulated"], false);
    }

    #[test]
    fn requests_other_than_the_known_are_refused() {
        let parse = serde_json::from_str::<PageMessage>;
        let press = parse(r#"{"press":{"x_m":0.01,"y_m":-2e-3}}"#);
        assert_eq!(press.ok(), Some(PageMessage::Press { x_m: 0.01, y_m: -2e-3 }));
        assert_eq!(parse(r#""rezero""#).ok(), Some(PageMessage::Rezero));
        for text in [
            "",
            "{}",
            "[]",
            "rezero",
            r#""flash""#,
            r#"{"press":{}}"#,
            r#""press""#,
            r#"{"press":{"x_m":1e999,"y_m":0}}"#,
            r#"{"press":{"x_m":0,"y_m":0,"z_m":0}}"#,
        ] {
            assert!(parse(text).is_err(), "{text}");
        }
    }
}
