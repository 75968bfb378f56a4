//! A sample under the indenter, as quickly as a fit of laws needs it: the potential at its contact for any conductance and radius.

use tactomo_physics::detector::Foam;
use tactomo_physics::forward::{Auto, ForwardModel};
use tactomo_physics::hertz::Skin;
use tactomo_physics::scene::Contact;

use super::super::DesignError;
use super::super::curve::{OutputCurve, fit};
use super::super::limit::of_drive;
use super::super::press::{FORCES_N, INDENTER_DIAMETER_M, MIDDLE, STEPS, force_n};
use super::super::samples::{Measured, stacked};
use super::Eighth;

/// Radii of contacts that resistances are computed at (m); the last is the indenter's.
const RADII_M: [f64; 5] = [0.3e-3, 0.6e-3, 1.2e-3, 1.8e-3, INDENTER_DIAMETER_M / 2.0];
/// Force at which SENS is taken: half of the largest that was applied (N).
const HALF_N: f64 = FORCES_N[1] / 2.0;

/// A sample, and the resistance from a contact in its middle to a ground.
pub struct Bench {
    /// As measured.
    pub measured: Measured,
    /// The foam on top.
    pub top: Foam,
    /// Young's modulus of all its layers together (Pa).
    pub young_pa: f64,
    /// `R0` of the paper's eq. (4), mean over the grounds, for each of [`RADII_M`] (ohm).
    resistances_ohm: [f64; RADII_M.len()],
}

/// SENS (unit of the output per newton) and FMAX (N) of a curve.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Curve {
    /// SENS, eq. (7), at half of the largest force.
    pub sensitivity: f64,
    /// FMAX, eq. (8).
    pub maximum_n: f64,
}

impl Bench {
    /// Of a sample.
    ///
    /// # Errors
    /// [`DesignError`] if there is no model of it.
    pub fn of(measured: Measured) -> Result<Self, DesignError> {
        let (stack, detector) = stacked(measured.name)?;
        let model = Auto::new(&detector.taken_as_exact(), None)?.model;
        let top = stack.top();
        let mut resistances_ohm = [0.0; RADII_M.len()];
        for (resistance_ohm, radius_m) in resistances_ohm.iter_mut().zip(RADII_M) {
            *resistance_ohm = resistance(&*model, radius_m, top.conductivity_s_per_m)?;
        }
        let young_pa = Skin::from(&stack).young_pa;
        Ok(Self { measured, top, young_pa, resistances_ohm })
    }

    /// The potential at a contact as a share of the drive, eq. (4).
    pub fn share(&self, conductance_s: f64, radius_m: f64) -> f64 {
        let x = conductance_s * self.resistance_ohm(radius_m);
        x / (1.0 + x)
    }

    /// SENS and FMAX of a law that gives conductance (S) and radius (m) of a contact for a force (N); `None` if it conducts nothing.
    pub fn curve(&self, law: impl Fn(f64) -> [f64; 2], eighth: Eighth) -> Option<Curve> {
        let point = |force_n: f64| {
            let [conductance_s, radius_m] = law(force_n);
            [force_n, self.share(conductance_s, radius_m)]
        };
        Curve::of(&(1..=STEPS).map(|step| point(force_n(step))).collect::<Vec<_>>(), eighth)
    }

    /// Between the radii a spreading resistance goes with one over the radius.
    fn resistance_ohm(&self, radius_m: f64) -> f64 {
        let at = RADII_M.iter().skip(1).position(|other_m| radius_m <= *other_m).unwrap_or(RADII_M.len() - 2);
        let [low_m, high_m] = [RADII_M[at], RADII_M[at + 1]];
        let share = (1.0 / radius_m - 1.0 / high_m) / (1.0 / low_m - 1.0 / high_m);
        self.resistances_ohm[at + 1] + share * (self.resistances_ohm[at] - self.resistances_ohm[at + 1])
    }
}

impl Curve {
    /// Of outputs over forces; `None` if the output does not rise.
    pub fn of(points: &[[f64; 2]], eighth: Eighth) -> Option<Self> {
        let curve: OutputCurve = fit(points)?.curve;
        let found = Self {
            sensitivity: curve.slope(HALF_N),
            maximum_n: match eighth {
                Eighth::Derived => curve.maximum_force(),
                Eighth::Printed => curve.printed_maximum_force(),
            },
        };
        (found.sensitivity > 0.0 && found.sensitivity.is_finite() && found.maximum_n > 0.0).then_some(found)
    }
}

/// From the middle to a ground (ohm), of a contact near half of the drive, where its current is as even as it gets.
fn resistance(model: &dyn ForwardModel, radius_m: f64, top_s_per_m: f64) -> Result<f64, DesignError> {
    let conductance_s = 4.0 * radius_m * top_s_per_m;
    let share = of_drive(model, &Contact::flat(MIDDLE[0], MIDDLE[1], radius_m, conductance_s))?;
    Ok(share / (1.0 - share) / conductance_s)
}

#[cfg(test)]
mod tests {
    use super::*;
    use tactomo_physics::hertz::Surface;

    #[test]
    fn it_gives_the_potential_that_the_model_gives_for_any_radius_and_conductance() {
        let measured = super::super::super::samples::measured().find(|one| one.name == "BA").unwrap();
        let bench = Bench::of(measured).unwrap();
        let (stack, detector) = stacked("BA").unwrap();
        assert_eq!((bench.top, bench.young_pa), (stack.top(), Skin::from(&stack).young_pa));
        let model = Auto::new(&detector.taken_as_exact(), None).unwrap().model;
        for (radius_m, conductance_s) in [(0.4e-3, 1e-4), (1e-3, 1e-3), (2.5e-3, 3e-2), (2.5e-3, 1e-5)] {
            let exact = of_drive(&*model, &Contact::flat(0.0, 0.0, radius_m, conductance_s)).unwrap();
            let quick = bench.share(conductance_s, radius_m);
            assert!((quick / exact - 1.0).abs() < 0.03, "{radius_m} m, {conductance_s} S: {quick} {exact}");
        }
    }

    #[test]
    fn the_law_of_the_program_is_the_law_that_is_chosen() {
        let (law, measured) =
            (super::super::laws::LAWS[super::super::laws::CHOSEN], super::super::super::samples::measured());
        for one in measured {
            let bench = Bench::of(one).unwrap();
            let surface = Surface::measured(bench.top.elasticity_pa);
            let area_m2 = std::f64::consts::PI * (INDENTER_DIAMETER_M / 2.0).powi(2);
            let Surface::Film { unit_pa } = surface else { panic!("no film") };
            // k in S, N and MPa from the pressure of 1 S/m2.
            let log_k =
                (area_m2 * (1.0 / (area_m2 * unit_pa)).powi(3) * (bench.top.elasticity_pa / 1e6).powf(1.5)).ln();
            let [conductance_s, _] = (law.contact)(&bench, &[log_k], 3.0);
            let expected_s = area_m2 * surface.s_per_m2(3.0 / area_m2, 0.0);
            assert!((conductance_s / expected_s - 1.0).abs() < 1e-9);
        }
    }
}
