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
mod ports;
mod reconstruct;
mod record;
mod recording;
mod replay;
mod scene;
mod source;
mod streams;

use clap::{Parser, Subcommand};

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
    }
}
