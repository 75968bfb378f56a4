//! Errors of presses, and what they come to.

use serde::Serialize;
use tactomo_study::view::{TEXT, Table};
use tactomo_touch::solve::{Press, Presses, Strength};

use super::map::{Cell, Map, Missed};

/// Presses, and what was read of each.
pub struct Scored<'a> {
    /// The presses.
    pub presses: &'a Presses,
    /// What was read; `None` where nothing was felt.
    pub read: Vec<Option<Press>>,
    /// Mean processor time of one (us).
    pub press_us: f64,
    /// How strengths were measured, if they can be compared.
    pub strength: Option<Strength>,
}

/// What the errors come to.
#[derive(Clone, Debug, Serialize)]
pub struct Report {
    presses: usize,
    /// Presses too light to be read.
    unread: usize,
    /// Presses that were flagged as unlike those taught.
    flagged: usize,
    mean_m: f64,
    median_m: f64,
    p90_m: f64,
    root_mean_square_m: f64,
    #[serde(skip_serializing_if = "Option::is_none")]
    strength: Option<&'static str>,
    /// Median of the errors of strengths, as shares of them.
    #[serde(skip_serializing_if = "Option::is_none")]
    strength_median_share: Option<f64>,
    press_us: f64,
    map: Vec<Cell>,
}

impl Scored<'_> {
    /// How far off each press is that was read.
    pub fn errors(&self) -> Vec<Missed> {
        let missed = |(truth, press): (&[f64; 3], &Option<Press>)| {
            let square: f64 = truth.iter().zip(press.as_ref()?.place_m).map(|(a, b)| (a - b) * (a - b)).sum();
            Some(([truth[0], truth[1]], square.sqrt()))
        };
        self.presses.places_m.iter().zip(&self.read).filter_map(missed).collect()
    }

    fn strength_median_share(&self) -> Option<f64> {
        self.strength?;
        let share = |(truth, press): (&f64, &Option<Press>)| Some((press.as_ref()?.strength? / truth - 1.0).abs());
        let shares: Vec<f64> = self.presses.strengths.iter().zip(&self.read).filter_map(share).collect();
        (!shares.is_empty()).then(|| at(&sorted(shares), 0.5))
    }
}

fn sorted(mut values: Vec<f64>) -> Vec<f64> {
    values.sort_by(f64::total_cmp);
    values
}

/// The value that so many are below; zero of none.
fn at(sorted: &[f64], share: f64) -> f64 {
    sorted.get((share * sorted.len().saturating_sub(1) as f64).round() as usize).copied().unwrap_or_default()
}

impl Report {
    /// Of all presses.
    pub fn of(scored: &Scored<'_>, map: &Map) -> Self {
        let missed_m = sorted(scored.errors().into_iter().map(|(_, missed_m)| missed_m).collect());
        let count = missed_m.len().max(1) as f64;
        Self {
            presses: scored.presses.count(),
            unread: scored.read.iter().filter(|press| press.is_none()).count(),
            flagged: scored.read.iter().flatten().filter(|press| press.is_outside).count(),
            mean_m: missed_m.iter().sum::<f64>() / count,
            median_m: at(&missed_m, 0.5),
            p90_m: at(&missed_m, 0.9),
            root_mean_square_m: (missed_m.iter().map(|missed_m| missed_m * missed_m).sum::<f64>() / count).sqrt(),
            strength: scored.strength.map(Strength::name),
            strength_median_share: scored.strength_median_share(),
            press_us: scored.press_us,
            map: map.cells.clone(),
        }
    }

    /// Names and figures, for people.
    pub fn table(&self) -> Table {
        let mm = |metres: f64| format!("{:.2} mm", metres * 1e3);
        let mut rows = vec![
            ("presses", self.presses.to_string()),
            ("of them too light to be read", self.unread.to_string()),
            ("flagged as unlike those taught", self.flagged.to_string()),
            ("off by, mean", mm(self.mean_m)),
            ("median", mm(self.median_m)),
            ("90 % within", mm(self.p90_m)),
            ("root mean square", mm(self.root_mean_square_m)),
        ];
        if let Some((name, share)) = self.strength.zip(self.strength_median_share) {
            rows.push(("strength", name.to_owned()));
            rows.push(("its median error", format!("{:.1} %", share * 100.0)));
        }
        rows.push(("time for a press", format!("{:.0} us", self.press_us)));
        let table = Table::of("", rows).column("presses that were not taught", TEXT, |(name, _)| *name);
        table.column("", TEXT, |(_, value)| value.clone()).into()
    }
}
