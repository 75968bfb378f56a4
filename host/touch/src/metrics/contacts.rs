//! Contacts found against contacts that are there.

use crate::solve::FoundContact;
use tactomo_physics::scene::Contact;
use tactomo_physics::space;

/// Which found contact stands for which true one.
///
/// ```
/// use tactomo_physics::scene::Contact;
/// use tactomo_touch::{metrics::Matching, solve::FoundContact};
///
/// let truth = [Contact::flat(0.010, 0.0, 0.003, 2e-4), Contact::flat(-0.010, 0.0, 0.003, 2e-4)];
/// let matching = Matching::within(0.005, &truth, &[FoundContact::flat(0.011, 0.0, 2e-4)]);
/// assert_eq!((matching.pairs.len(), &matching.missed[..]), (1, &[1][..]));
/// assert!(matching.position_error_m().is_some_and(|error_m| (error_m - 0.001).abs() < 1e-12));
/// ```
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Matching {
    /// Pairs, the nearest first.
    pub pairs: Vec<Pair>,
    /// True contacts that were not found.
    pub missed: Vec<usize>,
    /// Found contacts that are not there.
    pub invented: Vec<usize>,
}

/// A true contact and the one found for it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pair {
    /// The true one's place in its list.
    pub truth: usize,
    /// The found one's place in its list.
    pub found: usize,
    /// Distance between them (m).
    pub distance_m: f64,
}

impl Matching {
    /// Matches contacts one to one, nearest pairs first, of those at most `reach_m` apart (m; infinity matches as many as there
    /// are).
    pub fn within(reach_m: f64, truth: &[Contact], found: &[FoundContact]) -> Self {
        let mut near = pairs(truth, found);
        near.retain(|pair| pair.distance_m <= reach_m);
        near.sort_by(|a, b| a.distance_m.total_cmp(&b.distance_m));
        let (mut truth_left, mut found_left) = (vec![true; truth.len()], vec![true; found.len()]);
        near.retain(|pair| {
            let both_left = truth_left[pair.truth] && found_left[pair.found];
            if both_left {
                (truth_left[pair.truth], found_left[pair.found]) = (false, false);
            }
            both_left
        });
        Self { pairs: near, missed: indices(&truth_left), invented: indices(&found_left) }
    }

    /// Mean distance of the pairs (m); `None` without a pair.
    pub fn position_error_m(&self) -> Option<f64> {
        mean(self.pairs.iter().map(|pair| pair.distance_m))
    }

    /// Mean error (m) with what was missed or invented counted as `reach_m` each: the OSPA distance of order 1 (Schuhmacher, Vo and
    /// Vo, 2008, eq. 3), with this greedy matching for the optimal one. Zero where nothing is there and nothing was found.
    pub fn ospa_m(&self, reach_m: f64) -> f64 {
        let unmatched = self.missed.len().max(self.invented.len());
        let sum_m: f64 = self.pairs.iter().map(|pair| pair.distance_m).sum();
        (sum_m + reach_m * unmatched as f64) / (self.pairs.len() + unmatched).max(1) as f64
    }

    /// Mean of `|found / true - 1|` of the pairs' conductances; `None` without a pair.
    ///
    /// # Panics
    /// If the contacts are not those that were matched.
    pub fn conductance_error(&self, truth: &[Contact], found: &[FoundContact]) -> Option<f64> {
        let error = |pair: &Pair| (found[pair.found].conductance_s / truth[pair.truth].conductance_s - 1.0).abs();
        mean(self.pairs.iter().map(error))
    }
}

/// Mean distance (m) of true contacts from the found ones that are matched to them, each to one at most; `None` without a
/// match. Nearest pairs are matched first.
pub fn position_error_m(truth: &[Contact], found: &[FoundContact]) -> Option<f64> {
    Matching::within(f64::INFINITY, truth, found).position_error_m()
}

fn pairs(truth: &[Contact], found: &[FoundContact]) -> Vec<Pair> {
    let distance_m = |a: &Contact, b: &FoundContact| space::distance([a.x_m, a.y_m, a.z_m], [b.x_m, b.y_m, b.z_m]);
    let of =
        |(i, a)| found.iter().enumerate().map(move |(j, b)| Pair { truth: i, found: j, distance_m: distance_m(a, b) });
    truth.iter().enumerate().flat_map(of).collect()
}

/// Where a list says yes.
fn indices(list: &[bool]) -> Vec<usize> {
    (0..list.len()).filter(|&index| list[index]).collect()
}

fn mean(values: impl ExactSizeIterator<Item = f64>) -> Option<f64> {
    let count = values.len();
    (count > 0).then(|| values.sum::<f64>() / count as f64)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn truth(x_m: f64) -> Contact {
        Contact::flat(x_m, 0.0, 0.001, 1e-3)
    }

    fn found(x_m: f64) -> FoundContact {
        FoundContact::flat(x_m, 0.0, 1e-3)
    }

    #[test]
    fn nearest_pairs_are_matched_first_and_once() {
        let [truths, founds] = [[0.0, 0.010], [0.009, 0.002]];
        let matching =
            Matching::within(f64::INFINITY, &truths.map(truth), &[found(founds[0]), found(founds[1]), found(0.5)]);
        let matched: Vec<_> = matching.pairs.iter().map(|pair| (pair.truth, pair.found)).collect();
        assert_eq!((matched, matching.missed.len(), &matching.invented[..]), (vec![(1, 0), (0, 1)], 0, &[2][..]));
        assert!(matching.position_error_m().is_some_and(|error_m| (error_m - 0.0015).abs() < 1e-12));
        assert_eq!(
            position_error_m(&[truth(0.0), truth(0.010)], &[found(0.009)]).map(|m| (m * 1e3).round()),
            Some(1.0)
        );
        assert_eq!(position_error_m(&[truth(0.0)], &[]), None);
    }

    #[test]
    fn what_is_out_of_reach_is_missed_and_invented() {
        let matching = Matching::within(0.004, &[truth(0.0), truth(0.010)], &[found(0.003), found(0.015)]);
        // One pair 3 mm apart, and one contact at 4 mm.
        assert!((matching.ospa_m(0.004) - 0.0035).abs() < 1e-12);
        assert_eq!((matching.pairs.len(), matching.missed, matching.invented), (1, vec![1], vec![1]));
    }

    #[test]
    fn the_distance_of_sets_counts_what_is_missed_and_invented() {
        let error_mm =
            |truth: &[Contact], found: &[FoundContact]| Matching::within(0.010, truth, found).ospa_m(0.010) * 1e3;
        assert_eq!(error_mm(&[], &[]), 0.0);
        assert_eq!(error_mm(&[truth(0.0)], &[]), 10.0);
        assert_eq!(error_mm(&[], &[found(0.0), found(0.1)]), 10.0);
        // Two found for one that is there, 2 mm beside it: (2 + 10) / 2.
        assert!((error_mm(&[truth(0.0)], &[found(0.002), found(0.004)]) - 6.0).abs() < 1e-12);
    }

    #[test]
    fn distances_are_those_of_space() {
        let above = Contact { z_m: 0.004, ..truth(0.0) };
        assert_eq!(position_error_m(&[above], &[found(0.003)]), Some(0.005));
    }

    #[test]
    fn conductance_errors_are_relative_to_the_truth() {
        let founds = [
            FoundContact { conductance_s: 1.5e-3, ..found(0.0) },
            FoundContact { conductance_s: 0.8e-3, ..found(1.0) },
        ];
        let truths = [truth(1.0), truth(0.0)];
        let error = Matching::within(0.1, &truths, &founds).conductance_error(&truths, &founds);
        assert!(error.is_some_and(|error| (error - 0.35).abs() < 1e-12), "{error:?}");
    }
}
