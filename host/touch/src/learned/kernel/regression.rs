//! Regression with a Gaussian kernel, its parameters chosen by leaving one press out.
//!
//! With `K[i][j]` the kernel of two presses, `M` the diagonal matrix of ridges, a value is `mean + sum_i K(p, p_i) a_i`, `a = (K + M)^-1 (y - mean)`. Left
//! out, press `i` is missed by `a_i / ((K + M)^-1)_ii`: in closed form, so that parameters are judged without fitting anew (Rasmussen and
//! Williams, "Gaussian Processes for Machine Learning", 2006, eq. 5.12). With the Cholesky factor `K + M = L L'`, the diagonal is the sum of
//! squares of the columns of `L^-1`. Of a press of several rows `G`, all are left out together, and missed by `(((K + M)^-1)_GG)^-1 a_G`: readings of one
//! press tell of each other what no other press does.
//!
//! The ridge stands for the variance of noise: that of a press of median size, times the doubt of each.

use std::collections::BTreeMap;

use nalgebra::{DMatrix, DVector};
use tactomo_physics::algebra::Cholesky;

use super::points::{Likeness, Points};

/// Numbers of coordinates that are tried: on five public sensors of 192 channels, each of these was the best of one.
const COMPONENTS: [usize; 5] = [12, 24, 48, 96, usize::MAX];
/// Widths that are tried, in medians of the distance between points.
const WIDTHS: [f64; 6] = [0.15, 0.3, 0.6, 1.2, 2.4, 4.8];
/// Ridges that are tried.
const RIDGES: [f64; 7] = [1e-8, 1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 0.1];
/// How many presses parameters are tried on, and how many of the best go on to the next round: to try everything on 1800 presses would take a minute.
const ROUNDS: [(usize, usize); 2] = [(200, 20), (500, 1)];
/// From the best of the last round, neighbours are tried on all presses, as long as one is better: so many at most.
const MOST_NEIGHBOURS: usize = 6;

/// A regression that has learned.
#[derive(Clone, Debug, PartialEq)]
pub struct Regression {
    /// Which presses are alike.
    pub likeness: Likeness,
    /// Ridge of a press of median size.
    pub ridge: f64,
    /// Means of the targets.
    pub means: Vec<f64>,
    /// `points x targets`, row by row.
    pub weights: Vec<f64>,
    /// Root mean square of what is missed when a press is left out, for each target.
    pub left_out: Vec<f64>,
}

/// Parameters to try: where they are in [`COMPONENTS`], [`WIDTHS`] and [`RIDGES`].
type Choice = [usize; 3];

/// What a choice stands for.
#[derive(Clone, Debug)]
struct Grid {
    /// Numbers of coordinates that there are.
    components: Vec<usize>,
    /// Median distance of points in each.
    medians: Vec<f64>,
    size_weight: f64,
}

impl Grid {
    fn likeness(&self, [components, width, _]: Choice) -> Likeness {
        let width = WIDTHS[width] * self.medians[components];
        Likeness { components: self.components[components], size_weight: self.size_weight, width }
    }

    fn all(&self) -> Vec<Choice> {
        let widths = (0..self.components.len()).flat_map(|number| (0..WIDTHS.len()).map(move |width| (number, width)));
        widths.flat_map(|(number, width)| (0..RIDGES.len()).map(move |ridge| [number, width, ridge])).collect()
    }

    /// Those that differ by a step in one parameter.
    fn neighbours(&self, choice: Choice) -> Vec<Choice> {
        let lengths = [self.components.len(), WIDTHS.len(), RIDGES.len()];
        // Ridges first: that is what more presses change most.
        let steps = [2, 1, 0].into_iter().flat_map(|axis: usize| {
            let at = choice[axis];
            [at.checked_sub(1), Some(at + 1).filter(|next| *next < lengths[axis])].map(|next| (axis, next))
        });
        let moved = |(axis, next): (usize, Option<usize>)| {
            let mut moved = choice;
            moved[axis] = next?;
            Some(moved)
        };
        steps.filter_map(moved).collect()
    }
}

/// What is learned from.
pub struct Lesson<'a> {
    /// The presses.
    pub points: &'a Points,
    /// `points x count`, row by row.
    pub targets: &'a [f64],
    /// Targets of each press.
    pub count: usize,
    /// What a factor e in size counts for.
    pub size_weight: f64,
    /// Which press each point is of.
    pub presses: &'a [usize],
}

/// What solving for the weights gives.
struct Solved {
    /// `presses x targets`, row by row.
    weights: Vec<f64>,
    /// Mean square of what is missed of each target when a press is left out.
    missed: Vec<f64>,
}

impl Regression {
    /// Learns; `None` if the presses are all alike, or no parameters serve.
    pub fn learn(lesson: &Lesson<'_>) -> Option<Self> {
        let means = lesson.means();
        let (likeness, ridge) = lesson.choose(&means)?;
        let all: Vec<usize> = (0..lesson.points.count()).collect();
        let kernel = lesson.kernel(&lesson.squares(&all, likeness.components), &all, likeness);
        let Solved { weights, missed } = lesson.solve(&kernel, &all, ridge, &means)?;
        let left_out = missed.iter().map(|square| square.sqrt()).collect();
        Some(Self { likeness, ridge, means, weights, left_out })
    }

    /// Root mean square, over all targets together, of what is missed when a press is left out.
    pub fn missed(&self) -> f64 {
        self.left_out.iter().map(|missed| missed * missed).sum::<f64>().sqrt()
    }

    /// The targets of readings with such squares of the distances to the presses, and of such a size.
    pub fn values(&self, points: &Points, squares: &[f64], log_size: f64) -> Vec<f64> {
        let mut values = self.means.clone();
        let known = squares.iter().zip(&points.log_sizes).zip(self.weights.chunks_exact(self.means.len()));
        for ((square, known_log_size), weights) in known {
            let kernel = self.likeness.of(*square, log_size - known_log_size);
            values.iter_mut().zip(weights).for_each(|(value, weight)| *value += kernel * weight);
        }
        values
    }
}

impl Lesson<'_> {
    fn means(&self) -> Vec<f64> {
        let rows = self.points.count() as f64;
        (0..self.count).map(|target| self.targets.iter().skip(target).step_by(self.count).sum::<f64>() / rows).collect()
    }

    /// The likeness and the ridge that miss least: the sum of squares over all targets, in their own unit, so that one that hardly varies counts
    /// for little.
    fn choose(&self, means: &[f64]) -> Option<(Likeness, f64)> {
        // In a fixed random order, for presses are often made along rows.
        let mut order: Vec<usize> = (0..self.points.count()).collect();
        fastrand::Rng::with_seed(1).shuffle(&mut order);
        let grid = self.grid(&order)?;
        let mut tried = grid.all();
        for (most, kept) in ROUNDS {
            let part = &order[..most.min(order.len())];
            tried.sort_unstable();
            let mut judged = self.judge(part, &grid, &tried, means);
            judged.sort_by(|a, b| a.0.total_cmp(&b.0));
            tried = judged.into_iter().map(|(_, choice)| choice).take(kept).collect();
            if part.len() == order.len() {
                break;
            }
        }
        let chosen = self.climb(&order, &grid, *tried.first()?, means);
        Some((grid.likeness(chosen), RIDGES[chosen[2]]))
    }

    /// The best on all presses that steps from a choice lead to.
    fn climb(&self, order: &[usize], grid: &Grid, from: Choice, means: &[f64]) -> Choice {
        let judged = |choice: Choice| {
            self.judge(order, grid, &[choice], means).first().map_or(f64::INFINITY, |(missed, _)| *missed)
        };
        let (mut best, mut tried) = ((judged(from), from), vec![from]);
        while let Some(next) = grid.neighbours(best.1).into_iter().find(|next| !tried.contains(next)) {
            if tried.len() > MOST_NEIGHBOURS {
                break;
            }
            tried.push(next);
            let missed = judged(next);
            if missed < best.0 {
                best = (missed, next);
            }
        }
        best.1
    }

    /// `None` if most points are the same.
    fn grid(&self, order: &[usize]) -> Option<Grid> {
        let mut components = COMPONENTS.map(|components| self.points.used(components)).to_vec();
        components.dedup();
        let medians = components.iter().map(|components| self.median_distance(order, *components));
        let medians = medians.collect::<Option<Vec<f64>>>()?;
        Some(Grid { components, medians, size_weight: self.size_weight })
    }

    /// Of neighbours in a random order.
    fn median_distance(&self, order: &[usize], components: usize) -> Option<f64> {
        let distance = |pair: &[usize]| {
            let [a, b] = [pair[0], pair[1]];
            let sizes = self.size_weight * (self.points.log_sizes[a] - self.points.log_sizes[b]);
            let square = super::points::square(&self.points.at(a)[..components], &self.points.at(b)[..components]);
            (square + sizes * sizes).sqrt()
        };
        let mut distances: Vec<f64> = order.windows(2).map(distance).collect();
        distances.sort_by(f64::total_cmp);
        distances.get(distances.len() / 2).copied().filter(|distance| *distance > 0.0)
    }

    /// What leaving one of some presses out says of each choice that can be used; choices rise.
    fn judge(&self, part: &[usize], grid: &Grid, tried: &[Choice], means: &[f64]) -> Vec<(f64, Choice)> {
        let mut judged = Vec::with_capacity(tried.len());
        let (mut squares, mut summed) = (DMatrix::zeros(part.len(), part.len()), 0);
        for alike in tried.chunk_by(|a, b| a[..2] == b[..2]) {
            let likeness = grid.likeness(alike[0]);
            if likeness.components > summed {
                self.points.add_squares(&mut squares, part, summed..likeness.components);
                summed = likeness.components;
            }
            let kernel = self.kernel(&squares, part, likeness);
            for choice in alike {
                let solved = self.solve(&kernel, part, RIDGES[choice[2]], means);
                let missed = solved.map(|solved| solved.missed.iter().sum::<f64>());
                judged.extend(missed.filter(|missed| missed.is_finite()).map(|missed| (missed, *choice)));
            }
        }
        judged
    }

    fn squares(&self, part: &[usize], components: usize) -> DMatrix<f64> {
        let mut squares = DMatrix::zeros(part.len(), part.len());
        self.points.add_squares(&mut squares, part, 0..components);
        squares
    }

    /// The lower half of the kernel's matrix.
    fn kernel(&self, squares: &DMatrix<f64>, part: &[usize], likeness: Likeness) -> DMatrix<f64> {
        let log_sizes: Vec<f64> = part.iter().map(|&press| self.points.log_sizes[press]).collect();
        DMatrix::from_fn(part.len(), part.len(), |row, column| {
            if row < column {
                return 0.0;
            }
            likeness.of(squares[(row, column)].max(0.0), log_sizes[row] - log_sizes[column])
        })
    }

    /// Weights, and what is missed of a press that is left out; `None` if the matrix is singular to rounding.
    fn solve(&self, kernel: &DMatrix<f64>, part: &[usize], ridge: f64, means: &[f64]) -> Option<Solved> {
        let (rows, doubts) = (part.len(), &self.points.doubts);
        let mut matrix = kernel.clone();
        part.iter().enumerate().for_each(|(row, &press)| matrix[(row, row)] += ridge * doubts[press]);
        let factor = Cholesky::new(matrix).ok()?;
        let left_out = LeftOut::of(&factor, part.iter().map(|&press| self.presses[press]))?;
        let (mut weights, mut missed) = (vec![0.0; rows * self.count], Vec::with_capacity(self.count));
        for (target, mean) in means.iter().enumerate() {
            let mut solved = DVector::from_fn(rows, |row, _| self.targets[part[row] * self.count + target] - mean);
            factor.solve(&mut solved);
            missed.push(left_out.squares(&solved) / rows as f64);
            weights.iter_mut().skip(target).step_by(self.count).zip(&solved).for_each(|(to, weight)| *to = *weight);
        }
        weights.iter().all(|weight| weight.is_finite()).then_some(Solved { weights, missed })
    }
}

/// What leaving out presses takes: parts of the inverse of a matrix.
struct LeftOut {
    /// The diagonal.
    diagonal: DVector<f64>,
    /// Rows of each press that has several, and the factor of their part.
    parts: Vec<(Vec<usize>, nalgebra::Cholesky<f64, nalgebra::Dyn>)>,
}

impl LeftOut {
    /// For a matrix whose rows are of such presses; `None` if it is singular to rounding.
    fn of(factor: &Cholesky, presses: impl Iterator<Item = usize>) -> Option<Self> {
        let mut rows_of: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
        presses.enumerate().for_each(|(row, press)| rows_of.entry(press).or_default().push(row));
        let several = rows_of.into_values().filter(|rows| rows.len() > 1);
        let part = |rows: Vec<usize>| {
            let first = rows[0];
            let mut columns = DMatrix::zeros(rows.len(), factor.size() - first);
            rows.iter().enumerate().for_each(|(index, row)| columns[(index, row - first)] = 1.0);
            factor.forward(first, &mut columns);
            let part = nalgebra::Cholesky::new(&columns * columns.transpose())?;
            Some((rows, part))
        };
        Some(Self { diagonal: factor.inverse_diagonal(), parts: several.map(part).collect::<Option<_>>()? })
    }

    /// Sum of the squares of what is missed of all rows, of such weights.
    fn squares(&self, weights: &DVector<f64>) -> f64 {
        let mut missed = weights.component_div(&self.diagonal);
        for (rows, part) in &self.parts {
            let of_press = part.solve(&DVector::from_iterator(rows.len(), rows.iter().map(|&row| weights[row])));
            rows.iter().zip(&of_press).for_each(|(&row, value)| missed[row] = *value);
        }
        missed.norm_squared()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::learned::kernel::features::Description;

    fn points(dimensions: usize) -> Points {
        let even = |i: u32| [0.754_877_666, 0.569_840_291].map(|step| (f64::from(i) * step).fract());
        // Further coordinates are noise.
        let noise =
            |i: u32| (2..dimensions as u32).map(move |axis| 0.3 * (f64::from(i * i * axis) * 0.618_034).fract());
        let coordinates = (0..60).flat_map(|i| even(i).into_iter().chain(noise(i))).collect();
        let log_sizes = (0..60).map(|i| f64::from(i % 7) * 0.1).collect();
        Points::new(Description::Directions, dimensions, coordinates, log_sizes)
    }

    fn targets(points: &Points, noise: f64) -> Vec<f64> {
        let of = |index: usize| {
            let (point, wiggle) = (points.at(index), noise * if index.is_multiple_of(2) { 1.0 } else { -1.0 });
            [(3.0 * point[0]).sin() + point[1] + wiggle, point[0] * point[1]]
        };
        (0..points.count()).flat_map(of).collect()
    }

    /// Each point is a press of its own.
    static ALONE: [usize; 60] = {
        let mut alone = [0; 60];
        let mut press = 0;
        while press < 60 {
            alone[press] = press;
            press += 1;
        }
        alone
    };

    fn lesson<'a>(points: &'a Points, targets: &'a [f64]) -> Lesson<'a> {
        Lesson { points, targets, count: 2, size_weight: 0.0, presses: &ALONE }
    }

    #[test]
    fn a_smooth_function_is_learned() {
        let points = points(2);
        let regression = Regression::learn(&lesson(&points, &targets(&points, 0.0))).unwrap();
        let [squares, _] = points.squares_to(&[0.4, 0.55], 2, 2);
        let values = regression.values(&points, &squares, 0.0);
        assert!((values[0] - (1.2f64.sin() + 0.55)).abs() < 0.01 && (values[1] - 0.22).abs() < 0.01, "{values:?}");
    }

    #[test]
    fn leaving_presses_out_in_closed_form_is_leaving_them_out() {
        let points = points(2);
        let all = targets(&points, 0.05);
        let likeness = Likeness { components: 2, size_weight: 0.0, width: 0.4 };
        // Each point a press of its own, three rows a press in turn, and presses of one to several rows.
        for presses in [ALONE, ALONE.map(|row| row % 20), ALONE.map(|row| row * row / 100)] {
            let lesson = Lesson { presses: &presses, ..lesson(&points, &all) };
            let solved = |part: &[usize]| {
                lesson.solve(&lesson.kernel(&lesson.squares(part, 2), part, likeness), part, 1e-3, &[0.0; 2]).unwrap()
            };
            let mut missed = [0.0; 2];
            for left_out in 0..points.count() {
                let rest: Vec<usize> = (0..60).filter(|row| presses[*row] != presses[left_out]).collect();
                let fewer = solved(&rest).weights;
                for (target, missed) in missed.iter_mut().enumerate() {
                    let one = |(row, &press): (usize, &usize)| {
                        likeness.of(super::super::points::square(points.at(press), points.at(left_out)), 0.0)
                            * fewer[2 * row + target]
                    };
                    let predicted: f64 = rest.iter().enumerate().map(one).sum();
                    *missed += (all[2 * left_out + target] - predicted).powi(2) / points.count() as f64;
                }
            }
            let closed = solved(&ALONE).missed;
            assert!(closed.iter().zip(missed).all(|(a, b)| (a / b - 1.0).abs() < 1e-6), "{closed:?} {missed:?}");
        }
    }

    #[test]
    fn noise_is_not_learned_and_what_is_left_out_tells_of_it() {
        let points = points(2);
        let noisy = targets(&points, 0.2);
        let learned = |targets: &[f64]| Regression::learn(&lesson(&points, targets)).unwrap();
        let (clean, of_noise) = (learned(&targets(&points, 0.0)), learned(&noisy));
        assert!(clean.left_out[0] < 0.02 && of_noise.left_out[0] > 0.1, "{:?} {:?}", clean.left_out, of_noise.left_out);
        let beside = |press: usize| {
            let [squares, _] = points.squares_to(points.at(press), 2, 2);
            (of_noise.values(&points, &squares, points.log_sizes[press])[0] - noisy[2 * press]).powi(2)
        };
        let square = (0..points.count()).map(beside).sum::<f64>() / points.count() as f64;
        assert!(square.sqrt() > 0.1, "it goes through the noise: {square}");
    }

    #[test]
    fn coordinates_that_tell_nothing_are_left_out() {
        let points = points(60);
        let regression = Regression::learn(&lesson(&points, &targets(&points, 0.0))).unwrap();
        assert_eq!(regression.likeness.components, 12, "{regression:?}");
    }

    #[test]
    fn a_target_that_hardly_varies_does_not_choose_for_the_others() {
        let points = points(2);
        let even = targets(&points, 0.0);
        let with_noise: Vec<f64> =
            even.chunks_exact(2).enumerate().flat_map(|(i, pair)| [pair[0], 1e-6 * ((i * i) % 13) as f64]).collect();
        let alone: Vec<f64> = even.iter().step_by(2).flat_map(|value| [*value, 0.0]).collect();
        let [noisy, alone] = [with_noise, alone].map(|targets| Regression::learn(&lesson(&points, &targets)).unwrap());
        assert_eq!((noisy.likeness, noisy.ridge), (alone.likeness, alone.ridge));
    }

    #[test]
    fn points_that_are_all_alike_teach_nothing() {
        let points = Points::new(Description::Directions, 1, vec![0.5; 20], vec![0.0; 20]);
        assert!(Regression::learn(&lesson(&points, &[1.0; 40])).is_none());
    }
}
