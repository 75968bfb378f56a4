//! Promised and found, side by side.

use tactomo_study::view::{MM, PERCENT, PLAIN, TEXT, Table, View};

use super::Report;

/// A row for each detector.
pub fn view(report: &Report) -> View {
    let lead = "Detectors that design chooses for five wishes, and naive ones, as built: what they promise, and what auto finds with one frame, nobody having \
                calibrated.";
    let mut view = View::new("Promised and found", lead);
    if report.is_stopped {
        view = view.text("**Stopped before the end**: what is shown is of what was done.");
    }
    let table = Table::of("", report.rows.iter())
        .column("wish", TEXT, |row| row.wish.as_str())
        .column("detector", TEXT, |row| row.detector.as_str())
        .column("meets all", TEXT, |row| if row.meets_all { "yes" } else { "no" })
        .column("places, promised", MM, |row| row.promised.place_m)
        .column("places, found", MM, |row| row.place_m)
        .column("found / promised", PLAIN, |row| row.place_over_promise())
        .column("one contact", PERCENT, |row| row.one)
        .column("smallest promised (N)", PLAIN, |row| row.promised.smallest_n)
        .column("found (N)", PLAIN, |row| row.smallest_n)
        .column("found / promised", PLAIN, |row| row.smallest_over_promise())
        .column("two points, bound", MM, |row| row.promised.two_points_m)
        .column("two found", MM, |row| row.two_points_m)
        .column("found / bound", PLAIN, |row| row.two_points_over_bound());
    let method = format!(
        "Medians over presses and detectors drawn from the tolerances; readings of finer models through a chip of the board. The smallest force is that from which on half of \
         presses are seen, tried in steps of 1.1; two points are found from where half are two contacts, tried in steps of 1.4. Two points are no promise: the bound is what noise \
         and tolerances allow, and auto asks for more evidence before it calls two. Computed in {:.1} s.",
        report.seconds
    );
    View { method, ..view.with(table) }
}
