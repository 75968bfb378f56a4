//! Lines and rings: one strip of contact fitted to the full contact physics.
//!
//! A bar or the rim of a cup is no few points, and an image takes far more numbers than it needs. A strip ([`strip`]) along a line (two
//! ends, width, conductance) or a circle (centre, radius, width, conductance) is laid on the nodes of the model's image and fitted ([`fit`])
//! to whitened readings, as contacts are, from where contacts stand for it ([`start`]).
//!
//! How well the nodes carry a thin strip was measured on `square-60` (45 x 45 nodes, 1.4 mm apart) against exact polygons on 141 x 141
//! finer cells: lines of 36 mm and rings of 13 mm radius, 1.5 to 6 mm wide, of 0.1 and 2 sheet conductances. What the best strip leaves is
//! 0.00007 to 0.0003 of the largest reading in the root of the mean square, no more than the 0.0003 that contacts allow for the slab; ends are
//! right to 0.1 mm, radii to 0.03 mm (but where noise-free readings do not tell the width, and that is taken as usual), conductances to 2 %.

mod evidence;
mod fit;
mod found;
mod start;
mod strip;
#[cfg(test)]
mod tests;

use std::sync::Arc;

use nalgebra::DVector;

pub(crate) use self::fit::StripFit;
use self::fit::{StripFitter, Usual};
use self::found::found_shape;
use self::strip::{Course, Ground, Strip};
use crate::solve::answer::{Flags, FoundContact, FoundShape, Solution};
use crate::solve::fit::evidence::{Evidence, Searched};
use crate::solve::fit::policy;
use crate::solve::fit::target::Target;
use crate::solve::problem::Problem;
use tactomo_physics::forward::{ForwardError, ForwardModel};
use tactomo_physics::geometry::{self, Point};

/// Steps from each start on either mesh, and steps from the frame before.
const COLD_STEPS: usize = 20;
const WARM_STEPS: usize = 2;
/// Nodes of the mesh that shapes are searched on, as a share of the model's.
const COARSE: f64 = 0.4;
/// A strip with such a share on the detector is all on it: what nodes make of it is right to some thousandths.
const WHOLE: f64 = 0.995;
/// Differences of places, in usual widths, and of logarithms.
const DIFFERENCE: f64 = 1e-4;
/// Usual width of a strip, in mean distances of electrodes: between those of a ruler's edge and of a finger on `square-60`.
const WIDTH: f64 = 0.25;
/// Standard deviation of the logarithm of the width before anything is read, as of the radius of discs: it is usual to a factor of two.
const WIDTH_DEVIATION: f64 = 0.7;

/// What finds lines and rings: the same for all frames, and shared by the threads that follow and search.
pub(crate) struct ShapeFinder {
    problem: Problem,
    /// On which shapes are fitted, and on which they are searched.
    fine: Grid,
    coarse: Grid,
    /// Of the mesh that solutions' images are on.
    image_ground: Ground,
    usual: Usual,
}

/// A model and the nodes of its image.
struct Grid {
    model: Arc<dyn ForwardModel>,
    ground: Ground,
}

impl Grid {
    fn new(model: Arc<dyn ForwardModel>) -> Self {
        Self { ground: Ground::new(model.image_mesh()), model }
    }
}

impl ShapeFinder {
    /// Makes it ready for a problem; `None` on a curved detector, where lines are not straight.
    ///
    /// # Errors
    /// [`ForwardError`] if the model cannot be had on a coarser image.
    pub fn new(problem: &Problem) -> Result<Option<Self>, ForwardError> {
        let (mesh, detector) = (problem.model.image_mesh(), problem.detector());
        if detector.surface.is_some() {
            return Ok(None);
        }
        let coarse = problem.model.on_image_of((COARSE * mesh.nodes_m.len() as f64) as usize)?;
        let spacing_m = problem.spacing_m();
        let usual = Usual {
            width_m: WIDTH * spacing_m,
            width_deviation: WIDTH_DEVIATION,
            conductance_s: detector.sheet_conductance_s(),
            conductance_deviation: policy::CONDUCTANCE_DEVIATION,
            spacing_m,
            bounds_m: geometry::bounds(&mesh.nodes_m),
            area_m2: mesh.node_areas_m2.iter().sum(),
        };
        Ok(Some(Self {
            fine: Grid::new(Arc::clone(&problem.model)),
            coarse: Grid::new(coarse.into()),
            image_ground: Ground::new(&problem.jacobian.image_mesh),
            usual,
            problem: problem.clone(),
        }))
    }

    /// The line or ring that explains the readings best, from contacts that stand for it and from what was followed; `None` if none comes
    /// near to `rival`, the score of another explanation.
    pub fn search(
        &self,
        contacts: &[FoundContact],
        from: Option<&StripFit>,
        target: &Target,
        rival: f64,
    ) -> Option<StripFit> {
        let coarse = self.fitter(&self.coarse);
        let starts = start::starts(contacts, self.usual.width_m);
        let starts = starts.into_iter().chain(from.map(|fit| *fit.strip()));
        let most = policy::SHAPE_RIVALS * rival;
        let fits = starts.filter_map(|start| Some(coarse.fit_below(most, coarse.lay(start)?, target, COLD_STEPS)));
        let (lines, rings): (Vec<_>, Vec<_>) =
            fits.filter(|fit| fit.evidence().score() < most).partition(|fit| fit.strip().is_line());
        let lowest = |a: &StripFit, b: &StripFit| a.evidence().score().total_cmp(&b.evidence().score());
        let mut kinds: Vec<_> = [lines, rings].into_iter().filter_map(|fits| fits.into_iter().min_by(lowest)).collect();
        kinds.sort_unstable_by(lowest);
        let best = kinds.first()?.evidence().score();
        kinds.retain(|other| other.evidence().score() < policy::SHAPE_RIVALS * best);
        let fits = kinds.iter().filter_map(|fit| self.catch_up(fit, target));
        fits.filter(|fit| self.is_clear(fit.strip(), 1.0)).min_by(lowest)
    }

    /// An image as contacts, one for what each node has of it.
    pub fn contacts_of(&self, image_s_per_m2: &[f32]) -> Vec<FoundContact> {
        let nodes = self.image_ground.nodes().zip(image_s_per_m2);
        let contact = |(([x_m, y_m], area_m2), density): ((Point, f64), &f32)| FoundContact {
            radius_m: Some(0.0),
            ..FoundContact::flat(x_m, y_m, area_m2 * f64::from(*density))
        };
        nodes.filter(|(_, density)| **density > 0.0).map(contact).collect()
    }

    /// Whether what was chosen is still more than a disc to the readings.
    fn is_kept(&self, strip: &Strip) -> bool {
        self.is_clear(strip, policy::KEPT_SHAPE_SHARE)
    }

    /// Whether it is more than a disc to the readings, by a share of what a search asks for.
    fn is_clear(&self, strip: &Strip, share: f64) -> bool {
        let spacing_m = self.usual.spacing_m;
        let (size_m, least_m) = match strip.course {
            Course::Line(_) => (strip.course.length_m(), (2.0 * strip.width_m).max(policy::SHORTEST_LINE * spacing_m)),
            Course::Ring { radius_m, .. } => (radius_m, (1.5 * strip.width_m).max(policy::SMALLEST_RING * spacing_m)),
        };
        size_m > share * least_m
    }

    /// Whether contacts may stand for a line or a ring: more than one, or a wide one.
    pub fn may_be(&self, contacts: &[FoundContact]) -> bool {
        match contacts {
            [] => false,
            [one] => one.radius_m.is_some_and(|radius_m| radius_m > policy::SMALLEST_RING * self.usual.spacing_m),
            _ => true,
        }
    }

    /// A strip of some frames ago or of the coarse mesh, brought to this frame.
    fn catch_up(&self, fit: &StripFit, target: &Target) -> Option<StripFit> {
        let fine = self.fitter(&self.fine);
        Some(fine.fit(fine.lay(*fit.strip())?, target, COLD_STEPS))
    }

    /// The strip in the next frame; it has to be one of [`catch_up`](Self::catch_up).
    fn follow(&self, last: StripFit, target: &Target) -> StripFit {
        self.fitter(&self.fine).fit(last.laid, target, WARM_STEPS)
    }

    fn fitter<'a>(&'a self, grid: &'a Grid) -> StripFitter<'a> {
        StripFitter { model: &*grid.model, ground: &grid.ground, detector: self.problem.detector(), usual: &self.usual }
    }

    /// What of the strip is on the detector.
    fn shape(&self, fit: &StripFit) -> FoundShape {
        let strip = fit.strip();
        let share_of = |strip: &Strip| self.fine.ground.conductances_s(strip).iter().sum::<f64>() / strip.conductance_s;
        let share = share_of(strip);
        if share > WHOLE {
            return found_shape(strip, fit.covariance.as_ref());
        }
        // What is beyond an edge changes the conductance of all, not that of what touches.
        let log_slope = |parameter: usize| {
            let mut step = vec![0.0; strip.parameters()];
            let layout = strip.layout();
            step[parameter] = DIFFERENCE * if parameter < layout.coordinates { self.usual.width_m } else { 1.0 };
            let of_all = f64::from(u8::from(parameter == layout.conductance));
            of_all + (share_of(&strip.moved(&step)) / share).ln() / step[parameter]
        };
        let slopes = DVector::from_iterator(strip.parameters(), (0..strip.parameters()).map(log_slope));
        let covariance = fit.covariance.as_ref().map(|covariance| {
            let mut touching = covariance.clone();
            let last = slopes.len() - 1;
            touching[(last, last)] = slopes.dot(&(covariance * &slopes));
            touching
        });
        let touching = Strip {
            course: strip.course.within(self.usual.bounds_m),
            conductance_s: share * strip.conductance_s,
            ..*strip
        };
        found_shape(&touching, covariance.as_ref())
    }

    fn solution(&self, fit: &StripFit, target: &Target) -> Solution {
        let evidence = fit.evidence();
        let left = evidence.cost / (target.count() as f64 - evidence.parameters).max(1.0);
        let flags = Flags {
            saturated: target.is_saturated(),
            misfit: evidence.is_misfit(target.count()),
            unfinished: !fit.settled || target.is_provisional(),
            ..Flags::default()
        };
        Solution {
            image_s_per_m2: Some(self.image_ground.image_s_per_m2(fit.strip())),
            shape: Some(self.shape(fit)),
            residual: Some(left.sqrt() * target.deviation_v() / target.noise_v),
            flags,
            ..Solution::default()
        }
    }
}

/// Follows a line or a ring from frame to frame.
pub(crate) struct ShapeTracker {
    finder: Arc<ShapeFinder>,
    last: Option<(StripFit, Searched)>,
}

impl ShapeTracker {
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

    /// Brings the shape to the next frame; whether it has to be searched. What has become a disc to the readings is let go: it is no answer in
    /// any frame.
    pub fn follow(&mut self, target: &Target) -> bool {
        let Some((last, searched)) = self.last.take() else { return true };
        let moved = self.finder.follow(last, target);
        if !self.finder.is_kept(moved.strip()) {
            return true;
        }
        self.last = Some((moved, searched));
        self.has_lost(target)
    }

    /// Takes what a search has found, if it explains this frame better than what is followed, and is still more than a disc in it.
    pub fn adopt(&mut self, found: &StripFit, target: &Target) {
        let caught_up = self.finder.catch_up(found, target).filter(|fit| self.finder.is_kept(fit.strip()));
        let Some(caught_up) = caught_up else { return };
        let score = |fit: &StripFit| fit.evidence().score();
        if self.found().is_none_or(|last| score(&caught_up) <= score(last)) {
            self.last = Some((caught_up, Searched::new(found.evidence(), target.count())));
        }
    }

    /// Whether what is followed does not explain this frame as well as what was searched explained its own.
    pub fn has_lost(&self, target: &Target) -> bool {
        self.last.as_ref().is_none_or(|(fit, searched)| searched.is_worse(fit.evidence(), target.count()))
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
