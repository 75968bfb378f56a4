//! What the study shows: claims, maps of every figure, and where the foams lie.

use tactomo_study::view::{Axis, Chart, Format, MM, Map, Mark, PLAIN, S_PER_M, Series, TEXT, Table, Unit, Value, View};

use super::super::Imaging;
use super::super::imaging::figure;
use super::claims::extent;
use super::{Condition, Report};

/// Two conductivities that are one node of the map (relative).
const SAME: f64 = 1e-9;

/// A figure of the map: title, what is better, whether it is even in the logarithm, how it is written, and what it is.
struct Figure(&'static str, &'static str, bool, Format, fn(&Condition) -> Option<f64>);

const DECIBELS: Format = Format::new("dB", "db").digits(0);
const TWO: Format = PLAIN.digits(2);
const SENS: Format = Format::new("V per S/m", "v_per_s_per_m");
const SLOPE: &str = "slope at 5 S/m, V per S/m · light is better";
const MOST: &str = "contact at 90 % of saturation, S/m · light is better";
const SHARPNESS: &str = "1 - half width / width · light is sharper";
const ACCURACY: &str = "1 - error / width, nine places · light is better";

const EXACT: [Figure; 4] = [
    Figure("SENS", SLOPE, true, PLAIN, |c| c.exact.sensitivity()),
    Figure("FMAX", MOST, true, PLAIN, |c| c.exact.maximum()),
    Figure("SR", SHARPNESS, false, TWO, |c| c.exact.imaging.sharpness()),
    Figure("PA", ACCURACY, false, TWO, |c| c.exact.imaging.accuracy()),
];
/// The same where each contact is at half of the drive.
const AT_HALF: [Figure; 2] = [
    Figure("SR at half of the drive", SHARPNESS, false, TWO, |c| c.at_half.as_ref()?.imaging.sharpness()),
    Figure("PA at half of the drive", ACCURACY, false, TWO, |c| c.at_half.as_ref()?.imaging.accuracy()),
];
const NOISY: [Figure; 4] = [
    Figure("SENS with noise", SLOPE, true, PLAIN, |c| c.noisy.sensitivity()),
    Figure("FMAX with noise", MOST, true, PLAIN, |c| c.noisy.maximum()),
    Figure("SR with noise", SHARPNESS, false, TWO, |c| c.noisy.imaging.sharpness()),
    Figure("PA with noise", ACCURACY, false, TWO, |c| c.noisy.imaging.accuracy()),
];
const LIMITS: [Figure; 6] = [
    Figure("Signal to noise", "largest reading, dB · light is better", false, DECIBELS, |c| {
        Some(c.limit.signal_to_noise_db)
    }),
    Figure("Saturation", "contact at 90 % of the drive, S/m · light takes more", true, PLAIN, |c| c.limit.range[1]),
    Figure("Two points", "least distance told apart, mm · dark is better", true, MM, |c| c.limit.two_points_m),
    Figure("Place", "standard error at nine places, mm · dark is better", true, MM, |c| c.limit.place_m),
    Figure(
        "Decades of strength",
        "from noise to saturation · light is more",
        false,
        PLAIN.digits(1),
        Condition::decades,
    ),
    Figure("auto", "its error at nine places, one frame, mm · dark is better", true, MM, auto_m),
];

fn auto_m(c: &Condition) -> Option<f64> {
    c.reached.and_then(|reached| reached.place_m)
}

/// Claims, the samples, maps of all figures, and all figures.
pub fn view(report: &Report) -> View {
    let lead = "What the conductivities of bottom and top do to a tomographic tactile sensor: the four metrics of the paper, two by their definition and \
                two with its solver, and beside them what the sensor itself can tell, whatever the solver.";
    let metrics = "SENS and FMAX are of the largest reading, SR and PA of its image: thin shell and Tikhonov, without noise. A slab of 60 x 60 x 10 mm, \
                   16 electrodes of 4 mm, a contact of 4 mm whose conductivity, down to 0.5 mm, stands for force. Letters are the foams and stacks of \
                   its table I, the upper letter first.";
    let limits = "Cramer and Rao's bounds of one frame, 12 bits with 1.5 LSB of noise, for a contact of 1 S/m whose radius is known to a factor of two.";
    let lie = "Each metric from 0 for the lowest of the map to 1 for the highest, collapsed images included. Of a grey mark an image has collapsed.";
    let noisy = tactomo_study::view::Figures::of("", maps(report, &NOISY));
    report
        .course
        .view("Which material", lead)
        .heading("The paper's metrics")
        .figures(format!("{metrics} {}", collapsed(report)), maps(report, &EXACT))
        .figures("", maps(report, &AT_HALF))
        .folded("The same with the converter's noise", [noisy])
        .heading("The sensor's own limit")
        .figures(limits, maps(report, &LIMITS))
        .heading("Where the foams lie")
        .figures(lie, [positions(report, [2, 1]), positions(report, [3, 0])])
        .with(samples(report))
        .folded("All figures", [figures(report)])
}

/// How many images have collapsed, and what that gives.
fn collapsed(report: &Report) -> String {
    let all = report.conditions.len();
    let count = |is: fn(&Imaging) -> bool| report.conditions.iter().filter(|c| is(&c.exact.imaging)).count();
    let half = |is: fn(&Imaging) -> bool| {
        report.conditions.iter().filter(|c| c.at_half.as_ref().is_some_and(|half| is(&half.imaging))).count()
    };
    let [spread_out, central]: [fn(&Imaging) -> bool; 2] = [|one| one.is_spread_out, |one| one.is_central];
    format!(
        "Grey cells are images that have collapsed, and are left out of all that is concluded. Of {all} conditions {} ({} at half of the drive) have an \
         image of the contact in the middle that is above half of its height at the corners: SR is what the outline gives. {} ({}) see every contact in \
         the middle, within 1 % of the width: PA is {:.3}, what answering \"the middle\" gives over the nine places.",
        count(spread_out),
        half(spread_out),
        count(central),
        half(central),
        report.accuracy_of_the_middle
    )
}

fn maps(report: &Report, figures: &[Figure]) -> Vec<Map> {
    let has_any = |figure: &&Figure| report.conditions.iter().any(|c| figure.4(c).is_some());
    figures.iter().filter(has_any).map(|figure| map(report, figure)).collect()
}

fn map(report: &Report, Figure(title, subtitle, is_log, format, of): &Figure) -> Map {
    let ticks = &report.conductivities_s_per_m;
    let is = |a: f64, b: f64| (a / b - 1.0).abs() < SAME;
    let value = |bottom: f64, top: f64| {
        let found = report.conditions.iter().find(|c| is(c.bottom_s_per_m, bottom) && is(c.top_s_per_m, top));
        found.and_then(of)
    };
    let mark =
        |c: &Condition| Some(([c.bottom_s_per_m, c.top_s_per_m], c.name.filter(|name| *name != "BB")?.to_owned()));
    Map {
        title: (*title).to_owned(),
        subtitle: (*subtitle).to_owned(),
        axes: ["bottom, S/m", "top, S/m"].map(|title| Axis::log(title, Unit::Plain)),
        ticks: [ticks.clone(), ticks.clone()],
        rows: ticks.iter().map(|top| ticks.iter().map(|bottom| value(*bottom, *top)).collect()).collect(),
        empty: if title.starts_with("SR") || title.starts_with("PA") { "collapsed" } else { "not determined" },
        is_log: *is_log,
        range: None,
        format: *format,
        contours: 5,
        disc: None,
        aspect: 1.0,
        marks: report.samples.iter().filter_map(mark).collect(),
    }
}

/// A metric whatever its image is, and whether that has collapsed.
fn shown(index: usize, c: &Condition) -> (Option<f64>, bool) {
    let imaging = &c.exact.imaging;
    match index {
        2 => (imaging.spatial_resolution, imaging.is_spread_out),
        3 => (imaging.position_accuracy, imaging.is_central),
        _ => (EXACT[index].4(c), false),
    }
}

/// Samples between two of the metrics, each from 0 for the lowest of the map to 1 for the highest, with the curve of uniform materials.
fn positions(report: &Report, indices: [usize; 2]) -> Chart {
    let scale = |index: usize| {
        let scaled = move |value: f64| if EXACT[index].2 { value.ln() } else { value };
        let [low, high] = extent(report.conditions.iter().filter_map(|c| shown(index, c).0).map(scaled));
        move |value: f64| (scaled(value) - low) / (high - low)
    };
    let mark = |c: &Condition| {
        let [x, y] = indices.map(|index| shown(index, c).0.map_or(f64::NAN, scale(index)));
        let text = |index: usize| format!("{} {}", EXACT[index].0, PLAIN.text(shown(index, c).0));
        let note = format!("{}, {}, {}", c.title(), text(indices[0]), text(indices[1]));
        Mark { note, ..Mark::from([x, y]) }
    };
    let sample = |c: &Condition| {
        let is_collapsed = indices.iter().any(|index| shown(*index, c).1);
        Series::dots(c.name.unwrap_or_default(), if is_collapsed { "collapsed" } else { "contacts" }, [mark(c)])
    };
    let uniform = report.conditions.iter().filter(|c| c.bottom_s_per_m == c.top_s_per_m).map(mark);
    let uniform = Series::line("uniform", "bound", uniform);
    let axis = |index: usize| {
        let Figure(name, _, is_log, ..) = EXACT[index];
        Axis::linear(format!("{}{name}, normalised", if is_log { "log " } else { "" }), Unit::Plain)
            .within([-0.05, 1.1])
    };
    let [x, y] = indices.map(axis);
    let middle = Some(scale(3)(report.accuracy_of_the_middle)).filter(|_| indices[0] == 3);
    let title = format!("{} and {}", EXACT[indices[0]].0, EXACT[indices[1]].0);
    let subtitle = format!("{} upwards · right and up is better", y.title);
    let chart = Chart::new(title, subtitle, [x, y], report.samples.iter().map(sample).chain([uniform]));
    Chart { guide: middle.map(|middle| (middle, "answering \"the middle\"".to_owned())), ..chart }
}

fn samples(report: &Report) -> Table {
    Table::of("Foams and stacks", &report.samples)
        .column("sample", TEXT, |c| c.name.unwrap_or_default())
        .column("SENS", SENS, |c| c.exact.sensitivity())
        .column("FMAX", S_PER_M, |c| c.exact.maximum())
        .detail("as printed", S_PER_M, |c| c.exact.printed_maximum)
        .column("SR", TEXT, |c| figure(&c.exact.imaging, 0))
        .column("PA", TEXT, |c| figure(&c.exact.imaging, 1))
        .column("PA, noise", TEXT, |c| figure(&c.noisy.imaging, 1))
        .column("S/N", DECIBELS, |c| c.limit.signal_to_noise_db)
        .column("place", MM, |c| c.limit.place_m)
        .column("auto", MM, |c| auto_m(c))
        .column("two points", MM, |c| c.limit.two_points_m)
        .column("saturates at", S_PER_M, |c| c.limit.range[1])
        .column("from", Format::new("N", "n"), |c| c.force_range_n[0])
        .column("to", Format::new("N", "n"), |c| c.force_range_n[1])
        .note(
            "FMAX follows from eq. (6); eq. (8) as printed does not. A dash: the figure is open; in brackets: of images that have collapsed. S/N, place, auto \
             and two points: of a contact of 1 S/m. Newtons are those of Hertz's ball of 5 mm on a foam as soft as the sample's; the mesh between foam and \
             driving layer, which a press must bend first, is not in them.",
        )
        .into()
}

/// A row for each sample and condition.
fn figures(report: &Report) -> Table {
    let half = |of: fn(&super::AtHalf) -> Option<f64>| move |c: &&Condition| c.at_half.as_ref().and_then(of);
    let has = |is: fn(&Imaging) -> bool| {
        move |c: &&Condition| c.at_half.as_ref().map_or(Value::Open, |half| is(&half.imaging).into())
    };
    let (metres, newtons) = (MM, Format::new("N", "n"));
    Table::of("", report.samples.iter().chain(&report.conditions))
        .column("sample", TEXT, |c| c.name.unwrap_or_default())
        .column("bottom", S_PER_M, |c| c.bottom_s_per_m)
        .column("top", S_PER_M, |c| c.top_s_per_m)
        .column("SENS", SENS, |c| c.exact.sensitivity())
        .column("FMAX", S_PER_M, |c| c.exact.maximum())
        .column("FMAX printed", S_PER_M, |c| c.exact.printed_maximum)
        .column("SR", PLAIN, |c| c.exact.imaging.spatial_resolution)
        .column("PA", PLAIN, |c| c.exact.imaging.position_accuracy)
        .column("noisy SENS", SENS, |c| c.noisy.sensitivity())
        .column("noisy FMAX", S_PER_M, |c| c.noisy.maximum())
        .column("noisy SR", PLAIN, |c| c.noisy.imaging.spatial_resolution)
        .column("noisy PA", PLAIN, |c| c.noisy.imaging.position_accuracy)
        .column("signal to noise", DECIBELS, |c| c.limit.signal_to_noise_db)
        .column("place", metres, |c| c.limit.place_m)
        .column("conductance share", PLAIN, |c| c.limit.conductance)
        .column("two points", metres, |c| c.limit.two_points_m)
        .column("lightest", S_PER_M, |c| c.limit.range[0])
        .column("saturated", S_PER_M, |c| c.limit.range[1])
        .column("lightest", newtons, |c| c.force_range_n[0])
        .column("saturated", newtons, |c| c.force_range_n[1])
        .column("auto place", metres, |c| auto_m(c))
        .column("auto found", PLAIN, |c| c.reached.map(|reached| reached.found))
        .column("SR collapsed", PLAIN.digits(0), |c| c.exact.imaging.is_spread_out)
        .column("PA collapsed", PLAIN.digits(0), |c| c.exact.imaging.is_central)
        .column("half", S_PER_M, half(|half| Some(half.strength_s_per_m)))
        .column("half SR", PLAIN, half(|half| half.imaging.spatial_resolution))
        .column("half PA", PLAIN, half(|half| half.imaging.position_accuracy))
        .column("half SR collapsed", PLAIN.digits(0), has(|imaging| imaging.is_spread_out))
        .column("half PA collapsed", PLAIN.digits(0), has(|imaging| imaging.is_central))
        .column("half place", metres, half(|half| half.place_m))
        .column("half two points", metres, half(|half| half.two_points_m))
        .data()
        .into()
}
