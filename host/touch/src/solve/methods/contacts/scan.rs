//! Where contacts would explain most of what is left: a look at every place, and at every pair of places.

use std::borrow::Cow;

use nalgebra::{Cholesky, DMatrix, DVector};

use crate::solve::fit::balance;
use crate::solve::fit::dot::dot;
use crate::solve::fit::spots::{LoadedSpot, SpotModel};
use crate::solve::fit::target::Target;
use tactomo_physics::forward::spots::{Spot, SpotFields};
use tactomo_physics::readings::Readings;
use tactomo_physics::space;

/// Every so many places one is looked at in pairs.
const PAIR_STRIDE: usize = 2;

/// Share of a pattern that is taken for new, at least: where nothing is new, a gain would be a quotient of errors.
const LEAST_NEW: f64 = 0.02;

/// Places that are looked at.
#[derive(Clone, Debug)]
pub(super) struct Scan {
    spots: Vec<Spot>,
    first: FirstLook,
}

/// What single light contacts do to the readings, which has as few dimensions as there are electrodes.
#[derive(Clone, Debug)]
struct FirstLook {
    /// Orthonormal directions of readings: `electrodes^2 x electrodes`.
    basis: DMatrix<f64>,
    /// Change of the readings by conductance in these (V/S): a column for each place.
    patterns: DMatrix<f64>,
    /// Squares of their lengths.
    squares: Vec<f64>,
    /// Scalar products of the patterns of places that are looked at in pairs.
    pairs: DMatrix<f64>,
    /// Mean of `E[g][g] - 2 f + R` at each place (ohm).
    load_ohm: Vec<f64>,
}

/// What contacts at all places would do to whitened readings, linearly, and what is to be explained.
pub(super) struct Looks<'a> {
    /// Whitened change of the readings by conductance (1/S): a column for each place.
    patterns: Cow<'a, DMatrix<f64>>,
    /// Of each, the square of its length, but for what the contacts that there are could do as well.
    squares: Cow<'a, [f64]>,
    /// Whitened readings that are left.
    left: DVector<f64>,
    /// Resistance besides that of a contact alone that its share of the readings stands for (ohm); none if there is none.
    load_ohm: &'a [f64],
    /// Gains are to be multiplied with this.
    gain: f64,
}

/// Contacts that are fitted, beside which more are looked for.
pub(super) struct Fitted<'a> {
    pub spots: &'a [LoadedSpot],
    /// Whitened derivatives of the readings, a column for each parameter, and their normal matrix.
    pub slopes: DMatrix<f64>,
    pub normal: &'a DMatrix<f64>,
    /// Whitened readings that are left.
    pub left: DVector<f64>,
}

/// Contacts to start from, and by how much they lower the sum of squares, in the linear theory.
pub(super) struct Candidate {
    /// Place in the scan, and conductance (S).
    contacts: Vec<(usize, f64)>,
    pub gain: f64,
}

impl Scan {
    /// Looks at about so many places.
    pub fn new(fields: &dyn SpotFields, spot_model: &SpotModel, places: usize) -> Self {
        let spots: Vec<_> = fields.places_m(places).into_iter().map(|place_m| fields.spot(place_m)).collect();
        Self { first: FirstLook::new(&spots, spot_model), spots }
    }

    /// Looks for contacts where there are none yet.
    ///
    /// Balanced readings of one contact are exactly linear in the fields at its place (`solve::balance`), whatever its force and
    /// whatever the pads' own impedances, so the scan finds it; the rows' mean load is `A - 2 f + E[g][g] + R`, which gives its
    /// resistance `A`. `readings` are those of the target, completed.
    pub fn at_first(&self, spot_model: &SpotModel, target: &Target, readings: &Readings) -> Looks<'_> {
        let mut volts = readings.volts().to_vec();
        balance::balance(&mut volts, spot_model.electrodes(), spot_model.drive_v);
        Looks {
            patterns: Cow::Borrowed(&self.first.patterns),
            squares: Cow::Borrowed(&self.first.squares),
            left: self.first.basis.tr_mul(&DVector::from_vec(volts)),
            load_ohm: &self.first.load_ohm,
            gain: target.deviation_v().powi(-2),
        }
    }

    /// Share of the square of balanced `readings` that the best single place leaves: of one contact, what noise and the model's error do.
    pub fn left_by_one(&self, spot_model: &SpotModel, readings: &Readings) -> f64 {
        let mut volts = readings.volts().to_vec();
        balance::balance(&mut volts, spot_model.electrodes(), spot_model.drive_v);
        let volts = DVector::from_vec(volts);
        let along = self.first.patterns.tr_mul(&self.first.basis.tr_mul(&volts));
        let gains = along.iter().zip(&self.first.squares).filter(|(along, _)| **along > 0.0);
        let explained = gains.map(|(along, square)| along * along / square).fold(0.0, f64::max);
        1.0 - explained / volts.norm_squared().max(f64::MIN_POSITIVE)
    }

    /// Looks for more contacts beside those that are fitted: what they would explain that a change of those would not.
    ///
    /// With the fit's whitened derivatives `S` and normal matrix `H`, of a pattern `p` only `p - S H^-1 S^T p` is new; what is left, `r`, has no
    /// part along `S`, as the fit is at its minimum.
    pub fn beside(
        &self,
        spot_model: &SpotModel,
        fields: &dyn SpotFields,
        fitted: &Fitted<'_>,
        target: &Target,
    ) -> Option<Looks<'_>> {
        let n = spot_model.electrodes();
        let solved = spot_model.solve(fitted.spots, fields)?;
        let mut patterns = DMatrix::zeros(n * n, self.spots.len());
        for (mut column, spot) in patterns.column_iter_mut().zip(&self.spots) {
            let potentials_ohm = spot_model.potentials_ohm(&solved, fitted.spots, spot, fields);
            spot_model.volts_per_s(&solved, &potentials_ohm, column.as_mut_slice());
        }
        target.whiten_columns(&mut patterns);
        let mut shared = fitted.slopes.tr_mul(&patterns);
        let factor = Cholesky::new(fitted.normal.clone())?;
        factor.l_dirty().solve_lower_triangular_mut(&mut shared);
        let news = patterns.column_iter().zip(shared.column_iter()).map(|(pattern, shared)| {
            let (all, old) = (pattern.norm_squared(), shared.norm_squared());
            (all - old).max(LEAST_NEW * all)
        });
        Some(Looks {
            squares: news.collect::<Vec<_>>().into(),
            patterns: Cow::Owned(patterns),
            left: fitted.left.clone(),
            load_ohm: &[],
            gain: 1.0,
        })
    }

    /// The best places for one contact, each apart from better ones.
    pub fn ones(&self, looks: &Looks<'_>, count: usize, apart_m: f64) -> Vec<Candidate> {
        let all = (0..self.spots.len()).filter_map(|place| {
            let along = dot(looks.patterns.column(place).as_slice(), looks.left.as_slice()).max(0.0);
            let conductance_s = along / looks.squares[place];
            let gain = looks.gain * along * conductance_s;
            (gain > 0.0).then(|| Candidate { contacts: vec![(place, conductance_s)], gain })
        });
        self.best(all.collect(), count, apart_m)
    }

    /// The best places for two contacts at once where there are none yet, over all pairs of a coarser choice of places.
    pub fn pairs(&self, looks: &Looks<'_>, count: usize, apart_m: f64) -> Vec<Candidate> {
        let places = paired(self.spots.len());
        let patterns = looks.patterns.select_columns(&places);
        let products = &self.first.pairs;
        let along = patterns.tr_mul(&looks.left);
        let mut all = Vec::new();
        let mut floor = 0.0;
        for i in 0..places.len() {
            let (own_i, along_i) = (products[(i, i)], along[i]);
            for j in 0..i {
                let (own_j, cross) = (products[(j, j)], products[(j, i)]);
                let (a, b) = (own_j * along_i - cross * along[j], own_i * along[j] - cross * along_i);
                if a <= 0.0 || b <= 0.0 {
                    continue;
                }
                let determinant = own_i * own_j - cross * cross;
                let gain = looks.gain * (a * along_i + b * along[j]) / determinant;
                if gain > floor {
                    floor = floor.max(KEPT_GAIN * gain);
                    let contacts = vec![(places[i], a / determinant), (places[j], b / determinant)];
                    all.push(Candidate { contacts, gain });
                }
            }
        }
        all.retain(|candidate| candidate.gain >= floor);
        self.best(all, count, apart_m)
    }

    /// The spots of a candidate.
    pub fn start(&self, looks: &Looks<'_>, candidate: &Candidate) -> Vec<LoadedSpot> {
        let spot = |(place, conductance_s): &(usize, f64)| {
            let spot = self.spots[*place].clone();
            let load_ohm = looks.load_ohm.get(*place).copied().unwrap_or_default();
            LoadedSpot { ohm: (1.0 / conductance_s - load_ohm).max(spot.own_ohm), spot }
        };
        candidate.contacts.iter().map(spot).collect()
    }

    /// The best candidates, each with a contact that is apart from all of the better ones'.
    fn best(&self, mut all: Vec<Candidate>, count: usize, apart_m: f64) -> Vec<Candidate> {
        all.sort_unstable_by(|a, b| b.gain.total_cmp(&a.gain));
        let mut chosen: Vec<Candidate> = Vec::with_capacity(count);
        for candidate in all {
            if chosen.len() == count {
                break;
            }
            let is_apart = |place: usize, other: &Candidate| {
                let places = other.contacts.iter().map(|(other, _)| *other);
                places
                    .into_iter()
                    .all(|other| space::distance(self.spots[place].place_m, self.spots[other].place_m) > apart_m)
            };
            if chosen.iter().all(|other| candidate.contacts.iter().any(|(place, _)| is_apart(*place, other))) {
                chosen.push(candidate);
            }
        }
        chosen
    }
}

impl FirstLook {
    fn new(spots: &[Spot], spot_model: &SpotModel) -> Self {
        let n = spot_model.electrodes();
        let pads = &spot_model.electrodes_ohm;
        let drive_v = spot_model.drive_v;
        // Differences of fields at electrodes, and what is alike for all places.
        let constant = |g: usize, e: usize| pads[(g, g)] - pads[(e, g)] + spot_model.on_resistance_ohm;
        let directions = DMatrix::from_fn(n * n, n, |row, source| {
            let (g, e) = (row / n, row % n);
            match source + 1 == n {
                true => drive_v * constant(g, e),
                false => drive_v * (f64::from(u8::from(source == e)) - f64::from(u8::from(source == g))),
            }
        });
        let sources = DMatrix::from_fn(n, spots.len(), |source, place| {
            let field = &spots[place].electrodes_ohm;
            if source + 1 == n { 1.0 } else { field[source] - field[n - 1] }
        });
        let factor = directions.qr();
        let patterns = factor.r() * sources;
        let chosen = patterns.select_columns(&paired(spots.len()));
        let mean_ohm = |spot: &Spot| {
            let load = |g: usize| pads[(g, g)] - 2.0 * spot.electrodes_ohm[g] + spot_model.on_resistance_ohm;
            (0..n).map(load).sum::<f64>() / n as f64
        };
        Self {
            basis: factor.q(),
            squares: patterns.column_iter().map(|pattern| pattern.norm_squared()).collect(),
            pairs: chosen.transpose() * &chosen,
            load_ohm: spots.iter().map(mean_ohm).collect(),
            patterns,
        }
    }
}

/// Places of so many that are looked at in pairs.
fn paired(places: usize) -> Vec<usize> {
    (0..places).step_by(PAIR_STRIDE).collect()
}

/// Pairs with less than this share of the best gain so far are not kept.
const KEPT_GAIN: f64 = 0.95;
