//! `tactomo-lab study`: studies by name; and what these and others share.

mod args;
mod built;
mod design;
mod growth;
mod picard;
mod surface;

pub use self::args::StudyArgs;

/// Studies of detectors, and of how well touch is found.
///
/// Examples:
///   tactomo-lab study materials --out materials.html
///   tactomo-lab study surface --quick
#[derive(Debug, clap::Args)]
#[command(verbatim_doc_comment)]
pub struct Args {
    #[command(subcommand)]
    study: Study,
}

#[derive(Debug, clap::Subcommand)]
enum Study {
    Built(built::Args),
    Growth(growth::Args),
    Picard(picard::Args),
    Surface(surface::Args),
    #[command(flatten)]
    Design(design::Study),
}

/// Runs the study that was asked for.
pub fn run(args: &Args) -> anyhow::Result<()> {
    match &args.study {
        Study::Built(args) => built::run(args),
        Study::Growth(args) => growth::run(args),
        Study::Picard(args) => picard::run(args),
        Study::Surface(args) => surface::run(args),
        Study::Design(study) => design::run(study),
    }
}
