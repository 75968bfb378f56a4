//! Addresses to listen on or to send to, as a person types them: one form for the page, Foxglove and streams.

use std::fmt;
use std::io;
use std::net::{Ipv4Addr, Ipv6Addr, SocketAddr, ToSocketAddrs};
use std::str::FromStr;

/// Where: `PORT`, `ADDRESS`, `ADDRESS:PORT`, or a name in place of the address; IPv6 in brackets where a port follows. Without an address it is
/// this machine alone, without a port the usual one of what it is for.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Address {
    /// Address or name without brackets, if one was given.
    host: Option<String>,
    port: Option<u16>,
}

impl FromStr for Address {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (host, port) = split(text);
        let port = port.map(str::parse).transpose();
        let is_host = |host: &str| {
            let is_name = |byte: u8| byte.is_ascii_alphanumeric() || b"-._".contains(&byte);
            host.parse::<Ipv6Addr>().is_ok() || !host.is_empty() && host.bytes().all(is_name)
        };
        match port {
            Ok(port) if host.is_none_or(is_host) => Ok(Self { host: host.map(str::to_owned), port }),
            _ => Err(format!(
                "`{text}` is no address: it is a port up to 65535, an address or name, or both, such as 9000, 127.0.0.1 or 127.0.0.1:9000"
            )),
        }
    }
}

/// Host and port, each if it is there.
fn split(text: &str) -> (Option<&str>, Option<&str>) {
    if !text.is_empty() && text.bytes().all(|byte| byte.is_ascii_digit()) {
        return (None, Some(text));
    }
    if text.parse::<Ipv6Addr>().is_ok() {
        return (Some(text), None);
    }
    if let Some((host, rest)) = text.strip_prefix('[').and_then(|text| text.split_once(']')) {
        return (Some(host), if rest.is_empty() { None } else { Some(rest.strip_prefix(':').unwrap_or_default()) });
    }
    match text.rsplit_once(':') {
        Some((host, port)) => (Some(host), Some(port)),
        None => (Some(text), None),
    }
}

impl fmt::Display for Address {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match &self.host {
            Some(host) if host.contains(':') => write!(f, "[{host}]")?,
            Some(host) => write!(f, "{host}")?,
            None => write!(f, "{}", Ipv4Addr::LOCALHOST)?,
        }
        self.port.map_or(Ok(()), |port| write!(f, ":{port}"))
    }
}

impl Address {
    /// A port of this machine alone; 0 for any free one.
    pub fn local(port: u16) -> Self {
        Self { host: None, port: Some(port) }
    }

    /// The same form where no port is the usual one, so that it has to be there.
    ///
    /// # Errors
    /// What is wrong with the text.
    pub fn with_port(text: &str) -> Result<Self, String> {
        let address: Self = text.parse()?;
        match address.port {
            Some(_) => Ok(address),
            None => Err(format!("`{text}` has no port: give a port, or an address and a port such as 127.0.0.1:9000")),
        }
    }

    /// Whether an address or a name was given, and so others than this machine may be meant.
    pub fn has_host(&self) -> bool {
        self.host.is_some()
    }

    /// The port, if one was given.
    pub fn port(&self) -> Option<u16> {
        self.port
    }

    /// As the system takes it, with the usual port where none was given; a name is looked up.
    ///
    /// # Errors
    /// If nothing has such a name.
    pub fn resolve(&self, usual_port: u16) -> io::Result<SocketAddr> {
        let port = self.port.unwrap_or(usual_port);
        match &self.host {
            None => Ok((Ipv4Addr::LOCALHOST, port).into()),
            Some(host) => (&**host, port).to_socket_addrs()?.next().ok_or_else(|| io::ErrorKind::NotFound.into()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_left_out_is_this_machine_and_the_usual_port() {
        let resolved = |text: &str| text.parse::<Address>().unwrap().resolve(80).unwrap().to_string();
        assert_eq!(resolved("9000"), "127.0.0.1:9000");
        assert_eq!(resolved("0.0.0.0:9000"), "0.0.0.0:9000");
        assert_eq!(resolved("0.0.0.0"), "0.0.0.0:80");
        for text in ["[::1]:80", "[::1]", "::1"] {
            assert_eq!(resolved(text), "[::1]:80");
        }
        assert_eq!(Address::local(8765).to_string(), "127.0.0.1:8765");
        let shown = |text: &str| text.parse::<Address>().unwrap().to_string();
        assert_eq!([shown("::1"), shown("[::1]:9"), shown("robot.local")], ["[::1]", "[::1]:9", "robot.local"]);
    }

    #[test]
    fn what_is_no_address_is_said() {
        for text in [
            "",
            "70000",
            ":9000",
            "127.0.0.1:",
            "127.0.0.1:nine",
            "[::1]9",
            "[::1]:",
            "[]:9",
            "a b:9",
            "a/b",
            "1:2:9000",
        ] {
            assert!(text.parse::<Address>().is_err_and(|error| error.contains("127.0.0.1:9000")), "{text}");
        }
        assert!(Address::with_port("127.0.0.1").is_err_and(|error| error.contains("127.0.0.1:9000")));
        assert_eq!(Address::with_port("9000"), Ok(Address::local(9000)));
    }
}
