//! Whether known places can belong to the presses: lists are easily in another order, or the sensor in another position, than one thinks.

use std::fmt;

/// An exchange of two shows where both are so many medians of the others off, and each is nearer than this share of that at the other's place.
const EXCHANGED_MEDIANS: f64 = 4.0;
const EXCHANGED_SHARE: f64 = 0.25;
/// Another order or position is reported if places would be off by less than this share of the limit.
const FITS: f64 = 0.6;

/// What would make the places fit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WouldFit {
    /// Nothing that is known.
    Nothing,
    /// The reverse order.
    Reversed,
    /// Each place with the press after its own, or with the one before.
    Shifted {
        /// Whether it is the one after.
        is_later: bool,
    },
    /// The places of two presses, by their indices, exchanged.
    Exchanged(usize, usize),
    /// The sensor turned counter-clockwise by so many quarters, after it was mirrored left to right if that is so.
    Turned {
        /// Quarters of a turn.
        quarters: usize,
        /// Whether it is mirrored.
        is_mirrored: bool,
    },
}

impl fmt::Display for WouldFit {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match *self {
            Self::Nothing => write!(f, "see that each place belongs to its press, x and y from the middle"),
            Self::Reversed => write!(f, "they would fit in the reverse order"),
            Self::Shifted { is_later } => {
                let which = if is_later { "after" } else { "before" };
                write!(f, "they would fit if each place were that of the press {which} its own: is one missing?")
            }
            Self::Exchanged(a, b) => {
                write!(f, "they would fit with the places of presses {} and {} exchanged", a + 1, b + 1)
            }
            Self::Turned { quarters: 0, .. } => {
                write!(f, "they would fit with x mirrored: is the list for the sensor seen from the other side?")
            }
            Self::Turned { quarters, is_mirrored } => {
                let mirrored = if is_mirrored { "mirrored and " } else { "" };
                write!(f, "they would fit {mirrored}turned by {} degrees: how does the sensor lie?", 90 * quarters)
            }
        }
    }
}

/// Root of the mean square of distances (m).
fn off_m(pairs: impl Iterator<Item = ([f64; 2], [f64; 2])>) -> f64 {
    let (sum, count) =
        pairs.fold((0.0, 0), |(sum, count), (a, b)| (sum + (a[0] - b[0]).powi(2) + (a[1] - b[1]).powi(2), count + 1));
    (sum / f64::from(count.max(1))).sqrt()
}

/// Checks that places are where presses were found, to `limit_m` in the root of the mean square.
///
/// # Errors
/// How far off they are (m), and what would make them fit.
pub(super) fn check(found_m: &[[f64; 2]], known_m: &[[f64; 2]], limit_m: f64) -> Result<(), (f64, WouldFit)> {
    let as_given_m = off_m(found_m.iter().copied().zip(known_m.iter().copied()));
    if let Some((a, b)) = exchanged(found_m, known_m) {
        return Err((as_given_m, WouldFit::Exchanged(a, b)));
    }
    if as_given_m <= limit_m {
        return Ok(());
    }
    let tried = others(found_m, known_m).into_iter().min_by(|a, b| a.0.total_cmp(&b.0));
    match tried.filter(|(off_m, _)| *off_m < FITS * limit_m) {
        Some((_, would)) => Err((as_given_m, would)),
        None => Err((as_given_m, WouldFit::Nothing)),
    }
}

/// All other orders and positions, with how far off they are (m).
fn others(found_m: &[[f64; 2]], known_m: &[[f64; 2]]) -> Vec<(f64, WouldFit)> {
    let found = || found_m.iter().copied();
    let mut all = vec![(off_m(found().zip(known_m.iter().rev().copied())), WouldFit::Reversed)];
    if known_m.len() > 3 {
        all.push((off_m(found().skip(1).zip(known_m.iter().copied())), WouldFit::Shifted { is_later: true }));
        all.push((off_m(found().zip(known_m.iter().copied().skip(1))), WouldFit::Shifted { is_later: false }));
    }
    for is_mirrored in [false, true] {
        for quarters in usize::from(!is_mirrored)..4 {
            let placed = |at_m: &[f64; 2]| {
                let mirrored_m = if is_mirrored { [-at_m[0], at_m[1]] } else { *at_m };
                (0..quarters).fold(mirrored_m, |[x_m, y_m], _| [-y_m, x_m])
            };
            all.push((off_m(found().zip(known_m.iter().map(placed))), WouldFit::Turned { quarters, is_mirrored }));
        }
    }
    all
}

/// Two presses that are far off, and are not with each other's place.
fn exchanged(found_m: &[[f64; 2]], known_m: &[[f64; 2]]) -> Option<(usize, usize)> {
    let apart_m = |i: usize, j: usize| off_m([(found_m[i], known_m[j])].into_iter());
    let off: Vec<f64> = (0..found_m.len()).map(|i| apart_m(i, i)).collect();
    let mut sorted = off.clone();
    sorted.sort_by(f64::total_cmp);
    let far_m = EXCHANGED_MEDIANS * sorted.get(sorted.len() / 2)?;
    let far: Vec<usize> = (0..off.len()).filter(|i| off[*i] > far_m).collect();
    let fits =
        |a: usize, b: usize| apart_m(a, b) < EXCHANGED_SHARE * off[a] && apart_m(b, a) < EXCHANGED_SHARE * off[b];
    let pairs = far.iter().enumerate().flat_map(|(k, a)| far[..k].iter().map(move |b| (*b, *a)));
    pairs.filter(|(a, b)| fits(*a, *b)).max_by(|one, other| off[one.0].total_cmp(&off[other.0]))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Places in no symmetric order, and presses found a millimetre off.
    fn lists() -> (Vec<[f64; 2]>, Vec<[f64; 2]>) {
        let known_m =
            vec![[-0.02, -0.015], [0.01, -0.02], [0.022, 0.004], [0.005, 0.02], [-0.012, 0.011], [0.0, 0.001]];
        let found_m = known_m.iter().enumerate().map(|(k, [x, y])| [x + 1e-3, y - 2e-4 * k as f64]).collect();
        (found_m, known_m)
    }

    fn would(change: impl Fn(&mut Vec<[f64; 2]>)) -> Option<WouldFit> {
        let (found_m, mut known_m) = lists();
        change(&mut known_m);
        check(&found_m, &known_m, 7e-3).err().map(|(_, would)| would)
    }

    #[test]
    fn right_lists_pass_and_wrong_ones_are_reported_with_what_would_fit() {
        assert_eq!(would(|_| ()), None);
        assert_eq!(would(|all| all.reverse()), Some(WouldFit::Reversed));
        assert_eq!(would(|all| all.swap(1, 4)), Some(WouldFit::Exchanged(1, 4)));
        assert_eq!(would(|all| all.rotate_left(1)), Some(WouldFit::Shifted { is_later: true }));
        assert_eq!(would(|all| all.rotate_right(1)), Some(WouldFit::Shifted { is_later: false }));
        let mirrored = |all: &mut Vec<[f64; 2]>| all.iter_mut().for_each(|at| at[0] = -at[0]);
        assert_eq!(would(mirrored), Some(WouldFit::Turned { quarters: 0, is_mirrored: true }));
        let turned = |all: &mut Vec<[f64; 2]>| all.iter_mut().for_each(|at| *at = [at[1], -at[0]]);
        assert_eq!(would(turned), Some(WouldFit::Turned { quarters: 1, is_mirrored: false }));
        let elsewhere = |all: &mut Vec<[f64; 2]>| all.iter_mut().for_each(|at| at[0] += 0.03);
        assert_eq!(would(elsewhere), Some(WouldFit::Nothing));
    }

    #[test]
    fn what_would_fit_is_said() {
        assert!(WouldFit::Exchanged(1, 4).to_string().contains("presses 2 and 5 exchanged"));
        assert!(WouldFit::Turned { quarters: 1, is_mirrored: true }.to_string().contains("mirrored and turned by 90"));
        assert!(WouldFit::Turned { quarters: 0, is_mirrored: true }.to_string().contains("x mirrored"));
    }
}
