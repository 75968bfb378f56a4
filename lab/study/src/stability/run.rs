//! All sweeps, run one after the other.

use super::bounds::{BoundReport, Charted};
use super::breakdown::{CellReport, Classes, breaks, margin};
use super::report::{ErrorRange, PointReport, Report, SolverRow, SweepReport};
use super::sweep::{Bench, Maker, Plan, Point, Sweep};
use super::trials::Trials;
use super::{bounds, faults, scenes, shapes, tolerances, wrong};
use crate::experiment::{Experiment, StudyError};
use crate::judge::wrong_m;
use crate::machine::Machine;
use crate::progress::Progress;
use crate::scenes::SceneKind;
use crate::score::Score;
use tactomo_touch::solve::{Method, ParameterKind};

/// Lambda's sweep, in shares of the largest singular value.
const LAMBDAS: [f64; 7] = [1e-5, 1e-4, 1e-3, 0.01, 0.1, 1.0, 10.0];

/// Runs all sweeps, until they are done or it is stopped: then what is missing is in the report.
///
/// # Errors
/// [`StudyError`] if the detector cannot be modelled or is curved.
pub fn run(plan: &Plan, command: &str, progress: Progress) -> Result<Report, StudyError> {
    let bench = Bench::new(plan, Experiment::of(&plan.detector, plan.as_built)?);
    let makers = makers(plan);
    let all = makers.iter().map(|maker| maker.work).chain(bounds::CHARTS.iter().map(Charted::work)).sum();
    let progress = progress.part(0, all);
    let mut trials = Trials::new(&bench);
    let (mut sweeps, mut charts, mut missing, mut done) = (Vec::new(), Vec::new(), Vec::new(), 0);
    for maker in makers {
        progress.tell(maker.title, done);
        match try_sweep(&bench, &maker, &mut trials, progress)? {
            Some(sweep) => sweeps.push(sweep),
            None => missing.push(maker.title.to_owned()),
        }
        done += maker.work;
    }
    for chart in &bounds::CHARTS {
        progress.tell(chart.title, done);
        match progress.is_stopped() {
            true => missing.push(chart.title.to_owned()),
            false => charts.push(chart.of(&bench, &mut trials)?),
        }
        done += chart.work();
    }
    Ok(Report {
        machine: Machine::this(),
        command: command.to_owned(),
        detector: plan.detector.name.clone(),
        reach_m: bench.sound.reach_m(),
        wrong_m: wrong_m(&bench.sound.detector),
        seed: plan.seed,
        as_built: plan.as_built,
        places: plan.places,
        frames: plan.frames,
        sweeps,
        bounds: BoundReport { charts },
        missing,
    })
}

/// How all sweeps are made, in their order.
fn makers(plan: &Plan) -> Vec<Maker> {
    let mut makers = scenes::sweeps();
    makers.extend(shapes::sweeps());
    makers.extend(wrong::sweeps());
    makers.extend(tolerances::sweeps(plan));
    makers.push(Maker::new("Lambda", LAMBDAS.len(), lambda));
    makers.extend(faults::sweeps(plan.detector.electrodes.len()));
    makers
}

fn lambda(bench: &Bench) -> Result<Sweep, StudyError> {
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
    Ok(Sweep::new(note, points))
}

/// Lets all solvers try a sweep; `None` if it was stopped before they had.
fn try_sweep(
    bench: &Bench,
    maker: &Maker,
    trials: &mut Trials,
    progress: Progress,
) -> Result<Option<SweepReport>, StudyError> {
    if progress.is_stopped() {
        return Ok(None);
    }
    let Sweep { note, unit, points } = (maker.make)(bench)?;
    let sweeps_lambda = points.iter().any(|point| point.lambda.is_some());
    let methods =
        bench.plan.methods.iter().filter(|method| !sweeps_lambda || method.parameter() == Some(ParameterKind::Lambda));
    let before: Vec<&Point> = points.iter().collect();
    let after: Vec<&Point> = points.iter().filter_map(|point| point.calibrated.as_deref()).collect();
    let (mut solvers, mut calibrated) = (Vec::new(), Vec::new());
    for method in methods {
        for (points, rows) in [(&before, &mut solvers), (&after, &mut calibrated)] {
            if !points.is_empty() {
                match row(*method, points, trials, progress)? {
                    Some(row) => rows.push(row),
                    None => return Ok(None),
                }
            }
        }
    }
    let point = |point: Point| PointReport { label: point.label, severity: point.severity, amount: point.amount };
    let points = points.into_iter().map(point).collect();
    Ok(Some(SweepReport {
        title: maker.title.to_owned(),
        note,
        unit: unit.map(str::to_owned),
        points,
        solvers,
        calibrated,
    }))
}

/// What a solver makes of points; `None` if it was stopped before.
fn row(
    method: Method,
    points: &[&Point],
    trials: &mut Trials,
    progress: Progress,
) -> Result<Option<SolverRow>, StudyError> {
    let mut scores = Vec::with_capacity(points.len());
    for point in points {
        if progress.is_stopped() {
            return Ok(None);
        }
        scores.push(trials.scores(method, point)?);
    }
    let severities: Vec<f64> = points.iter().map(|point| point.severity).collect();
    let tried = (0..points.len()).filter(|index| scores[*index].is_some());
    let harmless = tried.min_by(|a, b| severities[*a].total_cmp(&severities[*b]));
    let harmless = harmless.and_then(|index| scores[index].clone()).unwrap_or_default();
    let cell = |(point, scores): (&&Point, &Option<Vec<Score>>)| {
        let detector = &point.experiment.detector;
        let lengths_m = [point.experiment.reach_m(), wrong_m(detector)];
        scores.as_ref().map(|scores| CellReport::of(scores, &harmless, lengths_m))
    };
    let mut cells: Vec<_> = points.iter().zip(&scores).map(cell).collect();
    let labels: Vec<&str> = points.iter().map(|point| point.label.as_str()).collect();
    let breaks = breaks(&labels, &severities, &mut cells);
    let errors = ErrorRange::of(&severities, &cells);
    let amounts: Vec<Option<f64>> = points.iter().map(|point| point.amount).collect();
    let margin = margin(&severities, &amounts, &cells);
    let classes = Classes::mean(&cells.iter().flatten().map(|cell| cell.classes).collect::<Vec<_>>());
    Ok(Some(SolverRow { solver: method.name().to_owned(), cells, errors, breaks, classes, margin }))
}

#[cfg(test)]
mod tests {
    use std::sync::LazyLock;
    use std::sync::atomic::{AtomicBool, Ordering};

    use super::super::{Breakdown, view};
    use super::*;
    use crate::calibrate::Calibrate;
    use crate::progress::Step;
    use crate::view::{page, text};
    use tactomo_physics::detector::Detector;

    fn plan() -> Plan {
        Plan {
            detector: Detector::preset(Detector::DEFAULT).unwrap(),
            methods: vec![Method::Tikhonov, Method::TikhonovPaper],
            places: 1,
            frames: 1,
            seed: 2,
            quick: true,
            as_built: None,
            calibrate: Some(Calibrate::Perfect),
        }
    }

    /// One run for all tests.
    static REPORT: LazyLock<Report> = LazyLock::new(|| {
        let stop = AtomicBool::new(false);
        run(&plan(), "tactomo <stability>", Progress::new(&stop, &|_| {})).unwrap()
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
        let impedances = breaks("Contact impedances that differ");
        let is_as_before = impedances.is_none_or(|found| found.how == Breakdown::Never);
        assert!(is_as_before, "a linear image does not feel them, however far off it is");
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
        assert_eq!(table.matches(", calibrated ").count(), 2, "{table}");
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
    fn what_is_stopped_says_what_is_missing() {
        let (plan, stop) = (plan(), AtomicBool::new(false));
        let after_two = |step: &Step| {
            if step.what == "Bits of the converter" {
                stop.store(true, Ordering::Relaxed);
            }
        };
        let report = run(&plan, "", Progress::new(&stop, &after_two)).unwrap();
        let titles: Vec<_> = report.sweeps.iter().map(|sweep| sweep.title.as_str()).collect();
        assert_eq!(titles, ["Noise", "Noise where nothing touches"]);
        assert_eq!(report.missing.len() + 2, REPORT.sweeps.len() + REPORT.bounds.charts.len());
        let views = [view(&report)];
        for shown in [page(&views, ""), text(&views)] {
            assert!(shown.contains("Partial") && shown.contains("Bits of the converter; "), "{shown}");
        }
        assert!(REPORT.missing.is_empty() && !text(&[view(&REPORT)]).contains("Partial"));
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
        let opened: usize = report.sweeps.iter().map(|sweep| sweep.solvers.len() + sweep.calibrated.len()).sum();
        assert_eq!((page.matches("popovertarget=").count(), page.matches("<div popover ").count()), (opened, opened));
        let row = |title: &str| &report.sweeps.iter().find(|sweep| sweep.title == title).unwrap().solvers[0];
        assert!(row("Noise").classes.silent > 0.1, "a linear image has no flags for noise");
        let bears = |title: &str| row(title).margin.is_some();
        assert!(bears("Noise where nothing touches") && !bears("A detector that leaks"), "it is never right there");
    }
}
