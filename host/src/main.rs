//! The `tactomo` program.
//!
//! Machine output goes to stdout, everything else to stderr. Exit codes: 0 done, 1 failed, 2 used wrongly.

#![warn(
    clippy::print_stdout,
    clippy::print_stderr,
    reason = "they panic where a pipe is closed; see tactomo_cli::output"
)]

mod commands;

use std::process::ExitCode;

fn main() -> ExitCode {
    let cli = commands::Cli::read();
    tactomo_cli::run(|| commands::run(cli))
}
