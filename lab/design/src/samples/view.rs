//! What the study shows: figures simulated beside measured, the paper's normalised planes, what is left open of its solver, and each sample.

use tactomo_study::view::{Axis, Chart, Format, MM, Mark, PLAIN, Series, TEXT, Table, Unit, Value, View};

use super::super::curve::Figure;
use super::super::imaging::figure;
use super::{Choice, Choices, Report, Sample};

/// Where a failed fit is drawn in a plane: above all others.
const FAILED: f64 = 1.08;
/// Half of the detector's side (m): places are drawn from -1 to 1.
const HALF_M: f64 = 0.030;
/// Points of a fitted curve.
const CURVE_POINTS: usize = 60;
/// Width and height of a small chart of a sample (px).
const SMALL: [f64; 2] = [214.0, 220.0];
const MIDDLE: &str = "the middle";
const NEWTONS: Format = Format::new("N", "n");
const DECIBELS: Format = Format::new("dB", "db").digits(0);

/// A metric of a sample, and whether it is a figure: a failed fit and a collapsed image are none.
type Of = fn(&Sample) -> (Option<f64>, bool);

/// A metric: its name, whether it is even in its logarithm, measured and simulated.
struct Metric(&'static str, bool, [Of; 2]);

const METRICS: [Metric; 4] = [
    Metric("SENS", true, [|one| (Some(one.measured.sensitivity_mv_per_n), true), |one| (sensitivity(one), true)]),
    Metric(
        "FMAX",
        true,
        [
            |one| (Some(one.measured.printed_maximum_n), one.measured.maximum_n.is_some()),
            |one| (maximum(one).value(), true),
        ],
    ),
    Metric(
        "SR",
        false,
        [
            |one| (Some(one.measured.spatial_resolution), true),
            |one| (one.imaging.spatial_resolution, !one.imaging.is_spread_out),
        ],
    ),
    Metric(
        "PA",
        false,
        [
            |one| (Some(one.measured.position_accuracy), true),
            |one| (one.imaging.position_accuracy, !one.imaging.is_central),
        ],
    ),
];

/// Simulated and measured figures of each sample.
pub fn view(report: &Report) -> View {
    let lead = "Foams A to D and stacks of them under an indenter of 5 mm, simulated as the paper measured them, with its measured figures beside: does \
                the simulation predict the experiment?";
    let beside =
        "Simulated against measured. Grey: the simulated image has collapsed, and takes no part in rank correlations.";
    let planes = "The planes of figure 6, each metric from 0 for the lowest of these samples to 1 for the highest, SENS and FMAX in their logarithms: as \
                  the paper measured them, and as they are simulated. Grey: a failed fit, above all others, or a collapsed image. A sample is missing \
                  where a figure is not determined.";
    let cards = "Sample by sample: output (S/m2 over a sheet of 1 S) over force (N), loading (dark), unloading (pale, with 10 % of hysteresis) and eq. (6); \
                 image along the line through the middle at 2.25 N, over its largest value; and where the contacts are (pale) and where the paper's \
                 solver sees them (dark) at 2.25 N, in half widths. `auto` sees them within the pale dots.";
    let both = [[&METRICS[2], &METRICS[1]], [&METRICS[3], &METRICS[0]]];
    let view = report
        .course
        .view("The paper's samples", lead)
        .figures(beside, METRICS.iter().map(|metric| self::beside(report, metric)))
        .with(figures(report))
        .text(below_the_middle(report))
        .figures(planes, both.into_iter().flat_map(|axes| [0, 1].map(|side| plane(report, axes, side))));
    let view = match &report.choices {
        Some(choices) => of_choices(view, choices),
        None => view,
    };
    view.figures(cards, report.samples.iter().flat_map(card))
}

fn sensitivity(sample: &Sample) -> Option<f64> {
    sample.curve.and_then(|fit| fit.sensitivity.value())
}

fn maximum(sample: &Sample) -> Figure {
    sample.curve.map_or(Figure::Open, |fit| fit.maximum_force)
}

/// A figure with its band, or what is known of it.
fn banded(figure: Figure) -> String {
    let three = |value: f64| PLAIN.text(Some(value));
    match figure {
        Figure::Determined { value, low, high } => format!("{}, {} to {}", three(value), three(low), three(high)),
        Figure::Above(least) => format!("not determined, above {least:.0}"),
        Figure::Open => "not determined".to_owned(),
    }
}

/// Which measured PA are worse than answering "the middle": a sentence.
fn below_the_middle(report: &Report) -> String {
    let middle = report.accuracy_of_the_middle;
    let below = report.samples.iter().filter(|sample| sample.measured.position_accuracy < middle);
    let below: Vec<&str> = below.map(|sample| sample.measured.name).collect();
    format!(
        "Answering \"the middle\", whatever is read, has PA {middle:.3} over the nine places; of {} measured PA {} are below that ({}).",
        report.samples.len(),
        below.len(),
        below.join(", ")
    )
}

/// A sample at two values, grey where one is no figure.
fn dot(sample: &Sample, [(x, is_x), (y, is_y)]: [(Option<f64>, bool); 2], note: String) -> Series {
    let [x, y] = [x, y].map(|value| value.unwrap_or(f64::NAN));
    let class = if is_x && is_y { "contacts" } else { "collapsed" };
    Series::dots(sample.measured.name, class, [Mark { note, ..Mark::from([x, y]) }])
}

/// Each sample's simulated figure over its measured one. Failed fits are left out.
fn beside(report: &Report, Metric(name, is_log, [measured, simulated]): &Metric) -> Chart {
    let failed = |(value, is): (Option<f64>, bool)| (value.filter(|_| is), is);
    let series =
        report.samples.iter().map(|sample| dot(sample, [failed(measured(sample)), simulated(sample)], String::new()));
    let middle = Some(report.accuracy_of_the_middle).filter(|_| *name == "PA");
    let axis = || match *name {
        _ if *is_log => Axis::log("measured", Unit::Plain).floor(1e-9),
        "SR" => Axis::linear("measured", Unit::Plain).reaching([0.25, 0.8]),
        _ => Axis::linear("measured", Unit::Plain).reaching(middle),
    };
    let guide = middle.map(|middle| (middle, MIDDLE.to_owned()));
    let chart = Chart::new(*name, "simulated upwards", [axis(), axis()], series).sized([360.0, 300.0]);
    Chart { level: guide.clone(), guide, ..chart }
}

/// Values of all samples from 0 to 1; failed ones above.
fn normalised(samples: &[Sample], Metric(_, is_log, of): &Metric, side: usize) -> Vec<(Option<f64>, bool)> {
    let scaled = |value: f64| if *is_log { value.ln() } else { value };
    let values: Vec<(Option<f64>, bool)> = samples.iter().map(of[side]).collect();
    // A collapsed image has a value like others; a failed fit has none.
    let counts = |is_figure: bool| is_figure || !is_log;
    let counted = values.iter().filter(|(_, is_figure)| counts(*is_figure)).filter_map(|(value, _)| *value).map(scaled);
    let [low, high] = super::super::materials::extent(counted);
    let share = |value: f64| if high > low { (scaled(value) - low) / (high - low) } else { 0.5 };
    let place =
        |(value, is): &(Option<f64>, bool)| (value.map(|value| if counts(*is) { share(value) } else { FAILED }), *is);
    values.iter().map(place).collect()
}

/// A plane of the paper's figure 6, as measured (0) or simulated (1).
fn plane(report: &Report, metrics: [&Metric; 2], side: usize) -> Chart {
    let samples = &report.samples;
    let [x, y] = metrics.map(|metric| normalised(samples, metric, side));
    let series = samples.iter().zip(x.into_iter().zip(y)).map(|(sample, (x, y))| {
        let text = |metric: &Metric| format!("{} {}", metric.0, PLAIN.text(metric.2[side](sample).0));
        dot(sample, [x, y], format!("{}, {}", text(metrics[0]), text(metrics[1])))
    });
    let axes = metrics.map(|Metric(name, is_log, _)| {
        let title = format!("{}{name}, normalised", if *is_log { "log " } else { "" });
        Axis::linear(title, Unit::Plain).within([-0.08, 1.14])
    });
    let title = format!("{} and {}, {}", metrics[0].0, metrics[1].0, ["measured", "simulated"][side]);
    let subtitle = format!("{} upwards", axes[1].title);
    Chart::new(title, subtitle, axes, series).sized([360.0, 300.0])
}

/// Three small charts of a sample: output over force, profile of the image, places.
fn card(sample: &Sample) -> [Chart; 3] {
    let name = sample.measured.name;
    let chart = |title: &str, [x, y]: [Axis; 2], series: Vec<Series>| {
        Chart::new(format!("{name} · {title}"), "", [x, y], series).sized(SMALL)
    };
    let axis = |title: &str| Axis::linear(title, Unit::Plain);
    let most_n = sample.loading.iter().map(|[force_n, _]| *force_n).fold(0.0, f64::max);
    let curve = sample.curve.map(|fit| {
        let force_n = |index: usize| most_n * index as f64 / CURVE_POINTS as f64;
        let points = (0..=CURVE_POINTS).map(|index| (force_n(index), fit.curve.output(force_n(index))));
        Series::line("", "bound", points).undotted()
    });
    let output = [
        Series::dots("", "collapsed", sample.unloading.iter().copied()),
        Series::dots("", "contacts", sample.loading.iter().copied()),
    ];
    let profile = Series::line("", "linear", sample.profile.iter().map(|[x_m, share]| (x_m * 1e3, *share))).undotted();
    let shares = |place_m: [f64; 2]| place_m.map(|metres| metres / HALF_M);
    let ways = sample.places_m.iter().map(|way_m| Series::line("", "bound", way_m.map(shares)).undotted());
    let truth = Series::dots("", "collapsed", sample.places_m.iter().map(|[truth_m, _]| shares(*truth_m)));
    let found = Series::dots("", "paper", sample.places_m.iter().map(|[_, found_m]| shares(*found_m)));
    [
        chart(
            "output",
            [axis("force, N").reaching([0.0]), axis("").reaching([0.0])],
            output.into_iter().chain(curve).collect(),
        ),
        chart("profile", [axis("x, mm"), axis("")], vec![profile]),
        chart(
            "places",
            ["half widths", ""].map(|title| axis(title).within([-1.0, 1.0])),
            ways.chain([truth, found]).collect(),
        ),
    ]
}

/// What the paper leaves open of its solver, and which SR and PA each choice gives.
fn of_choices(view: View, choices: &Choices) -> View {
    let table = |title: &str, all: &mut dyn Iterator<Item = &Choice>| -> Table {
        Table::of(title, all.collect::<Vec<_>>())
            .column("lambda^2 = 5000 is of", TEXT, |choice| choice.lambda.unwrap_or("the nearest"))
            .column("readings", TEXT, |choice| choice.rows)
            .column("pads", TEXT, |choice| choice.pads)
            .column("lambda, share", TEXT, |choice| format!("{:.2e}", choice.lambda_share))
            .column("SR", TEXT, |choice| choice.resolution_text())
            .column("PA", PLAIN.digits(3), |choice| choice.position_accuracy)
            .into()
    };
    view.heading("What is left open of its solver")
        .text(format!(
            "The paper gives lambda^2 = 5000 without a unit, and neither which readings are taken nor what the pads of its shell are. Each choice gives SR \
             and PA of sample A, measured as {} and {}; in brackets: collapsed. The result: {}. A share is of the largest singular value.",
            choices.measured[0],
            choices.measured[1],
            choices.text()
        ))
        .with(table("", &mut choices.one_at_a_time()))
        .folded("With the lambda that comes nearest to both", [table("", &mut choices.nearest.iter())])
        .folded("All combinations", [table("", &mut choices.printed.iter())])
}

fn figures(report: &Report) -> Table {
    let band = |end: fn(f64, f64) -> f64| {
        move |sample: &&Sample| match maximum(sample) {
            Figure::Determined { low, high, .. } => Value::Number(end(low, high)),
            _ => Value::Open,
        }
    };
    let three = PLAIN.digits(3);
    Table::of("Simulated and measured", &report.samples)
        .column("sample", TEXT, |one| one.measured.name)
        .column("SENS", PLAIN, |one| sensitivity(one))
        .column("measured SENS", Format::new("mV/N", "mv_per_n").digits(3), |one| one.measured.sensitivity_mv_per_n)
        .column("FMAX and its band, N", TEXT, |one| banded(maximum(one)))
        .column("measured FMAX, N", TEXT, |one| one.measured.maximum_text())
        .column("SR", TEXT, |one| figure(&one.imaging, 0))
        .column("measured SR", three, |one| one.measured.spatial_resolution)
        .column("PA", TEXT, |one| figure(&one.imaging, 1))
        .column("measured PA", three, |one| one.measured.position_accuracy)
        .column("place", MM, |one| one.limit.place_m)
        .column("auto place", MM, |one| one.reached.place_m)
        .column("two points", MM, |one| one.limit.two_points_m)
        .column("signal to noise", DECIBELS, |one| one.limit.signal_to_noise_db)
        .detail("FMAX", NEWTONS, |one| maximum(one).value())
        .detail("FMAX low", NEWTONS, band(|low, _| low))
        .detail("FMAX high", NEWTONS, band(|_, high| high))
        .detail("measured FMAX printed", NEWTONS, |one| one.measured.printed_maximum_n)
        .detail("SR collapsed", PLAIN.digits(0), |one| one.imaging.is_spread_out)
        .detail("PA collapsed", PLAIN.digits(0), |one| one.imaging.is_central)
        .detail("lightest", NEWTONS, |one| one.limit.range[0])
        .detail("saturated", NEWTONS, |one| one.limit.range[1])
        .detail("auto found", PLAIN, |one| one.reached.found)
        .note(
            "SENS: output per newton at 2.5 N, simulated in S/m2 of a sheet of 1 S, measured in mV/N: only their order can be compared. FMAX with its 95 % \
             band, and as printed; a failed fit is far beyond the 5 N that were applied. SR and PA in brackets: of images that have collapsed. Place, two \
             points and signal to noise are the sensor's own limit at 2.25 N.",
        )
        .data()
        .into()
}
