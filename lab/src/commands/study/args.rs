//! Arguments that studies share.

use tactomo_study::Calibrate;
use tactomo_touch::solve::Method;

use super::super::shown::Shown;
use tactomo_cli::choice;

/// What a study tries, and where its page goes.
#[derive(Debug, clap::Args)]
pub struct StudyArgs {
    /// Solver to try; give it again for more [default: all]
    #[arg(long, value_name = "NAME", value_parser = choice::method(), hide_possible_values = true)]
    solver: Vec<Method>,
    /// A quick look, with few places and frames
    #[arg(long)]
    pub quick: bool,
    /// Places of the contacts in each scene
    #[arg(long, value_parser = clap::value_parser!(u16).range(1..=1000))]
    places: Option<u16>,
    /// Frames at each place
    #[arg(long, value_parser = clap::value_parser!(u16).range(1..=1000))]
    frames: Option<u16>,
    /// Seed of places and noise: the same seed gives the same figures, but for times
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// Simulates detectors as they were built: drawn with this seed from the tolerances around their descriptions, which is all that
    /// solvers know
    #[arg(long, value_name = "SEED")]
    pub as_built: Option<u64>,
    /// Detectors as built are tried once more after a rub of so many presses at unknown places; 0 for none. Some seconds for each detector
    #[arg(long, value_name = "PRESSES", default_value_t = RUBBED, value_parser = clap::value_parser!(u16).range(0..=10_000))]
    calibrate: u16,
    #[command(flatten)]
    pub shown: Shown,
}

/// Rubbed presses unless said otherwise: more of them did not better places (`study built --rub`, the table in docs/calibrate.md), and
/// take longer.
const RUBBED: u16 = 24;

impl StudyArgs {
    /// The calibration that is tried, if one is.
    pub fn calibrate(&self) -> Option<Calibrate> {
        (self.calibrate > 0).then_some(Calibrate::Rub(usize::from(self.calibrate)))
    }

    /// The solvers that are tried.
    pub fn methods(&self) -> Vec<Method> {
        if self.solver.is_empty() { Method::ALL.to_vec() } else { self.solver.clone() }
    }

    /// Places and frames at each: those that are given, or a study's own.
    pub fn places_and_frames(&self, own: [usize; 2]) -> [usize; 2] {
        [self.places.map_or(own[0], usize::from), self.frames.map_or(own[1], usize::from)]
    }
}
