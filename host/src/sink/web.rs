//! HTTP for whoever connects, and sockets that end when the other end has gone.

use std::collections::VecDeque;
use std::io;
use std::time::Duration;

use axum::Router;
use axum::extract::ws::{Message, WebSocket};
use hyper::server::conn::http1;
use hyper_util::rt::{TokioIo, TokioTimer};
use hyper_util::service::TowerToHyperService;
use tokio::net::TcpListener;
use tokio::task::{AbortHandle, JoinSet};
use tokio::time::{Instant, sleep, sleep_until, timeout};

use super::door::Limits;
use tactomo_physics::causes::with_causes;

/// Pause after a connection could not be accepted, as where the system has no more of them.
const AFTER_FAILURE: Duration = Duration::from_millis(100);

/// Serves for ever. Connections that say nothing end, and however many there are, the newest is answered.
pub(super) async fn serve(listener: TcpListener, router: Router, limits: Limits) {
    let service = TowerToHyperService::new(router);
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
        let connection = http.serve_connection(TokioIo::new(stream), service.clone()).with_upgrades();
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
    pub async fn send(&self, socket: &mut WebSocket, message: Message) -> Result<(), axum::Error> {
        within(self.limits, async { socket.send(message).await.map_err(io::Error::other) })
            .await
            .map_err(axum::Error::new)
    }
}

/// What is written to another end that has to take it in time.
///
/// # Errors
/// If it does not, or cannot be written to.
pub(super) async fn within<T>(limits: Limits, written: impl Future<Output = io::Result<T>>) -> io::Result<T> {
    timeout(limits.gone_after, written).await.unwrap_or_else(|_| Err(io::ErrorKind::TimedOut.into()))
}
