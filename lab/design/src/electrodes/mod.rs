//! Which electrodes: their number, pattern, diameter and pitch, which the paper does not study.
//!
//! On its sample A, 60 x 60 x 5 mm, with its contact of 4 mm and 1 S/m. A frame has a conversion for each ground and electrode, so that more
//! electrodes take longer: places are compared for one frame, and for the time of a frame of 16.

mod view;

use std::time::Instant;

use tactomo_physics::detector::Detector;
use tactomo_physics::forward::Slab;
use tactomo_study::Errors;

use super::limit::{Spread, places_everywhere};
use super::press::{COMPARED_S_PER_M, CONDUCTIVITIES_S_PER_M, nine_places};
use super::reached::by_auto;
use super::{Course, DesignError, Layout, Limit, Press, Progress, Reached};

pub use self::view::view;

/// Places over the whole surface.
const PLACES: usize = 100;
/// Diameter of the paper's electrodes (m).
const DIAMETER_M: f64 = 0.004;
/// Conversions of a frame that others are compared with: 16 grounds, 16 electrodes.
const USUAL_CONVERSIONS: f64 = 256.0;

/// What to compute.
#[derive(Clone, Debug)]
pub struct Plan {
    /// Of noise.
    pub seed: u64,
}

/// Electrodes and what they give.
#[derive(Clone, Debug, serde::Serialize)]
pub struct Row {
    /// What is varied.
    pub group: Group,
    /// What the electrodes are.
    pub name: String,
    /// The pattern.
    pub layout: Layout,
    /// Diameter of an electrode (m).
    pub diameter_m: f64,
    /// Conversions of a frame.
    pub conversions: usize,
    /// What the sensor itself can tell.
    pub limit: Limit,
    /// Standard errors of a place over the whole surface; `None` if somewhere it is not told.
    pub everywhere: Option<Spread>,
    /// Their median if as many frames are averaged as are read in the time of one of 16 electrodes (m).
    pub median_in_same_time_m: Option<f64>,
    /// What `auto` makes of contacts at the nine places.
    pub reached: Reached,
}

/// What is varied.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Group {
    /// How many.
    Number,
    /// How 16 of them lie.
    Pattern,
    /// How wide they are.
    Diameter,
    /// How far apart.
    Pitch,
}

/// All of the study.
#[derive(Clone, Debug, serde::Serialize)]
pub struct Report {
    /// Group by group.
    pub rows: Vec<Row>,
    /// Seed of the noise.
    pub seed: u64,
    /// What was concluded, and how the study went.
    #[serde(flatten)]
    pub course: Course,
}

impl Group {
    /// All of them.
    pub const ALL: [Self; 4] = [Self::Number, Self::Pattern, Self::Diameter, Self::Pitch];

    /// What is varied, for people.
    pub const fn title(self) -> &'static str {
        match self {
            Self::Number => "Number",
            Self::Pattern => "Pattern of 16",
            Self::Diameter => "Diameter, 4 x 4",
            Self::Pitch => "Pitch, 4 x 4",
        }
    }

    fn layouts(self) -> Vec<(Layout, f64)> {
        let usual = |layout| (layout, DIAMETER_M);
        match self {
            Self::Number => [[2, 2], [4, 2], [3, 3], [4, 3], [4, 4], [5, 4], [5, 5], [6, 5], [8, 4]]
                .map(|[columns, rows]| usual(Layout::grid(columns, rows)))
                .to_vec(),
            Self::Pattern => [
                Layout::grid(4, 4),
                Layout::Staggered { columns: 4, rows: 4 },
                Layout::grid(8, 2),
                Layout::Ring { count: 16 },
            ]
            .map(usual)
            .to_vec(),
            Self::Diameter => {
                [1e-3, 2e-3, 4e-3, 6e-3, 8e-3, 12e-3].map(|diameter_m| (Layout::grid(4, 4), diameter_m)).to_vec()
            }
            Self::Pitch => [0.5, 0.6, 0.7, 0.8, 0.9, 1.0, 1.1, 1.2]
                .map(|spread| usual(Layout::Grid { columns: 4, rows: 4, spread }))
                .to_vec(),
        }
    }
}

/// Runs the study.
///
/// # Errors
/// [`DesignError`] if there is no model of a detector.
pub fn run(plan: &Plan, progress: Progress) -> Result<Report, DesignError> {
    let start = Instant::now();
    let tasks: Vec<_> = Group::ALL
        .into_iter()
        .flat_map(|group| group.layouts().into_iter().map(move |(layout, diameter_m)| (group, layout, diameter_m)))
        .collect();
    let computed =
        progress.map("electrodes", &tasks, |(group, layout, diameter_m)| row(*group, *layout, *diameter_m, plan.seed));
    let course = Course::since(start, computed.iter().any(Option::is_none), Vec::new());
    Ok(Report { rows: computed.into_iter().flatten().collect::<Result<_, _>>()?, seed: plan.seed, course })
}

fn row(group: Group, layout: Layout, diameter_m: f64, seed: u64) -> Result<Row, DesignError> {
    let base = Detector::default().taken_as_exact();
    let electrodes = layout.electrodes(base.outline.size_m(), diameter_m / 2.0);
    let detector = Detector { electrodes, ..base };
    let slab = Slab::new(&detector)?;
    let conversions = layout.count().pow(2);
    let noise_v = detector.adc.deviation_v();
    let errors = Errors::of_noise(&detector, noise_v);
    let everywhere = places_everywhere(&slab, &Press::PAPER, COMPARED_S_PER_M, &errors, PLACES)?;
    let contacts = nine_places(&detector).map(|place| Press::PAPER.at(place, COMPARED_S_PER_M));
    let name = match group {
        Group::Diameter => format!("{:.0} mm", diameter_m * 1e3),
        Group::Pitch => match layout {
            Layout::Grid { columns, spread, .. } => {
                format!("{:.1} mm", spread * base_width_m(&detector) / columns as f64 * 1e3)
            }
            _ => layout.name(),
        },
        Group::Number => format!("{}: {}", layout.count(), layout.name()),
        Group::Pattern => layout.name(),
    };
    Ok(Row {
        group,
        name,
        layout,
        diameter_m,
        conversions,
        limit: Limit::of(&slab, &Press::PAPER, COMPARED_S_PER_M, CONDUCTIVITIES_S_PER_M)?,
        everywhere,
        median_in_same_time_m: everywhere
            .map(|spread| spread.median_m * (conversions as f64 / USUAL_CONVERSIONS).sqrt()),
        reached: by_auto(&detector, &contacts, seed)?,
    })
}

fn base_width_m(detector: &Detector) -> f64 {
    detector.outline.size_m()[0]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn more_electrodes_tell_more_and_all_layouts_are_detectors() {
        let of = |layout| row(Group::Number, layout, DIAMETER_M, 1).unwrap();
        let [few, many] = [Layout::grid(3, 3), Layout::grid(5, 5)].map(of);
        let [few_places, many_places] = [&few, &many].map(|row| row.everywhere.unwrap());
        assert!(many_places.rms_m < few_places.rms_m && many_places.median_m < few_places.median_m);
        for spread in [few_places, many_places] {
            assert!(spread.median_m < spread.p90_m && spread.median_m < spread.rms_m, "{spread:?}");
        }
        assert_eq!((few.conversions, many.conversions), (81, 625));
        for (layout, diameter_m) in Group::ALL.into_iter().flat_map(Group::layouts) {
            let base = Detector::default();
            let electrodes = layout.electrodes(base.outline.size_m(), diameter_m / 2.0);
            let detector = Detector { electrodes, ..base };
            assert!(detector.check().is_ok(), "{} {diameter_m}: {:?}", layout.name(), detector.check());
        }
    }
}
