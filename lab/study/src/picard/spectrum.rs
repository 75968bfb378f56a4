//! Singular values and coefficients, as multiples of the noise.

use nalgebra::{DMatrix, DVector};

/// Singular values below this share of the largest are rounding.
const ROUNDING: f64 = 1e-9;
/// Readings tell a direction if signal is as large as noise there: the root of the mean square of both, in deviations of noise.
const TOLD: f64 = std::f64::consts::SQRT_2;

/// Frames whose mean has a tenth of the noise.
pub(super) const AVERAGED: u32 = 100;

/// What readings are made of, by how much images of one strength change it: the strongest first.
pub(super) struct Directions {
    /// `readings x rank`, orthonormal.
    readings: DMatrix<f64>,
    /// V for 1 S/m.
    singular_values: Vec<f64>,
}

/// Singular values and coefficients of presses, as multiples of the noise.
#[derive(Clone, Debug, serde::Serialize)]
pub struct Spectrum {
    /// Falling: the coefficient that a light press has in the mean over all places (root mean square).
    pub singular_values: Vec<f64>,
    /// Of each press, a coefficient for each singular value.
    pub coefficients: Vec<Vec<f64>>,
    /// Root mean square of the coefficients over presses.
    pub typical: Vec<f64>,
    /// Singular values above the noise of a frame.
    pub above_noise: usize,
    /// Singular values above the noise of the mean of a hundred frames.
    pub above_averaged: usize,
    /// Coefficients of these presses that have as much signal as noise or more.
    pub told: usize,
    /// Root mean square of what no image gives of the readings, a reading.
    pub outside: f64,
}

impl Directions {
    /// Of derivatives of readings by the conductances of nodes of such areas, for images measured by the integral of their square.
    pub fn of(mut tangent_v_per_s: DMatrix<f64>, areas_m2: &[f64]) -> Self {
        for (mut column, area_m2) in tangent_v_per_s.column_iter_mut().zip(areas_m2) {
            column *= area_m2.sqrt();
        }
        let mut decomposition = tangent_v_per_s.svd(true, false);
        decomposition.sort_by_singular_values();
        let values = decomposition.singular_values;
        let least = ROUNDING * values.amax();
        let rank = values.iter().take_while(|value| **value > least).count();
        let readings = decomposition.u.map_or_else(|| DMatrix::zeros(0, 0), |u| u.columns(0, rank).into_owned());
        Self { readings, singular_values: values.iter().take(rank).copied().collect() }
    }

    /// The spectrum of changes of the readings (V) by presses whose images have such a share of each singular image (S/m), under noise of a deviation (V).
    ///
    /// # Panics
    /// If there are not as many readings.
    pub fn spectrum(&self, changes_v: &[Vec<f64>], strength_s_per_m: f64, noise_v: f64) -> Spectrum {
        let scaled = |value: &f64| value * strength_s_per_m / noise_v;
        let singular_values: Vec<f64> = self.singular_values.iter().map(scaled).collect();
        let (mut coefficients, mut outside) = (Vec::with_capacity(changes_v.len()), 0.0);
        for change_v in changes_v {
            let change = DVector::from_column_slice(change_v) / noise_v;
            let inside = self.readings.tr_mul(&change);
            let free = change.len().saturating_sub(inside.len()).max(1);
            outside += (change.norm_squared() - inside.norm_squared()).max(0.0) / free as f64;
            coefficients.push(inside.iter().map(|value| value.abs()).collect::<Vec<f64>>());
        }
        let count = changes_v.len().max(1) as f64;
        let typical = |index: usize| (coefficients.iter().map(|all| all[index].powi(2)).sum::<f64>() / count).sqrt();
        let typical: Vec<f64> = (0..singular_values.len()).map(typical).collect();
        let above = |noise: f64| singular_values.iter().filter(|value| **value > noise).count();
        Spectrum {
            above_noise: above(1.0),
            above_averaged: above(1.0 / f64::from(AVERAGED).sqrt()),
            told: typical.iter().filter(|value| **value >= TOLD).count(),
            outside: (outside / count).sqrt(),
            singular_values,
            coefficients,
            typical,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two nodes of 4 and 1 m2 that change one reading each, by 3 and 5 V/S, of three.
    fn directions() -> Directions {
        let tangent = DMatrix::from_row_slice(3, 2, &[0.0, 5.0, 3.0, 0.0, 0.0, 0.0]);
        Directions::of(tangent, &[4.0, 1.0])
    }

    #[test]
    fn nodes_count_by_the_root_of_their_area() {
        let spectrum = directions().spectrum(&[], 0.1, 0.2);
        let expected = [6.0, 5.0].map(|value| value * 0.1 / 0.2);
        assert!(spectrum.singular_values.iter().zip(expected).all(|(found, value)| (found - value).abs() < 1e-12));
        assert_eq!((spectrum.above_noise, spectrum.above_averaged), (2, 2));
        let light = directions().spectrum(&[], 0.011, 0.2);
        assert_eq!((light.above_noise, light.above_averaged, light.told), (0, 2, 0), "{light:?}");
    }

    #[test]
    fn readings_are_told_by_direction_and_the_rest_is_outside() {
        let spectrum = directions().spectrum(&[vec![0.1, 0.6, 0.4], vec![-0.1, -0.6, 0.0]], 1.0, 0.2);
        let near = |found: &[f64], expected: [f64; 2]| found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-9);
        assert!(spectrum.coefficients.iter().all(|all| near(all, [3.0, 0.5])) && near(&spectrum.typical, [3.0, 0.5]));
        assert_eq!(spectrum.told, 1);
        assert!((spectrum.outside - 2f64.sqrt()).abs() < 1e-9, "{spectrum:?}");
    }
}
