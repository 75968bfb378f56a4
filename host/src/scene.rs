//! What presses: the contacts present at a moment.

/// A disc of contact between driving layer and detector.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Contact {
    /// Centre, x (m).
    pub x_m: f64,
    /// Centre, y (m).
    pub y_m: f64,
    /// Radius (m).
    pub radius_m: f64,
    /// Conductance of the whole disc (S), spread evenly over its area.
    pub conductance_s: f64,
}
