//! What the report shows.

use super::{Against, Cost, Growth, Power, Report, SizeReport, SweepReport};
use crate::score::Spread;
use crate::view::{Axis, Chart, Format, Mark, PLAIN, Series, TEXT, Table, Unit, View, same_axis};

const SECONDS: Format = Format::new("s", "s");
const MEGABYTES: Format = Format { factor: 1e-6, ..Format::new("MB", "bytes").digits(2) };
/// Costs in time and in memory, with their colours.
const TIMES: [(Cost, &str); 3] = [(Cost::SetUp, "image"), (Cost::First, "contacts"), (Cost::Following, "linear")];
const MEMORIES: [(Cost, &str); 2] = [(Cost::Kept, "learned"), (Cost::Peak, "paper")];
/// A cost that grows by a power within so much of zero does not grow.
const FLAT: f64 = 0.1;

/// Charts of time and memory against each size, and what grows how.
pub fn view(report: &Report) -> View {
    let lead = "Both axes are logarithmic, so **a power of the size is a straight line**, and its slope is the exponent: at a slope of 1 twice the size costs \
                twice as much, at 3 eight times. Bars reach from the 10th to the 90th percentile. Lines are the powers that were fitted, and numbers their exponents with standard errors.";
    let mut view = View::new("How cost grows", lead);
    view.method = format!(
        "Each thing is varied alone on {}, which solvers know exactly: electrodes on the same square, of `auto`, and nodes of the image, of `tikhonov`, with one firm \
         contact; contacts, and frames since a contact came, of `contacts`. Set-up is model, linear theory and solver. A first answer is a cold start; following \
         is the median of the second half of 8 frames. {} places at each size, seed {}. Times are of the processor time of one thread; memory is what \
         model and solver allocate, counted by the allocator. Exponents are least squares of the logarithms of medians; their standard errors come from how \
         far these are off the line, so they also tell whether a power is the right law.",
        report.detector, report.places, report.seed
    );
    let mut times: Vec<Chart> = report.sweeps.iter().map(|sweep| chart(sweep, &TIMES, Unit::Seconds)).collect();
    let mut memories: Vec<Chart> = report.sweeps.iter().map(|sweep| chart(sweep, &MEMORIES, Unit::Bytes)).collect();
    same_axis(&mut times, 1);
    same_axis(&mut memories, 1);
    view.text(verdict(report))
        .figures("", times.into_iter().chain(memories))
        .with(slopes(report))
        .folded("All figures", [figures(report)])
        .without(&report.missing)
}

fn chart(sweep: &SweepReport, costs: &[(Cost, &'static str)], unit: Unit) -> Chart {
    let what = if unit == Unit::Seconds { "time" } else { "memory" };
    let title = capital(sweep.against.name());
    let own = costs.iter().filter(|(cost, _)| sweep.against.costs().contains(cost));
    let series = own.flat_map(|(cost, class)| lines(sweep, *cost, class));
    let axes = [Axis::log(size_of(sweep.against), Unit::Plain).decades(0.8), Axis::log("", unit).floor(1e-7)];
    Chart::new(title, format!("{what}, solver {}", sweep.solver), axes, series).sized([330.0, 300.0])
}

fn size_of(against: Against) -> &'static str {
    match against {
        Against::Electrodes => "electrodes",
        Against::Nodes => "nodes of the image",
        Against::Contacts => "contacts",
        Against::Frames => "frames since the contact came",
    }
}

/// What was measured of a cost, and the power that is fitted to it.
fn lines(sweep: &SweepReport, cost: Cost, class: &'static str) -> Vec<Series> {
    let power = sweep.growth.iter().find(|growth| growth.cost == cost).map(|growth| growth.power);
    // The chart says whether it is of memory.
    let short = cost.name().trim_start_matches("memory ");
    let name = power.map_or_else(|| short.to_owned(), |power| format!("{short} {}", slope(&power)));
    let mark = |size: &SizeReport| Mark {
        spread: spread(cost, size).map(|spread| [[size.size as f64; 2], [spread.p10, spread.p90]]),
        ..Mark::from([size.size as f64, cost.of(size)])
    };
    let measured = Series::dots(name, class, sweep.sizes.iter().map(mark)).large();
    let measured = Series { main: Some(measured.marks.len() / 2), ..measured };
    let ends = [sweep.sizes.first(), sweep.sizes.last()].into_iter().flatten().map(|size| size.size as f64);
    let fitted = power.map(|power| Series::line("", class, ends.map(|size| [size, power.at(size)])).undotted());
    fitted.into_iter().chain([measured]).collect()
}

fn spread(cost: Cost, size: &SizeReport) -> Option<Spread> {
    match cost {
        Cost::SetUp => Some(size.set_up_s),
        Cost::First => Some(size.first_s),
        Cost::Following => Some(size.following_s),
        Cost::Kept | Cost::Peak => None,
    }
}

/// An exponent with its standard error.
fn slope(power: &Power) -> String {
    match power.standard_error {
        Some(error) => format!("{:.2} ± {error:.2}", power.exponent),
        None => format!("{:.2}", power.exponent),
    }
}

/// What grows fastest with each size, and what does not grow.
fn verdict(report: &Report) -> String {
    let of = |sweep: &SweepReport| {
        let fastest = sweep.growth.iter().max_by(|a, b| a.power.exponent.total_cmp(&b.power.exponent))?;
        let flat: Vec<_> =
            sweep.growth.iter().filter(|growth| growth.power.exponent.abs() < FLAT).map(|g| g.cost.name()).collect();
        let flat = if flat.is_empty() { String::new() } else { format!("no growth of {}", flat.join(", ")) };
        let fastest = match fastest.power.exponent < FLAT {
            true => String::new(),
            false => format!("{} grows fastest, by the power {}", fastest.cost.name(), slope(&fastest.power)),
        };
        let both: Vec<_> = [fastest, flat].into_iter().filter(|text| !text.is_empty()).collect();
        (!both.is_empty()).then(|| format!("**{}:** {}.", capital(size_of(sweep.against)), both.join("; ")))
    };
    report.sweeps.iter().filter_map(of).collect::<Vec<_>>().join(" ")
}

fn capital(text: &str) -> String {
    let mut letters = text.chars();
    letters.next().map_or_else(String::new, |first| first.to_uppercase().chain(letters).collect())
}

/// The exponents.
fn slopes(report: &Report) -> Table {
    let of = |cost: Cost| {
        move |sweep: &&SweepReport| {
            let growth: Option<&Growth> = sweep.growth.iter().find(|growth| growth.cost == cost);
            growth.map_or_else(|| "-".to_owned(), |growth| slope(&growth.power))
        }
    };
    let table = Table::of("Exponents, with their standard errors", &report.sweeps)
        .column("against", TEXT, |sweep| size_of(sweep.against))
        .column("solver", TEXT, |sweep| sweep.solver.as_str());
    Cost::ALL.into_iter().fold(table, |table, cost| table.column(cost.name(), TEXT, of(cost))).into()
}

/// All that was measured.
fn figures(report: &Report) -> Table {
    let rows = report.sweeps.iter().flat_map(|sweep| sweep.sizes.iter().map(move |size| (sweep, size)));
    Table::of("", rows)
        .group("against", |(sweep, _)| format!("{}, of {}", size_of(sweep.against), sweep.solver))
        .column("size", PLAIN.digits(0), |(_, size)| size.size)
        .column("set-up", SECONDS, |(_, size)| size.set_up_s.median)
        .column("first answer", SECONDS, |(_, size)| size.first_s.median)
        .column("first, p90", SECONDS, |(_, size)| size.first_s.p90)
        .column("following", SECONDS, |(_, size)| size.following_s.median)
        .column("following, p90", SECONDS, |(_, size)| size.following_s.p90)
        .column("memory kept", MEGABYTES, |(_, size)| size.memory.kept_bytes)
        .column("memory at most", MEGABYTES, |(_, size)| size.memory.peak_bytes)
        .data()
        .into()
}
