//! `tactomo board`: a new board, from the box to frames.

mod check;
mod elf;
mod firmware;
mod flash;
mod table;

/// Flashes a board, checks it, and gives it a table: from the box to frames, and to contacts.
///
/// Examples:
///   tactomo board flash esp32 --port /dev/ttyUSB0
///   tactomo board check --port /dev/ttyUSB0
///   tactomo board check --simulate --fault open:3
///   tactomo board table --detector my.toml           so that it finds contacts by itself
#[derive(Debug, clap::Args)]
#[command(verbatim_doc_comment)]
pub struct Args {
    #[command(subcommand)]
    action: Action,
}

#[derive(Debug, clap::Subcommand)]
enum Action {
    Check(Box<check::Args>),
    Flash(flash::Args),
    Table(Box<table::Args>),
}

/// Does what is asked.
pub fn run(args: &Args) -> anyhow::Result<()> {
    match &args.action {
        Action::Check(args) => check::run(args),
        Action::Flash(args) => flash::run(args),
        Action::Table(args) => table::run(args),
    }
}
