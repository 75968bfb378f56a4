//! What the paper concludes from its maps, on ours.

use super::super::claim::{Basis, Found, Trend, Verdict};
use super::super::rank::spearman;
use super::{Claim, Condition, short};

/// A conductivity is "about" another within this factor: half a decade, the step of the paper's map.
const ABOUT: f64 = 3.2;
/// Conductivity that the paper finds suited to touch of several newtons, and where it sees the best accuracy at the bottom (S/m).
const SUITED_S_PER_M: f64 = 0.2;
const PEAK_S_PER_M: f64 = 1.0;
/// A condition is among the best in a figure if it is in the best tenth.
const BEST_SHARE: f64 = 0.1;
/// Touch of several newtons (N): from a keystroke, the least that ISO 9241-410 prefers, to the largest force that the paper applied.
const TOUCH_N: [f64; 2] = [0.5, 5.0];

/// A figure of a condition: larger is better. Images that have collapsed have none.
type Figure = fn(&Condition) -> Option<f64>;

/// By the paper's definition, and the sensor's own of the same meaning.
const SENSITIVITY: [Figure; 2] = [|c| c.exact.sensitivity(), |c| Some(c.limit.signal_to_noise_db)];
const MAXIMUM: [Figure; 2] = [|c| c.exact.maximum(), |c| c.limit.range[1]];
/// With the paper's solver, and the sensor's own: each at a contact of 1 S/m, and where the contact is at half of the drive.
const RESOLUTION: [[Figure; 2]; 2] = [
    [|c| c.exact.imaging.sharpness(), |c| c.at_half.as_ref()?.imaging.sharpness()],
    [|c| c.limit.two_points_m.map(|m| -m), |c| c.at_half.as_ref()?.two_points_m.map(|m| -m)],
];
const ACCURACY: [[Figure; 2]; 2] = [
    [|c| c.exact.imaging.accuracy(), |c| c.at_half.as_ref()?.imaging.accuracy()],
    [|c| c.limit.place_m.map(|m| -m), |c| c.at_half.as_ref()?.place_m.map(|m| -m)],
];
const AT: [&str; 2] = ["contact of 1 S/m", "contact at half of the drive"];

/// Whether something holds at both strengths, and what was found at each, by a test of each of two figures.
fn at_both(figures: [Figure; 2], what: &str, test: impl Fn(Figure) -> Found) -> Found {
    let [one, half] = figures.map(test);
    let text = format!("{what}, {}: {}; {}: {}", AT[0], one.text, AT[1], half.text);
    Found::new(one.verdict.and(half.verdict), text)
}

/// All claims of section III.B.
pub(super) fn of(conditions: &[Condition], conductivities_s_per_m: &[f64]) -> Vec<Claim> {
    let map = Map { conditions, conductivities_s_per_m };
    vec![
        map.suited(),
        Claim::new(
            "sensitivity rises with the conductivity of the top",
            Basis::Definition,
            [("SENS with top", SENSITIVITY[0]), ("signal to noise with top", SENSITIVITY[1])]
                .map(|(what, figure)| map.trend(what, figure, |c| c.top_s_per_m).found()),
        ),
        map.most_sensitive(),
        map.sharpened_by_a_poor_bottom(),
        map.high_and_even(),
        map.bottom_above_top(),
        map.peak(),
        map.best_in_all(),
    ]
}

struct Map<'a> {
    conditions: &'a [Condition],
    conductivities_s_per_m: &'a [f64],
}

impl<'a> Map<'a> {
    fn trend(&self, of: &str, figure: Figure, by: fn(&Condition) -> f64) -> Trend {
        let pairs: Vec<_> = self.conditions.iter().filter_map(|c| Some([by(c), figure(c)?])).collect();
        Trend::of(of, &pairs)
    }

    /// Conditions of the same conductivity at top and bottom.
    fn uniform(&self) -> impl Iterator<Item = &'a Condition> {
        self.conditions.iter().filter(|c| c.bottom_s_per_m == c.top_s_per_m)
    }

    fn sharpened_by_a_poor_bottom(&self) -> Claim {
        let found = |figures: [Figure; 2], what: &str| {
            at_both(figures, &format!("{what} with bottom, reversed"), |figure| {
                let trend = self.trend("", figure, |c| -c.bottom_s_per_m);
                Found::new(trend.verdict(), trend.value_text())
            })
        };
        Claim::new(
            "a low conductivity of the bottom sharpens the image",
            Basis::Solver,
            [found(RESOLUTION[0], "SR"), found(RESOLUTION[1], "two points told apart")],
        )
    }

    /// About 0.2 S/m for several newtons: with the solver, the uniform material whose least normalised metric is the largest; of the sensor, those that
    /// see a light press and do not saturate under a firm one.
    fn suited(&self) -> Claim {
        let normalised =
            [(SENSITIVITY[0], true), (MAXIMUM[0], true), (RESOLUTION[0][0], false), (ACCURACY[0][0], false)]
                .map(|(figure, is_log)| self.normalised(figure, is_log));
        let balance = |c: &Condition| {
            normalised.iter().map(|share| share(c)).try_fold(f64::INFINITY, |least, share| Some(least.min(share?)))
        };
        let balanced = best(self.uniform(), balance);
        let covers = |c: &&Condition| matches!(c.force_range_n, [Some(low), high] if low <= TOUCH_N[0] && high.is_none_or(|high| high >= TOUCH_N[1]));
        let suited: Vec<f64> = self.uniform().filter(covers).map(|c| c.bottom_s_per_m).collect();
        let is_about = |found: f64| (1.0 / ABOUT..=ABOUT).contains(&(found / SUITED_S_PER_M));
        let is_only = suited.iter().any(|found| is_about(*found)) && suited.iter().all(|found| is_about(*found));
        let paper = balanced.map_or_else(
            || "no uniform material has all four figures: images have collapsed".to_owned(),
            |c| format!("the least of the four normalised metrics is best at {} S/m, uniform", short(c.bottom_s_per_m)),
        );
        let sensor = match (suited.first(), suited.last()) {
            (Some(low), Some(high)) => format!(
                "{} to {} N is within the range of every uniform foam from {} to {} S/m that is as soft as sample A",
                TOUCH_N[0],
                TOUCH_N[1],
                short(*low),
                short(*high)
            ),
            _ => format!("no uniform foam has {} to {} N within its range", TOUCH_N[0], TOUCH_N[1]),
        };
        Claim::new(
            "about 0.2 S/m suits touch of several newtons",
            Basis::Metrics,
            [
                Found::new(Verdict::of(balanced.map(|c| is_about(c.bottom_s_per_m))), paper),
                Found::new(Verdict::of(self.uniform().next().map(|_| is_only)), sensor),
            ],
        )
    }

    /// Highest sensitivity for 0.5 S/m above 0.001 S/m: where it is highest, by both readings of eq. (7) and of the sensor.
    fn most_sensitive(&self) -> Claim {
        let at_half = best(self.conditions.iter(), |c| c.exact.sensitivity_at_half_maximum());
        let [solver, sensor] = SENSITIVITY.map(|figure| best(self.conditions.iter(), figure));
        let is_there = |c: &Condition| c.top_s_per_m > 100.0 * c.bottom_s_per_m;
        let place = |c: &Condition| c.title();
        let is_highest = solver.or(at_half).map(|c| is_there(c) || at_half.is_some_and(is_there));
        let paper = format!(
            "SENS is highest at {}; at half of FMAX instead of half of what is applied, at {}",
            said(solver, place),
            said(at_half, place)
        );
        let text = format!("signal to noise is highest at {}", said(sensor, place));
        Claim::new(
            "the most sensitive is a conductive top (0.5 S/m) on a poor bottom (0.001 S/m)",
            Basis::Definition,
            [Found::new(Verdict::of(is_highest), paper), Found::new(Verdict::of(sensor.map(is_there)), text)],
        )
    }

    /// High and even: the maximum rises along the diagonal, and no gradient of the same mean has more.
    fn high_and_even(&self) -> Claim {
        let found = MAXIMUM.map(|figure| {
            let pairs: Vec<_> = self.uniform().filter_map(|c| Some([c.bottom_s_per_m, figure(c)?])).collect();
            let (rises, [even, all]) = (spearman(&pairs), self.counts_of_pairs(figure, is_even_of));
            let text = match (rises, all) {
                (Some(rises), 1..) => format!(
                    "rank correlation with uniform conductivity {rises:+.2}; even has more than a gradient of the same mean in {}",
                    of_pairs([even, all])
                ),
                _ => NOT_COMPUTED.to_owned(),
            };
            Found::new(Verdict::of_correlation(rises, pairs.len()).and(Verdict::of_share(even, all)), text)
        });
        Claim::new("the maximum force is largest for high and even conductivity", Basis::Definition, found)
    }

    fn bottom_above_top(&self) -> Claim {
        let found = |figures: [Figure; 2], what: &str| {
            at_both(figures, &format!("{what} is better so than the other way round"), |figure| {
                let [better, all] = self.counts_of_pairs(figure, is_mirrored_with_better_bottom);
                let text = match all {
                    0 => NOT_COMPUTED.to_owned(),
                    _ => format!("in {}", of_pairs([better, all])),
                };
                Found::new(Verdict::of_share(better, all), text)
            })
        };
        Claim::new(
            "accuracy wants the bottom more conductive than the top",
            Basis::Solver,
            [found(ACCURACY[0], "PA"), found(ACCURACY[1], "the standard error of places")],
        )
    }

    /// The conductivity of the bottom with the best accuracy, mean over tops: of those of which at least half of the tops have a figure.
    fn peak(&self) -> Claim {
        let best_at = |figure: Figure| {
            let mean = |bottom: &f64| {
                let row = self.conditions.iter().filter(|c| c.bottom_s_per_m == *bottom);
                // Errors of places spread over decades: their logarithms are averaged.
                let values: Vec<f64> =
                    row.filter_map(figure).map(|value| if value < 0.0 { -(-value).ln() } else { value }).collect();
                let is_enough = 2 * values.len() >= self.conductivities_s_per_m.len();
                super::super::rank::mean(&values).filter(|_| is_enough).map(|mean| (*bottom, mean))
            };
            let means = self.conductivities_s_per_m.iter().filter_map(mean);
            means.max_by(|a, b| a.1.total_cmp(&b.1)).map(|(bottom, _)| bottom)
        };
        let found = |figures: [Figure; 2], what: &str| {
            at_both(figures, &format!("{what} is best"), |figure| {
                let at = best_at(figure);
                let is_there = at.map(|at| (1.0 / ABOUT..=ABOUT).contains(&(at / PEAK_S_PER_M)));
                let text = at.map_or(NOT_COMPUTED.to_owned(), |at| format!("at a bottom of {} S/m", short(at)));
                Found::new(Verdict::of(is_there), text)
            })
        };
        Claim::new(
            "accuracy peaks near 1 S/m at the bottom",
            Basis::Solver,
            [found(ACCURACY[0], "mean PA"), found(ACCURACY[1], "the mean standard error of places")],
        )
    }

    /// No condition is among the best tenth of all four.
    fn best_in_all(&self) -> Claim {
        let found = [0, 1].map(|side| {
            let figures = [SENSITIVITY[side], MAXIMUM[side], RESOLUTION[side][0], ACCURACY[side][0]];
            let levels: Option<Vec<f64>> = figures.iter().map(|figure| self.level(*figure)).collect();
            let levels = levels?;
            let among = |c: &&Condition| {
                figures.iter().zip(&levels).all(|(figure, level)| figure(c).is_some_and(|value| value >= *level))
            };
            Some(self.conditions.iter().filter(among).collect::<Vec<_>>())
        });
        let text = |best: &Option<Vec<&Condition>>| match best.as_deref() {
            None => "fewer than a tenth of the conditions have a figure: images have collapsed".to_owned(),
            Some([]) => "no condition is in the best tenth of all four figures".to_owned(),
            Some([first, ..]) => format!("{} is in the best tenth of all four figures", first.title()),
        };
        let found = found.map(|best| Found::new(Verdict::of(best.as_ref().map(Vec::is_empty)), text(&best)));
        Claim::new("no condition is best in all four", Basis::Metrics, found)
    }

    /// Of pairs of conditions that belong together, those of which the first has more of a figure, and all.
    fn counts_of_pairs(&self, figure: Figure, together: fn(&Condition, &Condition) -> bool) -> [usize; 2] {
        let mut counts = [0; 2];
        for first in self.conditions {
            for second in self.conditions.iter().filter(|second| together(first, second)) {
                if let (Some(a), Some(b)) = (figure(first), figure(second)) {
                    counts[usize::from(a > b)] += 1;
                }
            }
        }
        [counts[1], counts[0] + counts[1]]
    }

    /// From 0 for the worst condition to 1 for the best, even in the logarithm for what spans decades.
    fn normalised(&self, figure: Figure, is_log: bool) -> impl Fn(&Condition) -> Option<f64> {
        let scaled = move |value: f64| if is_log { value.ln() } else { value };
        let [low, high] = extent(self.conditions.iter().filter_map(figure).map(scaled));
        move |c| figure(c).filter(|_| high > low).map(|value| (scaled(value) - low) / (high - low))
    }

    /// The value from which on a condition is among the best tenth.
    fn level(&self, figure: Figure) -> Option<f64> {
        let mut values: Vec<f64> = self.conditions.iter().filter_map(figure).collect();
        values.sort_by(|a, b| b.total_cmp(a));
        values.get(((self.conditions.len() as f64 * BEST_SHARE).ceil() as usize).saturating_sub(1)).copied()
    }
}

const NOT_COMPUTED: &str = "too few conditions";

/// A share in words.
fn of_pairs([yes, all]: [usize; 2]) -> String {
    format!("{:.0} % of {all} pairs", 100.0 * yes as f64 / all as f64)
}

/// Smallest and largest.
pub(crate) fn extent(values: impl Iterator<Item = f64>) -> [f64; 2] {
    values.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], value| [low.min(value), high.max(value)])
}

fn best<'a>(
    conditions: impl Iterator<Item = &'a Condition>,
    figure: impl Fn(&Condition) -> Option<f64>,
) -> Option<&'a Condition> {
    let rated = conditions.filter_map(|c| Some((figure(c)?, c)));
    rated.max_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, c)| c)
}

fn said(found: Option<&Condition>, text: impl Fn(&Condition) -> String) -> String {
    found.map_or(NOT_COMPUTED.to_owned(), text)
}

/// Whether the first is even and the second a gradient with the same geometric mean.
fn is_even_of(first: &Condition, second: &Condition) -> bool {
    let mean = |c: &Condition| c.bottom_s_per_m.ln() + c.top_s_per_m.ln();
    first.bottom_s_per_m == first.top_s_per_m
        && second.bottom_s_per_m != second.top_s_per_m
        && (mean(first) - mean(second)).abs() < 1e-6
}

/// Whether the second is the first upside down, which has the better conductor at the bottom.
fn is_mirrored_with_better_bottom(first: &Condition, second: &Condition) -> bool {
    first.bottom_s_per_m > first.top_s_per_m
        && (first.bottom_s_per_m, first.top_s_per_m) == (second.top_s_per_m, second.bottom_s_per_m)
}
