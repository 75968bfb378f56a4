//! The web server of the live page: everything the page needs is in the program, and nothing leaves this machine.
//!
//! It runs in one thread of its own. Pages get the newest frame when they ask for the next one: a page that sleeps, or stops
//! reading, gets none, and neither the board nor the memory notices.

mod assets;
mod guard;
mod socket;
mod update;
mod wire;

use std::io;
use std::net::{Ipv4Addr, TcpListener};
use std::sync::Arc;
use std::sync::atomic::AtomicU64;
use std::sync::mpsc::SyncSender;
use std::thread::JoinHandle;

use axum::Router;
use axum::extract::{State, WebSocketUpgrade};
use axum::http::{HeaderMap, StatusCode, Uri};
use axum::middleware::from_fn_with_state;
use axum::response::{IntoResponse, Response};
use axum::routing::get;
use tokio::sync::{Semaphore, oneshot, watch};

use self::guard::Guard;
use crate::run::{Request, Snapshot};
use tactomo_physics::detector::Detector;
use tactomo_physics::forward::ImageMesh;
use tactomo_physics::scene::Contact;

/// Port of the page unless the user asks for another.
pub const DEFAULT_PORT: u16 = 7878;

/// Ports tried after [`DEFAULT_PORT`] if that is busy.
const PORTS_TRIED: u16 = 10;

/// Pages that may be open at a time.
const MAX_PAGES: usize = 32;

/// Largest message that a page may send, in bytes.
const MAX_PAGE_MESSAGE: usize = 1024;

/// What does not change while the program runs.
#[derive(Clone, Debug)]
pub struct PageSetup {
    /// The detector as it is modelled.
    pub detector: Detector,
    /// Places of the image.
    pub mesh: ImageMesh,
    /// What a person calls the source: a port, a recording, the simulated board.
    pub source: String,
    /// What the mouse presses with, if the board is simulated.
    pub finger: Option<Finger>,
}

/// What the mouse presses with.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Finger {
    /// Radius of the contact (m).
    pub radius_m: f64,
    /// Conductance of the contact (S).
    pub conductance_s: f64,
}

impl From<Contact> for Finger {
    fn from(contact: Contact) -> Self {
        Self { radius_m: contact.radius_m, conductance_s: contact.conductance_s }
    }
}

/// A running server; stops when dropped.
#[derive(Debug)]
pub struct Server {
    port: u16,
    stop: Option<oneshot::Sender<()>>,
    thread: Option<JoinHandle<()>>,
}

/// Why the page cannot be served.
#[derive(Debug, thiserror::Error)]
pub enum ServerError {
    /// Another program listens there.
    #[error("port {port} on 127.0.0.1 is busy (is another tactomo live running?): choose another with --http-port")]
    Busy {
        /// The port asked for.
        port: u16,
    },
    /// The system refuses.
    #[error("cannot serve the page on port {port} of 127.0.0.1: {source}; choose another with --http-port")]
    Listen {
        /// The port asked for.
        port: u16,
        /// What the system says.
        source: io::Error,
    },
    /// A scene with numbers that are none.
    #[error("detector {detector} cannot be described to the page: {source}")]
    PageSetup {
        /// Its name.
        detector: String,
        /// What cannot be written.
        source: serde_json::Error,
    },
}

/// What all sockets share.
#[derive(Debug)]
struct Shared {
    scene: PageSetup,
    scene_message: String,
    snapshots: watch::Receiver<Arc<Snapshot>>,
    requests: SyncSender<Request>,
    rezeros: AtomicU64,
    pages: Arc<Semaphore>,
    guard: Guard,
}

impl Server {
    /// Serves the page on `port`, 0 for any free one; without a port, on [`DEFAULT_PORT`] or the next free one.
    ///
    /// Pages show the newest of `snapshots` and ask through `requests`; a request that finds `requests` full is dropped.
    ///
    /// # Errors
    /// If the port is busy or refused.
    pub fn start(
        port: Option<u16>,
        scene: PageSetup,
        snapshots: watch::Receiver<Arc<Snapshot>>,
        requests: SyncSender<Request>,
    ) -> Result<Self, ServerError> {
        let listener = listen(port)?;
        let refused = |source| ServerError::Listen { port: port.unwrap_or(DEFAULT_PORT), source };
        let port = listener.local_addr().map_err(refused)?.port();
        let scene_message = wire::scene(&scene)
            .map_err(|source| ServerError::PageSetup { detector: scene.detector.name.clone(), source })?;
        let shared = Arc::new(Shared {
            scene,
            scene_message,
            snapshots,
            requests,
            rezeros: AtomicU64::new(0),
            pages: Arc::new(Semaphore::new(MAX_PAGES)),
            guard: Guard::new(port),
        });
        let (stop, stopped) = oneshot::channel();
        let thread = run(listener, shared, stopped).map_err(refused)?;
        Ok(Self { port, stop: Some(stop), thread: Some(thread) })
    }

    /// Where the page is.
    pub fn url(&self) -> String {
        format!("http://127.0.0.1:{}/", self.port)
    }

    /// The port it listens on.
    pub fn port(&self) -> u16 {
        self.port
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        drop(self.stop.take());
        if let Some(thread) = self.thread.take() {
            // A panic in the thread has already been reported by it.
            let _ = thread.join();
        }
    }
}

fn listen(port: Option<u16>) -> Result<TcpListener, ServerError> {
    let Some(port) = port else {
        return (DEFAULT_PORT..=DEFAULT_PORT + PORTS_TRIED)
            .find_map(|port| listen(Some(port)).ok())
            .ok_or(ServerError::Busy { port: DEFAULT_PORT });
    };
    TcpListener::bind((Ipv4Addr::LOCALHOST, port)).map_err(|source| match source.kind() {
        io::ErrorKind::AddrInUse => ServerError::Busy { port },
        _ => ServerError::Listen { port, source },
    })
}

/// Serves in a new thread until `stopped` is sent or its sender is gone.
fn run(listener: TcpListener, shared: Arc<Shared>, stopped: oneshot::Receiver<()>) -> io::Result<JoinHandle<()>> {
    listener.set_nonblocking(true)?;
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build()?;
    let serve = async move {
        let listener = tokio::net::TcpListener::from_std(listener)?;
        tokio::select! {
            served = axum::serve(listener, router(shared)) => served,
            _ = stopped => Ok(()),
        }
    };
    std::thread::Builder::new().name("page server".to_owned()).spawn(move || {
        if let Err(error) = runtime.block_on(serve) {
            tracing::error!("the page is no longer served: {error}");
        }
    })
}

fn router(shared: Arc<Shared>) -> Router {
    let guard = shared.guard.clone();
    Router::new()
        .route("/socket", get(open_socket))
        .fallback(get(|uri: Uri| async move { assets::answer(uri.path()) }))
        .layer(from_fn_with_state(guard, guard::check))
        .with_state(shared)
}

async fn open_socket(State(shared): State<Arc<Shared>>, headers: HeaderMap, upgrade: WebSocketUpgrade) -> Response {
    if !shared.guard.knows_origin(&headers) {
        return (StatusCode::FORBIDDEN, "Only the live page itself may open its socket.\n").into_response();
    }
    let Ok(page) = shared.pages.clone().try_acquire_owned() else {
        return (StatusCode::SERVICE_UNAVAILABLE, "Too many pages are open.\n").into_response();
    };
    upgrade.max_message_size(MAX_PAGE_MESSAGE).max_frame_size(MAX_PAGE_MESSAGE).on_upgrade(async move |socket| {
        socket::serve(socket, &shared).await;
        drop(page);
    })
}
