//! Surfaces for tests, as the text of OBJ files in metres.

use std::f64::consts::PI;
use std::fmt::Write as _;

use super::Surface;

fn surface(places: &[[f64; 3]], triangles: &[[usize; 3]]) -> Surface {
    Surface::parse(obj(places, triangles).as_bytes(), "test.obj", "m").unwrap_or_else(|error| panic!("{error}"))
}

/// The text of a file.
pub fn obj(places: &[[f64; 3]], triangles: &[[usize; 3]]) -> String {
    let mut text = String::new();
    for [x, y, z] in places {
        let _ = writeln!(text, "v {x:?} {y:?} {z:?}");
    }
    for [a, b, c] in triangles.iter().map(|triangle| triangle.map(|corner| corner + 1)) {
        let _ = writeln!(text, "f {a} {b} {c}");
    }
    text
}

/// A sheet of `columns x rows` rectangles, each two triangles; `place` of a point of the unit square.
fn sheet(columns: usize, rows: usize, place: impl Fn(f64, f64) -> [f64; 3]) -> Surface {
    let nodes = (0..=rows).flat_map(|j| (0..=columns).map(move |i| (i, j)));
    let places: Vec<_> = nodes.map(|(i, j)| place(i as f64 / columns as f64, j as f64 / rows as f64)).collect();
    let node = |i: usize, j: usize| j * (columns + 1) + i;
    let triangles: Vec<_> = (0..columns * rows)
        .map(|cell| (cell % columns, cell / columns))
        .flat_map(|(i, j)| {
            [[node(i, j), node(i + 1, j), node(i + 1, j + 1)], [node(i, j), node(i + 1, j + 1), node(i, j + 1)]]
        })
        .collect();
    surface(&places, &triangles)
}

/// A rectangle about the origin.
pub fn plate(width_m: f64, height_m: f64, columns: usize, rows: usize) -> Surface {
    sheet(columns, rows, |x, y| [width_m * (x - 0.5), height_m * (y - 0.5), 0.0])
}

/// A rectangle bent to a half cylinder about the y axis, as wide along its arc; convex upwards.
pub fn half_cylinder(arc_m: f64, height_m: f64, columns: usize, rows: usize) -> Surface {
    // The facets' chords have the arc's length together.
    let radius_m = arc_m / columns as f64 / (2.0 * (PI / 2.0 / columns as f64).sin());
    let place = |x: f64, y: f64| {
        let (sin, cos) = (PI * (x - 0.5)).sin_cos();
        [radius_m * sin, height_m * (y - 0.5), radius_m * cos]
    };
    sheet(columns, rows, place)
}

/// A sphere about the origin: an icosahedron whose triangles are divided into `divisions^2`.
pub fn sphere(radius_m: f64, divisions: usize) -> Surface {
    let (places, triangles) = ball(radius_m, divisions);
    surface(&places, &triangles)
}

/// Its corners, as often as they occur, and triangles.
pub fn ball(radius_m: f64, divisions: usize) -> (Vec<[f64; 3]>, Vec<[usize; 3]>) {
    let golden = (1.0 + 5f64.sqrt()) / 2.0;
    let corners: Vec<[f64; 3]> = [(1.0, golden), (-1.0, golden), (1.0, -golden), (-1.0, -golden)]
        .into_iter()
        .flat_map(|(one, long)| [[0.0, one, long], [one, long, 0.0], [long, 0.0, one]])
        .collect();
    let is_edge = |a: [f64; 3], b: [f64; 3]| crate::space::distance(a, b) < 2.1;
    let (mut places, mut triangles) = (Vec::new(), Vec::new());
    for i in 0..12 {
        for j in 0..12 {
            for k in 0..12 {
                let [a, b, c] = [i, j, k].map(|corner| corners[corner]);
                let outward = crate::space::dot(crate::space::normal([a, b, c]), a) > 0.0;
                if i < j && i < k && j != k && outward && is_edge(a, b) && is_edge(b, c) && is_edge(c, a) {
                    divide([a, b, c], radius_m, divisions, &mut places, &mut triangles);
                }
            }
        }
    }
    (places, triangles)
}

fn divide(
    [a, b, c]: [[f64; 3]; 3],
    radius_m: f64,
    divisions: usize,
    places: &mut Vec<[f64; 3]>,
    triangles: &mut Vec<[usize; 3]>,
) {
    let mut row_starts = Vec::new();
    for j in 0..=divisions {
        row_starts.push(places.len());
        for i in 0..=divisions - j {
            let [v, w] = [i, j].map(|step| step as f64 / divisions as f64);
            let at = [0, 1, 2].map(|axis| a[axis] * (1.0 - v - w) + b[axis] * v + c[axis] * w);
            places.push(at.map(|x| x * radius_m / crate::space::length(at)));
        }
    }
    for j in 0..divisions {
        for i in 0..divisions - j {
            let (low, high) = (row_starts[j] + i, row_starts[j + 1] + i);
            triangles.push([low, low + 1, high]);
            if i + 1 < divisions - j {
                triangles.push([low + 1, high + 1, high]);
            }
        }
    }
}
