//! What is answered: the few best with reasons, what is impossible, and which wish to relax.

use std::sync::atomic::AtomicBool;
use std::time::Instant;

use tactomo_physics::detector::Detector;
use tactomo_physics::scene::Contact;

use super::super::reached::{as_built, by_auto};
use super::super::{DesignError, Press, Progress, Reached};
use super::find::{Found, find, front};
use super::rating::hertz;
use super::{Material, Rating, Space, Wish, Wishes};

/// Detectors that are drawn from the tolerances of each choice.
const DRAWN: u64 = 2;
/// Presses that choices are tried with: shares of the sides from the middle.
const TRIED: [[f64; 2]; 4] = [[0.03, -0.07], [-0.28, 0.17], [0.21, 0.31], [0.36, -0.33]];

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
    /// What `auto` makes of four presses, one frame each, on the detector as described.
    pub reached: Reached,
    /// What a fit misses of the same presses on detectors as built, drawn from the tolerances, if the description is taken as exact.
    pub as_built: Reached,
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
    /// The best there is: of all candidates if it is impossible, else of those that meet all other wishes.
    pub best: f64,
    /// By which candidate.
    pub by: String,
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
    /// How many of the candidates that were tried meet the wishes better.
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
    /// How many of those meet all wishes.
    pub meeting: usize,
    /// The few best, the best first.
    pub choices: Vec<Choice>,
    /// Wishes that no candidate meets, even alone.
    pub impossible: Vec<Unmet>,
    /// If no candidate meets all: wishes of which one is to be relaxed, and how far.
    pub relax: Vec<Unmet>,
    /// Those that no other beats: what each gives.
    pub front: Vec<Rating>,
    /// All that were tried.
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
    let in_full: Vec<&Found> = found.iter().filter(|found| found.is_in_full).collect();
    let picked = picked(&in_full, wishes);
    // Also after a search that was stopped: without choices there is no answer.
    let never = AtomicBool::new(false);
    let choices = Progress::new(&never, progress.say)
        .map("choices as built", &picked, |(found, reason)| choice(found, reason, plan));
    let compared = plan.compared.as_ref().map(|detector| compared(detector, &found, wishes)).transpose()?;
    let meeting = found.iter().filter(|found| found.rating.meets(wishes, None)).count();
    let is_met = in_full.iter().any(|found| found.rating.meets(wishes, None));
    Ok(Answer {
        candidates: space.count(),
        tried: found.len(),
        meeting,
        choices: choices.into_iter().flatten().collect::<Result<_, _>>()?,
        impossible: unmet(&found, wishes, |_, _| true),
        relax: if is_met { Vec::new() } else { unmet(&found, wishes, |rating, wish| rating.meets(wishes, Some(wish))) },
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
fn picked<'a>(found: &[&'a Found], wishes: &Wishes) -> Vec<(&'a Found, String)> {
    let Some(best) = found.iter().max_by(|a, b| a.rating.score(wishes).total_cmp(&b.rating.score(wishes))) else {
        return Vec::new();
    };
    let meeting: Vec<&Found> = found.iter().copied().filter(|found| found.rating.meets(wishes, None)).collect();
    let pool = if meeting.is_empty() { found.to_vec() } else { meeting };
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
            Some(given) => format!("{} is {}, not {}", wish.name(), wish.text(given), wish.text(wishes.wanted(wish))),
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
    let middle_n = (wishes.smallest_n * wishes.largest_n).sqrt();
    let contacts: Vec<Contact> =
        TRIED.iter().map(|shares| press.at([0, 1].map(|axis| shares[axis] * wishes.size_m[axis]), middle_n)).collect();
    Ok(Choice {
        name: found.detector.name.clone(),
        reason: reason.to_owned(),
        rating: found.rating,
        meets_all: found.rating.meets(wishes, None),
        reached: by_auto(&found.detector, &contacts, plan.seed)?,
        as_built: as_built(&found.detector, &contacts, plan.seed, DRAWN)?,
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

fn compared(detector: &Detector, found: &[Found], wishes: &Wishes) -> Result<Compared, DesignError> {
    let rating = Rating::as_driven(detector, wishes)?;
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
        let answer = answered(Wishes { two_points_m: 18e-3, electrodes: 9, ..wishes() });
        assert!(answer.meeting > 0 && answer.impossible.is_empty() && answer.relax.is_empty(), "{answer:?}");
        let best = &answer.choices[0];
        assert!(best.meets_all && best.reason.contains("meets the wishes best"), "{}", best.reason);
        let file = Detector::from_toml(&answer.toml(0).unwrap(), "chosen").unwrap();
        assert_eq!(file.electrodes.len(), best.rating.electrodes);
        assert_eq!((file.skin, &file.layers), (best.detector.skin, &best.detector.layers));
        assert!(file.skin.is_some());
        assert!(answer.compared.is_some_and(|compared| compared.rating.electrodes == 16));
        assert!(!answer.front.is_empty() && answer.front.len() <= answer.tried);
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
