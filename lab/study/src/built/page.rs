//! Error against rubbed presses, as a page.

use super::{Curve, OverFrames, Point};
use crate::machine::Machine;
use crate::page::{Axis, Chart, Mark, Series, Unit, html, machine};

/// Errors below this show there (m).
const FLOOR_M: f64 = 1e-5;
/// Colours of the noises, from the smallest.
const CLASSES: [&str; 3] = ["image", "linear", "contacts"];

/// A self-contained HTML page: a chart for each solver, a line for each noise.
pub fn page(report: &OverFrames) -> String {
    let mut solvers: Vec<&str> = report.curves.iter().map(|curve| curve.solver).collect();
    solvers.dedup();
    let charts: String = solvers.iter().map(|solver| chart(report, solver).svg() + "\n").collect();
    let parts = [
        "<h1>How many presses a calibration needs</h1>".to_owned(),
        format!(
            "<p class=\"lead-in\">Mean error of single presses on {} detectors as built, after rubbing each with so many presses at places that nobody \
             knows: further <b>down is more accurate</b>.</p>",
            report.detectors
        ),
        format!("<div class=\"charts\">{charts}</div>"),
        format!(
            "<h2>How it was measured</h2>\n<p class=\"note\">Detectors are drawn from the tolerances of {}; {} single presses on each, each a cold start, \
             the same for all points. Rubbed presses are others than those tried. \
             Where a calibration is refused, solvers know the description.</p>\n{}",
            crate::page::escaped(&report.detector),
            report.presses,
            machine(&Machine::this(), &report.command)
        ),
    ];
    html("Tactomo: how many presses a calibration needs", &parts)
}

fn chart(report: &OverFrames, solver: &str) -> Chart {
    let curves = || report.curves.iter().filter(|curve| curve.solver == solver);
    let described = |curve: &Curve| {
        let error_m = curve.points.iter().find(|point| point.frames == 0).and_then(|point| point.figures.error_m);
        let error = error_m.map_or_else(|| "–".to_owned(), |error_m| Unit::Metres.text(error_m));
        format!("{error} at {} LSB", curve.noise_lsb)
    };
    let before: Vec<String> = curves().map(described).collect();
    // All charts have the same axes.
    let marks: Vec<Mark> = report.curves.iter().flat_map(|curve| series(curve, "").marks).collect();
    Chart {
        title: solver.to_owned(),
        subtitle: format!("error · as described {}", before.join(", ")),
        x: Axis::over("rubbed presses", Unit::Plain, marks.iter().map(|mark| mark.x), 1.0, 1.0),
        y: Axis::over("", Unit::Metres, marks.iter().map(|mark| mark.y), FLOOR_M, 1.0),
        series: curves().zip(CLASSES).map(|(curve, class)| series(curve, class)).collect(),
        has_front: false,
        guide: None,
        level: None,
        size: [430.0, 380.0],
    }
}

fn series(curve: &Curve, class: &'static str) -> Series {
    let mark = |point: &Point| {
        let figures = &point.figures;
        let tooltip = format!(
            "{} presses at {} LSB: {}, count right in {:.0} %, {} calibrations refused",
            point.frames,
            curve.noise_lsb,
            Unit::Metres.text(figures.error_m?),
            100.0 * figures.count_right,
            point.refused
        );
        Some(Mark { x: point.frames as f64, y: figures.error_m?, tooltip })
    };
    let marks: Vec<Mark> = curve.points.iter().filter(|point| point.frames > 0).filter_map(mark).collect();
    let main = marks.len() / 2;
    Series { name: format!("{} LSB", curve.noise_lsb), class, marks, main, is_joined: true }
}
