//! A pad that an operating system takes for a touch screen, without any program: its contacts go to a [`ReportSink`] too, whether a host streams or not.

use tactomo_protocol::{ContactCode, ContactFlags, Contacts, Hello, Output, Scope, TablePiece, TableState};

use super::{ContactFinder, TableStore, Touch};
use crate::hid::{Fingers, LAST_PLACE, ReportSink};
use crate::scan::Scanned;

/// A [`ContactFinder`] whose contacts go to `H` as [reports](crate::hid), as soon as it has a table and for as long.
///
/// Until readings at rest are known none are sent: what they are off by might look like a touch. While
/// nothing touches no report is sent. The host of the line can ask for contacts, frames or both meanwhile, but for whole frames only.
#[derive(Debug)]
pub struct Digitizer<S, H, const READINGS: usize> {
    finder: ContactFinder<S, READINGS>,
    sink: H,
    fingers: Fingers,
    /// The detector's corners, while it finds contacts.
    bounds_m: Option<[[f32; 2]; 2]>,
    /// What is streamed. The finder finds contacts all the time.
    output: Output,
}

impl<S: TableStore, H: ReportSink, const READINGS: usize> Digitizer<S, H, READINGS> {
    /// Sends what `finder` finds to `sink`.
    pub const fn new(finder: ContactFinder<S, READINGS>, sink: H) -> Self {
        Self { finder, sink, fingers: Fingers::NONE, bounds_m: None, output: Output::Frames }
    }

    /// Finds contacts by the table that there is, if there is one.
    fn begin(&mut self) {
        self.output = Output::Frames;
        self.bounds_m = if self.finder.set_output(Output::Contacts) { self.finder.bounds_m() } else { None };
        if let Some([low_m, high_m]) = self.bounds_m {
            self.sink.set_size([0, 1].map(|axis: usize| high_m[axis] - low_m[axis]));
        }
    }

    /// Tells what touches in the scan at this time (us), if anything does or did, and if that is known.
    fn report(&mut self, found: Option<&Contacts>, time_us: u64) {
        let known = found.filter(|contacts| !contacts.flags.has(ContactFlags::RESTING));
        let touching: &[ContactCode] = known.map_or(&[], |contacts| &contacts.found);
        let bounds_m = self.bounds_m.unwrap_or_default();
        let places = touching.iter().map(|contact| (contact.id, place(contact.at_m(), bounds_m)));
        self.fingers.follow(places);
        if self.fingers.are_any() && self.sink.send(&self.fingers.report(time_us)) {
            self.fingers.forget_gone();
        }
    }
}

/// Where a place (m) is between the corners, from the left and from the upper edge, as a screen has it.
fn place([x_m, y_m]: [f32; 2], [low_m, high_m]: [[f32; 2]; 2]) -> [u16; 2] {
    let share =
        |part_m: f32, whole_m: f32| (part_m / whole_m * f32::from(LAST_PLACE) + 0.5).min(LAST_PLACE.into()) as u16;
    [share(x_m - low_m[0], high_m[0] - low_m[0]), share(high_m[1] - y_m, high_m[1] - low_m[1])]
}

impl<S: TableStore, H: ReportSink, const READINGS: usize> Touch for Digitizer<S, H, READINGS> {
    fn meet(&mut self, hello: &Hello) {
        self.finder.meet(hello);
        self.begin();
    }

    fn output(&self) -> Output {
        self.output
    }

    fn set_output(&mut self, output: Output) -> bool {
        let can = self.bounds_m.is_some() || !output.has_contacts();
        if can {
            self.output = output;
        }
        can
    }

    fn take(&mut self, piece: &TablePiece) -> bool {
        let before = self.finder.used();
        let fits = self.finder.take(piece);
        // Else what touches goes on touching, and rest stays known.
        if self.finder.used() != before {
            self.begin();
        }
        fits
    }

    fn table(&self) -> TableState {
        self.finder.table()
    }

    fn restart(&mut self) {
        self.finder.restart();
    }

    fn take_broken_wires(&mut self) -> u32 {
        self.finder.take_broken_wires()
    }

    /// As long as there is a table, and until who touches has been told to be away.
    fn needs_frames(&self) -> bool {
        self.bounds_m.is_some() || self.fingers.are_any()
    }

    fn contacts(
        &mut self,
        scanned: &Scanned,
        scope: &Scope,
        readings: &[u16],
        attend: &mut dyn FnMut(),
    ) -> Option<Contacts> {
        let found = self.finder.contacts(scanned, scope, readings, attend);
        self.report(found.as_ref(), scanned.time_us);
        found.filter(|_| self.output.has_contacts())
    }

    fn go_on(&mut self, attend: &mut dyn FnMut()) {
        self.finder.go_on(attend);
    }
}
