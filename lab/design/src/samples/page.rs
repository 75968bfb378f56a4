//! The study as parts of a page: figures simulated beside measured, the paper's normalised planes, and what is left open of its solver.

use tactomo_study::page::{Axis, Chart, Mark, Series, Unit, escaped, folded, table};

use super::super::imaging::figure;
use super::super::text::number;
use super::card::card;
use super::claims::METRICS;
use super::planes::planes;
use super::table::{banded, below_the_middle, maximum, sensitivity};
use super::{Choice, Choices, Report, Sample};

pub(super) fn parts(report: &Report) -> Vec<String> {
    let cards: String = report.samples.iter().map(card).collect();
    let charts: String =
        METRICS.iter().zip(TITLES).map(|(metric, title)| beside(report, metric, title).svg() + "\n").collect();
    let mut parts = vec![
        "<h3>Simulated against measured</h3><p class=\"quiet\">Grey: the simulated image has collapsed, and takes no part in rank correlations.</p>".to_owned(),
        format!("<div class=\"charts small\">{charts}</div>"),
        format!("<p class=\"quiet\">{}</p>", escaped(&below_the_middle(report))),
        figures(report),
    ];
    parts.extend(planes(report));
    parts.extend(report.choices.as_ref().map(choices));
    parts.push(
        "<h3>Sample by sample</h3><p class=\"quiet\">Left: output (S/m2 over a sheet of 1 S) over force (N), loading (dots), unloading (rings, with 10 % of hysteresis) and eq. (6). \
         Middle: image along the line through the middle (mm) at 2.25 N, over its largest value. Right: where the contacts are (crosses) and where the paper's solver sees them (dots) at \
         2.25 N, in half widths; `auto` sees them within the crosses.</p>"
            .to_owned(),
    );
    parts.push(format!("<div class=\"cards\">{cards}</div>"));
    parts
}

const TITLES: [&str; 4] = ["SENS", "FMAX, N", "SR", "PA"];
const MIDDLE: &str = "the middle";

/// Each sample's simulated figure over its measured one; grey where the image has collapsed.
fn beside(report: &Report, metric: &super::claims::Metric, title: &str) -> Chart {
    let series = |sample: &Sample| {
        let imaging = &sample.imaging;
        let (y, is_collapsed) = match title {
            "SR" => (imaging.spatial_resolution, imaging.is_spread_out),
            "PA" => (imaging.position_accuracy, imaging.is_central),
            _ => ((metric.solver)(sample), false),
        };
        let (x, y) = ((metric.measured)(sample)?, y?);
        let tooltip =
            format!("{}: measured {}, simulated {}", sample.measured.name, number(Some(x), 1.0), number(Some(y), 1.0));
        let class = if is_collapsed { "collapsed" } else { "contacts" };
        let marks = vec![Mark { x, y, tooltip }];
        Some(Series { name: sample.measured.name.to_owned(), class, marks, main: 0, is_joined: false })
    };
    let series: Vec<Series> = report.samples.iter().filter_map(series).collect();
    let middle = Some(report.accuracy_of_the_middle).filter(|_| title == "PA");
    let values =
        |of: fn(&Mark) -> f64| series.iter().flat_map(|series| &series.marks).map(of).chain(middle).collect::<Vec<_>>();
    let (x, y) = (values(|mark| mark.x), values(|mark| mark.y));
    let axis = |values: Vec<f64>| match title {
        "SENS" | "FMAX, N" => Axis::over("measured", Unit::Plain, values, 1e-9, 1.0),
        "SR" => Axis::linear("measured", Unit::Plain, values.into_iter().chain([0.25, 0.8])),
        _ => Axis::linear("measured", Unit::Plain, values),
    };
    Chart {
        title: title.to_owned(),
        subtitle: "simulated upwards".to_owned(),
        x: axis(x),
        y: axis(y),
        series,
        has_front: false,
        guide: middle.map(|middle| (middle, MIDDLE)),
        level: middle.map(|middle| (middle, MIDDLE)),
        size: [360.0, 300.0],
    }
}

/// What the paper leaves open of its solver, and which SR and PA each choice gives.
fn choices(choices: &Choices) -> String {
    let row = |choice: &Choice| {
        let share = |value: f64| format!("{value:.2e}");
        vec![
            choice.lambda.unwrap_or("the nearest").to_owned(),
            choice.rows.to_owned(),
            choice.pads.to_owned(),
            share(choice.lambda_share),
            choice.resolution_text(),
            format!("{:.3}", choice.position_accuracy),
        ]
    };
    let heads = ["lambda^2 = 5000 is of", "readings", "pads", "lambda, share", "SR", "PA"];
    let of = |all: &mut dyn Iterator<Item = &Choice>| table(&heads, &all.map(row).collect::<Vec<_>>());
    format!(
        "<h3>What is left open of its solver</h3><p class=\"quiet\">The paper gives lambda^2 = 5000 without a unit, and neither which readings are taken nor what the pads of its shell \
         are. Each choice gives SR and PA of sample A, measured as {} and {}; in brackets: collapsed. {}. A share is of the largest singular value.</p>{}{}{}",
        choices.measured[0],
        choices.measured[1],
        escaped(&capital(&choices.text())),
        of(&mut choices.one_at_a_time()),
        folded("With the lambda that comes nearest to both", &of(&mut choices.nearest.iter())),
        folded("All combinations", &of(&mut choices.printed.iter()))
    )
}

/// A sentence from its first letter on.
fn capital(text: &str) -> String {
    let mut letters = text.chars();
    letters.next().map_or(String::new(), |first| first.to_uppercase().chain(letters).collect())
}

fn figures(report: &Report) -> String {
    let heads = [
        "sample",
        "SENS [measured]",
        "FMAX, N",
        "[measured]",
        "SR",
        "[measured]",
        "PA",
        "[measured]",
        "place, mm",
        "auto, mm",
        "two points, mm",
        "S/N, dB",
        "90 % at, N",
    ];
    let row = |sample: &Sample| {
        let (measured, limit) = (&sample.measured, &sample.limit);
        let plain = |value: Option<f64>| number(value, 1.0);
        let mm = |value: Option<f64>| number(value, 1e3);
        vec![
            measured.name.to_owned(),
            format!("{} [{}]", plain(sensitivity(sample)), measured.sensitivity_mv_per_n),
            banded(maximum(sample), "N"),
            measured.maximum_text(),
            figure(&sample.imaging, 0),
            plain(Some(measured.spatial_resolution)),
            figure(&sample.imaging, 1),
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
        + "<p class=\"note\">Simulated SENS is in S/m2 of a sheet of 1 S per newton, measured in mV/N: only their order can be compared. FMAX with its 95 % band, and as printed; a failed fit is far beyond the 5 N that were applied. SR and PA in brackets: of images that have collapsed. Place, two points and S/N are the sensor's own limit \
           at 2.25 N.</p>"
}
