//! `tactomo calibrate`: makes a detector on paper the one that was built.

mod force;

/// Fits a detector's description to the detector that was built.
///
/// Each way of calibrating writes a new detector file, for every --detector; none replaces a
/// file.
///
/// Example:
///   tactomo calibrate force scale.csv --detector my.toml --newtons 0.5,1,2,3,5 --out my-newtons.toml
#[derive(Debug, clap::Args)]
#[command(verbatim_doc_comment)]
pub struct Args {
    #[command(subcommand)]
    way: Way,
}

#[derive(Debug, clap::Subcommand)]
enum Way {
    Force(force::Args),
}

/// Calibrates.
pub fn run(args: &Args) -> anyhow::Result<()> {
    match &args.way {
        Way::Force(args) => force::run(args),
    }
}
