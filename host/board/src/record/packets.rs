//! Where the first whole packet begins in bytes that come in pieces.

/// Leaves out the rest of a packet that began before; the protocol ends packets with a zero.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct FirstPacket {
    in_packet: bool,
}

impl FirstPacket {
    /// For bytes that may begin within a packet.
    pub fn within() -> Self {
        Self { in_packet: true }
    }

    /// Takes note of bytes that are left out altogether.
    pub fn pass(&mut self, bytes: &[u8]) {
        self.in_packet = bytes.last().map_or(self.in_packet, |last| *last != 0);
    }

    /// `bytes` from the first packet on that begins in them.
    pub fn rest<'a>(&mut self, bytes: &'a [u8]) -> &'a [u8] {
        if !self.in_packet {
            return bytes;
        }
        let Some(end) = bytes.iter().position(|byte| *byte == 0) else { return &[] };
        self.in_packet = false;
        &bytes[end + 1..]
    }
}
