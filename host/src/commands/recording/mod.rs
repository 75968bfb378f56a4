//! `tactomo recording`: what is in recordings, and pieces and sums of them.

pub mod folder;
mod info;

use std::path::{Path, PathBuf};

use anyhow::ensure;
use tactomo::board::record::edit;

use tactomo_cli::options;
use tactomo_cli::output::message;

/// Looks into recordings, cuts pieces out of them and joins them.
///
/// Examples:
///   tactomo recording info touch.tactomo
///   tactomo recording check *.tactomo
///   tactomo recording cut touch.tactomo --from 12 --to 20 --out slip.tactomo
///   tactomo recording merge morning.tactomo noon.tactomo --out day.tactomo
#[derive(Debug, clap::Args)]
#[command(verbatim_doc_comment)]
pub struct Args {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, clap::Subcommand)]
enum Command {
    /// Prints what a recording is of, how long it is, its marks, and what is damaged
    Info {
        /// The recording
        #[arg(value_name = "FILE")]
        file: PathBuf,
        /// Prints `{file, detector, source, started_unix_s, notes, board, electrodes, frames, seconds, frames_per_s, longest_pause_s,
        /// missing_frames, missing_s, corrupt, is_damaged, loss, marks: [{time_s, text}], joined_at_s}` as JSON
        #[arg(long)]
        json: bool,
    },
    /// Reads recordings from end to end and says what is damaged or missing, in frames and seconds; exit code 1 if a file is damaged or cannot be read.
    /// What was lost on the line damages no file, nor does a board that started anew, which is told with the time
    Check {
        /// The recordings
        #[arg(value_name = "FILE", required = true)]
        files: Vec<PathBuf>,
    },
    /// Makes a new recording of a piece of one; of a folder of recordings of several boards, a new folder
    Cut {
        /// The recording
        #[arg(value_name = "FILE")]
        file: PathBuf,
        /// Start of the piece, in seconds since the recording's start [default: the start]
        #[arg(long, value_name = "SECONDS", value_parser = options::time_s())]
        from: Option<f64>,
        /// Its end [default: the end]
        #[arg(long, value_name = "SECONDS", value_parser = options::time_s())]
        to: Option<f64>,
        /// The new recording
        #[arg(long, value_name = "FILE")]
        out: PathBuf,
    },
    /// Makes a new recording of several of one detector, one after the other; of folders, a new folder
    Merge {
        /// The recordings, in their order
        #[arg(value_name = "FILE", required = true, num_args = 2..)]
        files: Vec<PathBuf>,
        /// The new recording
        #[arg(long, value_name = "FILE")]
        out: PathBuf,
    },
}

/// Does what is asked.
pub fn run(args: &Args) -> anyhow::Result<()> {
    match &args.command {
        Command::Info { file, json } => info::print(file, *json),
        Command::Check { files } => info::check(&folder::files(files)?),
        Command::Cut { file, from, to, out } => {
            let (from, to) = (from.unwrap_or(0.0), to.unwrap_or(f64::MAX));
            ensure!(from < to, "--from {from} has to be before --to {to}");
            if file.is_dir() {
                return all_made(&folder::cut(file, from, to, out)?);
            }
            edit::cut(file, from..=to, out)?;
            made(out)
        }
        Command::Merge { files, out } => {
            if files.iter().all(|file| file.is_dir()) {
                return all_made(&folder::merge(files, out)?);
            }
            edit::merge(files, out)?;
            made(out)
        }
    }
}

fn all_made(out: &[PathBuf]) -> anyhow::Result<()> {
    out.iter().try_for_each(|out| made(out))
}

fn made(out: &Path) -> anyhow::Result<()> {
    message!("{}", info::line(out)?);
    Ok(())
}
