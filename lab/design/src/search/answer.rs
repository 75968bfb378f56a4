//! What is answered: the few best with reasons, what is impossible, and which wish to relax.

use std::sync::atomic::AtomicBool;
use std::time::Instant;

use tactomo_physics::detector::Detector;

use super::super::reached::{AsBuilt, as_built};
use super::super::{DesignError, Press, Progress};
use super::find::{Found, find, front};
use super::rating::hertz;
use super::{Material, Rating, Space, Wish, Wishes};

/// Presses that choices are tried with: shares of the sides from the middle.
const TRIED: [[f64; 2]; 5] = [[0.03, -0.07], [-0.28, 0.17], [0.21, 0.31], [0.36, -0.33], [-0.13, -0.22]];

/// What to search.
#[derive(Clone, Debug)]
pub struct Plan {
    /// What is wanted.
    pub wishes: Wishes,
    /// Of what it can be made.
    pub foams: Vec<Material>,
    /// How many candidates are tried at most.
    pub most: usize,
    /// A detector that is compared with what is found; it has to say how soft it is.
    pub compared: Option<Detector>,
    /// Of the sample, and of noise.
    pub seed: u64,
}

/// A detector that is proposed.
#[derive(Clone, Debug, serde::Serialize)]
pub struct Choice {
    /// What it is, as one would order it.
    pub name: String,
    /// Why it is among the few, in plain words.
    pub reason: String,
    /// What it gives.
    pub rating: Rating,
    /// Whether it meets all wishes.
    pub meets_all: bool,
    /// Error of places (m) that half of some presses on a detector as built, drawn from the tolerances, are told better than by `auto`, with one frame each.
    pub place_found_m: Option<f64>,
    /// The detector itself.
    #[serde(skip)]
    pub detector: Detector,
}

/// A wish that cannot be met, alone or with the others.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Unmet {
    /// Which.
    pub wish: Wish,
    /// What was wanted.
    pub wanted: f64,
    /// The best there is: of all candidates, those not rated as built as described, if it is impossible; else of those that meet all other wishes as built.
    pub best: f64,
    /// By which candidate.
    pub by: String,
}

/// The wish without which the others are met best, where no candidate meets all but one.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Costliest {
    /// Which.
    pub wish: Wish,
    /// What was wanted.
    pub wanted: f64,
    /// The candidate that meets the others best.
    pub by: String,
    /// What that gives of the wish; `None` if nothing.
    pub given: Option<f64>,
    /// Factor by which it misses that of the others which it misses most.
    pub others_missed: f64,
}

/// How a detector that was compared does.
#[derive(Clone, Debug, serde::Serialize)]
pub struct Compared {
    /// Its name.
    pub name: String,
    /// What it gives.
    pub rating: Rating,
    /// Whether it meets all wishes.
    pub meets_all: bool,
    /// How many of the candidates that were rated as built meet the wishes better.
    pub better: usize,
    /// How many are at least as good in everything, and better in something.
    pub beaten_by: usize,
}

/// What is answered.
#[derive(Clone, Debug, serde::Serialize)]
pub struct Answer {
    /// What was wanted.
    pub wishes: Wishes,
    /// Candidates in all, and how many were tried.
    pub candidates: usize,
    /// Those that could be built.
    pub tried: usize,
    /// The best of them, and those that no other beat: what they give as built, within their tolerances, was rated.
    pub rated: usize,
    /// How many of these meet all wishes.
    pub meeting: usize,
    /// The few best, the best first.
    pub choices: Vec<Choice>,
    /// Wishes that no candidate meets, even alone.
    pub impossible: Vec<Unmet>,
    /// If no candidate meets all: wishes of which one is to be relaxed, and how far.
    pub relax: Vec<Unmet>,
    /// If none meets all but one either: the one that costs most.
    pub costliest: Option<Costliest>,
    /// Those that no other beats: what each gives.
    pub front: Vec<Rating>,
    /// All that were rated as built.
    #[serde(skip)]
    pub all: Vec<Rating>,
    /// The detector that was compared.
    pub compared: Option<Compared>,
    /// Whether it was ended before all was done.
    pub is_stopped: bool,
    /// What it took (s).
    pub seconds: f64,
}

/// Searches, and answers.
///
/// # Errors
/// [`DesignError`] if a candidate cannot be modelled, or there is none.
pub fn answer(plan: &Plan, progress: Progress) -> Result<Answer, DesignError> {
    let start = Instant::now();
    let wishes = &plan.wishes;
    let space = Space::new(wishes, &plan.foams);
    let found = find(&space, wishes, plan.most, plan.seed, progress)?;
    if found.is_empty() && !progress.is_stopped() {
        return Err(DesignError::NothingFits { electrodes: wishes.electrodes });
    }
    // As described no detector gives less than as built, so that what none gives is impossible; whatever else is said needs those rated as built.
    let impossible = unmet(&found, wishes, |_, _| true);
    let tried = found.len();
    let found: Vec<Found> = found.into_iter().filter(|found| found.is_in_full).collect();
    let picked = picked(&found, wishes);
    // Also after a search that was stopped: without choices there is no answer.
    let never = AtomicBool::new(false);
    let choices = Progress::new(&never, progress.say)
        .map("choices as built", &picked, |(found, reason)| choice(found, reason, plan));
    let compared = plan.compared.as_ref().map(|detector| compared(detector, &found, wishes)).transpose()?;
    let meeting = found.iter().filter(|found| found.rating.meets(wishes, None)).count();
    let relax = match meeting {
        0 => unmet(&found, wishes, |rating, wish| rating.meets(wishes, Some(wish))),
        _ => Vec::new(),
    };
    Ok(Answer {
        candidates: space.count(),
        tried,
        rated: found.len(),
        meeting,
        choices: choices.into_iter().flatten().collect::<Result<_, _>>()?,
        impossible,
        costliest: if meeting == 0 && relax.is_empty() { costliest(&found, wishes) } else { None },
        relax,
        front: front(&found).into_iter().map(|found| found.rating).collect(),
        all: found.iter().map(|found| found.rating).collect(),
        compared,
        is_stopped: progress.is_stopped(),
        wishes: wishes.clone(),
        seconds: start.elapsed().as_secs_f64(),
    })
}

/// The few best: the one that meets the wishes best, and those that are best in one thing among those that meet all (or, if none does, among those
/// that miss least).
fn picked<'a>(found: &'a [Found], wishes: &Wishes) -> Vec<(&'a Found, String)> {
    let Some(best) = found.iter().max_by(|a, b| a.rating.score(wishes).total_cmp(&b.rating.score(wishes))) else {
        return Vec::new();
    };
    let meeting: Vec<&Found> = found.iter().filter(|found| found.rating.meets(wishes, None)).collect();
    let pool = if meeting.is_empty() { found.iter().collect() } else { meeting };
    let value = |found: &Found, wish: Wish| found.rating.margin(wish, wishes);
    let most = |of: &dyn Fn(&Found) -> f64| pool.iter().copied().max_by(|a, b| of(a).total_cmp(&of(b)));
    let specialists = [
        ("tells places best", most(&|found| value(found, Wish::Place))),
        ("tells two points best", most(&|found| value(found, Wish::TwoPoints))),
        ("stands the largest force", most(&|found| value(found, Wish::Largest))),
        ("is most sensitive", most(&|found| value(found, Wish::Smallest))),
        (
            "has the fewest electrodes",
            most(&|found| -(found.rating.electrodes as f64) + 1e-3 * found.rating.score(wishes)),
        ),
        ("is thinnest", most(&|found| -1e3 * found.rating.thickness_m + 1e-3 * found.rating.score(wishes))),
    ];
    let mut picked: Vec<(&Found, Vec<&str>)> = vec![(best, vec!["meets the wishes best"])];
    for (what, found) in specialists {
        let Some(found) = found else { continue };
        match picked.iter_mut().find(|(other, _)| other.candidate == found.candidate) {
            Some((_, reasons)) => reasons.push(what),
            None => picked.push((found, vec![what])),
        }
    }
    picked.into_iter().map(|(found, reasons)| (found, reason(found, &reasons, wishes))).collect()
}

/// Why a detector is among the few, and what to know of it.
fn reason(found: &Found, best_in: &[&str], wishes: &Wishes) -> String {
    let rating = &found.rating;
    let missed: Vec<String> = Wish::ALL
        .into_iter()
        .filter(|wish| rating.margin(*wish, wishes) < 0.0)
        .map(|wish| match rating.given(wish) {
            Some(given) => format!("{} is {}, not {}", wish.name(), wish.text(given), wish.wished(wishes.wanted(wish))),
            None => format!("{} is not told at all", wish.name()),
        })
        .collect();
    let tightest = rating.tightest(wishes);
    let tight = match (missed.is_empty(), rating.given(tightest)) {
        (true, Some(given)) => format!("tightest: {} {}", tightest.name(), wish_text(tightest, given)),
        _ => missed.join(", "),
    };
    let saturates = match rating.largest_n {
        Some(largest_n) => format!("saturates at {}", Wish::Largest.text(largest_n)),
        None => "no force saturates it".to_owned(),
    };
    let limit = rating.beyond_hertz.map_or_else(String::new, |beyond| {
        format!("; at the largest force {beyond}, beyond Hertz's theory, so forces there are rough")
    });
    format!("{}; {saturates}; {tight}{limit}", best_in.join(", "))
}

fn wish_text(wish: Wish, given: f64) -> String {
    if given.is_finite() { wish.text(given) } else { "without end".to_owned() }
}

fn choice(found: &Found, reason: &str, plan: &Plan) -> Result<Choice, DesignError> {
    let wishes = &plan.wishes;
    let press = Press::Ball { radius_m: wishes.tip_m, hertz: hertz(&found.detector)? };
    let at = |shares: &[f64; 2]| {
        let place_m = [0, 1].map(|axis| shares[axis] * wishes.size_m[axis]);
        vec![press.at(place_m, wishes.middle_n())]
    };
    let presses = [TRIED.iter().map(at).collect()];
    Ok(Choice {
        name: found.detector.name.clone(),
        reason: reason.to_owned(),
        rating: found.rating,
        meets_all: found.rating.meets(wishes, None),
        place_found_m: as_built(&found.detector, &presses, [plan.seed])?.first().and_then(AsBuilt::place_m),
        detector: found.detector.clone(),
    })
}

/// Wishes that no candidate meets among those that count: what is the best there is.
fn unmet(found: &[Found], wishes: &Wishes, counts: impl Fn(&Rating, Wish) -> bool) -> Vec<Unmet> {
    let of = |wish: Wish| {
        let among = found.iter().filter(|found| counts(&found.rating, wish) && found.rating.given(wish).is_some());
        let best = among.max_by(|a, b| a.rating.margin(wish, wishes).total_cmp(&b.rating.margin(wish, wishes)))?;
        let given = best.rating.given(wish)?;
        let missed = best.rating.margin(wish, wishes) < 0.0;
        missed.then(|| Unmet { wish, wanted: wishes.wanted(wish), best: given, by: best.detector.name.clone() })
    };
    Wish::ALL.into_iter().filter_map(of).collect()
}

/// The wish without which the others are met best.
fn costliest(found: &[Found], wishes: &Wishes) -> Option<Costliest> {
    let without = |wish: Wish| {
        let worst = |found: &Found| found.rating.worst(wishes, Some(wish));
        let best = found.iter().max_by(|a, b| worst(a).total_cmp(&worst(b)))?;
        Some((worst(best), wish, best))
    };
    let (worst, wish, by) = Wish::ALL.into_iter().filter_map(without).max_by(|a, b| a.0.total_cmp(&b.0))?;
    Some(Costliest {
        wish,
        wanted: wishes.wanted(wish),
        by: by.detector.name.clone(),
        given: by.rating.given(wish),
        others_missed: (-worst).exp(),
    })
}

fn compared(detector: &Detector, found: &[Found], wishes: &Wishes) -> Result<Compared, DesignError> {
    let rating = Rating::of(&wishes.board.measuring(detector.clone()), wishes)?;
    let score = rating.score(wishes);
    Ok(Compared {
        name: detector.name.clone(),
        meets_all: rating.meets(wishes, None),
        better: found.iter().filter(|found| found.rating.score(wishes) > score).count(),
        beaten_by: found.iter().filter(|found| rating.is_beaten_by(&found.rating)).count(),
        rating,
    })
}

impl Answer {
    /// A detector's name for a file: what it is made of.
    pub fn toml(&self, index: usize) -> Option<String> {
        self.choices.get(index).map(|choice| choice.detector.to_toml())
    }
}

#[cfg(test)]
mod tests {
    use super::super::wishes::tests::wishes;
    use super::*;

    fn answered(wishes: Wishes) -> Answer {
        let foams = Material::of_paper()
            .into_iter()
            .take(2)
            .map(|foam| Material { thicknesses_m: vec![5e-3, 10e-3], ..foam })
            .collect();
        let stop = AtomicBool::new(false);
        let compared = Some(Detector::default());
        let plan = Plan { wishes, foams, most: 60, compared, seed: 1 };
        answer(&plan, Progress::new(&stop, &|_| {})).unwrap()
    }

    #[test]
    fn modest_wishes_are_met_and_the_file_is_a_detector() {
        let answer = answered(Wishes { place_m: 1.5e-3, two_points_m: 18e-3, electrodes: 9, ..wishes() });
        assert!(answer.meeting > 0 && answer.impossible.is_empty() && answer.relax.is_empty(), "{answer:?}");
        let best = &answer.choices[0];
        assert!(best.meets_all && best.reason.contains("meets the wishes best"), "{}", best.reason);
        let file = Detector::from_toml(&answer.toml(0).unwrap(), "chosen").unwrap();
        assert_eq!(file.electrodes.len(), best.rating.electrodes);
        assert_eq!((file.skin, &file.layers), (best.detector.skin, &best.detector.layers));
        assert!(file.skin.is_some());
        assert!(answer.compared.is_some_and(|compared| compared.rating.electrodes == 16));
        assert!(!answer.front.is_empty() && answer.front.len() <= answer.rated && answer.rated <= answer.tried);
    }

    #[test]
    fn what_is_impossible_is_named_with_the_best_there_is() {
        let answer = answered(Wishes { two_points_m: 0.2e-3, electrodes: 6, ..wishes() });
        assert_eq!(answer.meeting, 0);
        let unmet = answer.impossible.iter().find(|unmet| unmet.wish == Wish::TwoPoints).unwrap();
        assert!(unmet.best > 0.2e-3 && !unmet.by.is_empty(), "{unmet:?}");
        assert!(
            !answer.choices[0].meets_all && answer.choices[0].reason.contains("two points"),
            "{}",
            answer.choices[0].reason
        );
    }
}
