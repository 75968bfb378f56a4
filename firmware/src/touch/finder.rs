//! Finds contacts in frames, by a table.

use tactomo_protocol::scope::Scope;
use tactomo_protocol::{
    ContactCode, ContactFlags, Contacts, FrameHead, Hello, Output, TableId, TablePiece, TableState,
};
use tactomo_touch_core::{Answer, Contact, Flags, Solver};

use super::cells::Cells;
use super::input::Input;
use super::tables::Tables;
use super::{TableStore, Touch};
use crate::scan::Scanned;

/// Pieces of the work on a frame that are done at once: contacts that are followed rarely take more. What is left, most of a search, is done between rows, a piece each,
/// while commands are obeyed and the scan goes on. Frames that come meanwhile are not looked at.
const AT_ONCE: u32 = 6;

/// Finds contacts by a table that it keeps in `S`, in frames of up to `READINGS` readings.
#[derive(Debug)]
pub struct ContactFinder<S, const READINGS: usize> {
    tables: Tables<S, READINGS>,
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
            tables: Tables::new(store),
            input: Input::NONE,
            output: Output::Frames,
            solver: Solver::patient(),
            cells: Cells::NONE,
            broken_wires: 0,
            last_broken: 0,
            told_broken: 0,
            told: None,
        }
    }

    /// Lowest and highest corner of the detector (m), if there is a table of it.
    pub fn bounds_m(&self) -> Option<[[f32; 2]; 2]> {
        self.tables.table().map(|table| table.bounds_m())
    }

    /// Which table contacts are found by.
    pub(super) fn used(&self) -> Option<TableId> {
        self.tables.used()
    }

    /// Does so many pieces of the work on a frame; `None` if there is nothing to work on.
    fn work(&mut self, pieces: u32, attend: &mut dyn FnMut()) -> Option<()> {
        let Self { tables, solver, cells, .. } = self;
        let table = tables.table()?;
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
}

impl<S: TableStore, const READINGS: usize> Touch for ContactFinder<S, READINGS> {
    fn meet(&mut self, hello: &Hello) {
        self.input = Input::of(hello);
        self.tables.look(&self.input);
    }

    fn output(&self) -> Output {
        self.output
    }

    fn set_output(&mut self, output: Output) -> bool {
        let can = self.used().is_some() || !output.has_contacts();
        if can {
            self.output = output;
            self.restart();
        }
        can
    }

    fn take(&mut self, piece: &TablePiece) -> bool {
        let before = self.used();
        let fits = self.tables.take(piece, &self.input);
        if self.used() != before {
            // Contacts of the new one are asked for anew.
            self.output = Output::Frames;
            self.restart();
        }
        fits
    }

    fn table(&self) -> TableState {
        self.tables.state()
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
            let Self { tables, input, cells, .. } = self;
            cells.take(&tables.table()?, input, (scanned, scope, readings));
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
