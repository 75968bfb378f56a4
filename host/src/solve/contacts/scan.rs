//! Where contacts would explain most of what is left: a look at every place, and at every pair of places.

use nalgebra::{DMatrix, DVector};

use super::fit::{Fit, Fitter};
use super::network::FitSpot;
use super::target::{Target, dot};
use crate::forward::ImageMesh;
use crate::forward::spots::{Spot, SpotFields};
use crate::solve::balance;
use crate::space;

/// Every so many places one is looked at in pairs.
const PAIR_STRIDE: usize = 2;

/// Places that are looked at.
#[derive(Clone, Debug)]
pub(super) struct Scan {
    spots: Vec<Spot>,
}

/// What contacts at all places would do to whitened readings, linearly, and what is to be explained.
pub(super) struct Looks {
    /// Whitened change of the readings by conductance (1/S): a column for each place.
    patterns: DMatrix<f64>,
    /// Whitened readings that are left.
    left: DVector<f64>,
    /// Resistance besides that of a contact alone that its share of the readings stands for (ohm).
    load_ohm: Vec<f64>,
}

/// Contacts to start from, and by how much they lower the sum of squares, in the linear theory.
pub(super) struct Candidate {
    /// Place in the scan, and conductance (S).
    contacts: Vec<(usize, f64)>,
    pub gain: f64,
}

impl Scan {
    /// Looks at the nodes of a mesh.
    pub fn new(mesh: &ImageMesh, fields: &dyn SpotFields) -> Self {
        Self { spots: (0..mesh.nodes_m.len()).map(|node| fields.spot(mesh.place_m(node))).collect() }
    }

    /// Looks for contacts where there are none yet.
    ///
    /// Balanced readings of one contact are exactly linear in the fields at its place (`solve::balance`), whatever its force,
    /// so the scan finds it; the rows' mean load is `A - 2 f + E[g][g] + R`, which gives its resistance `A`.
    pub fn at_first(&self, fitter: &Fitter<'_>, target: &Target) -> Looks {
        let network = fitter.network;
        let n = network.electrodes();
        let mut volts = target.volts.clone();
        balance::balance(&mut volts, n, network.drive_v);
        target.whiten(&mut volts);
        let pads = &network.electrodes_ohm;
        let mean_ohm = |field: &[f64]| {
            (0..n).map(|g| pads[(g, g)] - 2.0 * field[g] + network.on_resistance_ohm).sum::<f64>() / n as f64
        };
        let mut patterns = DMatrix::zeros(n * n, self.spots.len());
        for (mut column, spot) in patterns.column_iter_mut().zip(&self.spots) {
            let (field, pattern) = (&spot.electrodes_ohm, column.as_mut_slice());
            for (g, row) in pattern.chunks_exact_mut(n).enumerate() {
                let own = pads[(g, g)] - field[g] + network.on_resistance_ohm;
                let pads_g = pads.column(g);
                let fields = field.iter().zip(pads_g.iter());
                row.iter_mut()
                    .zip(fields)
                    .for_each(|(volts, (field, pad))| *volts = network.drive_v * (own + field - pad));
            }
            target.whiten(pattern);
        }
        let load_ohm = self.spots.iter().map(|spot| mean_ohm(&spot.electrodes_ohm)).collect();
        Looks { patterns, left: volts.into(), load_ohm }
    }

    /// Looks for more contacts beside those of a fit.
    pub fn beside(&self, fitter: &Fitter<'_>, fit: &Fit, target: &Target) -> Looks {
        let n = fitter.network.electrodes();
        let mut patterns = DMatrix::zeros(n * n, self.spots.len());
        for (mut column, spot) in patterns.column_iter_mut().zip(&self.spots) {
            let potentials_ohm = fitter.network.potentials_ohm(&fit.solved, &fit.spots, spot, fitter.fields);
            fitter.network.volts_per_s(&fit.solved, &potentials_ohm, column.as_mut_slice());
            target.whiten(column.as_mut_slice());
        }
        Looks { patterns, left: target.residuals(&fit.volts).into(), load_ohm: vec![0.0; self.spots.len()] }
    }

    /// The best places for one contact, each apart from better ones.
    pub fn ones(&self, looks: &Looks, count: usize, apart_m: f64) -> Vec<Candidate> {
        let all = looks.patterns.column_iter().enumerate().filter_map(|(place, pattern)| {
            let (along, square) = (dot(pattern.as_slice(), looks.left.as_slice()), pattern.norm_squared());
            (along > 0.0).then(|| Candidate { contacts: vec![(place, along / square)], gain: along * along / square })
        });
        self.best(all.collect(), count, apart_m)
    }

    /// The best places for two contacts at once, over all pairs of a coarser choice of places.
    pub fn pairs(&self, looks: &Looks, count: usize, apart_m: f64) -> Vec<Candidate> {
        let places: Vec<_> = (0..self.spots.len()).step_by(PAIR_STRIDE).collect();
        let patterns = looks.patterns.select_columns(&places);
        let products = patterns.tr_mul(&patterns);
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
                let gain = (a * along_i + b * along[j]) / determinant;
                if gain > floor {
                    floor = floor.max(KEPT * gain);
                    let contacts = vec![(places[i], a / determinant), (places[j], b / determinant)];
                    all.push(Candidate { contacts, gain });
                }
            }
        }
        self.best(all, count, apart_m)
    }

    /// The spots of a candidate.
    pub fn start(&self, fitter: &Fitter<'_>, looks: &Looks, candidate: &Candidate) -> Vec<FitSpot> {
        let spot = |(place, conductance_s): &(usize, f64)| {
            let spot = self.spots[*place].clone();
            let ohm = (1.0 / conductance_s - looks.load_ohm[*place]).max(spot.own_ohm);
            fitter.spot(spot, ohm)
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

/// Pairs with less than this share of the best gain so far are not kept.
const KEPT: f64 = 0.8;
