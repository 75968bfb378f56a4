//! Layers in depth, for one cosine mode in the plane.
//!
//! In a layer with `sigma = s0 exp(a z)` a mode of wave number `k` obeys `phi'' + a phi' - k^2 phi = 0`, so
//! `phi = exp(-a z / 2) (A cosh s z + B sinh s z)` with `s = sqrt(k^2 + a^2 / 4)`: exact, whatever the gradient.

use crate::detector::Layer;

/// Potential of the surfaces per normal current density into them (ohm m2), in one mode.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Response {
    /// At the top from the top.
    pub tt: f64,
    /// Across, either way.
    pub tb: f64,
    /// At the bottom from the bottom.
    pub bb: f64,
}

/// Response of `layers`, bottom first, to wave number `k` (1/m) above zero.
pub(super) fn response(layers: &[Layer], k: f64) -> Response {
    let mut stack = layers.iter().map(|layer| layer_response(layer, k));
    let first = stack.next().unwrap_or(Response { tt: 0.0, tb: 0.0, bb: 0.0 });
    stack.fold(first, join)
}

/// What is left of the response at `k = 0` after `1 / (sheet conductance k^2)`, the part that the floating of the whole
/// detector makes infinite: resistance in depth.
pub(super) fn floating_response(layers: &[Layer]) -> Response {
    let thickness_m: f64 = layers.iter().map(|layer| layer.thickness_m).sum();
    let sheet_s: f64 = layers.iter().map(Layer::sheet_conductance_s).sum();
    // Small enough that the next term, (kT)^2, is below 1e-5; large enough to keep ten digits of the difference.
    let k = 3e-3 / thickness_m;
    let at_k = response(layers, k);
    let infinite = 1.0 / (sheet_s * k * k);
    Response { tt: at_k.tt - infinite, tb: at_k.tb - infinite, bb: at_k.bb - infinite }
}

/// The two-port of one layer: the inverse of its admittance matrix, whose determinant is exactly `s0 s1 k^2`.
fn layer_response(layer: &Layer, k: f64) -> Response {
    let (bottom, top, thickness) = (layer.bottom_s_per_m, layer.top_s_per_m, layer.thickness_m);
    let half_rate = 0.5 * (top / bottom).ln() / thickness;
    let s = k.hypot(half_rate);
    // exp(-2 s t) never overflows, however fine the mode.
    let decay = (-s * thickness).exp();
    let sinh_decay = -(-2.0 * s * thickness).exp_m1();
    let coth = (1.0 + decay * decay) / sinh_decay;
    let across = s * 2.0 * decay / sinh_decay;
    Response {
        bb: (s * coth - half_rate) / (bottom * k * k),
        tb: across / ((bottom * top).sqrt() * k * k),
        tt: (s * coth + half_rate) / (top * k * k),
    }
}

/// Puts one stack on another: what leaves one enters the other, at the same potential.
fn join(below: Response, above: Response) -> Response {
    let between = below.tt + above.bb;
    Response {
        bb: below.bb - below.tb * below.tb / between,
        tb: below.tb * above.tb / between,
        tt: above.tt - above.tb * above.tb / between,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn close(a: f64, b: f64, relative: f64) -> bool {
        (a - b).abs() <= relative * b.abs()
    }

    #[test]
    fn a_uniform_layer_has_the_hyperbolic_response() {
        let (k, sigma, t) = (700.0_f64, 0.25, 0.004);
        let found = response(&[Layer::uniform(t, sigma)], k);
        assert!(close(found.tt, 1.0 / (sigma * k * (k * t).tanh()), 1e-13));
        assert!(close(found.bb, found.tt, 1e-15));
        assert!(close(found.tb, 1.0 / (sigma * k * (k * t).sinh()), 1e-13));
    }

    #[test]
    fn a_gradient_is_the_limit_of_many_thin_layers() {
        let (bottom, top, t) = (1.0_f64, 0.01, 0.01);
        let gradient = [Layer::graded(t, [bottom, top])];
        let count = 400;
        let steps: Vec<_> = (0..count)
            .map(|i| {
                let share = (f64::from(i) + 0.5) / f64::from(count);
                Layer::uniform(t / f64::from(count), bottom * (top / bottom).powf(share))
            })
            .collect();
        for k in [20.0, 200.0, 1000.0] {
            let (a, b) = (response(&gradient, k), response(&steps, k));
            assert!(
                close(a.tt, b.tt, 0.01) && close(a.tb, b.tb, 1e-3) && close(a.bb, b.bb, 0.01),
                "k {k}: {a:?} {b:?}"
            );
        }
    }

    #[test]
    fn cutting_a_layer_in_two_changes_nothing() {
        let whole = Layer::graded(0.006, [0.1, 2.5]);
        let middle = 0.1 * 25.0_f64.powf(1.0 / 3.0);
        let cut = [Layer::graded(0.002, [0.1, middle]), Layer::graded(0.004, [middle, 2.5])];
        for k in [1.0, 50.0, 3000.0] {
            let (a, b) = (response(&[whole], k), response(&cut, k));
            assert!(close(a.tt, b.tt, 1e-10) && close(a.tb, b.tb, 1e-10) && close(a.bb, b.bb, 1e-10), "k {k}");
        }
    }

    #[test]
    fn the_finest_modes_neither_overflow_nor_cross() {
        let found = response(&[Layer::uniform(0.01, 0.2), Layer::uniform(0.02, 3.0)], 1e7);
        assert!(close(found.bb, 1.0 / (0.2 * 1e7), 1e-12) && close(found.tt, 1.0 / (3.0 * 1e7), 1e-12));
        assert!(found.tb >= 0.0 && found.tb < 1e-100);
    }

    #[test]
    fn a_one_dimensional_bar_has_the_resistance_of_its_depth() {
        let layers = [Layer::uniform(0.003, 0.5), Layer::graded(0.004, [0.1, 0.4])];
        let found = floating_response(&layers);
        let gradient = 0.004 * (1.0 / 0.1 - 1.0 / 0.4) / 4.0_f64.ln();
        assert!(close(found.tt + found.bb - 2.0 * found.tb, 0.003 / 0.5 + gradient, 1e-5));
    }
}
