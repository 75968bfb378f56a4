//! Answers as they came, against a scene.

use std::time::Instant;

use tactomo_physics::detector::Detector;
use tactomo_physics::scene::Scene;
use tactomo_study::judge::{Judged, WRONG_SHARE, wrong_m};
use tactomo_study::score::quantiles;
use tactomo_touch::solve::{Alternative, Solution};

/// Conductance of a contact that has to be found, in sheet conductances: `lab/examples/floor.rs` has lighter ones found in most frames, not in all.
const PLAIN: f64 = 0.03;
/// How far a touch moves at most from an answer to the next, in mean distances of electrodes: 3 mm of 15.
const MOVED: f64 = 0.2;
/// Share of the run at its end that late errors are of.
const LATE: f64 = 1.0 / 3.0;

/// An answer as it came.
pub struct Answer {
    /// Time of its frame, by the board's clock (s).
    pub time_s: f64,
    /// When it was ready.
    pub came: Instant,
    pub solution: Solution,
}

/// Answers against the truth.
#[derive(Clone, Debug, Default, serde::Serialize)]
pub struct Scored {
    /// Answers.
    pub answers: usize,
    /// Share of the time in which what was shown was right: as many contacts as there are, none too far off (`judge::WRONG_SHARE`), or the right shape.
    pub right: f64,
    /// Share of the time in which it was right, or the number of contacts there are was named as one that it may be.
    pub named: f64,
    /// Time from the first frame to the first right answer to a touch (s); `None` if there was none.
    pub first_right_s: Option<f64>,
    /// Error of places, however far, median and 95 % (m).
    pub error_m: Option<f64>,
    pub error_p95_m: Option<f64>,
    /// Median in the last third of the run (m).
    pub late_error_m: Option<f64>,
    /// Share of the answers with a contact that is not there.
    pub invented: f64,
    /// Share of the answers that say of themselves that they are doubtful.
    pub doubtful: f64,
    /// Times that a touch's contact changed its number.
    pub id_changes: usize,
    /// Longest time without an answer (s).
    pub gap_s: f64,
}

/// Scores the answers to one scene.
pub struct Scorer {
    scene: Scene,
    plain_s: f64,
    wrong_m: f64,
}

/// What an answer is worth.
struct Worth {
    is_touched: bool,
    is_right: bool,
    is_named: bool,
    has_invented: bool,
    errors_m: Vec<f64>,
    /// Places of touches (m), and the numbers of their contacts.
    ids: Vec<([f64; 2], u32)>,
}

impl Scorer {
    /// For a scene on a detector.
    pub fn new(detector: &Detector, scene: Scene) -> Self {
        Self { scene, plain_s: PLAIN * detector.sheet_conductance_s(), wrong_m: wrong_m(detector) }
    }

    /// Scores all answers of a run whose scene began at this board time (s).
    pub fn of(&self, answers: &[Answer], began_s: f64) -> Scored {
        let [Some(first), Some(last)] = [answers.first(), answers.last()] else { return Scored::default() };
        let worth: Vec<_> =
            answers.iter().map(|answer| self.worth(answer.time_s - began_s, &answer.solution)).collect();
        let since = |answer: &Answer| answer.came.duration_since(first.came).as_secs_f64();
        let shown_s: Vec<f64> = answers.windows(2).map(|pair| since(&pair[1]) - since(&pair[0])).collect();
        let late_from = answers.partition_point(|answer| since(answer) < (1.0 - LATE) * since(last));
        let share = |count: usize| count as f64 / answers.len() as f64;
        let errors = |worth: &[Worth]| quantiles(worth.iter().flat_map(|of| &of.errors_m).copied(), [0.5, 0.95]);
        let [error_m, error_p95_m] = errors(&worth).map_or([None; 2], |of| of.map(Some));
        let shown_in_all_s = shown_s.iter().sum::<f64>().max(f64::MIN_POSITIVE);
        let share_of = |is: fn(&Worth) -> bool| {
            let of_it = worth.iter().zip(&shown_s).filter(|(of, _)| is(of));
            of_it.fold(0.0, |sum, (_, shown_s)| sum + shown_s) / shown_in_all_s
        };
        let first_right = worth.iter().position(|of| of.is_touched && of.is_right);
        Scored {
            answers: answers.len(),
            right: share_of(|of| of.is_right),
            named: share_of(|of| of.is_right || of.is_named),
            first_right_s: first_right.map(|index| since(&answers[index]) + first.time_s - began_s),
            error_m,
            error_p95_m,
            late_error_m: errors(&worth[late_from..]).map(|[median_m, _]| median_m),
            invented: share(worth.iter().filter(|of| of.has_invented).count()),
            doubtful: share(answers.iter().filter(|answer| answer.solution.flags.is_doubtful()).count()),
            id_changes: worth.windows(2).map(|pair| self.id_changes(&pair[0], &pair[1])).sum(),
            gap_s: shown_s.iter().copied().fold(0.0, f64::max),
        }
    }

    fn worth(&self, time_s: f64, solution: &Solution) -> Worth {
        let touches = self.scene.at(time_s);
        let is_plain = |conductance_s: f64| conductance_s > self.plain_s;
        let judged = Judged::of(self.wrong_m, &touches, solution);
        let Judged { found, truth, near, is_kind_right } = &judged;
        let ids = near.pairs.iter().filter_map(|pair| {
            let touch = &truth[pair.truth];
            Some(([touch.x_m, touch.y_m], found[pair.found].id?))
        });
        let plain = truth.iter().filter(|disc| is_plain(disc.conductance_s)).count();
        let is_count = |other: &Alternative| (plain..=truth.len()).contains(&other.contacts);
        let are_discs = touches.iter().all(|touch| touch.disc().is_some());
        Worth {
            is_touched: touches.iter().any(|touch| is_plain(touch.conductance_s)),
            is_named: are_discs && *is_kind_right && solution.alternative.as_ref().is_some_and(is_count),
            is_right: judged.is_right(|disc| is_plain(disc.conductance_s)),
            has_invented: !near.invented.is_empty() || are_discs && solution.shape.is_some(),
            errors_m: judged.pairs().pairs.iter().map(|pair| pair.distance_m).collect(),
            ids: ids.collect(),
        }
    }

    fn id_changes(&self, before: &Worth, after: &Worth) -> usize {
        let is_other = |(at_m, id): &&([f64; 2], u32)| {
            let apart_m = |other_m: &[f64; 2]| (at_m[0] - other_m[0]).hypot(at_m[1] - other_m[1]);
            let nearest = before.ids.iter().min_by(|a, b| apart_m(&a.0).total_cmp(&apart_m(&b.0)));
            nearest.is_some_and(|(other_m, other)| apart_m(other_m) < MOVED / WRONG_SHARE * self.wrong_m && other != id)
        };
        after.ids.iter().filter(is_other).count()
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;
    use tactomo_physics::scene::{Hand, SceneName};
    use tactomo_touch::solve::{FoundContact, FoundRing, FoundShape};

    const FRAME_S: f64 = 0.01;

    fn scorer(name: SceneName) -> (Scorer, Scene) {
        let detector = Detector::default();
        let scene = Scene::new(name, &detector, Hand::relative(&detector), 1);
        (Scorer::new(&detector, scene.clone()), scene)
    }

    /// The score of answers to the frames from one on, the first of a second after the board's start.
    fn scored(scorer: &Scorer, first: u64, solutions: Vec<Solution>) -> Scored {
        let begun = Instant::now();
        let answer = |(index, solution): (usize, Solution)| {
            let sequence = first + index as u64;
            let time_s = sequence as f64 * FRAME_S;
            Answer { time_s: 1.0 + time_s, came: begun + Duration::from_secs_f64(time_s), solution }
        };
        scorer.of(&solutions.into_iter().enumerate().map(answer).collect::<Vec<_>>(), 1.0)
    }

    fn contacts(all: Vec<FoundContact>) -> Solution {
        Solution { contacts: all, ..Solution::default() }
    }

    #[test]
    fn time_counts_in_which_all_contacts_are_within_reach_and_none_is_invented() {
        let (scorer, scene) = scorer(SceneName::Single);
        let truth = scene.at(0.0)[0].disc().unwrap();
        let at =
            |off_m: f64, id| FoundContact { id: Some(id), ..FoundContact::flat(truth.x_m + off_m, truth.y_m, 1e-4) };
        let other = FoundContact::flat(-truth.x_m, -truth.y_m, 1e-4);
        let found = scored(
            &scorer,
            5,
            [
                contacts(Vec::new()),
                contacts(vec![at(0.001, 1)]),
                contacts(vec![at(0.002, 2)]),
                contacts(vec![at(0.001, 2), other]),
            ]
            .into_iter()
            .chain([contacts(Vec::new())])
            .collect(),
        );
        assert!((found.right - 0.5).abs() < 1e-9, "{found:?}");
        assert!(found.first_right_s.is_some_and(|first_s| (first_s - 6.0 * FRAME_S).abs() < 1e-9), "{found:?}");
        assert_eq!((found.answers, found.id_changes, found.invented), (5, 1, 0.2));
        assert!(found.error_m.is_some_and(|error_m| (error_m - 0.001).abs() < 1e-9), "{found:?}");
        assert!((found.gap_s - FRAME_S).abs() < 1e-9);
    }

    #[test]
    fn a_number_that_may_be_the_right_one_is_named_if_it_is_that() {
        let (scorer, scene) = scorer(SceneName::FiveFingers);
        let discs = scene.at(0.0).into_iter().filter_map(|touch| touch.disc());
        let four: Vec<_> = discs.skip(1).map(|disc| FoundContact::flat(disc.x_m, disc.y_m, 1e-4)).collect();
        let or = |other: usize| {
            let alternative = Some(Alternative { contacts: other, certainty: 0.4 });
            Solution { alternative, ..contacts(four.clone()) }
        };
        let found = scored(&scorer, 0, vec![or(5), or(3), contacts(four.clone()), contacts(four.clone()), or(5)]);
        assert_eq!((found.right, found.named), (0.0, 0.25), "{found:?}");
    }

    #[test]
    fn a_ring_is_right_as_a_ring_alone() {
        let (scorer, _) = scorer(SceneName::Ring);
        let ring = || Solution { shape: Some(FoundShape::Ring(FoundRing::default())), ..Solution::default() };
        let found = scored(&scorer, 0, vec![ring(), ring(), contacts(Vec::new()), ring()]);
        assert!((found.right - 2.0 / 3.0).abs() < 1e-9 && found.invented == 0.0, "{found:?}");
        let one = contacts(vec![FoundContact::flat(0.0, 0.0, 1e-4)]);
        assert_eq!(scored(&scorer, 0, vec![one.clone(), one]).right, 0.0);
    }
}
