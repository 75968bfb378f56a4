//! What the paper claims, and whether it holds: of the sensor, or of its solver only.

use tactomo_study::page::escaped;

/// Rank correlations above this count as a trend: with it, two ranks explain a quarter of each other.
const TREND: f64 = 0.5;

/// Whether a claim holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Verdict {
    /// With the paper's solver, and of the sensor itself.
    Holds,
    /// With the paper's solver; the sensor does not set that limit.
    SolverOnly,
    /// Of the sensor itself; that solver does not show it.
    SensorOnly,
    /// Neither.
    DoesNotHold,
    /// What it needs was not computed.
    Unknown,
}

/// A claim of the paper with what was found.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Claim {
    /// What the paper says, in short.
    pub claim: &'static str,
    /// Whether it holds.
    pub verdict: Verdict,
    /// What was found with the paper's solver: a number and what it is.
    pub solver: String,
    /// What was found of the sensor itself.
    pub sensor: String,
}

impl Verdict {
    /// From whether it holds with the paper's solver and of the sensor.
    pub fn of(solver: Option<bool>, sensor: Option<bool>) -> Self {
        match (solver, sensor) {
            (Some(true), Some(true)) => Self::Holds,
            (Some(true), Some(false)) => Self::SolverOnly,
            (Some(false), Some(true)) => Self::SensorOnly,
            (Some(false), Some(false)) => Self::DoesNotHold,
            _ => Self::Unknown,
        }
    }

    /// In words.
    pub const fn text(self) -> &'static str {
        match self {
            Self::Holds => "holds",
            Self::SolverOnly => "holds for that solver only",
            Self::SensorOnly => "holds for the sensor, not with that solver",
            Self::DoesNotHold => "does not hold",
            Self::Unknown => "not computed",
        }
    }
}

impl Claim {
    /// A claim that two rank correlations decide, with the paper's solver and of the sensor: each above 0.5 confirms it.
    pub(crate) fn of_trends(claim: &'static str, solver: Trend, sensor: Trend) -> Self {
        let verdict = Verdict::of(solver.confirms(), sensor.confirms());
        Self { claim, verdict, solver: solver.text(), sensor: sensor.text() }
    }
}

/// A rank correlation that is claimed to be above zero.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Trend {
    /// Of what with what.
    pub of: &'static str,
    /// The correlation.
    pub correlation: Option<f64>,
}

impl Trend {
    pub fn confirms(&self) -> Option<bool> {
        self.correlation.map(|correlation| correlation > TREND)
    }

    pub fn text(&self) -> String {
        self.correlation.map_or_else(
            || format!("{}: too few conditions", self.of),
            |correlation| format!("{}: rank correlation {correlation:+.2}", self.of),
        )
    }
}

/// Claims as lines of text.
pub fn table(claims: &[Claim]) -> String {
    let line = |claim: &Claim| {
        format!(
            "{}: {}\n    that solver: {}\n    the sensor: {}\n",
            claim.claim,
            claim.verdict.text(),
            claim.solver,
            claim.sensor
        )
    };
    claims.iter().map(line).collect()
}

/// Claims as a table of a page: what is said, whether it holds, and the numbers.
pub fn html(claims: &[Claim]) -> String {
    let row = |claim: &Claim| {
        let level = match claim.verdict {
            Verdict::Holds => "h0",
            Verdict::SensorOnly => "h1",
            Verdict::SolverOnly => "h2",
            Verdict::DoesNotHold => "h3",
            Verdict::Unknown => "empty",
        };
        format!(
            "<tr><td>{}</td><td class=\"verdict {level}\">{}</td><td>{}</td><td>{}</td></tr>\n",
            escaped(claim.claim),
            claim.verdict.text(),
            escaped(&claim.solver),
            escaped(&claim.sensor)
        )
    };
    let rows: String = claims.iter().map(row).collect();
    format!(
        "<div class=\"wide\"><table class=\"claims\"><thead><tr><th>the paper says</th><th></th><th>with its solver</th>\
         <th>the sensor itself</th></tr></thead><tbody>\n{rows}</tbody></table></div>"
    )
}
