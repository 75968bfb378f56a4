//! How image and contacts of one press are over the surface: GREIT's figures of merit, place by place.
//!
//! GREIT asks of an image that a target looks alike wherever it is (A. Adler et al., "GREIT: a unified approach to 2D linear EIT reconstruction of
//! lung images", Physiological Measurement 30 (2009) S35): the same amplitude, at its place, small, round, and nothing below zero around it.
//! [`Greit`] has the formulas.

mod view;

use tactomo_physics::detector::Detector;
use tactomo_physics::geometry::Point;
use tactomo_physics::scene::{Hand, Shape, Touch};
use tactomo_touch::metrics::Greit;
use tactomo_touch::solve::Method;

pub use self::view::view;
use crate::experiment::{Experiment, Frame, StudyError};
use crate::machine::Machine;
use crate::progress::Progress;
use crate::score::{Scorer, quantiles};
use crate::variant::Variation;

/// What is tried.
#[derive(Clone, Debug)]
pub struct Plan {
    /// The detector, a flat one.
    pub detector: Detector,
    /// Solvers.
    pub methods: Vec<Method>,
    /// Places along the longer side.
    pub across: usize,
    /// Conductance of the press (sheet conductances).
    pub sheets: f64,
    /// Where noise starts.
    pub seed: u64,
    /// If given, everything is simulated on the detector as it was built with this seed.
    pub as_built: Option<u64>,
}

/// What came out.
#[derive(Clone, Debug, serde::Serialize)]
pub struct Report {
    /// Where it ran.
    pub machine: Machine,
    /// How to run it again.
    pub command: String,
    /// Name of the detector.
    pub detector: String,
    /// The seed of the detector as it was built, if it was.
    pub as_built: Option<u64>,
    /// Where noise starts.
    pub seed: u64,
    /// Conductance of the press (sheet conductances).
    pub sheets: f64,
    /// Its radius (m).
    pub radius_m: f64,
    /// Mean distance of electrodes (m): what a contact missed or invented counts.
    pub reach_m: f64,
    /// Places of the press: columns from the left and rows from below (m).
    pub grid_m: [Vec<f64>; 2],
    /// Places of electrodes (m).
    pub electrodes_m: Vec<Point>,
    /// The solvers.
    pub solvers: Vec<SolverReport>,
    /// Solvers that were not done when the study was stopped.
    pub missing: Vec<String>,
}

/// How a solver shows a press.
#[derive(Clone, Debug, serde::Serialize)]
pub struct SolverReport {
    /// Its name.
    pub solver: String,
    /// GREIT's amplitude response: 1 is right.
    pub amplitude_response: Option<Spread>,
    /// GREIT's position error (m): above zero is pulled to the middle.
    pub position_error_m: Option<Spread>,
    /// GREIT's resolution: small is sharp.
    pub resolution: Option<Spread>,
    /// GREIT's shape deformation: 0 is round.
    pub shape_deformation: Option<Spread>,
    /// GREIT's ringing: 0 is none.
    pub ringing: Option<Spread>,
    /// Mean error of contacts, with those missed and invented (m).
    pub error_m: Option<Spread>,
    /// Place by place.
    pub places: Vec<PlaceReport>,
}

/// Over the surface.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Spread {
    /// A tenth of the places have less.
    pub p10: f64,
    /// The median.
    pub median: f64,
    /// A tenth of the places have more.
    pub p90: f64,
}

/// How a press at a place is shown.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct PlaceReport {
    /// Column and row of the place.
    pub at: [usize; 2],
    /// The place (m).
    pub x_m: f64,
    /// The place (m).
    pub y_m: f64,
    /// Error of contacts, with those missed and invented (m); `None` if the readings were refused.
    pub error_m: Option<f64>,
    /// Figures of the image; `None` if it is nowhere above zero.
    pub greit: Option<Greit>,
}

/// Solvers that make images, and `auto`, which is the one to compare them with.
pub fn methods() -> Vec<Method> {
    use tactomo_touch::solve::Family::{Auto, Image, Linear, Paper};
    Method::ALL.into_iter().filter(|method| matches!(method.family(), Auto | Image | Linear | Paper)).collect()
}

/// Presses at each place of a grid, and lets each solver show it from a cold start, until it is done or stopped.
///
/// # Errors
/// [`StudyError`] if the detector cannot be modelled or is curved, or a solver cannot be made for it.
pub fn run(plan: &Plan, command: &str, progress: Progress) -> Result<Report, StudyError> {
    let experiment = Experiment::of(&plan.detector, plan.as_built)?;
    let radius_m = radius_m(&plan.detector, plan.sheets);
    let grid_m = grid_m(&plan.detector, plan.across, radius_m);
    let places = places(&plan.detector, &grid_m);
    let touches: Vec<_> = places.iter().map(|(_, at_m)| vec![press(plan, *at_m, radius_m)]).collect();
    let frames = experiment.frames(&touches, plan.seed)?;
    let of = |method: &Method| of_solver(&experiment, *method, &places, &frames);
    let done = progress.map("press by press", &plan.methods, of);
    let (mut solvers, mut missing) = (Vec::new(), Vec::new());
    for (method, report) in plan.methods.iter().zip(done) {
        match report {
            Some(report) => solvers.push(report?),
            None => missing.push(method.name().to_owned()),
        }
    }
    Ok(Report {
        machine: Machine::this(),
        command: command.to_owned(),
        detector: plan.detector.name.clone(),
        as_built: plan.as_built,
        seed: plan.seed,
        sheets: plan.sheets,
        radius_m,
        reach_m: experiment.reach_m(),
        grid_m,
        electrodes_m: plan.detector.electrodes.iter().map(|pad| [pad.x_m, pad.y_m]).collect(),
        solvers,
        missing,
    })
}

/// A place of the grid: its column and row, and where it is (m).
type Place = ([usize; 2], Point);

/// Radius of a finger's touch of a conductance (m).
fn radius_m(detector: &Detector, sheets: f64) -> f64 {
    let hand = Hand::relative(detector);
    let radius_m = |firmness: f64| hand.tip([0.0; 2], firmness, 1.0).disc().map_or(0.0, |disc| disc.radius_m);
    let firmest_s = hand.tip([0.0; 2], 1.0, 1.0).conductance_s;
    radius_m(sheets * detector.sheet_conductance_s() / firmest_s)
}

fn press(plan: &Plan, centre_m: Point, radius_m: f64) -> Touch {
    Touch::flat(centre_m, Shape::Disc { radius_m }, plan.sheets * plan.detector.sheet_conductance_s())
}

/// Middles of so many cells along the longer side, or of fewer that are as wide as the press; those of the shorter side are as wide or a little
/// wider, two at least.
fn grid_m(detector: &Detector, across: usize, radius_m: f64) -> [Vec<f64>; 2] {
    let [low, high] = detector.outline.bounds();
    let length_m = [0, 1].map(|axis: usize| high[axis] - low[axis]);
    let longer_m = length_m[0].max(length_m[1]);
    let step_m = (longer_m / across as f64).max(2.0 * radius_m);
    [0, 1].map(|axis: usize| {
        // Rounding must not cost a cell.
        let count = (length_m[axis] / step_m + 1e-9).floor().max(2.0);
        (0..count as usize).map(|cell| low[axis] + length_m[axis] * (cell as f64 + 0.5) / count).collect()
    })
}

fn places(detector: &Detector, [columns, rows]: &[Vec<f64>; 2]) -> Vec<Place> {
    let row = |(row, y_m): (usize, &f64)| {
        let y_m = *y_m;
        columns.iter().enumerate().map(move |(column, x_m)| ([column, row], [*x_m, y_m])).collect::<Vec<_>>()
    };
    rows.iter().enumerate().flat_map(row).filter(|(_, at_m)| detector.outline.holds(*at_m)).collect()
}

/// What a solver shows at each place, and all of it together.
fn of_solver(
    experiment: &Experiment,
    method: Method,
    places: &[Place],
    frames: &[Frame],
) -> Result<SolverReport, StudyError> {
    let mut solver = Variation::default_of(method).build(&experiment.problem)?;
    let mut scorer = Scorer::new(experiment);
    let mut all = Vec::with_capacity(places.len());
    for ((at, [x_m, y_m]), frame) in places.iter().zip(frames) {
        // One frame alone: the press before was elsewhere.
        for score in scorer.run(&mut *solver, std::slice::from_ref(frame))? {
            all.push(PlaceReport { at: *at, x_m: *x_m, y_m: *y_m, error_m: score.error_m, greit: score.greit });
        }
    }
    let of_image =
        |value: fn(&Greit) -> f64| Spread::of(all.iter().filter_map(|place| place.greit.as_ref().map(value)));
    Ok(SolverReport {
        solver: method.name().to_owned(),
        amplitude_response: of_image(|greit| greit.amplitude_response),
        position_error_m: of_image(|greit| greit.position_error_m),
        resolution: of_image(|greit| greit.resolution),
        shape_deformation: of_image(|greit| greit.shape_deformation),
        ringing: of_image(|greit| greit.ringing),
        error_m: Spread::of(all.iter().filter_map(|place| place.error_m)),
        places: all,
    })
}

impl Spread {
    fn of(values: impl Iterator<Item = f64>) -> Option<Self> {
        quantiles(values, [0.1, 0.5, 0.9]).map(|[p10, median, p90]| Self { p10, median, p90 })
    }
}

#[cfg(test)]
mod tests {
    use std::sync::LazyLock;
    use std::sync::atomic::AtomicBool;

    use super::*;
    use crate::view::{csv, page, text};
    use tactomo_physics::detector::Outline;

    fn plan() -> Plan {
        Plan {
            detector: Detector::preset("square-50").unwrap(),
            methods: vec![Method::Contacts, Method::Tikhonov],
            across: 5,
            sheets: 0.03,
            seed: 2,
            as_built: None,
        }
    }

    /// One run for all tests.
    static REPORT: LazyLock<Report> = LazyLock::new(|| {
        let stop = AtomicBool::new(false);
        run(&plan(), "", Progress::new(&stop, &|_| {})).unwrap()
    });

    #[test]
    fn a_light_press_has_its_conductance_everywhere_and_contacts_are_sharper_than_an_image() {
        let [contacts, image] = [0, 1].map(|index: usize| &REPORT.solvers[index]);
        // By the pads in the corners a light press has two places that readings tell apart by less than noise.
        let is_corner = |at: [usize; 2]| at.iter().all(|index| [0, 4].contains(index));
        let inner = |solver: &SolverReport| {
            assert_eq!(solver.places.len(), 25);
            solver.places.iter().filter(|place| !is_corner(place.at)).cloned().collect::<Vec<_>>()
        };
        assert!(inner(contacts).iter().all(|place| place.error_m.unwrap() < 0.001), "{:?}", contacts.places);
        for solver in [contacts, image] {
            let amplitude = |place: &PlaceReport| place.greit.unwrap().amplitude_response;
            assert!(inner(solver).iter().all(|place| (0.8..1.2).contains(&amplitude(place))), "{:?}", solver.places);
        }
        let sharp = |solver: &SolverReport| solver.resolution.unwrap().median;
        assert!(sharp(contacts) < 0.5 * sharp(image));
        assert!(image.ringing.unwrap().median > contacts.ringing.unwrap().median);
    }

    #[test]
    fn cells_fill_the_outline_and_none_is_beside_the_outline() {
        let [columns, rows] = &REPORT.grid_m;
        assert_eq!((columns.len(), rows.len()), (5, 5));
        assert!((columns[4] - 0.020).abs() < 1e-12);
        let [columns, rows] = grid_m(&Detector::preset("strip-13x60").unwrap(), 50, 0.001).map(|middles| middles.len());
        assert_eq!((columns, rows), (6, 30), "no cell is narrower than the press");
        // Three quarters of a square.
        let outer = [[-1.0, -1.0], [1.0, -1.0], [1.0, 0.0], [0.0, 0.0], [0.0, 1.0], [-1.0, 1.0]];
        let outline = Outline { outer: outer.map(|corner| corner.map(|x| 0.025 * x)).into(), holes: Vec::new() };
        let detector = Detector { outline, ..plan().detector };
        let on = places(&detector, &grid_m(&detector, 4, 0.002));
        assert_eq!(on.len(), 12);
        assert!(on.iter().all(|(_, [x_m, y_m])| *x_m < 0.0 || *y_m < 0.0), "{on:?}");
    }

    #[test]
    fn each_solver_has_two_maps_and_a_row() {
        let views = [view(&REPORT)];
        let page = page(&views, "");
        for solver in ["contacts", "tikhonov"] {
            assert_eq!(page.matches(&format!("aria-label=\"{solver}\"")).count(), 2, "{solver}");
        }
        assert_eq!(csv(&views).lines().count(), 3);
        assert!(text(&views).contains("amplitude response"));
    }

    #[test]
    fn what_is_stopped_says_what_is_missing() {
        let report = run(&plan(), "", Progress::new(&AtomicBool::new(true), &|_| {})).unwrap();
        assert_eq!((report.solvers.len(), report.missing), (0, vec!["contacts".to_owned(), "tikhonov".to_owned()]));
    }
}
