//! Contacts on the board itself: what a board can be asked for beside frames, and how a table comes to it.

mod cells;
mod digitizer;
mod finder;
mod flash;
mod input;
mod rest;
mod store;
mod tables;
#[cfg(test)]
mod tests;

use tactomo_protocol::{Contacts, Hello, Output, Scope, TablePiece, TableState};

pub use self::digitizer::Digitizer;
pub use self::finder::ContactFinder;
pub use self::flash::{FlashStore, RamCopy, View};
pub use self::store::{CHUNK, RamStore, TableStore};
use crate::scan::Scanned;

/// What a board makes of its readings: [`NoTouch`], a [`ContactFinder`], or a [`Digitizer`] around one.
pub trait Touch {
    /// Who the board is; comes once, before all else.
    fn meet(&mut self, hello: &Hello);

    /// What is streamed.
    fn output(&self) -> Output;

    /// Streams this from now on; returns whether it can. If not, it stays as it was. Contacts begin [anew](Self::restart) then, but for those that go elsewhere too.
    fn set_output(&mut self, output: Output) -> bool;

    /// Takes a piece of a table; returns whether it can be part of one that fits the board. The table before is used until the new one is whole.
    fn take(&mut self, piece: &TablePiece) -> bool;

    /// What there is of a table.
    fn table(&self) -> TableState;

    /// Begins anew, as a stream begins: the detector is taken to be at rest.
    fn restart(&mut self);

    /// Whether it needs whole frames, of each scan by itself, though nobody streams: its contacts go elsewhere than to the line.
    fn needs_frames(&self) -> bool {
        false
    }

    /// Electrodes whose wires have turned out to be broken since this was asked last: a bit each.
    fn take_broken_wires(&mut self) -> u32 {
        0
    }

    /// The contacts of a frame, if they are to be streamed: while one before is still worked on, those that were told last. Whoever has something else to do is
    /// called by `attend` meanwhile.
    fn contacts(
        &mut self,
        scanned: &Scanned,
        scope: &Scope,
        readings: &[u16],
        attend: &mut dyn FnMut(),
    ) -> Option<Contacts>;

    /// Does a piece of the work on a frame that is still worked on, if there is one: comes between two rows, and between commands.
    fn go_on(&mut self, _attend: &mut dyn FnMut()) {}
}

/// A board that streams frames and nothing else: takes no memory.
#[derive(Clone, Copy, Debug, Default)]
pub struct NoTouch;

impl Touch for NoTouch {
    fn meet(&mut self, _hello: &Hello) {}

    fn output(&self) -> Output {
        Output::Frames
    }

    fn set_output(&mut self, output: Output) -> bool {
        output == Output::Frames
    }

    fn take(&mut self, piece: &TablePiece) -> bool {
        piece.bytes.is_empty()
    }

    fn table(&self) -> TableState {
        TableState::default()
    }

    fn restart(&mut self) {}

    fn contacts(
        &mut self,
        _scanned: &Scanned,
        _scope: &Scope,
        _readings: &[u16],
        _attend: &mut dyn FnMut(),
    ) -> Option<Contacts> {
        None
    }
}
