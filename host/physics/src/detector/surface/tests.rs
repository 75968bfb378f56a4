//! Files that are surfaces, and files that are not.

use proptest::prelude::*;

use super::*;

fn ball_obj() -> String {
    let (places, triangles) = shapes::ball(30.0, 3);
    shapes::obj(&places, &triangles)
}

/// The ball as facets: what an STL holds.
fn facets() -> Vec<[Place; 3]> {
    let (places, triangles) = shapes::ball(30.0, 3);
    triangles.into_iter().map(|triangle| triangle.map(|corner| places[corner])).collect()
}

fn text_stl() -> String {
    let mut text = "solid ball\n".to_owned();
    for facet in facets() {
        text += "facet normal 0 0 0\n outer loop\n";
        facet.iter().for_each(|[x, y, z]| text += &format!("  vertex {x:e} {y:e} {z:e}\n"));
        text += " endloop\nendfacet\n";
    }
    text + "endsolid ball\n"
}

fn binary_stl() -> Vec<u8> {
    // Some programs begin binary files so.
    let mut bytes = b"solid, but binary".to_vec();
    bytes.resize(80, b' ');
    bytes.extend((facets().len() as u32).to_le_bytes());
    for facet in facets() {
        bytes.extend([0; 12]);
        facet.iter().flatten().for_each(|x| bytes.extend((*x as f32).to_le_bytes()));
        bytes.extend([0; 2]);
    }
    bytes
}

fn message(bytes: impl AsRef<[u8]>, name: &str) -> String {
    Surface::parse(bytes.as_ref(), name, "mm").map_or_else(|error| error.to_string(), |_| String::new())
}

#[test]
fn one_ball_in_three_formats() {
    let obj = Surface::parse(ball_obj().as_bytes(), "ball.obj", "mm").unwrap();
    assert_eq!((obj.nodes_m.len(), obj.triangles.len()), (92, 180), "corners are welded");
    let chord = 1.0 - obj.area_m2() / (4.0 * std::f64::consts::PI * 9e-4);
    assert!((0.0..0.06).contains(&chord), "{chord}");
    assert_eq!(obj.clearance_m([0.0; 3]), f64::INFINITY, "it is closed");
    for (bytes, within) in [(text_stl().into_bytes(), 1e-12), (binary_stl(), 1e-8)] {
        let stl = Surface::parse(&bytes, "Ball.STL", "mm").unwrap();
        assert_eq!(stl.triangles.len(), 180);
        assert!((stl.area_m2() / obj.area_m2() - 1.0).abs() < 1e-5, "{within}");
        assert_eq!(stl.nodes_m.len(), 92);
    }
    let inches = Surface::parse(ball_obj().as_bytes(), "ball.obj", "in").unwrap();
    assert!((inches.area_m2() / obj.area_m2() / 25.4f64.powi(2) - 1.0).abs() < 1e-9);
}

#[test]
fn polygons_comments_and_references_from_the_end() {
    let text = "# a plate\nvn 0 0 1\nv 0 0 0 1.0\nv 2 0 0 # right\nv 2 2 0\nv 0 2 0\nf -4/1/1 2//1 3 4\n";
    let plate = Surface::parse(text.as_bytes(), "plate.obj", "cm").unwrap();
    assert!((plate.area_m2() - 4e-4).abs() < 1e-15);
    assert_eq!(plate.moved_m, [-0.01, -0.01]);
    assert!((plate.clearance_m([0.0; 3]) - 0.01).abs() < 1e-12);
    assert_eq!(plate.outline().size_m(), [0.02, 0.02]);
    assert_eq!(plate.outline().as_rectangle(), None, "it is no slab");
}

#[test]
fn errors_say_where_and_what_to_do() {
    let obj = |text: &str| message(text, "a.obj");
    assert!(obj("v 0 0 0\nv 1 0 x\n").starts_with("line 2: `x` is not a finite number"));
    assert!(obj("v 0 0 0\nf 1 0 1\n").starts_with("line 2: `0` names no vertex"));
    assert!(obj("v 0 0 0\n\nf 1 1 9\n").starts_with("line 3: a face names a vertex that is not among the 1"));
    assert!(obj("v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n").contains("has no area"));
    assert!(obj("v 0 0 0\n").contains("has 0 triangles"));
    assert!(obj("v 0 0 0\nv 1e9 0 0\nv 0 1 0\nf 1 2 3\n").contains("see the unit"));
    let two = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 5 0 0\nv 6 0 0\nv 5 1 0\nf 1 2 3\nf 4 5 6\n";
    assert!(obj(two).contains("more than one piece"));
    assert!(obj("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nf 1 2 3\nf 1 2 4\n").contains("opposite ways"));
    let stl = binary_stl();
    assert!(
        message(&stl[..stl.len() - 50], "a.stl").starts_with("byte 80: a binary STL of 180 triangles has 9084 bytes")
    );
    assert!(message("solid a\nfacet\nvertex 0 0 0\nendfacet", "a.stl").starts_with("line 4: a facet ends that has 1"));
    assert!(message("", "a.ply").contains("ends in .obj or .stl"));
    assert!(Surface::parse(ball_obj().as_bytes(), "a.obj", "km").is_err_and(|error| error.to_string().contains("km")));
}

#[test]
fn a_surface_that_no_map_can_show_is_refused() {
    // A strip wound up by more than a turn hides itself from its middle.
    let mut text = String::new();
    for i in 0..40 {
        let (sin, cos) = (0.3 * f64::from(i)).sin_cos();
        let radius = 10.0 + 0.5 * f64::from(i);
        for z in [0.0, 20.0] {
            text += &format!("v {} {} {z}\n", radius * cos, radius * sin);
        }
    }
    for i in 0..39 {
        text += &format!("f {} {} {} {}\n", 2 * i + 1, 2 * i + 3, 2 * i + 4, 2 * i + 2);
    }
    assert!(message(&text, "a.obj").contains("cannot be drawn flat"), "{}", message(&text, "a.obj"));
}

#[test]
fn every_place_of_a_ball_is_found_on_its_map() {
    let ball = Surface::parse(ball_obj().as_bytes(), "ball.obj", "mm").unwrap();
    let [low, high] = ball.outline().bounds();
    assert!((high[0] - 2.0 * 0.0295).abs() < 1e-3 && (low[0] + high[0]).abs() < 1e-12, "{high:?}");
    for triangle in 0..ball.triangles.len() {
        let at = space::middle(ball.corners(triangle));
        let map_m = ball.map_m(at);
        match ball.place_m(map_m) {
            Some(found) => assert!(space::distance(found, at) < 1e-9, "{at:?} {found:?}"),
            None => assert!(at[2] < -0.027, "only the lowest places are not drawn: {at:?}"),
        }
        assert!(space::distance(ball.nearest(at.map(|x| 1.1 * x)).place_m, at) < 0.002);
    }
    assert_eq!(ball.place_m([0.07, 0.0]), None);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(256))]

    #[test]
    fn no_bytes_make_it_panic(mut bytes in prop::collection::vec(any::<u8>(), 0..400), name in "a\\.(obj|stl)", count: u32) {
        let _ = Surface::parse(&bytes, &name, "mm");
        if let Some(field) = bytes.get_mut(80..84) {
            field.copy_from_slice(&count.to_le_bytes());
        }
        let _ = Surface::parse(&bytes, "a.stl", "mm");
    }

    #[test]
    fn no_words_make_it_panic(words in prop::collection::vec("v|f|vertex|facet|endfacet|solid|1|-2|3/4|0.5|nan|1e300|\n|#", 0..200)) {
        let text = words.join(" ");
        let _ = Surface::parse(text.as_bytes(), "a.obj", "mm");
        let _ = Surface::parse(format!("solid {text}").as_bytes(), "a.stl", "mm");
    }

    #[test]
    fn a_damaged_file_is_a_surface_or_an_error(at in 0usize..9084, byte: u8) {
        let mut bytes = binary_stl();
        bytes[at] = byte;
        if let Ok(surface) = Surface::parse(&bytes, "a.stl", "mm") {
            prop_assert!(surface.area_m2().is_finite());
            let outline = surface.outline();
            prop_assert!(outline.size_m().iter().all(|size_m| size_m.is_finite()));
        }
    }
}
