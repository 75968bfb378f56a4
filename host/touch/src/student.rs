//! Student's distribution: how much farther than a normal one it reaches.

/// The quantile of Student's t with `freedom` degrees of freedom at the probability of a normal one, `z`.
///
/// Cornish and Fisher's expansion (Abramowitz and Stegun, 26.7.5), within 0.5 % of the truth from 3 degrees of freedom on, and 1.5 % at 2. Below 1 that of
/// 1 is given.
pub fn quantile(z: f64, freedom: f64) -> f64 {
    let v = freedom.max(1.0);
    let terms = [
        (z.powi(3) + z) / 4.0,
        (5.0 * z.powi(5) + 16.0 * z.powi(3) + 3.0 * z) / 96.0,
        (3.0 * z.powi(7) + 19.0 * z.powi(5) + 17.0 * z.powi(3) - 15.0 * z) / 384.0,
    ];
    z + terms[0] / v + terms[1] / (v * v) + terms[2] / v.powi(3)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_are_those_of_tables() {
        // 95 and 97.5 %: any book's table.
        for (z, freedom, table) in [
            (1.644_854, 2.0, 2.920),
            (1.644_854, 3.0, 2.353),
            (1.644_854, 8.0, 1.860),
            (1.959_964, 8.0, 2.306),
            (1.959_964, 4.0, 2.776),
        ] {
            let found: f64 = quantile(z, freedom);
            assert!((found / table - 1.0).abs() < if freedom < 3.0 { 0.015 } else { 0.005 }, "{freedom}: {found}");
        }
        assert!((quantile(1.959_964, 1e9) - 1.959_964).abs() < 1e-6);
    }
}
