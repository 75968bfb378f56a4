//! The study as a page: claims, maps of every figure, and where the foams lie.

use tactomo_study::page::{Axis, Chart, Map, Mark, Series, Unit, folded, table};

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
}

const EXACT: [Figure; 4] = [
    Figure {
        title: "SENS",
        subtitle: "slope at 5 S/m, V per S/m · light is better",
        is_log: true,
        text: three,
        of: |c| c.exact.sensitivity(),
    },
    Figure {
        title: "FMAX",
        subtitle: "contact at 90 % of saturation, S/m · light is better",
        is_log: true,
        text: three,
        of: |c| c.exact.maximum(),
    },
    Figure {
        title: "SR",
        subtitle: "1 - half width / width · light is sharper",
        is_log: false,
        text: two,
        of: |c| c.exact.spatial_resolution,
    },
    Figure {
        title: "PA",
        subtitle: "1 - error / width, nine places · light is better",
        is_log: false,
        text: two,
        of: |c| c.exact.position_accuracy,
    },
];

const NOISY: [Figure; 4] = [
    Figure { title: "SENS with noise", of: |c| c.noisy.sensitivity(), ..EXACT[0] },
    Figure { title: "FMAX with noise", of: |c| c.noisy.maximum(), ..EXACT[1] },
    Figure { title: "SR with noise", of: |c| c.noisy.spatial_resolution, ..EXACT[2] },
    Figure { title: "PA with noise", of: |c| c.noisy.position_accuracy, ..EXACT[3] },
];

const LIMITS: [Figure; 6] = [
    Figure {
        title: "Signal to noise",
        subtitle: "largest reading, dB · light is better",
        is_log: false,
        text: whole,
        of: |c| Some(c.limit.signal_to_noise_db),
    },
    Figure {
        title: "Saturation",
        subtitle: "contact at 90 % of the drive, S/m · light takes more",
        is_log: true,
        text: three,
        of: |c| c.limit.range[1],
    },
    Figure {
        title: "Two points",
        subtitle: "least distance told apart, mm · dark is better",
        is_log: true,
        text: three,
        of: |c| c.limit.two_points_m.map(|m| m * 1e3),
    },
    Figure {
        title: "Place",
        subtitle: "standard error at nine places, mm · dark is better",
        is_log: true,
        text: three,
        of: |c| c.limit.place_m.map(|m| m * 1e3),
    },
    Figure {
        title: "Decades of strength",
        subtitle: "from noise to saturation · light is more",
        is_log: false,
        text: one,
        of: Condition::decades,
    },
    Figure {
        title: "auto",
        subtitle: "its error at nine places, one frame, mm · dark is better",
        is_log: true,
        text: three,
        of: |c| c.reached.and_then(|reached| reached.place_m).map(|m| m * 1e3),
    },
];

/// What the page shows below the claims.
pub(super) fn parts(report: &Report) -> Vec<String> {
    vec![
        "<h2>The paper's metrics</h2><p class=\"quiet\">Thin shell and Tikhonov's image, without noise. A slab of 60 x 60 x 10 mm, 16 electrodes of 4 mm, a contact of \
         4 mm whose conductivity, down to 0.5 mm, stands for force. Letters are the foams and stacks of its table I, the upper letter first.</p>"
            .to_owned(),
        maps(report, &EXACT),
        folded("The same with the converter's noise", &maps(report, &NOISY)),
        "<h2>The sensor's own limit</h2><p class=\"quiet\">Cramer and Rao's bounds of one frame, 12 bits with 1.5 LSB of noise, for a contact of \
         1 S/m whose radius is known to a factor of two.</p>"
            .to_owned(),
        maps(report, &LIMITS),
        "<h2>Where the foams lie</h2>".to_owned(),
        format!("<div class=\"charts\">{}{}</div>", positions(report, [2, 1]).svg(), positions(report, [3, 0]).svg()),
        samples(report),
    ]
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
        is_log: figure.is_log,
        text: figure.text,
        marks: report.samples.iter().filter_map(mark).collect(),
    }
}

/// Samples between two of the metrics, each from 0 for the worst condition of the map to 1 for the best, with the curve of uniform materials.
fn positions(report: &Report, [x, y]: [usize; 2]) -> Chart {
    let [x, y] = [x, y].map(|index| &EXACT[index]);
    let normalised = |figure: &Figure, c: &Condition| {
        let scaled = |value: f64| if figure.is_log { value.ln() } else { value };
        let [low, high] = extent(report.conditions.iter().filter_map(figure.of).map(scaled));
        (figure.of)(c).map(|value| (scaled(value) - low) / (high - low)).filter(|share| share.is_finite())
    };
    let mark = |c: &Condition| {
        let tooltip =
            format!("{}: {} {}, {} {}", c.title(), x.title, number((x.of)(c), 1.0), y.title, number((y.of)(c), 1.0));
        Some(Mark { x: normalised(x, c)?, y: normalised(y, c)?, tooltip })
    };
    let sample = |c: &Condition| {
        Some(Series { name: c.name?.to_owned(), class: "contacts", marks: vec![mark(c)?], main: 0, is_joined: false })
    };
    let uniform: Vec<Mark> =
        report.conditions.iter().filter(|c| c.bottom_s_per_m == c.top_s_per_m).filter_map(mark).collect();
    let main = uniform.len() / 2;
    let uniform = Series { name: "uniform".to_owned(), class: "bound", marks: uniform, main, is_joined: true };
    let axis = |figure: &Figure| {
        let title = format!("{}{}, normalised", if figure.is_log { "log " } else { "" }, figure.title);
        Axis { range: [-0.05, 1.1], ..Axis::linear(&title, Unit::Plain, []) }
    };
    Chart {
        title: format!("{} and {}", x.title, y.title),
        subtitle: format!("{} upwards · right and up is better", axis(y).title),
        x: axis(x),
        y: axis(y),
        series: report.samples.iter().filter_map(sample).chain([uniform]).collect(),
        has_front: false,
        guide: None,
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
            plain(c.exact.spatial_resolution),
            plain(c.exact.position_accuracy),
            plain(c.noisy.position_accuracy),
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
        + "<p class=\"note\">FMAX follows from eq. (6); eq. (8) as printed does not. A dash: the figure is open. Newtons are those of Hertz's ball of 5 mm on a foam \
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
