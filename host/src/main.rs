//! The `tactomo` program.
//!
//! Machine output goes to stdout, everything else to stderr. Exit codes: 0 done, 1 failed, 2 used wrongly.

#![warn(clippy::print_stdout, clippy::print_stderr, reason = "they panic where a pipe is closed; see commands::output")]

mod commands;
mod heap;
mod log;

use std::process::ExitCode;

use clap::Parser;

#[global_allocator]
static ALLOCATOR: heap::Counting = heap::Counting;

fn main() -> ExitCode {
    let cli = commands::Cli::parse();
    let log = log::Log::begin();
    let ended = commands::run(cli);
    drop(log);
    match ended {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            commands::output::print_message(format_args!("error: {error:#}"));
            ExitCode::FAILURE
        }
    }
}
