//! `tactomo board`: a new board, from the box to frames.

mod check;
mod elf;
mod firmware;
mod flash;

/// Flashes a board and checks it: from the box to frames.
///
/// Examples:
///   tactomo board flash esp32 --port /dev/ttyUSB0
///   tactomo board check --port /dev/ttyUSB0
///   tactomo board check --simulate --fault open:3
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
}

/// Does what is asked.
pub fn run(args: &Args) -> anyhow::Result<()> {
    match &args.action {
        Action::Check(args) => check::run(args),
        Action::Flash(args) => flash::run(args),
    }
}
