//! What a candidate gives of each wish, and how well that meets them.

use tactomo_physics::detector::Detector;
use tactomo_physics::forward::{ForwardModel, Resolution, Slab};
use tactomo_physics::hertz::{Beyond, Hertz};

use super::super::limit::{places_everywhere, range, two_points_m};
use super::super::{DesignError, Press};
use super::{Wish, Wishes};

/// Drive voltages (V). The ESP32's converter is calibrated up to 2.45 V at its widest range; no reading is above the drive.
const DRIVES_V: [f64; 3] = [1.0, 2.0, 2.4];
/// Places that the error of places is the root mean square of.
const PLACES: usize = 24;
/// A wish that is met by more than this factor is met: more brings nothing.
const ENOUGH: f64 = 2.0;
/// What all wishes together count beside the one that is met worst.
const TOGETHER: f64 = 0.02;
/// What a wish counts that is not met at all, as a logarithm.
const NOT_AT_ALL: f64 = -20.0;

/// The ESP32's budget, docs/firmware.md: seconds for a conversion, of which ten of sixteen are one after the other, a ground's settling, and the firmware's work for a
/// frame of 256 conversions; bytes of a coded frame beside the readings, and of a reading; bytes a second at 921 600 baud.
const CONVERSION_S: f64 = 10e-6 * 10.0 / 16.0;
const SETTLE_S: f64 = 20e-6;
const WORK_S: f64 = 0.415e-3 / 256.0;
const FRAME_BYTES: f64 = 18.0;
const BYTES_PER_READING: f64 = 0.75;
const BYTES_PER_S: f64 = 92_160.0;

/// What a detector gives of each wish.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Rating {
    /// Smallest force that is seen (N); `None` if none is.
    pub smallest_n: Option<f64>,
    /// Force from which on it saturates (N); `None` if it does at no force that was tried.
    pub largest_n: Option<f64>,
    /// Error of places (m), root mean square over the surface.
    pub place_m: Option<f64>,
    /// Two points told apart (m); `None` if they are not at half the shorter side.
    pub two_points_m: Option<f64>,
    /// On an ESP32 at 921 600 baud.
    pub frames_per_s: f64,
    /// Drive (V).
    pub drive_v: f64,
    /// How many electrodes.
    pub electrodes: usize,
    /// Of all layers (m).
    pub thickness_m: f64,
    /// The limit of Hertz's theory that the largest force wished for is beyond, if any: then contacts are narrower than it says.
    pub beyond_hertz: Option<Beyond>,
}

impl Rating {
    /// Of a detector, at the highest drive, on a coarse model: for a search. Against the standard one, forces and two points are right to
    /// 5 %, and so are places but for thin layers on wide electrodes, right above which the coarse model tells places two or three times too well.
    ///
    /// # Errors
    /// [`DesignError`] if there is no model of it.
    pub fn roughly(detector: &Detector, wishes: &Wishes) -> Result<Self, DesignError> {
        let slab = Slab::with_resolution(&detector.taken_as_exact(), Resolution::COARSE)?;
        Self::at(&slab, wishes, DRIVES_V[DRIVES_V.len() - 1])
    }

    /// Of a detector, with the drive that meets the wishes best: of equals, the lowest.
    ///
    /// # Errors
    /// [`DesignError`] if there is no model of it.
    pub fn of(detector: &Detector, wishes: &Wishes) -> Result<Self, DesignError> {
        let slab = Slab::new(&detector.taken_as_exact())?;
        let mut best = Self::at(&slab, wishes, DRIVES_V[0])?;
        for drive_v in &DRIVES_V[1..] {
            let other = Self::at(&slab, wishes, *drive_v)?;
            if other.score(wishes) > best.score(wishes) {
                best = other;
            }
        }
        Ok(best)
    }

    /// Of a detector with its own drive.
    ///
    /// # Errors
    /// [`DesignError`] if there is no model of it.
    pub fn as_driven(detector: &Detector, wishes: &Wishes) -> Result<Self, DesignError> {
        let slab = Slab::new(&detector.taken_as_exact())?;
        Self::at(&slab, wishes, detector.drive_v)
    }

    fn at(slab: &Slab, wishes: &Wishes, drive_v: f64) -> Result<Self, DesignError> {
        let detector = slab.detector();
        // All readings are in proportion to the drive.
        let noise_v = detector.adc.deviation_v() * detector.drive_v / drive_v;
        let hertz = hertz(detector)?;
        let press = Press::Ball { radius_m: wishes.tip_m, hertz };
        let middle_n = (wishes.smallest_n * wishes.largest_n).sqrt();
        let [smallest_n, largest_n] = range(slab, &press, [wishes.smallest_n, wishes.largest_n], noise_v)?;
        Ok(Self {
            smallest_n,
            largest_n,
            place_m: places_everywhere(slab, &press, middle_n, noise_v, PLACES)?.map(|spread| spread.rms_m),
            two_points_m: two_points_m(slab, &press, middle_n, noise_v)?,
            frames_per_s: frames_per_s(detector.electrodes.len()),
            drive_v,
            electrodes: detector.electrodes.len(),
            thickness_m: detector.thickness_m(),
            beyond_hertz: hertz.ball(wishes.tip_m, wishes.largest_n).beyond,
        })
    }

    /// What it gives of a wish; `None` if nothing.
    pub fn given(&self, wish: Wish) -> Option<f64> {
        match wish {
            Wish::Smallest => self.smallest_n,
            // Where nothing saturates it, no force is too large.
            Wish::Largest => Some(self.largest_n.unwrap_or(f64::INFINITY)),
            Wish::Place => self.place_m,
            Wish::TwoPoints => self.two_points_m,
            Wish::Frames => Some(self.frames_per_s),
        }
    }

    /// How much better than wished, as the logarithm of a factor; below zero where a wish is not met.
    pub fn margin(&self, wish: Wish, wishes: &Wishes) -> f64 {
        let Some(given) = self.given(wish) else { return NOT_AT_ALL };
        let factor = given / wishes.wanted(wish);
        (if wish.is_less_better() { 1.0 / factor } else { factor }).ln().max(NOT_AT_ALL)
    }

    /// Whether it meets all wishes, or all but one.
    pub fn meets(&self, wishes: &Wishes, but: Option<Wish>) -> bool {
        Wish::ALL.into_iter().filter(|wish| Some(*wish) != but).all(|wish| self.margin(wish, wishes) >= 0.0)
    }

    /// How well it meets the wishes: the margin of the one met worst, and a little of all.
    pub fn score(&self, wishes: &Wishes) -> f64 {
        let margins = Wish::ALL.map(|wish| self.margin(wish, wishes).min(ENOUGH.ln()));
        let worst = margins.into_iter().fold(f64::INFINITY, f64::min);
        worst + TOGETHER * margins.into_iter().sum::<f64>()
    }

    /// The wish that is met worst.
    pub fn tightest(&self, wishes: &Wishes) -> Wish {
        let by_margin = |a: &Wish, b: &Wish| self.margin(*a, wishes).total_cmp(&self.margin(*b, wishes));
        Wish::ALL.into_iter().min_by(by_margin).unwrap_or(Wish::Place)
    }

    /// Whether another is at least as good in every wish and in the number of electrodes, and better in one.
    pub fn is_beaten_by(&self, other: &Self) -> bool {
        let better = |wish: Wish| {
            let [own, others] = [self, other].map(|rating| rating.given(wish));
            match (own, others) {
                (Some(own), Some(others)) if wish.is_less_better() => others.total_cmp(&own).reverse(),
                (Some(own), Some(others)) => others.total_cmp(&own),
                (own, others) => others.is_some().cmp(&own.is_some()),
            }
        };
        let mut orders: Vec<_> = Wish::ALL.map(better).to_vec();
        orders.push(self.electrodes.cmp(&other.electrodes));
        orders.iter().all(|order| order.is_ge()) && orders.iter().any(|order| order.is_gt())
    }
}

/// Mechanics of a detector that says how soft it is.
///
/// # Errors
/// [`DesignError::Softness`] if it does not, or [`DesignError::Skin`].
pub(super) fn hertz(detector: &Detector) -> Result<Hertz, DesignError> {
    let skin = detector.skin.ok_or_else(|| DesignError::Softness { detector: detector.name.clone() })?;
    Ok(Hertz::new(detector, skin)?)
}

/// Frames a second of so many electrodes on an ESP32: what the wire or the converter allows, whichever is less (docs/firmware.md).
pub fn frames_per_s(electrodes: usize) -> f64 {
    let conversions = electrodes.pow(2) as f64;
    let scan_s = conversions * (CONVERSION_S + WORK_S) + electrodes as f64 * SETTLE_S;
    let wire_s = (FRAME_BYTES + BYTES_PER_READING * conversions) / BYTES_PER_S;
    1.0 / scan_s.max(wire_s)
}

#[cfg(test)]
mod tests {
    use super::super::wishes::tests::wishes;
    use super::*;

    fn rating() -> Rating {
        Rating::as_driven(&Detector::default(), &wishes()).unwrap()
    }

    #[test]
    fn the_default_detector_is_rated_as_elsewhere() {
        let rating = rating();
        assert!((rating.largest_n.unwrap() - 9.9).abs() < 0.1, "{rating:?}");
        assert!(rating.smallest_n.unwrap() < 0.1 && rating.place_m.unwrap() < 1e-3, "{rating:?}");
        // docs/firmware.md: 428 frames/s.
        assert!((rating.frames_per_s - 428.0).abs() < 1.0, "{}", rating.frames_per_s);
        assert!(rating.meets(&wishes(), None));
        assert_eq!(rating.tightest(&wishes()), Wish::TwoPoints);
    }

    #[test]
    fn more_drive_is_better_as_the_square_root_of_nothing_but_noise() {
        let of = |drive_v: f64| {
            let detector = Detector { drive_v, ..Detector::default() };
            Rating::as_driven(&detector, &wishes()).unwrap()
        };
        let slab = Slab::new(&Detector::default()).unwrap();
        let [scaled, direct] = [Rating::at(&slab, &wishes(), 1.0).unwrap(), of(1.0)];
        assert!((scaled.place_m.unwrap() / direct.place_m.unwrap() - 1.0).abs() < 1e-6);
        assert!(of(2.0).place_m < direct.place_m && of(2.0).largest_n == direct.largest_n);
    }

    #[test]
    fn a_rating_is_beaten_by_what_is_nowhere_worse() {
        let own = rating();
        assert!(!own.is_beaten_by(&own));
        let finer = Rating { place_m: own.place_m.map(|m| m / 2.0), ..own };
        assert!(own.is_beaten_by(&finer) && !finer.is_beaten_by(&own));
        let traded = Rating { two_points_m: None, ..finer };
        assert!(!own.is_beaten_by(&traded) && !traded.is_beaten_by(&own));
        assert!(own.is_beaten_by(&Rating { electrodes: 9, ..own }));
        assert!(own.is_beaten_by(&Rating { largest_n: None, ..own }), "never saturating is better");
        assert!(finer.score(&wishes()) >= own.score(&wishes()));
    }
}
