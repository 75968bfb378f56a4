//! What the study shows.

use tactomo_study::view::{Axis, Chart, Format, MM, PLAIN, S_PER_M, Series, TEXT, Table, Unit, View};

use super::{Group, Report, Row};

/// A line of the charts: name, class, and the figure (m).
type Line = (&'static str, &'static str, fn(&Row) -> Option<f64>);

const LINES: [Line; 5] = [
    ("median", "linear", |row| row.everywhere.map(|spread| spread.median_m)),
    ("nine tenths", "learned", |row| row.everywhere.map(|spread| spread.p90_m)),
    ("rms", "bound", |row| row.everywhere.map(|spread| spread.rms_m)),
    ("auto", "auto", |row| row.reached.place_m),
    ("two points", "image", |row| row.limit.two_points_m),
];

/// Errors over number, diameter and pitch, and all figures.
pub fn view(report: &Report) -> View {
    let lead = "How many electrodes, in which pattern, how wide and how far apart: what the sensor itself can tell with them, on sample A of \
                60 x 60 x 5 mm. The paper does not study this.";
    let text = "Standard error of a place with one frame, over the whole surface: half of the places are told better than the median, nine tenths better \
                than the next line, and the root mean square is ruled by the few worst places, which are corners; what `auto` reaches with one frame at \
                the nine places; and the least distance of two points told apart.";
    let charts = [
        chart(report, Group::Number, ("electrodes", Unit::Plain), |row| row.layout.count() as f64),
        chart(report, Group::Diameter, ("diameter", Unit::Metres), |row| row.diameter_m),
        chart(report, Group::Pitch, ("pitch", Unit::Metres), pitch_m),
    ];
    let everywhere = |of: usize| move |row: &&Row| LINES[of].2(row);
    let table = Table::of("", &report.rows)
        .group("group", |row| row.group.title())
        .column("name", TEXT, |row| row.name.as_str())
        .detail("electrodes", PLAIN.digits(0), |row| row.layout.count())
        .detail("diameter", MM, |row| row.diameter_m)
        .column("conver- sions", PLAIN.digits(0), |row| row.conversions)
        .column("place", MM, |row| row.limit.place_m)
        .detail("worst place", MM, |row| row.limit.worst_place_m)
        .column("everywhere median", MM, everywhere(0))
        .column("everywhere p90", MM, everywhere(1))
        .column("everywhere rms", MM, everywhere(2))
        .column("median in same time", MM, |row| row.median_in_same_time_m)
        .column("auto place", MM, |row| row.reached.place_m)
        .column("two points", MM, |row| row.limit.two_points_m)
        .column("signal to noise", Format::new("dB", "db").digits(0), |row| row.limit.signal_to_noise_db)
        .detail("lightest", S_PER_M, |row| row.limit.range[0])
        .detail("saturated", S_PER_M, |row| row.limit.range[1])
        .detail("auto found", PLAIN, |row| row.reached.found)
        .note(
            "place: at the paper's nine places (rms); everywhere: over the whole surface; in same time: the median with as many frames as take the time of \
             one of 16",
        )
        .data();
    report.course.view("Which electrodes", lead).figures(text, charts).with(table)
}

fn pitch_m(row: &Row) -> f64 {
    let [a, b] = [0, 1].map(|index| row.layout.electrodes([0.06, 0.06], row.diameter_m / 2.0)[index]);
    (a.x_m - b.x_m).hypot(a.y_m - b.y_m)
}

/// Errors over what is varied in a group; all charts have the same axis upwards.
fn chart(report: &Report, group: Group, (title, unit): (&str, Unit), x: fn(&Row) -> f64) -> Chart {
    let line = |(name, class, figure): Line| {
        let own = report.rows.iter().filter(|row| row.group == group);
        Series::line(name, class, own.map(|row| (x(row), figure(row))))
    };
    let errors_m = report.rows.iter().flat_map(|row| LINES.map(|(.., figure)| figure(row))).flatten();
    let axes = [Axis::log(title, unit).decades(0.6), Axis::log("", Unit::Metres).reaching(errors_m)];
    Chart::new(group.title(), "places, two points", axes, LINES.map(line)).sized([380.0, 340.0])
}
