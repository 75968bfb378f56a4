//! Detectors of the paper, by name.

use super::material::FOAMS;
use super::pad::CONTACT_IMPEDANCE_OHM_M2;
use super::{Adc, Detector, Electrode, Layer, Outline, Tolerances, Unevenness};

/// Drive where none is given (V).
pub(super) const DRIVE_V: f64 = 2.0;
/// On-resistance where none is given: the ADG726's (ohm).
pub(super) const ON_RESISTANCE_OHM: f64 = 4.0;

/// The paper's stacks of two foams on the default preset, joined by dots of glue.
const BONDED: [&str; 2] = ["BB-5x5", "BB-7x7"];

/// Name, width, height, thickness (m), columns and rows of electrodes, their diameter (m).
type Row = (&'static str, f64, f64, f64, usize, usize, f64);

const ROWS: [Row; 7] = [
    ("square-60", 0.060, 0.060, 0.005, 4, 4, 0.004),
    ("square-50", 0.050, 0.050, 0.005, 4, 4, 0.003),
    ("square-150", 0.150, 0.150, 0.010, 4, 4, 0.004),
    ("strip-13x60", 0.013, 0.060, 0.003, 2, 8, 0.004),
    ("display-140x70", 0.140, 0.070, 0.003, 8, 4, 0.004),
    ("pad-257x182", 0.257, 0.182, 0.005, 8, 4, 0.004),
    ("fingertip-10", 0.010, 0.010, 0.0005, 4, 4, 0.001),
];

impl Detector {
    /// Name of the default preset.
    pub const DEFAULT: &str = ROWS[0].0;

    /// Names of all presets.
    pub fn preset_names() -> impl Iterator<Item = &'static str> {
        ROWS.iter().map(|row| row.0).chain(BONDED)
    }

    /// A detector of the paper in sample A, or in the foams of its name; `None` if there is none of that name.
    pub fn preset(name: &str) -> Option<Self> {
        if BONDED.contains(&name) {
            let stacked = Self::default().in_material(&name.parse().ok()?).ok()?;
            return Some(Self { name: name.to_owned(), ..stacked });
        }
        ROWS.iter().find(|row| row.0 == name).map(Self::of)
    }

    fn of(&(name, width_m, height_m, thickness_m, columns, rows, diameter_m): &Row) -> Self {
        Self {
            name: name.to_owned(),
            outline: Outline::rectangle(width_m, height_m),
            surface: None,
            layers: vec![Layer::uniform(thickness_m, FOAMS[0].conductivity_s_per_m)],
            unevenness: Unevenness::default(),
            electrodes: electrode_grid(width_m, height_m, columns, rows, diameter_m / 2.0),
            contact_impedance_ohm_m2: CONTACT_IMPEDANCE_OHM_M2,
            drive_v: DRIVE_V,
            ground_v: 0.0,
            on_resistance_ohm: ON_RESISTANCE_OHM,
            adc: Adc::default(),
            tolerances: Tolerances::default(),
            converters: Vec::new(),
            calibration: None,
            force: None,
            skin: Some(FOAMS[0].into()),
            correction: None,
        }
    }
}

impl Default for Detector {
    /// The default preset, 60 x 60 mm with 16 electrodes.
    fn default() -> Self {
        Self::of(&ROWS[0])
    }
}

/// A cell-centred grid, x running fastest: pitch = side / number of electrodes on that side.
pub fn electrode_grid(width_m: f64, height_m: f64, columns: usize, rows: usize, radius_m: f64) -> Vec<Electrode> {
    let place = |side_m: f64, index: usize, count: usize| side_m * ((index as f64 + 0.5) / count as f64 - 0.5);
    (0..rows)
        .flat_map(|row| (0..columns).map(move |column| (column, row)))
        .map(|(column, row)| Electrode::flat(place(width_m, column, columns), place(height_m, row, rows), radius_m))
        .collect()
}
