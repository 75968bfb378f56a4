//! Image and contacts by a network that was trained on simulated detectors as they are built: no detector of its own is needed to be known.
//!
//! [Features](features) of a frame go through three hidden layers to an image, a map of contacts, their number and the total conductance, by
//! plain loops. A further head gives the features back: where it cannot, the network never saw the like, and says so. `tools/train_network.py`
//! trains it; [`Network::from_bytes`] reads what that writes.

mod dense;
mod features;
mod file;
mod grid;
mod peaks;

use std::sync::Arc;

use self::dense::Dense;
use self::features::Features;
pub use self::file::NetworkError;
use self::grid::{Grid, Spread};
use super::linear::full_v;
use super::locate::Locator;
use super::{Flags, FoundContact, Problem, Solution, SolveError, Solver};
use tactomo_physics::detector::Detector;
use tactomo_physics::readings::Readings;

/// The network for `square-60`, trained as `docs/solvers.md` says.
const SQUARE_60: &[u8] = include_bytes!("square-60.safetensors");

/// How far a detector's sides and electrodes may be from those trained for, as a share of its shorter side: ten tolerances of an electrode's
/// place on 60 mm.
const PLACES_SHARE: f64 = 0.05;
/// How far its thickness may be, as a factor: four tolerances.
const THICKNESS_FACTOR: f64 = 1.4;
/// What has less than this share of the conductance is no contact: of pairs of like contacts on detectors as built the count is right in 71 %
/// with it, and in 56 % without. What it leaves out of three is a hundredth of the others.
const LEAST_SHARE: f64 = 0.01;
/// Sizes of readings that were seen go so far beyond those that limits are told for, as a logarithm.
const SIZES_BEYOND: f32 = 0.7;
/// Logarithms of total conductances in sheet conductances, which are held between these: no scene that was trained with is outside.
const TOTALS: [f32; 2] = [-7.0, 4.0];

/// A trained network.
#[derive(Clone, Debug, PartialEq)]
pub struct Network {
    detector: String,
    electrodes_m: Vec<[f64; 2]>,
    size_m: [f64; 2],
    thickness_m: f64,
    features: Features,
    hidden: Vec<Dense>,
    image: Dense,
    map: Dense,
    count: Dense,
    total: Dense,
    echo: Dense,
    /// Logarithms of sizes of readings, rising, and the largest errors of the echo of what was seen.
    seen: Vec<[f32; 2]>,
}

impl Network {
    /// What `tactomo` is in the metadata of its file.
    pub(crate) const KIND: &str = "network";

    /// Reads a network as `tools/train_network.py` writes it: `safetensors`, with `tactomo: network` in its metadata. Nothing in it is trusted.
    ///
    /// # Errors
    /// [`NetworkError`], which names the tensor or the field.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, NetworkError> {
        file::read(bytes)
    }

    /// The one that comes with the program.
    ///
    /// # Errors
    /// [`NetworkError`] if it is damaged.
    pub fn shipped() -> Result<Self, NetworkError> {
        Self::from_bytes(SQUARE_60)
    }

    /// Electrodes of the detector that it was trained for.
    pub fn electrodes(&self) -> usize {
        self.electrodes_m.len()
    }

    /// Name of the detector that it was trained for.
    pub fn detector(&self) -> &str {
        &self.detector
    }

    /// Checks that it was trained for detectors like this one.
    ///
    /// # Errors
    /// [`NetworkError::Detector`], which says what differs.
    pub fn check(&self, detector: &Detector) -> Result<(), NetworkError> {
        let other = |what| {
            Err(NetworkError::Detector { trained: self.detector.clone(), detector: detector.name.clone(), what })
        };
        if detector.electrodes.len() != self.electrodes_m.len() {
            return other(format!("it has {} electrodes, not {}", detector.electrodes.len(), self.electrodes_m.len()));
        }
        if detector.surface.is_some() {
            return other("it is curved".to_owned());
        }
        let within_m = PLACES_SHARE * self.size_m[0].min(self.size_m[1]);
        let size_m = detector.outline.size_m();
        if detector.outline.as_rectangle().is_none()
            || (0..2).any(|axis| (size_m[axis] - self.size_m[axis]).abs() > within_m)
        {
            let [width_mm, height_mm] = self.size_m.map(|side_m| 1e3 * side_m);
            return other(format!("it is no rectangle of {width_mm:.1} mm x {height_mm:.1} mm"));
        }
        let is_apart = |(pad, [x_m, y_m]): (&tactomo_physics::detector::Electrode, &[f64; 2])| {
            (pad.x_m - x_m).hypot(pad.y_m - y_m) > within_m
        };
        if let Some(electrode) = detector.electrodes.iter().zip(&self.electrodes_m).position(is_apart) {
            return other(format!("electrode {electrode} is elsewhere"));
        }
        if (detector.thickness_m() / self.thickness_m).ln().abs() > THICKNESS_FACTOR.ln() {
            return other(format!(
                "it is {:.1} mm thick, not {:.1} mm",
                1e3 * detector.thickness_m(),
                1e3 * self.thickness_m
            ));
        }
        Ok(())
    }

    /// Whether features of such a size (logarithm), which the echo misses by so much, are like those that were seen.
    fn was_seen(&self, log_size: f32, echo_error: f32) -> bool {
        let (Some([first, _]), Some([last, _])) = (self.seen.first(), self.seen.last()) else { return false };
        if !(first - SIZES_BEYOND..=last + SIZES_BEYOND).contains(&log_size) {
            return false;
        }
        let at = log_size.clamp(*first, *last);
        let after = self.seen.partition_point(|[size, _]| *size < at).clamp(1, self.seen.len() - 1);
        let ([from, low], [to, high]) = (self.seen[after - 1], self.seen[after]);
        echo_error <= low + (high - low) * (at - from) / (to - from)
    }
}

/// What the layers of a network give for a frame; kept from frame to frame, so that none allocates them.
#[derive(Clone, Debug, Default)]
struct Outputs {
    features: Vec<f32>,
    hidden: [Vec<f32>; 2],
    image: Vec<f32>,
    map: Vec<f32>,
    count: Vec<f32>,
    total: Vec<f32>,
    echo: Vec<f32>,
}

impl Network {
    fn run(&self, outputs: &mut Outputs) {
        let [from, to] = &mut outputs.hidden;
        from.clone_from(&outputs.features);
        for layer in &self.hidden {
            layer.apply(from, to);
            to.iter_mut().for_each(|value| *value = value.max(0.0));
            std::mem::swap(from, to);
        }
        self.image.apply(from, &mut outputs.image);
        self.map.apply(from, &mut outputs.map);
        self.count.apply(from, &mut outputs.count);
        self.total.apply(from, &mut outputs.total);
        self.echo.apply(from, &mut outputs.echo);
    }
}

/// `network`: a network, on the image of a problem.
pub struct NetworkSolver {
    network: Arc<Network>,
    electrodes: usize,
    drive_v: f64,
    full_v: f64,
    sheet_s: f64,
    grid: Grid,
    /// From the grid to the problem's image.
    spread: Spread,
    locator: Locator,
    outputs: Outputs,
}

impl NetworkSolver {
    /// Runs a network on a detector.
    ///
    /// # Errors
    /// [`NetworkError::Detector`] if it was trained for another one.
    pub fn new(problem: &Problem, network: Arc<Network>) -> Result<Self, NetworkError> {
        let detector = problem.detector();
        network.check(detector)?;
        let grid = Grid::new(network.image.outputs(), network.size_m);
        Ok(Self {
            electrodes: detector.electrodes.len(),
            drive_v: detector.drive_v,
            full_v: full_v(detector),
            sheet_s: detector.sheet_conductance_s(),
            spread: Spread::new(&grid, &problem.jacobian.image_mesh.nodes_m),
            locator: Locator::new(&problem.jacobian.image_mesh, detector),
            grid,
            network,
            outputs: Outputs::default(),
        })
    }

    fn flags(&self, readings: &Readings, log_size: f32) -> Flags {
        let errors = self.outputs.features.iter().zip(&self.outputs.echo).map(|(is, echoed)| (is - echoed).powi(2));
        let echo_error = (errors.sum::<f32>() / self.outputs.echo.len() as f32).sqrt();
        let is_beyond = readings.volts().iter().any(|volts| volts.abs() > self.drive_v);
        Flags {
            saturated: readings.largest_v() >= self.full_v,
            misfit: is_beyond || !self.network.was_seen(log_size, echo_error),
            ..Flags::default()
        }
    }

    /// Contacts at the highest peaks of the map, each with the conductance (S) of the part of the grid's image that is nearest to it.
    fn contacts(&self, count: usize, image_s_per_m2: &[f32]) -> Vec<FoundContact> {
        let places_m = peaks::places_m(&self.grid, &self.outputs.map, count);
        let conductances_s = self.grid.conductances_s(image_s_per_m2, &places_m);
        let least_s = LEAST_SHARE * conductances_s.iter().sum::<f64>();
        let contact = |([x_m, y_m], conductance_s): (&[f64; 2], f64)| {
            (conductance_s >= least_s).then(|| FoundContact::flat(*x_m, *y_m, conductance_s))
        };
        places_m.iter().zip(conductances_s).filter_map(contact).collect()
    }
}

impl Solver for NetworkSolver {
    fn name(&self) -> &'static str {
        "network"
    }

    fn solve(&mut self, readings: &Readings) -> Result<Solution, SolveError> {
        super::check(readings, self.electrodes)?;
        if self.locator.is_rest(readings) {
            return Ok(Solution::default());
        }
        let log_size = self.network.features.of(readings, self.drive_v, &mut self.outputs.features);
        self.network.run(&mut self.outputs);
        let flags = self.flags(readings, log_size);
        let count = largest(&self.outputs.count);
        let total = self.outputs.total[0].clamp(TOTALS[0], TOTALS[1]);
        let total_s = if count == 0 { 0.0 } else { f64::from(total).exp() * self.sheet_s };
        self.grid.scale(&mut self.outputs.image, total_s);
        // The last class is one shape, which is no contact.
        let is_shape = count + 1 == self.outputs.count.len();
        let contacts = if is_shape { Vec::new() } else { self.contacts(count, &self.outputs.image) };
        Ok(Solution {
            image_s_per_m2: Some(self.spread.image(&self.outputs.image)),
            contacts,
            flags,
            ..Solution::default()
        })
    }
}

/// Which of some numbers is largest.
fn largest(values: &[f32]) -> usize {
    (0..values.len()).max_by(|a, b| values[*a].total_cmp(&values[*b])).unwrap_or(0)
}

#[cfg(test)]
mod tests;
