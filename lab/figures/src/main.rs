//! Every number, chart, picture and film of the documents, from one command: `cargo run --release -p tactomo-figures`.
//!
//! `lab/figures/README.md` says how a figure is added and how a number is marked.

mod browser;
mod check;
mod figure;
mod film;
mod find;
mod job;
mod live;
mod marks;
mod palette;
mod picture;
mod png;
mod store;
mod table;
mod take;

use std::process::ExitCode;

use clap::Parser;

/// What a person types.
pub const COMMAND: &str = "cargo run --release -p tactomo-figures";

/// Takes the figures, charts, pictures and films of the documents, writes docs/figures.json, and the numbers that are marked in the documents.
///
/// Without IDs everything is taken, in some 20 minutes of two cores; let nothing else run meanwhile, or times mean nothing.
#[derive(Debug, Parser)]
#[command(version)]
struct Args {
    /// What to take: figures, runs or pictures by their ids, or the beginning of ids with a `*` behind it
    #[arg(value_name = "ID")]
    ids: Vec<String>,
    /// Lists all ids and takes nothing
    #[arg(long, conflicts_with_all = ["ids", "check"])]
    list: bool,
    /// Takes figures alone, no pictures or films: no browser is needed
    #[arg(long, conflicts_with = "check")]
    no_pictures: bool,
    /// Changes nothing: fails where a number in the documents is not the one in docs/figures.json, where a figure that does not depend on the
    /// machine has moved by more than its spread (those of quick runs), or where a picture or film is older than what it shows
    #[arg(long)]
    check: bool,
    /// Checks the figures of slow runs too
    #[arg(long, requires = "check")]
    all: bool,
    /// Checks what is written only, and takes no figure again
    #[arg(long, requires = "check", conflicts_with = "all")]
    written: bool,
}

fn main() -> ExitCode {
    let args = Args::parse();
    let done = if args.list {
        take::list();
        Ok(())
    } else if args.check {
        check::run(&args.ids, args.all, args.written)
    } else {
        take::run(&args.ids, !args.no_pictures)
    };
    match done {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error:#}");
            ExitCode::FAILURE
        }
    }
}
