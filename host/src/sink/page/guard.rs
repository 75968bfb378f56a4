//! Who may ask: only pages that this server served itself.
//!
//! The server listens on 127.0.0.1, but any page in the same browser can reach that address. A foreign page that opens the
//! socket says so in `Origin`; one that had its own name resolve to 127.0.0.1 (DNS rebinding) says so in `Host`.

use axum::extract::{Request, State};
use axum::http::header::{
    CACHE_CONTROL, CONTENT_SECURITY_POLICY, HOST, ORIGIN, REFERRER_POLICY, X_CONTENT_TYPE_OPTIONS,
};
use axum::http::{HeaderMap, HeaderName, HeaderValue, StatusCode};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};

/// The names under which a browser reaches the server.
#[derive(Clone, Debug)]
pub(super) struct Guard {
    authorities: [String; 2],
    policy: HeaderValue,
}

impl Guard {
    /// For a server on `port`.
    pub(super) fn new(port: u16) -> Self {
        // Browsers leave out the port that HTTP implies.
        let suffix = if port == 80 { String::new() } else { format!(":{port}") };
        let authorities = ["127.0.0.1", "localhost"].map(|name| format!("{name}{suffix}"));
        // Some browsers do not count the socket as 'self'.
        let [a, b] = &authorities;
        let policy = format!(
            "default-src 'self'; connect-src 'self' ws://{a} ws://{b}; frame-ancestors 'none'; base-uri 'none'; form-action 'none'"
        );
        Self {
            authorities,
            policy: HeaderValue::try_from(policy).unwrap_or(HeaderValue::from_static("default-src 'self'")),
        }
    }

    /// Whether the request names this server.
    fn knows_host(&self, headers: &HeaderMap) -> bool {
        only(headers, &HOST).is_some_and(|host| self.authorities.iter().any(|known| known == host))
    }

    /// Whether the request comes from a page of this server.
    pub(super) fn knows_origin(&self, headers: &HeaderMap) -> bool {
        let authority = only(headers, &ORIGIN).and_then(|origin| origin.strip_prefix("http://"));
        authority.is_some_and(|authority| self.authorities.iter().any(|known| known == authority))
    }
}

/// The value of a header that is there exactly once.
fn only<'a>(headers: &'a HeaderMap, name: &HeaderName) -> Option<&'a str> {
    let mut values = headers.get_all(name).iter();
    let value = values.next()?;
    if values.next().is_some() { None } else { value.to_str().ok() }
}

/// Refuses requests under another name, and tells the browser what the page may do.
pub(super) async fn check(State(guard): State<Guard>, request: Request, next: Next) -> Response {
    let mut response = if guard.knows_host(request.headers()) {
        next.run(request).await
    } else {
        (StatusCode::FORBIDDEN, "This server answers to 127.0.0.1 and localhost only.\n").into_response()
    };
    let headers = response.headers_mut();
    headers.insert(CONTENT_SECURITY_POLICY, guard.policy);
    headers.insert(CACHE_CONTROL, HeaderValue::from_static("no-store"));
    headers.insert(X_CONTENT_TYPE_OPTIONS, HeaderValue::from_static("nosniff"));
    headers.insert(REFERRER_POLICY, HeaderValue::from_static("no-referrer"));
    response
}

#[cfg(test)]
mod tests {
    use super::*;

    fn headers(name: HeaderName, values: &[&'static str]) -> HeaderMap {
        values.iter().map(|value| (name.clone(), HeaderValue::from_static(value))).collect()
    }

    #[test]
    fn hosts_and_origins_must_match_to_the_letter() {
        let guard = Guard::new(7878);
        for host in ["127.0.0.1:7878", "localhost:7878"] {
            assert!(guard.knows_host(&headers(HOST, &[host])), "{host}");
        }
        for host in ["127.0.0.1", "127.0.0.1:7879", "evil.example:7878", "localhost.evil.example:7878", ""] {
            assert!(!guard.knows_host(&headers(HOST, &[host])), "{host}");
        }
        assert!(!guard.knows_host(&headers(HOST, &["127.0.0.1:7878", "evil.example"])));
        assert!(!guard.knows_host(&HeaderMap::new()));
        assert!(guard.knows_origin(&headers(ORIGIN, &["http://localhost:7878"])));
        for origin in ["null", "https://localhost:7878", "http://localhost", "http://localhost:7878.evil.example"] {
            assert!(!guard.knows_origin(&headers(ORIGIN, &[origin])), "{origin}");
        }
        assert!(!guard.knows_origin(&HeaderMap::new()));
    }

    #[test]
    fn the_port_that_http_implies_is_left_out() {
        assert!(Guard::new(80).knows_host(&headers(HOST, &["localhost"])));
    }
}
