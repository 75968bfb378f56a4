//! `tactomo-lab design`: from what is wanted to a detector that can be ordered.

use std::ops::RangeInclusive;
use std::path::PathBuf;
use std::str::FromStr;

use anyhow::{Context, bail, ensure};
use clap::builder::TypedValueParser;
use tactomo_board::inputs::{self, Settling};
use tactomo_board::simulated::BoardModel;
use tactomo_design::search::{self, Board, Material, Plan, Wishes};
use tactomo_physics::detector::{Adc, Chosen, Detector, LENGTH_M, Stack};
use tactomo_study::view::{self, View};

use super::shown::watched;
use tactomo_cli::choice::board_model;
use tactomo_cli::options;
use tactomo_cli::output::{self, NewFile, message};

/// Finds the detector that meets what you want: foams, thicknesses and electrodes.
///
/// Searches all detectors of that size that can be made of the foams at hand, and answers with the
/// few best and why, what is impossible and which wish to relax. The best are rated as built, within
/// their tolerances and read by a board.
/// With --out the best is written as a detector file, ready for `live --simulate --detector`.
///
/// Examples:
///   tactomo-lab design --size 60x60 --largest 3 --two-points 6 --out mine.toml
///   tactomo-lab design --size 13x60 --smallest 0.1 --largest 10 --compare strip-13x60 --page design.html
///   tactomo-lab design --size 60x60 --foams my-foams.toml --choose 3 --out mine.toml
#[derive(Debug, clap::Args)]
#[command(verbatim_doc_comment)]
pub struct Args {
    /// Width and height, mm
    #[arg(long, value_name = "WxH", default_value = "60x60")]
    size: Size,
    /// Smallest force that has to be seen, N
    #[arg(long, value_name = "N", default_value_t = 0.05, value_parser = options::force())]
    smallest: f64,
    /// Largest force that must not saturate it, N
    #[arg(long, value_name = "N", default_value_t = 2.5, value_parser = options::force())]
    largest: f64,
    /// Error of a place, mm: of one frame of a press in the middle of these forces
    #[arg(long, value_name = "MM", default_value_t = 0.5, value_parser = options::tip())]
    place: f64,
    /// Distance of two such presses that have to be told apart, mm [default: a sixth of the shorter side]
    #[arg(long, value_name = "MM", value_parser = options::tip())]
    two_points: Option<f64>,
    /// Frames a second
    #[arg(long, value_name = "NUMBER", default_value_t = 100.0, value_parser = options::number("a rate (frames a second)", 1e-3..=1e6))]
    frames: f64,
    /// Electrodes at most: the channels of the board
    #[arg(long, value_name = "COUNT", default_value_t = 16)]
    electrodes: usize,
    /// Board that reads it, with its noise, the floor of its converter and its frames a second [default: esp32; of more than 16 electrodes ideal]
    #[arg(long, value_name = "BOARD", value_parser = board_model())]
    board: Option<BoardModel>,
    /// Voltage that the multiplexer's ground is lifted to, V: above the board's floor nothing is hidden (docs/hardware.md)
    #[arg(long, value_name = "V", default_value_t = 0.0, value_parser = ground())]
    ground: f64,
    /// Diameter of what presses, mm [default: 5, or a fifth of the shorter side if that is less]
    #[arg(long, value_name = "MM", value_parser = options::tip())]
    tip: Option<f64>,
    /// Foam at hand, one of the paper's, A to D; give it again for more [default: all four]
    #[arg(long, value_name = "A..D", conflicts_with = "foams")]
    foam: Vec<char>,
    /// Foams at hand: a TOML file with a `[[foam]]` for each, of name, conductivity_s_per_m, elasticity_pa and thicknesses_m
    #[arg(long, value_name = "FILE")]
    foams: Option<PathBuf>,
    /// A detector to compare with what is found: a preset, or a TOML file
    #[arg(long, value_name = "NAME|FILE")]
    compare: Option<Chosen>,
    /// Foam, or stack with the upper one first, that is compared in place of what that is made of
    #[arg(long, value_name = "A..D|STACK", requires = "compare")]
    material: Option<Stack>,
    /// Candidates that are tried at most
    #[arg(long = "try", value_name = "COUNT", default_value_t = 3000, value_parser = clap::value_parser!(u32).range(1..))]
    most: u32,
    /// Which of the choices is written
    #[arg(long, value_name = "NUMBER", default_value_t = 1, requires = "out", value_parser = clap::value_parser!(u8).range(1..))]
    choose: u8,
    /// Writes the choice as a detector file
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Writes a page with charts of all that can be had, which needs nothing else
    #[arg(long, value_name = "FILE")]
    page: Option<PathBuf>,
    /// Seed of the search: the same seed gives the same answer
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Prints the answer as JSON
    #[arg(long)]
    json: bool,
}

/// Sides that differ by less than this share are the same.
const SAME_SIZE: f64 = 0.01;

/// Width and height (m).
#[derive(Clone, Copy, Debug)]
struct Size([f64; 2]);

impl FromStr for Size {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let sides = text.split_once('x').ok_or("width and height in millimetres are needed, as in 60x60")?;
        let range_mm = 1e3 * LENGTH_M.start()..=1e3 * LENGTH_M.end();
        let side_m = |side: &str| options::number_in(side, "a side (mm)", &range_mm).map(|side_mm| 1e-3 * side_mm);
        Ok(Self([side_m(sides.0)?, side_m(sides.1)?]))
    }
}

/// A detector of another size meets other wishes.
fn check_size(detector: &Detector, size_m: [f64; 2]) -> anyhow::Result<()> {
    let own_m = detector.outline.size_m();
    let is_same = own_m.iter().zip(size_m).all(|(own, wished)| (own / wished - 1.0).abs() < SAME_SIZE);
    let [own, wished] = [own_m, size_m].map(|size| size.map(|metres| format!("{:.4}", metres * 1e3)));
    let text = |size: &[String; 2]| size.each_ref().map(|mm| mm.trim_end_matches('0').trim_end_matches('.')).join("x");
    ensure!(
        is_same,
        "--compare {}: it is {} mm, and {} mm is wished: give --size {}, or compare a detector of that size",
        detector.name,
        text(&own),
        text(&wished),
        text(&own)
    );
    Ok(())
}

/// Searches and answers.
pub fn run(args: &Args) -> anyhow::Result<()> {
    let plan = args.plan()?;
    if let Some(page) = args.out.as_ref().filter(|path| path.extension().is_some_and(|ending| ending == "html")) {
        bail!("--out {0}: the choice is written as a detector file, in TOML; for a page, --page {0}", page.display());
    }
    let file = NewFile::optional(args.out.as_ref())?;
    let page = NewFile::optional(args.page.as_ref())?;
    let answer = watched(|progress| search::answer(&plan, progress))?;
    let view = search::view(&answer);
    page.map(|page| page.write(view::page(std::slice::from_ref(&view), &output::command_line()))).transpose()?;
    let settling = answer.choices.iter().map(|choice| settlings(&choice.detector)).collect();
    let output = Output { answer: &answer, settling };
    output::print(&if args.json { serde_json::to_string(&output)? } else { output.text(view) })?;
    if let (Some(file), Some(path)) = (file, &args.out) {
        let index = usize::from(args.choose) - 1;
        let toml = answer.toml(index).with_context(|| {
            format!("there is no choice {}; there are {} of them", args.choose, answer.choices.len())
        })?;
        file.write(toml)?;
        message!("choice {} is written: tactomo live --simulate --detector {}", args.choose, path.display());
    }
    Ok(())
}

/// Voltages that a ground can be lifted to: half of the drive is left at least.
const GROUNDS_V: RangeInclusive<f64> = 0.0..=1.2;

/// Parses a voltage that the ground is lifted to.
pub(super) fn ground() -> impl TypedValueParser<Value = f64> {
    options::number("a voltage (V)", GROUNDS_V)
}

/// The board that is named, or the usual one for so many electrodes, with its ground lifted so far (V).
pub(super) fn board_for(electrodes: usize, named: Option<BoardModel>, ground_v: f64) -> Board {
    let is_usual = electrodes <= BoardModel::Esp32.most_electrodes();
    let model = named.unwrap_or(if is_usual { BoardModel::Esp32 } else { BoardModel::Ideal });
    let (converters, inputs) = model.converters();
    Board {
        name: model.name().to_owned(),
        adc: model.adc(Adc::default()),
        ground_v,
        frames_per_s: (1..=inputs.len()).map(|electrodes| model.frames_per_s(electrodes)).collect(),
        converters,
        inputs,
    }
}

/// What is printed: the answer, and how boards as they are after a reset suit the pads of each choice.
#[derive(serde::Serialize)]
struct Output<'a> {
    #[serde(flatten)]
    answer: &'a search::Answer,
    settling: Vec<Vec<Settling>>,
}

/// How each board, with the settings that it has after a reset, suits the pads of a detector.
fn settlings(detector: &Detector) -> Vec<Settling> {
    let pad_ohm = detector.largest_pad_ohm();
    inputs::BOARDS.iter().filter_map(|board| inputs::settling(board.board, &board.after_reset(), pad_ohm)).collect()
}

impl Output<'_> {
    /// The answer as a table, and what the boards need that do not suit.
    fn text(&self, mut shown: View) -> String {
        for (choice, settlings) in (1..).zip(&self.settling) {
            let unsuited = settlings.iter().filter(|settling| !settling.suits);
            shown = unsuited.fold(shown, |shown, settling| shown.text(format!("choice {choice}: {settling}")));
        }
        view::text(&[shown])
    }
}

impl Args {
    fn plan(&self) -> anyhow::Result<Plan> {
        let Size(size_m) = self.size;
        let side_m = size_m[0].min(size_m[1]);
        let wishes = Wishes {
            size_m,
            smallest_n: self.smallest,
            largest_n: self.largest,
            place_m: self.place * 1e-3,
            two_points_m: self.two_points.map_or(side_m / 6.0, |mm| mm * 1e-3),
            frames_per_s: self.frames,
            electrodes: self.electrodes,
            tip_m: self.tip.map_or((5e-3_f64).min(side_m / 5.0), |mm| mm * 1e-3) / 2.0,
            board: board_for(self.electrodes, self.board, self.ground),
        };
        wishes.check()?;
        let compared = match &self.compare {
            Some(chosen) => {
                let detector = chosen.get()?;
                check_size(&detector, size_m)?;
                Some(match &self.material {
                    Some(stack) => detector.in_material(stack)?,
                    None => detector,
                })
            }
            None => None,
        };
        Ok(Plan { wishes, foams: self.foams()?, most: self.most as usize, compared, seed: self.seed })
    }

    fn foams(&self) -> anyhow::Result<Vec<Material>> {
        if let Some(path) = &self.foams {
            return Ok(Material::read(path)?);
        }
        let all = Material::of_paper();
        if self.foam.is_empty() {
            return Ok(all);
        }
        let of = |letter: &char| {
            let found = all.iter().find(|foam| foam.name == letter.to_string()).cloned();
            found.with_context(|| {
                format!("there is no foam {letter}: A, B, C and D are known; others go into a file for --foams")
            })
        };
        self.foam.iter().map(of).collect()
    }
}
