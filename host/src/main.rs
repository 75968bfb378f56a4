//! The `tactomo` program.
//!
//! Machine output goes to stdout, everything else to stderr. Exit codes: 0 done, 1 failed, 2 used wrongly.

#![warn(clippy::print_stdout, clippy::print_stderr, reason = "they panic where a pipe is closed; see commands::output")]

mod commands;
mod heap;

use std::io::IsTerminal;
use std::process::ExitCode;

use clap::Parser;

#[global_allocator]
static ALLOCATOR: heap::Counting = heap::Counting;

fn main() -> ExitCode {
    let cli = commands::Cli::parse();
    print_log_on_stderr();
    match commands::run(cli) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            commands::output::print_message(format_args!("error: {error:#}"));
            ExitCode::FAILURE
        }
    }
}

fn print_log_on_stderr() {
    let colours = std::io::stderr().is_terminal();
    tracing_subscriber::fmt()
        .with_writer(|| commands::output::Stderr)
        .with_ansi(colours)
        .with_target(false)
        .without_time()
        .init();
}
