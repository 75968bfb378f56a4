//! What each threshold that decides between answers is worth: the same readings, solved with it larger and smaller than it is.

use std::time::{Duration, Instant};

use tactomo_physics::detector::Detector;
use tactomo_physics::readings::Readings;
use tactomo_physics::scene::{Hand, Scene, SceneName};
use tactomo_study::bank::{self, Case, Scenes, Trial};
use tactomo_study::stopwatch::timed;
use tactomo_study::{Experiment, StudyError};
use tactomo_touch::solve::{Method, Problem, Threshold, thresholds};

use crate::live::{Answer, Scorer};

/// Time between two frames of a scene that is followed (s): as a board of 16 electrodes gives them.
const PERIOD_S: f64 = 0.004;

/// What is tried.
#[derive(Clone, Debug)]
pub struct Plan {
    /// The thresholds that are changed, one at a time.
    pub thresholds: Vec<&'static Threshold>,
    /// Factors on each.
    pub factors: Vec<f64>,
    /// Random scenes that are found cold.
    pub scenes: usize,
    /// Frames of each scene that is followed.
    pub frames: usize,
    /// Seed of scenes and noise, and of the detector as built.
    pub seed: u64,
}

/// A threshold that was made larger or smaller, against what it is.
#[derive(Clone, Debug, Default, serde::Serialize)]
pub struct Change {
    /// Its name and value.
    pub threshold: &'static str,
    pub value: &'static str,
    /// How often it was read.
    pub reads: u64,
    /// The factor; none of what is never read.
    pub factor: Option<f64>,
    /// What it changed.
    #[serde(flatten)]
    pub found: Option<Figures>,
    /// Share of the answers that are others.
    pub others: f64,
}

/// Figures of one run; the first of two is of a detector that is known exactly, the second of one as built of which the description is known.
#[derive(Clone, Debug, Default, serde::Serialize)]
pub struct Figures {
    /// Share of random scenes with all visible contacts found and none invented, cold.
    pub cold: [f64; 2],
    /// Error of their contacts over its bound, 90 % below.
    pub over_bound: [f64; 2],
    /// Mean over all scenes of the share of time in which they are right, followed from a press in the first frame.
    pub followed: [f64; 2],
    /// Mean of the median errors of places, followed (m).
    pub error_m: [f64; 2],
    /// Time for all answers (s).
    pub time_s: f64,
    /// Scenes that were followed: name, which of the two detectors, and the share of time in which it is right.
    pub scenes: Vec<(String, usize, f64)>,
    /// Places, for a comparison.
    #[serde(skip)]
    answers: Vec<Vec<f64>>,
}

/// A scene's readings.
struct Recording {
    name: SceneName,
    scene: Scene,
    detector: Detector,
    problem: Problem,
    frames: Vec<Readings>,
    /// 0 if the detector is known exactly.
    which: usize,
}

/// Tries all changes. `progress` is called with what is done next.
///
/// # Errors
/// [`StudyError`] if a solver refuses readings.
pub fn run(plan: &Plan, progress: &mut dyn FnMut(&str)) -> Result<(Figures, Vec<Change>), StudyError> {
    progress("recording scenes");
    let recordings = recordings(plan)?;
    let tried = |plan: &Plan| figures(plan, &recordings);
    thresholds().iter().for_each(|one| _ = one.take_reads());
    let usual = tried(plan)?;
    let mut changes = Vec::new();
    let reads: Vec<_> = plan.thresholds.iter().map(|one| one.take_reads()).collect();
    for (index, (threshold, reads)) in plan.thresholds.iter().zip(reads).enumerate() {
        let unread = Change { threshold: threshold.name, value: threshold.value, reads, ..Change::default() };
        if reads == 0 {
            changes.push(unread);
            continue;
        }
        for factor in &plan.factors {
            progress(&format!("{} of {}: {} x {factor}", index + 1, plan.thresholds.len(), threshold.name));
            threshold.scale(*factor);
            let found = tried(plan);
            threshold.scale(1.0);
            let found = found?;
            let others = found.answers.iter().zip(&usual.answers).filter(|(one, other)| one != other).count();
            let others = others as f64 / usual.answers.len() as f64;
            changes.push(Change { factor: Some(*factor), found: Some(found), others, ..unread });
        }
    }
    Ok((usual, changes))
}

fn recordings(plan: &Plan) -> Result<Vec<Recording>, StudyError> {
    let (mut all, seed) = (Vec::new(), plan.seed);
    for name in SceneName::ALL.into_iter().filter(|name| *name != SceneName::Rest) {
        let detector = name.detector().and_then(Detector::preset).unwrap_or_default();
        if detector.surface.is_some() {
            continue;
        }
        let scene = Scene::new(name, &detector, Hand::relative(&detector), seed);
        let touches: Vec<_> = (0..plan.frames).map(|index| scene.at(index as f64 * PERIOD_S)).collect();
        for (which, as_built) in [None, Some(seed)].into_iter().enumerate() {
            let experiment = Experiment::of(&detector, as_built)?;
            let frames = experiment.frames(&touches, seed)?.into_iter().map(|frame| frame.readings).collect();
            all.push(Recording {
                name,
                scene: scene.clone(),
                detector: detector.clone(),
                problem: experiment.problem,
                frames,
                which,
            });
        }
    }
    Ok(all)
}

fn figures(plan: &Plan, recordings: &[Recording]) -> Result<Figures, StudyError> {
    let mut found = Figures::default();
    for (which, as_built) in [None, Some(plan.seed)].into_iter().enumerate() {
        let case = Case::of("", Scenes::Random, vec![Detector::default()]);
        let plan = bank::Plan {
            cases: vec![Case { built: as_built.into_iter().collect(), ..case }],
            methods: vec![Method::Auto],
            scenes: plan.scenes,
            frames: 1,
            threads: 1,
            worst: plan.scenes,
            seed: plan.seed,
        };
        let report = bank::run(&plan, "", &mut |_| ())?;
        if let Some(all) = report.rows.iter().find(|row| row.class == "all") {
            found.cold[which] = all.scenes.as_ref().map_or(0.0, |scenes| scenes.all_found);
            found.over_bound[which] = all.contacts.over_bound.map_or(f64::NAN, |over| over.high);
        }
        let mut trials = report.worst;
        trials.sort_by_key(|trial| trial.scene);
        found.time_s += 1e-6 * trials.iter().map(|trial| trial.cold_us).sum::<f64>();
        let places = |trial: &Trial| trial.judged.found.iter().flat_map(|one| [one.x_m, one.y_m]).collect();
        found.answers.extend(trials.iter().map(places));
    }
    for recording in recordings {
        recording.follow(recordings.len() as f64 / 2.0, &mut found)?;
    }
    Ok(found)
}

impl Recording {
    /// Adds what following this scene gives, as one of so many.
    fn follow(&self, of: f64, found: &mut Figures) -> Result<(), StudyError> {
        let refused = |error| StudyError::Solve { solver: Method::Auto.name().to_owned(), error };
        let mut solver = Method::Auto.build(&self.problem)?;
        let began = Instant::now();
        let mut answers = Vec::with_capacity(self.frames.len());
        for (index, readings) in self.frames.iter().enumerate() {
            let (solution, time) = timed(|| solver.solve(readings));
            let solution = solution.map_err(refused)?;
            found.time_s += time.as_secs_f64();
            found.answers.push(solution.contacts.iter().flat_map(|one| [one.x_m, one.y_m]).collect());
            let time_s = index as f64 * PERIOD_S;
            answers.push(Answer { time_s, came: began + Duration::from_secs_f64(time_s), solution });
        }
        let scored = Scorer::new(&self.detector, self.scene.clone()).of(&answers, 0.0);
        found.scenes.push((self.name.to_string(), self.which, scored.right));
        found.followed[self.which] += scored.right / of;
        found.error_m[self.which] += scored.error_m.unwrap_or_default() / of;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_threshold_is_read_and_changes_answers_until_it_is_what_it_was() {
        let chosen = ["fewer_nats", "healed_share"];
        let chosen = thresholds().iter().copied().filter(|one| chosen.contains(&one.name)).collect();
        let plan = Plan { thresholds: chosen, factors: vec![1.0, 30.0], scenes: 10, frames: 5, seed: 1 };
        let (usual, changes) = run(&plan, &mut |_| ()).unwrap();
        let right = |found: &Figures| found.cold.iter().chain(&found.followed).sum::<f64>();
        assert!(usual.cold[0] > 0.8 && usual.cold[0] >= usual.cold[1] && usual.followed[0] > 0.3);
        let [same, other, unread] = &changes[..] else { panic!("{} changes", changes.len()) };
        assert!(same.reads > 0 && same.others == 0.0 && other.others > 0.0, "{} and {}", same.others, other.others);
        assert!(other.found.as_ref().is_some_and(|found| right(found) < right(&usual)));
        assert!(unread.reads == 0 && unread.found.is_none());
    }
}
