//! `tactomo-lab study materials` and the other studies of detectors.

use anyhow::ensure;
use serde::Serialize;
use tactomo_design::search::Material;
use tactomo_design::{
    DesignError, Progress, bonding, electrodes, explain, materials, overview, promises, samples, thickness,
};
use tactomo_study::view::View;
use tactomo_touch::solve::Method;

use super::super::design::{board_for, ground};
use super::super::shown::{Shown, watched};
use tactomo_cli::choice;

/// Conductivities on a side of the paper's map.
const SIDE: usize = 11;

/// Studies of detectors.
#[derive(Debug, clap::Subcommand)]
pub enum Study {
    /// Maps what the conductivities of a detector's bottom and top do: the paper's figures 2 and 3.
    ///
    /// A slab of 60 x 60 x 10 mm with 16 electrodes, conductivities from 0.001 to 100 S/m at the
    /// bottom and at the top, and the paper's foams and stacks among them: sensitivity, maximum
    /// force, spatial resolution and position accuracy with the paper's solver, and beside them the
    /// limits of the sensor itself. Says of each of the paper's conclusions whether it holds.
    ///
    /// Examples:
    ///   tactomo-lab study materials --out materials.html
    ///   tactomo-lab study materials --side 101 --csv materials.csv
    #[command(verbatim_doc_comment)]
    Materials {
        /// Conductivities on each side of the map: 11 are the paper's
        #[arg(long, default_value_t = SIDE as u16, value_parser = clap::value_parser!(u16).range(2..=301))]
        side: u16,
        /// Has `auto` find presses on all of the map, not on the foams alone; takes some ten seconds more
        #[arg(long)]
        auto: bool,
        #[command(flatten)]
        args: Seeded,
    },
    /// Compares detectors of 1 to 16 mm with the thin shell that the paper's solver takes them for: its figure 4.
    ///
    /// Correlation of the readings, largest reading, mean absolute error; and of each solver the
    /// error where it takes the detector for a shell, and where it inverts the slab.
    ///
    /// Examples:
    ///   tactomo-lab study thickness --out thickness.html
    ///   tactomo-lab study thickness --solver contacts --solver tikhonov --json
    #[command(verbatim_doc_comment)]
    Thickness {
        /// Solver to try; give it again for more [default: all but auto, which makes of single contacts what `contacts` does]
        #[arg(long, value_name = "NAME", value_parser = choice::method(), hide_possible_values = true)]
        solver: Vec<Method>,
        #[command(flatten)]
        args: Seeded,
    },
    /// Simulates the paper's foams A to D and their stacks as it measured them, with its figures beside: tables I and II.
    ///
    /// Nine places, an indenter of 5 mm, 0 to 5 N up and down; curves of output over force with eq.
    /// (6) fitted, line profiles, places seen at 2.25 N; and whether the simulation puts the
    /// samples in the order that was measured.
    ///
    /// Examples:
    ///   tactomo-lab study samples --out samples.html
    ///   tactomo-lab study samples --json
    #[command(verbatim_doc_comment)]
    Samples(Seeded),
    /// Explains why the paper's table II differs from ideal foams: laws of contact, and causes one at a time.
    ///
    /// Laws of how a contact conducts under force are fitted to the four single foams, and have to
    /// predict the seven stacks. Then what each cause explains of sensitivity, maximum force, spatial
    /// resolution and position accuracy: the law, eq. (8) as printed, tolerances, rubber on the
    /// contactor, unloading, the image and its lambda, noise, the converter's floor.
    ///
    /// Examples:
    ///   tactomo-lab study explain --out explain.html
    ///   tactomo-lab study explain --json
    #[command(verbatim_doc_comment)]
    Explain(Seeded),
    /// Joins two layers of sample B by 5 x 5 and 7 x 7 dots of conductive glue, from 1 mm to dots that touch: figure 7.
    ///
    /// Errors of places with the paper's solver and the limit of the sensor itself over the dots'
    /// diameter, and the current through each dot.
    ///
    /// Examples:
    ///   tactomo-lab study bonding --out bonding.html
    ///   tactomo-lab study bonding --json
    #[command(verbatim_doc_comment)]
    Bonding(Shown),
    /// Compares electrodes: 4 to 32 of them, grids, a ring around the edge, diameters and pitches.
    ///
    /// What the sensor itself can tell with them of places, two points and strengths, with one frame and in the
    /// same time, and what `auto` reaches, on the paper's sample A of 60 x 60 x 5 mm.
    ///
    /// Examples:
    ///   tactomo-lab study electrodes --out electrodes.html
    ///   tactomo-lab study electrodes --csv electrodes.csv
    #[command(verbatim_doc_comment)]
    Electrodes(Seeded),
    /// Holds what `design` promises against what is found: five wishes, from a fingertip to a seat.
    ///
    /// A detector is searched for each wish, built five times within its tolerances, read by a chip
    /// of the board and pressed; `auto` knows its description and one frame. Beside each stands an even
    /// grid of 4 x 4 electrodes on foam A.
    ///
    /// Examples:
    ///   tactomo-lab study promises --out promises.html
    ///   tactomo-lab study promises --wish strip --try 300 --json
    #[command(verbatim_doc_comment)]
    Promises {
        /// Wishes whose names have this in them [default: all five]
        #[arg(long, value_name = "TEXT", default_value = "", hide_default_value = true)]
        wish: String,
        /// Voltage that the multiplexer's ground is lifted to, V: above the board's floor nothing is hidden (docs/hardware.md)
        #[arg(long, value_name = "V", default_value_t = 0.0, value_parser = ground())]
        ground: f64,
        /// Candidates that each search tries at most
        #[arg(long = "try", value_name = "COUNT", default_value_t = 3000, value_parser = clap::value_parser!(u32).range(1..))]
        most: u32,
        /// Detectors as built of each
        #[arg(long, value_name = "COUNT", default_value_t = 5, value_parser = clap::value_parser!(u8).range(1..))]
        built: u8,
        /// Presses of each of these
        #[arg(long, value_name = "COUNT", default_value_t = 20, value_parser = clap::value_parser!(u16).range(1..))]
        presses: u16,
        #[command(flatten)]
        args: Seeded,
    },
    /// All studies of detectors, on one page: what of the paper holds, and what of it belongs to its solver.
    ///
    /// Examples:
    ///   tactomo-lab study all --out detectors.html
    ///   tactomo-lab study all --json
    #[command(verbatim_doc_comment)]
    All(Seeded),
}

/// What noise there is, and where what is found goes.
#[derive(Debug, clap::Args)]
pub struct Seeded {
    /// Seed of the noise: the same seed gives the same figures
    #[arg(long, default_value_t = 1)]
    seed: u64,
    #[command(flatten)]
    shown: Shown,
}

/// What all of them found, by their names.
#[derive(Serialize)]
struct All {
    materials: materials::Report,
    thickness: thickness::Report,
    samples: samples::Report,
    explain: explain::Report,
    bonding: bonding::Report,
    electrodes: electrodes::Report,
}

impl All {
    fn run(seed: u64, progress: Progress) -> Result<Self, DesignError> {
        Ok(Self {
            materials: materials::run(&materials::Plan { side: SIDE, reached: false, seed }, progress)?,
            thickness: thickness::run(&thickness::Plan { methods: thickness::methods(), seed }, progress)?,
            samples: samples::run(&samples::Plan { seed }, progress)?,
            explain: explain::run(&explain::Plan { seed }, progress)?,
            bonding: bonding::run(progress)?,
            electrodes: electrodes::run(&electrodes::Plan { seed }, progress)?,
        })
    }

    fn views(&self) -> Vec<View> {
        let mut views = vec![
            materials::view(&self.materials),
            thickness::view(&self.thickness),
            samples::view(&self.samples),
            explain::view(&self.explain),
            bonding::view(&self.bonding),
            electrodes::view(&self.electrodes),
        ];
        overview(&mut views);
        views
    }
}

/// Runs the study that was asked for.
pub fn run(study: &Study) -> anyhow::Result<()> {
    match study {
        Study::Materials { side, auto, args: Seeded { seed, shown } } => {
            let plan = materials::Plan { side: usize::from(*side), reached: *auto, seed: *seed };
            found(shown, |progress| materials::run(&plan, progress), |report| vec![materials::view(report)])
        }
        Study::Thickness { solver, args: Seeded { seed, shown } } => {
            let methods = if solver.is_empty() { thickness::methods() } else { solver.clone() };
            let plan = thickness::Plan { methods, seed: *seed };
            found(shown, |progress| thickness::run(&plan, progress), |report| vec![thickness::view(report)])
        }
        Study::Samples(Seeded { seed, shown }) => {
            let plan = samples::Plan { seed: *seed };
            found(shown, |progress| samples::run(&plan, progress), |report| vec![samples::view(report)])
        }
        Study::Explain(Seeded { seed, shown }) => {
            let plan = explain::Plan { seed: *seed };
            found(shown, |progress| explain::run(&plan, progress), |report| vec![explain::view(report)])
        }
        Study::Bonding(shown) => found(shown, bonding::run, |report| vec![bonding::view(report)]),
        Study::Electrodes(Seeded { seed, shown }) => {
            let plan = electrodes::Plan { seed: *seed };
            found(shown, |progress| electrodes::run(&plan, progress), |report| vec![electrodes::view(report)])
        }
        Study::Promises { wish, ground, most, built, presses, args: Seeded { seed, shown } } => {
            let mut wanted = promises::wanted(|electrodes| board_for(electrodes, None, *ground));
            let names = wanted.iter().map(|wanted| wanted.name.as_str()).collect::<Vec<_>>().join(", ");
            wanted.retain(|wanted| wanted.name.contains(wish.as_str()));
            ensure!(!wanted.is_empty(), "--wish {wish} is in none of {names}");
            let plan = promises::Plan {
                wanted,
                foams: Material::of_paper(),
                most: *most as usize,
                built: u64::from(*built),
                presses: usize::from(*presses),
                seed: *seed,
            };
            found(shown, |progress| promises::run(&plan, progress), |report| vec![promises::view(report)])
        }
        Study::All(Seeded { seed, shown }) => found(shown, |progress| All::run(*seed, progress), All::views),
    }
}

/// Runs a study on all cores, tells how far it is, and puts out what it found; Ctrl-C keeps what is done.
fn found<R: Serialize>(
    shown: &Shown,
    run: impl FnOnce(Progress) -> Result<R, DesignError>,
    views: impl FnOnce(&R) -> Vec<View>,
) -> anyhow::Result<()> {
    let files = shown.files()?;
    let found = watched(run)?;
    shown.put_out(files, &found, &views(&found))
}
