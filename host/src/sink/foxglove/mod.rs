//! A live connection for Foxglove's app: a server that speaks its WebSocket protocol, version 1
//! (<https://github.com/foxglove/ws-protocol/blob/main/docs/spec.md>).
//!
//! It only sends: nothing can be asked of the board through it. Programs that can reach the address can read what is touched; of pages in a
//! browser those of Foxglove, and others that are named.

mod client;
mod protocol;

use std::io;
use std::net::SocketAddr;
use std::sync::Arc;
use std::time::{SystemTime, UNIX_EPOCH};

use hyper::header::{HeaderValue, SEC_WEBSOCKET_PROTOCOL};
use hyper::{HeaderMap, StatusCode};
use tokio::net::TcpListener;
use tokio::sync::Semaphore;
use tokio::time::timeout;

use super::address::Address;
use super::channels::{Messages, Topics};
use super::door::Door;
use super::feed::Taps;
use super::running::{PATIENCE, Sinks};
use super::target::StreamError;
use super::web::{self, PLAIN, Request, Response, response};
use tactomo_physics::causes::with_causes;

/// The port that Foxglove's app proposes.
pub const DEFAULT_PORT: u16 = 8765;

/// Where Foxglove's app comes from in a browser.
const OWN: &str = "https://app.foxglove.dev";
/// Apps at a time.
const MOST_APPS: u32 = 16;
/// Largest message that an app may send, in bytes: a list of a few subscriptions.
const LONGEST_ASKED: usize = 1 << 16;
/// The protocol by both its names: apps of 2025 and later offer the second too, for the same messages.
const SUBPROTOCOLS: [&str; 2] = ["foxglove.websocket.v1", "foxglove.sdk.v1"];

/// What all connections share.
struct Shared {
    taps: Taps,
    topics: Topics,
    /// Tells an app that connects again whether it is the same run.
    session: String,
    room: Arc<Semaphore>,
    door: Door,
}

impl Sinks {
    /// Serves Foxglove's app, and says where.
    ///
    /// # Errors
    /// [`StreamError`] if the port is busy or the address not this machine's.
    pub fn add_foxglove(
        &mut self,
        address: &Address,
        detectors: Vec<Messages>,
        door: Door,
    ) -> Result<SocketAddr, StreamError> {
        let refused = StreamError::address("Foxglove", address);
        let listener = address.resolve(DEFAULT_PORT).and_then(std::net::TcpListener::bind).map_err(&refused)?;
        let at = listener.local_addr().map_err(&refused)?;
        listener.set_nonblocking(true).map_err(&refused)?;
        let session = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default().as_millis().to_string();
        let room = Arc::new(Semaphore::new(MOST_APPS as usize));
        let shared = Arc::new(Shared { taps: self.taps(), topics: Topics::new(detectors), session, room, door });
        let name = format!("Foxglove at ws://{at}");
        let work = move |runtime: tokio::runtime::Runtime| {
            if let Err(error) = runtime.block_on(serve(listener, shared)) {
                tracing::error!("Foxglove is no longer served at ws://{at}: {}", with_causes(&error));
            }
        };
        self.thread(name.clone(), 2 * PATIENCE, work).map_err(StreamError::thread(&name))?;
        Ok(at)
    }
}

async fn serve(listener: std::net::TcpListener, shared: Arc<Shared>) -> io::Result<()> {
    let listener = TcpListener::from_std(listener)?;
    let mut alive = shared.taps.clone();
    let all = Arc::clone(&shared);
    tokio::select! {
        () = web::serve(listener, move |request: &mut Request| connect(&all, request), shared.door.limits) => {}
        () = alive.ended() => {}
    }
    // What is left is for those who read; a stalled one is not waited for.
    let _ = timeout(PATIENCE, shared.room.acquire_many(MOST_APPS)).await;
    Ok(())
}

fn connect(shared: &Arc<Shared>, request: &mut Request) -> Response {
    if !shared.door.lets_in(request.headers(), OWN, true) {
        let refused = "Only Foxglove's own pages may read this, and those that --allow-origin names.\n";
        return response(StatusCode::FORBIDDEN, PLAIN, refused);
    }
    let Ok(mut switching) = web::switching(request) else {
        return response(StatusCode::UPGRADE_REQUIRED, PLAIN, "Open this address in Foxglove, as a WebSocket.\n");
    };
    let Some(subprotocol) = subprotocol(request.headers()) else {
        let offered = "This server speaks the subprotocol foxglove.websocket.v1, which was not offered.\n";
        return response(StatusCode::BAD_REQUEST, PLAIN, offered);
    };
    let Ok(place) = Arc::clone(&shared.room).try_acquire_owned() else {
        return response(StatusCode::SERVICE_UNAVAILABLE, PLAIN, "Too many apps are connected.\n");
    };
    switching.headers_mut().insert(SEC_WEBSOCKET_PROTOCOL, HeaderValue::from_static(subprotocol));
    let shared = Arc::clone(shared);
    web::when_switched(request, LONGEST_ASKED, async move |socket| {
        client::serve(socket, &shared).await;
        drop(place);
    });
    switching
}

/// The first name of the protocol that is among those an app offers.
fn subprotocol(headers: &HeaderMap) -> Option<&'static str> {
    let lists = headers.get_all(SEC_WEBSOCKET_PROTOCOL).iter().filter_map(|list| list.to_str().ok());
    let offered: Vec<_> = lists.flat_map(|list| list.split(',')).map(str::trim).collect();
    SUBPROTOCOLS.into_iter().find(|name| offered.contains(name))
}
