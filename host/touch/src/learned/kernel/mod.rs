//! Place and strength of a press, learned from presses at known places: no model, no detector, any number of channels.
//!
//! Readings are told apart by a description of them and their size ([`features`]); place, and the strength over the size, are learned by
//! regression with a Gaussian kernel ([`regression`]), the description and all parameters chosen by leaving one press out. One contact is all that such presses
//! teach. Readings unlike all that were taught ([`novelty`]) are answered, and flagged.

mod classes;
mod columns;
mod features;
mod file;
mod left_over;
mod novelty;
mod points;
mod presses;
mod regression;
mod sentence;

use self::classes::Classes;
use self::columns::Columns;
pub use self::features::Description;
use self::features::{Described, Features};
use self::left_over::LeftOver;
use self::novelty::Novelty;
use self::points::Points;
pub use self::presses::{Presses, PressesError, Strength, check_newtons};
use self::regression::{Lesson, Regression};
use crate::solve::answer::{Flags, FoundContact, Solution};
use tactomo_table::{Array, Table};

/// How much the size of readings tells of the place of a press beside their direction: of a detector nothing, once the force is taken out of them.
const SIZE_FOR_PLACE: f64 = 0.02;
/// How much it tells of the strength over the size. Channels tell the size by themselves.
const SIZE_FOR_STRENGTH: f64 = 0.3;
/// A size beyond those taught by this factor is too far, and below those taught no contact.
const SIZES_BEYOND: f64 = 2.0;

/// Standard errors by which places that say nothing may seem better than the middle.
const BY_CHANCE: f64 = 3.0;

/// A regression from readings to the place and the strength of a press.
#[derive(Clone, Debug, PartialEq)]
pub struct Kernel {
    /// Names of the channels, if the presses had some.
    names: Vec<String>,
    features: Features,
    points: Points,
    /// x, y and z (m).
    places: Regression,
    /// What was measured of the strength, and the logarithm of that over the size.
    strengths: Option<(Strength, Regression)>,
    classes: Classes,
    novelty: Novelty,
    left_over: LeftOver,
    limits: Limits,
    /// How far the middle of the others is from each press, in the root of the mean square (m); of a file that tells.
    middle_m: Option<f64>,
    /// Presses that the points are of: some may be of one.
    presses: usize,
}

/// What was taught.
#[derive(Clone, Debug, PartialEq)]
struct Limits {
    /// Smallest and largest x, y and z (m).
    places_m: [[f64; 2]; 3],
    /// Smallest and largest logarithm of the strength over the size.
    shares: [f64; 2],
    /// Smallest and largest size of readings (V).
    sizes_v: [f64; 2],
}

/// A press, as a kernel reads it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Press {
    /// Its middle (m).
    pub place_m: [f64; 3],
    /// Its strength, in the unit of the presses taught, if that was taught.
    pub strength: Option<f64>,
    /// The readings are unlike all that were taught.
    pub is_outside: bool,
}

/// Why nothing was learned.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("nothing can be learned from these presses: {0}")]
pub struct TeachError(String);

impl Kernel {
    /// Learns from presses.
    ///
    /// # Errors
    /// [`TeachError`] if there are too few presses or they are all alike.
    pub fn train(presses: &Presses) -> Result<Self, TeachError> {
        presses.check().map_err(TeachError)?;
        let alike = || TeachError("their readings are all alike".to_owned());
        let told: Vec<_> =
            Description::ALL.into_iter().filter_map(|description| Told::of(presses, description)).collect();
        let (places_m, of) = (presses.places_m.concat(), presses.groups());
        let learned = told.iter().filter_map(|told| Some((told, Regression::learn(&told.places(&places_m, &of))?)));
        let best = learned.min_by(|(_, a), (_, b)| a.missed().total_cmp(&b.missed()));
        let (told, places) = best.ok_or_else(alike)?;
        let Told { features, described, points } = told;
        let shares = shares(presses, points);
        let lesson = told.strengths(&shares, &of);
        let strengths = match presses.strength {
            Some(strength) => Some((strength, Regression::learn(&lesson).ok_or_else(alike)?)),
            None => None,
        };
        let sizes_v: Vec<f64> = described.iter().map(|described| described.size_v).collect();
        let classes = Classes::of(&sizes_v);
        let left_over = LeftOver::of(features, described, &classes, &of);
        let limits = Limits {
            places_m: [0, 1, 2].map(|axis| range(presses.places_m.iter().map(|place_m| place_m[axis]))),
            shares: range(shares.iter().copied()),
            sizes_v: range(sizes_v.iter().copied()),
        };
        let for_strength = strengths.as_ref().map_or(0, |(_, strengths)| strengths.likeness.components);
        let compared = places.likeness.components.max(for_strength);
        let points = points.clone().keeping(compared);
        Ok(Self {
            names: presses.names.clone(),
            features: features.clone().keeping(compared.max(left_over.dimensions)),
            novelty: Novelty::of(&places, &points, &classes, &of),
            points,
            places,
            strengths,
            classes,
            left_over,
            limits,
            middle_m: Some(middle_m(&presses.places_m)),
            presses: of.iter().max().map_or(0, |last| last + 1),
        })
    }

    /// Readings that it needs for a press.
    pub fn channels(&self) -> usize {
        self.features.mean.len()
    }

    /// Names of the channels, in their order; none if they had no names.
    pub fn names(&self) -> &[String] {
        &self.names
    }

    /// Readings of a table, a row a press: by the names of the channels if both have some, else in their order. A file of presses is such a table too.
    ///
    /// # Errors
    /// What is missing.
    pub fn readings_of(&self, table: Table) -> Result<Array, String> {
        Ok(Columns::of(table, &self.names)?.readings)
    }

    /// How the strength of presses was measured, if it was.
    pub fn strength(&self) -> Option<Strength> {
        self.strengths.as_ref().map(|(strength, _)| *strength)
    }

    /// How it describes readings.
    pub fn description(&self) -> Description {
        self.features.description
    }

    /// Dimensions in which the places of presses are told apart.
    pub fn components(&self) -> usize {
        self.places.likeness.components
    }

    /// Presses that it has learned from.
    pub fn presses(&self) -> usize {
        self.presses
    }

    /// Rows of readings of those.
    pub fn rows(&self) -> usize {
        self.points.count()
    }

    /// Root mean square distance (m) by which it misses a press that it was not taught.
    pub fn left_out_m(&self) -> f64 {
        self.places.missed()
    }

    /// Root mean square distance (m) by which the middle of all presses taught misses one of them: who reads nothing does as well.
    /// `None` of a file that does not tell.
    pub fn middle_m(&self) -> Option<f64> {
        self.middle_m
    }

    /// Whether places are found no better than by guessing the middle of all presses: nothing was learned of them. The standard error of a root
    /// mean square of two coordinates of `n` presses is a share of `1 / sqrt(4 n)`, and that parameters are chosen by presses left out makes a
    /// few of them of noise.
    pub fn is_no_better_than_middle(&self) -> bool {
        let by_chance = BY_CHANCE / (4.0 * self.presses() as f64).sqrt();
        self.middle_m.is_some_and(|middle_m| self.left_out_m() > middle_m * (1.0 - by_chance))
    }

    /// The same for the strength, as a share of it.
    pub fn left_out_strength(&self) -> Option<f64> {
        self.strengths.as_ref().map(|(_, strengths)| strengths.left_out[0])
    }

    /// The press that readings tell of (V, less those at rest); `None` if they are smaller than any that was taught.
    ///
    /// # Errors
    /// The first channel that is not finite, or `None` if there are not as many as were taught.
    pub fn press(&self, readings_v: &[f64]) -> Result<Option<Press>, Option<usize>> {
        if readings_v.len() != self.channels() {
            return Err(None);
        }
        if let Some(channel) = readings_v.iter().position(|volts| !volts.is_finite()) {
            return Err(Some(channel));
        }
        let described = self.features.describe(readings_v);
        let [smallest_v, largest_v] = self.limits.sizes_v;
        if described.size_v < smallest_v / SIZES_BEYOND {
            return Ok(None);
        }
        let (log_size, class) = (described.size_v.ln(), self.classes.class(described.size_v));
        let [for_places, for_strengths] = self.squares(&described);
        let is_outside = described.size_v > largest_v * SIZES_BEYOND
            || self.left_over.is_new(&self.features, &described, class)
            || self.novelty.is_new(&self.points, &for_places, log_size, class);
        let found_m = self.places.values(&self.points, &for_places, log_size);
        let place_m = [0, 1, 2].map(|axis| held(found_m[axis], self.limits.places_m[axis]));
        let strength = self.strengths.as_ref().map(|(_, strengths)| {
            let share = strengths.values(&self.points, &for_strengths, log_size)[0];
            held(share, self.limits.shares).exp() * described.size_v.min(largest_v * SIZES_BEYOND)
        });
        Ok(Some(Press { place_m, strength, is_outside }))
    }

    /// Squares of the distances to all presses, for their places and for their strengths.
    fn squares(&self, described: &Described) -> [Vec<f64>; 2] {
        let for_places = self.places.likeness.components;
        let Some((_, strengths)) = &self.strengths else {
            return self.points.squares_to(&described.coordinates, for_places, 0);
        };
        let for_strengths = strengths.likeness.components;
        let [few, many] = [for_places.min(for_strengths), for_places.max(for_strengths)];
        let [of_few, of_many] = self.points.squares_to(&described.coordinates, few, many);
        if for_places == few { [of_few, of_many] } else { [of_many, of_few] }
    }
}

/// Presses as one description has them.
struct Told {
    features: Features,
    described: Vec<Described>,
    points: Points,
}

impl Told {
    /// `None` if they are all alike.
    fn of(presses: &Presses, description: Description) -> Option<Self> {
        let (features, described) = Features::of(presses, description)?;
        let points = Points::of(&features, &described);
        Some(Self { features, described, points })
    }

    fn places<'a>(&'a self, places_m: &'a [f64], presses: &'a [usize]) -> Lesson<'a> {
        let size_weight = match (self.features.description, self.features.drive_v) {
            (Description::Directions, None) => SIZE_FOR_PLACE,
            _ => 0.0,
        };
        Lesson { points: &self.points, targets: places_m, count: 3, size_weight, presses }
    }

    fn strengths<'a>(&'a self, shares: &'a [f64], presses: &'a [usize]) -> Lesson<'a> {
        let size_weight = match self.features.description {
            Description::Directions => SIZE_FOR_STRENGTH,
            Description::Channels => 0.0,
        };
        Lesson { points: &self.points, targets: shares, count: 1, size_weight, presses }
    }
}

/// Logarithms of strengths over sizes; none where strengths were not measured.
fn shares(presses: &Presses, points: &Points) -> Vec<f64> {
    presses.strengths.iter().zip(&points.log_sizes).map(|(strength, log_size)| strength.ln() - log_size).collect()
}

/// How far each place is from the mean of the others, in the root of the mean square (m).
fn middle_m(places_m: &[[f64; 3]]) -> f64 {
    let count = places_m.len() as f64;
    let mean_m = [0, 1, 2].map(|axis| places_m.iter().map(|place_m| place_m[axis]).sum::<f64>() / count);
    let square = |place_m: &[f64; 3]| (0..3).map(|axis| (place_m[axis] - mean_m[axis]).powi(2)).sum::<f64>();
    let mean_square = places_m.iter().map(square).sum::<f64>() / count;
    mean_square.sqrt() * count / (count - 1.0).max(1.0)
}

fn held(value: f64, [low, high]: [f64; 2]) -> f64 {
    value.clamp(low, high)
}

/// Smallest and largest; zeros of nothing.
fn range(values: impl Iterator<Item = f64>) -> [f64; 2] {
    let bounds = |bounds: Option<[f64; 2]>, value: f64| {
        bounds.map_or(Some([value; 2]), |[low, high]| Some([low.min(value), high.max(value)]))
    };
    values.fold(None, bounds).unwrap_or_default()
}

impl Press {
    /// As a solution: a contact, with the force, the depth or the conductance that was taught.
    pub fn solution(&self, strength: Option<Strength>) -> Solution {
        let [x_m, y_m, z_m] = self.place_m;
        let mut contact = FoundContact::flat(x_m, y_m, 0.0);
        match strength {
            Some(Strength::Conductance) => contact.conductance_s = self.strength.unwrap_or_default(),
            Some(Strength::Force) => contact.force_n = self.strength,
            Some(Strength::Depth) => contact.depth_m = self.strength,
            None => {}
        }
        Solution {
            contacts: vec![FoundContact { z_m, ..contact }],
            flags: Flags { misfit: self.is_outside, ..Flags::default() },
            ..Solution::default()
        }
    }
}

#[cfg(test)]
mod tests;
