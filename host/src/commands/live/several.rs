//! Several detectors, each with its board, shown together: of a body's file, on ports that are named, or simulated.

use std::fs;
use std::path::Path;

use anyhow::{Context, ensure};
use tactomo::board::identity::port_label;

use super::Args;
use super::body::{self, Patch};
use crate::commands::recording::folder::{self, BODY, EXTENSION};
use crate::commands::streams::StreamArgs;

/// The detectors to show; `None` if it is one.
///
/// # Errors
/// If the body is none, or they cannot be recorded.
pub fn detectors(args: &Args) -> anyhow::Result<Option<Vec<Patch>>> {
    let mut all = match &args.body {
        Some(path) => body::read(path)?,
        None if args.board.boards() > 1 => boards(args)?,
        None => return Ok(None),
    };
    if let Some(folder) = &args.record {
        record(&mut all, folder)?;
    }
    Ok(Some(all))
}

/// Boards on ports, or simulated: each is asked for what the command line asks of all, and has a scene of its own.
fn boards(args: &Args) -> anyhow::Result<Vec<Patch>> {
    let of_one = || Args { streams: StreamArgs::default(), record: None, ..args.clone() };
    let simulated = |k: u8| {
        let mut board = of_one();
        board.board.simulate = Some(1);
        board.board.scene = board.board.scene.later(u64::from(k));
        Patch { name: format!("board-{}", k + 1), place: None, args: board }
    };
    let on_port = |port: &String| {
        let mut board = of_one();
        board.board.ports = vec![port.clone()];
        Patch { name: port_label(port), place: None, args: board }
    };
    let count = args.board.ports.len();
    ensure!(count <= body::MOST, "{count} ports are given, and {} boards can be shown together", body::MOST);
    let ports = args.board.ports.iter().map(on_port);
    let all: Vec<_> = (0..args.board.simulate.unwrap_or(0)).map(simulated).chain(ports).collect();
    for (i, Patch { name, .. }) in all.iter().enumerate() {
        let is_new = all[..i].iter().all(|other| other.name != *name);
        ensure!(is_new, "two boards would be called {name}: name each port once, or give them names with --body");
    }
    Ok(all)
}

/// Has each of them recorded in a folder, which can be shown again as it is.
fn record(all: &mut [Patch], folder: &Path) -> anyhow::Result<()> {
    folder::make(folder).context("the recordings of all go into a new folder")?;
    let mut body = String::new();
    for Patch { name, place, args } in all.iter_mut().filter(|patch| patch.args.replay.is_none()) {
        let file = format!("{name}.{EXTENSION}");
        args.record.get_or_insert_with(|| folder.join(&file));
        let place = place.map_or_else(String::new, |place| format!("place = {place}\n"));
        body += &format!("[[patch]]\nname = \"{name}\"\nreplay = \"{file}\"\n{place}\n");
    }
    let path = folder.join(BODY);
    fs::write(&path, body).with_context(|| format!("cannot write {}", path.display()))
}
