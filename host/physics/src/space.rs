//! Geometry in space: vectors, and what of a triangle is nearest.

/// A point or a vector of space (m).
pub type Place = [f64; 3];

/// `a - b`.
pub fn sub(a: Place, b: Place) -> Place {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

/// `a + share * b`.
pub fn along(a: Place, share: f64, b: Place) -> Place {
    [a[0] + share * b[0], a[1] + share * b[1], a[2] + share * b[2]]
}

/// From a place by `steps` along two directions.
pub fn moved(from: Place, steps: [f64; 2], directions: [Place; 2]) -> Place {
    along(along(from, steps[0], directions[0]), steps[1], directions[1])
}

/// Scalar product.
pub fn dot(a: Place, b: Place) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// Vector product.
pub fn cross(a: Place, b: Place) -> Place {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// Length.
pub fn length(a: Place) -> f64 {
    dot(a, a).sqrt()
}

/// Distance between two points.
pub fn distance(a: Place, b: Place) -> f64 {
    length(sub(a, b))
}

/// Normal of a triangle that is counter-clockwise seen from its tip; as long as twice the area.
pub fn normal([a, b, c]: [Place; 3]) -> Place {
    cross(sub(b, a), sub(c, a))
}

/// Middle of a triangle.
pub fn middle([a, b, c]: [Place; 3]) -> Place {
    [0, 1, 2].map(|axis| (a[axis] + b[axis] + c[axis]) / 3.0)
}

/// The point of a segment that is nearest to `p`.
pub fn nearest_on_segment(p: Place, a: Place, b: Place) -> Place {
    let edge = sub(b, a);
    let share = dot(sub(p, a), edge) / dot(edge, edge).max(f64::MIN_POSITIVE);
    along(a, share.clamp(0.0, 1.0), edge)
}

/// The point of a triangle that is nearest to `p`.
pub fn nearest_on_triangle(p: Place, corners: [Place; 3]) -> Place {
    let [a, b, c] = corners;
    let up = normal(corners);
    let inside = |(from, to): &(Place, Place)| dot(cross(sub(*to, *from), sub(p, *from)), up) >= 0.0;
    let edges = [(a, b), (b, c), (c, a)];
    if edges.iter().all(inside) {
        return along(p, -dot(sub(p, a), up) / dot(up, up), up);
    }
    let nearest = edges.map(|(from, to)| nearest_on_segment(p, from, to));
    nearest.into_iter().min_by(|s, t| distance(p, *s).total_cmp(&distance(p, *t))).unwrap_or(a)
}

/// Where along a ray (in lengths of `direction`) it meets a triangle, if it does.
pub fn ray_to_triangle(from: Place, direction: Place, corners: [Place; 3]) -> Option<f64> {
    let up = normal(corners);
    let share = dot(sub(corners[0], from), up) / dot(direction, up);
    let at = along(from, share, direction);
    let slack = -1e-12 * dot(up, up);
    let inside = |i: usize| {
        let (a, b) = (corners[i], corners[(i + 1) % 3]);
        dot(cross(sub(b, a), sub(at, a)), up) >= slack
    };
    (share.is_finite() && share >= 0.0 && (0..3).all(inside)).then_some(share)
}

/// A triangle's plane as a plane of its own: origin at a corner, the first axis along an edge.
#[derive(Clone, Copy, Debug)]
pub struct Frame {
    origin: Place,
    axes: [Place; 2],
    up: Place,
}

impl Frame {
    /// The frame of a triangle with more than no area.
    pub fn of(corners: [Place; 3]) -> Self {
        let unit = |a: Place| along([0.0; 3], 1.0 / length(a), a);
        let first = unit(sub(corners[1], corners[0]));
        let up = unit(normal(corners));
        Self { origin: corners[0], axes: [first, cross(up, first)], up }
    }

    /// Unit vectors of the plane's two directions.
    pub fn axes(&self) -> [Place; 2] {
        self.axes
    }

    /// A place's foot in the plane.
    pub fn flat(&self, at: Place) -> [f64; 2] {
        self.axes.map(|axis| dot(sub(at, self.origin), axis))
    }

    /// Distance of a place from the plane, above zero on the side of the normal.
    pub fn height(&self, at: Place) -> f64 {
        dot(sub(at, self.origin), self.up)
    }

    /// The place of a point of the plane.
    pub fn lift(&self, [x, y]: [f64; 2]) -> Place {
        along(along(self.origin, x, self.axes[0]), y, self.axes[1])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CORNERS: [Place; 3] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

    #[test]
    fn the_nearest_point_is_within_on_an_edge_or_a_corner() {
        let third = 1.0 / 3.0;
        for (p, expected) in [
            ([1.0, 1.0, 1.0], [third; 3]),
            ([0.0, 0.0, 0.0], [third; 3]),
            ([1.0, 1.0, -1.0], [0.5, 0.5, 0.0]),
            ([3.0, 0.0, -1.0], [1.0, 0.0, 0.0]),
        ] {
            assert!(distance(nearest_on_triangle(p, CORNERS), expected) < 1e-12, "{p:?}");
        }
    }

    #[test]
    fn rays_meet_what_is_before_them() {
        let hit = ray_to_triangle([0.0; 3], [1.0, 1.0, 1.0], CORNERS);
        assert!(hit.is_some_and(|share| (share - 1.0 / 3.0).abs() < 1e-12));
        assert_eq!(ray_to_triangle([0.0; 3], [-1.0, -1.0, -1.0], CORNERS), None);
        assert_eq!(ray_to_triangle([0.0; 3], [1.0, 1.0, -1.0], CORNERS), None);
        assert_eq!(ray_to_triangle([2.0, 2.0, 2.0], [1.0, -1.0, 0.0], CORNERS), None, "it is parallel");
    }

    #[test]
    fn a_frame_keeps_lengths_and_turns() {
        let frame = Frame::of(CORNERS);
        let [a, b, c] = CORNERS.map(|corner| frame.flat(corner));
        assert!((crate::geometry::cross(a, b, c) - length(normal(CORNERS))).abs() < 1e-12);
        let at = [0.3, -0.2, 0.7];
        let foot = frame.lift(frame.flat(at));
        assert!((distance(foot, at) - frame.height(at).abs()).abs() < 1e-12);
    }
}
