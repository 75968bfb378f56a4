//! What the paper claims, and whether it holds: as the paper computes it, or of the sensor.

use tactomo_study::view::{Cell, Style, TEXT, Table};

use super::rank::spearman;

/// Rank correlations above this count as a trend: with it, two ranks explain a quarter of each other.
const TREND: f64 = 0.5;

/// Conditions from which on a correlation can be beyond chance: of fewer than five, even a perfect order is as frequent as 1 in 12.
const LEAST_CONDITIONS: usize = 5;
/// Chance gives what counts as shown in less than this share of tests.
const SHOWN: f64 = 0.05;
/// Deviations of a normal error that 95 % are within.
const NORMAL_95: f64 = 1.96;

/// Whether something holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Verdict {
    /// It does.
    Holds,
    /// It does not.
    DoesNotHold,
    /// There are too few conditions, or chance is too likely, to say either.
    NotShown,
    /// There is nothing to judge by.
    Unknown,
}

impl Verdict {
    /// Of what is computed without chance; `None` if it is not.
    pub fn of(holds: Option<bool>) -> Self {
        match holds {
            Some(true) => Self::Holds,
            Some(false) => Self::DoesNotHold,
            None => Self::Unknown,
        }
    }

    /// Of a rank correlation over so many conditions that is claimed to be above 0.5: it holds if it is that and beyond chance, and does not where the 95 %
    /// interval is below. The interval is Fisher's with the variance that ranks have (Fieller, Hartley and Pearson, "Tests for rank correlation
    /// coefficients I", Biometrika 44, 1957).
    pub fn of_correlation(correlation: Option<f64>, conditions: usize) -> Self {
        let Some(correlation) = correlation else { return Self::Unknown };
        if conditions < LEAST_CONDITIONS {
            return Self::NotShown;
        }
        let half = NORMAL_95 * (1.06 / (conditions as f64 - 3.0)).sqrt();
        let [low, high] = [-half, half].map(|side| (correlation.atanh() + side).tanh());
        match (correlation > TREND && low > 0.0, high < TREND) {
            (true, _) => Self::Holds,
            (_, true) => Self::DoesNotHold,
            _ => Self::NotShown,
        }
    }

    /// Of what is claimed of most pairs and is so in some of all: by the sign test, against even odds.
    pub fn of_share(yes: usize, all: usize) -> Self {
        let chance = |least: usize| {
            let ways = |k: usize| (0..k).fold(1.0, |ways, i| ways * (all - i) as f64 / (i + 1) as f64);
            (least..=all).map(ways).sum::<f64>() / 2f64.powi(all as i32)
        };
        match all {
            0 => Self::Unknown,
            _ if chance(yes) <= SHOWN => Self::Holds,
            _ if chance(all - yes) <= SHOWN => Self::DoesNotHold,
            _ => Self::NotShown,
        }
    }

    /// Of both of two.
    pub fn and(self, other: Self) -> Self {
        let is_any = |verdict| self == verdict || other == verdict;
        [Self::Unknown, Self::DoesNotHold, Self::NotShown]
            .into_iter()
            .find(|worse| is_any(*worse))
            .unwrap_or(Self::Holds)
    }

    fn text(self) -> &'static str {
        match self {
            Self::Holds => "holds",
            Self::DoesNotHold => "does not hold",
            Self::NotShown => "not shown",
            Self::Unknown => "cannot be judged",
        }
    }
}

/// What was found on a claim.
#[derive(Clone, Debug)]
pub(crate) struct Found {
    /// Whether it holds.
    pub verdict: Verdict,
    /// A number and what it is.
    pub text: String,
}

impl Found {
    /// With what was found.
    pub fn new(verdict: Verdict, text: impl Into<String>) -> Self {
        Self { verdict, text: text.into() }
    }
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
    /// Whether it holds, in words.
    pub verdict: String,
    /// What was found with that: a number and what it is.
    pub paper: String,
    /// What was found of the sensor itself.
    pub sensor: String,
    /// Whether it holds with that, and of the sensor itself.
    #[serde(skip)]
    pub verdicts: [Verdict; 2],
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
    /// With what was found as the paper computes it, and of the sensor.
    pub(crate) fn new(claim: &'static str, basis: Basis, [paper, sensor]: [Found; 2]) -> Self {
        let verdicts = [paper.verdict, sensor.verdict];
        let [of_paper, of_sensor] = verdicts.map(Verdict::text);
        let verdict = match of_paper == of_sensor {
            true => of_paper.to_owned(),
            false => format!("{of_paper} {}; {of_sensor} for the sensor", basis.text()),
        };
        Self { claim, basis, verdict, paper: paper.text, sensor: sensor.text, verdicts }
    }
}

/// A rank correlation that is claimed to be above 0.5.
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

    pub fn verdict(&self) -> Verdict {
        Verdict::of_correlation(self.correlation, self.conditions)
    }

    pub fn found(&self) -> Found {
        Found::new(self.verdict(), self.text())
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
    let level = |claim: &Claim| match claim.verdicts {
        [Verdict::Holds, Verdict::Holds] => Some(0),
        [_, Verdict::Holds] => Some(1),
        [Verdict::Holds, _] => Some(2),
        verdicts => verdicts.contains(&Verdict::DoesNotHold).then_some(3),
    };
    Table::of(CLAIMS, claims)
        .column("the paper says", TEXT, |claim| claim.claim)
        .cells("", TEXT, |claim| Cell { value: claim.verdict.as_str().into(), level: level(claim), ..Cell::default() })
        .column("as it computes it", TEXT, |claim| format!("{}: {}", claim.basis.text(), claim.paper))
        .column("the sensor itself", TEXT, |claim| claim.sensor.as_str())
        .style(Style::Prose)
        .into()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn claim(basis: Basis, verdicts: [Verdict; 2]) -> Claim {
        Claim::new("c", basis, verdicts.map(|verdict| Found::new(verdict, "p < 1")))
    }

    #[test]
    fn a_verdict_names_what_it_was_found_with() {
        let text = |basis, verdicts| claim(basis, verdicts).verdict;
        assert_eq!(text(Basis::Solver, [Verdict::NotShown; 2]), "not shown");
        assert_eq!(
            text(Basis::Definition, [Verdict::DoesNotHold, Verdict::Holds]),
            "does not hold by its definition; holds for the sensor"
        );
        assert_eq!(
            text(Basis::Metrics, [Verdict::Unknown, Verdict::NotShown]),
            "cannot be judged by its metrics; not shown for the sensor"
        );
        let all = [claim(Basis::Definition, [Verdict::Holds; 2])];
        assert_eq!(table(&all).rows[0][2].value, "by its definition: p < 1".into());
    }

    #[test]
    fn too_few_conditions_show_nothing() {
        let of = |correlation, conditions| Verdict::of_correlation(Some(correlation), conditions);
        assert_eq!(
            [of(1.0, 4), of(-1.0, 4), of(0.6, 4)],
            [Verdict::NotShown; 3],
            "as many orders as that have no rare one"
        );
        assert_eq!([of(1.0, 5), of(0.54, 121), of(0.85, 9)], [Verdict::Holds; 3]);
        assert_eq!([of(0.26, 112), of(-0.3, 11), of(-1.0, 5)], [Verdict::DoesNotHold; 3]);
        assert_eq!([of(0.15, 10), of(0.6, 8), of(0.45, 121)], [Verdict::NotShown; 3]);
        assert_eq!(Verdict::of_correlation(None, 121), Verdict::Unknown);
    }

    #[test]
    fn a_share_of_few_pairs_shows_nothing() {
        // All of four is chance in one of 16, all of five in one of 32.
        let of = |yes, all| Verdict::of_share(yes, all);
        assert_eq!([of(4, 4), of(4, 5), of(1, 2)], [Verdict::NotShown; 3]);
        assert_eq!([of(5, 5), of(40, 55)], [Verdict::Holds; 2]);
        assert_eq!([of(0, 5), of(10, 55)], [Verdict::DoesNotHold; 2]);
        assert_eq!(of(0, 0), Verdict::Unknown);
    }

    #[test]
    fn both_hold_only_together() {
        use Verdict::{DoesNotHold, Holds, NotShown, Unknown};
        assert_eq!([Holds.and(Holds), Holds.and(NotShown)], [Holds, NotShown]);
        assert_eq!([NotShown.and(DoesNotHold), DoesNotHold.and(Unknown)], [DoesNotHold, Unknown]);
    }
}
