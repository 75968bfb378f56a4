//! Contacts that a board finds by itself, with their readings or without.

use std::time::Instant;

use tactomo_board::frames::FoundByBoard;
use tactomo_physics::readings::Readings;
use tactomo_protocol::{Contacts, Output};

use super::Reader;
use crate::run::connection::Connection;
use crate::run::found;
use crate::run::frame::{Arrival, Frame};
use crate::run::inbox::{Found, Taken};

impl Reader {
    /// Takes contacts that the board has found; where their readings come too, these bring them along.
    pub(super) fn contacts(&mut self, connection: &mut Connection, contacts: Contacts, received: Instant) {
        let (Some(board), Some(_)) = (&self.board, connection.junk) else { return };
        if !connection.answers && board.detector.force.is_some() {
            self.options.table.compile_once(&board.detector);
        }
        connection.session.contacts(received);
        connection.landed();
        match self.options.output {
            Output::Contacts => self.contacts_alone(connection, &contacts, received),
            Output::Frames if connection.answers => {}
            // Of a recording nobody knows whether readings follow before something else does.
            Output::Frames | Output::Both => {
                self.take_found_alone(connection, received);
                self.found = Some(contacts);
            }
        }
    }

    /// Takes contacts whose readings have not come.
    pub(super) fn take_found_alone(&mut self, connection: &mut Connection, received: Instant) {
        if let Some(contacts) = self.found.take() {
            self.contacts_alone(connection, &contacts, received);
        }
    }

    fn contacts_alone(&mut self, connection: &mut Connection, contacts: &Contacts, received: Instant) {
        let Some(board) = &self.board else { return };
        let place = self.sequence.place(&contacts.head);
        self.frames_lost += place.dropped;
        self.notice.count(|meter| meter.frame(received, &contacts.head, place.dropped));
        if !self.follows {
            return;
        }
        let nothing = Readings::from_fn(board.hello.electrodes.into(), |_, _| 0.0).hiding(|_, _| true);
        let first = Frame::first(nothing.clone(), nothing, Arrival::at(received));
        let frame = Frame {
            sequence: place.sequence,
            board_time_us: place.time_us,
            delay: connection.session.delay(contacts.head.time_us, received),
            status: contacts.head.status,
            lost: self.frames_lost,
            ..first
        };
        let found = self.found_on_board(contacts, false);
        self.inbox.put_frame(Taken::new(frame, Vec::new(), Some(found)), board.noise_v);
    }

    pub(super) fn found_on_board(&self, contacts: &Contacts, has_readings: bool) -> Found {
        let by_board = FoundByBoard { contacts: contacts.clone(), broken_wires: self.broken_wires };
        let mut found = found::found(&by_board, has_readings);
        if let Some(law) = &self.options.detector.force {
            self.options.table.add_newtons(law, &mut found.solution.contacts);
        }
        found
    }
}
