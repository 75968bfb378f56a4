//! An input of a real board: how a pin follows its pad, and what the ADC's sampling capacitor does to it.
//!
//! The foam holds the pad at `V` behind the pad's own resistance `P`. From there a resistor `R` with a capacitor `C` across it leads to the pin at `u`,
//! which has `c` to ground. With `x` the voltage across `R`:
//!
//! ```text
//! c du/dt = (V - u - x) / P              C dx/dt = (V - u - x) / P - x / R
//! ```
//!
//! Without the capacitor across the resistor that is one time constant, `(P + R) c`. With it there are two: the pin follows a jump of `V` within about
//! `P c` but for its share `c / (C + c)`, and the rest dies away with about `R (C + c)`.
//!
//! The ADC closes its switch for a while onto a capacitor `s` that still has the voltage `h` of its last conversion. Charge is kept:
//! `u` becomes `(s h + c u) / (s + c)`, and then goes back to `V` with `s` beside `c` until the switch opens; what is there is
//! converted. (Charge sharing, as in any text on switched capacitors.)
//!
//! Limits: the foam is a resistor, and quick (its own capacitance is left out); pads do not move each other; the switch
//! has no resistance and injects no charge; leakage is left out.

use super::InputFigures;

/// A pin, from moment to moment.
#[derive(Clone, Debug)]
pub struct Input {
    figures: InputFigures,
    /// Resistance of the pad (ohm).
    pad_ohm: f64,
    /// What the foam would bring the pad to (V).
    pad_v: f64,
    /// The pin's voltage, and that across the series resistor (V).
    pin_v: f64,
    across_v: f64,
    /// Since when (s).
    at_s: f64,
}

impl Input {
    /// An input that is at zero, behind a pad of such a resistance (ohm).
    pub fn new(figures: InputFigures, pad_ohm: f64) -> Self {
        Self { figures, pad_ohm, pad_v: 0.0, pin_v: 0.0, across_v: 0.0, at_s: 0.0 }
    }

    /// Lets the time pass until `now_s`, when the pad gets another voltage.
    pub fn follow(&mut self, now_s: f64, pad_v: f64) {
        self.settle(now_s - self.at_s, 0.0);
        self.at_s = self.at_s.max(now_s);
        self.pad_v = pad_v;
    }

    /// Lets the time pass until `now_s`, when the input is brought to another pad, of such a resistance (ohm) and voltage.
    pub fn change_to(&mut self, now_s: f64, pad_v: f64, pad_ohm: f64) {
        self.follow(now_s, pad_v);
        self.pad_ohm = pad_ohm;
    }

    /// What the sampling capacitor takes (V), after a conversion that left `held_v` on it.
    pub fn sample(&mut self, held_v: f64) -> f64 {
        let InputFigures { node_f, sampling_f, sampling_s, .. } = self.figures;
        self.pin_v = (sampling_f * held_v + node_f * self.pin_v) / (sampling_f + node_f);
        self.settle(sampling_s, sampling_f);
        self.at_s += sampling_s;
        self.pin_v
    }

    fn settle(&mut self, time_s: f64, extra_f: f64) {
        let InputFigures { series_ohm, across_f, node_f, .. } = self.figures;
        let (time_s, node_f) = (time_s.max(0.0), node_f + extra_f);
        let missing_v = self.pin_v - self.pad_v;
        if across_f == 0.0 {
            let constant_s = (self.pad_ohm + series_ohm) * node_f;
            self.pin_v = self.pad_v + missing_v * (-time_s / constant_s).exp();
            return;
        }
        let [across, pin] = [1.0 / (across_f * self.pad_ohm), 1.0 / (node_f * self.pad_ohm)];
        let rates = [[-across - 1.0 / (across_f * series_ohm), -across], [-pin, -pin]];
        let [across_v, missing_v] = decayed(rates, [self.across_v, missing_v], time_s);
        (self.across_v, self.pin_v) = (across_v, self.pad_v + missing_v);
    }
}

/// `exp(A t) y` for a matrix of which both eigenvalues are real, negative and different (Sylvester's formula).
fn decayed(a: [[f64; 2]; 2], y: [f64; 2], time_s: f64) -> [f64; 2] {
    let middle = 0.5 * (a[0][0] + a[1][1]);
    let half_apart = (0.25 * (a[0][0] - a[1][1]).powi(2) + a[0][1] * a[1][0]).sqrt();
    let fast = middle - half_apart;
    // Their product is the determinant: the sum would lose the slow one's digits.
    let slow = (a[0][0] * a[1][1] - a[0][1] * a[1][0]) / fast;
    let [by_slow, by_fast] = [slow, fast].map(|rate| (rate * time_s).exp() / (slow - fast));
    let row = |k: usize| a[k][0] * y[0] + a[k][1] * y[1];
    [0, 1].map(|k| by_slow * (row(k) - fast * y[k]) - by_fast * (row(k) - slow * y[k]))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 99 kilohm before 20 pF, behind a pad of 1 kilohm, and a sampling capacitor of 8 pF for 2.25 us.
    const BARE: InputFigures =
        InputFigures { series_ohm: 99e3, across_f: 0.0, node_f: 20e-12, sampling_f: 8e-12, sampling_s: 2.25e-6 };
    const PAD_OHM: f64 = 1e3;

    fn at_zero(figures: InputFigures) -> Input {
        Input::new(figures, PAD_OHM)
    }

    /// What is missing of a step of 1 V after so many seconds, for a capacitor that already has the pad's voltage.
    fn missing_v(figures: InputFigures, after_s: f64) -> f64 {
        let mut input = at_zero(figures);
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
    fn a_capacitor_across_the_resistor_passes_a_step_as_fast_as_the_pad_allows() {
        let bypassed = InputFigures { across_f: 10e-9, ..BARE };
        // 1 kilohm and 20 pF: 20 ns a time constant.
        let at_first = missing_v(bypassed, 20e-9);
        assert!((at_first - (-1f64).exp()).abs() < 0.01, "{at_first}");
        let left_v = 20e-12 / 10.02e-9;
        assert!((missing_v(bypassed, 1e-6) / left_v - 1.0).abs() < 0.03, "{}", missing_v(bypassed, 1e-6));
        // Then it is slow.
        let constant_s = 99e3 * 10.02e-9;
        let ratio = missing_v(bypassed, 1e-6 + constant_s) / missing_v(bypassed, 1e-6);
        assert!((ratio - (-1f64).exp()).abs() < 1e-3, "{ratio}");
    }

    /// Small steps of Euler's rule, with the same equations written out.
    #[test]
    fn two_time_constants_are_those_of_the_equations() {
        let InputFigures { series_ohm, node_f, .. } = BARE;
        let (across_f, pad_ohm) = (100e-12, 75e3);
        let mut input = Input::new(InputFigures { across_f, ..BARE }, pad_ohm);
        input.follow(0.0, 1.0);
        let (mut pin_v, mut across_v, step_s) = (0.0, 0.0, 1e-10);
        for step in 1..=100_000 {
            let current_a = (1.0 - pin_v - across_v) / pad_ohm;
            pin_v += step_s * current_a / node_f;
            across_v += step_s * (current_a - across_v / series_ohm) / across_f;
            if step % 20_000 == 0 {
                input.follow(f64::from(step) * step_s, 1.0);
                assert!((input.pin_v - pin_v).abs() < 1e-4, "{} and {pin_v}", input.pin_v);
                assert!((input.across_v - across_v).abs() < 1e-4);
            }
        }
    }

    #[test]
    fn charge_is_shared_with_the_channel_before() {
        let instant = InputFigures { sampling_s: 0.0, ..BARE };
        let mut input = at_zero(instant);
        assert!((input.sample(1.0) - 8.0 / 28.0).abs() < 1e-12);
    }

    #[test]
    fn kickback_vanishes_with_long_waits() {
        let kick_v = |sampling_s: f64| at_zero(InputFigures { sampling_s, ..BARE }).sample(1.0);
        for sampling_s in [1e-6, 2e-6, 4e-6, 8e-6] {
            // One time constant with the sampling capacitor on the pin is 2.8 us.
            assert!((kick_v(sampling_s) - 8.0 / 28.0 * (-sampling_s / 2.8e-6).exp()).abs() < 1e-12);
        }
        assert!(kick_v(60e-6) < 1e-9);
        // And what is left on the pin is gone by its next conversion, if that is late.
        let mut input = at_zero(BARE);
        input.sample(1.0);
        input.follow(1e-3, 0.0);
        assert!(input.sample(0.0).abs() < 1e-9);
    }
}
