//! What each solver costs and reaches, in numbers.

use super::super::{DetectorReport, Group, SceneKind, SolverReport};
use super::{TWO, label};
use crate::score::Summary;
use crate::view::{Format, MM, PERCENT, TEXT, Table, US, Value};

const MEGABYTES: Format = Format { factor: 1e-6, ..Format::new("MB", "bytes").digits(2) };
const MILLISECONDS: Format = Format::new("ms", "ms").digits(2);

/// What each solver costs and reaches over all scenes, on the detector as described, and on detectors as built.
pub(super) fn costs(report: &DetectorReport) -> Table {
    let own = report.solvers.iter().map(|solver| ("on the detector as described".to_owned(), solver));
    let built = report.as_built.iter().flat_map(|known| {
        let title = format!("{} detectors as built, {}", known.detectors, known.known.name());
        known.solvers.iter().map(move |solver| (title.clone(), solver))
    });
    type Row<'a> = (String, &'a SolverReport);
    let of =
        |group: Group, value: fn(&Summary) -> Option<f64>| move |(_, solver): &Row| solver.group(group).and_then(value);
    let all = |value: fn(&Summary) -> f64| move |(_, solver): &Row| value(&solver.all);
    let note = format!(
        "one, several: mean error with contacts missed and invented; count: frames of several with none of either; conductance: relative error of one \
         contact's; correlation, Dice: images of {}. --json has every figure of every scene.",
        Group::Shapes.kinds().map(SceneKind::name).collect::<Vec<_>>().join(", ")
    );
    Table::of("", own.chain(built))
        .group("detectors", |(group, _)| group.clone())
        .column("solver", TEXT, |(_, solver)| label(solver))
        .column("median", US, all(|all| all.time_us.median))
        .column("p99", US, all(|all| all.time_us.p99))
        .detail("max", US, all(|all| all.time_us.max))
        .column("set-up", MILLISECONDS, |(_, solver)| solver.set_up_ms)
        .detail("kept", MEGABYTES, |(_, solver)| solver.memory.map(|memory| memory.kept_bytes as f64))
        .column("at most", MEGABYTES, |(_, solver)| solver.memory.map(|memory| memory.peak_bytes as f64))
        .column("one", MM.digits(2), of(Group::One, |one| one.error_m))
        .column("several", MM.digits(2), of(Group::Several, |several| several.error_m))
        .column("count", PERCENT, of(Group::Several, |several| several.count_right))
        .column("missed", TWO, |(_, solver)| solver.all.missed)
        .column("invented", TWO, |(_, solver)| solver.all.invented)
        .column("conduct- ance", TWO, of(Group::One, |one| one.conductance_error))
        .column("corre- lation", TWO, of(Group::Shapes, |shapes| shapes.correlation))
        .column("Dice", TWO, of(Group::Shapes, |shapes| shapes.dice))
        .detail("misfit", PERCENT, all(|all| all.misfit))
        .detail("saturated", PERCENT, all(|all| all.saturated))
        .detail("unfinished", PERCENT, all(|all| all.unfinished))
        .detail("excluded", PERCENT, all(|all| all.excluded))
        .detail("refused", PERCENT, all(|all| all.failed))
        .note(note)
        .into()
}

/// Every figure of every scene.
pub(super) fn figures(report: &DetectorReport) -> Table {
    let rows = SceneKind::ALL
        .into_iter()
        .flat_map(|kind| report.solvers.iter().filter_map(move |solver| Some((kind, solver, solver.scene(kind)?))));
    let of = |value: fn(&Summary) -> Option<f64>| {
        move |(_, _, summary): &(SceneKind, &SolverReport, &Summary)| Value::from(value(summary))
    };
    let mm = MM.digits(2);
    Table::of("", rows)
        .group("scene", |(kind, ..)| kind.name())
        .column("solver", TEXT, |(_, solver, _)| label(solver))
        .column("time", US, of(|s| Some(s.time_us.median)))
        .column("error", mm, of(|s| s.error_m))
        .column("position", mm, of(|s| s.position_error_m))
        .column("missed", TWO, of(|s| s.missed))
        .column("invented", TWO, of(|s| s.invented))
        .column("conductance error", TWO, of(|s| s.conductance_error))
        .column("correlation", TWO, of(|s| s.correlation))
        .column("Dice", TWO, of(|s| s.dice))
        .column("IoU", TWO, of(|s| s.iou))
        .column("SR", TWO, of(|s| s.spatial_resolution))
        .column("PA", TWO, of(|s| s.position_accuracy))
        .column("AR", TWO, of(|s| s.amplitude_response))
        .column("PE", mm, of(|s| s.greit_position_error_m))
        .column("RES", TWO, of(|s| s.resolution))
        .column("SD", TWO, of(|s| s.shape_deformation))
        .column("RNG", TWO, of(|s| s.ringing))
        .note(
            "SR, PA: the paper's spatial resolution and position accuracy. AR, PE, RES, SD, RNG: GREIT's amplitude response, position error towards \
             the middle, resolution, shape deformation, ringing. Of one contact's image.",
        )
        .data()
        .into()
}
