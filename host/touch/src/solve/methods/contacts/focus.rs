//! Which grounds tell most of the contacts that are followed, and which see one that comes.
//!
//! The row of a ground has the information `H = J^T J` on the contacts' parameters, `J` its whitened derivatives. Grounds are taken one after
//! the other, each the one that makes `ln det (P + sum H)` largest: a D-optimal design, by the greedy choice that is never below 63 % of the best
//! (Nemhauser, Wolsey and Fisher, An analysis of approximations for maximizing submodular set functions, 1978; Pukelsheim, Optimal design of
//! experiments, 1993). `P` is what is known of a contact that runs, however well it is known where it was: a still one is averaged anyway.

use nalgebra::{Cholesky, DMatrix};

use super::ContactFinder;
use super::discs::{DiscFit, PARAMETERS};
use crate::scanning::spread;
use crate::solve::fit::dot::dot;
use crate::solve::fit::target::Target;
use tactomo_physics::forward::jacobian::Jacobian;
use tactomo_physics::readings::Readings;

/// What is known before the rows come, in standard deviations of the parameters: half a radius, a fifth of the resistance, a tenth of the radius.
const BEFORE: [f64; PARAMETERS] = [0.5, 0.5, 0.2, 0.1];
/// Nodes at which a contact may come that are looked at.
const NODES: usize = 150;

impl ContactFinder {
    /// The grounds whose rows tell most of contacts, so many of them, the best first.
    pub(super) fn telling_grounds(&self, fit: &DiscFit, count: usize) -> Vec<usize> {
        let n = self.spot_model.electrodes();
        // Near a contact readings are largest, and so is what its pad may be off by: both are in the whitening.
        let readings = Readings::from_fn(n, |g, e| fit.volts[g * n + e]);
        let target = Target::of_mean(&readings, 1, &self.errors, None);
        let slopes: Vec<Vec<f64>> = fit.slopes_v().iter().map(|slope| target.whitened(slope)).collect();
        let size = slopes.len();
        let information = |g: usize| {
            let row = |i: usize| &slopes[i][g * n..(g + 1) * n];
            DMatrix::from_fn(size, size, |i, j| dot(row(i), row(j)))
        };
        let rows: Vec<DMatrix<f64>> = (0..n).map(information).collect();
        let mut known = DMatrix::from_fn(size, size, |i, j| match i == j {
            true => BEFORE[i % PARAMETERS].powi(-2),
            false => 0.0,
        });
        let ln_determinant =
            |matrix: DMatrix<f64>| Cholesky::new(matrix).map_or(f64::NEG_INFINITY, |factor| factor.ln_determinant());
        let mut chosen = Vec::with_capacity(count);
        for _ in 0..count {
            let gain = |g: &usize| ln_determinant(&known + &rows[*g]);
            // Once more of the same would be off by the same at its pad.
            let others = (0..n).filter(|g| !chosen.contains(g));
            let Some(best) = others.max_by(|a, b| gain(a).total_cmp(&gain(b))) else { break };
            known += &rows[best];
            chosen.push(best);
        }
        chosen
    }

    /// All grounds, those that follow each other far apart.
    pub(super) fn all_grounds(&self) -> Vec<usize> {
        spread(self.problem.detector(), self.spot_model.electrodes())
    }

    /// Two grounds that see a light contact wherever it comes: those for which it is largest where it is smallest.
    pub(super) fn watching_grounds(&self) -> Vec<usize> {
        self.watching.get_or_init(|| watching(&self.problem.jacobian)).clone()
    }
}

fn watching(jacobian: &Jacobian) -> Vec<usize> {
    let n = jacobian.electrodes();
    let nodes = jacobian.fields_ohm.nrows();
    let at: Vec<usize> = (0..nodes).step_by((nodes / NODES).max(1)).collect();
    let square = |g: usize, node: usize| (0..n).map(|e| jacobian.volts_per_s(g, e, node).powi(2)).sum::<f64>();
    let squares: Vec<Vec<f64>> = (0..n).map(|g| at.iter().map(|node| square(g, *node)).collect()).collect();
    let least = |g: usize, h: usize| {
        squares[g].iter().zip(&squares[h]).map(|(one, other)| one + other).fold(f64::INFINITY, f64::min)
    };
    let pairs = (0..n).flat_map(|g| (0..g).map(move |h| [h, g]));
    pairs.max_by(|a, b| least(a[0], a[1]).total_cmp(&least(b[0], b[1]))).map_or_else(Vec::new, Vec::from)
}

#[cfg(test)]
mod tests {
    use super::{BEFORE, PARAMETERS};
    use crate::solve::methods::contacts::{ContactSettings, Contacts};
    use crate::solve::problem::Problem;
    use nalgebra::Cholesky;
    use tactomo_physics::detector::Detector;
    use tactomo_physics::scene::Contact;

    #[test]
    fn the_grounds_that_tell_most_leave_less_unknown_than_others() {
        let detector = Detector::preset(Detector::DEFAULT).unwrap().taken_as_exact();
        let problem = Problem::of(&detector).unwrap();
        let contacts = Contacts::new(&problem, ContactSettings::of(&problem)).unwrap();
        let finder = contacts.finder();
        let mut random = fastrand::Rng::with_seed(2);
        // Logarithms of the area in which a place is left unknown, by the best pair and by others in the mean.
        let (mut by_best, mut by_others) = (0.0, 0.0);
        for _ in 0..10 {
            let [x_m, y_m] = [0, 1].map(|_| 0.05 * (random.f64() - 0.5));
            let truth = Contact::flat(x_m, y_m, 0.0025, 0.3 * detector.sheet_conductance_s());
            let impedance_ohm = problem.model.impedance_ohm(&[truth]).unwrap();
            let readings = tactomo_physics::forward::readings_v(&impedance_ohm, &detector);
            let of = |grounds: &[usize]| {
                let rows = readings.clone().hiding(|g, _| !grounds.contains(&g));
                let target = finder.target_of_rows(&rows, None);
                finder.disc_fitter().fit(vec![truth], &target, super::super::search::COLD).unwrap()
            };
            let all: Vec<usize> = (0..16).collect();
            let best = finder.telling_grounds(&of(&all), 2);
            // Of the place, where resistance and radius are known from before.
            let unknown = |grounds: &[usize]| {
                let mut known = of(grounds).normal;
                (0..PARAMETERS).for_each(|i| known[(i, i)] += BEFORE[i].powi(-2));
                let left = Cholesky::new(known).unwrap().inverse();
                (left[(0, 0)] * left[(1, 1)] - left[(0, 1)] * left[(1, 0)]).ln() / 10.0
            };
            by_best += unknown(&best);
            by_others += (0..15).map(|g| unknown(&[g, g + 1])).sum::<f64>() / 15.0;
        }
        assert!(by_best < by_others, "{by_best} {by_others}");
        let watching = finder.watching_grounds();
        assert!(watching.len() == 2 && watching[0] != watching[1], "{watching:?}");
    }
}
