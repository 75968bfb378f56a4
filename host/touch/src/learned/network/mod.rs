//! Image and contacts by a network that was trained on simulated detectors as they are built: no detector of its own is needed to be known.
//!
//! [Features](features) of a frame go through three hidden layers to an image, a map of contacts, their number and the total conductance, by
//! plain loops. A further head gives the features back: where it cannot, the network never saw the like, and says so. `tools/train_network.py`
//! trains it; [`Network::from_bytes`] reads what that writes.

mod dense;
mod features;
mod file;

use self::dense::Dense;
use self::features::Features;
pub use self::file::NetworkError;
use tactomo_physics::detector::Detector;

/// The network for `square-60`, trained as `docs/solvers.md` says.
const SQUARE_60: &[u8] = include_bytes!("square-60.safetensors");

/// How far a detector's sides and electrodes may be from those trained for, as a share of its shorter side: ten tolerances of an electrode's
/// place on 60 mm.
const PLACES_SHARE: f64 = 0.05;
/// How far its thickness may be, as a factor: four tolerances.
const THICKNESS_FACTOR: f64 = 1.4;
/// Sizes of readings that were seen go so far beyond those that limits are given for, as a logarithm.
const SIZES_BEYOND: f32 = 0.7;

/// A trained network.
#[derive(Clone, Debug, PartialEq)]
pub struct Network {
    detector: String,
    electrodes_m: Vec<[f64; 2]>,
    pub(crate) size_m: [f64; 2],
    thickness_m: f64,
    pub(crate) features: Features,
    hidden: Vec<Dense>,
    pub(crate) image: Dense,
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
    pub(crate) fn was_seen(&self, log_size: f32, echo_error: f32) -> bool {
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
pub(crate) struct Outputs {
    pub features: Vec<f32>,
    hidden: [Vec<f32>; 2],
    pub image: Vec<f32>,
    pub map: Vec<f32>,
    pub count: Vec<f32>,
    pub total: Vec<f32>,
    pub echo: Vec<f32>,
}

impl Network {
    /// Goes through all layers, from the features in `outputs`.
    pub(crate) fn run(&self, outputs: &mut Outputs) {
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn damaged_files_are_refused_in_words() {
        for end in (0..SQUARE_60.len()).step_by(4999) {
            assert!(Network::from_bytes(&SQUARE_60[..end]).is_err(), "{end}");
        }
        let replaced = |from: &str, to: &str| {
            assert_eq!(from.len(), to.len());
            let at = SQUARE_60.windows(from.len()).position(|part| part == from.as_bytes()).unwrap();
            let bytes = [&SQUARE_60[..at], to.as_bytes(), &SQUARE_60[at + from.len()..]].concat();
            Network::from_bytes(&bytes).unwrap_err().to_string()
        };
        for (from, to, what) in [
            (r#""network""#, r#""netwerk""#, "metadata `tactomo` has to be `network`, not `netwerk`"),
            (r#""version":"1""#, r#""version":"9""#, "metadata `version` has to be `1`, not `9`"),
            ("map.bias", "mop.bias", "tensor `map.bias` is missing"),
            ("[1024]", "[1023]", "no network"),
            ("[273]", "[272]", "no network"),
        ] {
            let error = replaced(from, to);
            assert!(error.contains(what), "{from}: {error}");
        }
    }
}
