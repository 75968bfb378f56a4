//! Fields between places: a part that goes by the ways between them, straight and by walls, and one that pads and all else make.

use std::f64::consts::TAU;
use std::sync::Arc;

use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

use super::Modelled;
use super::splines::Grid;
use super::table::{CompileError, failed};
use tactomo_physics::detector::Outline;
use tactomo_physics::forward::ForwardModel;
use tactomo_physics::forward::spots::Spot;
use tactomo_touch_core::spline::{interval, weights};
use tactomo_touch_core::ways::ways_m;

/// Coefficients over distances.
const KNOTS: usize = 18;
/// Places spread over a detector whose fields at each other are fitted, for each electrode, and pairs of these for each unknown, about.
const SPREAD: usize = 9;
const PAIRS: usize = 10;
/// Places about each of those whose fields at it are fitted too, up to so many times as far as those are from each other: no two of them are as near as contacts may be.
const NEAR: usize = 2;
const NEAR_REACH: f64 = 1.5;
/// Golden ratio less one.
const GOLDEN: f64 = 0.618_033_988_749_895;
/// Share of the diagonal that is added to it where a fit is not determined.
const RIDGE: f64 = 1e-9;

/// Fields between places.
#[derive(Clone, Debug)]
pub(super) struct Between {
    /// Coefficients of the spline over distances (ohm).
    pub distances: Vec<f64>,
    /// `Q`: lower triangle.
    pub walls: Vec<f64>,
}

/// The spline over the lengths of ways between places.
pub(crate) struct Ways {
    /// Distance that it begins at (m).
    pub near_m: f64,
    /// Step of `ln r`.
    pub ln_step: f64,
    /// Lowest and highest corner of a rectangle whose walls there are ways by (m), by the rule of [`Table`](tactomo_touch_core::Table).
    pub walls_m: Option<[[f64; 2]; 2]>,
}

impl Ways {
    /// On a detector.
    pub fn of(modelled: Modelled<'_>) -> Self {
        let (outline, radius_m) = (&modelled.detector.outline, modelled.radius_m);
        let [low_m, high_m] = outline.bounds();
        // By walls, ways are twice as long.
        let far_m = 2.0 * (high_m[0] - low_m[0]).hypot(high_m[1] - low_m[1]);
        let ln_step = (far_m / radius_m).ln() / (KNOTS - 3) as f64;
        let is_rectangle = Grid::of(modelled).on_detector(outline).all(|is_on| is_on);
        Self { near_m: radius_m, ln_step, walls_m: is_rectangle.then_some([low_m, high_m]) }
    }

    /// Those between two places, in steps of `ln r`.
    fn steps(&self, to_m: [f64; 2], from_m: [f64; 2]) -> impl Iterator<Item = f64> {
        ways_m(to_m, from_m, self.walls_m).map(|[x_m, y_m]| (x_m.hypot(y_m) / self.near_m).ln() / self.ln_step)
    }
}

/// Pairs of places, and what fields between them are fitted by.
pub(super) struct Paired {
    pub ways: Ways,
    places_m: Vec<[f64; 2]>,
    pairs: Vec<[usize; 2]>,
    /// Of each pair, factors of the unknowns: coefficients over distances, and then of the form.
    design: DMatrix<f64>,
    factor: Cholesky<f64, Dyn>,
    /// Unit of the fields (ohm).
    scale_ohm: f64,
    /// How many electrodes.
    electrodes: usize,
}

/// Fields of spots at the places, in the gauge in which the electrodes' have no mean, and those between pairs (ohm).
struct Sampled {
    fields_ohm: Vec<Vec<f64>>,
    between_ohm: DVector<f64>,
}

impl Paired {
    /// Of a detector, with the fit of its own fields.
    ///
    /// # Errors
    /// [`CompileError::Fit`] if its model has no spots, or places do not determine the fit.
    pub fn of(modelled: Modelled<'_>) -> Result<(Self, Between), CompileError> {
        let radius_m = modelled.radius_m;
        let fields =
            modelled.model.spots(radius_m).ok_or_else(|| failed(modelled, "the model has no small contacts"))?;
        let n = modelled.detector.electrodes.len();
        let outline = &modelled.detector.outline;
        let spread_m = fields.places_m(SPREAD * n).into_iter().map(|[x_m, y_m, _]| [x_m, y_m]);
        let spread_m: Vec<_> = spread_m.filter(|place_m| outline.holds(*place_m)).collect();
        let unknowns = KNOTS + (n + 1) * (n + 2) / 2;
        let (places_m, pairs) = paired(spread_m, outline, radius_m, PAIRS * unknowns);
        let ways = Ways::of(modelled);
        let sampled = Sampled::of(&**modelled.model, radius_m, &places_m, &pairs)
            .ok_or_else(|| failed(modelled, "the model has no small contacts"))?;
        let scale_ohm = sampled.fields_ohm.iter().flatten().fold(0.0f64, |most, ohm| most.max(ohm.abs()));
        let bases: Vec<_> = sampled.fields_ohm.iter().map(|fields| basis(fields, scale_ohm)).collect();
        let mut design = DMatrix::zeros(pairs.len(), unknowns);
        let mut row = vec![0.0; design.ncols()];
        for (index, pair) in pairs.iter().enumerate() {
            let [to_m, from_m] = pair.map(|k| places_m[k]);
            equation(ways.steps(to_m, from_m), pair.map(|k| &bases[k][..]), &mut row);
            design.row_mut(index).iter_mut().zip(&row).for_each(|(to, from)| *to = *from);
        }
        let mut matrix = design.transpose() * &design;
        (0..matrix.nrows()).for_each(|i| matrix[(i, i)] += RIDGE * (1.0 + matrix[(i, i)]));
        let factor =
            Cholesky::new(matrix).ok_or_else(|| failed(modelled, "places do not determine what is between them"))?;
        let paired = Self { ways, places_m, pairs, design, factor, scale_ohm, electrodes: n };
        let between = paired.fitted(&sampled.between_ohm);
        Ok((paired, between))
    }

    /// None.
    pub fn nothing(&self) -> Between {
        let n = self.electrodes;
        Between { distances: vec![0.0; KNOTS], walls: vec![0.0; (n + 1) * (n + 2) / 2] }
    }

    /// What changes of models make of it, by the fields that are not changed: the sum of these, each so many times. `None` if one has no spots.
    pub fn change(&self, parts: &[(f64, Arc<dyn ForwardModel>)]) -> Option<Between> {
        let mut between_ohm = DVector::zeros(self.pairs.len());
        for (share, model) in parts {
            let sampled = Sampled::of(&**model, self.ways.near_m, &self.places_m, &self.pairs)?;
            between_ohm += sampled.between_ohm * *share;
        }
        Some(self.fitted(&between_ohm))
    }

    /// The fit of any function of two places (ohm), but for a constant that a place has.
    pub fn of_function(&self, function: impl Fn([f64; 2], [f64; 2]) -> f64) -> Between {
        let at = |[k, l]: &[usize; 2]| function(self.places_m[*k], self.places_m[*l]);
        self.fitted(&DVector::from_iterator(self.pairs.len(), self.pairs.iter().map(at)))
    }

    fn fitted(&self, between_ohm: &DVector<f64>) -> Between {
        let found = self.factor.solve(&self.design.tr_mul(between_ohm));
        let n = self.electrodes;
        let units = |s: usize| if s == n { 1.0 } else { self.scale_ohm };
        let indices = (0..=n).flat_map(|s| (0..=s).map(move |t| (s, t)));
        let walls = indices.zip(found.iter().skip(KNOTS)).map(|((s, t), q)| q / (units(s) * units(t))).collect();
        Between { distances: found.iter().take(KNOTS).copied().collect(), walls }
    }
}

impl Sampled {
    fn of(model: &dyn ForwardModel, radius_m: f64, places_m: &[[f64; 2]], pairs: &[[usize; 2]]) -> Option<Self> {
        let fields = model.spots(radius_m)?;
        let spots: Vec<Spot> = places_m.iter().map(|[x, y]| fields.spot([*x, *y, 0.0])).collect();
        let mean = |spot: &Spot| spot.electrodes_ohm.iter().sum::<f64>() / spot.electrodes_ohm.len() as f64;
        let means: Vec<_> = spots.iter().map(mean).collect();
        let between_ohm = pairs.iter().map(|[k, l]| fields.between_ohm(&spots[*k], &spots[*l]) - means[*k] - means[*l]);
        let centred = |(spot, mean): (&Spot, &f64)| spot.electrodes_ohm.iter().map(|ohm| ohm - mean).collect();
        Some(Self {
            between_ohm: DVector::from_iterator(pairs.len(), between_ohm),
            fields_ohm: spots.iter().zip(&means).map(centred).collect(),
        })
    }
}

fn basis(fields_ohm: &[f64], scale_ohm: f64) -> Vec<f64> {
    fields_ohm.iter().map(|ohm| ohm / scale_ohm).chain([1.0]).collect()
}

/// Places and pairs of them: of those that are spread, about so many, and of each with some that are near.
fn paired(spread_m: Vec<[f64; 2]>, outline: &Outline, least_m: f64, count: usize) -> (Vec<[f64; 2]>, Vec<[usize; 2]>) {
    let spread = spread_m.len();
    let stride = (spread * spread.saturating_sub(1) / 2 / count).max(1);
    let all = (0..spread).flat_map(|k| (0..k).map(move |l| [k, l]));
    let mut pairs: Vec<_> = all.step_by(stride).collect();
    let [low_m, high_m] = outline.bounds();
    let apart_m = ((high_m[0] - low_m[0]) * (high_m[1] - low_m[1]) / spread.max(1) as f64).sqrt();
    let ln_reach = (NEAR_REACH * apart_m / least_m).ln().max(0.0);
    let mut places_m = spread_m;
    for index in 0..NEAR * spread {
        // Turned by the golden angle, and as far as the golden ratio spreads them evenly in the logarithm.
        let turns = index as f64 * GOLDEN;
        let (way_m, angle) = (least_m * (ln_reach * (7.0 * turns).fract()).exp(), TAU * turns);
        let [x_m, y_m] = places_m[index / NEAR];
        let near_m = [x_m + way_m * angle.cos(), y_m + way_m * angle.sin()];
        if outline.holds(near_m) {
            pairs.push([places_m.len(), index / NEAR]);
            places_m.push(near_m);
        }
    }
    pairs.retain(|[k, l]| (places_m[*k][0] - places_m[*l][0]).hypot(places_m[*k][1] - places_m[*l][1]) >= least_m);
    (places_m, pairs)
}

/// Factors of the unknowns, coefficients over distances and then of the form, in the field between two places with ways of so many steps of `ln r` between them.
fn equation(ways: impl Iterator<Item = f64>, [a, b]: [&[f64]; 2], row: &mut [f64]) {
    row.fill(0.0);
    for steps in ways {
        let (first, t) = interval(steps, KNOTS - 3);
        weights(t).value.iter().enumerate().for_each(|(i, weight)| row[first + i] += *weight);
    }
    let pairs = (0..a.len()).flat_map(|s| (0..=s).map(move |t| (s, t)));
    for (factor, (s, t)) in row.iter_mut().skip(KNOTS).zip(pairs) {
        let product = a[s] * b[t] + a[t] * b[s];
        *factor = if s == t { 0.5 * product } else { product };
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::solve::Problem;
    use tactomo_physics::detector::Detector;

    /// Near and far, in the middle and at walls, also where electrodes are many and the layer is thin.
    #[test]
    fn fields_between_places_are_the_models() {
        for name in ["square-60", "display-140x70"] {
            let problem = Problem::of(&Detector::preset(name).unwrap()).unwrap();
            let modelled = problem.modelled();
            let (paired, between) = Paired::of(modelled).unwrap();
            let outline = &modelled.detector.outline;
            let [low_m, high_m] = outline.bounds();
            let (mut places_m, mut pairs) = (Vec::new(), Vec::new());
            let mut random = fastrand::Rng::with_seed(7);
            while pairs.len() < 400 {
                let at_m = [0, 1].map(|d| low_m[d] + random.f64() * (high_m[d] - low_m[d]));
                let (way_m, angle) = (paired.ways.near_m * 20f64.powf(random.f64()), TAU * random.f64());
                let to_m = [at_m[0] + way_m * angle.cos(), at_m[1] + way_m * angle.sin()];
                if outline.holds(to_m) {
                    pairs.push([places_m.len(), places_m.len() + 1]);
                    places_m.extend([at_m, to_m]);
                }
            }
            let sampled = Sampled::of(&**modelled.model, paired.ways.near_m, &places_m, &pairs).unwrap();
            let all: Vec<_> = between.distances.iter().chain(&between.walls).collect();
            let mut row = vec![0.0; all.len()];
            let (mut off, mut square) = (0.0, 0.0);
            for (pair, exact_ohm) in pairs.iter().zip(sampled.between_ohm.iter()) {
                let [to_m, from_m] = pair.map(|k| places_m[k]);
                let bases = pair.map(|k| basis(&sampled.fields_ohm[k], 1.0));
                equation(paired.ways.steps(to_m, from_m), bases.each_ref().map(|basis| &basis[..]), &mut row);
                let ohm: f64 = row.iter().zip(&all).map(|(factor, value)| factor * **value).sum();
                off += (ohm - exact_ohm).powi(2);
                square += exact_ohm.powi(2);
            }
            let share = (off / square).sqrt();
            assert!(share < 0.025, "{name}: {share}");
        }
    }
}
