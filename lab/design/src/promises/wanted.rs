//! Five wishes, from a fingertip to a seat.

use super::super::search::{Board, Wishes};

/// What somebody wants.
#[derive(Clone, Debug)]
pub struct Wanted {
    /// For what.
    pub name: String,
    /// What it has to give.
    pub wishes: Wishes,
}

/// Five of them, each read by the board that `board` takes for so many electrodes. The first four are the worked examples of `docs/design.md`; the last one asks
/// for little.
pub fn wanted(board: impl Fn(usize) -> Board) -> Vec<Wanted> {
    let mm = |[width, height]: [f64; 2]| [width * 1e-3, height * 1e-3];
    let of = |name: &str,
              size_mm,
              forces_n: [f64; 2],
              place_mm: f64,
              two_points_mm: f64,
              frames_per_s,
              electrodes,
              tip_mm: f64| {
        let wishes = Wishes {
            size_m: mm(size_mm),
            smallest_n: forces_n[0],
            largest_n: forces_n[1],
            place_m: place_mm * 1e-3,
            two_points_m: two_points_mm * 1e-3,
            frames_per_s,
            electrodes,
            tip_m: tip_mm * 1e-3 / 2.0,
            board: board(electrodes),
        };
        Wanted { name: name.to_owned(), wishes }
    };
    vec![
        of("fingertip", [10.0, 10.0], [0.02, 2.0], 0.1, 2.0, 200.0, 16, 1.0),
        of("gripper strip", [13.0, 60.0], [0.1, 10.0], 1.0, 6.0, 100.0, 16, 2.6),
        of("table-top display", [140.0, 70.0], [0.1, 3.0], 1.0, 15.0, 50.0, 32, 8.0),
        of("seat pad", [257.0, 182.0], [0.5, 10.0], 2.0, 40.0, 50.0, 32, 20.0),
        of("very cheap", [60.0, 60.0], [0.2, 3.0], 2.0, 25.0, 50.0, 6, 5.0),
    ]
}
