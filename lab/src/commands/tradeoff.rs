//! `tactomo-lab tradeoff`: speed against accuracy of every solver.

use std::path::PathBuf;

use tactomo_physics::detector::Chosen;
use tactomo_study::SceneKind;
use tactomo_study::scanning::{self, Settings};
use tactomo_study::tradeoff::{self, Plan};
use tactomo_study::view::picture as picture_of;

use super::shown::{watched, whole};
use super::study::StudyArgs;
use crate::heap::HEAP;
use tactomo_cli::choice;
use tactomo_cli::output::{self, NewFile, message};

/// Detectors unless others are asked for: the default, a thin narrow one, a large one of 32 electrodes, and a very thin small one.
const DETECTORS: [&str; 4] = ["square-60", "strip-13x60", "display-140x70", "fingertip-10"];

/// Detectors drawn from the tolerances of each: in a quick look, and else.
const DRAWN: [usize; 2] = [1, 4];

/// What touches those in a quick look: a search for a ring or a whole hand on a detector that is not the one described takes `contacts` and `auto` a
/// second or two, half of the time of all else.
const QUICK_DRAWN: [SceneKind; 12] = [
    SceneKind::None,
    SceneKind::Light,
    SceneKind::Firm,
    SceneKind::Hard,
    SceneKind::Edge,
    SceneKind::Corner,
    SceneKind::MovingBall,
    SceneKind::TwoNear,
    SceneKind::TwoFar,
    SceneKind::Three,
    SceneKind::Wide,
    SceneKind::Line,
];

/// Scenes of each number of contacts of --scan: in a quick look, and else.
const SCENES: [usize; 2] = [1, 6];
/// Numbers of contacts of --scan.
const CONTACTS: [usize; 3] = [1, 2, 3];

/// Charts time per frame against error for every solver, on scenes from no touch to a hand.
///
/// Readings are simulated on a finer model than the ones inverted, with the converter's noise
/// and steps; then once more on detectors that are not quite the ones described, before and after a calibration. Takes some minutes, with
/// --quick 20 seconds. Ctrl-C keeps what is done. Let nothing else run meanwhile.
///
/// Examples:
///   tactomo-lab tradeoff --quick --out tradeoff.html
///   tactomo-lab tradeoff --detector square-60 --detector my.toml --json
///   tactomo-lab tradeoff --scan --out scan.html
#[derive(Debug, clap::Args)]
#[command(verbatim_doc_comment)]
pub struct Args {
    /// Detector: name of a preset, or a TOML file; give it again for more [default: four presets, with --quick square-60]
    #[arg(long, value_name = "NAME|FILE")]
    detector: Vec<Chosen>,
    /// Charts frames a second against error instead, for the rows that an ESP32 can scan and send: whole frames, or some grounds
    #[arg(long, conflicts_with_all = ["solver", "frames", "as_built", "calibrate"])]
    scan: bool,
    #[command(flatten)]
    study: StudyArgs,
    /// Writes a page with the first detector's charts only, for a document
    #[arg(long, value_name = "FILE")]
    picture: Option<PathBuf>,
}

/// Runs the study.
pub fn run(args: &Args) -> anyhow::Result<()> {
    if args.scan {
        return scan(args);
    }
    let Args { detector, study, picture, .. } = args;
    let files = study.shown.files()?;
    let picture = NewFile::optional(picture.as_ref())?;
    let [places, frames] = study.places_and_frames(if study.quick { [2, 2] } else { [6, 5] });
    let plan = Plan {
        detectors: choice::detectors(detector, if study.quick { &DETECTORS[..1] } else { &DETECTORS })?,
        methods: study.methods(),
        swept: if study.quick { 1 } else { places },
        places,
        frames,
        seed: study.seed,
        heap: Some(HEAP),
        as_built: study.as_built,
        drawn: if study.quick { DRAWN[0] } else { DRAWN[1] },
        drawn_scenes: if study.quick { QUICK_DRAWN.into() } else { SceneKind::ALL.into() },
        calibrate: study.calibrate(),
    };
    let report = watched(|progress| tradeoff::run(&plan, &output::command_line(), progress))?;
    let view = tradeoff::view(&report);
    picture.map(|picture| picture.write(picture_of(&view))).transpose()?;
    study.shown.put_out(files, &report, &[view])?;
    whole(&report.missing)
}

/// Runs the study of rows.
fn scan(args: &Args) -> anyhow::Result<()> {
    let Args { detector, study, picture, .. } = args;
    anyhow::ensure!(detector.len() <= 1, "--scan is of one detector: give --detector once");
    let files = study.shown.files()?;
    let picture = NewFile::optional(picture.as_ref())?;
    let own = if study.quick { SCENES[0] } else { SCENES[1] };
    let [scenes, _] = study.places_and_frames([own, 0]);
    let detector = choice::detectors(detector, &DETECTORS[..1])?.into_iter().next().unwrap_or_default();
    let settings = Settings { detector, contacts: CONTACTS.to_vec(), scenes, seed: study.seed };
    let report = scanning::run(&settings, &output::command_line(), &mut |step| message!("{step}"))?;
    let view = scanning::view(&report);
    picture.map(|picture| picture.write(picture_of(&view))).transpose()?;
    study.shown.put_out(files, &report, &[view])
}
