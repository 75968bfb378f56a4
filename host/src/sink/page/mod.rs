//! The web server of the live page: everything the page needs is in the program, and nothing leaves this machine unless
//! [asked to](Listen).
//!
//! It runs in one thread of its own. Pages get the newest frame when they ask for the next one: a page that sleeps, or stops
//! reading, gets none, and neither the board nor the memory notices.

mod access;
mod assets;
mod calibrating;
pub mod code;
mod messages;
mod setup;
mod socket;
mod update;
mod wire;

use std::io;
use std::net::{IpAddr, Ipv4Addr, SocketAddr, TcpListener, UdpSocket};
use std::sync::Arc;
use std::sync::atomic::AtomicU64;
use std::sync::mpsc::SyncSender;
use std::thread::JoinHandle;

use hyper::StatusCode;
use hyper::header::{HeaderValue, LOCATION};
use tokio::sync::{Semaphore, oneshot, watch};

use self::access::Access;
use super::address::Address;
use super::door::Door;
use super::place::Place;
use super::web::{self, PLAIN, Response, response};
use crate::run::{Request, Snapshot};
use tactomo_physics::causes::with_causes;
use tactomo_physics::detector::Detector;
use tactomo_physics::forward::ImageMesh;
use tactomo_physics::scene::Contact;

/// Port of the page unless the user asks for another.
pub const DEFAULT_PORT: u16 = 7878;

/// Ports tried after [`DEFAULT_PORT`] if that is busy.
const PORTS_TRIED: u16 = 10;

/// Pages that may be open at a time.
const MAX_PAGES: usize = 32;

/// Path of the picture of the page's address.
const ADDRESS: &str = "/address.svg";

/// Largest message that a page may send, in bytes.
const MAX_PAGE_MESSAGE: usize = 2048;

/// One detector to be shown: what does not change, what there is to show, and where pages' requests go. A request that finds no room is dropped.
#[derive(Debug)]
pub struct Shown {
    /// Its name among others, which is part of the address of its page: letters, digits, `-` and `_`.
    pub name: String,
    /// Where it lies on a body, if that is told.
    pub place: Option<Place>,
    /// What does not change.
    pub setup: PageSetup,
    /// The newest of what there is to show.
    pub snapshots: watch::Receiver<Arc<Snapshot>>,
    /// Where requests go.
    pub requests: SyncSender<Request>,
}

impl Shown {
    /// One that is shown alone, and needs no name.
    pub fn alone(
        setup: PageSetup,
        snapshots: watch::Receiver<Arc<Snapshot>>,
        requests: SyncSender<Request>,
    ) -> Vec<Self> {
        vec![Self { name: String::new(), place: None, setup, snapshots, requests }]
    }
}

/// What does not change while the program runs.
#[derive(Clone, Debug)]
pub struct PageSetup {
    /// The detector as it is modelled.
    pub detector: Detector,
    /// Places of the image.
    pub mesh: ImageMesh,
    /// Radius that contacts are drawn with where it is not known (m).
    pub usual_radius_m: f64,
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

/// Who can reach the page.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Listen {
    /// Address of this machine that other machines reach, or `0.0.0.0` for all it has; then the page's address has a random token,
    /// without which nothing is answered. `None` for this machine alone.
    pub address: Option<IpAddr>,
    /// Port, 0 for any free one; `None` for [`DEFAULT_PORT`] or the next free one.
    pub port: Option<u16>,
    /// Who may open its socket besides its own pages, and how long somebody may stay without a word.
    pub door: Door,
}

impl Listen {
    /// At an address as a person types it, which other machines reach if it has a host.
    ///
    /// # Errors
    /// [`ServerError::Address`] if nothing has such a name.
    pub fn at(address: &Address, door: Door) -> Result<Self, ServerError> {
        let resolved = address.resolve(DEFAULT_PORT);
        let at = resolved.map_err(|source| ServerError::Address { address: address.clone(), source })?;
        Ok(Self { address: address.has_host().then_some(at.ip()), port: address.port(), door })
    }

    fn ip(&self) -> IpAddr {
        self.address.unwrap_or(Ipv4Addr::LOCALHOST.into())
    }
}

/// A running server; stops when dropped.
#[derive(Debug)]
pub struct Server {
    at: SocketAddr,
    /// The token and a slash, if there is one.
    prefix: String,
    shared_url: Option<String>,
    stop: Option<oneshot::Sender<()>>,
    thread: Option<JoinHandle<()>>,
}

/// Why the page cannot be served.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ServerError {
    /// Another program listens there.
    #[error("port {port} on {address} is busy (is another tactomo live running?): choose another with --http-port")]
    Busy {
        /// The address asked for.
        address: IpAddr,
        /// The port asked for.
        port: u16,
    },
    /// The system refuses.
    #[error(
        "cannot serve the page on port {port} of {address} (choose another port with --http-port, or with --listen an address \
         that this machine has)"
    )]
    Listen {
        /// The address asked for.
        address: IpAddr,
        /// The port asked for.
        port: u16,
        /// What the system says.
        source: io::Error,
    },
    /// A setup with numbers that are none.
    #[error("detector {detector} cannot be described to the page")]
    PageSetup {
        /// Its name.
        detector: String,
        /// What cannot be written.
        source: serde_json::Error,
    },
    /// An address that nobody has.
    #[error("cannot serve the page at {address}: give --listen an address that this machine has, or only a port")]
    Address {
        /// The address asked for.
        address: Address,
        /// What the system says.
        source: io::Error,
    },
    /// No random numbers.
    #[error("the system gives no random numbers for the token of a shared page ({0}): leave out --listen")]
    Token(getrandom::Error),
}

/// What all sockets of a detector share.
#[derive(Debug)]
struct Picture {
    shown: Shown,
    setup_message: String,
    rezeros: AtomicU64,
    door: Door,
}

/// What all requests share.
#[derive(Debug)]
struct Shared {
    /// Those shown, each with a page of its own if they are several.
    pictures: Vec<Arc<Picture>>,
    pages: Arc<Semaphore>,
    access: Access,
    /// The address for other machines, if it is shared.
    shared_url: Option<String>,
    door: Door,
}

impl Server {
    /// Serves the page of a detector; or of several a page with all of them, from which those of each are opened.
    ///
    /// # Errors
    /// If the port or the address is busy or refused.
    pub fn start(listen: Listen, all: Vec<Shown>) -> Result<Self, ServerError> {
        let listener = bind(&listen)?;
        let (address, port) = (listen.ip(), listen.port.unwrap_or(DEFAULT_PORT));
        let refused = |source| ServerError::Listen { address, port, source };
        let at = listener.local_addr().map_err(refused)?;
        let access = match listen.address {
            Some(_) => Access::shared(at).map_err(ServerError::Token)?,
            None => Access::local(at.port()),
        };
        let prefix = access.prefix();
        let shared_url = shared_url(at, &prefix);
        let picture = |shown: Shown| {
            let name = || shown.setup.detector.name.clone();
            let setup_message = setup::message(&shown.setup, (&shown.name, shown.place), shared_url.as_deref())
                .map_err(|source| ServerError::PageSetup { detector: name(), source })?;
            Ok(Arc::new(Picture { shown, setup_message, rezeros: AtomicU64::new(0), door: listen.door.clone() }))
        };
        let pictures: Vec<_> = all.into_iter().map(picture).collect::<Result<_, _>>()?;
        let pages = Arc::new(Semaphore::new(MAX_PAGES * pictures.len()));
        let shared = Arc::new(Shared { pictures, pages, access, shared_url: shared_url.clone(), door: listen.door });
        let (stop, stopped) = oneshot::channel();
        let thread = run(listener, shared, stopped).map_err(refused)?;
        Ok(Self { at, prefix, shared_url, stop: Some(stop), thread: Some(thread) })
    }

    /// Where the page is for a browser on this machine, with its token if it has one.
    pub fn url(&self) -> String {
        let ip = if self.at.ip().is_unspecified() { Ipv4Addr::LOCALHOST.into() } else { self.at.ip() };
        self.url_at(ip)
    }

    /// Where the page is for other machines, with its token; `None` if it is for this machine alone.
    pub fn shared_url(&self) -> Option<&str> {
        self.shared_url.as_deref()
    }

    fn url_at(&self, ip: IpAddr) -> String {
        url(ip, self.at.port(), &self.prefix)
    }

    /// The port it listens on.
    pub fn port(&self) -> u16 {
        self.at.port()
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

fn url(ip: IpAddr, port: u16, prefix: &str) -> String {
    format!("http://{}/{prefix}", SocketAddr::new(ip, port))
}

/// Where the page of a server at `at` is for other machines, behind its token; `None` if it has none, and so is for this machine alone.
fn shared_url(at: SocketAddr, prefix: &str) -> Option<String> {
    let outward = || if at.ip().is_unspecified() { own_address() } else { Some(at.ip()) };
    (!prefix.is_empty()).then(outward).flatten().map(|ip| url(ip, at.port(), prefix))
}

/// The address that other machines on the network know this one by, if it is on one.
fn own_address() -> Option<IpAddr> {
    let socket = UdpSocket::bind((Ipv4Addr::UNSPECIFIED, 0)).ok()?;
    // Chooses a route and sends nothing; the address is one of those kept for documentation (RFC 5737).
    socket.connect((Ipv4Addr::new(192, 0, 2, 1), 9)).ok()?;
    socket.local_addr().ok().map(|address| address.ip())
}

fn bind(listen: &Listen) -> Result<TcpListener, ServerError> {
    let address = listen.ip();
    let Some(port) = listen.port else {
        let mut refusal = None;
        let ports = DEFAULT_PORT..=DEFAULT_PORT + PORTS_TRIED;
        let found =
            ports.map(|port| bind(&Listen { port: Some(port), ..listen.clone() })).find_map(|bound| match bound {
                Ok(listener) => Some(listener),
                Err(error) => {
                    refusal.get_or_insert(error);
                    None
                }
            });
        return found.ok_or(refusal.unwrap_or(ServerError::Busy { address, port: DEFAULT_PORT }));
    };
    TcpListener::bind((address, port)).map_err(|source| match source.kind() {
        io::ErrorKind::AddrInUse => ServerError::Busy { address, port },
        _ => ServerError::Listen { address, port, source },
    })
}

/// Serves in a new thread until `stopped` is sent or its sender is gone.
fn run(listener: TcpListener, shared: Arc<Shared>, stopped: oneshot::Receiver<()>) -> io::Result<JoinHandle<()>> {
    listener.set_nonblocking(true)?;
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build()?;
    let limits = shared.door.limits;
    let serving = async move {
        let listener = tokio::net::TcpListener::from_std(listener)?;
        tokio::select! {
            () = web::serve(listener, move |request: &mut web::Request| serve(&shared, request), limits) => {}
            _ = stopped => {}
        }
        io::Result::Ok(())
    };
    std::thread::Builder::new().name("page server".to_owned()).spawn(move || {
        if let Err(error) = runtime.block_on(serving) {
            tracing::error!("the page is no longer served: {}", with_causes(&error));
        }
    })
}

/// Answers any request: who may not ask gets nothing else.
fn serve(shared: &Arc<Shared>, request: &mut web::Request) -> Response {
    let host = shared.access.host(request.headers()).map(ToOwned::to_owned);
    let mut response = match &host {
        Some(host) => answer(shared, request, host),
        None => refuse("This server answers to its own address only: open the address that tactomo live printed.\n"),
    };
    access::protect(response.headers_mut(), host.as_deref());
    response
}

fn refuse(why: &str) -> Response {
    response(StatusCode::FORBIDDEN, PLAIN, why)
}

fn answer(shared: &Arc<Shared>, request: &mut web::Request, host: &str) -> Response {
    let whole = request.uri().path().to_owned();
    match shared.access.path(&whole) {
        None => refuse("The token is missing or wrong: open the whole address that tactomo live printed.\n"),
        Some("") => redirect(&format!("{whole}/")),
        Some(path) => match &shared.pictures[..] {
            [only] => page(shared, only, request, (path, host)),
            all => {
                let mut parts = path.splitn(3, '/').skip(1);
                let name = parts.next().unwrap_or_default();
                match (all.iter().find(|picture| picture.shown.name == name), parts.next()) {
                    (Some(_), None) => redirect(&format!("{whole}/")),
                    (Some(picture), Some(rest)) => page(shared, picture, request, (&format!("/{rest}"), host)),
                    (None, _) if path == "/detectors.json" => names(all),
                    (None, _) if path == ADDRESS => address(shared),
                    (None, _) => assets::of_all(path),
                }
            }
        },
    }
}

/// The page of one detector.
fn page(
    shared: &Arc<Shared>,
    picture: &Arc<Picture>,
    request: &mut web::Request,
    (path, host): (&str, &str),
) -> Response {
    match path {
        "/socket" => open_socket(shared, picture, request, host),
        ADDRESS => address(shared),
        path => assets::answer(path),
    }
}

/// The address for other machines as a picture.
fn address(shared: &Shared) -> Response {
    match &shared.shared_url {
        Some(url) => response(StatusCode::OK, assets::SVG, &code::svg(url)),
        None => response(StatusCode::NOT_FOUND, PLAIN, ""),
    }
}

/// Names of all detectors, as JSON.
fn names(all: &[Arc<Picture>]) -> Response {
    let names: Vec<&str> = all.iter().map(|picture| picture.shown.name.as_str()).collect();
    let json = serde_json::to_string(&names).unwrap_or_default();
    response(StatusCode::OK, "application/json", &json)
}

/// The same page with a slash at its end: the names of its files are relative to that.
fn redirect(to: &str) -> Response {
    let Ok(to) = HeaderValue::try_from(to) else { return response(StatusCode::NOT_FOUND, PLAIN, "") };
    let mut redirect = response(StatusCode::PERMANENT_REDIRECT, PLAIN, "");
    redirect.headers_mut().insert(LOCATION, to);
    redirect
}

fn open_socket(shared: &Arc<Shared>, picture: &Arc<Picture>, request: &mut web::Request, host: &str) -> Response {
    let Ok(switching) = web::switching(request) else {
        return response(StatusCode::BAD_REQUEST, PLAIN, "This is the page's socket: open the page.\n");
    };
    if !shared.door.lets_in(request.headers(), &format!("http://{host}"), false) {
        return refuse("Only the live page itself may open its socket, and pages that --allow-origin names.\n");
    }
    let Ok(page) = shared.pages.clone().try_acquire_owned() else {
        return response(StatusCode::SERVICE_UNAVAILABLE, PLAIN, "Too many pages are open.\n");
    };
    let picture = Arc::clone(picture);
    web::when_switched(request, MAX_PAGE_MESSAGE, async move |socket| {
        socket::serve(socket, &picture).await;
        drop(page);
    });
    switching
}
