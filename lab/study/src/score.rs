//! Scores of solutions, frame by frame, and their summary.

use std::time::Duration;

use super::experiment::{Experiment, Frame};
use super::judge::{Judged, wrong_m};
use super::stopwatch::timed;
pub use super::summary::{ChosenReport, Spread, Summary, Times, quantiles};
use tactomo_physics::forward::{ForwardError, ImageMesh};
use tactomo_physics::scene::Touch;
use tactomo_touch::metrics::{
    Comparison, Greit, ImageMetrics, Matching, PaperFigures, found_s_per_m2, shape_error_m, truth_s_per_m2,
};
use tactomo_touch::solve::{Flags, FoundContact, FoundShape, NonlinearSettings, Solution, Solver};

/// Images are smoothed by this share of the shorter side before they are compared: by 2 mm on 60 mm.
const SMOOTHING_SHARE: f64 = 1.0 / 30.0;
/// Radius of contacts without one, as discs beside a touch of another shape (mean distances of electrodes): 1.5 mm of 15.
const POINT_SHARE: f64 = 0.1;

/// What one frame's solution is worth. `None` where a figure is not defined.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Score {
    /// Time that the solver took.
    pub time: Duration,
    /// It refused the readings.
    pub failed: bool,
    /// Something of it was no finite number.
    pub not_finite: bool,
    /// Whether the answer is wrong, as [`Judged`] says of contacts: refused, not finite, of another kind than what touches, with a contact missed, invented or
    /// too far off; of touches that are no discs, an error as large or a [wrong image](Self::is_wrong_image).
    pub is_wrong: bool,
    /// Whether [it says itself](Judged::is_covered) how far off it is.
    pub is_covered: bool,
    /// Mean error with those missed and invented (m): [`Matching::ospa_m`]; of touches that are no discs [`shape_error_m`].
    pub error_m: Option<f64>,
    /// Mean distance of contacts found (m), however far.
    pub position_error_m: Option<f64>,
    /// Whether as many contacts were found as touch.
    pub is_number_right: Option<bool>,
    /// Contacts that nothing was found near to.
    pub missed: Option<usize>,
    /// Contacts found that nothing is near to.
    pub invented: Option<usize>,
    /// Mean relative error of the conductance of contacts found.
    pub conductance_error: Option<f64>,
    /// Image against truth.
    pub image: ImageMetrics,
    /// Figures of the paper, for one contact.
    pub paper: Option<PaperFigures>,
    /// Figures of GREIT, for one contact.
    pub greit: Option<Greit>,
    /// What the solver says of it.
    pub flags: Flags,
    /// The solver's own residual.
    pub residual: Option<f64>,
    /// What a solver that chooses took it for.
    pub chosen: Option<Chosen>,
}

/// What a solver that chooses took a frame for.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Chosen {
    /// The model: nothing, `2 contacts`, `line`, `ring`, `image`.
    pub what: String,
    /// How many unknowns that has.
    pub unknowns: usize,
}

/// Unknowns of a contact: place, conductance and radius.
pub(crate) const OF_CONTACT: usize = 4;
/// Of a line, two ends, width and conductance; and of a ring, middle, radius, width and conductance.
const OF_LINE: usize = 6;
const OF_RING: usize = 5;

impl Chosen {
    /// Of a solution, if its solver chooses.
    fn of(solution: &Solution) -> Option<Self> {
        let what = solution.choice.as_ref()?.what.clone();
        let unknowns = match &solution.shape {
            Some(FoundShape::Line(_)) => OF_LINE,
            Some(FoundShape::Ring(_)) => OF_RING,
            None if solution.is_contacts() => OF_CONTACT * solution.contacts.len(),
            None => NonlinearSettings::default().nodes,
        };
        Some(Self { what, unknowns })
    }
}

impl Score {
    /// Whether the image is wrong: refused, not finite, or explaining less than half of the truth's variance.
    pub fn is_wrong_image(&self) -> bool {
        let explained = self.image.correlation.map_or(0.0, |correlation| correlation.max(0.0).powi(2));
        self.failed || self.not_finite || explained < 0.5
    }
}

/// Scores solutions on one detector.
pub struct Scorer {
    /// What a contact missed or invented counts (m).
    reach_m: f64,
    wrong_m: f64,
    /// Where touches that are no discs are compared with what was found; `None` if images are.
    shapes: Option<ImageMesh>,
    images: Option<Images>,
}

/// What images are scored with.
struct Images {
    width_m: f64,
    mesh: ImageMesh,
    comparison: Comparison,
    smoothing_m: f64,
    /// The touches before, and their image.
    last: Option<(Vec<Touch>, Vec<f32>)>,
}

impl Scorer {
    /// For solutions of an experiment's problem.
    pub fn new(experiment: &Experiment) -> Self {
        Self { images: Some(Images::new(experiment)), ..Self::of(experiment) }
    }

    /// For errors alone: images are looked at where touches are no discs, which then have the [error](shape_error_m) of a shape.
    pub fn of_errors(experiment: &Experiment) -> Self {
        Self { shapes: Some(experiment.problem.jacobian.image_mesh.clone()), ..Self::of(experiment) }
    }

    fn of(experiment: &Experiment) -> Self {
        let (reach_m, wrong_m) = (experiment.reach_m(), wrong_m(&experiment.detector));
        Self { reach_m, wrong_m, shapes: None, images: None }
    }

    /// Lets a solver read frames one after the other, and scores what it found.
    ///
    /// # Errors
    /// [`ForwardError`] if the truth cannot be imaged.
    pub fn run(&mut self, solver: &mut dyn Solver, frames: &[Frame]) -> Result<Vec<Score>, ForwardError> {
        solver.reset();
        frames.iter().map(|frame| self.frame(solver, frame)).collect()
    }

    fn frame(&mut self, solver: &mut dyn Solver, frame: &Frame) -> Result<Score, ForwardError> {
        let (result, time) = timed(|| solver.solve(&frame.readings));
        match result {
            Ok(solution) => Ok(Score { time, ..self.score(frame, &solution)? }),
            Err(_) => Ok(Score { time, failed: true, is_wrong: true, ..Score::default() }),
        }
    }

    /// Scores a solution.
    ///
    /// # Errors
    /// [`ForwardError`] if the truth cannot be imaged.
    pub fn score(&mut self, frame: &Frame, solution: &Solution) -> Result<Score, ForwardError> {
        let mut score = Score {
            not_finite: !is_finite(solution),
            flags: solution.flags.clone(),
            residual: solution.residual,
            chosen: Chosen::of(solution),
            ..Score::default()
        };
        if let Some(images) = self.images.as_mut().filter(|_| !frame.touches.is_empty()) {
            images.score(frame, solution, &mut score)?;
        }
        score.is_wrong = if frame.contacts.is_some() {
            self.score_contacts(&frame.touches, solution, &mut score)
        } else if let Some(mesh) = &self.shapes {
            let [truth, found] =
                [truth_s_per_m2(mesh, &frame.touches)?, found_s_per_m2(mesh, solution, self.reach_m * POINT_SHARE)];
            score.error_m = shape_error_m(mesh, &truth, &found, self.reach_m);
            score.error_m.is_none_or(|error_m| error_m > self.wrong_m)
        } else {
            score.is_wrong_image()
        };
        score.is_wrong |= score.not_finite;
        Ok(score)
    }

    /// Scores an answer to discs, and tells whether it is wrong.
    fn score_contacts(&self, touches: &[Touch], solution: &Solution, score: &mut Score) -> bool {
        let judged = Judged::of(self.wrong_m, touches, solution);
        let Judged { found, truth, near, .. } = &judged;
        score.error_m = Some(Matching::within(self.reach_m, truth, found).ospa_m(self.reach_m));
        score.position_error_m = judged.pairs().position_error_m();
        score.is_number_right = Some(judged.is_number_right());
        score.missed = Some(near.missed.len());
        score.invented = Some(near.invented.len());
        score.conductance_error = near.conductance_error(truth, found);
        score.is_covered = judged.is_covered();
        !judged.is_right(|_| true)
    }
}

impl Images {
    /// Of an experiment's problem.
    fn new(experiment: &Experiment) -> Self {
        let mesh = experiment.problem.jacobian.image_mesh.clone();
        let [width_m, height_m] = experiment.detector.outline.size_m();
        let smoothing_m = SMOOTHING_SHARE * width_m.min(height_m);
        let comparison = Comparison::new(&mesh, smoothing_m);
        Self { width_m, mesh, comparison, smoothing_m, last: None }
    }

    fn score(&mut self, frame: &Frame, solution: &Solution, score: &mut Score) -> Result<(), ForwardError> {
        let image = found_s_per_m2(&self.mesh, solution, self.smoothing_m);
        self.see(&frame.touches)?;
        if let Some((_, truth)) = &self.last {
            score.image = self.comparison.of(truth, &image);
        }
        if let Some([contact]) = frame.contacts.as_deref() {
            score.paper = PaperFigures::of(&self.mesh, &image, contact, self.width_m);
            score.greit = Greit::of(&self.mesh, &image, contact);
        }
        Ok(())
    }

    /// Keeps the image of what touches.
    fn see(&mut self, touches: &[Touch]) -> Result<(), ForwardError> {
        if self.last.as_ref().is_none_or(|(last, _)| last != touches) {
            self.last = Some((touches.to_vec(), truth_s_per_m2(&self.mesh, touches)?));
        }
        Ok(())
    }
}

fn is_finite(solution: &Solution) -> bool {
    let of = |contact: &FoundContact| {
        [contact.x_m, contact.y_m, contact.z_m, contact.conductance_s].iter().all(|x| x.is_finite())
    };
    solution.contacts.iter().all(of)
        && solution.image_s_per_m2.iter().flatten().all(|value| value.is_finite())
        && solution.residual.is_none_or(f64::is_finite)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::SceneKind;
    use tactomo_physics::detector::Detector;
    use tactomo_physics::scene::Contact;
    use tactomo_touch::solve::FoundLine;

    fn experiment() -> Experiment {
        Experiment::new(&Detector::preset(Detector::DEFAULT).unwrap()).unwrap()
    }

    fn frame(experiment: &Experiment, kind: SceneKind) -> Frame {
        let touches = kind.frames(&experiment.detector, 1, 1);
        experiment.frames(&touches, 1).unwrap().remove(0)
    }

    #[test]
    fn two_discs_that_are_told_as_a_line_are_wrong_whatever_is_kept_beside_it() {
        let experiment = experiment();
        let frame = frame(&experiment, SceneKind::TwoNear);
        let truth = truth_of(&frame);
        let line = Solution { shape: Some(FoundShape::Line(FoundLine::default())), ..truth.clone() };
        for mut scorer in [Scorer::new(&experiment), Scorer::of_errors(&experiment)] {
            let [right, wrong] = [&truth, &line].map(|answer| scorer.score(&frame, answer).unwrap());
            assert_eq!((right.is_wrong, right.is_number_right), (false, Some(true)));
            assert_eq!((wrong.is_wrong, wrong.is_number_right, wrong.missed), (true, Some(false), Some(2)));
            assert_eq!(wrong.error_m, Some(experiment.reach_m()));
        }
    }

    fn truth_of(frame: &Frame) -> Solution {
        let found = |contact: &Contact| FoundContact::flat(contact.x_m, contact.y_m, contact.conductance_s);
        Solution { contacts: frame.contacts.iter().flatten().map(found).collect(), ..Solution::default() }
    }

    #[test]
    fn the_truth_scores_full_marks_and_nothing_scores_none() {
        let experiment = experiment();
        let mut scorer = Scorer::new(&experiment);
        let frame = frame(&experiment, SceneKind::Three);
        let best = scorer.score(&frame, &truth_of(&frame)).unwrap();
        assert_eq!((best.error_m, best.missed, best.invented, best.is_wrong), (Some(0.0), Some(0), Some(0), false));
        assert!(best.conductance_error.is_some_and(|error| error < 1e-12));
        assert!(best.image.correlation.is_some_and(|correlation| correlation > 0.95), "{:?}", best.image);
        let worst = scorer.score(&frame, &Solution::default()).unwrap();
        assert_eq!((worst.error_m, worst.missed, worst.is_wrong), (Some(experiment.reach_m()), Some(3), true));
        let summary = Summary::of([&best, &worst]);
        assert_eq!((summary.missed, summary.count_right), (Some(1.5), Some(0.5)));
    }

    #[test]
    fn nothing_found_where_nothing_is_has_no_error() {
        let experiment = experiment();
        let frame = frame(&experiment, SceneKind::None);
        let score = Scorer::new(&experiment).score(&frame, &Solution::default()).unwrap();
        assert_eq!((score.error_m, score.invented, score.image.correlation), (Some(0.0), Some(0), None));
    }

    #[test]
    fn touches_that_are_no_discs_have_an_error_too() {
        let experiment = experiment();
        let mut scorer = Scorer::of_errors(&experiment);
        let frame = frame(&experiment, SceneKind::Line);
        let truth = truth_s_per_m2(&experiment.problem.jacobian.image_mesh, &frame.touches).unwrap();
        let right = Solution { image_s_per_m2: Some(truth), ..Solution::default() };
        let score = scorer.score(&frame, &right).unwrap();
        assert_eq!((score.error_m, score.is_wrong), (Some(0.0), false));
        let [x_m, y_m] = frame.touches[0].centre_m;
        let middle = Solution { contacts: vec![FoundContact::flat(x_m, y_m, 1e-3)], ..Solution::default() };
        let error_m = scorer.score(&frame, &middle).unwrap().error_m.unwrap();
        assert!(error_m > 0.002 && error_m < experiment.reach_m(), "{error_m}");
        let nothing = scorer.score(&frame, &Solution::default()).unwrap();
        assert_eq!((nothing.error_m, nothing.missed, nothing.is_wrong), (Some(experiment.reach_m()), None, true));
    }

    #[test]
    fn what_is_no_number_is_seen() {
        let experiment = experiment();
        let frame = frame(&experiment, SceneKind::Firm);
        let solution = Solution { contacts: vec![FoundContact::flat(f64::NAN, 0.0, 1e-3)], ..Solution::default() };
        assert!(Scorer::new(&experiment).score(&frame, &solution).unwrap().not_finite);
    }
}
