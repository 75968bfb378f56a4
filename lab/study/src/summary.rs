//! Scores of many frames in a few figures.

use std::time::Duration;

use super::score::{Chosen, Score};

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
    /// Share of frames with as many contacts as touch.
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
    /// What a solver that chooses took the frames for, the most frequent first.
    pub chosen: Vec<ChosenReport>,
}

/// What a solver that chooses took some frames for.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct ChosenReport {
    /// The model: nothing, `2 contacts`, `line`, `ring`, `image`.
    pub what: String,
    /// How many unknowns that has.
    pub unknowns: usize,
    /// The share of frames.
    pub share: f64,
}

impl ChosenReport {
    fn all(scores: &[&Score]) -> Vec<Self> {
        let mut all: Vec<Self> = Vec::new();
        let each = 1.0 / scores.len().max(1) as f64;
        for Chosen { what, unknowns } in scores.iter().filter_map(|score| score.chosen.as_ref()) {
            match all.iter_mut().find(|report| report.what == *what) {
                Some(report) => report.share += each,
                None => all.push(Self { what: what.clone(), unknowns: *unknowns, share: each }),
            }
        }
        all.sort_by(|a, b| b.share.total_cmp(&a.share));
        all
    }
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
            wrong: share(&|score| score.is_wrong),
            position_error_m: mean(&|score| score.position_error_m),
            count_right: mean(&|score| Some(f64::from(u8::from(score.is_number_right?)))),
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
            chosen: ChosenReport::all(&scores),
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

    #[test]
    fn times_are_ranks() {
        let times = Times::of((0..=100).rev().map(Duration::from_micros));
        assert_eq!([times.median, times.p99, times.max].map(f64::round), [50.0, 99.0, 100.0]);
    }
}
