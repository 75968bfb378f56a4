//! Lines and rings: one strip of contact fitted to the full contact physics.
//!
//! A bar or the rim of a cup is no few points, and an image takes far more numbers than it needs. A strip ([`strip`]) along a line (two
//! ends, width, conductance) or a circle (centre, radius, width, conductance) is laid on the nodes of the model's image and fitted ([`fit`])
//! to whitened readings, as contacts are, from where contacts stand for it ([`start`]).
//!
//! How well the nodes carry a thin strip was measured on `square-60` (45 x 45 nodes, 1.4 mm apart) against exact polygons on 141 x 141
//! finer cells: lines of 36 mm and rings of 13 mm radius, 1.5 to 6 mm wide, of 0.1 and 2 sheet conductances. What the best strip leaves is
//! 0.00007 to 0.0003 of the largest reading in the root of the mean square, less than the 0.0007 that contacts allow for the model; ends are
//! right to 0.1 mm, radii to 0.03 mm (but where noise-free readings do not tell the width, and that is taken as usual), conductances to 2 %.

mod fit;
mod found;
mod start;
mod strip;

use std::sync::Arc;

pub(super) use self::fit::StripFit;
use self::fit::{StripFitter, Usual};
pub use self::found::{FoundLine, FoundRing, FoundShape, LineUncertainty, RingUncertainty};
use self::strip::Ground;
use super::contacts::Target;
use super::evidence::{Evidence, Watch};
use super::{Flags, FoundContact, Problem, Solution};
use tactomo_physics::geometry;

/// Steps from each start, steps from the best one of a kind, and steps from the frame before.
const FIRST_STEPS: usize = 5;
const COLD_STEPS: usize = 20;
const WARM_STEPS: usize = 2;
/// Usual width of a strip, in mean distances of electrodes: between those of a ruler's edge and of a finger on `square-60`.
const WIDTH: f64 = 0.25;
/// Standard deviations of the logarithms of width and conductance before anything is read, as of the radius and conductance of discs: the
/// width is usual to a factor of two, of the conductance nearly nothing is known.
const WIDTH_DEVIATION: f64 = 0.7;
const CONDUCTANCE_DEVIATION: f64 = 4.0;
/// A contact of more sheet conductances counts as one of so many where a fit starts.
const MOST_WEIGHT: f64 = 2.0;

/// What finds lines and rings: the same for all frames, and shared by the threads that follow and search.
pub(super) struct ShapeFinder {
    problem: Problem,
    ground: Ground,
    /// Of the mesh that solutions' images are on.
    image_ground: Ground,
    usual: Usual,
    noise_v: f64,
}

impl ShapeFinder {
    /// Makes it ready for a problem; `None` on a curved detector, where lines are not straight.
    pub fn new(problem: &Problem) -> Option<Self> {
        let (mesh, detector) = (problem.model.image_mesh(), problem.detector());
        if detector.surface.is_some() {
            return None;
        }
        let spacing_m = problem.spacing_m();
        let usual = Usual {
            width_m: WIDTH * spacing_m,
            width_deviation: WIDTH_DEVIATION,
            conductance_s: detector.sheet_conductance_s(),
            conductance_deviation: CONDUCTANCE_DEVIATION,
            spacing_m,
            bounds_m: geometry::bounds(&mesh.nodes_m),
        };
        Some(Self {
            ground: Ground::new(mesh),
            image_ground: Ground::new(&problem.jacobian.image_mesh),
            usual,
            noise_v: detector.adc.deviation_v(),
            problem: problem.clone(),
        })
    }

    /// The line or ring that explains the readings best, from contacts that stand for it and from what was followed.
    pub fn search(&self, contacts: &[FoundContact], from: Option<&StripFit>, target: &Target) -> Option<StripFit> {
        let fitter = self.fitter();
        let starts = start::starts(contacts, self.usual.width_m, MOST_WEIGHT * self.usual.conductance_s);
        let starts = starts.into_iter().chain(from.map(|fit| fit.strip));
        let begun: Vec<_> = starts.filter_map(|start| fitter.fit(start, target, FIRST_STEPS)).collect();
        let is_line = |fit: &StripFit| matches!(fit.strip.course, strip::Course::Line(_));
        let best = |lines: bool| {
            let ones = begun.iter().filter(|fit| is_line(fit) == lines);
            let best = ones.min_by(|a, b| a.cost.total_cmp(&b.cost))?;
            fitter.fit(best.strip, target, COLD_STEPS)
        };
        let lowest = |a: &StripFit, b: &StripFit| a.evidence().score().total_cmp(&b.evidence().score());
        [true, false].into_iter().filter_map(best).min_by(lowest)
    }

    /// A strip of some frames ago, brought to this one.
    fn catch_up(&self, fit: &StripFit, target: &Target) -> Option<StripFit> {
        self.fitter().fit(fit.strip, target, COLD_STEPS)
    }

    /// The strip in the next frame.
    fn follow(&self, last: &StripFit, target: &Target) -> Option<StripFit> {
        self.fitter().fit(last.strip, target, WARM_STEPS)
    }

    fn fitter(&self) -> StripFitter<'_> {
        StripFitter {
            model: &*self.problem.model,
            ground: &self.ground,
            detector: self.problem.detector(),
            usual: &self.usual,
        }
    }

    fn solution(&self, fit: &StripFit, target: &Target) -> Solution {
        let evidence = fit.evidence();
        let left = evidence.cost / (target.count() as f64 - evidence.parameters).max(1.0);
        let flags = Flags {
            saturated: target.is_saturated(),
            misfit: evidence.is_misfit(target.count()),
            unfinished: !fit.settled,
            excluded: Vec::new(),
        };
        Solution {
            image_s_per_m2: Some(self.image_ground.image_s_per_m2(&fit.strip)),
            shape: Some(FoundShape::of(&fit.strip, fit.covariance.as_ref())),
            residual: Some(left.sqrt() * target.deviation_v() / self.noise_v),
            flags,
            ..Solution::default()
        }
    }
}

/// Follows a line or a ring from frame to frame.
pub(super) struct ShapeFollower {
    finder: Arc<ShapeFinder>,
    last: Option<(StripFit, Watch)>,
}

impl ShapeFollower {
    /// Follows nothing yet.
    pub fn new(finder: Arc<ShapeFinder>) -> Self {
        Self { finder, last: None }
    }

    /// What is followed.
    pub fn found(&self) -> Option<&StripFit> {
        self.last.as_ref().map(|(fit, _)| fit)
    }

    /// What is left of the frame that was followed last, and what that takes.
    pub fn evidence(&self) -> Option<Evidence> {
        self.found().map(StripFit::evidence)
    }

    /// Brings the shape to the next frame; whether it has to be searched.
    pub fn follow(&mut self, target: &Target) -> bool {
        let Some((last, mut watch)) = self.last.take() else { return true };
        let Some(moved) = self.finder.follow(&last, target) else { return true };
        let has_lost = watch.has_lost(moved.evidence(), target.count());
        self.last = Some((moved, watch));
        has_lost
    }

    /// Takes what a search has found, if it explains this frame better than what is followed.
    pub fn adopt(&mut self, found: &StripFit, target: &Target) {
        let Some(caught_up) = self.finder.catch_up(found, target) else { return };
        let score = |fit: &StripFit| fit.evidence().score();
        if self.found().is_none_or(|last| score(&caught_up) <= score(last)) {
            let watch = Watch::new(caught_up.evidence(), found.evidence(), target.count());
            self.last = Some((caught_up, watch));
        }
    }

    /// Whether what was adopted does not explain this frame as well as its own.
    pub fn has_lost(&self, target: &Target) -> bool {
        self.last.as_ref().is_none_or(|(fit, watch)| watch.is_worse(fit.evidence(), target.count()))
    }

    /// What is followed, as a solution.
    pub fn solution(&self, target: &Target) -> Option<Solution> {
        self.found().map(|fit| self.finder.solution(fit, target))
    }

    /// Follows nothing.
    pub fn let_go(&mut self) {
        self.last = None;
    }
}
