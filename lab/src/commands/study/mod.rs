//! `tactomo-lab study`: studies by name; and what these and others share.

mod all;
mod args;
mod bonding;
mod built;
mod contacts;
mod design;
mod electrodes;
mod materials;
mod samples;
mod thickness;

pub use self::args::StudyArgs;
pub use self::design::watched;

/// Studies of detectors, and of how well touch is found.
///
/// Examples:
///   tactomo-lab study materials --out materials.html
///   tactomo-lab study contacts --scenes 60
#[derive(Debug, clap::Args)]
#[command(verbatim_doc_comment)]
pub struct Args {
    #[command(subcommand)]
    study: Study,
}

#[derive(Debug, clap::Subcommand)]
enum Study {
    Built(built::Args),
    Contacts(contacts::Args),
    Materials(materials::Args),
    Thickness(thickness::Args),
    Samples(samples::Args),
    Bonding(bonding::Args),
    Electrodes(electrodes::Args),
    All(all::Args),
}

/// Runs the study that was asked for.
pub fn run(args: &Args) -> anyhow::Result<()> {
    match &args.study {
        Study::Built(args) => built::run(args),
        Study::Contacts(args) => contacts::run(args),
        Study::Materials(args) => materials::run(args),
        Study::Thickness(args) => thickness::run(args),
        Study::Samples(args) => samples::run(args),
        Study::Bonding(args) => bonding::run(args),
        Study::Electrodes(args) => electrodes::run(args),
        Study::All(args) => all::run(args),
    }
}
