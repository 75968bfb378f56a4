//! Finds contacts in frames, by a table.

use tactomo_protocol::scope::Scope;
use tactomo_protocol::{
    ContactCode, ContactFlags, Contacts, FrameHead, Hello, Output, TableId, TablePiece, TableState,
};
use tactomo_touch_core::{Answer, Contact, Flags, Solver, Table};

use super::cells::Cells;
use super::input::Input;
use super::{TableStore, Touch};
use crate::scan::Scanned;

/// A table's drive may be above the board's by so much (V), as rounding to millivolts makes it; what it is below is how far the ground is lifted.
const DRIVE_ROUNDING_V: f32 = 1e-3;

/// Pieces of the work on a frame that are done at once: contacts that are followed rarely take more. What is left, most of a search, is done between rows, a piece each,
/// while commands are obeyed and the scan goes on. Frames that come meanwhile are not looked at.
const AT_ONCE: u32 = 6;

/// Finds contacts by a table that it keeps in `S`, in frames of up to `READINGS` readings.
#[derive(Debug)]
pub struct ContactFinder<S, const READINGS: usize> {
    store: S,
    /// Bytes of the table under way, or of the one in use.
    held: usize,
    usable: Option<TableId>,
    input: Input,
    output: Output,
    solver: Solver,
    cells: Cells<READINGS>,
    /// Electrodes whose wires the last two frames show to be broken, those of the last, and those that were told: a bit each.
    broken_wires: u32,
    last_broken: u32,
    told_broken: u32,
    /// What was told last, if anything was.
    told: Option<Contacts>,
}

impl<S: TableStore, const READINGS: usize> ContactFinder<S, READINGS> {
    /// Uses the table that `store` has kept, if it has one of this board.
    pub const fn new(store: S) -> Self {
        Self {
            store,
            held: 0,
            usable: None,
            input: Input::NONE,
            output: Output::Frames,
            solver: Solver::new(),
            cells: Cells::NONE,
            broken_wires: 0,
            last_broken: 0,
            told_broken: 0,
            told: None,
        }
    }

    /// Lowest and highest corner of the detector (m), if there is a table of it.
    pub fn bounds_m(&self) -> Option<[[f32; 2]; 2]> {
        self.usable?;
        Some(table_in(&self.store, self.held)?.bounds_m())
    }

    /// The table in the store's first bytes, if it is sound and one of this board.
    fn sound(&self, length: usize) -> Option<TableId> {
        let bytes = self.store.bytes().get(..length)?;
        let table = Table::read(bytes).ok()?;
        let fits = table.electrodes() == usize::from(self.input.electrodes)
            && table.electrodes() * table.electrodes() <= READINGS
            && table.head().drive_v <= self.input.drive_v + DRIVE_ROUNDING_V;
        let checksum = u32::from_le_bytes(*bytes.last_chunk()?);
        fits.then_some(TableId { layout: table.layout(), checksum })
    }

    /// Begins a new table, or goes on with the one under way; returns whether it can become one.
    fn write(&mut self, at: usize, bytes: &[u8]) -> bool {
        if at == 0 {
            (self.held, self.usable, self.output) = (0, None, Output::Frames);
        }
        // A piece that came twice, or after one that was lost: the state says where to go on.
        if at != self.held || self.usable.is_some() {
            return true;
        }
        let Some(held) = self.store.write(at, bytes) else { return false };
        self.held = held;
        match self.store.bytes().get(..held).and_then(Table::announced_bytes) {
            Some(length) if length > self.store.bytes().len() || length < held => self.refuse(),
            Some(length) if length == held => self.finish(length),
            _ => true,
        }
    }

    fn finish(&mut self, length: usize) -> bool {
        let Some(table) = self.sound(length) else { return self.refuse() };
        self.usable = Some(table);
        self.store.keep(length)
    }

    /// Does so many pieces of the work on a frame; `None` if there is nothing to work on.
    fn work(&mut self, pieces: u32, attend: &mut dyn FnMut()) -> Option<()> {
        let Self { store, held, solver, cells, .. } = self;
        let table = table_in(store, *held)?;
        let Some(answer) = solver.solve_in_pieces(&table, &cells.touch(&table)?, pieces, attend).ok()? else {
            return Some(());
        };
        self.broken_wires = answer.left_out & self.last_broken;
        self.last_broken = answer.left_out;
        if cells.learn(&answer, &table) {
            // What follows is above rest.
            solver.reset();
        }
        self.told = Some(told(&answer));
        Some(())
    }

    fn refuse(&mut self) -> bool {
        self.held = 0;
        false
    }
}

impl<S: TableStore, const READINGS: usize> Touch for ContactFinder<S, READINGS> {
    fn meet(&mut self, hello: &Hello) {
        self.input = Input::of(hello);
        let length = Table::announced_bytes(self.store.bytes());
        self.usable = length.and_then(|length| self.sound(length));
        self.held = length.filter(|_| self.usable.is_some()).unwrap_or(0);
    }

    fn output(&self) -> Output {
        self.output
    }

    fn set_output(&mut self, output: Output) -> bool {
        let can = self.usable.is_some() || !output.has_contacts();
        if can {
            self.output = output;
            self.restart();
        }
        can
    }

    fn take(&mut self, piece: &TablePiece) -> bool {
        piece.bytes.is_empty() || self.write(piece.at as usize, &piece.bytes)
    }

    fn table(&self) -> TableState {
        let [room, held] = [self.store.bytes().len(), self.held].map(|bytes| bytes as u32);
        TableState { answers: 0, room, held, usable: self.usable }
    }

    fn restart(&mut self) {
        self.solver.reset();
        self.cells.restart();
        self.told_broken = 0;
        self.told = None;
    }

    fn take_broken_wires(&mut self) -> u32 {
        let new = self.broken_wires & !self.told_broken;
        self.told_broken |= new;
        new
    }

    fn contacts(
        &mut self,
        scanned: &Scanned,
        scope: &Scope,
        readings: &[u16],
        attend: &mut dyn FnMut(),
    ) -> Option<Contacts> {
        if !self.output.has_contacts() {
            return None;
        }
        if !self.solver.is_busy() {
            let Self { store, held, input, cells, .. } = self;
            cells.take(&table_in(store, *held)?, input, (scanned, scope, readings));
            self.work(AT_ONCE, attend)?;
        }
        let nothing = || told(&Answer::default());
        let mut contacts = self.told.clone().unwrap_or_else(nothing);
        if self.solver.is_busy() {
            contacts.flags.raise(ContactFlags::MISFIT);
        }
        if !self.cells.knows_rest() {
            contacts.flags.raise(ContactFlags::RESTING);
        }
        Some(contacts)
    }

    fn go_on(&mut self, attend: &mut dyn FnMut()) {
        if self.output.has_contacts() && self.solver.is_busy() {
            let _ = self.work(1, attend);
        }
    }
}

/// The table in a store's first bytes: it was read, and checked, when it came.
fn table_in(store: &impl TableStore, held: usize) -> Option<Table<'_>> {
    Table::read_again(store.bytes().get(..held)?).ok()
}

/// An answer as it is sent.
fn told(answer: &Answer) -> Contacts {
    let mut flags = ContactFlags::default();
    for (found, sent) in [
        (Flags::MORE, ContactFlags::MORE),
        (Flags::MISFIT, ContactFlags::MISFIT),
        (Flags::SATURATED, ContactFlags::SATURATED),
        (Flags::FAULT, ContactFlags::FAULT),
        (Flags::CALIBRATE, ContactFlags::CALIBRATE),
    ] {
        if answer.flags.has(found) {
            flags.raise(sent);
        }
    }
    let code = |contact: &Contact| {
        let [x_m, y_m] = contact.sigma_m;
        let id = (contact.id.wrapping_sub(1) % u32::from(u8::MAX)) as u8 + 1;
        ContactCode::new(id, [contact.x_m, contact.y_m], contact.apparent_conductance_s, x_m.max(y_m))
    };
    Contacts { head: FrameHead::default(), flags, found: answer.contacts().iter().map(code).collect() }
}
