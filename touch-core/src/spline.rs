//! Uniform cubic B-splines: four weights an interval, with derivatives.

/// Weights of the four coefficients about an interval, and their first and second derivatives by the way through it.
#[derive(Clone, Copy, Debug, Default)]
pub struct Weights {
    /// Of the value.
    pub value: [f32; 4],
    /// Of the derivative.
    pub slope: [f32; 4],
    /// Of the second derivative.
    pub bend: [f32; 4],
}

/// At a share `t` of the way through an interval, 0 to 1.
pub fn weights(t: f32) -> Weights {
    let (r, t2) = (1.0 - t, t * t);
    let sixth = 1.0 / 6.0;
    Weights {
        value: [
            sixth * r * r * r,
            sixth * (3.0 * t2 * t - 6.0 * t2 + 4.0),
            sixth * (-3.0 * t2 * t + 3.0 * t2 + 3.0 * t + 1.0),
            sixth * t2 * t,
        ],
        slope: [-0.5 * r * r, 1.5 * t2 - 2.0 * t, -1.5 * t2 + t + 0.5, 0.5 * t2],
        bend: [r, 3.0 * t - 2.0, 1.0 - 3.0 * t, t],
    }
}

/// The interval that a position in intervals is in, of so many, and the share of the way through it; a position beyond them, or none, is
/// at an end.
pub fn interval(position: f32, intervals: usize) -> (usize, f32) {
    // `max` also takes what is not a number.
    let position = position.max(0.0).min(intervals as f32);
    let first = (position as usize).min(intervals.saturating_sub(1));
    (first, position - first as f32)
}
