//! What a candidate gives of each wish, and how well that meets them.

use std::sync::Arc;

use tactomo_physics::detector::Detector;
use tactomo_physics::forward::{ForwardModel, Nuisance, Resolution, Slab};
use tactomo_physics::hertz::{Beyond, Hertz};
use tactomo_study::Errors;

use super::super::limit::{hardest, lightest_found, places_everywhere, two_points_m};
use super::super::{DesignError, Press};
use super::{Wish, Wishes};

/// Places whose median error is that of places.
const PLACES: usize = 24;
/// A wish that is met by more than this factor is met: more brings nothing, but for places.
const ENOUGH: f64 = 2.0;
/// What all wishes together count beside the one that is missed most.
const TOGETHER: f64 = 0.02;
/// What places count besides, however good they are: places that are twice as good make up for 7 % of what is missed.
const PLACES_COUNT: f64 = 0.1;
/// What a wish counts that is not met at all, as a logarithm.
const NOT_AT_ALL: f64 = -20.0;

/// What a detector gives of each wish.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Rating {
    /// Smallest force that `auto` finds a contact of, in half of the frames and at half of all places (N); `None` if it finds none.
    pub smallest_n: Option<f64>,
    /// Force from which on it saturates (N); `None` if it does at no force that was tried.
    pub largest_n: Option<f64>,
    /// Error of places (m): half of presses all over the surface are told better.
    pub place_m: Option<f64>,
    /// Two points that noise and tolerances allow to be told apart (m): a bound, from which `auto` is farther the less its evidence for two is. `None` if
    /// they are not at half the shorter side.
    pub two_points_m: Option<f64>,
    /// On the board that was named.
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
    /// Of a detector as it is described, on a coarse model: for a search. Against the standard one, forces and two points are right to
    /// 5 %, and so are places but for thin layers on wide electrodes, right above which they are not resolved. No tolerances are in it, so what it gives
    /// is what the detector gives at best.
    ///
    /// # Errors
    /// [`DesignError`] if there is no model of it.
    pub fn roughly(detector: &Detector, wishes: &Wishes) -> Result<Self, DesignError> {
        Self::at(&Slab::with_resolution(&detector.taken_as_exact(), Resolution::COARSE)?, None, wishes)
    }

    /// Of a detector as it is built within its tolerances, and read by some chip of its board.
    ///
    /// # Errors
    /// [`DesignError`] if there is no model of it.
    pub fn of(detector: &Detector, wishes: &Wishes) -> Result<Self, DesignError> {
        let slab: Arc<dyn ForwardModel> = Arc::new(Slab::new(detector)?);
        // Candidates are rated side by side.
        let nuisance = Nuisance::new(&slab, detector, 1)?;
        Self::at(&*slab, nuisance.as_ref(), wishes)
    }

    fn at(model: &dyn ForwardModel, nuisance: Option<&Nuisance>, wishes: &Wishes) -> Result<Self, DesignError> {
        let detector = model.detector();
        let noise = Errors::of_noise(detector, detector.adc.deviation_v());
        let errors = Errors { nuisance, ..noise.clone() };
        let hertz = hertz(detector)?;
        let press = Press::Ball { radius_m: wishes.tip_m, hertz };
        let middle_n = wishes.middle_n();
        let largest_n = hardest(model, &press, [wishes.smallest_n, wishes.largest_n])?;
        let forces_n = [wishes.smallest_n, largest_n.unwrap_or(f64::INFINITY).min(wishes.largest_n)];
        // Whether there is anything is told from noise, whatever the detector is.
        let smallest_n = lightest_found(model, &press, forces_n, &noise, PLACES)?;
        Ok(Self {
            smallest_n,
            largest_n,
            place_m: places_everywhere(model, &press, middle_n, &errors, PLACES)?.map(|spread| spread.median_error_m),
            two_points_m: two_points_m(model, &press, middle_n, &errors)?,
            frames_per_s: wishes.board.frames_per_s(detector.electrodes.len()),
            drive_v: detector.drive_v,
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

    /// Margin of the wish that is met worst, of all or of all but one.
    pub fn worst(&self, wishes: &Wishes, but: Option<Wish>) -> f64 {
        let counting = Wish::ALL.into_iter().filter(|wish| Some(*wish) != but);
        counting.map(|wish| self.margin(wish, wishes)).fold(f64::INFINITY, f64::min)
    }

    /// Whether it meets all wishes, or all but one.
    pub fn meets(&self, wishes: &Wishes, but: Option<Wish>) -> bool {
        self.worst(wishes, but) >= 0.0
    }

    /// How well it meets the wishes: by how much the one is missed that is missed most, a little of the margins of all, and among those that are alike in this,
    /// places.
    pub fn score(&self, wishes: &Wishes) -> f64 {
        let margins = Wish::ALL.map(|wish| self.margin(wish, wishes).min(ENOUGH.ln()));
        let missed = self.worst(wishes, None).min(0.0);
        missed + TOGETHER * margins.into_iter().sum::<f64>() + PLACES_COUNT * self.margin(Wish::Place, wishes)
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
pub(crate) fn hertz(detector: &Detector) -> Result<Hertz, DesignError> {
    let skin = detector.skin.ok_or_else(|| DesignError::Softness { detector: detector.name.clone() })?;
    Ok(Hertz::new(detector, skin)?)
}

#[cfg(test)]
mod tests {
    use tactomo_physics::detector::ConverterErrors;

    use super::super::wishes::tests::wishes;
    use super::*;

    fn rating() -> Rating {
        Rating::of(&Detector::default().taken_as_exact(), &wishes()).unwrap()
    }

    #[test]
    fn the_default_detector_is_rated_as_elsewhere() {
        let rating = rating();
        assert!((rating.largest_n.unwrap() - 9.9).abs() < 0.1, "{rating:?}");
        assert!(rating.smallest_n.unwrap() < 0.1 && rating.place_m.unwrap() < 1e-3, "{rating:?}");
        assert_eq!(rating.frames_per_s, 400.0);
        assert!(rating.meets(&wishes(), None));
        assert_eq!(rating.tightest(&wishes()), Wish::TwoPoints);
    }

    #[test]
    fn tolerances_a_floor_and_little_drive_each_cost_something() {
        let exact = Detector::default().taken_as_exact();
        let of = |detector: &Detector| Rating::of(detector, &wishes()).unwrap();
        // What is not told at all is told worse than anything.
        let apart_m = |rating: &Rating| rating.two_points_m.unwrap_or(f64::INFINITY);
        let place_m = |rating: &Rating| rating.place_m.unwrap_or(f64::INFINITY);
        let (best, built) = (of(&exact), of(&Detector::default()));
        assert!(place_m(&built) > place_m(&best) && apart_m(&built) > apart_m(&best), "{best:?} {built:?}");
        assert_eq!((built.largest_n, built.smallest_n), (best.largest_n, best.smallest_n));
        let converter = ConverterErrors { gain_share: 0.0, bow_v: 0.0, range_v: [0.142, 3.1] };
        let floor = of(&Detector { converters: vec![converter], ..exact.clone() });
        // Readings that were nearly nothing are lost, and so are light presses.
        assert!(floor.smallest_n > best.smallest_n && place_m(&floor) > place_m(&best), "{best:?} {floor:?}");
        let half = of(&Detector { drive_v: exact.drive_v / 2.0, ..exact });
        assert!(place_m(&half) > place_m(&best) && half.largest_n == best.largest_n, "{best:?} {half:?}");
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
