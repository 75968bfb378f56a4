//! Places of contacts on a network's map.

use super::grid::Grid;

/// A peak is the highest within so many nodes each way.
const ALONE: usize = 2;
/// Its place is the centroid within so many nodes each way, as in training.
const WINDOW: usize = 3;

/// Places (m) of the highest peaks of a map of logits, so many at most: centroids of what is nearer to each than to the others.
pub(super) fn places_m(grid: &Grid, map: &[f32], count: usize) -> Vec<[f64; 2]> {
    let side = grid.side;
    let mut tops: Vec<usize> = (0..map.len()).filter(|node| is_top(map, side, *node)).collect();
    tops.sort_by(|a, b| map[*b].total_cmp(&map[*a]));
    tops.truncate(count);
    let tops: Vec<[usize; 2]> = tops.into_iter().map(|node| [node % side, node / side]).collect();
    tops.iter().map(|top| grid.place_m(centroid(map, side, *top, &tops))).collect()
}

/// Nodes from one index to another, within the grid.
fn around(index: usize, by: usize, side: usize) -> std::ops::Range<usize> {
    index.saturating_sub(by)..(index + by + 1).min(side)
}

fn is_top(map: &[f32], side: usize, node: usize) -> bool {
    let (i, j) = (node % side, node / side);
    around(j, ALONE, side).all(|row| map[row * side..][around(i, ALONE, side)].iter().all(|value| *value <= map[node]))
}

/// Mean indices about a top, weighted by the probability that its logits stand for.
fn centroid(map: &[f32], side: usize, top: [usize; 2], tops: &[[usize; 2]]) -> [f64; 2] {
    let distance2 = |[i, j]: [usize; 2], at: [usize; 2]| i.abs_diff(at[0]).pow(2) + j.abs_diff(at[1]).pow(2);
    let (mut sum, mut moments) = (0.0, [0.0; 2]);
    for j in around(top[1], WINDOW, side) {
        for i in around(top[0], WINDOW, side) {
            let own2 = distance2([i, j], top);
            if tops.iter().all(|other| distance2([i, j], *other) >= own2) {
                let weight = 1.0 / (1.0 + f64::from(-map[j * side + i]).exp());
                sum += weight;
                moments = [moments[0] + weight * i as f64, moments[1] + weight * j as f64];
            }
        }
    }
    if sum > 0.0 { moments.map(|moment| moment / sum) } else { top.map(|index| index as f64) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bumps_are_found_between_nodes_the_highest_first() {
        let grid = Grid::new(1024, [0.06, 0.06]);
        let bumps = [([0.0103, -0.0042], 0.9), ([-0.012, 0.0155], 0.6), ([0.0, 0.0281], 0.3)];
        let value = |node: usize| {
            let [x, y] = grid.place_m([(node % 32) as f64, (node / 32) as f64]);
            let bump = |([bx, by], height): &([f64; 2], f64)| {
                height * (-0.5 * ((x - bx).powi(2) + (y - by).powi(2)) / 0.0025f64.powi(2)).exp()
            };
            let share = bumps.iter().map(bump).sum::<f64>().clamp(1e-6, 1.0 - 1e-6);
            (share / (1.0 - share)).ln() as f32
        };
        let map: Vec<f32> = (0..1024).map(value).collect();
        let found = places_m(&grid, &map, 2);
        assert_eq!(found.len(), 2);
        for (found, (at, _)) in found.iter().zip(&bumps) {
            assert!((found[0] - at[0]).hypot(found[1] - at[1]) < 3e-4, "{found:?} {at:?}");
        }
        // Beside an edge the window is cut off.
        let edge = places_m(&grid, &map, 3)[2];
        assert!((edge[0] - 0.0).abs() < 3e-4 && (edge[1] - 0.0281).abs() < 2e-3, "{edge:?}");
    }
}
