//! The commands, one file each: its arguments and what it does.

mod bank;
mod design;
mod learn;
mod live;
mod score;
mod shown;
mod stability;
mod study;
mod tradeoff;
mod validate;

use clap::{Parser, Subcommand};

/// Measures solvers, designs detectors, and learns from presses; `tactomo` is the program for the sensor itself.
#[derive(Debug, Parser)]
#[command(version, arg_required_else_help = true)]
pub struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    Tradeoff(tradeoff::Args),
    Stability(stability::Args),
    Bank(bank::Args),
    Study(study::Args),
    Validate(validate::Args),
    Design(Box<design::Args>),
    Live(live::Args),
    Learn(learn::Args),
    Score(score::Args),
}

/// Runs the command that was asked for.
pub fn run(cli: Cli) -> anyhow::Result<()> {
    match cli.command {
        Command::Tradeoff(args) => tradeoff::run(&args),
        Command::Stability(args) => stability::run(&args),
        Command::Bank(args) => bank::run(&args),
        Command::Study(args) => study::run(&args),
        Command::Validate(args) => validate::run(&args),
        Command::Design(args) => design::run(&args),
        Command::Live(args) => live::run(&args),
        Command::Learn(args) => learn::run(&args),
        Command::Score(args) => score::run(&args),
    }
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory;

    use super::Cli;

    #[test]
    fn every_option_that_takes_a_number_says_what_is_needed() {
        assert_eq!(tactomo_cli::options::untold(Cli::command()), [""; 0]);
    }
}
