//! The paper's study of bonding, its figure 7: two layers joined by dots of glue, over the dots' diameter, up to dots that touch.
//!
//! Two layers of sample B, 60 x 60 mm and 5 mm each, 5 x 5 or 7 x 7 dots. The paper's glue conducts along itself far better than foam, so that a dot is an equipotential;
//! beside it stands a glue that conducts only across, which shows what of the effect that is.

mod bar;
mod claims;
mod view;

use std::fmt::Display;
use std::time::Instant;

use tactomo_physics::detector::{Bond, Detector, Stack};
use tactomo_physics::forward::{ForwardError, Slab};

pub use self::bar::Bar;
pub use self::view::view;
use super::metrics::Sweep;
use super::press::{COMPARED_S_PER_M, CONDUCTIVITIES_S_PER_M, MIDDLE};
use super::{Claim, Course, DesignError, Imaging, Limit, PaperSolver, Press, Progress};

/// What is stacked.
const MATERIAL: &str = "BB";
/// Dots along a side.
const GRIDS: [usize; 2] = [5, 7];
/// Diameters, as shares of the pitch, and how many.
const COUNT: usize = 10;
const DIAMETERS: [f64; COUNT] = [0.08, 0.16, 0.25, 0.35, 0.45, 0.55, 0.65, 0.75, 0.88, 1.0];
/// Sheet conductance of a glue that conducts only across (S): the least that a bond may have.
const ACROSS_ONLY_S: f64 = 1e-9;
/// The electrode that is grounded while the currents through the dots are looked at: one of the four around the middle.
const GROUNDED: usize = 5;

/// How two layers are joined.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Glue {
    /// Dots of glue that conducts along itself as well: the paper's.
    Conducting,
    /// Dots of glue that conducts only across.
    AcrossOnly,
}

/// A bond and what it gives.
#[derive(Clone, Debug, serde::Serialize)]
pub struct Row {
    /// Dots along a side; 0 where the layers touch all over.
    pub dots: usize,
    /// Of what the dots are; `None` where the layers touch all over.
    pub glue: Option<Glue>,
    /// Diameter of a dot (m); `None` where the layers touch all over.
    pub diameter_m: Option<f64>,
    /// Error of the paper's solver (m): mean over nine places, without noise.
    pub position_error_m: Option<f64>,
    /// SR and PA with it.
    #[serde(flatten)]
    pub imaging: Imaging,
    /// What the sensor itself can tell.
    pub limit: Limit,
    /// Current of a contact in the middle through each dot, while an electrode beside the middle is grounded: place (m), mean density (A/m2).
    pub currents: Vec<Current>,
}

/// Current through a dot.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Current {
    /// Middle of the dot (m).
    pub centre_m: [f64; 2],
    /// Current (A).
    pub current_a: f64,
    /// Over its area (A/m2).
    pub density_a_per_m2: f64,
}

/// All of the study.
#[derive(Clone, Debug, serde::Serialize)]
pub struct Report {
    /// Each glue and grid, by diameter; the layers that touch all over first.
    pub rows: Vec<Row>,
    /// Bars of conductor that a dot of each diameter joins.
    pub bars: Vec<Bar>,
    /// What was concluded, and how the study went.
    #[serde(flatten)]
    pub course: Course,
}

/// Runs the study. It has no noise, and so no seed.
///
/// # Errors
/// [`DesignError`] if there is no model of a bond.
pub fn run(progress: Progress) -> Result<Report, DesignError> {
    let start = Instant::now();
    let wrong = |what: &dyn Display| ForwardError::Detector { detector: MATERIAL.to_owned(), what: what.to_string() };
    let stack: Stack = MATERIAL.parse().map_err(|error| wrong(&error))?;
    let touching = Detector::default().in_material(&stack).map_err(|error| wrong(&error))?.taken_as_exact();
    let solver = PaperSolver::new(&touching)?;
    let bonds = GRIDS.iter().flat_map(|dots| {
        let pitch_m = touching.outline.size_m()[0] / *dots as f64;
        [Glue::Conducting, Glue::AcrossOnly]
            .into_iter()
            .flat_map(move |glue| DIAMETERS.map(move |share| Some((glue, *dots, share * pitch_m))))
    });
    let tasks: Vec<_> = std::iter::once(None).chain(bonds).collect();
    let computed = progress.map("bonds", &tasks, |bond| row(&touching, *bond, &solver));
    let is_stopped = computed.iter().any(Option::is_none);
    let rows: Vec<Row> = computed.into_iter().flatten().collect::<Result<_, _>>()?;
    let bars = bars(&touching);
    let course = Course::since(start, is_stopped, claims::of(&rows));
    Ok(Report { rows, bars, course })
}

/// A dot of each diameter in a bar of two layers of a detector.
fn bars(touching: &Detector) -> Vec<Bar> {
    let layer_m = touching.layers.first().map_or(0.0, |layer| layer.thickness_m);
    let of = |dots: usize| {
        let pitch_m = touching.outline.size_m()[0] / dots as f64;
        DIAMETERS.map(|share| Bar::of(pitch_m, layer_m, share * pitch_m))
    };
    GRIDS.into_iter().flat_map(of).collect()
}

fn row(touching: &Detector, bond: Option<(Glue, usize, f64)>, solver: &PaperSolver) -> Result<Row, DesignError> {
    let mut detector = touching.clone();
    if let (Some((glue, dots, diameter_m)), Some(upper)) = (bond, detector.layers.last_mut()) {
        let bond = Bond::of_dots([dots; 2], diameter_m);
        upper.bond = Some(match glue {
            Glue::Conducting => bond,
            Glue::AcrossOnly => Bond { sheet_conductance_s: ACROSS_ONLY_S, ..bond },
        });
    }
    let slab = Slab::new(&detector)?;
    let imaging = Sweep::of(&slab, &Press::PAPER, &[], COMPARED_S_PER_M)?.metrics(solver).imaging;
    let width_m = detector.outline.size_m()[0];
    Ok(Row {
        dots: bond.map_or(0, |(_, dots, _)| dots),
        glue: bond.map(|(glue, ..)| glue),
        diameter_m: bond.map(|(.., diameter_m)| diameter_m),
        position_error_m: imaging.position_accuracy.map(|accuracy| (1.0 - accuracy) * width_m),
        imaging,
        limit: Limit::of(&slab, &Press::PAPER, COMPARED_S_PER_M, CONDUCTIVITIES_S_PER_M)?,
        currents: currents(&slab)?,
    })
}

fn currents(slab: &Slab) -> Result<Vec<Current>, ForwardError> {
    let Some(dots) = slab.dot_currents()? else { return Ok(Vec::new()) };
    let contact = Press::PAPER.at(MIDDLE, COMPARED_S_PER_M);
    let of = |dot: &tactomo_physics::forward::DotCurrent| Current {
        centre_m: dot.centre_m,
        current_a: dot.current_a,
        density_a_per_m2: dot.mean_density_a_per_m2(),
    };
    Ok(dots.at(GROUNDED, &[contact])?.iter().map(of).collect())
}

impl Row {
    /// Largest mean current density of a dot (A/m2); `None` without dots.
    pub fn largest_density_a_per_m2(&self) -> Option<f64> {
        self.currents.iter().map(|current| current.density_a_per_m2).max_by(f64::total_cmp)
    }

    /// What it is, for people.
    pub fn name(&self) -> String {
        match self.glue {
            Some(glue) => format!("{0} x {0}, {1}", self.dots, glue.title()),
            None => "touching all over".to_owned(),
        }
    }
}

impl Glue {
    /// What it is, for people.
    pub const fn title(self) -> &'static str {
        match self {
            Self::Conducting => "glue of the paper",
            Self::AcrossOnly => "glue that conducts only across",
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_current_of_a_contact_passes_the_dots_and_wide_dots_of_good_glue_spread_it() {
        let stack: Stack = MATERIAL.parse().unwrap();
        let touching = Detector::default().in_material(&stack).unwrap().taken_as_exact();
        let solver = PaperSolver::new(&touching).unwrap();
        let of = |glue, diameter_m| row(&touching, Some((glue, 5, diameter_m)), &solver).unwrap();
        let [narrow, wide] = [2e-3, 10e-3].map(|diameter_m| of(Glue::Conducting, diameter_m));
        let total = |row: &Row| row.currents.iter().map(|current| current.current_a).sum::<f64>();
        let contact = Press::PAPER.at(MIDDLE, COMPARED_S_PER_M);
        for (row, diameter_m) in [(&narrow, 2e-3), (&wide, 10e-3)] {
            assert_eq!(row.currents.len(), 25);
            // What flows is the drive over the grounded electrode's impedance, and all of it crosses the bond.
            let mut detector = touching.clone();
            detector.layers[1].bond = Some(Bond::of_dots([5, 5], diameter_m));
            let z = tactomo_physics::forward::ForwardModel::impedance_ohm(&Slab::new(&detector).unwrap(), &[contact])
                .unwrap();
            let expected_a = 2.0 / (z[(GROUNDED, GROUNDED)] + 4.0);
            assert!((total(row) / expected_a - 1.0).abs() < 1e-3, "{} {expected_a}", total(row));
        }
        assert!(narrow.largest_density_a_per_m2() > wide.largest_density_a_per_m2());
        let across = of(Glue::AcrossOnly, 10e-3);
        assert!(across.limit.place_m < wide.limit.place_m, "what spreads along the glue is lost for places");
    }
}
