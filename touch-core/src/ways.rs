//! Ways between two places: the straight one, and those by the walls of a rectangle.
//!
//! No current flows across a wall. So the field of a contact is that of a layer without end with contacts mirrored at the walls and at the corners (method of images). Mirrors
//! of mirrors are far off, and what they add is smooth.

use crate::real::Real;

/// The ways (m) to a place from another, the straight one first, and from its mirrors at walls that go through a lowest and a highest corner, if there are any.
pub fn ways_m<T: Real>(to_m: [T; 2], from_m: [T; 2], walls_m: Option<[[T; 2]; 2]>) -> impl Iterator<Item = [T; 2]> {
    turned_ways_m(to_m, from_m, walls_m).map(|(way_m, _)| way_m)
}

/// The same with how they change along each axis with the second place; with the first one they change as that does.
pub(crate) fn turned_ways_m<T: Real>(
    to_m: [T; 2],
    from_m: [T; 2],
    walls_m: Option<[[T; 2]; 2]>,
) -> impl Iterator<Item = ([T; 2], [T; 2])> {
    let along = [0, 1].map(|d| {
        let mirrored = |wall: [T; 2]| to_m[d] + from_m[d] - T::of(2.0) * wall[d];
        let [low_m, high_m] = walls_m.map_or([T::ZERO; 2], |walls_m| walls_m.map(mirrored));
        [to_m[d] - from_m[d], low_m, high_m]
    });
    let count = if walls_m.is_some() { 3 } else { 1 };
    let turn = |which: usize| if which == 0 { -T::ONE } else { T::ONE };
    (0..count).flat_map(move |i| (0..count).map(move |j| ([along[0][i], along[1][j]], [i, j].map(turn))))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn mirrors_are_as_far_from_either_place() {
        let walls_m = Some([[-0.03, -0.02], [0.03, 0.02]]);
        let (a, b) = ([0.012, -0.017], [-0.028f64, 0.004]);
        let far = |[x, y]: [f64; 2]| x.hypot(y);
        let all: std::vec::Vec<_> = ways_m(a, b, walls_m).map(far).collect();
        let back: std::vec::Vec<_> = ways_m(b, a, walls_m).map(far).collect();
        assert_eq!(all.len(), 9);
        for (one, other) in all.iter().zip(&back) {
            assert!((one - other).abs() < 1e-12, "{one} {other}");
        }
        // Mirrored at the left wall, it is at -0.032.
        assert!((all[3] - far([0.012 + 0.032, -0.021])).abs() < 1e-12, "{all:?}");
        assert_eq!(ways_m(a, b, None).collect::<std::vec::Vec<_>>(), [[0.04, -0.021]]);
    }
}
