//! Who gets in, and how long somebody may stay without a word: one rule for the page, Foxglove and streams.
//!
//! Browsers say in `Origin` which site a page comes from, and let no page say otherwise; programs say nothing. Any site that is open in a
//! browser on this machine can reach a server on 127.0.0.1, so a socket is opened for known origins only.

use std::fmt;
use std::str::FromStr;
use std::time::Duration;

use hyper::HeaderMap;
use hyper::header::{HeaderName, ORIGIN};

/// Characters of an origin that is refused, in the log.
const SHOWN: usize = 100;

/// Who gets in besides those who always do, and what nobody may do for long.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Door {
    /// Sites whose pages may open sockets.
    pub origins: Vec<Origin>,
    /// How long somebody may stay without a word, and how many may be there.
    pub limits: Limits,
}

/// A site, as browsers name it: `https://app.example` or `http://localhost:8080`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Origin(String);

/// How long a connection may be idle, and how many there may be.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Limits {
    /// Longest wait for a request's head, the next one's too. A browser sends it in one packet.
    pub head: Duration,
    /// Longest that a connection lives which is no socket: enough for the page's files, 0.2 MB, over a slow network.
    pub life: Duration,
    /// Connections to a server at a time that are no sockets; a new one takes the place of the oldest. A browser opens six.
    pub connections: usize,
    /// Time between two pings to a socket from which nothing is heard.
    pub ping_every: Duration,
    /// A socket from which nothing is heard for so long, or that takes nothing, has gone. A computer that wakes up connects again.
    pub gone_after: Duration,
}

impl Default for Limits {
    fn default() -> Self {
        let seconds = Duration::from_secs;
        Self { head: seconds(10), life: seconds(60), connections: 64, ping_every: seconds(20), gone_after: seconds(60) }
    }
}

impl FromStr for Origin {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let wrong = || {
            format!(
                "`{text}` is no origin: it is a scheme and a name, as a browser has them, such as https://app.example or http://localhost:8080"
            )
        };
        let (scheme, host) = text.trim_end_matches('/').split_once(':').ok_or_else(wrong)?;
        let is_scheme =
            !scheme.is_empty() && scheme.bytes().all(|byte| byte.is_ascii_alphanumeric() || b"+-.".contains(&byte));
        // Pages that are files have no name.
        let is_file = scheme.eq_ignore_ascii_case("file") && host.is_empty();
        let name = host.strip_prefix("//").unwrap_or_default();
        let is_name =
            !name.is_empty() && name.bytes().all(|byte| byte.is_ascii_alphanumeric() || b".-_:[]".contains(&byte));
        if !is_scheme || !(is_file || is_name) {
            return Err(wrong());
        }
        Ok(Self(if is_file { "file://".to_owned() } else { format!("{scheme}://{name}").to_ascii_lowercase() }))
    }
}

impl fmt::Display for Origin {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str(&self.0)
    }
}

impl Door {
    /// Whether who asks with these headers may open a socket: pages of the origin `own` and of those that are named, and, if `programs` may,
    /// whoever is no browser. The log says which origin was refused.
    pub(super) fn lets_in(&self, headers: &HeaderMap, own: &str, programs: bool) -> bool {
        if !headers.contains_key(ORIGIN) {
            return programs;
        }
        let Some(origin) = only(headers, &ORIGIN) else { return false };
        let is_in = origin == own || self.origins.iter().any(|named| named.0 == origin);
        if !is_in {
            let origin: String = origin.chars().take(SHOWN).collect();
            tracing::warn!(
                "a page of {} wanted to read touch and was refused: if it may, begin with --allow-origin and that name",
                origin.escape_debug()
            );
        }
        is_in
    }
}

/// The value of a header that is there exactly once.
pub(super) fn only<'a>(headers: &'a HeaderMap, name: &HeaderName) -> Option<&'a str> {
    let mut values = headers.get_all(name).iter();
    let value = values.next()?;
    if values.next().is_some() { None } else { value.to_str().ok() }
}

#[cfg(test)]
mod tests {
    use hyper::header::HeaderValue;

    use super::*;

    fn headers(values: &[&'static str]) -> HeaderMap {
        values.iter().map(|value| (ORIGIN, HeaderValue::from_static(value))).collect()
    }

    #[test]
    fn origins_are_as_browsers_name_them() {
        let parsed = |text: &str| text.parse::<Origin>().map(|origin| origin.to_string());
        assert_eq!(parsed("https://App.Example/").as_deref(), Ok("https://app.example"));
        assert_eq!(parsed("http://[::1]:8080").as_deref(), Ok("http://[::1]:8080"));
        assert_eq!(parsed("file://").as_deref(), Ok("file://"));
        for text in ["", "*", "null", "app.example", "https://", "https://a.example/path", "https://a b", "http:///x"] {
            assert!(parsed(text).is_err_and(|error| error.contains("https://app.example")), "{text}");
        }
    }

    #[test]
    fn own_pages_and_named_ones_get_in_and_programs_where_they_may() {
        let door = Door { origins: vec!["https://robot.example".parse().unwrap()], ..Door::default() };
        let own = "http://localhost:7878";
        for programs in [false, true] {
            let lets_in = |values: &[&'static str]| door.lets_in(&headers(values), own, programs);
            assert!(lets_in(&[own]) && lets_in(&["https://robot.example"]));
            assert_eq!(lets_in(&[]), programs);
            for values in [
                &["null"][..],
                &[""],
                &["https://evil.example"],
                &["https://localhost:7878"],
                &["http://localhost:7878.evil.example"],
                &["https://robot.example.evil.example"],
                &["https://robot.example:444"],
                &[own, "https://evil.example"],
                &["file://"],
            ] {
                assert!(!lets_in(values), "{values:?}");
            }
        }
    }
}
