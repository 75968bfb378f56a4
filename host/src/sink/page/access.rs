//! Who may ask: only pages that this server served itself, and over the network only who has the token.
//!
//! A foreign page that opens the socket says so in `Origin`, which the [door](crate::sink::door) looks at; one
//! that had its own name resolve to this machine (DNS rebinding) says so in `Host`. A server that other machines can reach asks for
//! more: every path begins with a token of 128 random bits, which only the printed address has.

use std::fmt::Write;
use std::hint::black_box;
use std::net::{IpAddr, SocketAddr};

use hyper::HeaderMap;
use hyper::header::{
    CACHE_CONTROL, CONTENT_SECURITY_POLICY, HOST, HeaderValue, REFERRER_POLICY, X_CONTENT_TYPE_OPTIONS,
};

use crate::sink::door::only;

/// Bytes of a token: 128 bits.
const TOKEN_BYTES: usize = 16;

/// What a request needs to be answered.
#[derive(Clone, Debug)]
pub(super) struct Access {
    hosts: Hosts,
    token: Option<Token>,
}

/// The names under which browsers reach the server.
#[derive(Clone, Debug)]
enum Hosts {
    /// These, to the letter.
    Only(Vec<String>),
    /// Any address as such with this port, of which a machine may have many. A name can be made to resolve here; an address cannot.
    AnyAddress(u16),
}

/// The secret part of a shared address.
#[derive(Clone, Debug)]
struct Token(String);

impl Access {
    /// For a server on this machine alone.
    pub(super) fn local(port: u16) -> Self {
        Self { hosts: Hosts::Only(["127.0.0.1", "localhost"].map(|name| authority(name, port)).to_vec()), token: None }
    }

    /// For a server that other machines can reach at `at`.
    ///
    /// # Errors
    /// If the system has no random numbers.
    pub(super) fn shared(at: SocketAddr) -> Result<Self, getrandom::Error> {
        let hosts = match at.ip() {
            ip if ip.is_unspecified() => Hosts::AnyAddress(at.port()),
            IpAddr::V4(ip) => Hosts::Only(vec![authority(&ip.to_string(), at.port())]),
            IpAddr::V6(ip) => Hosts::Only(vec![authority(&format!("[{ip}]"), at.port())]),
        };
        Ok(Self { hosts, token: Some(Token::new()?) })
    }

    /// What an address has between the slash after its port and the page: nothing, or the token and a slash.
    pub(super) fn prefix(&self) -> String {
        self.token.as_ref().map_or_else(String::new, |token| format!("{}/", token.0))
    }

    /// The name under which the request reaches this server, if that is one of its names.
    pub(super) fn host<'a>(&self, headers: &'a HeaderMap) -> Option<&'a str> {
        only(headers, &HOST).filter(|host| self.hosts.know(host))
    }

    /// The path behind the token, with its first slash; `None` without the right token.
    pub(super) fn path<'a>(&self, path: &'a str) -> Option<&'a str> {
        let Some(token) = &self.token else { return Some(path) };
        let path = path.strip_prefix('/')?;
        let (given, rest) = path.split_at(path.find('/').unwrap_or(path.len()));
        token.is(given).then_some(rest)
    }
}

impl Hosts {
    fn know(&self, host: &str) -> bool {
        match self {
            Self::Only(known) => known.iter().any(|known| known == host),
            Self::AnyAddress(80) => host.trim_matches(['[', ']']).parse::<IpAddr>().is_ok(),
            Self::AnyAddress(port) => host.parse::<SocketAddr>().is_ok_and(|address| address.port() == *port),
        }
    }
}

impl Token {
    fn new() -> Result<Self, getrandom::Error> {
        let mut bytes = [0; TOKEN_BYTES];
        getrandom::fill(&mut bytes)?;
        Ok(Self(bytes.iter().fold(String::new(), |mut text, byte| {
            // Writing to a text does not fail.
            let _ = write!(text, "{byte:02x}");
            text
        })))
    }

    /// Whether `given` is the token; takes as long wherever they differ, so that the time says nothing of it.
    fn is(&self, given: &str) -> bool {
        let (known, given) = (self.0.as_bytes(), given.as_bytes());
        let difference = known.iter().zip(given).fold(0, |all, (a, b)| black_box(all | (a ^ b)));
        known.len() == given.len() && black_box(difference) == 0
    }
}

/// Browsers leave out the port that HTTP implies.
fn authority(name: &str, port: u16) -> String {
    if port == 80 { name.to_owned() } else { format!("{name}:{port}") }
}

/// Tells the browser what the page, reached as `host`, may do.
pub(super) fn protect(headers: &mut HeaderMap, host: Option<&str>) {
    // Some browsers do not count the socket as 'self'.
    let socket = host.map_or_else(String::new, |host| format!(" ws://{host}"));
    let policy = format!(
        "default-src 'self'; connect-src 'self'{socket}; frame-ancestors 'none'; base-uri 'none'; form-action 'none'"
    );
    let strictest = HeaderValue::from_static("default-src 'none'");
    headers.insert(CONTENT_SECURITY_POLICY, HeaderValue::try_from(policy).unwrap_or(strictest));
    headers.insert(CACHE_CONTROL, HeaderValue::from_static("no-store"));
    headers.insert(X_CONTENT_TYPE_OPTIONS, HeaderValue::from_static("nosniff"));
    headers.insert(REFERRER_POLICY, HeaderValue::from_static("no-referrer"));
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::net::Ipv4Addr;

    fn headers(hosts: &[&'static str]) -> HeaderMap {
        hosts.iter().map(|host| (HOST, HeaderValue::from_static(host))).collect()
    }

    fn knows(access: &Access, host: &'static str) -> bool {
        access.host(&headers(&[host])).is_some()
    }

    #[test]
    fn hosts_must_match_to_the_letter() {
        let access = Access::local(7878);
        for host in ["127.0.0.1:7878", "localhost:7878"] {
            assert!(knows(&access, host), "{host}");
        }
        for host in ["127.0.0.1", "127.0.0.1:7879", "evil.example:7878", "localhost.evil.example:7878", ""] {
            assert!(!knows(&access, host), "{host}");
        }
        assert!(access.host(&headers(&["127.0.0.1:7878", "evil.example"])).is_none());
        assert!(access.host(&HeaderMap::new()).is_none());
    }

    #[test]
    fn the_port_that_http_implies_is_left_out() {
        assert!(knows(&Access::local(80), "localhost"));
    }

    #[test]
    fn a_shared_server_answers_to_addresses_and_no_other_names() {
        let one = Access::shared((Ipv4Addr::new(192, 168, 1, 5), 7878).into()).unwrap();
        assert!(knows(&one, "192.168.1.5:7878") && !knows(&one, "192.168.1.6:7878"));
        let any = Access::shared((Ipv4Addr::UNSPECIFIED, 7878).into()).unwrap();
        for host in ["192.168.1.5:7878", "127.0.0.1:7878", "[::1]:7878"] {
            assert!(knows(&any, host), "{host}");
        }
        for host in ["192.168.1.5", "192.168.1.5:80", "rebound.example:7878", "192.168.1.5.evil.example:7878"] {
            assert!(!knows(&any, host), "{host}");
        }
    }

    #[test]
    fn the_token_comes_first_in_every_path() {
        let access = Access::shared((Ipv4Addr::UNSPECIFIED, 7878).into()).unwrap();
        let prefix = access.prefix();
        let token = prefix.trim_end_matches('/');
        assert_eq!(token.len(), 2 * TOKEN_BYTES);
        assert_eq!(access.path(&format!("/{token}/app.js")), Some("/app.js"));
        assert_eq!(access.path(&format!("/{token}")), Some(""));
        let last = if token.ends_with('0') { "1" } else { "0" };
        let wrong = format!("/{}{last}/", &token[..token.len() - 1]);
        for path in ["/", "", "/app.js", "//app.js", &wrong, &format!("/{token}0/"), &format!("/x/{token}/")] {
            assert_eq!(access.path(path), None, "{path}");
        }
        let other = Access::shared((Ipv4Addr::UNSPECIFIED, 7878).into()).unwrap();
        assert_ne!(other.prefix(), prefix, "tokens are random");
        assert_eq!(Access::local(1).path("/app.js"), Some("/app.js"));
    }
}
