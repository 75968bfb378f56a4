//! Answers that leave much of the readings are flagged, whatever method they are of.
//!
//! A method knows its own errors best, and flags a misfit by them; this is what holds for all. Two things make an answer a misfit:
//! - what it leaves of the readings is more than noise, and much of them;
//! - readings are below those at rest. What touches conducts from the driving layer, so that no pad of a passive detector falls: such readings have
//!   the wrong sign, or something pressed while the baseline was taken.

use crate::solve::answer::Solution;
use crate::solve::fit::policy;
use tactomo_physics::detector::Detector;
use tactomo_physics::readings::Readings;

/// Flags answers that leave much of the readings.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Unexplained {
    /// Standard deviation of a reading by noise (V).
    noise_v: f64,
}

impl Unexplained {
    /// For readings of a detector.
    pub fn of(detector: &Detector) -> Self {
        Self { noise_v: detector.adc.deviation_v() }
    }

    /// The answer to these readings, flagged if it leaves much of them.
    pub fn flagged(&self, readings: &Readings, mut solution: Solution) -> Solution {
        let size_v = readings.rms_v();
        let says_nothing = solution.contacts.is_empty() && solution.is_contacts();
        let left_v = match solution.residual {
            Some(residual) => residual * self.noise_v,
            None if says_nothing => size_v,
            None => 0.0,
        };
        if self.is_large(left_v, policy::LEFT_SHARE * size_v) || self.are_below_rest(readings) {
            solution.doubt();
        }
        solution
    }

    /// Whether much of the readings is below those at rest.
    fn are_below_rest(&self, readings: &Readings) -> bool {
        self.is_large(readings.rms_below_rest_v(), policy::OUTSIDE_SHARE * readings.rms_v())
    }

    fn is_large(&self, volts: f64, least_v: f64) -> bool {
        volts > policy::MISFIT_DEVIATIONS * self.noise_v && volts > least_v
    }
}

/// How far the lowest of readings (V, less the baseline) is below those at rest (V), if so much of them is that they are not of this detector at all, or
/// the baseline is not.
pub fn below_rest_v(readings: &Readings, detector: &Detector) -> Option<f64> {
    let lowest_v = readings.touches_v().iter().copied().fold(0.0, f64::min);
    Unexplained::of(detector).are_below_rest(readings).then_some(-lowest_v)
}

#[cfg(test)]
mod tests {
    use crate::solve::{Method, Problem};
    use tactomo_physics::detector::Detector;
    use tactomo_physics::forward::readings_v;
    use tactomo_physics::readings::Readings;
    use tactomo_physics::scene::Contact;

    #[test]
    fn sound_tables_are_flagged_by_no_method_negated_ones_by_every_and_most_transposed_ones() {
        let detector = Detector::default().taken_as_exact();
        let problem = Problem::of(&detector).unwrap();
        let press = |x_mm: f64, y_mm: f64, sheets: f64| {
            Contact::flat(1e-3 * x_mm, 1e-3 * y_mm, 2.5e-3, sheets * detector.sheet_conductance_s())
        };
        let scenes = [
            vec![press(12.0, -8.0, 1.0)],
            vec![press(-3.0, 19.0, 4.0)],
            vec![press(-24.0, 23.0, 3.0)],
            vec![press(-14.0, 3.0, 1.0), press(17.0, 9.0, 4.0)],
            vec![press(-6.0, -21.0, 2.0), press(4.0, 16.0, 0.5)],
        ];
        for method in [Method::Tikhonov, Method::Laplace, Method::Nonnegative, Method::Bsbl, Method::Contacts] {
            let mut solver = method.build(&problem).unwrap();
            let mut flagged = [0; 3];
            for scene in &scenes {
                let sound = readings_v(&problem.model.impedance_ohm(scene).unwrap(), &detector);
                let n = sound.electrodes();
                let negated = Readings::from_fn(n, |g, e| -sound.at(g, e));
                let transposed = Readings::from_fn(n, |g, e| sound.at(e, g));
                for (count, readings) in flagged.iter_mut().zip([&sound, &negated, &transposed]) {
                    solver.reset();
                    *count += usize::from(solver.solve(readings).unwrap().flags.misfit);
                }
            }
            let [of_sound, of_negated, of_transposed] = flagged;
            assert!((of_sound, of_negated) == (0, scenes.len()), "{}: {flagged:?}", method.name());
            assert!(of_transposed > scenes.len() / 2, "{}: {flagged:?}", method.name());
        }
    }
}
