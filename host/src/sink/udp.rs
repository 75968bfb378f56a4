//! A stream in datagrams: each line is one, and who is not there gets none.

use std::io;
use std::net::{Ipv4Addr, Ipv6Addr, UdpSocket};

use super::address::Address;
use super::feed::Delivery;
use super::lines::Fields;
use super::running::Sink;
use super::target::StreamError;

/// Lines as datagrams.
pub(super) struct Datagrams {
    socket: UdpSocket,
    name: String,
    fields: Fields,
    line: Vec<u8>,
}

impl Datagrams {
    /// Sends to an address.
    pub fn to(address: &Address, name: String, fields: Fields) -> Result<Self, StreamError> {
        let refused = StreamError::address("a stream", address);
        let to = address.resolve(0).map_err(&refused)?;
        let from = if to.is_ipv4() { (Ipv4Addr::UNSPECIFIED, 0).into() } else { (Ipv6Addr::UNSPECIFIED, 0).into() };
        let bound = |from: std::net::SocketAddr| {
            let socket = UdpSocket::bind(from)?;
            socket.connect(to)?;
            Ok(socket)
        };
        let socket = bound(from).map_err(&refused)?;
        Ok(Self { socket, name, fields, line: Vec::new() })
    }
}

impl Sink for Datagrams {
    fn take(&mut self, delivery: &Delivery, _: bool) -> io::Result<()> {
        self.fields.line(delivery, &mut self.line)?;
        // The most that one over IPv4 carries: 65535 bytes less the headers of IP and UDP (RFC 768, RFC 791).
        const LONGEST: usize = 65_507;
        if self.line.len() > LONGEST {
            tracing::warn!(
                "{}: a line of more than {LONGEST} bytes is too long for a datagram, and is left out; ask for fewer fields",
                self.name
            );
            return Ok(());
        }
        match self.socket.send(&self.line) {
            // Nobody is there yet, or any more; the network is down for a moment.
            Err(error) if is_passing(&error) => Ok(()),
            sent => sent.map(drop),
        }
    }

    fn finish(&mut self) -> io::Result<()> {
        Ok(())
    }
}

fn is_passing(error: &io::Error) -> bool {
    use io::ErrorKind::{ConnectionRefused, HostUnreachable, NetworkDown, NetworkUnreachable};
    matches!(error.kind(), ConnectionRefused | HostUnreachable | NetworkDown | NetworkUnreachable)
}
