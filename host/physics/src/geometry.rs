//! Plane geometry: areas, distances, and what part of a triangle lies under a disc.

use std::f64::consts::{PI, TAU};

/// A point of the plane (m).
pub type Point = [f64; 2];

/// Twice the signed area of a triangle (m2), above zero if counter-clockwise.
pub fn cross(a: Point, b: Point, c: Point) -> f64 {
    (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
}

/// Signed area of a polygon (m2), above zero if counter-clockwise.
pub fn area(polygon: &[Point]) -> f64 {
    edges(polygon).map(|(a, b)| a[0] * b[1] - b[0] * a[1]).sum::<f64>() / 2.0
}

/// Area and centroid of a polygon with more than no area.
pub fn area_and_centroid(polygon: &[Point]) -> Option<(f64, Point)> {
    let origin = *polygon.first()?;
    let (mut twice, mut moment) = (0.0, [0.0; 2]);
    for (a, b) in edges(polygon) {
        let part = cross(origin, a, b);
        twice += part;
        for axis in 0..2 {
            moment[axis] += part * (a[axis] + b[axis] - 2.0 * origin[axis]) / 3.0;
        }
    }
    (twice > 0.0).then(|| (twice / 2.0, [origin[0] + moment[0] / twice, origin[1] + moment[1] / twice]))
}

/// Whether a coordinate need not be written, as the height of what is flat.
pub fn is_zero(value: &f64) -> bool {
    *value == 0.0
}

/// Corners of the bounding box of points: smallest and largest x and y.
pub fn bounds(points: &[Point]) -> [Point; 2] {
    points.iter().fold([[f64::INFINITY; 2], [f64::NEG_INFINITY; 2]], |[low, high], at| {
        [[low[0].min(at[0]), low[1].min(at[1])], [high[0].max(at[0]), high[1].max(at[1])]]
    })
}

/// Distance between two points (m).
pub fn distance(a: Point, b: Point) -> f64 {
    (a[0] - b[0]).hypot(a[1] - b[1])
}

/// Distance of a point from a segment (m).
pub fn segment_distance(p: Point, (a, b): (Point, Point)) -> f64 {
    let along = [b[0] - a[0], b[1] - a[1]];
    let length2 = along[0] * along[0] + along[1] * along[1];
    let share = ((p[0] - a[0]) * along[0] + (p[1] - a[1]) * along[1]) / length2.max(f64::MIN_POSITIVE);
    let share = share.clamp(0.0, 1.0);
    distance(p, [a[0] + share * along[0], a[1] + share * along[1]])
}

/// Whether a polygon goes round a point (odd number of crossings of the ray towards larger x).
pub fn is_inside(p: Point, polygon: &[Point]) -> bool {
    let crosses = |(a, b): &(Point, Point)| (a[1] > p[1]) != (b[1] > p[1]) && (cross(*a, *b, p) > 0.0) == (b[1] > a[1]);
    edges(polygon).filter(crosses).count() % 2 == 1
}

/// The edges of a closed polygon.
pub fn edges(polygon: &[Point]) -> impl Iterator<Item = (Point, Point)> + '_ {
    (0..polygon.len()).map(|i| (polygon[i], polygon[(i + 1) % polygon.len()]))
}

/// A regular polygon, counter-clockwise, with the area of the disc that it stands for.
pub fn disc(centre: Point, radius_m: f64, corners: usize) -> Vec<Point> {
    turned_disc(centre, radius_m, corners, 0.0)
}

/// A regular polygon with the area of the disc that it stands for, turned counter-clockwise by an angle.
pub fn turned_disc(centre: Point, radius_m: f64, corners: usize, turn: f64) -> Vec<Point> {
    let step = TAU / corners as f64;
    let to_corner_m = radius_m * (2.0 * PI / (corners as f64 * step.sin())).sqrt();
    (0..corners)
        .map(|i| (turn + step * i as f64).sin_cos())
        .map(|(sin, cos)| [centre[0] + to_corner_m * cos, centre[1] + to_corner_m * sin])
        .collect()
}

/// The part of a convex polygon inside a counter-clockwise triangle (Sutherland and Hodgman, 1974).
pub fn clip(polygon: &[Point], triangle: [Point; 3]) -> Vec<Point> {
    let mut part = polygon.to_vec();
    for (a, b) in edges(&triangle) {
        let side = |p: Point| cross(a, b, p);
        let mut kept = Vec::with_capacity(part.len() + 1);
        for (from, to) in edges(&part) {
            let (before, after) = (side(from), side(to));
            if before >= 0.0 {
                kept.push(from);
            }
            if (before >= 0.0) != (after >= 0.0) {
                let share = before / (before - after);
                kept.push([from[0] + share * (to[0] - from[0]), from[1] + share * (to[1] - from[1])]);
            }
        }
        part = kept;
    }
    part
}

/// Integrals over the part of a triangle inside a `polygon` of the three functions that are linear in
/// it and one at one corner (m2); `None` if nothing is inside. Exact: such an integral is area times the value at the centroid.
pub fn shape_integrals_m2(polygon: &[Point], corners: [Point; 3]) -> Option<[f64; 3]> {
    let (area_m2, centroid) = area_and_centroid(&clip(polygon, corners))?;
    let [a, b, c] = corners;
    let twice_m2 = cross(a, b, c);
    // A centroid on an edge may be beyond it by rounding.
    Some([(b, c), (c, a), (a, b)].map(|(from, to)| (area_m2 * cross(from, to, centroid) / twice_m2).max(0.0)))
}

#[cfg(test)]
mod tests {
    use super::*;

    const SQUARE: [Point; 4] = [[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0]];

    #[test]
    fn a_disc_keeps_its_area_and_its_centre() {
        let disc = disc([3.0, -1.0], 2.0, 16);
        let (area_m2, centre) = area_and_centroid(&disc).unwrap_or_default();
        assert!((area_m2 - 4.0 * PI).abs() < 1e-12);
        assert!(distance(centre, [3.0, -1.0]) < 1e-12);
    }

    #[test]
    fn the_parts_in_two_triangles_make_the_whole() {
        let disc = disc([0.3, 1.5], 0.4, 32);
        let whole = area(&clip(&disc, [[0.0, 0.0], [2.0, 0.0], [2.0, 2.0]]))
            + area(&clip(&disc, [[0.0, 0.0], [2.0, 2.0], [0.0, 2.0]]));
        let inside = area(&clip(&disc, [[0.0, -9.0], [99.0, -9.0], [0.0, 90.0]]))
            - area(&clip(&disc, [[-5.0, 2.0], [5.0, 2.0], [0.0, 9.0]]));
        assert!((whole - inside).abs() < 1e-12, "{whole} {inside}");
    }

    #[test]
    fn inside_and_distance_of_a_square() {
        assert!(is_inside([1.0, 1.9], &SQUARE));
        assert!(!is_inside([1.0, 2.1], &SQUARE));
        assert!(!is_inside([-0.1, 1.0], &SQUARE));
        assert_eq!(segment_distance([3.0, 4.0], ([0.0, 0.0], [0.0, 2.0])), 13f64.sqrt());
    }
}
