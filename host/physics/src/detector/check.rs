//! Whether a detector can be built: numbers within range, electrodes on the layer and apart.

use std::ops::RangeInclusive;

use super::{
    Adc, CalibratedParameter, Correction, Detector, Electrode, ForceLaw, Layer, Outline, Parameter, Tolerances,
};
use crate::geometry::{Point, area, cross, distance, edges, is_inside, segment_distance};
use crate::hertz::Skin;
use crate::space::{self, Place};

/// How many electrodes a detector may have.
pub const ELECTRODES: RangeInclusive<usize> = 4..=32;
/// Sides, thicknesses and diameters of detectors (m).
pub const LENGTH_M: RangeInclusive<f64> = 1e-6..=10.0;
/// Conductivities of layers (S/m).
pub const CONDUCTIVITY_S_PER_M: RangeInclusive<f64> = 1e-9..=1e9;
/// Contact impedances that a pad may have (ohm m2).
const IMPEDANCE_OHM_M2: RangeInclusive<f64> = 0.0..=1e3;
/// Amplitudes of unevenness, as logarithms: a factor of e.
const UNEVEN_LOG: RangeInclusive<f64> = -1.0..=1.0;
const MAX_UNEVEN_MODES: usize = 9;
/// What a channel may read, over what is there.
const GAIN: RangeInclusive<f64> = 0.5..=2.0;
/// What a channel may read where nothing is (V).
const OFFSET_V: RangeInclusive<f64> = -1e3..=1e3;
const DRIVE_V: RangeInclusive<f64> = 1e-3..=1e3;
const BITS: RangeInclusive<u8> = 1..=24;
const MAX_LAYERS: usize = 16;
const MAX_CORNERS: usize = 1000;
const MAX_NAME: usize = 100;
/// Points nearer than this are one (m).
const APART_M: f64 = 1e-9;

/// What is wrong with a detector.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{field} {what}")]
pub struct Problem {
    /// The field, as in a detector's file.
    pub field: String,
    /// What it is, and what it has to be.
    pub what: String,
}

impl Problem {
    /// `what` is wrong with `field`.
    pub(super) fn new(field: impl Into<String>, what: impl Into<String>) -> Self {
        Self { field: field.into(), what: what.into() }
    }
}

impl Detector {
    /// Checks that it can be built.
    ///
    /// # Errors
    /// The first [`Problem`] found.
    pub fn check(&self) -> Result<(), Problem> {
        check_name(&self.name)?;
        // A surface was checked when it was read, and its map is only drawn.
        if self.surface.is_none() {
            self.outline.check()?;
        }
        self.check_layers()?;
        self.check_unevenness()?;
        self.check_electrodes()?;
        within("contact_impedance_ohm_m2", self.contact_impedance_ohm_m2, IMPEDANCE_OHM_M2)?;
        if self.ground_v != 0.0 && self.drive_v <= 0.0 {
            let drive_v = self.drive_v + self.ground_v;
            return Err(Problem::new(
                "drive_v",
                format!("is {drive_v}, but has to be above ground_v, which is {}", self.ground_v),
            ));
        }
        within("drive_v", self.drive_v, DRIVE_V)?;
        within("ground_v", self.ground_v, 0.0..=5.0)?;
        within("on_resistance_ohm", self.on_resistance_ohm, 0.0..=1e9)?;
        self.tolerances.check()?;
        self.check_calibration()?;
        self.adc.check()?;
        self.force.as_ref().map_or(Ok(()), ForceLaw::check)?;
        self.skin.as_ref().map_or(Ok(()), Skin::check)?;
        self.check_correction()
    }

    fn check_correction(&self) -> Result<(), Problem> {
        if self.correction.is_some() && self.surface.is_some() {
            return Err(Problem::new("correction", "is known of flat detectors only: leave it out of a curved one"));
        }
        self.correction.as_ref().map_or(Ok(()), Correction::check)
    }

    fn check_layers(&self) -> Result<(), Problem> {
        if !(1..=MAX_LAYERS).contains(&self.layers.len()) {
            let what = format!("has {} layers, but has to have 1 to {MAX_LAYERS}", self.layers.len());
            return Err(Problem::new("layers", what));
        }
        self.layers.iter().enumerate().try_for_each(|(index, layer)| layer.check(&format!("layers[{index}]")))?;
        self.check_bond()
    }

    fn check_calibration(&self) -> Result<(), Problem> {
        let known = self.calibration.iter().flat_map(|calibration| &calibration.parameters);
        let electrodes = self.electrodes.len();
        let wrong = |other: Parameter| match other {
            Parameter::Uneven(mode) if mode.iter().any(|half_waves| *half_waves >= MAX_UNEVEN_MODES) => {
                Some(format!("but unevenness has up to {} half waves along a side", MAX_UNEVEN_MODES - 1))
            }
            _ if other.electrode().is_some_and(|e| e >= electrodes) => {
                Some(format!("but the detector has {electrodes} electrodes, counted from 0"))
            }
            _ => None,
        };
        let names = |known: &CalibratedParameter| {
            wrong(known.parameter).map(|what| format!("names `{}`, {what}", known.parameter))
        };
        let wrong_name = known.clone().find_map(names);
        let error = known.map(|known| known.standard_error).find(|error| *error < 0.0);
        match (wrong_name, error) {
            (Some(what), _) => Err(Problem::new("calibration.parameters", what)),
            (_, Some(error)) => {
                let what = format!("holds {error:?}, but a standard error is not below zero");
                Err(Problem::new("calibration.standard_errors", what))
            }
            _ => Ok(()),
        }
    }

    fn check_unevenness(&self) -> Result<(), Problem> {
        let rows = &self.unevenness.log_amplitudes;
        let longest = rows.iter().map(Vec::len).chain([rows.len()]).max().unwrap_or(0);
        if longest > MAX_UNEVEN_MODES {
            let what = format!("has {longest} amplitudes along a side, but may have {MAX_UNEVEN_MODES}");
            return Err(Problem::new("uneven_log_amplitudes", what));
        }
        let mut all = rows.iter().flatten();
        all.try_for_each(|amplitude| within("uneven_log_amplitudes", *amplitude, UNEVEN_LOG))
    }

    fn check_electrodes(&self) -> Result<(), Problem> {
        let count = self.electrodes.len();
        if !ELECTRODES.contains(&count) {
            let what =
                format!("has {count} electrodes, but has to have {} to {}", ELECTRODES.start(), ELECTRODES.end());
            return Err(Problem::new("electrodes", what));
        }
        (0..count).try_for_each(|index| self.check_electrode(index))
    }

    fn check_electrode(&self, index: usize) -> Result<(), Problem> {
        let pad = self.electrodes[index];
        within(&format!("electrodes.diameters_m[{index}]"), 2.0 * pad.radius_m, LENGTH_M)?;
        let impedance = format!("electrodes.contact_impedances_ohm_m2[{index}]");
        within(&impedance, self.pad_impedance_ohm_m2(&pad), IMPEDANCE_OHM_M2)?;
        within(&format!("electrodes.gains[{index}]"), pad.gain, GAIN)?;
        within(&format!("electrodes.unseen_offsets_v[{index}]"), pad.unseen_offset_v, -1.0..=1.0)?;
        within(&format!("electrodes.offsets_v[{index}]"), pad.offset_v, OFFSET_V)?;
        let at = pad.place_m();
        let position = format!("electrodes.positions_m[{index}]");
        at.iter().try_for_each(|&at_m| within(&position, at_m, -LENGTH_M.end()..=*LENGTH_M.end()))?;
        let wrong = |what: String| {
            let place = format!("puts electrode {index} at {} mm", self.millimetres(at));
            Err(Problem::new(&position, place + &what))
        };
        if !self.is_within(&pad) {
            let diameter_mm = 2e3 * pad.radius_m;
            return wrong(format!(", but with its diameter of {diameter_mm:.3} mm it has to lie within the outline"));
        }
        match self.electrodes[..index].iter().position(|other| overlap(&pad, other)) {
            Some(other) => wrong(format!(", where it overlaps with electrode {other}; there has to be a gap")),
            None => Ok(()),
        }
    }

    /// Whether a pad lies on the layer with all of its area.
    fn is_within(&self, pad: &Electrode) -> bool {
        let clearance_m = match &self.surface {
            Some(surface) => surface.clearance_m(pad.place_m()),
            None => self.outline.clearance_m([pad.x_m, pad.y_m]),
        };
        clearance_m > pad.radius_m
    }

    /// Whether a pad could be where it is: on the layer, and apart from all others.
    pub(crate) fn has_room_for(&self, index: usize) -> bool {
        let pad = &self.electrodes[index];
        let mut others = self.electrodes.iter().enumerate().filter(|(other, _)| *other != index);
        self.is_within(pad) && !others.any(|(_, other)| overlap(pad, other))
    }

    /// A place for people: two numbers, or three on a surface.
    fn millimetres(&self, at: Place) -> String {
        match self.surface {
            Some(_) => format!("({:.3}, {:.3}, {:.3})", at[0] * 1e3, at[1] * 1e3, at[2] * 1e3),
            None => millimetres([at[0], at[1]]),
        }
    }
}

fn overlap(pad: &Electrode, other: &Electrode) -> bool {
    space::distance(pad.place_m(), other.place_m()) <= pad.radius_m + other.radius_m + APART_M
}

impl Tolerances {
    fn check(&self) -> Result<(), Problem> {
        self.named().iter().try_for_each(|(name, value)| {
            let allowed = match *name {
                "electrodes_m" => 0.0..=0.1,
                "offset_lsb" => 0.0..=1e4,
                "driving_sheet_ohm" => 0.0..=1e6,
                name if name.ends_with("_factor") => 1.0..=1e3,
                _ => 0.0..=1.0,
            };
            within(&format!("tolerances.{name}"), *value, allowed)
        })
    }
}

impl Layer {
    fn check(&self, field: &str) -> Result<(), Problem> {
        within(&format!("{field}.thickness_m"), self.thickness_m, LENGTH_M)?;
        let names = if self.bottom_s_per_m == self.top_s_per_m {
            ["conductivity_s_per_m"; 2]
        } else {
            ["bottom_s_per_m", "top_s_per_m"]
        };
        within(&format!("{field}.{}", names[0]), self.bottom_s_per_m, CONDUCTIVITY_S_PER_M)?;
        within(&format!("{field}.{}", names[1]), self.top_s_per_m, CONDUCTIVITY_S_PER_M)
    }
}

impl Adc {
    fn check(&self) -> Result<(), Problem> {
        if !BITS.contains(&self.bits) {
            let what = format!("is {}, but has to be from {} to {}", self.bits, BITS.start(), BITS.end());
            return Err(Problem::new("adc.bits", what));
        }
        within("adc.full_scale_v", self.full_scale_v, DRIVE_V)?;
        within("adc.noise_lsb", self.noise_lsb, 0.0..=1e6)
    }
}

impl Outline {
    /// Distance of a point of the layer from its nearest edge (m); below zero beside the layer.
    fn clearance_m(&self, at: Point) -> f64 {
        let on_layer = is_inside(at, &self.outer) && !self.holes.iter().any(|hole| is_inside(at, hole));
        let nearest_m = self.edges().map(|(_, edge)| segment_distance(at, edge)).fold(f64::INFINITY, f64::min);
        if on_layer { nearest_m } else { -nearest_m }
    }

    /// The polygons with their fields: the outer edge, then the holes.
    fn polygons(&self) -> impl Iterator<Item = (String, &Vec<Point>)> {
        let holes = self.holes.iter().enumerate().map(|(index, hole)| (format!("outline.holes_m[{index}]"), hole));
        std::iter::once(("outline.corners_m".to_owned(), &self.outer)).chain(holes)
    }

    /// All edges, with the number of their polygon.
    fn edges(&self) -> impl Iterator<Item = (usize, (Point, Point))> {
        let polygons = std::iter::once(&self.outer).chain(&self.holes).enumerate();
        polygons.flat_map(|(polygon, corners)| edges(corners).map(move |edge| (polygon, edge)))
    }

    fn check(&self) -> Result<(), Problem> {
        let corners: usize = self.polygons().map(|(_, polygon)| polygon.len()).sum();
        if corners > MAX_CORNERS {
            return Err(Problem::new("outline", format!("has {corners} corners, but may have {MAX_CORNERS}")));
        }
        self.polygons().try_for_each(|(field, polygon)| check_corners(&field, polygon))?;
        self.check_crossings()?;
        self.check_turns()
    }

    /// No two edges meet, but for neighbours at their corner.
    fn check_crossings(&self) -> Result<(), Problem> {
        let edges: Vec<_> = self.edges().collect();
        for (index, &(polygon, edge)) in edges.iter().enumerate() {
            for &(other_polygon, other) in &edges[..index] {
                if meet(other, edge, polygon == other_polygon) {
                    let places = [other.0, other.1, edge.0, edge.1].map(millimetres);
                    let [a, b, c, d] = places;
                    let what = format!("has edges that meet: {a} to {b} mm and {c} to {d} mm");
                    return Err(Problem::new("outline", what));
                }
            }
        }
        Ok(())
    }

    /// The outer edge runs counter-clockwise, holes clockwise; holes lie in the outer edge and not in each other.
    fn check_turns(&self) -> Result<(), Problem> {
        if area(&self.outer) <= 0.0 {
            return Err(Problem::new("outline.corners_m", "has to run counter-clockwise round an area"));
        }
        for (index, hole) in self.holes.iter().enumerate() {
            let field = format!("outline.holes_m[{index}]");
            if area(hole) >= 0.0 {
                return Err(Problem::new(field, "has to run clockwise round an area"));
            }
            let others = self.holes.iter().enumerate().filter(|(other, _)| *other != index);
            let in_other = others.map(|(_, other)| other).any(|other| is_inside(hole[0], other));
            if !is_inside(hole[0], &self.outer) || in_other {
                return Err(Problem::new(field, "has to lie within the outer edge, and not in another hole"));
            }
        }
        Ok(())
    }
}

/// Whether two edges meet where they should not; `a` comes before `b` if they are of the same polygon.
fn meet(a: (Point, Point), b: (Point, Point), same_polygon: bool) -> bool {
    let near = |p: Point, edge| segment_distance(p, edge) < APART_M;
    // Neighbours share a corner; they meet only if one folds back onto the other.
    if same_polygon && a.1 == b.0 {
        return near(b.1, a) || near(a.0, b);
    }
    if same_polygon && b.1 == a.0 {
        return near(b.0, a) || near(a.1, b);
    }
    let apart = |axis: usize| {
        let span = |(from, to): (Point, Point)| [from[axis].min(to[axis]), from[axis].max(to[axis])];
        let ([a0, a1], [b0, b1]) = (span(a), span(b));
        a1 + APART_M < b0 || b1 + APART_M < a0
    };
    if apart(0) || apart(1) {
        return false;
    }
    let sides =
        |edge: (Point, Point), p: Point, q: Point| (cross(edge.0, edge.1, p) > 0.0) != (cross(edge.0, edge.1, q) > 0.0);
    let crossing = sides(a, b.0, b.1) && sides(b, a.0, a.1);
    crossing || near(a.0, b) || near(a.1, b) || near(b.0, a) || near(b.1, a)
}

fn check_corners(field: &str, corners: &[Point]) -> Result<(), Problem> {
    if corners.len() < 3 {
        return Err(Problem::new(field, format!("has {} corners, but has to have at least 3", corners.len())));
    }
    for (index, corner) in corners.iter().enumerate() {
        let field = format!("{field}[{index}]");
        corner.iter().try_for_each(|&at_m| within(&field, at_m, -LENGTH_M.end()..=*LENGTH_M.end()))?;
        let next = corners[(index + 1) % corners.len()];
        if distance(*corner, next) < *LENGTH_M.start() {
            return Err(Problem::new(field, "is where the next corner is; corners have to be at least 1e-6 m apart"));
        }
    }
    Ok(())
}

fn check_name(name: &str) -> Result<(), Problem> {
    let fine = (1..=MAX_NAME).contains(&name.chars().count()) && !name.chars().any(char::is_control);
    let what = || format!("has to be 1 to {MAX_NAME} characters, none of them a control character");
    if fine { Ok(()) } else { Err(Problem::new("name", what())) }
}

/// Checks that a number is in a range.
pub(crate) fn within(field: &str, value: f64, range: RangeInclusive<f64>) -> Result<(), Problem> {
    if range.contains(&value) {
        return Ok(());
    }
    let what = format!("is {value:?}, but has to be from {:?} to {:?}", range.start(), range.end());
    Err(Problem::new(field, what))
}

fn millimetres([x_m, y_m]: Point) -> String {
    format!("({:.3}, {:.3})", x_m * 1e3, y_m * 1e3)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn problem(spoil: impl FnOnce(&mut Detector)) -> String {
        let mut detector = Detector::preset(Detector::DEFAULT).unwrap();
        spoil(&mut detector);
        detector.check().unwrap_err().to_string()
    }

    #[test]
    fn every_preset_passes() {
        for name in Detector::preset_names() {
            assert_eq!(Detector::preset(name).unwrap().check(), Ok(()), "{name}");
        }
    }

    #[test]
    fn electrodes_have_to_be_few_inside_and_apart() {
        assert!(problem(|d| d.electrodes.truncate(3)).contains("has 3 electrodes, but has to have 4 to 32"));
        assert!(problem(|d| d.electrodes[2].x_m = 0.0285).starts_with("electrodes.positions_m[2]"));
        assert!(problem(|d| d.electrodes[2].x_m = f64::NAN).starts_with("electrodes.positions_m[2] is NaN"));
        assert!(problem(|d| d.electrodes[1].x_m -= 0.012).contains("overlaps with electrode 0"));
        let hole = vec![[-0.005, -0.005], [-0.005, 0.005], [0.005, 0.005], [0.005, -0.005]];
        let in_hole = |d: &mut Detector| {
            d.outline.holes = vec![hole.clone()];
            (d.electrodes[5].x_m, d.electrodes[5].y_m) = (0.0, 0.0);
        };
        assert!(problem(in_hole).starts_with("electrodes.positions_m[5]"));
    }

    #[test]
    fn outlines_must_not_cross_themselves_or_their_holes() {
        let outline = |corners: &[Point]| problem(|d| d.outline = Outline { outer: corners.to_vec(), holes: vec![] });
        assert!(outline(&[[0.0, 0.0], [1.0, 1.0], [1.0, 0.0], [0.0, 1.0]]).contains("edges that meet"));
        assert!(outline(&[[0.0, 0.0], [1.0, 0.0], [0.5, 0.0]]).contains("edges that meet"));
        assert!(outline(&[[0.0, 0.0], [0.0, 1.0], [1.0, 0.0]]).contains("counter-clockwise"));
        assert!(outline(&[[0.0, 0.0], [1.0, 0.0], [1.0, 0.0]]).contains("1e-6 m apart"));
        let hole = |hole: Vec<Point>| problem(|d| d.outline.holes = vec![hole]);
        assert!(hole(vec![[0.05, 0.05], [0.05, 0.06], [0.06, 0.06]]).contains("within the outer edge"));
        assert!(hole(vec![[0.0, 0.0], [0.0, 0.01], [0.05, 0.01]]).contains("edges that meet"));
    }

    #[test]
    fn numbers_have_to_be_in_their_range() {
        assert!(problem(|d| d.layers[0].thickness_m = 0.0).starts_with("layers[0].thickness_m is 0.0, but"));
        assert!(problem(|d| d.layers[0].top_s_per_m = f64::INFINITY).starts_with("layers[0].top_s_per_m is inf"));
        assert!(problem(|d| d.layers.clear()).contains("has 0 layers"));
        assert!(problem(|d| d.drive_v = -2.0).starts_with("drive_v is -2.0, but has to be from"));
        assert!(problem(|d| d.adc.bits = 0).starts_with("adc.bits is 0"));
        assert!(problem(|d| d.name = "two\nlines".to_owned()).starts_with("name"));
    }
}
