//! What a detector itself can tell, whatever the solver: how well any method can do with its readings.
//!
//! Standard errors are Cramer and Rao's bounds of one frame under the converter's noise, [`cramer_rao`]; the range of strengths runs from
//! where noise hides a contact to where the contact is at nine tenths of the drive, eq. (4). The radius of a contact is known to a factor of two only.

use std::f64::consts::FRAC_PI_2;

use tactomo_physics::detector::Detector;
use tactomo_physics::forward::{ForwardError, ForwardModel, readings_v};
use tactomo_physics::geometry::Point;
use tactomo_physics::scene::Contact;
use tactomo_study::{Bound, Errors, cramer_rao};
use tactomo_touch::solve::contact_over_needed;

use super::press::{MIDDLE, Press, nine_places};

/// A contact is seen if its conductance is so many standard errors from nothing.
const SEEN_DEVIATIONS: f64 = 3.0;
/// Two contacts are told apart if they are so many standard errors of each place apart: then the places' intervals of two standard
/// errors on either side do not meet.
const APART_DEVIATIONS: f64 = 4.0;
/// Radius of two contacts that are pressed side by side, as a share of their distance, at most.
const RADIUS_OF_DISTANCE: f64 = 0.4;
/// Distances that are tried for two contacts, as shares of the detector's shorter side.
const DISTANCES: [f64; 2] = [1e-3, 0.5];
/// Steps from one place to the next as shares of the sides, which fill a square evenly: powers of the plastic number (Roberts, "The unreasonable
/// effectiveness of quasirandom sequences", 2018). Right above an electrode a place is told worse, and places in rows would meet or miss just those.
const STEPS: [f64; 2] = [0.754_877_666, 0.569_840_291];
/// Share of each side that is left free at each edge.
const MARGIN: f64 = 0.05;
/// Directions of a quarter of an ellipse of errors that are averaged over: of one ten times as long as wide, the share of errors is right to 1 %.
const ANGLES: usize = 16;
/// Halvings of a range in its logarithm: of five decades to 0.2 %.
const DISTANCE_HALVINGS: usize = 8;
const STRENGTH_HALVINGS: usize = 15;
/// A contact saturates where it is at this share of the drive, eq. (8).
const SATURATED: f64 = 0.9;
/// Strengths below the smallest that is asked about are looked at, as far as this share of it.
const LIGHTEST: f64 = 1e-9;
/// And above the largest, up to so many times it.
const HARDEST: f64 = 1e3;

/// Limits of a detector for presses of one strength at the paper's nine places, and the strengths between which it can tell anything.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Limit {
    /// Largest reading over the standard deviation of one, in the middle (dB).
    pub signal_to_noise_db: f64,
    /// Root mean square over the places of the standard error of a place (m); `None` if the readings do not tell it at one of them.
    pub place_m: Option<f64>,
    /// The largest of them (m).
    pub worst_place_m: Option<f64>,
    /// Standard error of the conductance, as a share of it, in the middle.
    pub conductance: Option<f64>,
    /// Least distance of two such contacts about the middle that can be told apart (m); `None` if they cannot at half the shorter side.
    pub two_points_m: Option<f64>,
    /// Strengths from which on a contact in the middle is seen, and at which it saturates: unit of the press. `None` where
    /// that is beyond all that was looked at.
    pub range: [Option<f64>; 2],
}

impl Limit {
    /// Of a model, for presses of a strength, out of a range of strengths that matter.
    ///
    /// # Errors
    /// [`ForwardError`] if a contact is off the detector.
    pub fn of(
        model: &dyn ForwardModel,
        press: &Press,
        strength: f64,
        strengths: [f64; 2],
    ) -> Result<Self, ForwardError> {
        let detector = model.detector();
        let noise_v = detector.adc.deviation_v();
        let errors = Errors::of_noise(detector, noise_v);
        let bounds = at_nine_places(model, press, strength, &errors)?;
        let largest_v = readings_v(&model.impedance_ohm(&[press.at(MIDDLE, strength)])?, detector).largest_v();
        Ok(Self {
            signal_to_noise_db: 20.0 * (largest_v / noise_v).log10(),
            place_m: bounds.as_deref().map(rms_m),
            worst_place_m: bounds
                .as_ref()
                .map(|bounds| bounds.iter().map(|bound| bound.position_m).fold(0.0, f64::max)),
            conductance: bounds.as_ref().map(|bounds| bounds[4].conductance),
            two_points_m: two_points_m(model, press, strength, &errors)?,
            range: range(model, press, strengths, &errors)?,
        })
    }
}

/// Bounds of a press at each of the nine places; `None` if the readings do not tell one of them.
fn at_nine_places(
    model: &dyn ForwardModel,
    press: &Press,
    strength: f64,
    errors: &Errors<'_>,
) -> Result<Option<Vec<Bound>>, ForwardError> {
    let of = |place: Point| {
        let bound = cramer_rao(model, &[press.at(place, strength)], errors)?;
        Ok(bound.and_then(|bounds| bounds.first().copied()).filter(|bound| bound.position_m.is_finite()))
    };
    nine_places(model.detector()).into_iter().map(of).collect()
}

/// Root mean square of their standard errors (m).
fn rms_m(bounds: &[Bound]) -> f64 {
    (bounds.iter().map(|bound| bound.position_m.powi(2)).sum::<f64>() / bounds.len() as f64).sqrt()
}

/// [`Limit::place_m`] alone.
pub(crate) fn place_m(model: &dyn ForwardModel, press: &Press, strength: f64) -> Result<Option<f64>, ForwardError> {
    let errors = Errors::of_noise(model.detector(), model.detector().adc.deviation_v());
    Ok(at_nine_places(model, press, strength, &errors)?.as_deref().map(rms_m))
}

/// Standard errors of places over a surface.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Spread {
    /// Half of the places are told better (m).
    pub median_m: f64,
    /// Nine tenths are (m).
    pub p90_m: f64,
    /// Root mean square (m): the few worst places rule it.
    pub rms_m: f64,
    /// Half of the errors of presses all over the surface are less (m), by the ellipses of normal errors.
    pub median_error_m: f64,
}

impl Spread {
    /// Of bounds at some places, those that are not told among them; `None` if that is half of them.
    fn of(bounds: &[Option<Bound>]) -> Option<Self> {
        let errors_m = bounds.iter().map(|bound| bound.map_or(f64::INFINITY, |bound| bound.position_m));
        let mut errors_m: Vec<f64> = errors_m.collect();
        errors_m.sort_by(f64::total_cmp);
        let last = errors_m.len().checked_sub(1)? as f64;
        // Between the two nearest ranks, as most programs do.
        let quantile = |share: f64| {
            let (below, rest) = ((share * last).floor() as usize, (share * last).fract());
            errors_m[below] + rest * (errors_m.get(below + 1).unwrap_or(&errors_m[below]) - errors_m[below])
        };
        let squares_m2: Vec<f64> = errors_m.iter().map(|error_m| error_m.powi(2)).collect();
        let rms_m = super::rank::mean(&squares_m2)?.sqrt();
        let all =
            Self { median_m: quantile(0.5), p90_m: quantile(0.9), rms_m, median_error_m: median_error_m(bounds)? };
        Some(all).filter(|all| all.median_m.is_finite())
    }
}

/// Error (m) that half of presses have less than, each at one of some places; `None` if half of the places are not told.
fn median_error_m(bounds: &[Option<Bound>]) -> Option<f64> {
    let told = || bounds.iter().flatten().filter(|bound| bound.axes_m[0].is_finite());
    let largest_m = told().map(|bound| bound.axes_m[0]).fold(0.0, f64::max);
    let is_median = |error_m: f64| {
        let share: f64 = told().map(|bound| share_within(error_m, bound.axes_m)).sum();
        Ok(share >= 0.5 * bounds.len() as f64)
    };
    // Of five decades, to one in ten thousand.
    least([1e-5 * largest_m, 10.0 * largest_m], 20, is_median).ok().flatten()
}

/// Share of normal errors that are less than `error_m`, of such standard deviations along the axes of their ellipse (m): one in a direction that is drawn
/// evenly has the length of a Rayleigh number times that of the ellipse.
fn share_within(error_m: f64, [long_m, short_m]: [f64; 2]) -> f64 {
    let of = |index: usize| {
        let (sin, cos) = ((index as f64 + 0.5) * FRAC_PI_2 / ANGLES as f64).sin_cos();
        -(-0.5 * error_m.powi(2) / ((long_m * cos).powi(2) + (short_m * sin).powi(2))).exp_m1()
    };
    (0..ANGLES).map(of).sum::<f64>() / ANGLES as f64
}

/// Places all over a surface of such sides (m), from the middle (m), without end: the more, the closer.
pub(crate) fn everywhere(sides_m: [f64; 2]) -> impl Iterator<Item = Point> {
    (0..).map(move |index| {
        let share = |axis: usize| (0.5 + STEPS[axis] * f64::from(index)).fract() * (1.0 - 2.0 * MARGIN) + MARGIN - 0.5;
        [0, 1].map(|axis| share(axis) * sides_m[axis])
    })
}

/// Standard errors of a place over so many places all over the surface, without end where it is not told; `None` if that is at half of them.
///
/// # Errors
/// [`ForwardError`] if the model cannot have the contact.
pub fn places_everywhere(
    model: &dyn ForwardModel,
    press: &Press,
    strength: f64,
    errors: &Errors<'_>,
    places: usize,
) -> Result<Option<Spread>, ForwardError> {
    let at = everywhere(model.detector().outline.size_m()).take(places);
    let of = |place| Ok(cramer_rao(model, &[press.at(place, strength)], errors)?.map(|bounds| bounds[0]));
    let bounds = at.map(of).collect::<Result<Vec<_>, ForwardError>>()?;
    Ok(Spread::of(&bounds))
}

/// Least distance of two contacts of a strength, side by side about the middle, that can be told apart (m) with readings of such errors.
///
/// # Errors
/// [`ForwardError`] if the contacts are off the detector.
pub fn two_points_m(
    model: &dyn ForwardModel,
    press: &Press,
    strength: f64,
    errors: &Errors<'_>,
) -> Result<Option<f64>, ForwardError> {
    let detector = model.detector();
    let [width_m, height_m] = detector.outline.size_m();
    let side_m = width_m.min(height_m);
    // Along the longer side, where there is room.
    let along: Point = if width_m >= height_m { [1.0, 0.0] } else { [0.0, 1.0] };
    let apart = |distance_m: f64| {
        let pair = [-0.5, 0.5].map(|share| {
            let contact = press.at(along.map(|part| part * share * distance_m), strength);
            Contact { radius_m: contact.radius_m.min(RADIUS_OF_DISTANCE * distance_m), ..contact }
        });
        let bounds = cramer_rao(model, &pair, errors)?.unwrap_or_default();
        // Both coordinates of a place; along the line between them it is at most that.
        let error_m = bounds.iter().map(|bound| bound.position_m).fold(f64::NAN, f64::max);
        Ok::<_, ForwardError>(distance_m >= APART_DEVIATIONS * error_m)
    };
    let [low_m, high_m] = DISTANCES.map(|share| share * side_m);
    least([low_m, high_m], DISTANCE_HALVINGS, apart)
}

/// Strengths from which on a contact in the middle is seen, and at which it saturates: [`Limit::range`].
///
/// # Errors
/// [`ForwardError`] if the model cannot have the contact.
pub fn range(
    model: &dyn ForwardModel,
    press: &Press,
    strengths: [f64; 2],
    errors: &Errors<'_>,
) -> Result<[Option<f64>; 2], ForwardError> {
    let hardest = hardest(model, press, strengths)?;
    // Of a contact that is saturated, the conductance is not told.
    let [low, high] = strengths;
    Ok([lightest(model, press, [low, hardest.map_or(high, |hardest| hardest.min(high))], errors)?, hardest])
}

/// The strength from which on a contact in the middle is seen.
fn lightest(
    model: &dyn ForwardModel,
    press: &Press,
    [low, high]: [f64; 2],
    errors: &Errors<'_>,
) -> Result<Option<f64>, ForwardError> {
    let seen = |strength: f64| {
        let bound = match cramer_rao(model, &[press.at(MIDDLE, strength)], errors) {
            // So light that it conducts nothing in numbers of this size.
            Err(ForwardError::NoContact) => None,
            bound => bound?,
        };
        Ok(bound.is_some_and(|bounds| bounds[0].conductance * SEEN_DEVIATIONS <= 1.0))
    };
    least([LIGHTEST * low, high], STRENGTH_HALVINGS, seen)
}

/// The strength from which on `auto` looks for a contact in half of the frames, at half of so many places all over the surface; `None` if it does not at the end of
/// a range of strengths.
///
/// # Errors
/// [`ForwardError`] if the model cannot have the contact.
pub(crate) fn lightest_found(
    model: &dyn ForwardModel,
    press: &Press,
    [low, high]: [f64; 2],
    errors: &Errors<'_>,
    places: usize,
) -> Result<Option<f64>, ForwardError> {
    let readings = |place: Point, strength: f64| match model.impedance_ohm(&[press.at(place, strength)]) {
        // So light that it conducts nothing in numbers of this size.
        Err(ForwardError::NoContact) => Ok(None),
        impedance_ohm => Ok(Some(readings_v(&impedance_ohm?, errors.measured))),
    };
    // Which places are better than others hardly depends on the strength.
    let mut all = Vec::with_capacity(places);
    for place in everywhere(model.detector().outline.size_m()).take(places) {
        all.push((readings(place, low)?.map_or(0.0, |readings| contact_over_needed(&readings, model)), place));
    }
    all.sort_by(|a, b| a.0.total_cmp(&b.0));
    let Some((_, median)) = all.get(places / 2) else { return Ok(None) };
    let is_found = |strength: f64| {
        let readings = readings(*median, strength)?;
        Ok(readings
            .is_some_and(|readings| contact_over_needed(&errors.bounded(errors.on_average(readings)), model) >= 1.0))
    };
    least([LIGHTEST * low, high], STRENGTH_HALVINGS, is_found)
}

/// The strength at which a contact in the middle saturates.
pub(crate) fn hardest(
    model: &dyn ForwardModel,
    press: &Press,
    [low, high]: [f64; 2],
) -> Result<Option<f64>, ForwardError> {
    at_share_of_drive(model, press, [low, high], SATURATED)
}

/// The strength at which a contact in the middle is at a share of the drive; `None` where that is beyond all that is looked at.
pub(crate) fn at_share_of_drive(
    model: &dyn ForwardModel,
    press: &Press,
    [low, high]: [f64; 2],
    share: f64,
) -> Result<Option<f64>, ForwardError> {
    let is_there = |strength: f64| Ok(of_drive(model, &press.at(MIDDLE, strength))? >= share);
    least([low * LIGHTEST, high * HARDEST], STRENGTH_HALVINGS, is_there)
}

/// Potential of a contact that is alone as a share of the drive, mean over the grounds: eq. (4). All current passes the contact.
pub(crate) fn of_drive(model: &dyn ForwardModel, contact: &Contact) -> Result<f64, ForwardError> {
    let Detector { on_resistance_ohm, electrodes, .. } = model.detector();
    let impedance_ohm = match model.impedance_ohm(std::slice::from_ref(contact)) {
        // So light that it conducts nothing in numbers of this size.
        Err(ForwardError::NoContact) => return Ok(0.0),
        impedance_ohm => impedance_ohm?,
    };
    let lost = |g: usize| 1.0 / (contact.conductance_s * (impedance_ohm[(g, g)] + on_resistance_ohm));
    Ok(1.0 - (0..electrodes.len()).map(lost).sum::<f64>() / electrodes.len() as f64)
}

/// Least value of a range, by halves of its logarithm, from which on something holds; `None` if it does not at the end.
fn least(
    [mut low, mut high]: [f64; 2],
    halvings: usize,
    mut holds: impl FnMut(f64) -> Result<bool, ForwardError>,
) -> Result<Option<f64>, ForwardError> {
    if !holds(high)? {
        return Ok(None);
    }
    for _ in 0..halvings {
        let middle = (low * high).sqrt();
        if holds(middle)? { high = middle } else { low = middle }
    }
    Ok(Some(high))
}

#[cfg(test)]
mod tests {
    use super::*;
    use tactomo_physics::detector::{Adc, Foam};
    use tactomo_physics::forward::Slab;
    use tactomo_physics::hertz::{Skin, Surface};

    fn limit(detector: &Detector, strength: f64) -> Limit {
        Limit::of(&Slab::new(detector).unwrap(), &Press::PAPER, strength, [1e-3, 10.0]).unwrap()
    }

    #[test]
    fn four_times_less_noise_is_nearly_four_times_better() {
        let detector = Detector::default();
        // So noisy that rounding is nothing beside it.
        let noisy = |noise_lsb: f64| Detector { adc: Adc { noise_lsb, ..detector.adc }, ..detector.clone() };
        let [loud, quiet] = [12.0, 3.0].map(|noise_lsb| limit(&noisy(noise_lsb), 0.1));
        let ratio = loud.place_m.unwrap() / quiet.place_m.unwrap();
        // A little less than four times, for the radius is known alike to both.
        assert!((2.5..4.05).contains(&ratio), "{ratio}");
        assert!((quiet.signal_to_noise_db - loud.signal_to_noise_db - 12.04).abs() < 0.1);
        let seen = loud.range[0].unwrap() / quiet.range[0].unwrap();
        assert!((seen - 4.0).abs() < 0.1, "{seen}");
        assert!(quiet.two_points_m < loud.two_points_m);
        assert_eq!(quiet.range[1], loud.range[1]);
    }

    #[test]
    fn at_the_ends_of_the_range_a_contact_is_just_seen_and_nearly_at_the_drive() {
        let (detector, press) = (Detector::default(), Press::PAPER);
        let slab = Slab::new(&detector).unwrap();
        let [seen, saturated] = limit(&detector, 1.0).range.map(Option::unwrap);
        let errors = Errors::of_noise(&detector, detector.adc.deviation_v());
        let bound = cramer_rao(&slab, &[press.at(MIDDLE, seen)], &errors).unwrap().unwrap()[0];
        assert!((3.0 * bound.conductance - 1.0).abs() < 0.01, "{bound:?}");
        assert!((of_drive(&slab, &press.at(MIDDLE, saturated)).unwrap() - 0.9).abs() < 0.001);
        // A ball on an ideal sample A saturates where `tactomo_physics::hertz` says that it does.
        let skin: Skin = Foam::of('A').unwrap().into();
        let ball = Press::indenter(&detector, skin.with(Surface::IDEAL)).unwrap();
        let newtons = Limit::of(&slab, &ball, 1.0, [0.01, 5.0]).unwrap().range[1].unwrap();
        assert!((newtons - 2.1).abs() < 0.05, "{newtons}");
    }

    #[test]
    fn a_spread_tells_the_few_worst_places_from_the_others() {
        let mut errors_m = vec![1e-5; 20];
        errors_m[7] = 1e-3;
        let spread = Spread::of(&round(&errors_m)).unwrap();
        assert_eq!((spread.median_m, spread.p90_m), (1e-5, 1e-5));
        assert!((spread.rms_m / (1e-3 / 20f64.sqrt()) - 1.0).abs() < 1e-2, "{spread:?}");
        // 1 to 11: the median is the sixth, nine tenths of the way is the tenth.
        let even = Spread::of(&round(&(1..=11).map(f64::from).collect::<Vec<_>>())).unwrap();
        assert_eq!((even.median_m, even.p90_m), (6.0, 10.0));
        assert_eq!(Spread::of(&[]), None);
    }

    /// Bounds of such standard errors, as large in all directions.
    fn round(errors_m: &[f64]) -> Vec<Option<Bound>> {
        let of = |error_m: &f64| Bound { position_m: *error_m, ..ellipse([error_m / 2f64.sqrt(); 2]) };
        errors_m.iter().map(|error_m| Some(of(error_m))).collect()
    }

    fn ellipse(axes_m: [f64; 2]) -> Bound {
        let position_m = axes_m[0].hypot(axes_m[1]);
        Bound { axes_m, position_m, ..Bound::default() }
    }

    /// In a plane half of normal errors are within `sqrt(2 ln 2)` deviations, along a line within 0.6745.
    #[test]
    fn half_of_the_errors_are_less_than_their_median_whatever_their_ellipse() {
        for (axes_m, median_m) in [([1e-3, 1e-3], 1.1774e-3), ([1e-3, 1e-6], 0.6745e-3)] {
            let found_m = median_error_m(&[Some(ellipse(axes_m))]).unwrap();
            assert!((found_m / median_m - 1.0).abs() < 0.01, "{axes_m:?} {found_m}");
        }
        // Of places of which one is told far worse, half of the errors are those that three quarters have at the others.
        let far = [Some(ellipse([1e-3, 1e-3])), Some(ellipse([1e-3, 1e-3])), Some(ellipse([1.0, 1.0]))];
        let three_quarters_m = (2.0 * 4f64.ln()).sqrt() * 1e-3;
        assert!((median_error_m(&far).unwrap() / three_quarters_m - 1.0).abs() < 0.01);
        assert_eq!(median_error_m(&[Some(ellipse([1e-3, 1e-3])), None, None]), None);
    }

    #[test]
    fn what_no_reading_tells_is_left_open() {
        // A millionth of the voltage: nothing is seen.
        let detector = Detector { drive_v: 2e-6, ..Detector::default() };
        let found = limit(&detector, 1.0);
        assert_eq!((found.range[0], found.two_points_m), (None, None));
    }
}
