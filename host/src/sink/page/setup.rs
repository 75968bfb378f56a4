//! The `setup` message: what does not change while the program runs.

use serde::Serialize;

use super::PageSetup;
use super::update::{Layout, layout};
use crate::sink::place::Place;
use tactomo_physics::scene::SceneName;
use tactomo_touch::solve::Method;

#[derive(Serialize)]
struct SetupMessage<'a> {
    r#type: &'static str,
    /// How updates are to be read.
    layout: Layout,
    /// The detector's name among several; none if it is alone.
    name: &'a str,
    /// Where it lies on a body; none if that is not told.
    place: Option<PlaceMessage>,
    detector: &'a str,
    bounds_m: [[f64; 2]; 2],
    outline_m: Vec<&'a [[f64; 2]]>,
    electrodes: Vec<ElectrodeMessage>,
    nodes_m: &'a [[f64; 2]],
    /// Nodes in space, of a curved detector.
    places_m: &'a [[f64; 3]],
    /// Triangles that the flat picture has.
    triangles: Vec<[u32; 3]>,
    /// Triangles that the map of a closed surface tears apart: only the view in space has them.
    torn_triangles: Vec<[u32; 3]>,
    drive_v: f64,
    sheet_conductance_s: f64,
    usual_radius_m: f64,
    solvers: Vec<SolverMessage>,
    scenes: Vec<SceneMessage>,
    source: &'a str,
    simulated: bool,
    /// The address for other machines; none if the page is for this machine alone.
    shared: Option<&'a str>,
}

/// Where the detector's frame is on the body.
#[derive(Serialize)]
struct PlaceMessage {
    origin_m: [f64; 3],
    /// Directions of its x, y and z.
    axes: [[f64; 3]; 3],
}

#[derive(Serialize)]
struct SolverMessage {
    name: &'static str,
    explanation: &'static str,
}

#[derive(Serialize)]
struct SceneMessage {
    name: String,
    /// The preset that it was made for, if it is one of the paper's demonstrations.
    detector: Option<&'static str>,
}

#[derive(Serialize)]
struct ElectrodeMessage {
    x_m: f64,
    y_m: f64,
    radius_m: f64,
    place_m: [f64; 3],
}

/// The `setup` message of a detector by its name among several, and at its place on a body, on a page that other machines have at `shared_url`.
pub(super) fn message(
    setup: &PageSetup,
    (name, place): (&str, Option<Place>),
    shared_url: Option<&str>,
) -> serde_json::Result<String> {
    let detector = &setup.detector;
    let loops = std::iter::once(&detector.outline.outer).chain(&detector.outline.holes);
    let (triangles, torn_triangles) = drawn_triangles(setup);
    serde_json::to_string(&SetupMessage {
        r#type: "setup",
        layout: layout(),
        name,
        place: place.map(|place| PlaceMessage { origin_m: place.xyz_m, axes: place.axes() }),
        detector: &detector.name,
        bounds_m: detector.outline.bounds(),
        outline_m: loops.map(Vec::as_slice).collect(),
        electrodes: electrodes(setup),
        nodes_m: &setup.mesh.nodes_m,
        places_m: &setup.mesh.places_m,
        triangles,
        torn_triangles,
        drive_v: detector.drive_v,
        sheet_conductance_s: detector.sheet_conductance_s(),
        usual_radius_m: setup.usual_radius_m,
        solvers: solvers(),
        scenes: scenes(setup),
        source: &setup.source,
        simulated: setup.finger.is_some(),
        shared: shared_url,
    })
}

fn electrodes(setup: &PageSetup) -> Vec<ElectrodeMessage> {
    let detector = &setup.detector;
    let message = |place_m: [f64; 3], radius_m| {
        let [x_m, y_m] = detector.map_m(place_m);
        ElectrodeMessage { x_m, y_m, radius_m, place_m }
    };
    detector.electrodes.iter().map(|pad| message(pad.place_m(), pad.radius_m)).collect()
}

/// The scenes that a simulated detector can play: only discs can touch a curved one.
fn scenes(setup: &PageSetup) -> Vec<SceneMessage> {
    let is_flat = setup.detector.surface.is_none();
    let plays = |scene: &SceneName| is_flat || scene.is_of_discs();
    let message = |scene: SceneName| SceneMessage { name: scene.to_string(), detector: scene.detector() };
    SceneName::ALL.into_iter().filter(plays).map(message).collect()
}

/// The solvers to choose from, those that most people look for first.
fn solvers() -> Vec<SolverMessage> {
    let message = |method: Method| SolverMessage { name: method.name(), explanation: method.explanation() };
    Method::ALL.into_iter().map(message).collect()
}

/// The triangles that the flat picture has, and those about the lowest point of a closed surface, which its map tears apart.
fn drawn_triangles(setup: &PageSetup) -> (Vec<[u32; 3]>, Vec<[u32; 3]>) {
    let shows = |node: u32| {
        let surface = setup.detector.surface.as_ref();
        surface.is_none_or(|surface| surface.shows(setup.mesh.nodes_m[node as usize]))
    };
    setup.mesh.triangles.iter().partition(|triangle| triangle.iter().all(|node| shows(*node)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use tactomo_physics::detector::Detector;
    use tactomo_physics::forward::ImageMesh;

    fn small_setup() -> PageSetup {
        PageSetup {
            detector: Detector::preset(Detector::DEFAULT).expect("the default is a preset"),
            mesh: ImageMesh {
                nodes_m: vec![[0.0, 0.0], [0.01, 0.0], [0.0, 0.01]],
                places_m: Vec::new(),
                triangles: vec![[0, 1, 2]],
                node_areas_m2: vec![1e-5; 3],
            },
            usual_radius_m: 0.0025,
            source: "a \"quoted\" port".to_owned(),
            finger: None,
        }
    }

    fn json(text: serde_json::Result<String>) -> serde_json::Value {
        serde_json::from_str(&text.expect("plain numbers and texts")).expect("JSON")
    }

    #[test]
    fn the_setup_says_what_the_page_needs() {
        let value = json(message(&small_setup(), ("", None), None));
        assert_eq!(value["type"], "setup");
        assert_eq!(value["electrodes"].as_array().map(Vec::len), Some(16));
        assert_eq!(value["source"], "a \"quoted\" port");
        assert_eq!(value["simulated"], false);
        assert_eq!(value["usual_radius_m"], 0.0025);
        assert_eq!(value["solvers"].as_array().map(Vec::len), Some(Method::ALL.len()));
        assert_eq!(value["solvers"][0]["name"], "auto");
        assert_eq!(value["scenes"].as_array().map(Vec::len), Some(SceneName::ALL.len()));
        let scene = |index: usize| &value["scenes"][index];
        assert_eq!(*scene(0), serde_json::json!({"name": "rest", "detector": null}));
        assert_eq!(*scene(11), serde_json::json!({"name": "gripper", "detector": "strip-13x60"}));
        assert_eq!(value["triangles"], serde_json::json!([[0, 1, 2]]));
    }

    #[test]
    fn a_curved_detector_comes_with_its_places_and_every_triangle() {
        let file = concat!(env!("CARGO_MANIFEST_DIR"), "/examples/detectors/fingertip.toml");
        let detector = Detector::read(file.as_ref()).expect("an example");
        let model = tactomo_physics::forward::Auto::new(&detector, None).expect("a model").model;
        let mesh = model.image_mesh().clone();
        let value = json(message(&PageSetup { detector, mesh: mesh.clone(), ..small_setup() }, ("", None), None));
        let count = |name: &str| value[name].as_array().map_or(0, Vec::len);
        assert_eq!(count("places_m"), mesh.nodes_m.len());
        assert_eq!(count("triangles") + count("torn_triangles"), mesh.triangles.len());
        assert_eq!(count("scenes"), SceneName::ALL.len() - 3, "no line, no ring and no rod");
    }

    #[test]
    fn a_place_comes_as_an_origin_and_axes() {
        assert!(json(message(&small_setup(), ("thumb", None), None))["place"].is_null());
        let place = Place { xyz_m: [0.1, 0.0, -0.02], rpy_rad: [0.0; 3] };
        let axes = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        let value = json(message(&small_setup(), ("thumb", Some(place)), None));
        assert_eq!(value["place"], serde_json::json!({ "origin_m": [0.1, 0.0, -0.02], "axes": axes }));
    }
}
