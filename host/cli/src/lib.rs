//! What `tactomo` and `tactomo-lab` share on the command line: how it is read, arguments for detectors and solvers, messages and progress, files
//! that replace no other, the log, and Ctrl-C.

#![warn(
    clippy::print_stdout,
    clippy::print_stderr,
    reason = "they panic where a pipe is closed; see the module output"
)]

pub mod choice;
pub mod interrupt;
pub mod log;
pub mod options;
pub mod output;

use std::process::ExitCode;

/// Runs a command with the log on stderr. What it fails of is printed with its causes.
pub fn run(command: impl FnOnce() -> anyhow::Result<()>) -> ExitCode {
    let log = log::Log::begin();
    let ended = command();
    drop(log);
    match ended {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            output::print_message(format_args!("error: {error:#}"));
            ExitCode::FAILURE
        }
    }
}
