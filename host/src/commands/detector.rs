//! `tactomo detector`: which detectors there are, what one is, whether a file is one, and its table for a board.

use std::path::{Path, PathBuf};

use serde::Serialize;
use tactomo::detector::{Chosen, Detector, FOAMS, Foam, Stack, short};
use tactomo::solve::{self, Problem};

use super::as_built::AsBuiltArgs;
use tactomo_cli::choice::DetectorArgs;
use tactomo_cli::output::{self, NewFile, message};

/// Lists, shows, checks and compiles detectors.
///
/// Examples:
///   tactomo detector list
///   tactomo detector show square-60 --material BC --svg square.svg
///   tactomo detector show square-60 --toml          a file to start from
///   tactomo detector show square-60 --as-built 7    a file of one that may have been built by this description
///   tactomo detector check my.toml
///   tactomo detector compile my.toml --out my.table    for a board that finds contacts by itself
#[derive(Debug, clap::Args)]
#[command(verbatim_doc_comment)]
pub struct Args {
    #[command(subcommand)]
    action: Action,
}

#[derive(Debug, clap::Subcommand)]
enum Action {
    /// Lists the presets, and the foams for `--material`
    List {
        /// Prints `{detectors, foams}` as JSON
        #[arg(long)]
        json: bool,
    },
    /// Shows a detector
    Show(ShowArgs),
    /// Checks detector files
    Check {
        /// TOML files
        #[arg(required = true, value_name = "FILE")]
        files: Vec<PathBuf>,
    },
    /// Writes the table from which a board finds up to three contacts by itself
    Compile(CompileArgs),
}

#[derive(Debug, clap::Args)]
struct CompileArgs {
    /// Name of a preset, or a TOML file; one that was calibrated gives better contacts
    #[arg(value_name = "NAME|FILE", default_value = Detector::DEFAULT)]
    detector: Chosen,
    /// Foam of the detector, A to D, or a stack of foams with the upper one first, such as BC or, joined by dots of glue, BB-5x5
    #[arg(long, value_name = "A..D|STACK")]
    material: Option<Stack>,
    /// Writes the table there
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
    /// Prints `{detector, file, bytes, electrodes}` as JSON
    #[arg(long)]
    json: bool,
}

#[derive(Serialize)]
struct Compiled<'a> {
    detector: &'a str,
    file: &'a Path,
    bytes: usize,
    electrodes: usize,
}

#[derive(Debug, clap::Args)]
struct ShowArgs {
    /// Name of a preset, or a TOML file
    #[arg(value_name = "NAME|FILE", default_value = Detector::DEFAULT)]
    detector: Chosen,
    /// Foam of the detector, A to D, or a stack of foams with the upper one first, such as BC or, joined by dots of glue, BB-5x5
    #[arg(long, value_name = "A..D|STACK")]
    material: Option<Stack>,
    #[command(flatten)]
    as_built: AsBuiltArgs,
    /// Draws it into an SVG file
    #[arg(long, value_name = "FILE")]
    svg: Option<PathBuf>,
    /// Prints it as a TOML file
    #[arg(long, conflicts_with = "json")]
    toml: bool,
    /// Prints it as JSON
    #[arg(long)]
    json: bool,
}

#[derive(Serialize)]
struct List {
    detectors: Vec<Detector>,
    foams: [Foam; 4],
}

/// Does what is asked.
pub fn run(args: Args) -> anyhow::Result<()> {
    match args.action {
        Action::List { json } => list(json),
        Action::Show(args) => show(args),
        Action::Compile(args) => compile(args),
        Action::Check { files } => files.iter().try_for_each(|file| {
            let detector = Detector::read(file)?;
            Ok(output::print(&format!("{}: {}, {}", file.display(), detector.name, detector.summary()))?)
        }),
    }
}

fn compile(args: CompileArgs) -> anyhow::Result<()> {
    let out = NewFile::new(&args.out)?;
    let detector = DetectorArgs { detector: Some(args.detector), material: args.material }.get()?;
    let bytes = solve::compile(&Problem::of(&detector)?)?;
    out.write(&bytes)?;
    let (name, electrodes) = (&detector.name, detector.electrodes.len());
    message!("compiled {name} into {}: {} bytes for {electrodes} electrodes", args.out.display(), bytes.len());
    if args.json {
        let told = Compiled { detector: name, file: &args.out, bytes: bytes.len(), electrodes };
        output::print(&serde_json::to_string(&told)?)?;
    }
    Ok(())
}

fn list(json: bool) -> anyhow::Result<()> {
    let list = List { detectors: Detector::preset_names().filter_map(Detector::preset).collect(), foams: FOAMS };
    let text = if json { serde_json::to_string(&list)? } else { table(&list) };
    Ok(output::print(&text)?)
}

fn table(list: &List) -> String {
    let detectors = list.detectors.iter().map(|detector| format!("{:<16} {}", detector.name, detector.summary()));
    let foams = list.foams.iter().map(|foam| {
        let Foam { letter, product, conductivity_s_per_m, elasticity_pa } = foam;
        let [conductivity, elasticity] = [*conductivity_s_per_m, elasticity_pa * 1e-6].map(short);
        format!("{letter}  {product:<22} {conductivity:>9} S/m {elasticity:>6} MPa")
    });
    let mut lines = vec!["detectors, in foam A or in the foams of their name:".to_owned()];
    lines.extend(detectors);
    lines.push(
        "\nfoams for --material, alone or stacked with the upper one first, as in BC, or joined by dots, as in BC-5x5:"
            .to_owned(),
    );
    lines.extend(foams);
    lines.join("\n")
}

fn show(args: ShowArgs) -> anyhow::Result<()> {
    let described = DetectorArgs { detector: Some(args.detector), material: args.material }.get()?;
    let detector = args.as_built.of(&described)?;
    if let Some(path) = &args.svg {
        NewFile::new(path)?.write(detector.to_svg())?;
        message!("drew {} in {}", detector.name, path.display());
    }
    // What was built is for a machine to use.
    let toml = args.toml || args.as_built.is_given() && !args.json && args.svg.is_none();
    let text = match (toml, args.json) {
        (true, _) => detector.to_toml().trim_end().to_owned(),
        (_, true) => serde_json::to_string(&*detector)?,
        _ if args.svg.is_some() => return Ok(()),
        _ => description(&detector),
    };
    Ok(output::print(&text)?)
}

fn description(detector: &Detector) -> String {
    let mut lines = vec![format!("{}: {}", detector.name, detector.summary())];
    lines.push("layers, the top one first:".to_owned());
    lines.extend(detector.layers.iter().rev().map(|layer| format!("  {}", layer.summary())));
    lines.extend(detector.facts().into_iter().map(|(what, value)| format!("{what}: {value}")));
    let axes = if detector.surface.is_some() { 3 } else { 2 };
    lines.push(format!("electrodes, {} in mm from the middle:", ["x and y", "x, y and z"][axes - 2]));
    let place = |(channel, pad): (usize, &tactomo::detector::Electrode)| {
        let numbers = pad.place_m().into_iter().take(axes).map(|at_m| format!(" {:>8}", short(at_m * 1e3)));
        format!("  {channel:>2}{}", numbers.collect::<String>())
    };
    lines.extend(detector.electrodes.iter().enumerate().map(place));
    lines.join("\n")
}
