//! What `design` promises, and what is found: detectors that it chooses for five wishes, simulated as built, beside an even grid of 4 x 4 electrodes on foam A.
//!
//! Readings come of finer models of detectors drawn from the tolerances, through a chip of the board, and `auto` finds what pressed from the description and one
//! frame. Nothing of this is in the promises: places and two points are bounds of the described detector with its tolerances, and the smallest force is what
//! `auto` asks of a frame before it looks for a contact.

mod view;
mod wanted;

use std::time::Instant;

use tactomo_physics::detector::{Detector, FOAMS, Layer, Outline};
use tactomo_physics::hertz::Skin;
use tactomo_physics::scene::Contact;

use super::limit::everywhere;
use super::reached::{AsBuilt, as_built};
use super::search::{self, DRIVE_V, Material, Rating, Wishes, hertz};
use super::{DesignError, Layout, Press, Progress};

pub use self::view::view;
pub use self::wanted::{Wanted, wanted};

/// Most of the thickness of a naive detector (m), and of its electrodes' diameter (m): those of `square-60`. Smaller detectors have them in proportion.
const NAIVE_THICKNESS_M: f64 = 5e-3;
const NAIVE_DIAMETER_M: f64 = 4e-3;
/// Shorter side of `square-60` (m).
const NAIVE_SIDE_M: f64 = 60e-3;

/// Forces are tried in steps of this factor, from so many steps below the smallest that is promised to so many above.
const FORCE_STEP: f64 = 1.1;
const FORCE_STEPS: std::ops::RangeInclusive<i32> = -5..=8;
/// Distances of two points are tried in steps of this factor, from that of the bound on, as far as half the shorter side.
const DISTANCE_STEP: f64 = 1.4;
const DISTANCE_STEPS: i32 = 8;

/// What is tried.
#[derive(Clone, Debug)]
pub struct Plan {
    /// What is wanted.
    pub wanted: Vec<Wanted>,
    /// Of what it can be made.
    pub foams: Vec<Material>,
    /// How many candidates a search tries at most.
    pub most: usize,
    /// How many detectors are drawn from the tolerances of each.
    pub built: u64,
    /// Presses of each of these, of each kind.
    pub presses: usize,
    /// Of searches, of what is drawn and of noise.
    pub seed: u64,
}

/// What came out.
#[derive(Clone, Debug, serde::Serialize)]
pub struct Report {
    /// The detector that was chosen for each wish, and the naive one.
    pub rows: Vec<Row>,
    /// Whether it was ended before all was done.
    pub is_stopped: bool,
    /// What it took (s).
    pub seconds: f64,
}

/// A detector, what it promises and what is found.
#[derive(Clone, Debug, serde::Serialize)]
pub struct Row {
    /// For what.
    pub wish: String,
    /// Its name.
    pub detector: String,
    /// Whether it was chosen, or is the naive one.
    pub is_chosen: bool,
    /// Whether it promises to meet all wishes.
    pub meets_all: bool,
    /// What it promises.
    pub promised: Rating,
    /// Half of the places of single presses are found better (m), by the force that is in the middle of those wished for.
    pub place_m: Option<f64>,
    /// Share of these presses of which one contact was found.
    pub one: f64,
    /// Least force (N) from which on half of presses were seen, in steps of a factor; `None` if none is promised, or they were seen at none of those tried.
    pub smallest_n: Option<f64>,
    /// Least distance (m) from which on half of two presses were found as two contacts, in steps of a factor, likewise.
    pub two_points_m: Option<f64>,
}

impl Row {
    /// What is found over what is promised of places.
    pub fn place_over_promise(&self) -> Option<f64> {
        Some(self.place_m? / self.promised.place_m?)
    }

    /// The same of the smallest force.
    pub fn smallest_over_promise(&self) -> Option<f64> {
        Some(self.smallest_n? / self.promised.smallest_n?)
    }

    /// The same of two points, which are a bound.
    pub fn two_points_over_bound(&self) -> Option<f64> {
        Some(self.two_points_m? / self.promised.two_points_m?)
    }
}

/// Searches a detector for each wish, and presses it.
///
/// # Errors
/// [`DesignError`] if nothing can be built, or a detector cannot be modelled.
pub fn run(plan: &Plan, progress: Progress) -> Result<Report, DesignError> {
    let start = Instant::now();
    let mut rows = Vec::new();
    for (index, Wanted { name, wishes }) in plan.wanted.iter().enumerate() {
        progress.part(index, plan.wanted.len()).tell(name, 0);
        if progress.is_stopped() {
            break;
        }
        let search = search::Plan {
            wishes: wishes.clone(),
            foams: plan.foams.clone(),
            most: plan.most,
            compared: None,
            seed: plan.seed,
        };
        let answer = search::answer(&search, progress)?;
        if let (Some(choice), false) = (answer.choices.first(), progress.is_stopped()) {
            rows.push(row(name, &choice.detector, Some(choice.rating), wishes, plan)?);
            rows.push(row(name, &naive(wishes), None, wishes, plan)?);
        }
    }
    Ok(Report { rows, is_stopped: progress.is_stopped(), seconds: start.elapsed().as_secs_f64() })
}

/// An even grid on foam A, as thick and with electrodes as wide as one would take without thinking.
fn naive(wishes: &Wishes) -> Detector {
    let [width_m, height_m] = wishes.size_m;
    let part = (width_m.min(height_m) / NAIVE_SIDE_M).min(1.0);
    let layout = Layout::Grid { columns: 4, rows: 4, spread: 1.0 };
    let layer = Layer::uniform(part * NAIVE_THICKNESS_M, FOAMS[0].conductivity_s_per_m);
    wishes.board.measuring(Detector {
        name: "even 4 x 4 grid on A".to_owned(),
        outline: Outline::rectangle(width_m, height_m),
        electrodes: layout.electrodes(wishes.size_m, part * NAIVE_DIAMETER_M / 2.0),
        skin: Some(Skin::of_layers([(layer.thickness_m, FOAMS[0].elasticity_pa)])),
        layers: vec![layer],
        drive_v: DRIVE_V - wishes.board.ground_v,
        ..Detector::default()
    })
}

/// What a detector promises, unless that is known, and what is found of presses all over it.
fn row(
    wish: &str,
    detector: &Detector,
    promised: Option<Rating>,
    wishes: &Wishes,
    plan: &Plan,
) -> Result<Row, DesignError> {
    let is_chosen = promised.is_some();
    let promised = match promised {
        Some(promised) => promised,
        None => Rating::of(detector, wishes)?,
    };
    let press = Press::Ball { radius_m: wishes.tip_m, hertz: hertz(detector)? };
    // Others than those that the promise is made of.
    let places: Vec<_> = everywhere(wishes.size_m).skip(plan.seed as usize * 1000 + 1000).take(plan.presses).collect();
    let single = |force_n: f64| places.iter().map(|place_m| vec![press.at(*place_m, force_n)]).collect();
    let side_m = wishes.size_m[0].min(wishes.size_m[1]);
    let pair = |apart_m: f64| -> Vec<Contact> {
        let along = if wishes.size_m[0] >= wishes.size_m[1] { [0.5, 0.0] } else { [0.0, 0.5] };
        let at = |sign: f64| press.at(along.map(|part| sign * part * apart_m), wishes.middle_n());
        vec![at(-1.0), at(1.0)]
    };
    let forces_n =
        promised.smallest_n.map(|smallest_n| FORCE_STEPS.map(move |step| smallest_n * FORCE_STEP.powi(step)));
    let forces_n: Vec<f64> = forces_n.into_iter().flatten().collect();
    let distances_m = promised.two_points_m.map(|bound_m| {
        (0..DISTANCE_STEPS).map(move |step| bound_m * DISTANCE_STEP.powi(step)).filter(|m| *m <= side_m / 2.0)
    });
    let distances_m: Vec<f64> = distances_m.into_iter().flatten().collect();
    let mut groups = vec![single(wishes.middle_n())];
    groups.extend(forces_n.iter().map(|force_n| single(*force_n)));
    groups.extend(distances_m.iter().map(|apart_m| vec![pair(*apart_m)]));
    let found = as_built(detector, &groups, plan.seed..plan.seed + plan.built)?;
    let (middle, found) = (&found[0], &found[1..]);
    let (forces, pairs) = found.split_at(forces_n.len());
    Ok(Row {
        wish: wish.to_owned(),
        detector: detector.name.clone(),
        is_chosen,
        meets_all: promised.meets(wishes, None),
        place_m: middle.place_m(),
        one: middle.counted(),
        smallest_n: from_half_on(&forces_n, forces, AsBuilt::seen),
        two_points_m: from_half_on(&distances_m, pairs, AsBuilt::counted),
        promised,
    })
}

/// The least of some values, of which there are more and more, from which on a share is a half at least.
fn from_half_on(values: &[f64], found: &[AsBuilt], share: impl Fn(&AsBuilt) -> f64) -> Option<f64> {
    let from_last = values.iter().zip(found).rev();
    from_last.take_while(|(_, found)| share(found) >= 0.5).last().map(|(value, _)| *value)
}

#[cfg(test)]
mod tests {
    use super::super::search::Board;
    use super::*;
    use tactomo_physics::detector::Adc;

    fn plan() -> Plan {
        let board = |electrodes: usize| Board {
            name: "even".to_owned(),
            adc: Adc::default(),
            ground_v: 0.0,
            converters: Vec::new(),
            inputs: vec![0; electrodes.max(16)],
            frames_per_s: vec![400.0; electrodes.max(16)],
        };
        Plan { wanted: wanted(board), foams: Material::of_paper(), most: 1, built: 3, presses: 6, seed: 1 }
    }

    /// The median of 18 presses is known to a quarter of itself, and the smallest force to a step.
    #[test]
    fn places_and_the_smallest_force_are_found_about_as_promised() {
        let plan = plan();
        let Wanted { name, wishes } = &plan.wanted[4];
        let row = row(name, &naive(wishes), None, wishes, &plan).unwrap();
        let over = row.place_over_promise().unwrap();
        assert!((0.6..1.7).contains(&over) && row.one > 0.9, "{row:?}");
        let over = row.smallest_over_promise().unwrap();
        assert!((0.7..1.5).contains(&over), "{row:?}");
        assert!(!row.is_chosen && row.two_points_over_bound().is_none_or(|over| over >= 1.0), "{row:?}");
    }
}
