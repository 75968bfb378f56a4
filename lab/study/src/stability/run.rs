//! All sweeps, run one after the other.

use super::breakdown::{CellReport, breaks};
use super::report::{ErrorRange, PointReport, Report, SolverRow, SweepReport};
use super::sweep::{Bench, Plan, Point, Sweep};
use super::trials::Trials;
use super::{bounds, faults, scenes, tolerances, wrong};
use crate::experiment::{Experiment, StudyError};
use crate::machine::Machine;
use crate::scenes::SceneKind;
use tactomo_touch::solve::{Method, ParameterKind};

/// Lambda's sweep, in shares of the largest singular value.
const LAMBDAS: [f64; 7] = [1e-5, 1e-4, 1e-3, 0.01, 0.1, 1.0, 10.0];

/// Makes some sweeps.
type Maker = fn(&Bench) -> Result<Vec<Sweep>, StudyError>;

/// Runs all sweeps. `progress` is called with what is tried next.
///
/// # Errors
/// [`StudyError`] if the detector cannot be modelled or is curved.
pub fn run(plan: &Plan, command: &str, progress: &mut dyn FnMut(&str)) -> Result<Report, StudyError> {
    let bench = Bench::new(plan, Experiment::of(&plan.detector, plan.as_built)?, progress);
    let makers: [Maker; 5] = [scenes::sweeps, wrong::sweeps, tolerances::sweeps, lambda, faults::sweeps];
    let mut trials = Trials::default();
    let mut sweeps = Vec::new();
    for make in makers {
        for sweep in make(&bench)? {
            bench.tell(sweep.title);
            sweeps.push(try_sweep(plan, sweep, &mut trials)?);
        }
    }
    bench.tell("bounds");
    let bounds = bounds::report(&bench, &mut trials)?;
    Ok(Report {
        machine: Machine::this(),
        command: command.to_owned(),
        detector: plan.detector.name.clone(),
        reach_m: bench.sound.reach_m(),
        seed: plan.seed,
        as_built: plan.as_built,
        places: plan.places,
        frames: plan.frames,
        sweeps,
        bounds,
    })
}

fn lambda(bench: &Bench) -> Result<Vec<Sweep>, StudyError> {
    let points = bench
        .some(&LAMBDAS)
        .map(|lambda| {
            let experiment = bench.sound.with_faults(&[], 0)?;
            // Distance from the default, 0.03.
            let severity = (lambda / 0.03).log10().abs();
            let point = bench.point(format!("{lambda}"), severity, experiment, SceneKind::Firm)?;
            Ok(Point { lambda: Some(*lambda), ..point })
        })
        .collect::<Result<_, StudyError>>()?;
    let note = "Of a firm contact; in shares of the largest singular value. Only of solvers that have one.";
    Ok(vec![Sweep { title: "Lambda", note: note.to_owned(), points }])
}

fn try_sweep(plan: &Plan, sweep: Sweep, trials: &mut Trials) -> Result<SweepReport, StudyError> {
    let sweeps_lambda = sweep.points.iter().any(|point| point.lambda.is_some());
    let methods =
        plan.methods.iter().filter(|method| !sweeps_lambda || method.parameter() == Some(ParameterKind::Lambda));
    let before: Vec<&Point> = sweep.points.iter().collect();
    let after: Vec<&Point> = sweep.points.iter().filter_map(|point| point.calibrated.as_deref()).collect();
    let (mut solvers, mut calibrated) = (Vec::new(), Vec::new());
    for method in methods {
        solvers.push(row(*method, &before, trials)?);
        if !after.is_empty() {
            calibrated.push(row(*method, &after, trials)?);
        }
    }
    let point = |point: Point| PointReport { label: point.label, severity: point.severity };
    Ok(SweepReport {
        title: sweep.title.to_owned(),
        note: sweep.note,
        points: sweep.points.into_iter().map(point).collect(),
        solvers,
        calibrated,
    })
}

fn row(method: Method, points: &[&Point], trials: &mut Trials) -> Result<SolverRow, StudyError> {
    let cell = |point: &&Point| {
        let summary = trials.summary(method, point)?;
        Ok(summary.map(|summary| CellReport::of(&summary, point.experiment.reach_m())))
    };
    let mut cells = points.iter().map(cell).collect::<Result<Vec<_>, StudyError>>()?;
    let severities: Vec<f64> = points.iter().map(|point| point.severity).collect();
    let labels: Vec<&str> = points.iter().map(|point| point.label.as_str()).collect();
    let breaks = breaks(&labels, &severities, &mut cells);
    let errors = ErrorRange::of(&severities, &cells);
    Ok(SolverRow { solver: method.name().to_owned(), cells, errors, breaks })
}

#[cfg(test)]
mod tests {
    use std::sync::LazyLock;

    use super::super::view;
    use super::*;
    use crate::calibrate::Calibrate;
    use crate::view::{page, text};
    use tactomo_physics::detector::Detector;

    /// One run for all tests.
    static REPORT: LazyLock<Report> = LazyLock::new(|| {
        let plan = Plan {
            detector: Detector::preset(Detector::DEFAULT).unwrap(),
            methods: vec![Method::Tikhonov, Method::TikhonovPaper],
            places: 1,
            frames: 1,
            seed: 2,
            quick: true,
            as_built: None,
            calibrate: Some(Calibrate::Perfect),
        };
        run(&plan, "tactomo <stability>", &mut |_| {}).unwrap()
    });

    #[test]
    fn every_sweep_has_a_harmless_point_and_a_cell_for_each_solver_and_point() {
        let report = &*REPORT;
        assert!(report.sweeps.len() > 20);
        for sweep in &report.sweeps {
            let least = sweep.points.iter().map(|point| point.severity).fold(f64::INFINITY, f64::min);
            assert_eq!(sweep.points.iter().filter(|point| point.severity == least).count(), 1, "{}", sweep.title);
            assert!(sweep.points.len() > 2 && sweep.solvers.len() == 2, "{}", sweep.title);
            for row in &sweep.solvers {
                assert_eq!(row.cells.len(), sweep.points.len(), "{}", sweep.title);
                assert!(
                    row.cells.iter().flatten().all(|cell| cell.not_finite == 0.0 && cell.failed == 0.0),
                    "{}",
                    sweep.title
                );
            }
        }
        let breaks = |title: &str| {
            let sweep = report.sweeps.iter().find(|sweep| sweep.title == title).unwrap();
            sweep.solvers[0].breaks.clone()
        };
        assert!(breaks("Noise").is_some(), "nothing is found at 0 dB");
        assert!(breaks("Contact impedances that differ").is_none(), "a linear image does not feel them");
    }

    #[test]
    fn tolerances_of_nothing_are_the_description_and_a_calibration_shows_beyond() {
        let sweep = |title: &str| REPORT.sweeps.iter().find(|sweep| sweep.title == title).unwrap();
        let errors_m = |rows: &[SolverRow]| {
            let cells = rows[0].cells.iter().map(|cell| cell.as_ref().unwrap().error_m.unwrap());
            cells.collect::<Vec<_>>()
        };
        let all = sweep("All tolerances");
        let (before, after) = (errors_m(&all.solvers), errors_m(&all.calibrated));
        assert_eq!(before[0], after[0]);
        assert_ne!(before.last(), after.last());
        assert_eq!(before[0], errors_m(&sweep("Unevenness").solvers)[0]);
        assert!(sweep("Noise").calibrated.is_empty());
        let views = [view(&REPORT)];
        let (page, table) = (page(&views, ""), text(&views));
        assert!(page.contains("All tolerances, calibrated") && page.contains("tikhonov, calibrated"));
        assert_eq!(table.matches(", calibrated ").count(), 2 * 11, "{table}");
    }

    #[test]
    fn the_bound_is_below_what_a_linear_image_reaches() {
        let report = &*REPORT;
        for chart in &report.bounds.charts {
            let (bound, solver) = (&chart.curves[0], &chart.curves[1]);
            assert!(!bound.points.is_empty() && bound.solver.is_none(), "{}", chart.title);
            // Of contacts that cannot be separated in the noise, any guess on the detector is nearer than the bound.
            for [value, bound_m] in bound.points.iter().filter(|[_, bound_m]| *bound_m < 0.1 * report.reach_m) {
                let reached = solver.points.iter().find(|point| point[0] == *value).unwrap();
                assert!(*bound_m > 0.0 && *bound_m < reached[1], "{}: {bound_m} {reached:?}", chart.title);
            }
        }
    }

    #[test]
    fn page_and_table_show_every_sweep() {
        let report = &*REPORT;
        let views = [view(report)];
        let (page, table) = (page(&views, &report.command), text(&views));
        for sweep in &report.sweeps {
            assert!(page.contains(&sweep.title) && table.contains(&sweep.title), "{}", sweep.title);
        }
        let row = |row: &SolverRow| row.errors.median_m.zip(row.errors.largest_m);
        let errors: Vec<_> = report.sweeps.iter().flat_map(|sweep| &sweep.solvers).filter_map(row).collect();
        assert!(errors.len() > 20 && errors.iter().all(|(median_m, largest_m)| median_m <= largest_m));
        let fits = page.find("heat whole").is_some_and(|at| at < page.find("Against what noise allows").unwrap());
        assert!(fits, "the overview takes the width of the page, whatever its columns");
        assert!(page.contains("tactomo &lt;stability&gt;") && page.contains("noise limit"));
    }
}
