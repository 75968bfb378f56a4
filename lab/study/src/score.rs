//! Scores of solutions, frame by frame, and their summary.

use std::time::Duration;

use super::experiment::{Experiment, Frame};
use super::stopwatch::timed;
use tactomo_physics::forward::{ForwardError, ImageMesh};
use tactomo_physics::scene::{Contact, Touch};
use tactomo_touch::metrics::{Comparison, Greit, ImageMetrics, Matching, PaperFigures, found_s_per_m2, truth_s_per_m2};
use tactomo_touch::solve::{Flags, FoundContact, Solution, Solver};

/// Images are smoothed by this share of the shorter side before they are compared: by 2 mm on 60 mm.
const SMOOTHING_SHARE: f64 = 1.0 / 30.0;

/// What one frame's solution is worth. `None` where a figure is not defined.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Score {
    /// Time that the solver took.
    pub time: Duration,
    /// It refused the readings.
    pub failed: bool,
    /// Something of it was no finite number.
    pub not_finite: bool,
    /// Number of contacts found.
    pub found: usize,
    /// Mean error with those missed and invented (m): [`Matching::ospa_m`].
    pub error_m: Option<f64>,
    /// Mean distance of contacts found (m), however far.
    pub position_error_m: Option<f64>,
    /// Contacts not found within reach.
    pub missed: Option<usize>,
    /// Contacts found that are not there.
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
}

impl Score {
    /// Whether the answer is wrong, whatever its error is: refused, not finite, or with a contact missed or invented.
    pub fn is_wrong(&self) -> bool {
        let miscounted = self.missed.unwrap_or(0) + self.invented.unwrap_or(0) > 0;
        self.failed || self.not_finite || miscounted
    }

    /// Whether the image is wrong: refused, not finite, or explaining less than half of the truth's variance.
    pub fn is_wrong_image(&self) -> bool {
        let explained = self.image.correlation.map_or(0.0, |correlation| correlation.max(0.0).powi(2));
        self.failed || self.not_finite || explained < 0.5
    }
}

/// Scores solutions on one detector.
pub struct Scorer {
    reach_m: f64,
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
        Self { images: Some(Images::new(experiment)), ..Self::of_contacts(experiment.reach_m()) }
    }

    /// For contacts alone: images are not looked at. What is further from the truth than `reach_m` counts as missed and invented.
    pub fn of_contacts(reach_m: f64) -> Self {
        Self { reach_m, images: None }
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
            Err(_) => Ok(Score { time, failed: true, ..Score::default() }),
        }
    }

    /// Scores a solution.
    ///
    /// # Errors
    /// [`ForwardError`] if the truth cannot be imaged.
    pub fn score(&mut self, frame: &Frame, solution: &Solution) -> Result<Score, ForwardError> {
        let mut score = Score {
            found: solution.contacts.len(),
            not_finite: !is_finite(solution),
            flags: solution.flags.clone(),
            residual: solution.residual,
            ..Score::default()
        };
        if let Some(truth) = &frame.contacts {
            self.score_contacts(truth, &solution.contacts, &mut score);
        }
        if let Some(images) = self.images.as_mut().filter(|_| !frame.touches.is_empty()) {
            images.score(frame, solution, &mut score)?;
        }
        Ok(score)
    }

    fn score_contacts(&self, truth: &[Contact], found: &[FoundContact], score: &mut Score) {
        let matching = Matching::within(self.reach_m, truth, found);
        score.error_m = Some(matching.ospa_m(self.reach_m));
        score.missed = Some(matching.missed.len());
        score.invented = Some(matching.invented.len());
        score.conductance_error = matching.conductance_error(truth, found);
        score.position_error_m = Matching::within(f64::INFINITY, truth, found).position_error_m();
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

/// Means over frames. `None` where a figure is not defined in any.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize)]
pub struct Summary {
    /// How many frames.
    pub frames: usize,
    /// Time a frame (us).
    pub time_us: Times,
    /// Share of frames that the solver refused.
    pub failed: f64,
    /// Share of frames with something that is no finite number.
    pub not_finite: f64,
    /// Mean error with contacts missed and invented (m).
    pub error_m: Option<f64>,
    /// How that error is spread over frames (m).
    pub error_spread_m: Option<Spread>,
    /// Share of frames whose answer [is wrong](Score::is_wrong).
    pub wrong: f64,
    /// Mean distance of contacts found (m).
    pub position_error_m: Option<f64>,
    /// Share of frames with no contact missed and none invented.
    pub count_right: Option<f64>,
    /// Contacts missed, a frame.
    pub missed: Option<f64>,
    /// Contacts invented, a frame.
    pub invented: Option<f64>,
    /// Relative error of conductance: the median, as what is pressed hard may conduct anything.
    pub conductance_error: Option<f64>,
    /// Correlation of the image with the truth, zero where there is no image to correlate.
    pub correlation: Option<f64>,
    /// How that is spread over frames.
    pub correlation_spread: Option<Spread>,
    /// Share of frames whose image [is wrong](Score::is_wrong_image), where something touches.
    pub wrong_image: Option<f64>,
    /// Dice's coefficient.
    pub dice: Option<f64>,
    /// Jaccard's index.
    pub iou: Option<f64>,
    /// The paper's spatial resolution SR.
    pub spatial_resolution: Option<f64>,
    /// The paper's position accuracy PA.
    pub position_accuracy: Option<f64>,
    /// GREIT's amplitude response.
    pub amplitude_response: Option<f64>,
    /// GREIT's position error (m), above zero where pulled to the middle.
    pub greit_position_error_m: Option<f64>,
    /// GREIT's resolution.
    pub resolution: Option<f64>,
    /// GREIT's shape deformation.
    pub shape_deformation: Option<f64>,
    /// GREIT's ringing.
    pub ringing: Option<f64>,
    /// Share of frames flagged as not fitting the model.
    pub misfit: f64,
    /// Share of frames flagged as saturated.
    pub saturated: f64,
    /// Share of frames flagged as unfinished.
    pub unfinished: f64,
    /// Share of frames solved without some electrodes.
    pub excluded: f64,
}

/// How a figure is spread over frames.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize)]
pub struct Spread {
    /// A tenth of the frames is below.
    pub p10: f64,
    /// Half of them.
    pub median: f64,
    /// Nine tenths.
    pub p90: f64,
}

/// Times (us).
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize)]
pub struct Times {
    /// A tenth of the frames take less.
    pub p10: f64,
    /// Half of the frames take less.
    pub median: f64,
    /// Nine tenths of the frames take less.
    pub p90: f64,
    /// Of a hundred frames, one takes longer.
    pub p99: f64,
    /// The longest.
    pub max: f64,
}

impl Summary {
    /// Of all scores.
    pub fn of<'a>(scores: impl IntoIterator<Item = &'a Score>) -> Self {
        let scores: Vec<_> = scores.into_iter().collect();
        let share = |is: &dyn Fn(&Score) -> bool| {
            scores.iter().filter(|score| is(score)).count() as f64 / scores.len().max(1) as f64
        };
        let mean = |of: &dyn Fn(&Score) -> Option<f64>| mean(scores.iter().filter_map(|score| of(score)));
        // A solver that shows nothing where something touches is as wrong as one that shows anything.
        let touched = scores.iter().any(|score| score.image.correlation.is_some());
        let correlation = |score: &Score| touched.then(|| score.image.correlation.unwrap_or(0.0));
        Self {
            frames: scores.len(),
            time_us: Times::of(scores.iter().map(|score| score.time)),
            failed: share(&|score| score.failed),
            not_finite: share(&|score| score.not_finite),
            error_m: mean(&|score| score.error_m),
            error_spread_m: Spread::of(scores.iter().filter_map(|score| score.error_m)),
            wrong: share(&|score| score.is_wrong()),
            position_error_m: mean(&|score| score.position_error_m),
            count_right: mean(&|score| Some(f64::from(u8::from(score.missed? + score.invented? == 0)))),
            missed: mean(&|score| score.missed.map(|count| count as f64)),
            invented: mean(&|score| score.invented.map(|count| count as f64)),
            conductance_error: median(scores.iter().filter_map(|score| score.conductance_error)),
            correlation: mean(&correlation),
            correlation_spread: Spread::of(scores.iter().filter_map(|score| correlation(score))),
            wrong_image: touched.then(|| share(&|score| score.is_wrong_image())),
            dice: mean(&|score| score.image.dice),
            iou: mean(&|score| score.image.iou),
            spatial_resolution: mean(&|score| Some(score.paper?.spatial_resolution)),
            position_accuracy: mean(&|score| Some(score.paper?.position_accuracy)),
            amplitude_response: mean(&|score| Some(score.greit?.amplitude_response)),
            greit_position_error_m: mean(&|score| Some(score.greit?.position_error_m)),
            resolution: mean(&|score| Some(score.greit?.resolution)),
            shape_deformation: mean(&|score| Some(score.greit?.shape_deformation)),
            ringing: mean(&|score| Some(score.greit?.ringing)),
            misfit: share(&|score| score.flags.misfit),
            saturated: share(&|score| score.flags.saturated),
            unfinished: share(&|score| score.flags.unfinished),
            excluded: share(&|score| !score.flags.excluded.is_empty()),
        }
    }
}

impl Spread {
    /// Of some figures; `None` without one.
    pub fn of(figures: impl Iterator<Item = f64>) -> Option<Self> {
        quantiles(figures, [0.1, 0.5, 0.9]).map(|[p10, median, p90]| Self { p10, median, p90 })
    }

    /// The same of a function that rises.
    #[must_use]
    pub fn map(self, rising: impl Fn(f64) -> f64) -> Self {
        Self { p10: rising(self.p10), median: rising(self.median), p90: rising(self.p90) }
    }

    /// The same of a function that falls.
    #[must_use]
    pub fn turned(self, falling: impl Fn(f64) -> f64) -> Self {
        Self { p10: self.p90, median: self.median, p90: self.p10 }.map(falling)
    }
}

impl Times {
    /// How they are spread.
    pub fn spread(self) -> Spread {
        Spread { p10: self.p10, median: self.median, p90: self.p90 }
    }

    fn of(times: impl Iterator<Item = Duration>) -> Self {
        let us = times.map(|time| time.as_secs_f64() * 1e6);
        let [p10, median, p90, p99, max] = quantiles(us, [0.1, 0.5, 0.9, 0.99, 1.0]).unwrap_or_default();
        Self { p10, median, p90, p99, max }
    }
}

fn mean(values: impl Iterator<Item = f64>) -> Option<f64> {
    let (sum, count) = values.fold((0.0, 0), |(sum, count), value| (sum + value, count + 1));
    (count > 0).then(|| sum / f64::from(count))
}

fn median(values: impl Iterator<Item = f64>) -> Option<f64> {
    quantiles(values, [0.5]).map(|[median]| median)
}

/// The values below which such shares of all of them lie; `None` without a value.
pub fn quantiles<const N: usize>(values: impl Iterator<Item = f64>, shares: [f64; N]) -> Option<[f64; N]> {
    let mut values: Vec<_> = values.collect();
    values.sort_by(f64::total_cmp);
    let last = values.len().checked_sub(1)?;
    Some(shares.map(|share| values[(share * last as f64).round() as usize]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::SceneKind;
    use tactomo_physics::detector::Detector;

    fn experiment() -> Experiment {
        Experiment::new(&Detector::preset(Detector::DEFAULT).unwrap()).unwrap()
    }

    fn frame(experiment: &Experiment, kind: SceneKind) -> Frame {
        let touches = kind.frames(&experiment.detector, 1, 1);
        experiment.frames(&touches, 1).unwrap().remove(0)
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
        assert_eq!((best.error_m, best.missed, best.invented), (Some(0.0), Some(0), Some(0)));
        assert!(best.conductance_error.is_some_and(|error| error < 1e-12));
        assert!(best.image.correlation.is_some_and(|correlation| correlation > 0.95), "{:?}", best.image);
        let worst = scorer.score(&frame, &Solution::default()).unwrap();
        assert_eq!((worst.error_m, worst.missed), (Some(experiment.reach_m()), Some(3)));
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
    fn what_is_no_number_is_seen() {
        let experiment = experiment();
        let frame = frame(&experiment, SceneKind::Firm);
        let solution = Solution { contacts: vec![FoundContact::flat(f64::NAN, 0.0, 1e-3)], ..Solution::default() };
        assert!(Scorer::new(&experiment).score(&frame, &solution).unwrap().not_finite);
    }

    #[test]
    fn times_are_ranks() {
        let times = Times::of((0..=100).rev().map(Duration::from_micros));
        assert_eq!([times.median, times.p99, times.max].map(f64::round), [50.0, 99.0, 100.0]);
    }
}
