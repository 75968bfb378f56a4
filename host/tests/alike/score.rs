//! How good answers are.

use std::fmt;

use tactomo::metrics::{Comparison, Matching, truth_s_per_m2};
use tactomo::scene::{Contact, Touch};
use tactomo::solve::{Problem, Solution};

/// Contacts farther off than this are others (m).
const REACH_M: f64 = 0.010;
/// Smoothing of images before they are compared (m).
const SMOOTHING_M: f64 = 0.002;
/// Images are compared in every so many answers.
const IMAGE_STRIDE: usize = 20;
/// Images in a smaller share of the answers are chance: of `gripper`, which is now contacts and now a line, one answer in fifty was
/// an image offline, and in the next run none.
const FEWEST_IMAGES: f64 = 0.1;

/// How good answers are, in the mean.
#[derive(Clone, Copy, Debug, Default)]
pub struct Score {
    /// Share of answers with the right number of contacts.
    count_right: f64,
    /// Error of the places of contacts that were found (m).
    error_m: f64,
    /// Correlation of images with the truth.
    correlation: f64,
    images: usize,
    /// Answers that were looked at for an image.
    looked_at: usize,
}

impl Score {
    /// The score of answers against what truly touched.
    pub fn of<'a>(problem: &Problem, truths: &[Vec<Touch>], solutions: impl Iterator<Item = &'a Solution>) -> Self {
        let mesh = &problem.jacobian.image_mesh;
        let comparison = Comparison::new(mesh, SMOOTHING_M);
        let (mut score, mut matched, mut answers) = (Self::default(), 0, 0);
        for (truth, solution) in truths.iter().zip(solutions) {
            let contacts: Vec<Contact> = truth.iter().filter_map(Touch::disc).collect();
            score.count_right += f64::from(u8::from(contacts.len() == solution.contacts.len()));
            if let Some(error_m) = Matching::within(REACH_M, &contacts, &solution.contacts).position_error_m() {
                score.error_m += error_m;
                matched += 1;
            }
            if answers % IMAGE_STRIDE == 0 {
                score.looked_at += 1;
                if let Some(image) = &solution.image_s_per_m2 {
                    let truth = truth_s_per_m2(mesh, truth).unwrap();
                    score.correlation += comparison.of(&truth, image).correlation.unwrap_or_default();
                    score.images += 1;
                }
            }
            answers += 1;
        }
        score.count_right /= f64::from(answers.max(1) as u32);
        score.error_m /= f64::from(matched.max(1));
        score.correlation /= score.images.max(1) as f64;
        score
    }

    /// Whether it is as good, within 10 % and what is chance: places of contacts to 0.05 mm, peaks of images to a third of the 3 mm between the
    /// nodes of the coarsest. Errors may be so many `times` larger besides; where they may, contacts are found late, and a quarter of the counts may be
    /// of before.
    pub fn is_as_good_as(&self, other: &Self, times: f64) -> bool {
        let chance_m = if other.images > 0 { 1e-3 } else { 5e-5 };
        let counts = if times > 1.0 { 0.75 } else { 0.9 };
        self.count_right > counts * other.count_right - 0.01
            && self.error_m < 1.1 * times * other.error_m + chance_m
            && (!other.is_of_images()
                || self.images > 0 && self.correlation > other.correlation - 0.1 * other.correlation.abs() - 0.01)
    }

    fn is_of_images(&self) -> bool {
        self.images as f64 > FEWEST_IMAGES * self.looked_at as f64
    }
}

impl fmt::Display for Score {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { count_right, error_m, correlation, images, .. } = self;
        write!(formatter, "{:>3.0} % {:>5.2} mm", 100.0 * count_right, 1e3 * error_m)?;
        if *images > 0 { write!(formatter, " r {correlation:>4.2}") } else { write!(formatter, "       ") }
    }
}
