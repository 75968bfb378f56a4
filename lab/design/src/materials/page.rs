//! The study as a page: claims, maps of every figure, and where the foams lie.

use tactomo_study::page::{Axis, Chart, Map, Mark, Series, Unit, escaped, folded, table};

use super::super::Imaging;
use super::super::imaging::figure;
use super::super::text::number;
use super::claims::extent;
use super::{Condition, Report};

/// Two conductivities that are one node of the map (relative).
const SAME: f64 = 1e-9;

/// A figure of the map.
struct Figure {
    title: &'static str,
    subtitle: &'static str,
    is_log: bool,
    text: fn(f64) -> String,
    of: fn(&Condition) -> Option<f64>,
    /// What an empty cell is.
    empty: &'static str,
}

const OPEN: &str = "not determined";
const SPREAD_OUT: &str = "collapsed: half height reaches the corners";
const CENTRAL: &str = "collapsed: the middle, wherever the contact is";

const EXACT: [Figure; 4] = [
    Figure {
        title: "SENS",
        subtitle: "slope at 5 S/m, V per S/m · light is better",
        is_log: true,
        text: three,
        of: |c| c.exact.sensitivity(),
        empty: OPEN,
    },
    Figure {
        title: "FMAX",
        subtitle: "contact at 90 % of saturation, S/m · light is better",
        is_log: true,
        text: three,
        of: |c| c.exact.maximum(),
        empty: OPEN,
    },
    Figure {
        title: "SR",
        subtitle: "1 - half width / width · light is sharper",
        is_log: false,
        text: two,
        of: |c| c.exact.imaging.sharpness(),
        empty: SPREAD_OUT,
    },
    Figure {
        title: "PA",
        subtitle: "1 - error / width, nine places · light is better",
        is_log: false,
        text: two,
        of: |c| c.exact.imaging.accuracy(),
        empty: CENTRAL,
    },
];

/// The same where each contact is at half of the drive.
const AT_HALF: [Figure; 2] = [
    Figure {
        title: "SR at half of the drive",
        of: |c| c.at_half.as_ref().and_then(|at_half| at_half.imaging.sharpness()),
        ..EXACT[2]
    },
    Figure {
        title: "PA at half of the drive",
        of: |c| c.at_half.as_ref().and_then(|at_half| at_half.imaging.accuracy()),
        ..EXACT[3]
    },
];

const NOISY: [Figure; 4] = [
    Figure { title: "SENS with noise", of: |c| c.noisy.sensitivity(), ..EXACT[0] },
    Figure { title: "FMAX with noise", of: |c| c.noisy.maximum(), ..EXACT[1] },
    Figure { title: "SR with noise", of: |c| c.noisy.imaging.sharpness(), ..EXACT[2] },
    Figure { title: "PA with noise", of: |c| c.noisy.imaging.accuracy(), ..EXACT[3] },
];

const LIMITS: [Figure; 6] = [
    Figure {
        title: "Signal to noise",
        subtitle: "largest reading, dB · light is better",
        is_log: false,
        text: whole,
        of: |c| Some(c.limit.signal_to_noise_db),
        empty: OPEN,
    },
    Figure {
        title: "Saturation",
        subtitle: "contact at 90 % of the drive, S/m · light takes more",
        is_log: true,
        text: three,
        of: |c| c.limit.range[1],
        empty: OPEN,
    },
    Figure {
        title: "Two points",
        subtitle: "least distance told apart, mm · dark is better",
        is_log: true,
        text: three,
        of: |c| c.limit.two_points_m.map(|m| m * 1e3),
        empty: OPEN,
    },
    Figure {
        title: "Place",
        subtitle: "standard error at nine places, mm · dark is better",
        is_log: true,
        text: three,
        of: |c| c.limit.place_m.map(|m| m * 1e3),
        empty: OPEN,
    },
    Figure {
        title: "Decades of strength",
        subtitle: "from noise to saturation · light is more",
        is_log: false,
        text: one,
        of: Condition::decades,
        empty: OPEN,
    },
    Figure {
        title: "auto",
        subtitle: "its error at nine places, one frame, mm · dark is better",
        is_log: true,
        text: three,
        of: |c| c.reached.and_then(|reached| reached.place_m).map(|m| m * 1e3),
        empty: OPEN,
    },
];

/// What the page shows below the claims.
pub(super) fn parts(report: &Report) -> Vec<String> {
    vec![
        "<h2>The paper's metrics</h2><p class=\"quiet\">SENS and FMAX are of the largest reading, SR and PA of its image: thin shell and Tikhonov, without noise. A slab of 60 x 60 x 10 mm, 16 \
         electrodes of 4 mm, a contact of 4 mm whose conductivity, down to 0.5 mm, stands for force. Letters are the foams and stacks of its table I, the upper letter first.</p>"
            .to_owned(),
        format!("<p class=\"quiet\">{}</p>", escaped(&collapsed(report))),
        maps(report, &EXACT),
        maps(report, &AT_HALF),
        folded("The same with the converter's noise", &maps(report, &NOISY)),
        "<h2>The sensor's own limit</h2><p class=\"quiet\">Cramer and Rao's bounds of one frame, 12 bits with 1.5 LSB of noise, for a contact of \
         1 S/m whose radius is known to a factor of two.</p>"
            .to_owned(),
        maps(report, &LIMITS),
        "<h2>Where the foams lie</h2><p class=\"quiet\">Each metric from 0 for the lowest of the map to 1 for the highest, collapsed images included. Of a grey mark an image has collapsed.</p>"
            .to_owned(),
        format!("<div class=\"charts\">{}{}</div>", positions(report, [2, 1]).svg(), positions(report, [3, 0]).svg()),
        samples(report),
    ]
}

/// How many images have collapsed, and what that gives.
fn collapsed(report: &Report) -> String {
    let all = report.conditions.len();
    let count = |is: fn(&Condition) -> bool| report.conditions.iter().filter(|c| is(c)).count();
    let half = |is: fn(&Imaging) -> bool| {
        report.conditions.iter().filter(|c| c.at_half.as_ref().is_some_and(|half| is(&half.imaging))).count()
    };
    format!(
        "Grey cells are images that have collapsed, and are left out of all that is concluded. Of {all} conditions {} ({} at half of the drive) have an image of the contact in the \
         middle that is above half of its height at the corners: SR is what the outline gives. {} ({}) see every contact in the middle, within 1 % of the width: \
         PA is {:.3}, what answering \"the middle\" gives over the nine places.",
        count(|c| c.exact.imaging.is_spread_out),
        half(|imaging| imaging.is_spread_out),
        count(|c| c.exact.imaging.is_central),
        half(|imaging| imaging.is_central),
        report.accuracy_of_the_middle
    )
}

fn maps(report: &Report, figures: &[Figure]) -> String {
    let has_any = |figure: &&Figure| report.conditions.iter().any(|c| (figure.of)(c).is_some());
    let all: String = figures.iter().filter(has_any).map(|figure| map(report, figure).svg() + "\n").collect();
    format!("<div class=\"maps\">{all}</div>")
}

fn map(report: &Report, figure: &Figure) -> Map {
    let ticks = &report.conductivities_s_per_m;
    let is = |a: f64, b: f64| (a / b - 1.0).abs() < SAME;
    let value = |bottom: f64, top: f64| {
        let found = report.conditions.iter().find(|c| is(c.bottom_s_per_m, bottom) && is(c.top_s_per_m, top));
        found.and_then(figure.of)
    };
    let rows = ticks.iter().map(|top| ticks.iter().map(|bottom| value(*bottom, *top)).collect()).collect();
    let mark =
        |c: &Condition| Some(([c.bottom_s_per_m, c.top_s_per_m], c.name.filter(|name| *name != "BB")?.to_owned()));
    Map {
        title: figure.title.to_owned(),
        subtitle: figure.subtitle.to_owned(),
        axes: ["bottom, S/m".to_owned(), "top, S/m".to_owned()],
        ticks: [ticks.clone(), ticks.clone()],
        rows,
        empty: figure.empty,
        is_log: figure.is_log,
        text: figure.text,
        marks: report.samples.iter().filter_map(mark).collect(),
    }
}

/// A metric whatever its image is, and whether that has collapsed.
fn shown(index: usize, c: &Condition) -> (Option<f64>, bool) {
    let imaging = &c.exact.imaging;
    match index {
        2 => (imaging.spatial_resolution, imaging.is_spread_out),
        3 => (imaging.position_accuracy, imaging.is_central),
        _ => ((EXACT[index].of)(c), false),
    }
}

/// Samples between two of the metrics, each from 0 for the lowest of the map to 1 for the highest, with the curve of uniform materials.
fn positions(report: &Report, indices: [usize; 2]) -> Chart {
    let [x, y] = indices.map(|index| &EXACT[index]);
    let scale = |index: usize| {
        let scaled = move |value: f64| if EXACT[index].is_log { value.ln() } else { value };
        let [low, high] = extent(report.conditions.iter().filter_map(|c| shown(index, c).0).map(scaled));
        move |value: f64| Some((scaled(value) - low) / (high - low)).filter(|share| share.is_finite())
    };
    let mark = |c: &Condition| {
        let [at_x, at_y] = indices.map(|index| shown(index, c).0.and_then(scale(index)));
        let text = |index: usize| number(shown(index, c).0, 1.0);
        let tooltip = format!("{}: {} {}, {} {}", c.title(), x.title, text(indices[0]), y.title, text(indices[1]));
        Some(Mark { x: at_x?, y: at_y?, tooltip })
    };
    let sample = |c: &Condition| {
        let is_collapsed = indices.iter().any(|index| shown(*index, c).1);
        let class = if is_collapsed { "collapsed" } else { "contacts" };
        Some(Series { name: c.name?.to_owned(), class, marks: vec![mark(c)?], main: 0, is_joined: false })
    };
    let uniform: Vec<Mark> =
        report.conditions.iter().filter(|c| c.bottom_s_per_m == c.top_s_per_m).filter_map(mark).collect();
    let main = uniform.len() / 2;
    let uniform = Series { name: "uniform".to_owned(), class: "bound", marks: uniform, main, is_joined: true };
    let axis = |figure: &Figure| {
        let title = format!("{}{}, normalised", if figure.is_log { "log " } else { "" }, figure.title);
        Axis { range: [-0.05, 1.1], ..Axis::linear(&title, Unit::Plain, []) }
    };
    let middle = scale(3)(report.accuracy_of_the_middle).filter(|_| indices[0] == 3);
    Chart {
        title: format!("{} and {}", x.title, y.title),
        subtitle: format!("{} upwards · right and up is better", axis(y).title),
        x: axis(x),
        y: axis(y),
        series: report.samples.iter().filter_map(sample).chain([uniform]).collect(),
        has_front: false,
        guide: middle.map(|middle| (middle, "answering \"the middle\"")),
        level: None,
        size: [430.0, 380.0],
    }
}

fn samples(report: &Report) -> String {
    let row = |c: &Condition| {
        let reached = c.reached.and_then(|reached| reached.place_m);
        let plain = |value: Option<f64>| number(value, 1.0);
        let mm = |value: Option<f64>| number(value, 1e3);
        vec![
            c.name.unwrap_or_default().to_owned(),
            plain(c.exact.sensitivity()),
            plain(c.exact.maximum()),
            plain(c.exact.printed_maximum),
            figure(&c.exact.imaging, 0),
            figure(&c.exact.imaging, 1),
            figure(&c.noisy.imaging, 1),
            whole(c.limit.signal_to_noise_db),
            mm(c.limit.place_m),
            mm(reached),
            mm(c.limit.two_points_m),
            plain(c.limit.range[1]),
            plain(c.force_range_n[1]),
        ]
    };
    let heads = [
        "sample",
        "SENS, V per S/m",
        "FMAX, S/m",
        "as printed",
        "SR",
        "PA",
        "PA, noise",
        "S/N, dB",
        "place, mm",
        "auto, mm",
        "two points, mm",
        "saturates at, S/m",
        "at, N",
    ];
    let rows: Vec<_> = report.samples.iter().map(row).collect();
    table(&heads, &rows)
        + "<p class=\"note\">FMAX follows from eq. (6); eq. (8) as printed does not. A dash: the figure is open; in brackets: of images that have collapsed. Newtons are those of Hertz's ball of 5 mm on a foam \
           as soft as the sample's; the mesh between foam and driving layer, which a press must bend first, is not in them.</p>"
}

fn three(value: f64) -> String {
    number(Some(value), 1.0)
}

fn two(value: f64) -> String {
    format!("{value:.2}")
}

fn one(value: f64) -> String {
    format!("{value:.1}")
}

fn whole(value: f64) -> String {
    format!("{value:.0}")
}
