//! Fields between places: a part that goes by their distance, and one that walls and pads make.

use std::sync::Arc;

use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

use super::table::{CompileError, failed};
use crate::solve::problem::Problem;
use tactomo_physics::forward::ForwardModel;
use tactomo_physics::forward::spots::Spot;
use tactomo_touch_core::spline::{interval, weights};

/// Coefficients over distances.
const KNOTS: usize = 16;
/// Places whose fields at each other are fitted, about, and every so many pairs that are.
const PAIRED: usize = 144;
const PAIR_STRIDE: usize = 3;
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

/// Pairs of places, and what fields between them are fitted by.
pub(super) struct Paired {
    /// Distance that the spline begins at (m).
    pub near_m: f64,
    /// Step of `ln r`.
    pub ln_step: f64,
    radius_m: f64,
    places_m: Vec<[f64; 2]>,
    pairs: Vec<[usize; 2]>,
    /// Of each pair, factors of the unknowns: coefficients over distances, and then of the form.
    design: DMatrix<f64>,
    factor: Cholesky<f64, Dyn>,
    /// Unit of the fields (ohm).
    scale_ohm: f64,
    /// `Q b` of the places, but for the change of `Q`.
    walls: DMatrix<f64>,
    fields_ohm: Vec<Vec<f64>>,
}

/// Fields of spots at the places, in the gauge in which the electrodes' have no mean, and those between pairs (ohm).
struct Sampled {
    fields_ohm: Vec<Vec<f64>>,
    between_ohm: DVector<f64>,
}

impl Paired {
    /// Of a problem's detector, with the fit of its own fields.
    ///
    /// # Errors
    /// [`CompileError::Fit`] if its model has no spots, or places do not determine the fit.
    pub fn of(problem: &Problem) -> Result<(Self, Between), CompileError> {
        let radius_m = problem.usual_radius_m();
        let fields = problem.model.spots(radius_m).ok_or_else(|| failed(problem, "the model has no small contacts"))?;
        let outline = &problem.detector().outline;
        let places_m: Vec<_> = fields.places_m(PAIRED).into_iter().map(|[x_m, y_m, _]| [x_m, y_m]).collect();
        let places_m: Vec<_> = places_m.into_iter().filter(|place_m| outline.holds(*place_m)).collect();
        let distance_m = |[k, l]: [usize; 2]| (places_m[k][0] - places_m[l][0]).hypot(places_m[k][1] - places_m[l][1]);
        let pairs = (0..places_m.len()).flat_map(|k| (0..k).map(move |l| [k, l]));
        let pairs: Vec<_> = pairs.step_by(PAIR_STRIDE).filter(|pair| distance_m(*pair) >= radius_m).collect();
        let [low_m, high_m] = outline.bounds();
        let far_m = (high_m[0] - low_m[0]).hypot(high_m[1] - low_m[1]);
        let ln_step = (far_m / radius_m).ln() / (KNOTS - 3) as f64;
        let sampled = Sampled::of(&*problem.model, radius_m, &places_m, &pairs)
            .ok_or_else(|| failed(problem, "the model has no small contacts"))?;
        let scale_ohm = sampled.fields_ohm.iter().flatten().fold(0.0f64, |most, ohm| most.max(ohm.abs()));
        let bases: Vec<_> = sampled.fields_ohm.iter().map(|fields| basis(fields, scale_ohm)).collect();
        let n = problem.detector().electrodes.len();
        let mut design = DMatrix::zeros(pairs.len(), KNOTS + (n + 1) * (n + 2) / 2);
        let mut row = vec![0.0; design.ncols()];
        for (index, pair) in pairs.iter().enumerate() {
            equation((distance_m(*pair) / radius_m).ln() / ln_step, pair.map(|k| &bases[k][..]), &mut row);
            design.row_mut(index).iter_mut().zip(&row).for_each(|(to, from)| *to = *from);
        }
        let mut matrix = design.transpose() * &design;
        (0..matrix.nrows()).for_each(|i| matrix[(i, i)] += RIDGE * (1.0 + matrix[(i, i)]));
        let factor =
            Cholesky::new(matrix).ok_or_else(|| failed(problem, "places do not determine what is between them"))?;
        let mut paired = Self {
            near_m: radius_m,
            ln_step,
            radius_m,
            places_m,
            pairs,
            design,
            factor,
            scale_ohm,
            walls: DMatrix::zeros(0, 0),
            fields_ohm: sampled.fields_ohm,
        };
        let between = paired.fitted(&sampled.between_ohm);
        paired.walls = paired.by_walls(&between);
        Ok((paired, between))
    }

    /// What changes of models make of it: the sum of these, each so many times. `None` if one has no spots.
    pub fn change(&self, parts: &[(f64, Arc<dyn ForwardModel>)]) -> Option<Between> {
        let mut between_ohm = DVector::zeros(self.pairs.len());
        let mut fields_ohm: Vec<Vec<f64>> = self.fields_ohm.iter().map(|fields| vec![0.0; fields.len()]).collect();
        for (share, model) in parts {
            let sampled = Sampled::of(&**model, self.radius_m, &self.places_m, &self.pairs)?;
            between_ohm += sampled.between_ohm * *share;
            for (sums, fields) in fields_ohm.iter_mut().zip(&sampled.fields_ohm) {
                sums.iter_mut().zip(fields).for_each(|(sum, ohm)| *sum += share * ohm);
            }
        }
        // What the fields' own changes make of the form is left to them.
        let with = |k: usize, l: usize| -> f64 {
            fields_ohm[k].iter().enumerate().map(|(e, ohm)| ohm * self.walls[(e, l)]).sum()
        };
        for (ohm, [k, l]) in between_ohm.iter_mut().zip(&self.pairs) {
            *ohm -= with(*k, *l) + with(*l, *k);
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
        let n = self.fields_ohm.first().map_or(0, Vec::len);
        let units = |s: usize| if s == n { 1.0 } else { self.scale_ohm };
        let indices = (0..=n).flat_map(|s| (0..=s).map(move |t| (s, t)));
        let walls = indices.zip(found.iter().skip(KNOTS)).map(|((s, t), q)| q / (units(s) * units(t))).collect();
        Between { distances: found.iter().take(KNOTS).copied().collect(), walls }
    }

    /// `Q b` of all places: a column each.
    fn by_walls(&self, between: &Between) -> DMatrix<f64> {
        let n = self.fields_ohm.first().map_or(0, Vec::len);
        let form = |s: usize, t: usize| between.walls[s.max(t) * (s.max(t) + 1) / 2 + s.min(t)];
        DMatrix::from_fn(n + 1, self.places_m.len(), |s, place| {
            let fields = &self.fields_ohm[place];
            fields.iter().enumerate().map(|(t, ohm)| form(s, t) * ohm).sum::<f64>() + form(s, n)
        })
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

/// Factors of the unknowns, coefficients over distances and then of the form, in the field between two places so many steps of `ln r` apart.
fn equation(steps: f64, [a, b]: [&[f64]; 2], row: &mut [f64]) {
    row.fill(0.0);
    let (first, t) = interval(steps, KNOTS - 3);
    weights(t).value.iter().enumerate().for_each(|(i, weight)| row[first + i] = *weight);
    let pairs = (0..a.len()).flat_map(|s| (0..=s).map(move |t| (s, t)));
    for (factor, (s, t)) in row.iter_mut().skip(KNOTS).zip(pairs) {
        let product = a[s] * b[t] + a[t] * b[s];
        *factor = if s == t { 0.5 * product } else { product };
    }
}
