//! Leakage: where the layers touch lightly everywhere, by a preload or a worn mesh.
//!
//! That is an even image of contact conductance, in parallel to all contacts. It carries less current the more the contacts do, so taking
//! off its voltages at rest is right for light contacts only: with a hundredth of a sheet conductance 16 of 25 mV are wrong under a firm
//! one. Its current is nearly as even as it is, so it acts as one more terminal `l` whose current is spread over the surface. In ohms, of
//! the impedances `Z` of the touched detector,
//!
//! ```text
//! Z with leakage = Z - z z' / (1/C + Z[l][l]),    z[e] = Z[e][l].
//! ```
//!
//! `z` follows from `Z` itself. Weights `w` of the electrodes, which add up to one, give a field `N w` that is flat at the surface, so
//! that what a current spread over the surface does besides, `l - w`, no contact sees: `z = Z w + h`, and `h` is known of the bare
//! detector. `Z` follows from readings by reciprocity but for a factor, and that from the bare detector: if a contact is single, the
//! doubly centred `Z` is that of the bare detector. If there are several it is less, and the sum above is hardly another.

use nalgebra::{DMatrix, DVector};

use super::{BaselinePatterns, mean_fields_ohm};
use crate::forward::jacobian::Jacobian;

/// Rounds of `touch = readings - rest - what the leakage does under that touch`.
const ROUNDS: usize = 3;
/// Smallest `1 - V / Vcc` that a logarithm is taken of.
const SMALLEST: f64 = 1e-3;
/// Touches of less conductance than this are none to leakage (sheet conductances).
const NOTHING: f64 = 1e-5;
/// Share of the fields' variation that is added to keep the weights even where they do not matter.
const EVEN: f64 = 1e-6;

/// What leakage does to readings under a touch.
#[derive(Clone, Debug)]
pub struct Leakage {
    drive_v: f64,
    sheet_s: f64,
    /// Resistance of the multiplexer (ohm, times a sheet conductance).
    switch: f64,
    /// Electrodes of all that are looked at.
    kept: Vec<usize>,
    electrodes: usize,
    /// Fields of the bare detector at the electrodes, zero in the mean over the surface (times a sheet conductance).
    bare: DMatrix<f64>,
    /// `w` and `h`, and the impedance of `l - w`.
    weights: DVector<f64>,
    besides: DVector<f64>,
    own: f64,
}

impl Leakage {
    /// The leakage of a detector, seen through some of its electrodes.
    pub fn new(jacobian: &Jacobian, kept: &[usize]) -> Self {
        let sheet_s = jacobian.detector.sheet_conductance_s();
        let means_ohm = mean_fields_ohm(jacobian);
        let gauge_ohm = kept.iter().map(|e| means_ohm[*e]).sum::<f64>() / kept.len().max(1) as f64;
        let at_pads = jacobian.electrode_fields_ohm.select_rows(kept).select_columns(kept);
        let bare = at_pads.add_scalar(-gauge_ohm) * sheet_s;
        let fields = jacobian.fields_ohm.select_columns(kept).add_scalar(-gauge_ohm) * sheet_s;
        let weights = flat(&fields);
        let level = (&fields * &weights).mean();
        Self {
            drive_v: jacobian.detector.drive_v,
            sheet_s,
            switch: jacobian.detector.on_resistance_ohm * sheet_s,
            kept: kept.to_vec(),
            electrodes: jacobian.electrodes(),
            besides: (&bare * &weights).map(|field| level - field),
            own: weights.dot(&(&bare * &weights)),
            weights,
            bare,
        }
    }

    /// Leakage in readings at rest (V), in sheet conductances, by the patterns of the same electrodes. The patterns are those of very little:
    /// in truth the current to each electrode passes its resistance too.
    pub fn at_rest(&self, patterns: &BaselinePatterns, rest_v: &[f64]) -> f64 {
        let linear = patterns.explain(rest_v).leakage_sheets.max(0.0);
        let mut sheets = linear;
        for _ in 0..ROUNDS {
            let mut like_that_v = vec![0.0; self.electrodes * self.electrodes];
            if sheets > NOTHING {
                self.put(&self.readings(&self.bare.add_scalar(1.0 / sheets)), &mut like_that_v);
                sheets *= linear / patterns.explain(&like_that_v).leakage_sheets.max(0.5 * sheets);
            }
        }
        sheets
    }

    /// Takes off readings, which are less what they are at rest (V), what leakage of so many sheet conductances does under a touch
    /// otherwise than at rest.
    pub fn take_off(&self, touch_v: &mut [f64], sheets: f64) {
        if self.kept.len() < 2 || touch_v.len() != self.electrodes * self.electrodes {
            return;
        }
        let n = self.kept.len();
        let index = |g: usize, e: usize| self.kept[g] * self.electrodes + self.kept[e];
        let measured = DMatrix::from_fn(n, n, |g, e| touch_v[index(g, e)]);
        let at_rest = self.readings(&self.bare.add_scalar(1.0 / sheets));
        let mut touch = measured.clone();
        for _ in 0..ROUNDS {
            let Some(impedance) = self.impedance(&touch, sheets) else { break };
            let effect = self.readings(&self.beside(&impedance, sheets)) - self.readings(&impedance);
            touch = &measured + &at_rest - effect;
        }
        self.put(&touch, touch_v);
    }

    /// What so much more of it (sheet conductances) than in the baseline does to readings (V) of a touched detector with such impedances between
    /// all its electrodes (ohm).
    pub fn change_v(&self, impedance_ohm: &DMatrix<f64>, sheets: f64) -> Vec<f64> {
        let impedance = impedance_ohm.select_rows(&self.kept).select_columns(&self.kept) * self.sheet_s;
        let mut change_v = vec![0.0; self.electrodes * self.electrodes];
        self.put(&(self.readings(&self.beside(&impedance, sheets)) - self.readings(&impedance)), &mut change_v);
        change_v
    }

    /// Puts readings of the electrodes that are looked at among those of all (V).
    fn put(&self, readings: &DMatrix<f64>, all_v: &mut [f64]) {
        for (row, g) in self.kept.iter().enumerate() {
            for (column, e) in self.kept.iter().enumerate() {
                all_v[g * self.electrodes + e] = readings[(row, column)];
            }
        }
    }

    /// Impedances with leakage beside what touches.
    fn beside(&self, impedance: &DMatrix<f64>, sheets: f64) -> DMatrix<f64> {
        let of_weights = impedance * &self.weights;
        let own = self.weights.dot(&of_weights) + 2.0 * self.weights.dot(&self.besides) + self.own;
        let to_leakage = of_weights + &self.besides;
        impedance - &to_leakage * to_leakage.transpose() / (1.0 / sheets + own)
    }

    /// Readings (V), a row for each ground.
    fn readings(&self, impedance: &DMatrix<f64>) -> DMatrix<f64> {
        let n = impedance.nrows();
        DMatrix::from_fn(n, n, |g, e| self.drive_v * (1.0 - impedance[(e, g)] / (impedance[(g, g)] + self.switch)))
    }

    /// Impedances by readings (V), times a sheet conductance; `None` if nothing touches.
    fn impedance(&self, touch: &DMatrix<f64>, sheets: f64) -> Option<DMatrix<f64>> {
        let n = touch.nrows();
        let ratio = touch.map(|volts| (1.0 - volts / self.drive_v).max(SMALLEST));
        let load = |g: usize| ((0..n).map(|e| (ratio[(e, g)] / ratio[(g, e)]).ln()).sum::<f64>() / n as f64).exp();
        let loads: Vec<f64> = (0..n).map(load).collect();
        let relative = DMatrix::from_fn(n, n, |e, g| 0.5 * (ratio[(g, e)] * loads[g] + ratio[(e, g)] * loads[e]));
        let conductance = centred(&relative).trace() / centred(&self.bare).trace();
        if conductance.is_nan() || conductance < NOTHING {
            return None;
        }
        let impedance = relative / conductance;
        // Of touches that are light against the leakage, noise would be most of the centred part: which is then that of the bare detector.
        let share = conductance * conductance / (conductance * conductance + sheets * sheets);
        let kept = centred(&impedance) * share + centred(&self.bare) * (1.0 - share);
        Some(kept + &impedance - centred(&impedance))
    }
}

/// Less the means of rows and columns.
fn centred(matrix: &DMatrix<f64>) -> DMatrix<f64> {
    let (rows, columns, all) = (matrix.column_mean(), matrix.row_mean(), matrix.mean());
    DMatrix::from_fn(matrix.nrows(), matrix.ncols(), |i, j| matrix[(i, j)] - rows[i] - columns[j] + all)
}

/// Weights that add up to one, with which fields (`nodes x electrodes`) vary least from node to node.
fn flat(fields: &DMatrix<f64>) -> DVector<f64> {
    let n = fields.ncols();
    let mut about_means = fields.clone();
    about_means.column_iter_mut().for_each(|mut column| {
        let mean = column.mean();
        column.add_scalar_mut(-mean);
    });
    let even = EVEN * about_means.norm_squared();
    let squares = about_means.transpose() * &about_means + DMatrix::identity(n, n) * even;
    let ones = DVector::from_element(n, 1.0);
    let solved = squares.cholesky().map_or_else(|| ones.clone(), |factor| factor.solve(&ones));
    &solved / solved.sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::detector::Detector;
    use crate::forward::{ForwardModel, Resolution, Slab, readings_v};
    use crate::readings::Readings;
    use crate::scene::{Shape, Touch};

    /// A finer slab than the one whose fields are used, under leakage and discs of so many sheet conductances.
    struct LeakageTrial {
        fine: Slab,
        leakage: Leakage,
    }

    impl LeakageTrial {
        fn new(kept: &[usize]) -> Self {
            let detector = Detector::preset(Detector::DEFAULT).unwrap();
            let jacobian = Jacobian::of(&Slab::new(&detector).unwrap());
            let fine = Slab::with_resolution(&detector, Resolution::FINE).unwrap().on_image(900);
            Self { fine, leakage: Leakage::new(&jacobian, kept) }
        }

        fn readings(&self, sheets: f64, discs: &[([f64; 2], f64)]) -> Readings {
            readings_v(&self.impedance_ohm(sheets, discs), self.fine.detector())
        }

        fn impedance_ohm(&self, sheets: f64, discs: &[([f64; 2], f64)]) -> DMatrix<f64> {
            let (mesh, detector) = (self.fine.image_mesh(), self.fine.detector());
            let sheet_s = detector.sheet_conductance_s();
            let of = |(place_m, sheets): &([f64; 2], f64)| {
                Touch::flat(*place_m, Shape::Disc { radius_m: 0.0025 }, sheets * sheet_s)
            };
            let mut image_s = mesh.conductances_s(&discs.iter().map(of).collect::<Vec<_>>()).unwrap();
            let area_m2: f64 = mesh.node_areas_m2.iter().sum();
            image_s.iter_mut().zip(&mesh.node_areas_m2).for_each(|(s, m2)| *s += sheets * sheet_s * m2 / area_m2);
            self.fine.image_impedance_ohm(&image_s).unwrap()
        }

        /// What leakage leaves of the readings of electrodes (root of the mean square, V): taken off as at rest, and under the touch.
        fn left_v(&self, sheets: f64, discs: &[([f64; 2], f64)], kept: &[usize]) -> [f64; 2] {
            let (alone, both, rest) =
                (self.readings(0.0, discs), self.readings(sheets, discs), self.readings(sheets, &[]));
            let mut touch = both.clone();
            touch.volts_mut().iter_mut().zip(rest.volts()).for_each(|(volts, rest)| *volts -= rest);
            let rms_v = |touch: &Readings| {
                let off = touch
                    .of(kept)
                    .volts()
                    .iter()
                    .zip(alone.of(kept).volts())
                    .map(|(a, b)| (a - b).powi(2))
                    .sum::<f64>();
                off.sqrt() / kept.len() as f64
            };
            let before_v = rms_v(&touch);
            self.leakage.take_off(touch.volts_mut(), sheets);
            [before_v, rms_v(&touch)]
        }
    }

    const LIGHT: [([f64; 2], f64); 1] = [([-0.012, 0.009], 0.02)];
    const FIRM: [([f64; 2], f64); 1] = [([0.009, -0.024], 3.0)];
    const SEVERAL: [([f64; 2], f64); 3] = [([-0.012, 0.009], 3.0), ([0.014, 0.004], 0.3), ([0.0, -0.02], 3.0)];

    #[test]
    fn a_few_hundredths_at_most_are_left_of_what_leakage_does_under_a_touch() {
        let all: Vec<usize> = (0..16).collect();
        let trial = LeakageTrial::new(&all);
        for sheets in [0.01, 0.05] {
            for (discs, least_v) in [(&LIGHT[..], 0.0), (&FIRM, 0.01), (&SEVERAL, 0.01)] {
                let [before_v, after_v] = trial.left_v(sheets, discs, &all);
                // Subtracting alone leaves most of it under firm contacts: up to 1.6 V for each sheet conductance of leakage.
                assert!(
                    before_v > least_v && after_v < 0.03 * before_v + 2e-5,
                    "{sheets} {discs:?}: {before_v} {after_v}"
                );
            }
        }
    }

    #[test]
    fn what_more_of_it_changes_is_as_the_finer_model_has_it() {
        let all: Vec<usize> = (0..16).collect();
        let trial = LeakageTrial::new(&all);
        for sheets in [0.001, 0.03] {
            for (discs, most) in [(&LIGHT[..], 0.04), (&FIRM, 0.04), (&SEVERAL, 0.15)] {
                let [alone, both] = [0.0, sheets].map(|sheets| trial.readings(sheets, discs));
                let change_v = trial.leakage.change_v(&trial.impedance_ohm(0.0, discs), sheets);
                let truth: Vec<_> = both.volts().iter().zip(alone.volts()).map(|(both, alone)| both - alone).collect();
                let off = truth.iter().zip(&change_v).map(|(a, b)| (a - b).powi(2)).sum::<f64>();
                let share = (off / truth.iter().map(|volts| volts * volts).sum::<f64>()).sqrt();
                assert!(share < most, "{sheets} {discs:?}: off by a share of {share}");
            }
        }
    }

    #[test]
    fn leakage_is_found_from_readings_at_rest() {
        let all: Vec<usize> = (0..16).collect();
        let trial = LeakageTrial::new(&all);
        let patterns = BaselinePatterns::new(&Jacobian::of(&trial.fine), &all);
        for sheets in [0.003, 0.01, 0.05] {
            let found = trial.leakage.at_rest(&patterns, trial.readings(sheets, &[]).volts());
            assert!((found / sheets - 1.0).abs() < 0.005, "{sheets}: {found}");
        }
    }

    #[test]
    fn at_rest_nothing_changes_and_electrodes_may_be_missing() {
        let kept: Vec<usize> = (0..16).filter(|e| *e != 5).collect();
        let trial = LeakageTrial::new(&kept);
        let mut noise_v: Vec<f64> = (0..256).map(|i| 1e-3 * (f64::from(i) * 1.7).sin()).collect();
        let before_v = noise_v.clone();
        trial.leakage.take_off(&mut noise_v, 0.02);
        let changed_v = noise_v.iter().zip(&before_v).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(changed_v < 0.2e-3, "{changed_v}");
        let [before_v, after_v] = trial.left_v(0.02, &FIRM, &kept);
        assert!(after_v < 0.1 * before_v, "{before_v} {after_v}");
    }
}
