//! What a detector is: outline, layers, electrodes, and how it is measured.

mod bond;
mod calibration;
mod check;
mod chosen;
mod correction;
mod file;
mod force;
mod material;
mod pad;
mod parameters;
mod preset;
pub mod surface;
mod svg;
mod tolerances;
mod uneven;

pub use self::bond::Bond;
pub use self::calibration::{CalibratedParameter, Calibration, SHORTEST_WAVE, Unknowns};
pub(crate) use self::check::within;
pub use self::check::{CONDUCTIVITY_S_PER_M, ELECTRODES, LENGTH_M, Problem};
pub use self::chosen::{Chosen, UnknownDetector};
pub use self::correction::{ConductanceErrors, Correction, PlaceErrors};
pub use self::file::{FileError, TomlError};
pub use self::force::{FARTHEST, ForceLaw, Newtons};
pub use self::material::{FOAMS, Foam, MaterialError, Stack, StackError};
pub use self::parameters::{Parameter, UnknownParameter};
pub use self::preset::electrode_grid;
pub use self::surface::edges_of;
pub use self::surface::{Foot, FormatError, Surface, SurfaceError};
pub use self::svg::short;
pub use self::tolerances::Tolerances;
pub use self::uneven::Unevenness;
pub(crate) use self::uneven::cosines;
use crate::geometry;
use crate::hertz::Skin;
use crate::readings::Range;

/// A detection layer with its electrodes and the circuit that measures it.
///
/// Coordinates: x and y from the middle of the outline's bounding box, z up from the electrode side; metres.
///
/// ```
/// use tactomo_physics::detector::Detector;
///
/// let detector = Detector::preset("square-60").unwrap_or_default();
/// assert_eq!(detector.electrodes.len(), 16);
/// // The same from a file's text, with another name.
/// let text = detector.to_toml().replace("square-60", "mine");
/// assert_eq!(Detector::from_toml(&text, "unnamed")?.name, "mine");
/// # Ok::<(), tactomo_physics::detector::TomlError>(())
/// ```
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Detector {
    /// Preset or file name, for people.
    pub name: String,
    /// Edge of the layer; on a curved detector that of the flat map that it is drawn on.
    pub outline: Outline,
    /// The surface that the layer lies on, if that is not a plane.
    pub surface: Option<Surface>,
    /// Bottom (electrode side) first.
    pub layers: Vec<Layer>,
    /// How the layers' conductivity differs across the plane.
    #[serde(default)]
    pub unevenness: Unevenness,
    /// In the order of the channels.
    pub electrodes: Vec<Electrode>,
    /// Contact impedance between pad and layer, in ohm square metres (ohm m2), of pads that have none of their own.
    pub contact_impedance_ohm_m2: f64,
    /// Voltage of the driving layer above that of a grounded electrode's switch (V).
    pub drive_v: f64,
    /// Voltage of a grounded electrode's switch above the converter's zero (V): zero unless the multiplexer's drain is lifted, so that readings
    /// stay clear of a converter's floor. All readings are given above it.
    #[serde(default)]
    pub ground_v: f64,
    /// Resistance of the multiplexer's closed switch (ohm).
    pub on_resistance_ohm: f64,
    /// How the voltages become numbers.
    pub adc: Adc,
    /// What is known of the errors of the converters that the channels share, as a board tells it; none is known of a description alone. Which
    /// channels are on which, [`Electrode::converter`] tells.
    #[serde(skip)]
    pub converters: Vec<ConverterErrors>,
    /// How far it may be from this description.
    #[serde(default)]
    pub tolerances: Tolerances,
    /// Where its quantities come from, if they were not described but calibrated.
    #[serde(skip)]
    pub calibration: Option<Calibration>,
    /// Newtons from conductances, once that is calibrated.
    pub force: Option<ForceLaw>,
    /// How soft it is and what its surface conducts, if that is known: newtons of simulated presses need it.
    #[serde(default)]
    pub skin: Option<Skin>,
    /// What is taken off contacts that are found with this description, where known presses have shown errors.
    #[serde(skip)]
    pub correction: Option<Correction>,
}

/// What a converter's readings may be off by, as standard deviations from chip to chip.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ConverterErrors {
    /// Of its gain, as a share.
    pub gain_share: f64,
    /// Of the height of a bow over its range (V).
    pub bow_v: f64,
    /// Ends of the range, between which the bow is (V).
    pub range_v: [f64; 2],
}

impl ConverterErrors {
    /// What a gain and a bow of one standard deviation each change in a reading (V).
    pub fn changes_v(&self, volts: f64) -> [f64; 2] {
        let [low_v, high_v] = self.range_v;
        let share = ((volts - low_v) / (high_v - low_v)).clamp(0.0, 1.0);
        [self.gain_share * volts, self.bow_v * 4.0 * share * (1.0 - share)]
    }

    /// What its readings can tell, with noise of a standard deviation (V): as near to its ends as that, they say no more than a bound. At a floor of
    /// zero there is nothing that hides.
    pub fn range(&self, deviation_v: f64) -> Range {
        let [low_v, high_v] = self.range_v;
        let margin_v = ENDS * deviation_v;
        let floor_v = if low_v > 0.0 { low_v + margin_v } else { f64::NEG_INFINITY };
        Range { floor_v, ceiling_v: high_v - margin_v }
    }
}

/// Standard deviations of noise within which a reading counts as at an end of a converter's range: a voltage a little below a floor reads as much
/// above it as noise is.
const ENDS: f64 = 2.0;

/// Closed polygons, without repeating the first corner (m).
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Outline {
    /// Outer edge, counter-clockwise.
    pub outer: Vec<[f64; 2]>,
    /// Holes, clockwise.
    pub holes: Vec<Vec<[f64; 2]>>,
}

/// One layer; its conductivity runs exponentially from bottom to top, as in eq. (11) of the paper.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Layer {
    /// Thickness (m).
    pub thickness_m: f64,
    /// Conductivity at its bottom (S/m).
    pub bottom_s_per_m: f64,
    /// Conductivity at its top (S/m).
    pub top_s_per_m: f64,
    /// What joins it to the layer below, if the two do not touch all over.
    #[serde(default)]
    pub bond: Option<Bond>,
}

/// A round pad under the layer.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Electrode {
    /// Centre, x (m).
    pub x_m: f64,
    /// Centre, y (m).
    pub y_m: f64,
    /// Centre, z (m): on a curved detector; zero on a flat one.
    #[serde(default)]
    pub z_m: f64,
    /// Radius (m).
    pub radius_m: f64,
    /// Contact impedance (ohm m2), where it is not the detector's.
    #[serde(default)]
    pub contact_impedance_ohm_m2: Option<f64>,
    /// What its channel reads, over what is there.
    #[serde(default = "one")]
    pub gain: f64,
    /// What its channel reads too much, though at rest it does not show (V): a converter reads nothing below zero.
    #[serde(default)]
    pub unseen_offset_v: f64,
    /// What its channel reads where nothing is (V): in simulated detectors only, since a baseline takes it away.
    #[serde(default)]
    pub offset_v: f64,
    /// Which of [`Detector::converters`] reads its channel; of no consequence where none of these is known.
    #[serde(skip)]
    pub converter: usize,
}

const fn one() -> f64 {
    1.0
}

/// The analogue-to-digital converter.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Adc {
    /// Bits of one conversion.
    pub bits: u8,
    /// Voltage that code `2^bits` would stand for (V).
    pub full_scale_v: f64,
    /// Standard deviation of a conversion's noise, in codes (LSB).
    pub noise_lsb: f64,
}

impl Adc {
    /// Voltage of one code (V).
    pub fn lsb_v(&self) -> f64 {
        self.full_scale_v / 2f64.powi(i32::from(self.bits))
    }

    /// Standard deviation of a reading by noise and by rounding (V).
    pub fn deviation_v(&self) -> f64 {
        (self.noise_lsb.powi(2) + 1.0 / 12.0).sqrt() * self.lsb_v()
    }
}

impl Detector {
    /// Thickness of all layers together (m).
    pub fn thickness_m(&self) -> f64 {
        self.layers.iter().map(|layer| layer.thickness_m).sum()
    }

    /// Where a place is drawn (m): its x and y, but on a curved detector the point of its map.
    pub fn map_m(&self, place_m: [f64; 3]) -> [f64; 2] {
        self.surface.as_ref().map_or([place_m[0], place_m[1]], |surface| surface.map_m(place_m))
    }

    /// The place that is drawn at a point (m); `None` beside a curved detector.
    pub fn place_m(&self, map_m: [f64; 2]) -> Option<[f64; 3]> {
        match &self.surface {
            Some(surface) => surface.place_m(map_m),
            None => Some([map_m[0], map_m[1], 0.0]),
        }
    }

    /// This detector with some of its electrodes only, in the order given. What belongs to an electrode or to its channel goes with it: it is in
    /// [`Electrode`], or is chosen here.
    ///
    /// # Panics
    /// If there is no such electrode.
    #[must_use]
    pub fn keeping(&self, kept: &[usize]) -> Self {
        // All fields by name: whoever adds one is asked here whether it belongs to electrodes.
        let Self {
            name,
            outline,
            surface,
            layers,
            unevenness,
            electrodes,
            contact_impedance_ohm_m2,
            drive_v,
            ground_v,
            on_resistance_ohm,
            adc,
            converters,
            tolerances,
            calibration,
            force,
            skin,
            correction,
        } = self.clone();
        Self {
            electrodes: kept.iter().map(|e| electrodes[*e]).collect(),
            calibration: calibration.map(|calibration| calibration.keeping(kept)),
            name,
            outline,
            surface,
            layers,
            unevenness,
            contact_impedance_ohm_m2,
            drive_v,
            ground_v,
            on_resistance_ohm,
            adc,
            converters,
            tolerances,
            force,
            skin,
            correction,
        }
    }

    /// This detector as the board measures it that `other` is measured by: its drive, its converters and what is known of their errors.
    #[must_use]
    pub fn measured_as(&self, other: &Self) -> Self {
        let (drive_v, adc, converters) = (other.drive_v, other.adc, other.converters.clone());
        let mut measured = Self { drive_v, adc, converters, ..self.clone() };
        let pads = measured.electrodes.iter_mut().zip(&other.electrodes);
        pads.for_each(|(pad, other)| pad.converter = other.converter);
        measured
    }

    /// This detector with its description taken as exact: there is nothing to correct then.
    #[must_use]
    pub fn taken_as_exact(&self) -> Self {
        Self { tolerances: Tolerances::EXACT, calibration: None, correction: None, ..self.clone() }
    }

    /// Logarithm of the factor by which unevenness changes the conductivity at a place of the map (m).
    pub fn log_unevenness(&self, map_m: [f64; 2]) -> f64 {
        let [low, high] = self.outline.bounds();
        self.unevenness.log_at([0, 1].map(|axis| (map_m[axis] - low[axis]) / (high[axis] - low[axis])))
    }

    /// Contact impedance of one of its pads (ohm m2).
    pub fn pad_impedance_ohm_m2(&self, pad: &Electrode) -> f64 {
        pad.contact_impedance_ohm_m2.unwrap_or(self.contact_impedance_ohm_m2)
    }

    /// Conductivity integrated over the thickness (S per square): the natural unit of contact conductance.
    pub fn sheet_conductance_s(&self) -> f64 {
        self.layers.iter().map(Layer::sheet_conductance_s).sum()
    }
}

impl Electrode {
    /// Its centre (m).
    pub fn place_m(&self) -> [f64; 3] {
        [self.x_m, self.y_m, self.z_m]
    }

    /// A pad of a flat detector.
    pub const fn flat(x_m: f64, y_m: f64, radius_m: f64) -> Self {
        Self {
            x_m,
            y_m,
            z_m: 0.0,
            radius_m,
            contact_impedance_ohm_m2: None,
            gain: 1.0,
            unseen_offset_v: 0.0,
            offset_v: 0.0,
            converter: 0,
        }
    }
}

impl Layer {
    /// A layer of one conductivity.
    pub const fn uniform(thickness_m: f64, conductivity_s_per_m: f64) -> Self {
        Self::graded(thickness_m, [conductivity_s_per_m; 2])
    }

    /// A layer with a conductivity at its bottom and one at its top (S/m).
    pub const fn graded(thickness_m: f64, [bottom_s_per_m, top_s_per_m]: [f64; 2]) -> Self {
        Self { thickness_m, bottom_s_per_m, top_s_per_m, bond: None }
    }

    /// Integral of the conductivity over the thickness (S): thickness times the logarithmic mean of bottom and top.
    pub fn sheet_conductance_s(&self) -> f64 {
        let ratio = self.top_s_per_m / self.bottom_s_per_m;
        let log = ratio.ln();
        // Near 1 the quotient (ratio - 1) / ln(ratio) loses its digits; its series does not.
        let mean = if log.abs() < 1e-4 { 1.0 + log / 2.0 + log * log / 6.0 } else { (ratio - 1.0) / log };
        self.thickness_m * self.bottom_s_per_m * mean
    }
}

impl Outline {
    /// A rectangle about the origin (m).
    pub fn rectangle(width_m: f64, height_m: f64) -> Self {
        let (x, y) = (width_m / 2.0, height_m / 2.0);
        Self { outer: vec![[-x, -y], [x, -y], [x, y], [-x, y]], holes: Vec::new() }
    }

    /// Whether a point is inside, and in no hole (m).
    pub fn holds(&self, at_m: [f64; 2]) -> bool {
        geometry::is_inside(at_m, &self.outer) && !self.holes.iter().any(|hole| geometry::is_inside(at_m, hole))
    }

    /// Width and height (m) if this is a rectangle about the origin, else `None`.
    pub fn as_rectangle(&self) -> Option<[f64; 2]> {
        let [x, y] = *self.outer.get(2)?;
        (*self == Self::rectangle(2.0 * x, 2.0 * y)).then_some([2.0 * x, 2.0 * y])
    }

    /// Width and height of the bounding box (m).
    pub fn size_m(&self) -> [f64; 2] {
        let [low, high] = self.bounds();
        [high[0] - low[0], high[1] - low[1]]
    }

    /// Corners of the bounding box: smallest and largest x and y (m).
    pub fn bounds(&self) -> [[f64; 2]; 2] {
        geometry::bounds(&self.outer)
    }
}

impl Default for Adc {
    /// The ESP32's, at its widest range.
    fn default() -> Self {
        Self { bits: 12, full_scale_v: 3.3, noise_lsb: 1.5 }
    }
}
