//! What passes the socket. The page's side is `page/protocol.js`.
//!
//! Program to page, one message at a time, the next only after the page has answered `"taken"`:
//!
//! - `scene`, JSON, once: what does not change while the program runs.
//! - `status`, JSON, four times a second: the link, the board, the counts.
//! - an update, binary, at most about sixty times a second: the newest frame, as in [`update`](super::update).
//!
//! Page to program, JSON: `"taken"`, `"rezero"`, `{"solver": "auto"}`, `{"press": {"x_m": 0.01, "y_m": 0}}`, `"release"`.

use serde::de::Error;
use serde::{Deserialize, Deserializer, Serialize};
use tactomo_protocol::Hello;

use super::PageSetup;
use super::update::LAYOUT;
use crate::run::SolverState;
use crate::run::{Latency, LinkState, Snapshot};
use tactomo_touch::solve::Method;

/// What a page asks.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub(super) enum PageMessage {
    /// The last message is dealt with.
    Taken,
    /// Takes the readings at rest anew.
    Rezero,
    /// Reads the touch by the method of this name.
    Solver(#[serde(deserialize_with = "method")] Method),
    /// Presses on the simulated detector, here (m).
    Press { x_m: f64, y_m: f64 },
    /// Ends the press.
    Release,
}

fn method<'de, D: Deserializer<'de>>(name: D) -> Result<Method, D::Error> {
    String::deserialize(name)?.parse().map_err(D::Error::custom)
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
    solvers: Vec<SolverMessage>,
    source: &'a str,
    simulated: bool,
}

#[derive(Serialize)]
struct SolverMessage {
    name: &'static str,
    explanation: &'static str,
}

#[derive(Serialize)]
struct ElectrodeMessage {
    x_m: f64,
    y_m: f64,
    radius_m: f64,
}

/// The `scene` message.
pub(super) fn scene(scene: &PageSetup) -> serde_json::Result<String> {
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
        solvers: solvers(),
        source: &scene.source,
        simulated: scene.finger.is_some(),
    })
}

/// The solvers to choose from, those that most people look for first.
fn solvers() -> Vec<SolverMessage> {
    let message = |method: Method| SolverMessage { name: method.name(), explanation: method.explanation() };
    Method::ALL.into_iter().map(message).collect()
}

/// The triangles of the image that are drawn: on the map of a closed surface those about the lowest point are torn apart.
fn drawn_triangles(scene: &PageSetup) -> Vec<[u32; 3]> {
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
    solver: Option<SolverStateMessage<'a>>,
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
struct SolverStateMessage<'a> {
    name: &'static str,
    making: Option<&'static str>,
    refused: Option<&'a str>,
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
        solver: snapshot.solver.as_ref().map(solver_state),
        statistics: StatisticsMessage {
            frames: counts.frames,
            frames_per_s: counts.frames_per_s,
            dropped: counts.dropped,
            corrupt: counts.corrupt,
            latency_us: counts.age,
        },
        rezeroing: snapshot.frame.as_ref().is_some_and(|frame| frame.rezeroing),
        rezeros,
    })
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
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tactomo_physics::detector::Detector;
    use tactomo_physics::forward::ImageMesh;

    fn small_scene() -> PageSetup {
        PageSetup {
            detector: Detector::preset(Detector::DEFAULT).expect("the default is a preset"),
            mesh: ImageMesh {
                nodes_m: vec![[0.0, 0.0], [0.01, 0.0], [0.0, 0.01]],
                places_m: Vec::new(),
                triangles: vec![[0, 1, 2]],
                node_areas_m2: vec![1e-5; 3],
            },
            source: "a \"quoted\" port".to_owned(),
            finger: None,
        }
    }

    #[test]
    fn the_scene_says_what_the_page_needs() {
        let text = scene(&small_scene()).expect("plain numbers and texts");
        let value: serde_json::Value = serde_json::from_str(&text).expect("JSON");
        assert_eq!(value["electrodes"].as_array().map(Vec::len), Some(16));
        assert_eq!(value["source"], "a \"quoted\" port");
        assert_eq!(value["simulated"], false);
        assert_eq!(value["solvers"].as_array().map(Vec::len), Some(Method::ALL.len()));
        assert_eq!(value["solvers"][0]["name"], "auto");
    }

    #[test]
    fn requests_other_than_the_known_are_refused() {
        let parse = serde_json::from_str::<PageMessage>;
        let press = parse(r#"{"press":{"x_m":0.01,"y_m":-2e-3}}"#);
        assert_eq!(press.ok(), Some(PageMessage::Press { x_m: 0.01, y_m: -2e-3 }));
        assert_eq!(parse(r#""rezero""#).ok(), Some(PageMessage::Rezero));
        assert_eq!(parse(r#"{"solver":"noser"}"#).ok(), Some(PageMessage::Solver(Method::Noser)));
        for text in [
            "",
            "{}",
            "[]",
            "rezero",
            r#""flash""#,
            r#"{"press":{}}"#,
            r#""press""#,
            r#"{"solver":"guess"}"#,
            r#"{"press":{"x_m":1e999,"y_m":0}}"#,
            r#"{"press":{"x_m":0,"y_m":0,"z_m":0}}"#,
        ] {
            assert!(parse(text).is_err(), "{text}");
        }
    }
}
