//! The commands, one file each: its arguments and what it does.

mod as_built;
mod board;
mod browser;
mod calibrate;
mod detector;
mod export;
mod forward;
mod keep;
mod live;
mod material;
mod ports;
mod reconstruct;
mod record;
mod recording;
mod replay;
mod scene;
mod source;
mod streams;

use std::fmt::Write;

use clap::{CommandFactory, Parser, Subcommand};

/// Shows touch on a tomographic tactile sensor, live, from recordings or simulated.
#[derive(Debug, Parser)]
#[command(version, arg_required_else_help = true)]
pub struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    Live(Box<live::Args>),
    Ports(ports::Args),
    Board(board::Args),
    Record(Box<record::Args>),
    Recording(recording::Args),
    Replay(Box<replay::Args>),
    Export(Box<export::Args>),
    Detector(detector::Args),
    Forward(Box<forward::Args>),
    Reconstruct(reconstruct::Args),
    Calibrate(calibrate::Args),
    Material(Box<material::Args>),
}

/// Commands by what they are for, as `--help` lists them.
const TASKS: [(&str, &[&str]); 5] = [
    ("See", &["live", "replay"]),
    ("Connect", &["ports", "board"]),
    ("Record", &["record", "recording", "export"]),
    ("Calibrate", &["calibrate", "material"]),
    ("Compute", &["reconstruct", "forward", "detector"]),
];

impl Cli {
    /// What was asked for; help and wrong use end the program.
    pub fn read() -> Self {
        tactomo_cli::options::read(Self::by_task())
    }

    /// The commands, with a help that lists them by task.
    fn by_task() -> clap::Command {
        let command = Self::command();
        let mut list = String::new();
        for (task, names) in TASKS {
            let _infallible = writeln!(list, "{task}:");
            for name in names {
                let about = command.find_subcommand(name).and_then(clap::Command::get_about);
                let about = about.map(ToString::to_string).unwrap_or_default();
                let _infallible = writeln!(list, "  {name:12} {about}");
            }
            list.push('\n');
        }
        let after = "`tactomo COMMAND --help` explains one, with examples; `tactomo-lab` measures solvers and designs detectors.";
        command.help_template(format!(
            "{{about}}\n\n{{usage-heading}} {{usage}}\n\n{list}Options:\n{{options}}\n\n{after}"
        ))
    }
}

/// Runs the command that was asked for.
pub fn run(cli: Cli) -> anyhow::Result<()> {
    match cli.command {
        Command::Live(args) => live::run(*args),
        Command::Ports(args) => ports::run(&args),
        Command::Board(args) => board::run(&args),
        Command::Record(args) => record::run(*args),
        Command::Recording(args) => recording::run(&args),
        Command::Replay(args) => replay::run(*args),
        Command::Export(args) => export::run(&args),
        Command::Detector(args) => detector::run(args),
        Command::Forward(args) => forward::run(&args),
        Command::Reconstruct(args) => reconstruct::run(&args),
        Command::Calibrate(args) => calibrate::run(&args),
        Command::Material(args) => material::run(&args),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_option_that_takes_a_number_says_what_is_needed() {
        assert_eq!(tactomo_cli::options::untold(Cli::by_task()), [""; 0]);
    }

    #[test]
    fn help_lists_every_command_once() {
        let command = Cli::by_task();
        command.clone().debug_assert();
        let mut listed: Vec<&str> = TASKS.iter().flat_map(|(_, names)| names.iter().copied()).collect();
        let mut known: Vec<&str> = command.get_subcommands().map(clap::Command::get_name).collect();
        listed.sort_unstable();
        known.sort_unstable();
        assert_eq!(listed, known);
    }
}
