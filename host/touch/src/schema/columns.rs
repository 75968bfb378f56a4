//! The numbers of a contact and of a shape, by their names.

use serde::ser::{Serialize, SerializeMap, Serializer};

use crate::solve::{
    Change, FoundContact, FoundLine, FoundRing, FoundShape, LineUncertainty, RingUncertainty, Uncertainty,
};

/// What kind of number a column has. In files of columns each kind is that of the file: 64-bit integers, booleans, double precision.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// A whole number.
    Integer,
    /// Whether something is so: 1 or 0.
    Flag,
    /// Any number.
    Number,
    /// One of these words, by its number in their order.
    Word(&'static [&'static str]),
}

impl Kind {
    /// A value of this kind as text; nothing if it is not known.
    pub(super) fn text(self, value: Option<f64>) -> String {
        match (self, value) {
            (_, None) => String::new(),
            (Self::Flag, Some(value)) => (value != 0.0).to_string(),
            (Self::Word(words), Some(value)) => word(words, value).to_owned(),
            (Self::Integer | Self::Number, Some(value)) => value.to_string(),
        }
    }
}

/// The word of such a number.
pub fn word(words: &[&'static str], value: f64) -> &'static str {
    words.get(value as usize).copied().unwrap_or_default()
}

/// What a contact has done, as [`Change`] has it.
const STATES: &[&str] = &["start", "move"];

/// A number of a contact, by its name.
pub struct ContactColumn {
    /// Name with unit.
    pub name: &'static str,
    /// What kind of number it is.
    pub kind: Kind,
    /// What it says, in a line.
    pub what: &'static str,
    of: fn(&FoundContact) -> Option<f64>,
}

/// The numbers of a contact, in the order of every format.
pub const CONTACT_COLUMNS: [ContactColumn; 20] = [
    ContactColumn {
        name: "id",
        kind: Kind::Integer,
        what: "Its number, which stays the same from frame to frame.",
        of: |contact| contact.id.map(f64::from),
    },
    ContactColumn { name: "x_m", kind: Kind::Number, what: "Centre, x (m).", of: |contact| Some(contact.x_m) },
    ContactColumn { name: "y_m", kind: Kind::Number, what: "Centre, y (m).", of: |contact| Some(contact.y_m) },
    ContactColumn {
        name: "z_m",
        kind: Kind::Number,
        what: "Centre, z (m): on a curved detector; zero on a flat one.",
        of: |contact| Some(contact.z_m),
    },
    ContactColumn {
        name: "conductance_s",
        kind: Kind::Number,
        what: "Conductance (S); not known where something else was taught.",
        of: FoundContact::known_conductance_s,
    },
    ContactColumn {
        name: "apparent_conductance_s",
        kind: Kind::Number,
        what: "Conductance (S) in series with the spreading resistance under it: better determined for firm contacts.",
        of: |contact| contact.apparent_conductance_s,
    },
    ContactColumn {
        name: "radius_m",
        kind: Kind::Number,
        what: "Radius (m), where the readings determine it.",
        of: |contact| contact.radius_m,
    },
    ContactColumn {
        name: "force_n",
        kind: Kind::Number,
        what: "Force (N), on a detector with a law of force, or of a solver that was taught forces.",
        of: |contact| contact.force_n,
    },
    ContactColumn {
        name: "force_deviation_n",
        kind: Kind::Number,
        what: "Standard error of the force (N).",
        of: |contact| contact.force_deviation_n,
    },
    ContactColumn {
        name: "force_beyond_maximum",
        kind: Kind::Flag,
        what: "Whether the force is beyond the largest that can be determined.",
        of: |contact| contact.force_beyond_maximum.map(f64::from),
    },
    ContactColumn {
        name: "sigma_x_m",
        kind: Kind::Number,
        what: "Standard error of x (m).",
        of: |contact| error(contact, |errors| errors.x_m),
    },
    ContactColumn {
        name: "sigma_y_m",
        kind: Kind::Number,
        what: "Standard error of y (m).",
        of: |contact| error(contact, |errors| errors.y_m),
    },
    ContactColumn {
        name: "correlation",
        kind: Kind::Number,
        what: "Correlation of the errors of x and y, -1 to 1.",
        of: |contact| error(contact, |errors| errors.correlation),
    },
    ContactColumn {
        name: "sigma_conductance_s",
        kind: Kind::Number,
        what: "Standard error of the conductance (S).",
        of: |contact| error(contact, |errors| errors.conductance_s),
    },
    ContactColumn {
        name: "depth_m",
        kind: Kind::Number,
        what: "Depth (m) that it is pressed in, of a solver that was taught depths.",
        of: |contact| contact.depth_m,
    },
    ContactColumn {
        name: "area_m2",
        kind: Kind::Number,
        what: "Area (m2), where the readings determine its radius.",
        of: FoundContact::area_m2,
    },
    ContactColumn {
        name: "state",
        kind: Kind::Word(STATES),
        what: "`start` if it was not there in the answer before, else `move`.",
        of: |contact| contact.change.map(|change| f64::from(u8::from(change != Change::Start))),
    },
    ContactColumn {
        name: "dx_m",
        kind: Kind::Number,
        what: "Its way since the answer before, x (m).",
        of: |contact| way_m(contact, 0),
    },
    ContactColumn { name: "dy_m", kind: Kind::Number, what: "The same, y (m).", of: |contact| way_m(contact, 1) },
    ContactColumn {
        name: "dz_m",
        kind: Kind::Number,
        what: "The same, z (m): on a curved detector; zero on a flat one.",
        of: |contact| way_m(contact, 2),
    },
];

fn way_m(contact: &FoundContact, axis: usize) -> Option<f64> {
    match contact.change? {
        Change::Start => None,
        Change::Move { way_m } => Some(way_m[axis]),
    }
}

fn error(contact: &FoundContact, of: fn(&Uncertainty) -> f64) -> Option<f64> {
    // A board tells the error of the place alone.
    contact.uncertainty.as_ref().map(of).filter(|error| !error.is_nan())
}

impl ContactColumn {
    /// Its value, if it is known.
    pub fn value(&self, contact: &FoundContact) -> Option<f64> {
        (self.of)(contact)
    }
}

/// The numbers of a contact in the order of [`CONTACT_COLUMNS`] without the first, its id, which is an integer; NaN where not
/// known. For binary layouts.
pub fn contact_values(contact: &FoundContact) -> [f32; CONTACT_COLUMNS.len() - 1] {
    std::array::from_fn(|index| CONTACT_COLUMNS[index + 1].value(contact).map_or(f32::NAN, |value| value as f32))
}

impl FoundContact {
    /// The contact with these numbers, in the order of [`CONTACT_COLUMNS`]: the inverse of [`ContactColumn::value`].
    pub fn of_values(values: [Option<f64>; CONTACT_COLUMNS.len()]) -> Self {
        let [id, x_m, y_m, z_m, conductance_s, apparent_conductance_s, radius_m, others @ ..] = values;
        let [force_n, force_deviation_n, beyond, sigma_x_m, sigma_y_m, correlation, sigma_s, depth_m, ref change @ ..] =
            others;
        let uncertainty = || {
            let (correlation, conductance_s) = (correlation?, sigma_s?);
            Some(Uncertainty { x_m: sigma_x_m?, y_m: sigma_y_m?, correlation, conductance_s })
        };
        Self {
            id: id.map(|id| id as u32),
            x_m: x_m.unwrap_or_default(),
            y_m: y_m.unwrap_or_default(),
            z_m: z_m.unwrap_or_default(),
            conductance_s: conductance_s.unwrap_or_default(),
            apparent_conductance_s,
            radius_m,
            force_n,
            depth_m,
            force_deviation_n,
            force_beyond_maximum: beyond.map(|flag| flag != 0.0),
            uncertainty: uncertainty(),
            change: change_of(*change),
        }
    }
}

/// The change with the numbers from the area on.
fn change_of([_area_m2, state, ref way_m @ ..]: [Option<f64>; 5]) -> Option<Change> {
    let [dx_m, dy_m, dz_m] = way_m.map(Option::unwrap_or_default);
    state.map(|state| if state == 0.0 { Change::Start } else { Change::Move { way_m: [dx_m, dy_m, dz_m] } })
}

/// `{id?, x_m, y_m, z_m?, conductance_s?, apparent_conductance_s?, radius_m?, force_n?, force_deviation_n?, force_beyond_maximum?, sigma_x_m?, ..., depth_m?, area_m2?, state?, dx_m?, ...}`; z is left out on a flat detector.
impl Serialize for FoundContact {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(None)?;
        for column in &CONTACT_COLUMNS {
            match (column.name, column.kind, column.value(self)) {
                ("z_m" | "dz_m", _, Some(0.0)) | (_, _, None) => {}
                (name, Kind::Integer, Some(value)) => map.serialize_entry(name, &(value as u64))?,
                (name, Kind::Flag, Some(value)) => map.serialize_entry(name, &(value != 0.0))?,
                (name, Kind::Number, Some(value)) => map.serialize_entry(name, &value)?,
                (name, Kind::Word(words), Some(value)) => map.serialize_entry(name, word(words, value))?,
            }
        }
        map.end()
    }
}

/// A number of a shape, by its name.
pub struct ShapeColumn {
    /// Name with unit, after `shape_`; in JSON, where the shape is an object, without that.
    pub name: &'static str,
    of: fn(&FoundShape) -> Option<f64>,
}

/// The numbers of a shape, in the order of every format: ends of a line, centre and radius of a ring, width and conductance of both, and the
/// standard errors of all.
pub const SHAPE_COLUMNS: [ShapeColumn; 18] = [
    ShapeColumn { name: "shape_from_x_m", of: |shape| line(shape, |line| Some(line.from_m[0])) },
    ShapeColumn { name: "shape_from_y_m", of: |shape| line(shape, |line| Some(line.from_m[1])) },
    ShapeColumn { name: "shape_to_x_m", of: |shape| line(shape, |line| Some(line.to_m[0])) },
    ShapeColumn { name: "shape_to_y_m", of: |shape| line(shape, |line| Some(line.to_m[1])) },
    ShapeColumn { name: "shape_x_m", of: |shape| ring(shape, |ring| Some(ring.centre_m[0])) },
    ShapeColumn { name: "shape_y_m", of: |shape| ring(shape, |ring| Some(ring.centre_m[1])) },
    ShapeColumn { name: "shape_radius_m", of: |shape| ring(shape, |ring| Some(ring.radius_m)) },
    ShapeColumn { name: "shape_width_m", of: |shape| Some(shape.width_m()) },
    ShapeColumn { name: "shape_conductance_s", of: |shape| Some(shape.conductance_s()) },
    ShapeColumn { name: "shape_sigma_from_x_m", of: |shape| line(shape, |line| Some(line.uncertainty?.from_m[0])) },
    ShapeColumn { name: "shape_sigma_from_y_m", of: |shape| line(shape, |line| Some(line.uncertainty?.from_m[1])) },
    ShapeColumn { name: "shape_sigma_to_x_m", of: |shape| line(shape, |line| Some(line.uncertainty?.to_m[0])) },
    ShapeColumn { name: "shape_sigma_to_y_m", of: |shape| line(shape, |line| Some(line.uncertainty?.to_m[1])) },
    ShapeColumn { name: "shape_sigma_x_m", of: |shape| ring(shape, |ring| Some(ring.uncertainty?.centre_m[0])) },
    ShapeColumn { name: "shape_sigma_y_m", of: |shape| ring(shape, |ring| Some(ring.uncertainty?.centre_m[1])) },
    ShapeColumn { name: "shape_sigma_radius_m", of: |shape| ring(shape, |ring| Some(ring.uncertainty?.radius_m)) },
    ShapeColumn {
        name: "shape_sigma_width_m",
        of: |shape| {
            line(shape, |line| Some(line.uncertainty?.width_m)).or(ring(shape, |ring| Some(ring.uncertainty?.width_m)))
        },
    },
    ShapeColumn {
        name: "shape_sigma_conductance_s",
        of: |shape| {
            line(shape, |line| Some(line.uncertainty?.conductance_s))
                .or(ring(shape, |ring| Some(ring.uncertainty?.conductance_s)))
        },
    },
];

fn line(shape: &FoundShape, of: fn(&FoundLine) -> Option<f64>) -> Option<f64> {
    match shape {
        FoundShape::Line(line) => of(line),
        FoundShape::Ring(_) => None,
    }
}

fn ring(shape: &FoundShape, of: fn(&FoundRing) -> Option<f64>) -> Option<f64> {
    match shape {
        FoundShape::Line(_) => None,
        FoundShape::Ring(ring) => of(ring),
    }
}

impl ShapeColumn {
    /// Its value, if it is known.
    pub fn value(&self, shape: &FoundShape) -> Option<f64> {
        (self.of)(shape)
    }
}

impl FoundShape {
    /// The shape with these numbers, in the order of [`SHAPE_COLUMNS`]: the inverse of [`ShapeColumn::value`]. `None` if they are neither a
    /// line's nor a ring's.
    pub fn of_values(values: [Option<f64>; SHAPE_COLUMNS.len()]) -> Option<Self> {
        let [from_x, from_y, to_x, to_y, x, y, radius, width, conductance, sigmas @ ..] = values;
        let [sigma_from_x, sigma_from_y, sigma_to_x, sigma_to_y, others @ ..] = sigmas;
        let [sigma_x, sigma_y, sigma_radius, sigma_width, sigma_conductance] = others;
        let (width_m, conductance_s) = (width?, conductance?);
        let pair = |x: Option<f64>, y: Option<f64>| Some([x?, y?]);
        if let (Some(from_m), Some(to_m)) = (pair(from_x, from_y), pair(to_x, to_y)) {
            let uncertainty = || {
                let (from_m, to_m) = (pair(sigma_from_x, sigma_from_y)?, pair(sigma_to_x, sigma_to_y)?);
                Some(LineUncertainty { from_m, to_m, width_m: sigma_width?, conductance_s: sigma_conductance? })
            };
            return Some(Self::Line(FoundLine { from_m, to_m, width_m, conductance_s, uncertainty: uncertainty() }));
        }
        let uncertainty = || {
            let (centre_m, radius_m) = (pair(sigma_x, sigma_y)?, sigma_radius?);
            Some(RingUncertainty { centre_m, radius_m, width_m: sigma_width?, conductance_s: sigma_conductance? })
        };
        let (centre_m, radius_m) = (pair(x, y)?, radius?);
        Some(Self::Ring(FoundRing { centre_m, radius_m, width_m, conductance_s, uncertainty: uncertainty() }))
    }
}

/// The numbers of a shape in the order of [`SHAPE_COLUMNS`]; NaN where not known. For binary layouts.
pub fn shape_values(shape: &FoundShape) -> [f32; SHAPE_COLUMNS.len()] {
    std::array::from_fn(|index| SHAPE_COLUMNS[index].value(shape).map_or(f32::NAN, |value| value as f32))
}

/// `{kind, from_x_m?, ..., x_m?, ..., width_m, conductance_s, sigma_...?}`; the kind is `line` or `ring`.
impl Serialize for FoundShape {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(None)?;
        map.serialize_entry("kind", self.name())?;
        for column in &SHAPE_COLUMNS {
            if let Some(value) = column.value(self) {
                map.serialize_entry(column.name.trim_start_matches("shape_"), &value)?;
            }
        }
        map.end()
    }
}
