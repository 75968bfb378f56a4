//! How well any method can do: the Cramer-Rao bound of contacts under the converter's noise.

use std::f64::consts::{FRAC_1_SQRT_2, FRAC_PI_2, PI};

use nalgebra::DMatrix;

use tactomo_physics::detector::{Detector, Electrode};
use tactomo_physics::forward::{ForwardError, ForwardModel, Nuisance, readings_v};
use tactomo_physics::readings::{Readings, Says};
use tactomo_physics::scene::Contact;

/// Step of a place, as a share of the contact's radius, and of a conductance, as a share of it.
const STEP: f64 = 0.02;

/// Standard deviation of the logarithm of a radius that is not known: a factor of two.
pub const RADIUS_DEVIATION: f64 = 0.7;
/// Unknowns of a contact: x, y, logarithm of the conductance, logarithm of the radius.
const UNKNOWNS: usize = 4;

/// Directions of a quarter of an ellipse of errors that are averaged over: the mean distance is right to 0.02 % even of a line.
const ANGLES: u32 = 32;

/// Smallest standard errors that an unbiased method can have for a contact whose radius is known to a factor of two ([`RADIUS_DEVIATION`]).
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize)]
pub struct Bound {
    /// Of the place (m): the root of the sum of both coordinates' variances.
    pub position_m: f64,
    /// The same along the long and the short axis of the ellipse of errors (m).
    pub axes_m: [f64; 2],
    /// Of the conductance, as a share of it, for a known radius: whether readings show the contact at all. Firm ones hardly tell it from the radius.
    pub conductance: f64,
}

impl Bound {
    /// Mean distance (m) of normal errors with these axes, to compare mean errors with: in each direction of the ellipse its radius, times the mean of
    /// Rayleigh's distribution.
    pub fn mean_m(&self) -> f64 {
        let [long_m, short_m] = self.axes_m;
        let radius_m = |angle: u32| {
            let (sin, cos) = (FRAC_PI_2 * (f64::from(angle) + 0.5) / f64::from(ANGLES)).sin_cos();
            (long_m * cos).hypot(short_m * sin)
        };
        FRAC_PI_2.sqrt() * (0..ANGLES).map(radius_m).sum::<f64>() / f64::from(ANGLES)
    }
}

/// By what readings differ from those of a model.
#[derive(Clone)]
pub struct Errors<'a> {
    /// The detector as it is driven and measured: beyond the ends of its converters, readings tell nothing.
    pub measured: &'a Detector,
    /// Standard deviation of the noise of a reading (V).
    pub deviation_v: f64,
    /// What may be different of the detector as built; and then gain and bow of its converters are those of some chip.
    pub nuisance: Option<&'a Nuisance>,
}

impl<'a> Errors<'a> {
    /// Noise of a standard deviation (V) alone.
    pub fn of_noise(measured: &'a Detector, deviation_v: f64) -> Self {
        Self { measured, deviation_v, nuisance: None }
    }

    /// Readings as the converters have them: beyond their ends they are bounds.
    pub fn bounded(&self, readings: Readings) -> Readings {
        let Detector { converters, electrodes, .. } = self.measured;
        let of = |pad: &Electrode| Some(converters.get(pad.converter)?.range(self.deviation_v));
        let ranges: Vec<_> = electrodes.iter().filter_map(of).collect();
        if ranges.is_empty() { readings } else { readings.within(&ranges) }
    }

    /// Readings as converters have them on average, less what they have where nothing touches: they give nothing below zero, which cuts off half of the
    /// noise there, and with it half of what is small against noise.
    pub fn on_average(&self, mut readings: Readings) -> Readings {
        let (ground_v, deviation_v) = (self.measured.ground_v, self.deviation_v);
        let at_rest_v = mean_above_zero(ground_v, deviation_v);
        let volts = readings.volts_mut().iter_mut();
        volts.for_each(|volts| *volts = mean_above_zero(*volts + ground_v, deviation_v) - at_rest_v);
        readings
    }

    /// The readings that tell anything.
    fn seen(&self, readings: &Readings) -> Vec<usize> {
        let (n, bounded) = (readings.electrodes(), self.bounded(readings.clone()));
        (0..n * n).filter(|index| bounded.says(index / n, index % n) == Says::Voltage).collect()
    }

    /// Changes of readings of contacts (V) by one standard deviation of each thing that is not known.
    fn patterns_v(&self, contacts: &[Contact], readings: &Readings) -> Result<Option<DMatrix<f64>>, ForwardError> {
        let Some(nuisance) = self.nuisance else { return Ok(None) };
        let mut patterns = nuisance.patterns_v(contacts, self.measured)?;
        for (which, converter) in self.measured.converters.iter().enumerate() {
            let is_on = |index: usize| self.measured.electrodes[index % readings.electrodes()].converter == which;
            let changes_v = |index: usize, volts: &f64| {
                if is_on(index) { converter.changes_v(*volts) } else { [0.0; 2] }
            };
            for error in 0..2 {
                let column = patterns.ncols();
                patterns = patterns.insert_column(column, 0.0);
                let volts = readings.volts().iter().enumerate();
                let mut into = patterns.column_mut(column);
                volts.for_each(|(index, volts)| into[index] = changes_v(index, volts)[error]);
            }
        }
        Ok(Some(patterns))
    }
}

/// Mean of a normal number where it is above zero, and of zero where it is below.
fn mean_above_zero(mean: f64, deviation: f64) -> f64 {
    let normal = mean / deviation;
    let density = (-0.5 * normal * normal).exp() / (2.0 * PI).sqrt();
    deviation * density + 0.5 * mean * libm::erfc(-FRAC_1_SQRT_2 * normal)
}

/// The Cramer-Rao bound of contacts of known number, each with place and conductance unknown and its radius known to a factor of two, from one frame of readings with
/// independent normal noise, and with what is not known of the detector as a normal error that readings share.
///
/// With `J` the derivatives of the readings by the unknowns and `R` the covariance of the readings, Fisher's information is `J' R^-1 J`, and no unbiased
/// estimate has a covariance below its inverse (Rao, 1945; Cramer, 1946). Derivatives are central differences of what the model changes to first order. Readings below a floor tell
/// nothing. `None` if the others do not separate the unknowns.
///
/// # Errors
/// [`ForwardError`] if a contact, or one a step beside it, is off the detector.
pub fn cramer_rao(
    model: &dyn ForwardModel,
    contacts: &[Contact],
    errors: &Errors<'_>,
) -> Result<Option<Vec<Bound>>, ForwardError> {
    let (readings, jacobian_v) = derivatives(model, contacts, errors.measured)?;
    let seen = errors.seen(&readings);
    // In standard deviations.
    let jacobian = jacobian_v.select_rows(&seen) / errors.deviation_v;
    let mut information = jacobian.tr_mul(&jacobian);
    if let Some(patterns_v) = errors.patterns_v(contacts, &readings)? {
        // (1 + P P')^-1 = 1 - P (1 + P' P)^-1 P' (Woodbury).
        let patterns = patterns_v.select_rows(&seen) / errors.deviation_v;
        let inner = DMatrix::identity(patterns.ncols(), patterns.ncols()) + patterns.tr_mul(&patterns);
        let cross = patterns.tr_mul(&jacobian);
        let Some(factor) = inner.cholesky() else { return Ok(None) };
        information -= cross.tr_mul(&factor.solve(&cross));
    }
    Ok(bounds(information, contacts.iter().map(|contact| contact.radius_m)))
}

/// Standard errors of contacts of such radii (m) by Fisher's information; `None` if it does not separate the unknowns.
fn bounds(mut information: DMatrix<f64>, radii_m: impl Iterator<Item = f64>) -> Option<Vec<Bound>> {
    let size = information.nrows();
    let known: Vec<_> = (0..size).filter(|unknown| unknown % UNKNOWNS < 3).collect();
    let of_known = information.select_rows(&known).select_columns(&known);
    for radius in (UNKNOWNS - 1..size).step_by(UNKNOWNS) {
        information[(radius, radius)] += RADIUS_DEVIATION.powi(-2);
    }
    let inverse = |information: DMatrix<f64>| information.cholesky().map(|factor| factor.inverse());
    let (known, any) = (inverse(of_known)?, inverse(information)?);
    let of = |(k, radius_m): (usize, f64)| {
        let [x, y] = [0, 1].map(|axis| UNKNOWNS * k + axis);
        let (middle, half) = (0.5 * (any[(x, x)] + any[(y, y)]), 0.5 * (any[(x, x)] - any[(y, y)]));
        let apart = half.hypot(any[(x, y)]);
        Bound {
            axes_m: [middle + apart, middle - apart].map(|square| radius_m * square.max(0.0).sqrt()),
            position_m: radius_m * (any[(x, x)] + any[(y, y)]).sqrt(),
            conductance: known[(3 * k + 2, 3 * k + 2)].sqrt(),
        }
    };
    Some(radii_m.enumerate().map(of).collect())
}

/// What the row of each ground tells of some contacts, of which the [bound](cramer_rao) of any rows is made.
#[derive(Clone, Debug)]
pub(crate) struct RowInformation {
    radii_m: Vec<f64>,
    /// Fisher's information of each ground's row.
    rows: Vec<DMatrix<f64>>,
}

impl RowInformation {
    /// Of contacts under noise of a standard deviation (V).
    ///
    /// # Errors
    /// [`ForwardError`] if a contact, or one a step beside it, is off the detector.
    pub fn new(model: &dyn ForwardModel, contacts: &[Contact], deviation_v: f64) -> Result<Self, ForwardError> {
        let electrodes = model.detector().electrodes.len();
        let (_, jacobian_v) = derivatives(model, contacts, model.detector())?;
        let of_row = |g: usize| {
            let row_v = jacobian_v.rows(g * electrodes, electrodes);
            row_v.transpose() * row_v / (deviation_v * deviation_v)
        };
        Ok(Self {
            radii_m: contacts.iter().map(|contact| contact.radius_m).collect(),
            rows: (0..electrodes).map(of_row).collect(),
        })
    }

    /// The bound of each contact where the row of each ground is read so many times; `None` if that does not separate the unknowns.
    pub fn bounds(&self, times: &[f64]) -> Option<Vec<Bound>> {
        let size = UNKNOWNS * self.radii_m.len();
        let mut information = DMatrix::zeros(size, size);
        self.rows.iter().zip(times).for_each(|(row, times)| information += row * *times);
        bounds(information, self.radii_m.iter().copied())
    }
}

/// Readings (V) and their derivatives by x and y in radii and by the logarithms of conductance and radius of each contact: alike in size, so that
/// the information is well scaled.
fn derivatives(
    model: &dyn ForwardModel,
    contacts: &[Contact],
    measured: &Detector,
) -> Result<(Readings, DMatrix<f64>), ForwardError> {
    let stepped = |unknown: usize, step: f64| {
        let mut contact = contacts[unknown / UNKNOWNS];
        match unknown % UNKNOWNS {
            0 => contact.x_m += step * contact.radius_m,
            1 => contact.y_m += step * contact.radius_m,
            2 => contact.conductance_s *= step.exp(),
            _ => contact.radius_m *= step.exp(),
        }
        (unknown / UNKNOWNS, contact)
    };
    let unknowns = 0..UNKNOWNS * contacts.len();
    let replaced: Vec<_> = unknowns.flat_map(|unknown| [STEP, -STEP].map(|step| stepped(unknown, step))).collect();
    let (impedance_ohm, changes_ohm) = model.impedance_with_changes_ohm(contacts, &replaced)?;
    let electrodes = impedance_ohm.nrows();
    let mut jacobian_v = DMatrix::zeros(electrodes * electrodes, replaced.len() / 2);
    for (mut column, changes_ohm) in jacobian_v.column_iter_mut().zip(changes_ohm.chunks_exact(2)) {
        let [after, before] = [0, 1].map(|which| readings_v(&(&impedance_ohm + &changes_ohm[which]), measured));
        for (value, (after, before)) in column.iter_mut().zip(after.volts().iter().zip(before.volts())) {
            *value = (after - before) / (2.0 * STEP);
        }
    }
    Ok((readings_v(&impedance_ohm, measured), jacobian_v))
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use tactomo_physics::detector::ConverterErrors;
    use tactomo_physics::forward::Slab;
    use tactomo_physics::simulate::Noise;

    fn slab() -> Slab {
        Slab::new(&Detector::preset(Detector::DEFAULT).unwrap()).unwrap()
    }

    fn firm(x_m: f64, y_m: f64) -> Contact {
        let sheet_s = Detector::preset(Detector::DEFAULT).unwrap().sheet_conductance_s();
        Contact::flat(x_m, y_m, 0.0015, 0.3 * sheet_s)
    }

    #[test]
    fn errors_grow_with_noise_and_as_contacts_come_near() {
        let slab = slab();
        let of = |contacts: &[Contact], noise_v| {
            cramer_rao(&slab, contacts, &Errors::of_noise(slab.detector(), noise_v)).unwrap().unwrap()[0]
        };
        let one = of(&[firm(0.004, 0.007)], 1e-3);
        let noisy = of(&[firm(0.004, 0.007)], 2e-3);
        // What is known of the radius beforehand is worth more where there is more noise.
        assert!((1.5..2.0 + 1e-9).contains(&(noisy.position_m / one.position_m)), "{one:?} {noisy:?}");
        assert!((noisy.conductance / one.conductance - 2.0).abs() < 1e-9);
        let [long_m, short_m] = one.axes_m;
        assert!(long_m >= short_m && (long_m.hypot(short_m) / one.position_m - 1.0).abs() < 1e-9);
        let pair = |apart_m: f64| of(&[firm(0.004, 0.007), firm(0.004 + apart_m, 0.007)], 1e-3).position_m;
        assert!(one.position_m < pair(0.02) && pair(0.02) < pair(0.009) && pair(0.009) < pair(0.004));
    }

    #[test]
    fn rows_that_are_read_more_often_tell_more() {
        let rows = RowInformation::new(&slab(), &[firm(0.004, 0.007)], 1e-3).unwrap();
        let error_m =
            |times: &dyn Fn(usize) -> f64| rows.bounds(&(0..16).map(times).collect::<Vec<_>>()).unwrap()[0].position_m;
        assert!((0.5 - 1e-9..0.7).contains(&(error_m(&|_| 4.0) / error_m(&|_| 1.0))));
        let one = error_m(&|g| if g == 5 { 1.0 } else { 0.0 });
        assert!(one > error_m(&|g| if g == 5 || g == 10 { 1.0 } else { 0.0 }) && one > error_m(&|_| 1.0));
        assert!(rows.bounds(&[0.0; 16]).is_none());
    }

    #[test]
    fn contacts_on_one_spot_cannot_be_separated() {
        let slab = slab();
        let errors = Errors::of_noise(slab.detector(), 1e-3);
        let bound = cramer_rao(&slab, &[firm(0.004, 0.007), firm(0.004, 0.007)], &errors).unwrap();
        assert!(bound.as_ref().is_none_or(|bound| bound[0].position_m > 1.0), "{bound:?}");
    }

    /// Least squares of the linearised readings that knows what is known of the radius reaches the bound: root mean square and mean.
    #[test]
    fn least_squares_has_the_errors_that_the_bound_says() {
        let (slab, contact, noise_v) = (slab(), firm(-0.011, 0.003), 1e-3);
        let errors = Errors::of_noise(slab.detector(), noise_v);
        let bound = cramer_rao(&slab, &[contact], &errors).unwrap().unwrap()[0];
        let (_, jacobian_v) = derivatives(&slab, &[contact], slab.detector()).unwrap();
        let mut information = jacobian_v.tr_mul(&jacobian_v) / noise_v.powi(2);
        information[(3, 3)] += RADIUS_DEVIATION.powi(-2);
        let gain = information.cholesky().unwrap().solve(&jacobian_v.transpose()) / noise_v.powi(2);
        let mut noise = Noise::new(3);
        let trials = 2000;
        let distances_m = (0..trials).map(|_| {
            let radius = jacobian_v.column(3) * (RADIUS_DEVIATION * noise.normal());
            let read_v = DMatrix::from_fn(jacobian_v.nrows(), 1, |row, _| radius[row] + noise_v * noise.normal());
            let error = &gain * read_v;
            contact.radius_m * error[0].hypot(error[1])
        });
        let [sum_m, squares_m2] = distances_m.fold([0.0; 2], |[sum, squares], m: f64| [sum + m, squares + m * m]);
        let (rms_m, mean_m) = ((squares_m2 / f64::from(trials)).sqrt(), sum_m / f64::from(trials));
        assert!((rms_m / bound.position_m - 1.0).abs() < 0.06, "{rms_m} {bound:?}");
        assert!((mean_m / bound.mean_m() - 1.0).abs() < 0.06, "{mean_m} {bound:?}");
    }

    #[test]
    fn the_mean_distance_is_rayleighs_of_a_circle_and_half_a_normals_of_a_line() {
        let mean_m = |axes_m| Bound { axes_m, ..Bound::default() }.mean_m();
        assert!((mean_m([2.0, 2.0]) / (2.0 * FRAC_PI_2.sqrt()) - 1.0).abs() < 1e-9);
        assert!((mean_m([2.0, 0.0]) / (2.0 * (2.0 / PI).sqrt()) - 1.0).abs() < 2e-4);
    }

    /// Against the mean of many readings.
    #[test]
    fn a_converter_that_ends_at_zero_halves_what_is_small_against_noise() {
        let exact = Detector::default();
        let deviation_v = exact.adc.deviation_v();
        let volts = [-0.5, 0.1, 0.5, 1.0, 4.0].map(|deviations| deviations * deviation_v);
        let readings = |value: &dyn Fn(usize) -> f64| Readings::from_fn(5, |_, e| value(e));
        for ground_v in [0.0, deviation_v, 0.2] {
            let measured = Detector { ground_v, ..exact.clone() };
            let found = Errors::of_noise(&measured, deviation_v).on_average(readings(&|e| volts[e]));
            let mut noise = Noise::new(7);
            let many = 100_000;
            for (e, volts) in volts.iter().enumerate() {
                let above = |volts: f64, noise: &mut Noise| (ground_v + volts + deviation_v * noise.normal()).max(0.0);
                let sum_v: f64 = (0..many).map(|_| above(*volts, &mut noise) - above(0.0, &mut noise)).sum();
                let off_v = found.at(0, e) - sum_v / f64::from(many);
                assert!(off_v.abs() < 0.02 * deviation_v, "{ground_v} {volts} {off_v}");
            }
        }
    }

    #[test]
    fn what_is_below_a_floor_tells_nothing() {
        let slab = slab();
        let contact = [firm(0.004, 0.007)];
        let error_m = |floor_v: f64| {
            let converter = ConverterErrors { gain_share: 0.0, bow_v: 0.0, range_v: [floor_v, 3.1] };
            let measured = Detector { converters: vec![converter], ..slab.detector().clone() };
            cramer_rao(&slab, &contact, &Errors::of_noise(&measured, 1e-3)).unwrap().map(|bounds| bounds[0].position_m)
        };
        let readings = readings_v(&slab.impedance_ohm(&contact).unwrap(), slab.detector());
        let largest_v = readings.largest_v();
        assert!(error_m(0.7 * largest_v) > error_m(0.3 * largest_v) && error_m(0.3 * largest_v) > error_m(0.0));
        assert_eq!(error_m(largest_v), None);
    }

    /// The bound of a detector as built is what the errors of its parameters and the noise make of least squares that knows their covariance.
    #[test]
    fn tolerances_cost_places_and_exact_ones_nothing() {
        let detector = Detector::default();
        let of = |factor: f64| {
            let described = Detector { tolerances: detector.tolerances.times(factor), ..detector.clone() };
            let model: Arc<dyn ForwardModel> = Arc::new(Slab::new(&described).unwrap().on_image(100));
            let nuisance = Nuisance::new(&model, &described, 1).unwrap();
            let errors = Errors { nuisance: nuisance.as_ref(), ..Errors::of_noise(&described, 1e-3) };
            cramer_rao(&*model, &[firm(0.004, 0.007)], &errors).unwrap().unwrap()[0].position_m
        };
        let [exact, hardly, half, built] = [0.0, 1e-3, 0.5, 1.0].map(of);
        assert!((hardly / exact - 1.0).abs() < 0.01, "{exact} {hardly}");
        assert!(half > 3.0 * exact && built > 1.5 * half && built < 1e-3, "{exact} {half} {built}");
    }
}
