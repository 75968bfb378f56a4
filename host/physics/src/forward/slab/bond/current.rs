//! Currents through the dots of glue, and how they are spread over a dot.

use std::f64::consts::PI;

use nalgebra::{DMatrix, DVector};

use super::glue::{Face, Unknown, kept};
use super::join::Joined;
use crate::forward::slab::Slab;
use crate::forward::{ForwardError, ForwardModel};
use crate::scene::Contact;

/// The dots of a [`Slab`], to ask for the currents through them.
pub struct DotCurrents<'a> {
    slab: &'a Slab,
    joined: Joined,
    dots: Vec<JoinedDot>,
}

/// A dot in the joined system.
struct JoinedDot {
    centre_m: [f64; 2],
    /// Its unknowns, among those that are eliminated.
    rows: Vec<usize>,
    /// All densities, with those above the basis, and what they are for each of its unknowns.
    densities: Vec<Unknown>,
    of_unknowns: DMatrix<f64>,
}

/// Current through a dot, downwards.
#[derive(Clone, Debug)]
pub struct DotCurrent {
    /// Middle of the dot (m), from the middle of the detector.
    pub centre_m: [f64; 2],
    /// Its radius (m).
    pub radius_m: f64,
    /// The current through it (A).
    pub current_a: f64,
    /// Its densities, by their factors (A).
    densities: Vec<(Unknown, f64)>,
}

impl Slab {
    /// The currents through the dots between two layers; `None` if there are none. Takes as long as making the slab.
    ///
    /// # Errors
    /// [`ForwardError::Detector`] if the dots cannot be joined with the layers.
    pub fn dot_currents(&self) -> Result<Option<DotCurrents<'_>>, ForwardError> {
        let Some(bonded) = &self.bonded else { return Ok(None) };
        let stacks = self.stacks(bonded);
        let joined = stacks.join(&self.pad_impedances()).ok_or_else(|| self.not_positive())?;
        let kept = kept(stacks.dots.basis);
        let uniform = self.pads.electrodes();
        let dot = |(index, centre_m): (usize, [f64; 2])| {
            let at_m = stacks.dots.centres_m[index];
            let even = self.uneven.as_ref().map_or(1.0, |uneven| uneven.inverse_root(at_m).powi(2));
            let joint = stacks.dots.joint(even);
            let own = DMatrix::identity(kept.len(), kept.len());
            let all = own.row_iter().chain(joint.of_kept.row_iter()).map(|row| row.into_owned()).collect::<Vec<_>>();
            JoinedDot {
                centre_m,
                rows: stacks.unknowns(index).iter().map(|row| row - uniform).collect(),
                densities: kept.iter().chain(&joint.higher).copied().collect(),
                of_unknowns: DMatrix::from_rows(&all),
            }
        };
        let centres_m = stacks.dots.bond.centres_m(self.size_m);
        Ok(Some(DotCurrents { slab: self, dots: centres_m.into_iter().enumerate().map(dot).collect(), joined }))
    }
}

impl DotCurrents<'_> {
    /// The current through each dot while an electrode is grounded and contacts lead to the driving layer at its voltage.
    ///
    /// # Errors
    /// As for [`ForwardModel::impedance_ohm`].
    ///
    /// # Panics
    /// If there is no such electrode.
    pub fn at(&self, ground: usize, contacts: &[Contact]) -> Result<Vec<DotCurrent>, ForwardError> {
        let detector = self.slab.detector();
        let (impedance_ohm, on_top) = self.slab.currents_on_top(contacts)?;
        let ampere = -detector.drive_v / (impedance_ohm[(ground, ground)] + detector.on_resistance_ohm);
        let Joined { grid, modes, hidden, factor, through, root_ohm, top, pads, .. } = &self.joined;
        let mut modal = DVector::zeros(modes.len());
        for (at_m, currents) in on_top {
            let root = self.slab.uneven.as_ref().map_or(1.0, |uneven| uneven.inverse_root(at_m));
            let wave = |axis: usize, mode: usize| (grid.wave_number(axis, mode) * at_m[axis]).cos();
            for (value, mode) in modal.iter_mut().zip(modes) {
                *value += root * currents[ground] * wave(0, mode.m) * wave(1, mode.n);
            }
        }
        let mut all: DVector<f64> = -pads.row(ground).transpose();
        let mut seen = all.rows_mut(*hidden, top.ncols());
        seen -= top.tr_mul(&modal);
        all.axpy(-root_ohm, through, 1.0);
        all *= ampere;
        factor.solve_transposed(&mut all);
        Ok(self.dots.iter().map(|dot| dot.current(&all, self.slab)).collect())
    }
}

impl JoinedDot {
    fn current(&self, all: &DVector<f64>, slab: &Slab) -> DotCurrent {
        let own = DVector::from_iterator(self.rows.len(), self.rows.iter().map(|row| all[*row]));
        let factors = &self.of_unknowns * &own;
        DotCurrent {
            centre_m: self.centre_m,
            radius_m: slab.bonded.as_ref().map_or(0.0, |bonded| bonded.dots.radius_m()),
            current_a: own[0],
            densities: self.densities.iter().copied().zip(factors.iter().copied()).collect(),
        }
    }
}

impl DotCurrent {
    /// Current density (A/m2) on a face of the dot, downwards, at a place from the dot's middle (m); zero beside the dot. At the very rim, where
    /// it is nearly singular, it is what the polynomials make of it.
    pub fn density_a_per_m2(&self, face: Face, [x_m, y_m]: [f64; 2]) -> f64 {
        let rho = x_m.hypot(y_m) / self.radius_m;
        if rho > 1.0 {
            return 0.0;
        }
        let theta = y_m.atan2(x_m);
        let on_face = self.densities.iter().filter(|(unknown, _)| unknown.face.is_none_or(|other| other == face));
        let sum: f64 = on_face.map(|(unknown, factor)| factor * unknown.density.at(rho, theta)).sum();
        sum / (PI * self.radius_m * self.radius_m)
    }

    /// Current through it over its area (A/m2).
    pub fn mean_density_a_per_m2(&self) -> f64 {
        self.current_a / (PI * self.radius_m * self.radius_m)
    }
}
