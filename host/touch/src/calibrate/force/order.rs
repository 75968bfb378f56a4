//! Whether forces and conductances can belong to each other: known presses are easily typed in another order than they were made in.

use super::fit::Fitted;
use super::{ForcePress, numbers};

/// Pairs of presses whose forces are nearer than this share say nothing of the order: hysteresis and scatter may turn them round.
const NEAR: f64 = 0.2;
/// Largest share of the other pairs whose conductances may be the other way round. Forces in a random order have a half (with ten presses
/// one in a hundred orders has less than a quarter), ten presses of which the first and the last are exchanged two fifths.
const DISCORDANT: f64 = 0.25;
/// In the reverse order forces fit if no more pairs than these are discordant.
const REVERSED: f64 = 0.1;
/// Presses fit after an exchange if they are within so many standard deviations.
const FITS: f64 = 3.0;

/// Forces that do not belong to the conductances that they are given for.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Mistyped {
    /// Conductances do not rise with the forces.
    #[error(
        "the conductance does not rise with the force ({:.0} % of the pairs of presses contradict that{}): are the forces given in the order of the presses?{}",
        100.0 * share,
        if presses.is_empty() { String::new() } else { format!(", most of them with presses {}", numbers(presses)) },
        if *reversed { " They would fit in the reverse order." } else { "" }
    )]
    Order {
        /// Share of the pairs that contradict.
        share: f64,
        /// Presses that contradict more than half of the others.
        presses: Vec<usize>,
        /// Whether they fit in the reverse order.
        reversed: bool,
    },
    /// Two are exchanged.
    #[error(
        "presses {} and {} do not agree with the others, but would if their forces, {} N and {} N, were exchanged: are they given in the order of the presses?",
        pair[0] + 1, pair[1] + 1, forces_n[0], forces_n[1]
    )]
    Exchanged {
        /// Their indices.
        pair: [usize; 2],
        /// Their forces as given (N).
        forces_n: [f64; 2],
    },
}

/// Checks that conductances rise with forces.
pub(super) fn check(presses: &[ForcePress]) -> Result<(), Mistyped> {
    let forces_n: Vec<f64> = presses.iter().map(|press| press.force_n).collect();
    let contradictions = contradictions(presses, &forces_n);
    let share = contradictions.share();
    if share <= DISCORDANT {
        return Ok(());
    }
    let backwards: Vec<f64> = forces_n.iter().rev().copied().collect();
    let reversed = self::contradictions(presses, &backwards).share() < REVERSED;
    // Where all contradict all, naming them helps nobody.
    let worst: Vec<usize> = (0..presses.len()).filter(|press| contradictions.of_press(*press) > 0.5).collect();
    let presses = if 2 * worst.len() > presses.len() { Vec::new() } else { worst };
    Err(Mistyped::Order { share, presses, reversed })
}

/// Checks that no two of the outliers of a fit agree with it once their forces are exchanged.
pub(super) fn check_exchange(presses: &[ForcePress], outliers: &[usize], fit: &Fitted) -> Result<(), Mistyped> {
    let fits = |press: usize, force_of: usize| {
        fit.deviations(&ForcePress { force_n: presses[force_of].force_n, ..presses[press] }).abs() < FITS
    };
    let pairs = outliers.iter().enumerate().flat_map(|(i, a)| outliers[..i].iter().map(move |b| [*b, *a]));
    match pairs.into_iter().find(|[a, b]| fits(*a, *b) && fits(*b, *a)) {
        Some(pair) => Err(Mistyped::Exchanged { pair, forces_n: pair.map(|press| presses[press].force_n) }),
        None => Ok(()),
    }
}

/// Pairs that say something of the order, and those that contradict it.
struct Contradictions {
    /// Of each press: pairs, and those that contradict.
    counts: Vec<[usize; 2]>,
}

fn contradictions(presses: &[ForcePress], forces_n: &[f64]) -> Contradictions {
    let mut counts = vec![[0; 2]; presses.len()];
    for i in 0..presses.len() {
        for j in 0..i {
            let ratio = (forces_n[i] / forces_n[j]).ln();
            if ratio.abs() > (1.0 + NEAR).ln() {
                let is_against = (ratio > 0.0) != (presses[i].conductance_s > presses[j].conductance_s);
                for press in [i, j] {
                    counts[press][0] += 1;
                    counts[press][1] += usize::from(is_against);
                }
            }
        }
    }
    Contradictions { counts }
}

impl Contradictions {
    fn share(&self) -> f64 {
        let [pairs, against] = self.counts.iter().fold([0; 2], |[a, b], [pairs, against]| [a + pairs, b + against]);
        against as f64 / pairs.max(1) as f64
    }

    fn of_press(&self, press: usize) -> f64 {
        self.counts[press][1] as f64 / self.counts[press][0].max(1) as f64
    }
}
