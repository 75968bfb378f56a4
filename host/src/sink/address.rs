//! Addresses to listen on or to send to, as a person types them.

use std::fmt;
use std::io;
use std::net::{Ipv4Addr, SocketAddr, ToSocketAddrs};
use std::str::FromStr;

/// A port, and where: `PORT`, `ADDRESS:PORT` or `NAME:PORT`. Without an address it is this machine alone.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Address {
    /// Address or name, if one was given.
    host: Option<String>,
    port: u16,
}

impl FromStr for Address {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (host, port) = match text.rsplit_once(':') {
            Some((host, port)) => (Some(host.to_owned()), port),
            None => (None, text),
        };
        let port = port.parse().ok().filter(|_| host.as_deref() != Some(""));
        let port = port.ok_or_else(|| {
            format!(
                "`{text}` is no port: it is a number up to 65535, or an address and a number such as 127.0.0.1:9000"
            )
        })?;
        Ok(Self { host, port })
    }
}

impl fmt::Display for Address {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match &self.host {
            Some(host) => write!(f, "{host}:{}", self.port),
            None => write!(f, "{}:{}", Ipv4Addr::LOCALHOST, self.port),
        }
    }
}

impl Address {
    /// A port of this machine alone; 0 for any free one.
    pub fn local(port: u16) -> Self {
        Self { host: None, port }
    }

    /// As the system takes it; a name is looked up.
    ///
    /// # Errors
    /// If nothing has such a name.
    pub fn resolve(&self) -> io::Result<SocketAddr> {
        let host = self.host.as_deref().map(|host| host.trim_start_matches('[').trim_end_matches(']'));
        match host {
            None => Ok((Ipv4Addr::LOCALHOST, self.port).into()),
            Some(host) => (host, self.port).to_socket_addrs()?.next().ok_or_else(|| io::ErrorKind::NotFound.into()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_port_alone_is_of_this_machine() {
        let resolved = |text: &str| text.parse::<Address>().unwrap().resolve().unwrap().to_string();
        assert_eq!(resolved("9000"), "127.0.0.1:9000");
        assert_eq!(resolved("0.0.0.0:9000"), "0.0.0.0:9000");
        assert_eq!(resolved("[::1]:9000"), "[::1]:9000");
        assert_eq!(Address::local(8765).to_string(), "127.0.0.1:8765");
    }

    #[test]
    fn what_is_no_port_is_said() {
        for text in ["", "nine", "70000", "127.0.0.1", ":9000", "127.0.0.1:"] {
            assert!(text.parse::<Address>().is_err_and(|error| error.contains("127.0.0.1:9000")), "{text}");
        }
    }
}
