//! The commands, one file each: its arguments and what it does.

mod choice;
mod forward;
mod output;
mod ports;
mod validate;

use clap::{Parser, Subcommand};

/// Live pictures of touch from a tomographic tactile sensor, and its simulator.
#[derive(Debug, Parser)]
#[command(version, arg_required_else_help = true)]
pub struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    Forward(Box<forward::Args>),
    Ports(ports::Args),
    Validate(validate::Args),
}

/// Runs the command that was asked for.
pub fn run(cli: Cli) -> anyhow::Result<()> {
    match cli.command {
        Command::Forward(args) => forward::run(&args),
        Command::Ports(args) => ports::run(args),
        Command::Validate(args) => validate::run(&args),
    }
}
