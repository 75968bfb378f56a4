//! The `tactomo-lab` program: measurements of solvers, designs of detectors, and what is learned from presses.
//!
//! Machine output goes to stdout, everything else to stderr. Exit codes: 0 done, 1 failed, 2 used wrongly.

#![warn(
    clippy::print_stdout,
    clippy::print_stderr,
    reason = "they panic where a pipe is closed; see tactomo_cli::output"
)]

mod commands;
mod heap;
mod live;

use std::process::ExitCode;

use clap::CommandFactory;

#[global_allocator]
static ALLOCATOR: heap::Counting = heap::Counting;

fn main() -> ExitCode {
    let cli: commands::Cli = tactomo_cli::options::read(commands::Cli::command());
    tactomo_cli::run(|| commands::run(cli))
}
