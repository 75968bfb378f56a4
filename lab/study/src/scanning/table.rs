//! The report as a table.

use super::{Point, Report, SPEEDS_M_PER_S};

/// Lines for a terminal: a plan each.
pub fn table(report: &Report) -> String {
    let mut lines = vec![format!(
        "{}: {} model, {} scenes of each number of contacts; one missed or invented counts {:.0} mm",
        report.detector,
        report.model,
        report.scenes,
        report.reach_m * 1e3
    )];
    for contacts in report.contacts.iter().copied() {
        for speed_m_per_s in SPEEDS_M_PER_S {
            lines.push(format!("\n{}", title(contacts, speed_m_per_s)));
            lines.push(format!(
                "{:<9} {:>5} {:>9} {:>7} {:>11} {:>11} {:>8} {:>9} {:>11} {:>11}",
                "grounds",
                "rows",
                "frames/s",
                "age ms",
                "arrived mm",
                "middle mm",
                "count %",
                "right mm",
                "rows >= mm",
                "all >= mm"
            ));
            lines.extend(report.of(contacts, speed_m_per_s).map(line));
        }
    }
    lines.push(
        "\nage: from the middle of a frame's rows to its arrival; arrived, middle: mean error against where contacts are at either; count: answers with \
         none missed or invented, right: arrived of these alone;\nrows, all: Cramer-Rao bound of a frame's rows, and of all rows since the touch, radii not known"
            .to_owned(),
    );
    lines.join("\n")
}

/// What touches, for people.
pub(super) fn title(contacts: usize, speed_m_per_s: f64) -> String {
    let contacts = if contacts == 1 { "1 contact".to_owned() } else { format!("{contacts} contacts") };
    match speed_m_per_s {
        0.0 => format!("{contacts}, 50 ms after the touch"),
        speed => format!("{contacts} at {speed} m/s"),
    }
}

impl Report {
    /// Points of so many contacts at a speed.
    pub(super) fn of(&self, contacts: usize, speed_m_per_s: f64) -> impl Iterator<Item = &Point> {
        let wanted = move |point: &&Point| point.contacts == contacts && point.speed_m_per_s == speed_m_per_s;
        self.points.iter().filter(wanted)
    }
}

fn line(point: &Point) -> String {
    let mm = |metres: f64| format!("{:.3}", 1e3 * metres);
    format!(
        "{:<9} {:>5} {:>9.0} {:>7.2} {:>11} {:>11} {:>8.0} {:>9} {:>11} {:>11}",
        point.choice.name(),
        point.rows,
        point.frames_per_s,
        1e3 * point.age_s,
        mm(point.arrived_m),
        mm(point.middle_m),
        100.0 * point.count_right,
        point.right_m.map_or_else(|| "-".to_owned(), mm),
        mm(point.bound_rows_m),
        point.bound_all_m.map_or_else(|| "-".to_owned(), mm)
    )
}
