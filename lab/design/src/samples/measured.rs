//! What the paper measured of its samples: tables I and II.

/// Measured figures of a sample, and which of them are measurements at all.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Measured {
    /// Letters of its foams, the upper one first.
    pub name: &'static str,
    /// SENS (mV/N of the reconstructed value).
    pub sensitivity_mv_per_n: f64,
    /// FMAX (N), if it is a measurement.
    pub maximum_n: Option<f64>,
    /// FMAX as printed (N). Of sample D that is 34 975 N and of DA 105.5 N, 7000 and 21 times what was applied: fits that failed, not measurements.
    pub printed_maximum_n: f64,
    /// SR.
    pub spatial_resolution: f64,
    /// PA.
    pub position_accuracy: f64,
}

/// An FMAX from here on is a failed fit (N): four times what was applied (13.7 N of AB is 2.7 times).
pub const FAILED_N: f64 = 4.0 * super::super::press::FORCES_N[1];

/// Table II, as printed.
const TABLE: [(&str, [f64; 4]); 11] = [
    ("A", [0.174, 2.837, 0.711, 0.697]),
    ("B", [0.011, 6.008, 0.394, 0.745]),
    ("C", [0.108, 4.356, 0.417, 0.783]),
    ("D", [0.102, 34975.0, 0.788, 0.562]),
    ("BA", [0.009, 5.206, 0.522, 0.752]),
    ("AD", [0.223, 2.228, 0.528, 0.620]),
    ("BC", [0.418, 1.392, 0.442, 0.625]),
    ("AB", [0.017, 13.71, 0.454, 0.607]),
    ("DA", [0.064, 105.5, 0.736, 0.626]),
    ("BB-5x5", [0.009, 7.032, 0.381, 0.732]),
    ("BB-7x7", [0.005, 8.525, 0.466, 0.804]),
];

impl Measured {
    /// FMAX (N) as printed, with a word where that is a failed fit.
    pub fn maximum_text(&self) -> String {
        match self.maximum_n {
            Some(newtons) => newtons.to_string(),
            None => format!("{}, failed fit", self.printed_maximum_n),
        }
    }
}

/// All samples of the table.
pub fn all() -> impl Iterator<Item = Measured> {
    TABLE.into_iter().map(|(name, [sensitivity_mv_per_n, maximum_n, spatial_resolution, position_accuracy])| Measured {
        name,
        sensitivity_mv_per_n,
        maximum_n: (maximum_n < FAILED_N).then_some(maximum_n),
        printed_maximum_n: maximum_n,
        spatial_resolution,
        position_accuracy,
    })
}
