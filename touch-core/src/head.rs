//! Numbers of a detector and its board in a table.

use core::f64::consts::PI;

use crate::real::Real;
use crate::table::{Floats, MOST, RADII, TableError};

/// Numbers of a detector and its board.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Head {
    /// Lowest x of the grid (m).
    pub left_m: f32,
    /// Lowest y of the grid (m).
    pub bottom_m: f32,
    /// Side of a cell along x (m).
    pub step_x_m: f32,
    /// Side of a cell along y (m).
    pub step_y_m: f32,
    /// Usual radius of a contact (m).
    pub radius_m: f32,
    /// Radius of the small and of the wide disc (m).
    pub radii_m: [f32; RADII],
    /// Distance that the spline over distances begins at (m).
    pub near_m: f32,
    /// Ways from there through one of its intervals: step of `ln r`.
    pub ln_step: f32,
    /// Voltage of the driving layer (V).
    pub drive_v: f32,
    /// Resistance of a switch (ohm).
    pub on_resistance_ohm: f32,
    /// Standard deviation of a reading by noise and rounding (V).
    pub noise_v: f32,
    /// Error of the readings of contacts, as they are fitted, as a share of the largest: of the fields, and of what is not known of the detector.
    pub model_share: f32,
    /// Root mean square of how far what is not known of the detector moves contacts along each axis (m), while the readings fit.
    pub shift_m: f32,
    /// Of how far it changes the logarithms of their conductances.
    pub ln_conductance_error: f32,
    /// Error of a pad's own impedance, as a share of it.
    pub pad_share: f32,
    /// Readings from here on say nothing (V).
    pub full_v: f32,
    /// Conductance of a square of the layer (S).
    pub sheet_s: f32,
    /// Conductivity at the top (S/m).
    pub top_s_per_m: f32,
    /// Resistance of the current that crowds under a contact where nothing of it depends on the place, as the law of force has it (ohm).
    pub constriction_ohm: f32,
    /// Law of force: conductance of a contact that is pressed with 1 N, but for the resistance in series (S); 0 where no law is known.
    pub force_s: f32,
    /// Its exponent.
    pub force_exponent: f32,
    /// Its resistance in series (ohm).
    pub force_ohm: f32,
    /// Largest force that is told (N).
    pub force_most_n: f32,
}

/// `8 / (3 pi^2)`: own field of a disc of even current on a deep layer of conductivity `s`, as a mean over it, over `1 / (s R)`.
pub const EVEN_SPREADING: f64 = 8.0 / (3.0 * PI * PI);

/// How many numbers those are.
pub(crate) const NUMBERS: usize = 24;

impl Head {
    /// Whether a law of force is known.
    pub(crate) fn has_law(&self) -> bool {
        self.force_s > 0.0
    }

    /// Force under a contact (N) of a conductance with the constriction (S) by the law: `S = a F^g / (1 + a F^g R)`, solved for `F`.
    pub(crate) fn force_n<T: Real>(&self, conductance_s: T) -> T {
        let [force_s, exponent, ohm, most_n] =
            [self.force_s, self.force_exponent, self.force_ohm, self.force_most_n].map(T::of);
        let most_s = force_s * most_n.powf(exponent);
        let held_s = conductance_s.max(T::ZERO).min(most_s / (T::ONE + most_s * ohm));
        let own_s = held_s / (T::ONE - held_s * ohm);
        // Rounding may take the last of it beyond.
        (own_s / force_s).powf(T::ONE / exponent).min(most_n)
    }

    /// Own field of a disc of even current on a deep layer (ohm).
    pub(crate) fn even_ohm<T: Real>(&self, radius_m: T) -> T {
        T::of(EVEN_SPREADING) / (T::of(self.top_s_per_m) * radius_m)
    }

    /// Its numbers in the order in which they are stored.
    pub fn numbers(&self) -> [f32; NUMBERS] {
        [
            self.left_m,
            self.bottom_m,
            self.step_x_m,
            self.step_y_m,
            self.radius_m,
            self.radii_m[0],
            self.radii_m[1],
            self.near_m,
            self.ln_step,
            self.drive_v,
            self.on_resistance_ohm,
            self.noise_v,
            self.model_share,
            self.shift_m,
            self.ln_conductance_error,
            self.pad_share,
            self.full_v,
            self.sheet_s,
            self.top_s_per_m,
            self.constriction_ohm,
            self.force_s,
            self.force_exponent,
            self.force_ohm,
            self.force_most_n,
        ]
    }

    /// Reads it from the numbers in their order.
    ///
    /// # Errors
    /// [`TableError::Number`] if one makes no sense.
    pub(crate) fn read(floats: Floats<'_>) -> Result<Self, TableError> {
        let mut index = 0;
        let mut next = || {
            index += 1;
            floats.at(index - 1)
        };
        let head = Self {
            left_m: next(),
            bottom_m: next(),
            step_x_m: next(),
            step_y_m: next(),
            radius_m: next(),
            radii_m: [next(), next()],
            near_m: next(),
            ln_step: next(),
            drive_v: next(),
            on_resistance_ohm: next(),
            noise_v: next(),
            model_share: next(),
            shift_m: next(),
            ln_conductance_error: next(),
            pad_share: next(),
            full_v: next(),
            sheet_s: next(),
            top_s_per_m: next(),
            constriction_ohm: next(),
            force_s: next(),
            force_exponent: next(),
            force_ohm: next(),
            force_most_n: next(),
        };
        head.check()
    }

    fn check(self) -> Result<Self, TableError> {
        // Beyond what any detector has, and so that no product of some of them is too large for a number.
        let length = |value_m: f32| (1e-6..=100.0).contains(&value_m);
        let volts = |value_v: f32| (1e-7..=1e4).contains(&value_v);
        let ohm = |value_ohm: f32| (0.0..=MOST).contains(&value_ohm);
        let share = |value: f32| (0.0..=100.0).contains(&value);
        let conducts = |value: f32| (1e-9..=1e6).contains(&value);
        let is_law = conducts(self.force_s)
            && (0.1..=5.0).contains(&self.force_exponent)
            && ohm(self.force_ohm)
            && (1e-3..=1e4).contains(&self.force_most_n);
        let is_in_reach = |value_m: f32| value_m.abs() <= 100.0;
        let [small_m, wide_m] = self.radii_m;
        let all = [
            ("place", is_in_reach(self.left_m) && is_in_reach(self.bottom_m)),
            ("step of the grid", length(self.step_x_m) && length(self.step_y_m)),
            ("usual radius", length(self.radius_m)),
            ("radii", length(small_m) && length(wide_m) && wide_m > 1.01 * small_m),
            ("distances", length(self.near_m) && (1e-3..=10.0).contains(&self.ln_step)),
            ("drive", volts(self.drive_v)),
            ("on-resistance", ohm(self.on_resistance_ohm)),
            ("noise", volts(self.noise_v)),
            ("error of the readings", share(self.model_share)),
            ("errors of contacts", share(self.shift_m) && share(self.ln_conductance_error)),
            ("error of pads", share(self.pad_share)),
            ("full scale", volts(self.full_v)),
            ("sheet conductance", conducts(self.sheet_s)),
            ("conductivity", conducts(self.top_s_per_m)),
            ("constriction", ohm(self.constriction_ohm)),
            ("law of force", self.force_s == 0.0 || is_law),
        ];
        match all.iter().find(|(_, sound)| !sound) {
            Some((what, _)) => Err(TableError::Number { what }),
            None => Ok(self),
        }
    }
}
