//! A kernel in a file: what it writes to a container, and what it reads of one that nobody vouches for.

use super::classes::Classes;
use super::features::{Description, Features};
use super::left_over::LeftOver;
use super::novelty::Novelty;
use super::points::{Likeness, Points};
use super::regression::Regression;
use super::{Kernel, Limits, Strength};
use crate::learned::{Container, ContainerError, VERSION, wrong};

/// Most channels, presses and classes of a file: more than any that fits into one.
const MOST: usize = 1 << 24;

impl Kernel {
    /// What its files say they are.
    pub const KIND: &str = "kernel";
    /// Version of their layout.
    pub const VERSION: &str = "2";
    /// The version before, which is read too: its readings are described by directions, and it does not say so.
    pub const BEFORE: &str = "1";

    /// Writes it.
    pub fn to_container(&self, to: &mut Container) {
        let (channels, rows) = (self.channels(), self.points.count());
        let names = serde_json::Value::from(self.names.clone());
        to.set_text("channels", names.to_string());
        if let Some(drive_v) = self.features.drive_v {
            to.set_text("drive_v", drive_v.to_string());
        }
        to.set_text("description", self.features.description.name());
        to.set_array("mean", &[channels], &self.features.mean);
        to.set_array("scale", &[channels], &self.features.scale);
        to.set_array("axes", &[self.features.dimensions(), channels], &self.features.axes);
        to.set_array("coordinates", &[rows, self.points.dimensions], &self.points.coordinates);
        to.set_array("log_sizes", &[rows], &self.points.log_sizes);
        to.set_text("presses", self.presses.to_string());
        write_regression(to, "place", &self.places);
        if let Some(middle_m) = self.middle_m {
            to.set_text("middle_m", middle_m.to_string());
        }
        if let Some((strength, regression)) = &self.strengths {
            to.set_text("strength", strength.name());
            write_regression(to, "strength", regression);
        }
        let classes = self.classes.count();
        to.set_array("class_smallest_v", &[classes], &self.classes.smallest_v);
        to.set_array("novelty_limits", &[classes], &self.novelty.limits);
        to.set_text("left_over_dimensions", self.left_over.dimensions.to_string());
        to.set_array("left_over_deviations", &[classes, channels], &self.left_over.deviations);
        to.set_array("left_over_lengths", &[classes], &self.left_over.lengths);
        to.set_array("left_over_channels", &[classes], &self.left_over.channels);
        to.set_array("places_m", &[3, 2], &self.limits.places_m.concat());
        to.set_array("shares", &[2], &self.limits.shares);
        to.set_array("sizes_v", &[2], &self.limits.sizes_v);
    }

    /// Reads it; everything is checked.
    ///
    /// # Errors
    /// [`ContainerError`], which names the text or array that is missing or cannot be right.
    pub fn from_container(from: &Container) -> Result<Self, ContainerError> {
        let names: Vec<String> =
            serde_json::from_str(from.text("channels")?).map_err(|_| wrong("channels", "a list of names"))?;
        let features = features(from)?;
        let channels = features.mean.len();
        if !names.is_empty() && names.len() != channels {
            return Err(wrong("channels", &format!("a name for each of {channels} channels")));
        }
        let points = points(from, &features)?;
        let places = read_regression(from, "place", &points, 3)?;
        let strengths = match from.has_text("strength") {
            true => Some((strength(from)?, read_regression(from, "strength", &points, 1)?)),
            false => None,
        };
        let [classes] = from.shape("class_smallest_v")?;
        let smallest_v = from.array("class_smallest_v", &[classes])?.to_vec();
        if classes == 0 || !smallest_v.is_sorted() {
            return Err(wrong("class_smallest_v", "a rising size for each of some classes"));
        }
        let limits = from.array("novelty_limits", &[classes])?.to_vec();
        Ok(Self {
            names,
            novelty: Novelty::with_limits(&places, &points, limits),
            left_over: left_over(from, &features, classes)?,
            classes: Classes { smallest_v },
            limits: self::limits(from)?,
            middle_m: match from.has_text("middle_m") {
                true => Some(from.number("middle_m", |metres| metres >= 0.0, "a distance of 0 or more")?),
                false => None,
            },
            // Files of before count rows.
            presses: match from.has_text("presses") {
                true => from.number("presses", |presses| presses >= 1.0, "a number of presses")? as usize,
                false => points.count(),
            },
            features,
            points,
            places,
            strengths,
        })
    }
}

fn features(from: &Container) -> Result<Features, ContainerError> {
    let [dimensions, channels] = from.shape("axes")?;
    if channels == 0 || channels > MOST || dimensions == 0 {
        return Err(wrong("axes", "a dimension and a channel at least"));
    }
    let drive_v = match from.has_text("drive_v") {
        true => Some(from.number("drive_v", |volts| volts > 0.0, "a voltage above zero")?),
        false => None,
    };
    if drive_v.is_some() && channels.isqrt().pow(2) != channels {
        return Err(wrong("drive_v", "a detector, which has as many readings as the square of its electrodes,"));
    }
    let description = description(from)?;
    let scale = match description {
        None => vec![1.0; channels],
        Some(_) => from.checked("scale", &[channels], |scale| scale > 0.0, "a scale above zero")?.to_vec(),
    };
    Ok(Features {
        description: description.unwrap_or(Description::Directions),
        drive_v,
        mean: from.array("mean", &[channels])?.to_vec(),
        scale,
        axes: from.array("axes", &[dimensions, channels])?.to_vec(),
    })
}

/// `None` in a file of the version before.
fn description(from: &Container) -> Result<Option<Description>, ContainerError> {
    if from.text(VERSION)? == Kernel::BEFORE {
        return Ok(None);
    }
    let name = from.text("description")?;
    let description = Description::ALL.into_iter().find(|description| description.name() == name);
    description.map(Some).ok_or_else(|| wrong("description", "directions or channels"))
}

fn points(from: &Container, features: &Features) -> Result<Points, ContainerError> {
    let [presses, dimensions] = from.shape("coordinates")?;
    if presses == 0 || presses > MOST || dimensions == 0 || dimensions > features.dimensions() {
        return Err(wrong("coordinates", "presses in no more dimensions than there are axes"));
    }
    let coordinates = from.array("coordinates", &[presses, dimensions])?.to_vec();
    let log_sizes = from.array("log_sizes", &[presses])?.to_vec();
    Ok(Points::new(features.description, dimensions, coordinates, log_sizes))
}

fn strength(from: &Container) -> Result<Strength, ContainerError> {
    let name = from.text("strength")?;
    let strength = Strength::ALL.into_iter().find(|strength| strength.name() == name);
    strength.ok_or_else(|| wrong("strength", "force_n, depth_m or conductance_s"))
}

fn write_regression(to: &mut Container, name: &str, regression: &Regression) {
    let targets = regression.means.len();
    to.set_text(&format!("{name}_components"), regression.likeness.components.to_string());
    to.set_text(&format!("{name}_size_weight"), regression.likeness.size_weight.to_string());
    to.set_text(&format!("{name}_width"), regression.likeness.width.to_string());
    to.set_text(&format!("{name}_ridge"), regression.ridge.to_string());
    to.set_array(&format!("{name}_means"), &[targets], &regression.means);
    to.set_array(&format!("{name}_weights"), &[regression.weights.len() / targets, targets], &regression.weights);
    to.set_array(&format!("{name}_left_out"), &[targets], &regression.left_out);
}

fn read_regression(
    from: &Container,
    name: &str,
    points: &Points,
    targets: usize,
) -> Result<Regression, ContainerError> {
    let likeness = Likeness {
        components: from.count(&format!("{name}_components"), points.dimensions)?,
        size_weight: from.number(&format!("{name}_size_weight"), |weight| weight >= 0.0, "a weight of 0 or more")?,
        width: from.number(&format!("{name}_width"), |width| width > 0.0, "a width above zero")?,
    };
    Ok(Regression {
        likeness,
        ridge: from.number(&format!("{name}_ridge"), |ridge| ridge >= 0.0, "a ridge of 0 or more")?,
        means: from.array(&format!("{name}_means"), &[targets])?.to_vec(),
        weights: from.array(&format!("{name}_weights"), &[points.count(), targets])?.to_vec(),
        left_out: from
            .checked(&format!("{name}_left_out"), &[targets], |error| error >= 0.0, "no negative error")?
            .to_vec(),
    })
}

fn left_over(from: &Container, features: &Features, classes: usize) -> Result<LeftOver, ContainerError> {
    let deviations = from.checked(
        "left_over_deviations",
        &[classes, features.mean.len()],
        |deviation| deviation > 0.0,
        "a deviation above zero",
    )?;
    Ok(LeftOver {
        dimensions: from.count("left_over_dimensions", features.dimensions())?,
        deviations: deviations.to_vec(),
        lengths: from.array("left_over_lengths", &[classes])?.to_vec(),
        channels: from.array("left_over_channels", &[classes])?.to_vec(),
    })
}

fn limits(from: &Container) -> Result<Limits, ContainerError> {
    let range = |name: &str, shape: &[usize], at: usize| {
        let values = from.array(name, shape)?;
        let range = [values[2 * at], values[2 * at + 1]];
        if range[0] <= range[1] { Ok(range) } else { Err(wrong(name, "a smallest and a largest value")) }
    };
    let place_m = |axis: usize| range("places_m", &[3, 2], axis);
    let sizes_v = range("sizes_v", &[2], 0)?;
    if sizes_v[0] <= 0.0 {
        return Err(wrong("sizes_v", "a size above zero"));
    }
    Ok(Limits { places_m: [place_m(0)?, place_m(1)?, place_m(2)?], shares: range("shares", &[2], 0)?, sizes_v })
}
