//! HTTP for whoever connects, and sockets that end when the other end has gone.

use std::collections::VecDeque;
use std::convert::Infallible;
use std::future::ready;
use std::io;
use std::time::Duration;

use futures_util::SinkExt;
use hyper::StatusCode;
use hyper::body::Incoming;
use hyper::header::{CONTENT_TYPE, HeaderValue};
use hyper::server::conn::http1;
use hyper::service::service_fn;
use hyper::upgrade::{self, Upgraded};
use hyper_util::rt::{TokioIo, TokioTimer};
use tokio::net::TcpListener;
use tokio::task::{AbortHandle, JoinSet};
use tokio::time::{Instant, sleep, sleep_until, timeout};
use tokio_tungstenite::WebSocketStream;
use tokio_tungstenite::tungstenite::handshake::server::create_response_with_body;
use tokio_tungstenite::tungstenite::protocol::{Role, WebSocketConfig};
use tokio_tungstenite::tungstenite::{self, Message};

use super::door::Limits;
use tactomo_physics::causes::with_causes;

/// Pause after a connection could not be accepted, as where the system has no more of them.
const AFTER_FAILURE: Duration = Duration::from_millis(100);

/// Type of an answer in words.
pub(super) const PLAIN: &str = "text/plain; charset=utf-8";

/// What is asked; nobody reads what may come behind its head.
pub(super) type Request = hyper::Request<Incoming>;
/// What is answered.
pub(super) type Response = hyper::Response<String>;
/// A socket that was opened.
pub(super) type WebSocket = WebSocketStream<TokioIo<Upgraded>>;

/// An answer of a type, as browsers name it.
pub(super) fn response(status: StatusCode, kind: &'static str, contents: &str) -> Response {
    let mut response = Response::new(contents.to_owned());
    *response.status_mut() = status;
    response.headers_mut().insert(CONTENT_TYPE, HeaderValue::from_static(kind));
    response
}

/// The answer that makes a socket of a connection.
///
/// # Errors
/// If the request does not ask for one as RFC 6455, section 4.2.1, has it.
pub(super) fn switching(request: &Request) -> Result<Response, tungstenite::Error> {
    create_response_with_body(request, String::new)
}

/// Serves the socket that a connection becomes once [`switching`] was its answer; messages that are longer end it.
pub(super) fn when_switched<T: Future<Output = ()> + Send>(
    request: &mut Request,
    longest_message: usize,
    serve: impl FnOnce(WebSocket) -> T + Send + 'static,
) {
    let upgraded = upgrade::on(request);
    let longest = Some(longest_message);
    let config = WebSocketConfig::default().max_message_size(longest).max_frame_size(longest);
    tokio::spawn(async move {
        // It fails when the other end has gone before, which is its business.
        let Ok(upgraded) = upgraded.await else { return };
        serve(WebSocket::from_raw_socket(TokioIo::new(upgraded), Role::Server, Some(config)).await).await;
    });
}

/// Serves for ever. Connections that say nothing end, and however many there are, the newest is answered.
pub(super) async fn serve(
    listener: TcpListener,
    answer: impl Fn(&mut Request) -> Response + Clone + Send + 'static,
    limits: Limits,
) {
    let mut http = http1::Builder::new();
    http.timer(TokioTimer::new()).header_read_timeout(limits.head);
    let (mut open, mut oldest_first) = (JoinSet::new(), VecDeque::<AbortHandle>::new());
    loop {
        let stream = match listener.accept().await {
            Ok((stream, _)) => stream,
            Err(error) => {
                tracing::debug!("a connection could not be accepted: {}", with_causes(&error));
                sleep(AFTER_FAILURE).await;
                continue;
            }
        };
        while open.try_join_next().is_some() {}
        oldest_first.retain(|connection| !connection.is_finished());
        if oldest_first.len() >= limits.connections
            && let Some(oldest) = oldest_first.pop_front()
        {
            oldest.abort();
        }
        let answer = answer.clone();
        let service = service_fn(move |mut request| ready(Ok::<_, Infallible>(answer(&mut request))));
        let connection = http.serve_connection(TokioIo::new(stream), service).with_upgrades();
        oldest_first.push_back(open.spawn(async move {
            // It fails when the other end has gone or says nothing, which is its business. One that became a socket has ended here.
            let _ = timeout(limits.life, connection).await;
        }));
    }
}

/// Whether the other end of a socket is still there: it answers pings.
pub(super) struct Pulse {
    limits: Limits,
    heard: Instant,
    ping_due: Instant,
}

/// What is due for a socket from which nothing is heard.
pub(super) enum Beat {
    /// To ask whether it is there.
    Ping,
    /// To end it.
    Gone,
}

impl Pulse {
    /// Of a socket that was just opened.
    pub fn new(limits: Limits) -> Self {
        let heard = Instant::now();
        Self { limits, heard, ping_due: heard + limits.ping_every }
    }

    /// Takes note that something was heard.
    pub fn heard(&mut self) {
        self.heard = Instant::now();
        self.ping_due = self.heard + self.limits.ping_every;
    }

    /// Waits until something is due. May be dropped at any time.
    pub async fn next(&mut self) -> Beat {
        let gone = self.heard + self.limits.gone_after;
        sleep_until(self.ping_due.min(gone)).await;
        if Instant::now() >= gone {
            return Beat::Gone;
        }
        self.ping_due = Instant::now() + self.limits.ping_every;
        Beat::Ping
    }

    /// Sends a message.
    ///
    /// # Errors
    /// If the socket has gone, or takes nothing for too long.
    pub async fn send(&self, socket: &mut WebSocket, message: Message) -> io::Result<()> {
        within(self.limits, async { socket.send(message).await.map_err(io::Error::other) }).await
    }
}

/// What is written to another end that has to take it in time.
///
/// # Errors
/// If it does not, or cannot be written to.
pub(super) async fn within<T>(limits: Limits, written: impl Future<Output = io::Result<T>>) -> io::Result<T> {
    timeout(limits.gone_after, written).await.unwrap_or_else(|_| Err(io::ErrorKind::TimedOut.into()))
}
