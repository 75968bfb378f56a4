//! What is not known of a detector: how far it makes readings differ from those of any contact, and contacts from where they are told.
//!
//! Tolerances, and gains and bows of the board's converters, change the readings of a contact. Some of that another place, strength or width of the contact would do as
//! well: the fit takes that up, and the contact is told wrong by it. The rest is left, and looks like something else that touches.

use nalgebra::{DMatrix, DVector};

use super::Modelled;
use crate::solve::fit::target::converter_patterns_v;
use tactomo_physics::forward::{Nuisance, readings_v};
use tactomo_physics::scene::Contact;

/// Places that stand for all of a detector, as shares of the outline's sides.
const TRIED: [[f64; 2]; 5] = [[0.5, 0.5], [0.25, 0.3], [0.7, 0.25], [0.3, 0.75], [0.8, 0.7]];
/// Steps of differences: of a place, in usual radii, and of logarithms.
const STEP: f64 = 0.05;
/// What changes readings by less than this, as a share of what changes them most, takes nothing up: strength against width of a firm contact.
const LEAST_PART: f64 = 0.01;
/// Standard deviations above the mean that the sum of squares of what converters leave is taken at: two gains and two bows are too few to be near their mean. What
/// tolerances leave is taken as its mean: of single contacts on detectors as built (`study built --seed 9`) 85, 88 and 89 % are one with 0, 1 and 2 deviations, of pairs
/// 67, 62 and 48 % are two.
const DEVIATIONS: f64 = 2.0;
/// Parameters of a contact that take up errors: place, strength and width.
const PARAMETERS: usize = 4;

/// Root mean squares over contacts at some places.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Unknown {
    /// Of what a contact's own parameters do not take up, over readings, as a share of the largest.
    pub share: f64,
    /// Of the error of a place along each axis (m).
    pub place_m: f64,
    /// Of the error of a conductance's logarithm.
    pub ln_conductance: f64,
}

impl Unknown {
    /// Of a detector, by what is not known of it.
    pub fn of(modelled: Modelled<'_>, nuisance: Option<&Nuisance>) -> Self {
        let all: Vec<_> = tried_m(modelled).filter_map(|place_m| Self::at(modelled, nuisance, place_m)).collect();
        let mean = |of: fn(&Self) -> f64| {
            let squares: f64 = all.iter().map(|one| of(one).powi(2)).sum();
            (squares / all.len().max(1) as f64).sqrt()
        };
        Self {
            share: mean(|one| one.share),
            place_m: mean(|one| one.place_m),
            ln_conductance: mean(|one| one.ln_conductance),
        }
    }

    /// At a place; `None` where the model has no answer.
    fn at(modelled: Modelled<'_>, nuisance: Option<&Nuisance>, [x_m, y_m]: [f64; 2]) -> Option<Self> {
        let (detector, radius_m) = (modelled.detector, modelled.radius_m);
        let contact = Contact::flat(x_m, y_m, radius_m, detector.sheet_conductance_s());
        let read = |contact: Contact| Some(readings_v(&modelled.model.impedance_ohm(&[contact]).ok()?, detector));
        let readings = read(contact)?;
        let of_electrode = |e: usize| detector.electrodes[e].converter;
        let mut unknown_v = converter_patterns_v(&readings, &detector.converters, of_electrode);
        let converters = unknown_v.ncols();
        if let Some(nuisance) = nuisance {
            let of_tolerances_v = nuisance.patterns_v(&[contact], detector).ok()?;
            unknown_v = unknown_v.resize_horizontally(converters + of_tolerances_v.ncols(), 0.0);
            unknown_v.columns_mut(converters, of_tolerances_v.ncols()).copy_from(&of_tolerances_v);
        }
        let changed = |parameter: usize, step: f64| match parameter {
            0 => Contact { x_m: x_m + step * radius_m, ..contact },
            1 => Contact { y_m: y_m + step * radius_m, ..contact },
            2 => Contact { conductance_s: contact.conductance_s * step.exp(), ..contact },
            _ => Contact { radius_m: radius_m * step.exp(), ..contact },
        };
        let mut slopes_v = DMatrix::zeros(unknown_v.nrows(), PARAMETERS);
        for parameter in 0..PARAMETERS {
            let [more, less] = [STEP, -STEP].map(|step| read(changed(parameter, step)));
            let difference = DVector::from_column_slice(more?.volts()) - DVector::from_column_slice(less?.volts());
            slopes_v.set_column(parameter, &(difference / (2.0 * STEP)));
        }
        let parts = slopes_v.clone().svd(true, true);
        let taken = parts.solve(&unknown_v, LEAST_PART * parts.singular_values.max()).ok()?;
        let left_v = &unknown_v - slopes_v * &taken;
        // The variance of a sum of squares, each of a normal number times its pattern.
        let of_converters_v = left_v.columns(0, converters);
        let beyond_v2 = DEVIATIONS * 2f64.sqrt() * of_converters_v.tr_mul(&of_converters_v).norm();
        let square_v2 = left_v.norm_squared() + beyond_v2;
        let [x, y, ln_conductance] = [0, 1, 2].map(|parameter| taken.row(parameter).norm());
        Some(Self {
            share: (square_v2 / left_v.nrows() as f64).sqrt() / readings.largest_v(),
            place_m: radius_m * (0.5 * (x * x + y * y)).sqrt(),
            ln_conductance,
        })
    }
}

/// Places that stand for all of a detector (m).
pub(super) fn tried_m(modelled: Modelled<'_>) -> impl Iterator<Item = [f64; 2]> {
    let outline = &modelled.detector.outline;
    let [low_m, high_m] = outline.bounds();
    let at = move |share: [f64; 2]| [0, 1].map(|axis| low_m[axis] + share[axis] * (high_m[axis] - low_m[axis]));
    TRIED.into_iter().map(at).filter(|place_m| outline.holds(*place_m))
}
