//! An input of a real board: how a pin follows its pad, and what the ADC's sampling capacitor does to it.
//!
//! The pad, held by the foam at `V`, drives the pin at `u` through a resistor `R` with a capacitor `C` across it; the pin has `c` to ground:
//!
//! ```text
//! c du/dt = (V - u) / R + C d(V - u)/dt
//! ```
//!
//! So where `V` jumps by `D`, the pin follows at once by `D C / (C + c)`, and the rest dies away with the time constant `R (C + c)`.
//!
//! The ADC closes its switch for a while onto a capacitor `s` that still has the voltage `h` of its last conversion. Charge is kept:
//! `u` becomes `(s h + (c + C) u) / (s + c + C)`, and then goes back to `V` with `R (s + c + C)` until the switch opens; what is there is
//! converted. (Charge sharing, as in any text on switched capacitors.)
//!
//! Limits: the foam is a resistor, and quick (its own capacitance is left out); pads settle at once and do not move each other; the switch
//! has no resistance and injects no charge; leakage is left out.

use super::model::InputFigures;

/// A pin, from moment to moment.
#[derive(Clone, Debug)]
pub(super) struct Input {
    figures: InputFigures,
    /// The pad's voltage (V).
    pad_v: f64,
    /// The pin's (V).
    pin_v: f64,
    /// Since when (s).
    at_s: f64,
}

impl Input {
    pub(super) fn new(figures: InputFigures) -> Self {
        Self { figures, pad_v: 0.0, pin_v: 0.0, at_s: 0.0 }
    }

    /// Lets the time pass until `now_s`, when the pad gets another voltage.
    pub(super) fn follow(&mut self, now_s: f64, pad_v: f64) {
        self.settle(now_s - self.at_s, 0.0);
        self.at_s = self.at_s.max(now_s);
        let InputFigures { across_f, node_f, .. } = self.figures;
        self.pin_v += (pad_v - self.pad_v) * across_f / (across_f + node_f);
        self.pad_v = pad_v;
    }

    /// What the sampling capacitor takes (V), after a conversion that left `held_v` on it.
    pub(super) fn sample(&mut self, held_v: f64) -> f64 {
        let InputFigures { across_f, node_f, sampling_f, sampling_s, .. } = self.figures;
        let own_f = node_f + across_f;
        self.pin_v = (sampling_f * held_v + own_f * self.pin_v) / (sampling_f + own_f);
        self.settle(sampling_s, sampling_f);
        self.at_s += sampling_s;
        self.pin_v
    }

    fn settle(&mut self, time_s: f64, extra_f: f64) {
        let InputFigures { source_ohm, across_f, node_f, .. } = self.figures;
        let constant_s = source_ohm * (node_f + across_f + extra_f);
        self.pin_v = self.pad_v + (self.pin_v - self.pad_v) * (-time_s.max(0.0) / constant_s).exp();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 100 kilohm before 20 pF, and a sampling capacitor of 8 pF for 2.25 us.
    const BARE: InputFigures =
        InputFigures { source_ohm: 100e3, across_f: 0.0, node_f: 20e-12, sampling_f: 8e-12, sampling_s: 2.25e-6 };

    /// What is missing of a step of 1 V after so many seconds, for a capacitor that already has the pad's voltage.
    fn missing_v(figures: InputFigures, after_s: f64) -> f64 {
        let mut input = Input::new(figures);
        input.follow(0.0, 1.0);
        input.follow(after_s, 1.0);
        1.0 - input.pin_v
    }

    #[test]
    fn the_settle_error_falls_as_an_exponential() {
        for after_s in [0.0, 1e-6, 2e-6, 7e-6, 20e-6] {
            let expected = (-after_s / 2e-6f64).exp();
            assert!((missing_v(BARE, after_s) - expected).abs() < 1e-12, "after {after_s} s");
        }
    }

    #[test]
    fn a_capacitor_across_the_resistor_takes_the_step_at_once() {
        let bypassed = InputFigures { across_f: 10e-9, ..BARE };
        assert!((missing_v(bypassed, 0.0) - 20e-12 / 10.02e-9).abs() < 1e-12);
        // Then it is slow.
        let constant_s = 100e3 * 10.02e-9;
        let ratio = missing_v(bypassed, constant_s) / missing_v(bypassed, 0.0);
        assert!((ratio - (-1f64).exp()).abs() < 1e-9, "{ratio}");
    }

    #[test]
    fn charge_is_shared_with_the_channel_before() {
        let instant = InputFigures { sampling_s: 0.0, ..BARE };
        let mut input = Input::new(instant);
        assert!((input.sample(1.0) - 8.0 / 28.0).abs() < 1e-12);
    }

    #[test]
    fn kickback_vanishes_with_long_waits() {
        let kick_v = |sampling_s: f64| Input::new(InputFigures { sampling_s, ..BARE }).sample(1.0);
        for sampling_s in [1e-6, 2e-6, 4e-6, 8e-6] {
            // One time constant with the sampling capacitor on the pin is 2.8 us.
            assert!((kick_v(sampling_s) - 8.0 / 28.0 * (-sampling_s / 2.8e-6).exp()).abs() < 1e-12);
        }
        assert!(kick_v(60e-6) < 1e-9);
        // And what is left on the pin is gone by its next conversion, if that is late.
        let mut input = Input::new(BARE);
        input.sample(1.0);
        input.follow(1e-3, 0.0);
        assert!(input.sample(0.0).abs() < 1e-9);
    }
}
