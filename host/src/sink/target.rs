//! Where answers go, in which form, and why they cannot go there.

use std::fmt;
use std::io;
use std::path::PathBuf;
use std::str::FromStr;
use std::time::Duration;

use tactomo_physics::new_file::NewFileError;

use super::address::Address;
use super::lines::Fields;

/// Longest wait for a disk at the end.
pub(super) const DISK_PATIENCE: Duration = Duration::from_secs(10);

/// Where a stream goes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Target {
    /// To stdout.
    Stdout,
    /// Into a new file.
    File(PathBuf),
    /// To all who connect to this port.
    Tcp(Address),
    /// To an address, each line as a datagram.
    Udp(Address),
}

/// `-`, `tcp:PORT`, `tcp:ADDRESS:PORT`, `udp:ADDRESS:PORT`, or else a file.
impl FromStr for Target {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text.split_once(':') {
            _ if text == "-" => Ok(Self::Stdout),
            Some(("tcp", address)) => Address::with_port(address).map(Self::Tcp),
            Some(("udp", address)) => Address::with_port(address).map(Self::Udp),
            _ => Ok(Self::File(text.into())),
        }
    }
}

impl fmt::Display for Target {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match self {
            Self::Stdout => write!(f, "stdout"),
            Self::File(path) => write!(f, "{}", path.display()),
            Self::Tcp(address) => write!(f, "tcp:{address}"),
            Self::Udp(address) => write!(f, "udp:{address}"),
        }
    }
}

/// What a stream carries.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Form {
    /// Fields of a line.
    pub fields: Fields,
    /// Lines a second at most; all of them if that is not said.
    pub most_per_s: Option<f64>,
}

/// Why there is no stream.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum StreamError {
    /// The file of a stream cannot be made.
    #[error(transparent)]
    File(#[from] NewFileError),
    /// Another program listens there.
    #[error("port {address} for {what} is busy: give it another port, or end the program that listens there")]
    Busy {
        /// What was to listen: a stream, Foxglove.
        what: &'static str,
        /// Where.
        address: Address,
    },
    /// An address that this machine does not have, or that nobody has.
    #[error("cannot use {address} for {what} (give it an address that this machine can reach, or only a port)")]
    Address {
        /// What was to use it.
        what: &'static str,
        /// Where.
        address: Address,
        /// What the system says.
        source: io::Error,
    },
    /// No thread.
    #[error("cannot start a thread for {name}")]
    Thread {
        /// The stream.
        name: String,
        /// What the system says.
        source: io::Error,
    },
}

impl StreamError {
    pub(super) fn address(what: &'static str, address: &Address) -> impl Fn(io::Error) -> Self {
        let address = address.clone();
        move |source| match source.kind() {
            io::ErrorKind::AddrInUse => Self::Busy { what, address: address.clone() },
            _ => Self::Address { what, address: address.clone(), source },
        }
    }

    pub(super) fn thread(name: &str) -> impl Fn(io::Error) -> Self {
        let name = name.to_owned();
        move |source| Self::Thread { name: name.clone(), source }
    }
}
