//! The calibration by rubbing, from frames to a detector.

use std::sync::Arc;

use tactomo_physics::detector::{Calibration, Detector, Parameter, SHORTEST_WAVE, Tolerances};
use tactomo_physics::readings::Readings;
use tactomo_physics::scene::Contact;

use super::bundle::{Bundle, Iterations, Normal};
use super::centred::between_others;
use super::contact::Press;
use super::held_out::{self, HeldOut, Missing};
use super::posterior::Posterior;
use super::presses::{Chosen, Mean};
use super::slopes::Slopes;
use super::wires::{Order, orders};
use super::{CalibrateError, Frame, Step};
use crate::solve::{ContactSettings, Contacts, Problem, Solver};
use tactomo_physics::threads::map;

/// How a rub is used.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RubSettings<'a> {
    /// Most presses that are fitted, spread over the detector.
    pub presses: usize,
    /// Standard deviation of known places (m).
    pub known_deviation_m: f64,
    /// Another detector that the presses that are held out are tried on too, as one that was found before.
    pub rival: Option<&'a Detector>,
}

impl Default for RubSettings<'_> {
    /// 160 presses: twice as many bettered places on simulated detectors by less than a tenth. Places to a third of a millimetre, as a hand finds
    /// a mark.
    fn default() -> Self {
        Self { presses: 160, known_deviation_m: 0.3e-3, rival: None }
    }
}

/// A detector as it was built, and how it was found.
#[derive(Clone, Debug)]
pub struct Rub {
    /// The detector, with what is left unknown; its calibration has neither board nor date yet.
    pub detector: Detector,
    /// Electrodes of the description that the channels are connected to, if not in its order.
    pub wires: Option<Vec<usize>>,
    /// Electrodes that were left out, because they are wrong.
    pub left_out: Vec<usize>,
    /// Frames that something touched in, and of those the ones of a single contact.
    pub touched: usize,
    /// Frames of a single contact.
    pub single: usize,
    /// Presses that were fitted.
    pub presses: usize,
    /// Fitted presses at known places.
    pub known: usize,
    /// What it is worth, on presses that were not used; none where there are too few to hold any out.
    pub held_out: Option<HeldOut>,
    /// What the rub is missing, what matters most first.
    pub missing: Vec<Missing>,
    /// Sum of squares for each reading, in standard deviations, of the presses after the first step and with what was found.
    pub chi_square: [f64; 2],
    /// Places over the detector (m), with the standard error that a press of half a sheet conductance has there in one frame (m).
    pub place_errors_m: Vec<([f64; 2], f64)>,
}

impl Rub {
    /// Median of the standard errors of places over the detector (m): a few corners, where readings tell little, do not decide it.
    pub fn place_error_m(&self) -> f64 {
        median_m(&self.place_errors_m)
    }

    /// Whether presses that were not used say that it has helped.
    pub fn helped(&self) -> bool {
        self.held_out.is_some_and(|held_out| held_out.helped())
    }
}

fn median_m(place_errors_m: &[([f64; 2], f64)]) -> f64 {
    let mut sorted: Vec<f64> = place_errors_m.iter().map(|(_, error_m)| *error_m).collect();
    sorted.sort_by(f64::total_cmp);
    sorted.get(sorted.len() / 2).copied().unwrap_or_default()
}

/// Places along a side that standard errors are given for, and how far they reach in shares of it.
const PLACES: usize = 7;
const REACH: f64 = 0.8;

/// Most steps from the description, as a share of the centred matrix: detectors drawn from the default tolerances are up to 0.2 off.
const FAR: f64 = 0.45;
/// Mean distances of electrodes by which known places may be off on the description: on detectors of the default tolerances they are off by a
/// fifth at most, and by one and more where the sensor is taken for turned.
const OFF_SPACINGS: f64 = 0.5;
/// Readings above this share of the converter's range, or of the drive, say nothing.
const FULL: f64 = 0.995;
/// Sum of squares for each reading above which one contact each and a detector within its tolerances do not explain the presses: rubs of
/// simulated detectors as built leave 0.5 to 1.6.
const UNFIT: f64 = 5.0;
/// Errors of the model, in its own, with which the first iterations are done: far from the truth readings are not linear in the detector, and
/// with the model's own error alone two of five detectors drawn from the default tolerances end in a wrong minimum.
const ROUGH: [f64; 2] = [30.0, 4.0];
/// Presses that the detector is fitted to first: what they leave is within a tenth of what all leave, in a sixth of the time.
const FIRST: usize = 24;
/// Sum of squares, in those of most presses, above which a press is sought anew.
const LOST: f64 = 2.0;

/// Fits the detector `nominal` to the frames of a rub; `report` hears of each step, and stops it by `false`.
///
/// # Errors
/// [`CalibrateError`] if the frames are not those of a single contact on such a detector.
pub fn rub(
    nominal: &Detector,
    frames: &[Frame],
    settings: &RubSettings<'_>,
    report: &mut dyn FnMut(Step) -> bool,
) -> Result<Rub, CalibrateError> {
    // Readings are those of the channels: gains and offsets are fitted from none.
    let (told_channels, nominal) = (nominal, &without_channels(nominal));
    let Sorted { chosen, means, held, order, problem } = Sorted::new(nominal, frames, settings.presses)?;
    let parameters: Vec<_> = Parameter::all(problem.detector(), SHORTEST_WAVE)
        .into_iter()
        .map(|parameter| (parameter, nominal.tolerances.deviation(nominal, parameter)))
        .filter(|(_, deviation)| *deviation > 0.0)
        .collect();
    let full_v = FULL * nominal.adc.full_scale_v.min(nominal.drive_v);
    let presses = Presses { means: &means, settings };
    let (first, rest) = presses.divided();
    let first = presses.started(&problem, &first)?;
    let mut bundle = Bundle::new(Arc::clone(&problem.model), parameters, first, full_v);
    let mut slopes = Slopes::new(&bundle.model, &bundle.parameters)?;
    let before_m = median_m(&place_errors_m(&bundle, &slopes, &Posterior::before(bundle.parameters.len())));
    let (first, last) = adjusted(&mut bundle, &mut slopes, &presses, &rest, report)?;
    let single = chosen.singles.iter().map(|mean| mean.frames).sum();
    if bundle.chi_square(&last) > UNFIT {
        let residual = bundle.chi_square(&last).sqrt();
        return Err(CalibrateError::Unfit { detector: nominal.name.clone(), residual });
    }
    let posterior = Posterior::new(&last.information, bundle.information_of_press(&slopes), bundle.chi_square(&last))
        .ok_or_else(|| CalibrateError::Unfit { detector: nominal.name.clone(), residual: f64::INFINITY })?;
    let place_errors_m = place_errors_m(&bundle, &slopes, &posterior);
    let after_m = median_m(&place_errors_m);
    let mut detector = calibrated(nominal, &chosen, &bundle, &posterior);
    detector.force.clone_from(&told_channels.force);
    detector.calibration.iter_mut().for_each(|calibration| calibration.place_error_m = Some(after_m));
    let residuals = [held_out::residual(&problem.model, &held)?, held_out::residual(&bundle.model, &held)?];
    let held_out = match residuals {
        [Some(before), Some(after)] => {
            let rival = settings.rival.map(|rival| left_by(rival, &chosen, &held)).transpose()?.flatten();
            let (residuals, place_errors_m) = ([before, after], [before_m, after_m]);
            Some(HeldOut { presses: held.len(), residuals, place_errors_m, rival })
        }
        _ => None,
    };
    let contacts: Vec<Contact> = bundle.presses.iter().map(|press| press.contact).collect();
    Ok(Rub {
        detector,
        held_out,
        missing: held_out::missing(&contacts, bundle.model.detector()),
        place_errors_m,
        wires: (!order.exchanged().is_empty()).then_some(order.electrodes),
        left_out: (0..nominal.electrodes.len()).filter(|e| !chosen.kept.contains(e)).collect(),
        touched: chosen.touched,
        single,
        presses: bundle.presses.len(),
        known: bundle.presses.iter().filter(|press| press.known_m.is_some()).count(),
        chi_square: [first, bundle.chi_square(&last)],
    })
}

/// Frames of a rub, with the electrodes that they are of.
pub(super) struct Sorted {
    chosen: Chosen,
    /// Means of frames that are fitted.
    means: Vec<Mean>,
    /// And of others, that what was found is tried on.
    held: Vec<Mean>,
    pub order: Order,
    /// The detector as described, through electrodes that are sound, in the order of the channels.
    problem: Problem,
}

impl Sorted {
    /// Takes so many presses of single contacts, and finds which wire is which.
    pub fn new(nominal: &Detector, frames: &[Frame], presses: usize) -> Result<Self, CalibrateError> {
        let electrodes = nominal.electrodes.len();
        if let Some(other) = frames.iter().find(|frame| frame.readings.electrodes() != electrodes) {
            let readings = other.readings.electrodes();
            return Err(CalibrateError::Count { readings, detector: nominal.name.clone(), electrodes });
        }
        let chosen = Chosen::among(frames, nominal)?;
        let problem = Problem::of(&nominal.taken_as_exact())?;
        let found = wired(&chosen, nominal, &problem)?;
        let held = held_out::chosen(chosen.singles.len(), |index| chosen.singles[index].known_m.is_some());
        let means = chosen.spread(presses, &held, nominal);
        let held = held.into_iter().map(|index| chosen.singles[index].clone()).collect();
        let (order, problem) = ordered(&found, &chosen, &problem, &means)?;
        Ok(Self { chosen, means, held, order, problem })
    }
}

/// A detector whose channels are taken to read what is there, and whose answers are not corrected. One that is taken as exact is no longer, by
/// whoever calibrates it.
fn without_channels(detector: &Detector) -> Detector {
    let mut detector = Detector { correction: None, ..detector.clone() };
    if detector.tolerances.is_exact() {
        detector.tolerances = Tolerances::default();
    }
    detector.electrodes.iter_mut().for_each(|pad| (pad.gain, pad.unseen_offset_v) = (1.0, 0.0));
    detector
}

/// Standard errors of places over the detector.
fn place_errors_m(bundle: &Bundle, slopes: &Slopes, posterior: &Posterior) -> Vec<([f64; 2], f64)> {
    let detector = bundle.model.detector();
    let [low, high] = detector.outline.bounds();
    let at = |axis: usize, i: usize| {
        let share = REACH * (i as f64 / (PLACES - 1) as f64 - 0.5);
        (0.5 + share) * high[axis] + (0.5 - share) * low[axis]
    };
    let places: Vec<[f64; 2]> =
        (0..PLACES * PLACES).map(|index| [at(0, index % PLACES), at(1, index / PLACES)]).collect();
    let radius_m = bundle.presses.first().map_or(0.0, |press| press.usual.radius_m);
    let error_m = |at_m: &[f64; 2]| {
        let contact = Contact::flat(at_m[0], at_m[1], radius_m, 0.5 * detector.sheet_conductance_s());
        Some((*at_m, bundle.place_error_m(&contact, slopes, &posterior.precision)?))
    };
    map(&places, error_m).into_iter().flatten().collect()
}

/// What single contacts leave of presses on another detector, whose electrodes are in the order of the channels.
fn left_by(rival: &Detector, chosen: &Chosen, held: &[Mean]) -> Result<Option<f64>, CalibrateError> {
    let problem = Problem::of(&rival.taken_as_exact())?;
    let is_whole = chosen.kept.len() == rival.electrodes.len();
    let problem = if is_whole { problem } else { problem.through(&chosen.kept, &[]) };
    held_out::residual(&problem.model, held)
}

/// Orders of the wires that fit, the likeliest first.
fn wired(chosen: &Chosen, nominal: &Detector, problem: &Problem) -> Result<Vec<Order>, CalibrateError> {
    let fields_ohm = problem.model.electrode_fields_ohm();
    let described = between_others(&fields_ohm.select_rows(&chosen.kept).select_columns(&chosen.kept));
    let described = &described / described.norm();
    let as_described =
        Order { electrodes: (0..chosen.kept.len()).collect(), distance: (&described - &chosen.centred).norm() };
    // Which electrode is missing and how the others are exchanged cannot both be found.
    let found = match chosen.kept.len() == nominal.electrodes.len() {
        true => orders(&chosen.centred, &described),
        false => vec![as_described],
    };
    match found.first() {
        Some(best) if best.distance < FAR => Ok(found),
        other => Err(CalibrateError::OtherDetector {
            detector: nominal.name.clone(),
            distance: 100.0 * other.map_or(f64::INFINITY, |order| order.distance),
            usual: 100.0 * FAR / 2.0,
        }),
    }
}

/// The order that known places agree with, or else the likeliest, and the problem through it.
fn ordered(
    found: &[Order],
    chosen: &Chosen,
    problem: &Problem,
    means: &[Mean],
) -> Result<(Order, Problem), CalibrateError> {
    let known: Vec<_> = means.iter().filter(|mean| mean.known_m.is_some()).cloned().collect();
    if known.is_empty() {
        let order = found[0].clone();
        let problem = through(&order, chosen, problem);
        return Ok((order, problem));
    }
    let mut best: Option<(f64, Order, Problem)> = None;
    for order in found {
        let problem = through(order, chosen, problem);
        let off_m = off_m(&problem, &known)?;
        if best.as_ref().is_none_or(|(least_m, ..)| off_m < *least_m) {
            best = Some((off_m, order.clone(), problem));
        }
    }
    match best {
        Some((off_m, order, through)) if off_m < OFF_SPACINGS * problem.spacing_m() => Ok((order, through)),
        other => Err(CalibrateError::Places { off_mm: 1e3 * other.map_or(f64::INFINITY, |(off_m, ..)| off_m) }),
    }
}

/// A problem with the electrodes that are kept, in such an order.
fn through(order: &Order, chosen: &Chosen, problem: &Problem) -> Problem {
    let kept: Vec<usize> = order.electrodes.iter().map(|e| chosen.kept[*e]).collect();
    let is_whole = kept.len() == problem.detector().electrodes.len();
    if is_whole && order.exchanged().is_empty() { problem.clone() } else { problem.through(&kept, &[]) }
}

/// How far contacts found with the description are from where they are known to be, in the root of the mean square (m).
fn off_m(problem: &Problem, known: &[Mean]) -> Result<f64, CalibrateError> {
    let found = searched(problem, known.iter().map(|mean| &mean.readings))?;
    let square = |(mean, contact): (&Mean, Option<Contact>)| {
        let (Some(known_m), Some(contact)) = (mean.known_m, contact) else { return 1.0 };
        (contact.x_m - known_m[0]).powi(2) + (contact.y_m - known_m[1]).powi(2)
    };
    Ok((known.iter().zip(found).map(square).sum::<f64>() / known.len() as f64).sqrt())
}

/// The one contact of each of some readings.
fn searched<'a>(
    problem: &Problem,
    all: impl Iterator<Item = &'a Readings>,
) -> Result<Vec<Option<Contact>>, CalibrateError> {
    let settings = ContactSettings { most: 1, ..ContactSettings::of(problem) };
    let mut solver = Contacts::new(problem, settings)?;
    let of = |readings: &Readings| {
        solver.reset();
        let found = solver.solve(readings).ok()?.contacts.into_iter().next()?;
        Some(Contact::flat(found.x_m, found.y_m, settings.radius_m, found.conductance_s))
    };
    Ok(all.map(of).collect())
}

/// Means of frames that are fitted.
struct Presses<'a> {
    means: &'a [Mean],
    settings: &'a RubSettings<'a>,
}

impl Presses<'_> {
    /// Those that the detector is fitted to first, with all at known places, and the others.
    fn divided(&self) -> (Vec<usize>, Vec<usize>) {
        let step = self.means.len().div_ceil(FIRST).max(1);
        (0..self.means.len()).partition(|index| index % step == 0 || self.means[*index].known_m.is_some())
    }

    /// Some of them with contacts to start from, as they are found by what is known of a detector.
    fn started(&self, problem: &Problem, which: &[usize]) -> Result<Vec<Press>, CalibrateError> {
        let found = searched(problem, which.iter().map(|index| &self.means[*index].readings))?;
        let press = |(index, contact): (&usize, Option<Contact>)| {
            let mean = &self.means[*index];
            contact.map(|contact| Press {
                readings: mean.readings.clone(),
                noise_v: mean.noise_v,
                known_m: mean.known_m.map(|at_m| (at_m, self.settings.known_deviation_m)),
                contact,
                usual: contact,
            })
        };
        Ok(which.iter().zip(found).filter_map(press).collect())
    }
}

/// Adjusts the detector to the first presses and then to the rest too, seeks presses anew that were lost in a wrong minimum, and adjusts again.
/// Gives the sum of squares for each reading at the start.
fn adjusted(
    bundle: &mut Bundle,
    slopes: &mut Slopes,
    presses: &Presses<'_>,
    rest: &[usize],
    report: &mut dyn FnMut(Step) -> bool,
) -> Result<(f64, Normal), CalibrateError> {
    let first = bundle.chi_square(&bundle.normal(slopes));
    for rough in ROUGH {
        bundle.rough = rough;
        bundle.adjust(slopes, Iterations { most: 1, renewed: 1 }, report)?;
    }
    bundle.rough = 1.0;
    let others = presses.started(&Problem::new(Arc::clone(&bundle.model)), rest)?;
    bundle.presses.extend(others);
    let mut normal = bundle.adjust(slopes, Iterations::default(), report)?;
    for _ in 0..2 {
        let lost = bundle.lost(&normal, LOST);
        if lost.is_empty() {
            break;
        }
        let problem = Problem::new(Arc::clone(&bundle.model));
        let readings: Vec<_> = lost.iter().map(|index| &bundle.presses[*index].readings).collect();
        let found = searched(&problem, readings.into_iter())?;
        if !bundle.offer(&lost, &found) {
            break;
        }
        normal = bundle.adjust(slopes, Iterations::default(), report)?;
    }
    Ok((first, normal))
}

/// The detector of all electrodes, in the order of the channels, with what is left unknown.
fn calibrated(nominal: &Detector, chosen: &Chosen, bundle: &Bundle, posterior: &Posterior) -> Detector {
    let fitted = bundle.detector();
    let mut detector = Detector { electrodes: nominal.electrodes.clone(), ..fitted.clone() };
    chosen.kept.iter().zip(&fitted.electrodes).for_each(|(channel, pad)| detector.electrodes[*channel] = *pad);
    let mut parameters = posterior.parameters(&bundle.parameters);
    for known in &mut parameters {
        if let Some(e) = known.parameter.electrode() {
            known.parameter = known.parameter.with_electrode(chosen.kept[e]);
        }
    }
    let calibration = Calibration {
        frames: chosen.singles.iter().map(|mean| mean.frames).sum(),
        presses: bundle.presses.len(),
        parameters,
        directions: posterior.directions(&bundle.parameters),
        ..Calibration::default()
    };
    Detector { name: nominal.name.clone(), tolerances: nominal.tolerances, calibration: Some(calibration), ..detector }
}
