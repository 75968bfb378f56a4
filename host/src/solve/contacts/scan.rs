//! Where another contact would explain most of what is left: a look at every place.

use super::fit::{Fit, Fitter};
use super::network::FitSpot;
use super::target::{Target, dot};
use crate::forward::ImageMesh;
use crate::forward::spots::{Spot, SpotFields};
use crate::solve::balance;
use crate::space;

/// Places that are looked at.
#[derive(Clone, Debug)]
pub(super) struct Scan {
    spots: Vec<Spot>,
}

/// A place for a contact.
#[derive(Clone, Debug)]
pub(super) struct Candidate {
    pub spot: FitSpot,
    /// By how much it lowers the sum of squares, in the linear theory.
    pub gain: f64,
}

impl Scan {
    /// Looks at the nodes of a mesh.
    pub fn new(mesh: &ImageMesh, fields: &dyn SpotFields) -> Self {
        Self { spots: (0..mesh.nodes_m.len()).map(|node| fields.spot(mesh.place_m(node))).collect() }
    }

    /// Candidates for one contact alone, the best first, each apart from better ones.
    ///
    /// Balanced readings of one contact are exactly linear in the fields at its place (`solve::balance`), whatever its force,
    /// so the scan finds it; the rows' mean load is `A - 2 f + E[g][g] + R`, which gives its resistance `A`.
    pub fn first(&self, fitter: &Fitter<'_>, target: &Target, count: usize, apart_m: f64) -> Vec<Candidate> {
        let network = fitter.network;
        let n = network.electrodes();
        let mut volts = target.volts.clone();
        balance::balance(&mut volts, n, network.drive_v);
        target.whiten(&mut volts);
        let pads = &network.electrodes_ohm;
        let constant: Vec<_> =
            (0..n * n).map(|i| pads[(i / n, i / n)] - pads[(i % n, i / n)] + network.on_resistance_ohm).collect();
        let mut pattern = vec![0.0; n * n];
        let all = self.spots.iter().filter_map(|spot| {
            let field = &spot.electrodes_ohm;
            for (i, value) in pattern.iter_mut().enumerate() {
                *value = network.drive_v * (field[i % n] - field[i / n] + constant[i]);
            }
            let (conductance_s, gain) = amplitude(&mut pattern, &volts, target)?;
            let mean_load =
                (0..n).map(|g| pads[(g, g)] - 2.0 * field[g] + network.on_resistance_ohm).sum::<f64>() / n as f64;
            let ohm = (1.0 / conductance_s - mean_load).max(spot.own_ohm);
            Some(Candidate { spot: fitter.spot(spot.clone(), ohm), gain })
        });
        best(all.collect(), count, apart_m)
    }

    /// Candidates for one more contact beside those of a fit.
    pub fn further(
        &self,
        fitter: &Fitter<'_>,
        fit: &Fit,
        target: &Target,
        count: usize,
        apart_m: f64,
    ) -> Vec<Candidate> {
        let n = fitter.network.electrodes();
        let left = target.residuals(&fit.volts);
        let mut pattern = vec![0.0; n * n];
        let all = self.spots.iter().filter_map(|spot| {
            let potentials_ohm = fitter.network.potentials_ohm(&fit.solved, &fit.spots, spot, fitter.fields);
            fitter.network.volts_per_s(&fit.solved, &potentials_ohm, &mut pattern);
            let (conductance_s, gain) = amplitude(&mut pattern, &left, target)?;
            let ohm = (1.0 / conductance_s).max(spot.own_ohm);
            Some(Candidate { spot: fitter.spot(spot.clone(), ohm), gain })
        });
        best(all.collect(), count, apart_m)
    }
}

/// How much of a pattern (V/S) is in some whitened volts, and by how much that lowers their sum of squares; `None` if not
/// above zero.
fn amplitude(pattern: &mut [f64], volts: &[f64], target: &Target) -> Option<(f64, f64)> {
    target.whiten(pattern);
    let (along, square) = (dot(pattern, volts), dot(pattern, pattern));
    (along > 0.0 && square > 0.0).then(|| (along / square, along * along / square))
}

fn best(mut all: Vec<Candidate>, count: usize, apart_m: f64) -> Vec<Candidate> {
    all.sort_unstable_by(|a, b| b.gain.total_cmp(&a.gain));
    let mut chosen: Vec<Candidate> = Vec::with_capacity(count);
    for candidate in all {
        if chosen.len() == count {
            break;
        }
        let place_m = |candidate: &Candidate| candidate.spot.spot.place_m;
        if chosen.iter().all(|other| space::distance(place_m(other), place_m(&candidate)) > apart_m) {
            chosen.push(candidate);
        }
    }
    chosen
}
