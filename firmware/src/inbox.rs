//! What was received and is not looked at yet: a wait within a scan empties the line's FIFO before it overflows, and the command loop comes later.

use tactomo_protocol::MAX_COMMAND;

use crate::Serial;

/// Bytes that can wait: a UART's whole FIFO, and more than the zero and the longest command that a host sends before it hears an answer.
const BYTES: usize = 128;
const _: () = assert!(BYTES > MAX_COMMAND);

/// Bytes from the host, in order.
#[derive(Debug)]
pub(crate) struct Inbox {
    bytes: [u8; BYTES],
    length: usize,
}

impl Default for Inbox {
    fn default() -> Self {
        Self { bytes: [0; BYTES], length: 0 }
    }
}

impl Inbox {
    /// Takes from `serial` what there is and as much as there is room for. What finds none stays in the line's own FIFO.
    pub(crate) fn fill(&mut self, serial: &mut impl Serial) {
        if let Some(room) = self.bytes.get_mut(self.length..).filter(|room| !room.is_empty()) {
            self.length += serial.pull(room).min(room.len());
        }
    }

    /// The bytes that came.
    pub(crate) fn bytes(&self) -> &[u8] {
        self.bytes.get(..self.length).unwrap_or_default()
    }

    /// Forgets them.
    pub(crate) fn clear(&mut self) {
        self.length = 0;
    }
}
