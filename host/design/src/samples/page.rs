//! The study as parts of a page: small charts of each sample, simulated beside measured.

use std::fmt::Write;

use tactomo_physics::geometry::Point;
use tactomo_study::page::{Axis, Chart, Mark, Series, Unit, escaped, table};

use super::super::text::number;
use super::claims::METRICS;
use super::table::{banded, maximum, sensitivity};
use super::{Report, Sample};

/// Side of a small chart, and room around its plot (px).
const SIDE: f64 = 150.0;
const ROOM: f64 = 16.0;
/// Half of the detector's side (m): places are drawn from -1 to 1.
const HALF_M: f64 = 0.030;
/// Points of a fitted curve.
const CURVE_POINTS: usize = 60;

pub(super) fn parts(report: &Report) -> Vec<String> {
    let cards: String = report.samples.iter().map(card).collect();
    let charts: String =
        METRICS.iter().zip(TITLES).map(|(metric, title)| beside(report, metric, title).svg() + "\n").collect();
    vec![
        "<h3>Simulated against measured</h3>".to_owned(),
        format!("<div class=\"charts small\">{charts}</div>"),
        figures(report),
        "<h3>Sample by sample</h3><p class=\"quiet\">Left: output over force, loading (dots), unloading (rings, with 10 % of hysteresis) and eq. (6). Middle: image along the line through the \
         middle at 2.25 N. Right: where the contacts are (crosses) and where the paper's solver sees them (dots) at 2.25 N; `auto` sees them within \
         the crosses.</p>"
            .to_owned(),
        format!("<div class=\"maps\">{cards}</div>"),
    ]
}

const TITLES: [&str; 4] = ["SENS", "FMAX, N", "SR", "PA"];

/// Each sample's simulated figure over its measured one.
fn beside(report: &Report, metric: &super::claims::Metric, title: &str) -> Chart {
    let series = |sample: &Sample| {
        let (x, y) = ((metric.measured)(sample)?, (metric.solver)(sample)?);
        let tooltip =
            format!("{}: measured {}, simulated {}", sample.measured.name, number(Some(x), 1.0), number(Some(y), 1.0));
        let marks = vec![Mark { x, y, tooltip }];
        Some(Series { name: sample.measured.name.to_owned(), class: "contacts", marks, main: 0, is_joined: false })
    };
    let series: Vec<Series> = report.samples.iter().filter_map(series).collect();
    let values = |of: fn(&Mark) -> f64| series.iter().flat_map(|series| &series.marks).map(of).collect::<Vec<_>>();
    let (x, y) = (values(|mark| mark.x), values(|mark| mark.y));
    let axis = |title: &str, values: Vec<f64>| match title {
        "SENS" | "FMAX, N" => Axis::over("measured", Unit::Plain, values, 1e-9, 1.0),
        _ => Axis::linear("measured", Unit::Plain, values),
    };
    Chart {
        title: title.to_owned(),
        subtitle: "simulated upwards".to_owned(),
        x: axis(title, x),
        y: axis(title, y),
        series,
        has_front: false,
        guide: None,
        size: [330.0, 280.0],
    }
}

fn figures(report: &Report) -> String {
    let heads = [
        "simulated (measured)",
        "SENS (mV/N)",
        "FMAX, N, 95 % band",
        "(N)",
        "SR",
        "(SR)",
        "PA",
        "(PA)",
        "place, mm",
        "auto, mm",
        "two points, mm",
        "S/N, dB",
        "saturates at, N",
    ];
    let row = |sample: &Sample| {
        let (measured, limit) = (&sample.measured, &sample.limit);
        let plain = |value: Option<f64>| number(value, 1.0);
        let mm = |value: Option<f64>| number(value, 1e3);
        vec![
            measured.name.to_owned(),
            format!("{} ({})", plain(sensitivity(sample)), measured.sensitivity_mv_per_n),
            banded(maximum(sample), "N"),
            measured.maximum_n.map_or("failed fit".to_owned(), |n| plain(Some(n))),
            plain(sample.spatial_resolution),
            plain(Some(measured.spatial_resolution)),
            plain(sample.position_accuracy),
            plain(Some(measured.position_accuracy)),
            mm(limit.place_m),
            mm(sample.reached.place_m),
            mm(limit.two_points_m),
            format!("{:.0}", limit.signal_to_noise_db),
            plain(limit.range[1]),
        ]
    };
    let rows: Vec<_> = report.samples.iter().map(row).collect();
    table(&heads, &rows)
        + "<p class=\"note\">Simulated SENS is in S/m2 of a sheet of 1 S per newton, measured in mV/N: only their order can be compared. Place, two points and S/N are the sensor's own limit \
           at 2.25 N.</p>"
}

/// Three small charts of a sample.
fn card(sample: &Sample) -> String {
    let name = escaped(sample.measured.name);
    format!(
        "<section><h4>{name}</h4><svg class=\"chart\" viewBox=\"0 0 {} {SIDE}\" role=\"img\" aria-label=\"{name}: force and output, profile, places\">{}{}{}</svg></section>",
        3.0 * SIDE,
        force_output(sample),
        at(1, &profile(sample)),
        at(2, &places(sample))
    )
}

fn at(column: usize, content: &str) -> String {
    format!("<g transform=\"translate({} 0)\">{content}</g>", column as f64 * SIDE)
}

/// A point of a plot (px) from shares of its sides.
fn place(x: f64, y: f64) -> (f64, f64) {
    (ROOM + x * (SIDE - 2.0 * ROOM), SIDE - ROOM - y * (SIDE - 2.0 * ROOM))
}

fn frame(ends: [&str; 2]) -> String {
    let (side, bottom) = (SIDE - 2.0 * ROOM, SIDE - 3.0);
    format!(
        "<rect class=\"guide\" x=\"{ROOM}\" y=\"{ROOM}\" width=\"{side}\" height=\"{side}\"/>\
         <text class=\"tick\" x=\"{ROOM}\" y=\"{bottom}\">{}</text>\
         <text class=\"tick\" x=\"{}\" y=\"{bottom}\" text-anchor=\"end\">{}</text>",
        ends[0],
        SIDE - ROOM,
        ends[1]
    )
}

fn force_output(sample: &Sample) -> String {
    let all = || sample.loading.iter().chain(&sample.unloading);
    let largest = all().map(|[_, output]| *output).fold(f64::MIN_POSITIVE, f64::max);
    let most_n = all().map(|[force, _]| *force).fold(f64::MIN_POSITIVE, f64::max);
    let on_plot = |force_n: f64, output: f64| place(force_n / most_n, (output / largest).clamp(0.0, 1.0));
    let mut svg = frame(["0 N", &format!("{most_n:.0} N")]);
    for (points, class) in [(&sample.unloading, "ring"), (&sample.loading, "dot")] {
        for [force_n, output] in points {
            let (x, y) = on_plot(*force_n, *output);
            _ = write!(svg, "<circle class=\"{class}\" cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"1.8\"/>");
        }
    }
    if let Some(fit) = &sample.curve {
        let curve = (0..=CURVE_POINTS).map(|index| {
            let force_n = most_n * index as f64 / CURVE_POINTS as f64;
            on_plot(force_n, fit.curve.output(force_n))
        });
        svg += &line(curve);
    }
    format!("<g class=\"contacts\">{svg}</g>")
}

fn profile(sample: &Sample) -> String {
    let points = sample.profile.iter().map(|[x_m, share]| place((x_m / HALF_M + 1.0) / 2.0, share.max(0.0)));
    format!("<g class=\"linear\">{}{}</g>", frame(["-30 mm", "30 mm"]), line(points))
}

fn places(sample: &Sample) -> String {
    let on_plot = |[x_m, y_m]: Point| place((x_m / HALF_M + 1.0) / 2.0, (y_m / HALF_M + 1.0) / 2.0);
    let mut svg = frame(["-1", "1"]);
    for [truth_m, found_m] in &sample.places_m {
        let ((x, y), (to_x, to_y)) = (on_plot(*truth_m), on_plot(*found_m));
        _ = write!(
            svg,
            "<path class=\"cross\" d=\"M{:.1} {y:.1}h6M{x:.1} {:.1}v6\"/><path class=\"lead\" d=\"M{x:.1} {y:.1}L{to_x:.1} {to_y:.1}\"/>\
             <circle class=\"dot\" cx=\"{to_x:.1}\" cy=\"{to_y:.1}\" r=\"2.5\"/>",
            x - 3.0,
            y - 3.0
        );
    }
    format!("<g class=\"paper\">{svg}</g>")
}

fn line(points: impl Iterator<Item = (f64, f64)>) -> String {
    let points: Vec<_> = points.map(|(x, y)| format!("{x:.1},{y:.1}")).collect();
    format!("<polyline points=\"{}\"/>", points.join(" "))
}
