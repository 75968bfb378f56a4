//! What the paper concludes on bonding, on ours.

use tactomo_study::view::MM;

use super::super::claim::{Basis, Found, Trend, Verdict};
use super::super::rank::spearman;
use super::{Claim, GRIDS, Glue, Row};

/// Where the paper sees a local peak of the error (m), and within what a peak is that one.
const PEAK_M: f64 = 5e-3;
const NEAR_PEAK_M: f64 = 1.5e-3;

/// With the paper's solver, where its images have not collapsed, and of the sensor.
const ERRORS: [fn(&Row) -> Option<f64>; 2] =
    [|row| row.position_error_m.filter(|_| !row.imaging.is_central), |row| row.limit.place_m];

pub(super) fn of(rows: &[Row]) -> Vec<Claim> {
    if rows.iter().filter(|row| row.glue == Some(Glue::Conducting)).count() < 4 {
        return Vec::new();
    }
    // Each grid for itself: pitches differ.
    let trend = |of: &str, error: fn(&Row) -> Option<f64>| {
        let pairs = GRIDS.map(|dots| {
            let rows = series(rows, dots, Glue::Conducting);
            rows.filter_map(|row| Some([row.diameter_m?, -error(row)?])).collect::<Vec<_>>()
        });
        let each: Vec<f64> = pairs.iter().filter_map(|pairs| spearman(pairs)).collect();
        let conditions = pairs.iter().map(Vec::len).sum();
        Trend { of: of.to_owned(), correlation: super::super::rank::mean(&each), conditions }.found()
    };
    vec![
        Claim::new(
            "wider dots lower the error of places",
            Basis::Solver,
            [
                trend("error with diameter, reversed, mean of both grids", ERRORS[0]),
                trend("standard error with diameter, reversed, mean of both grids", ERRORS[1]),
            ],
        ),
        more_dots(rows),
        peak(rows),
    ]
}

/// Of a grid and a glue, by diameter.
pub(super) fn series(rows: &[Row], dots: usize, glue: Glue) -> impl Iterator<Item = &Row> {
    rows.iter().filter(move |row| row.dots == dots && row.glue == Some(glue))
}

/// Dots of the same share of the pitch cover the same area: only their number differs.
fn more_dots(rows: &[Row]) -> Claim {
    let found = |what: &str, error: fn(&Row) -> Option<f64>| {
        let pairs = series(rows, GRIDS[0], Glue::Conducting).zip(series(rows, GRIDS[1], Glue::Conducting));
        let lower: Vec<bool> = pairs.filter_map(|(few, many)| Some(error(many)? < error(few)?)).collect();
        let [yes, all] = [lower.iter().filter(|lower| **lower).count(), lower.len()];
        let share = 100.0 * yes as f64 / all as f64;
        let text = match all {
            0 => "not computed".to_owned(),
            _ => format!(
                "{what} is lower with 7 x 7 than with 5 x 5 of the same area in {share:.0} % of {all} diameters"
            ),
        };
        Found::new(Verdict::of_share(yes, all), text)
    };
    let found = [found("the error", ERRORS[0]), found("the standard error", ERRORS[1])];
    Claim::new("more dots lower the error of places", Basis::Solver, found)
}

/// Where the error of a grid, over the diameter, is higher (or lower) than on both sides.
fn turns(rows: &[Row], error: fn(&Row) -> Option<f64>, sign: f64) -> Vec<(usize, f64)> {
    let of = |dots: &usize| {
        let all: Vec<[f64; 2]> = series(rows, *dots, Glue::Conducting)
            .filter_map(|row| Some([row.diameter_m?, sign * error(row)?]))
            .collect();
        let peaks = all.windows(3).filter(|three| three[1][1] > three[0][1] && three[1][1] > three[2][1]);
        peaks.map(|three| (*dots, three[1][0])).collect::<Vec<_>>()
    };
    GRIDS.iter().flat_map(of).collect()
}

fn peak(rows: &[Row]) -> Claim {
    let [peaks, lows] = [1.0, -1.0].map(|sign| ERRORS.map(|error| turns(rows, error, sign)));
    let is_there = |peaks: &[(usize, f64)]| Some(peaks.iter().any(|(_, at_m)| (at_m - PEAK_M).abs() <= NEAR_PEAK_M));
    let each = |turns: &[(usize, f64)]| {
        let each = turns.iter().map(|(dots, at_m)| format!("{} mm with {dots} x {dots}", MM.text(Some(*at_m))));
        each.collect::<Vec<_>>().join(", ")
    };
    let text = |peaks: &[(usize, f64)], lows: &[(usize, f64)]| match (peaks, lows) {
        ([], []) => "no local peak and no least error between the ends".to_owned(),
        ([], lows) => format!("no local peak, but the least error at {}", each(lows)),
        (peaks, _) => format!("local peak at {}", each(peaks)),
    };
    let found = [0, 1].map(|side| Found::new(Verdict::of(is_there(&peaks[side])), text(&peaks[side], &lows[side])));
    Claim::new("the error has a local peak near dots of 5 mm", Basis::Solver, found)
}
