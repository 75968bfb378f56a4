//! What the paper claims, and whether it holds: as the paper computes it, or of the sensor.

use tactomo_study::view::{Cell, Style, TEXT, Table};

use super::rank::spearman;

/// Rank correlations above this count as a trend: with it, two ranks explain a quarter of each other.
const TREND: f64 = 0.5;

/// Whether a claim holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Verdict {
    /// As the paper computes it, and of the sensor itself.
    Holds,
    /// As the paper computes it; the sensor does not set that limit.
    PaperOnly,
    /// Of the sensor itself; what the paper computes does not show it.
    SensorOnly,
    /// Neither.
    DoesNotHold,
    /// Of the sensor itself; what the paper computes gives no figures to judge by.
    SensorHolds,
    /// Not of the sensor itself; what the paper computes gives no figures to judge by.
    SensorDoesNot,
    /// There is nothing to judge by.
    Unknown,
}

/// What of the paper a claim is computed with, in place of the sensor itself.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Basis {
    /// Its image: thin shell and Tikhonov.
    Solver,
    /// Its definition of a figure of the readings, SENS or FMAX, in which there is no image and no solver.
    Definition,
    /// All four metrics: two by their definition, two with its solver.
    Metrics,
    /// Readings, which it compares between models.
    Readings,
}

/// A claim of the paper with what was found.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Claim {
    /// What the paper says, in short.
    pub claim: &'static str,
    /// What of the paper it is computed with.
    pub basis: Basis,
    /// Whether it holds.
    pub verdict: Verdict,
    /// What was found with that: a number and what it is.
    pub paper: String,
    /// What was found of the sensor itself.
    pub sensor: String,
}

impl Verdict {
    /// From whether it holds as the paper computes it and of the sensor.
    pub fn of(paper: Option<bool>, sensor: Option<bool>) -> Self {
        match (paper, sensor) {
            (Some(true), Some(true)) => Self::Holds,
            (Some(true), Some(false)) => Self::PaperOnly,
            (Some(false), Some(true)) => Self::SensorOnly,
            (Some(false), Some(false)) => Self::DoesNotHold,
            (None, Some(true)) => Self::SensorHolds,
            (None, Some(false)) => Self::SensorDoesNot,
            (_, None) => Self::Unknown,
        }
    }
}

impl Basis {
    /// In words that follow "holds".
    pub const fn text(self) -> &'static str {
        match self {
            Self::Solver => "with its solver",
            Self::Definition => "by its definition",
            Self::Metrics => "by its metrics",
            Self::Readings => "for its models",
        }
    }
}

impl Claim {
    /// A claim that two rank correlations decide, as the paper computes it and of the sensor: each above 0.5 confirms it.
    pub(crate) fn of_trends(claim: &'static str, basis: Basis, paper: &Trend, sensor: &Trend) -> Self {
        let verdict = Verdict::of(paper.confirms(), sensor.confirms());
        Self { claim, basis, verdict, paper: paper.text(), sensor: sensor.text() }
    }

    /// The verdict in words.
    pub fn verdict_text(&self) -> String {
        let basis = self.basis.text();
        match self.verdict {
            Verdict::Holds => "holds".to_owned(),
            Verdict::PaperOnly => format!("holds {basis} only"),
            Verdict::SensorOnly => format!("holds for the sensor, not {basis}"),
            Verdict::DoesNotHold => "does not hold".to_owned(),
            Verdict::SensorHolds => format!("holds for the sensor, cannot be judged {basis}"),
            Verdict::SensorDoesNot => format!("does not hold for the sensor, cannot be judged {basis}"),
            Verdict::Unknown => "cannot be judged".to_owned(),
        }
    }
}

/// A rank correlation that is claimed to be above zero.
#[derive(Clone, Debug)]
pub(crate) struct Trend {
    /// Of what with what.
    pub of: String,
    /// The correlation.
    pub correlation: Option<f64>,
    /// Over how many conditions.
    pub conditions: usize,
}

impl Trend {
    /// Of pairs.
    pub fn of(of: impl Into<String>, pairs: &[[f64; 2]]) -> Self {
        Self { of: of.into(), correlation: spearman(pairs), conditions: pairs.len() }
    }

    pub fn confirms(&self) -> Option<bool> {
        self.correlation.map(|correlation| correlation > TREND)
    }

    pub fn text(&self) -> String {
        format!("{}: {}", self.of, self.value_text())
    }

    /// The correlation alone, and over how many conditions.
    pub fn value_text(&self) -> String {
        self.correlation.map_or_else(
            || "too few conditions".to_owned(),
            |correlation| format!("rank correlation {correlation:+.2} (n = {})", self.conditions),
        )
    }
}

/// Title of the table of claims.
pub const CLAIMS: &str = "What of the paper holds";

/// Claims as a table: what is said, whether it holds, and the numbers.
pub(crate) fn table(claims: &[Claim]) -> Table {
    let level = |claim: &Claim| match claim.verdict {
        Verdict::Holds => Some(0),
        Verdict::SensorOnly | Verdict::SensorHolds => Some(1),
        Verdict::PaperOnly => Some(2),
        Verdict::DoesNotHold | Verdict::SensorDoesNot => Some(3),
        Verdict::Unknown => None,
    };
    Table::of(CLAIMS, claims)
        .column("the paper says", TEXT, |claim| claim.claim)
        .cells("", TEXT, |claim| Cell { value: claim.verdict_text().into(), level: level(claim), ..Cell::default() })
        .column("as it computes it", TEXT, |claim| format!("{}: {}", claim.basis.text(), claim.paper))
        .column("the sensor itself", TEXT, |claim| claim.sensor.as_str())
        .style(Style::Prose)
        .into()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn claim(basis: Basis, holds: [Option<bool>; 2]) -> Claim {
        let verdict = Verdict::of(holds[0], holds[1]);
        Claim { claim: "c", basis, verdict, paper: "p < 1".to_owned(), sensor: "s".to_owned() }
    }

    #[test]
    fn a_verdict_names_what_it_was_found_with() {
        let text = |basis, holds| claim(basis, holds).verdict_text();
        assert_eq!(text(Basis::Definition, [Some(false), Some(true)]), "holds for the sensor, not by its definition");
        assert_eq!(text(Basis::Solver, [Some(true), Some(false)]), "holds with its solver only");
        assert_eq!(
            text(Basis::Metrics, [None, Some(false)]),
            "does not hold for the sensor, cannot be judged by its metrics"
        );
        assert_eq!(text(Basis::Solver, [Some(true), None]), "cannot be judged");
        let all = [claim(Basis::Definition, [Some(true); 2])];
        assert_eq!(table(&all).rows[0][2].value, "by its definition: p < 1".into());
    }
}
