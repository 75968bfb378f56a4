//! The server alone: what it lets in, what it sends when, and what it makes of nonsense.

use std::io::{ErrorKind, Read, Write};
use std::net::{Ipv4Addr, TcpStream};
use std::sync::Arc;
use std::sync::mpsc::{Receiver, sync_channel};
use std::time::{Duration, Instant};

use anyhow::{Context, Result, ensure};
use tactomo::board::link::Control;
use tactomo::detector::Detector;
use tactomo::forward::ImageMesh;
use tactomo::readings::Readings;
use tactomo::run::{Request, Snapshot};
use tactomo::scene::Contact;
use tactomo::sink::door::{Door, Limits};
use tactomo::sink::page::{Finger, Listen, PageSetup, Server, ServerError, Shown};
use tactomo::solve::{Method, Solution};
use tokio::sync::watch;

use crate::raw::{Heard, RawPage, ask, ask_socket, ask_socket_at};
use crate::script::answer;

const FINGER: Finger = Finger { radius_m: 0.003, conductance_s: 1e-4 };

/// A server with nothing behind it.
struct Rig {
    server: Server,
    snapshots: watch::Sender<Arc<Snapshot>>,
    requests: Receiver<Request>,
}

/// This machine alone, at a port.
fn local(port: Option<u16>) -> Listen {
    Listen { port, ..Listen::default() }
}

fn setup(finger: Option<Finger>) -> Result<PageSetup> {
    Ok(PageSetup {
        detector: Detector::preset(Detector::DEFAULT).context("the default preset")?,
        mesh: ImageMesh::default(),
        usual_radius_m: 0.0025,
        source: "a test".to_owned(),
        finger,
    })
}

impl Rig {
    fn start(finger: Option<Finger>) -> Result<Self> {
        Self::listening(local(Some(0)), finger)
    }

    fn listening(listen: Listen, finger: Option<Finger>) -> Result<Self> {
        let (snapshots, receiver) = watch::channel(Arc::default());
        let (sender, requests) = sync_channel(64);
        let server = Server::start(listen, Shown::alone(setup(finger)?, receiver, sender))?;
        Ok(Self { server, snapshots, requests })
    }

    fn publish(&self, sequence: u64) {
        let answer = Arc::new(answer(sequence, Readings::from_fn(16, |_, _| 0.0), Solution::default()));
        self.snapshots.send_replace(Arc::new(Snapshot { answer: Some(answer), ..Snapshot::default() }));
    }

    fn request(&self) -> Result<Request> {
        Ok(self.requests.recv_timeout(Duration::from_secs(5))?)
    }
}

#[test]
fn the_page_is_served_to_its_own_names_only() -> Result<()> {
    let rig = Rig::start(None)?;
    let port = rig.server.port();
    let own = format!("127.0.0.1:{port}");
    for (path, host, status) in [
        ("/", own.as_str(), 200),
        ("/app.js", &format!("localhost:{port}"), 200),
        ("/Cargo.toml", &own, 404),
        ("/../style.css", &own, 404),
        ("/", "127.0.0.1", 403),
        ("/", &format!("rebound.example:{port}"), 403),
    ] {
        let answer = ask(port, path, host, &[])?;
        assert_eq!(answer.status, status, "{path} of {host}");
        assert!(answer.headers.contains("content-security-policy: default-src 'self'; "), "{}", answer.headers);
    }
    Ok(())
}

#[test]
fn a_foreign_page_cannot_open_the_socket() -> Result<()> {
    let rig = Rig::start(None)?;
    let port = rig.server.port();
    let (own, page) = (format!("localhost:{port}"), format!("http://localhost:{port}"));
    let rebound = format!("rebound.example:{port}");
    for (host, origin, status) in [
        (own.as_str(), Some(page.as_str()), 101),
        (&own, None, 403),
        (&own, Some("null"), 403),
        (&own, Some("http://foreign.example"), 403),
        (&own, Some("http://localhost:1"), 403),
        (&rebound, Some(&page), 403),
        (&rebound, Some(&format!("http://{rebound}")), 403),
    ] {
        assert_eq!(ask_socket(port, host, origin)?.status, status, "{host} from {origin:?}");
    }
    Ok(())
}

#[test]
fn a_page_of_an_origin_that_is_named_opens_the_socket() -> Result<()> {
    let origins = vec!["https://robot.example".parse().map_err(anyhow::Error::msg)?];
    let door = Door { origins, ..Door::default() };
    let rig = Rig::listening(Listen { door, ..local(Some(0)) }, None)?;
    let port = rig.server.port();
    let own = format!("127.0.0.1:{port}");
    for (origin, status) in [("https://robot.example", 101), ("https://other.example", 403)] {
        assert_eq!(ask_socket(port, &own, Some(origin))?.status, status, "{origin}");
    }
    Ok(())
}

#[test]
fn a_socket_opens_where_all_is_asked_that_it_needs() -> Result<()> {
    let rig = Rig::start(None)?;
    let host = format!("127.0.0.1:{}", rig.server.port());
    let origin = format!("http://{host}");
    let asked = [
        ("Origin", origin.as_str()),
        ("Connection", "keep-alive, Upgrade"),
        ("Upgrade", "websocket"),
        ("Sec-WebSocket-Version", "13"),
        ("Sec-WebSocket-Key", "dGhlIHNhbXBsZSBub25jZQ=="),
    ];
    let answer = ask(rig.server.port(), "/socket", &host, &asked)?;
    // The example of RFC 6455, section 1.3.
    let accepted = "sec-websocket-accept: s3pPLMBiTxaQ9kYGzzhZRbK+xOo=\r\n";
    assert!(answer.status == 101 && answer.headers.contains(accepted), "{}", answer.headers);
    for (name, _) in &asked[1..] {
        let rest: Vec<_> = asked.into_iter().filter(|(other, _)| other != name).collect();
        assert_eq!(ask(rig.server.port(), "/socket", &host, &rest)?.status, 400, "without {name}");
    }
    Ok(())
}

/// A server with little patience.
fn hasty() -> Result<Rig> {
    let limits = Limits {
        head: Duration::from_millis(300),
        connections: 16,
        ping_every: Duration::from_millis(100),
        gone_after: Duration::from_millis(400),
        ..Limits::default()
    };
    Rig::listening(Listen { door: Door { limits, ..Door::default() }, ..local(Some(0)) }, None)
}

/// What comes until the server hangs up.
fn until_closed(mut stream: TcpStream) -> Result<Vec<u8>> {
    stream.set_read_timeout(Some(Duration::from_secs(20)))?;
    let mut bytes = Vec::new();
    match stream.read_to_end(&mut bytes) {
        Err(error) if error.kind() != ErrorKind::ConnectionReset => Err(error.into()),
        _ => Ok(bytes),
    }
}

#[test]
fn idle_connections_end_and_however_many_there_are_the_page_is_served() -> Result<()> {
    let rig = hasty()?;
    let port = rig.server.port();
    let connect = || TcpStream::connect((Ipv4Addr::LOCALHOST, port));
    let mut idle: Vec<TcpStream> = (0..200).map(|_| connect()).collect::<Result<_, _>>()?;
    assert_eq!(ask(port, "/", &format!("127.0.0.1:{port}"), &[])?.status, 200);
    // One that begins to ask and never ends, and one that has asked and asks nothing more.
    let mut slow = connect()?;
    slow.write_all(b"GET / HTTP/1.1\r\nHost: ")?;
    let mut kept = connect()?;
    write!(kept, "GET /app.js HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\n\r\n")?;
    ensure!(until_closed(kept)?.starts_with(b"HTTP/1.1 200"));
    idle.push(slow);
    idle.into_iter().try_for_each(|stream| until_closed(stream).map(drop))
}

#[test]
fn a_socket_whose_page_has_gone_without_a_word_ends() -> Result<()> {
    let rig = hasty()?;
    let host = format!("127.0.0.1:{}", rig.server.port());
    let answer = ask_socket(rig.server.port(), &host, Some(&format!("http://{host}")))?;
    ensure!(answer.status == 101);
    let came = until_closed(answer.stream())?;
    assert!(came.windows(2).any(|pair| pair == [0x89, 0]), "it was pinged");
    Ok(())
}

#[test]
fn a_message_is_sent_when_the_last_was_taken() -> Result<()> {
    let rig = Rig::start(None)?;
    let mut page = RawPage::open(rig.server.port())?;
    assert!(
        matches!(page.hear()?, Heard::Text(text) if text.starts_with(r#"{"type":"setup","layout":{"words":["sequence","#))
    );
    assert!(page.is_silent_for(Duration::from_millis(400))?, "the setup was not taken");
    page.take()?;
    assert!(matches!(page.hear()?, Heard::Text(text) if text.starts_with(r#"{"type":"status","#)));
    rig.publish(1);
    assert!(page.is_silent_for(Duration::from_millis(400))?, "the status was not taken");
    assert_eq!(page.next_sequence()?, 1);
    Ok(())
}

#[test]
fn pages_get_the_newest_frame_however_long_they_slept() -> Result<()> {
    let rig = Rig::start(None)?;
    let mut sleeper = RawPage::open(rig.server.port())?;
    let mut awake = RawPage::open(rig.server.port())?;
    rig.publish(0);
    assert_eq!((sleeper.next_sequence()?, awake.next_sequence()?), (0, 0));
    for sequence in 1..=20 {
        rig.publish(sequence);
        assert_eq!(u64::from(awake.next_sequence()?), sequence);
    }
    assert_eq!(sleeper.next_sequence()?, 20);
    Ok(())
}

#[test]
fn updates_come_at_the_pace_of_a_screen() -> Result<()> {
    let rig = Rig::start(None)?;
    let mut page = RawPage::open(rig.server.port())?;
    let begin = Instant::now();
    let mut updates = 0_u32;
    while begin.elapsed() < Duration::from_millis(600) {
        rig.publish(u64::from(updates));
        page.next_sequence()?;
        updates += 1;
    }
    // 15 ms at least between two, however fast the page takes them.
    let most = begin.elapsed().as_millis() / 15 + 2;
    assert!(u128::from(updates) <= most && updates >= 5, "{updates} updates, {most} allowed");
    Ok(())
}

#[test]
fn nonsense_closes_its_page_and_no_other() -> Result<()> {
    let rig = Rig::start(None)?;
    let mut other = RawPage::open(rig.server.port())?;
    let long = format!("\"{}\"", "a".repeat(5000));
    for text in [
        "",
        "taken",
        "{",
        r#""flash""#,
        r#"{"solver":"guess"}"#,
        r#"{"press":[{"x_m":0}]}"#,
        r#"{"press":[{"x_m":0,"y_m":0}]}"#,
        r#"{"scene":"ring"}"#,
        r#"{"speed":-1}"#,
        &long,
    ] {
        let mut page = RawPage::open(rig.server.port())?;
        page.say(text)?;
        ensure!(matches!(page.hear()?, Heard::Text(_)), "the setup comes first");
        // A message that is too long ends the stream at once; others are answered with a reason.
        match page.hear() {
            Ok(Heard::Close(reason)) => assert!(!reason.is_empty(), "{text}"),
            Ok(heard) => anyhow::bail!("{text} is answered with {heard:?}"),
            Err(_) => assert_eq!(text, long),
        }
    }
    rig.publish(3);
    assert_eq!(other.next_sequence()?, 3);
    assert!(rig.requests.try_recv().is_err(), "nothing of this reaches the board");
    Ok(())
}

#[test]
fn a_page_presses_on_the_detector_and_lets_go_when_it_leaves() -> Result<()> {
    let rig = Rig::start(Some(FINGER))?;
    let mut page = RawPage::open(rig.server.port())?;
    page.say(r#"{"press":[{"x_m":0.031,"y_m":0}]}"#)?;
    page.say(r#"{"press":[{"x_m":0.01,"y_m":-0.02},{"x_m":0,"y_m":0}]}"#)?;
    let contacts = [[0.01, -0.02], [0.0, 0.0]].map(|[x, y]| Contact::flat(x, y, 0.003, 1e-4)).to_vec();
    assert_eq!(rig.request()?, Request::Control(Control::Press(contacts)), "0.031 m is off the detector");
    page.say("\"rezero\"")?;
    assert_eq!(rig.request()?, Request::Rezero);
    page.say(r#"{"solver":"contacts"}"#)?;
    assert_eq!(rig.request()?, Request::Solver(Method::Contacts));
    drop(page);
    assert_eq!(rig.request()?, Request::Control(Control::Press(Vec::new())));
    Ok(())
}

#[test]
fn a_shared_page_needs_its_token_for_everything() -> Result<()> {
    let any = Listen { address: Some(Ipv4Addr::UNSPECIFIED.into()), port: Some(0), ..Listen::default() };
    let rig = Rig::listening(any, None)?;
    let port = rig.server.port();
    let host = format!("127.0.0.1:{port}");
    let url = rig.server.url();
    let path = url.strip_prefix(&format!("http://{host}")).context("an address of this machine")?;
    let token = path.trim_matches('/');
    assert_eq!(token.len(), 32, "128 bits in {url}");
    let wrong = "0".repeat(32);
    for (path, host, status) in [
        (path, host.as_str(), 200),
        (&format!("/{token}/app.js"), &host, 200),
        (&format!("/{token}"), &host, 308),
        (&format!("/{token}/Cargo.toml"), &host, 404),
        ("/", &host, 403),
        ("/app.js", &host, 403),
        ("/socket", &host, 403),
        (&format!("/{wrong}/"), &host, 403),
        (&format!("/{}/", &token[..31]), &host, 403),
        (path, &format!("rebound.example:{port}"), 403),
    ] {
        assert_eq!(ask(port, path, host, &[])?.status, status, "{path} of {host}");
    }
    let page = format!("http://{host}");
    for (socket, origin, status) in [
        ("/socket".to_owned(), Some(page.as_str()), 403),
        (format!("/{wrong}/socket"), Some(&page), 403),
        (format!("/{token}/socket"), Some("http://foreign.example"), 403),
        (format!("/{token}/socket"), None, 403),
        (format!("/{token}/socket"), Some(&page), 101),
    ] {
        assert_eq!(ask_socket_at(port, &socket, &host, origin)?.status, status, "{socket} from {origin:?}");
    }
    Ok(())
}

#[test]
fn only_a_shared_page_has_an_address_for_others() -> Result<()> {
    let code = |rig: &Rig| {
        let url = rig.server.url();
        let (host, path) = url.trim_start_matches("http://").split_once('/').context("a path")?;
        ask(rig.server.port(), &format!("/{path}address.svg"), host, &[])
    };
    let alone = Rig::start(None)?;
    assert_eq!((alone.server.shared_url(), code(&alone)?.status), (None, 404));
    let loopback = Listen { address: Some(Ipv4Addr::LOCALHOST.into()), port: Some(0), ..Listen::default() };
    let rig = Rig::listening(loopback, None)?;
    assert_eq!(rig.server.shared_url(), Some(&*rig.server.url()));
    assert!(code(&rig)?.body()?.contains("<svg"));
    Ok(())
}

#[test]
fn several_detectors_have_a_page_and_a_socket_each_and_one_with_all() -> Result<()> {
    let (_snapshots, receiver) = watch::channel(Arc::default());
    let of = |name: &str, requests| -> Result<Shown> {
        let setup = PageSetup { source: format!("the board of {name}"), ..setup(Some(FINGER))? };
        Ok(Shown { name: name.to_owned(), place: None, setup, snapshots: receiver.clone(), requests })
    };
    let [(thumb, of_thumb), (palm, of_palm)] = [sync_channel(4), sync_channel(4)];
    let server = Server::start(local(Some(0)), vec![of("thumb", thumb)?, of("palm", palm)?])?;
    let host = format!("127.0.0.1:{}", server.port());
    let get = |path: &str| ask(server.port(), path, &host, &[]);
    let of_all = |path: &str| anyhow::Ok(get(path)?.body()?.contains("detectors.js"));
    assert!(of_all("/")? && !of_all("/thumb/")?);
    assert_eq!(get("/detectors.json")?.body()?, r#"["thumb","palm"]"#);
    let paths = [("/thumb", 308), ("/thumb/app.js", 200), ("/palm/socket", 400), ("/style.css", 200), ("/index/", 404)];
    for (path, status) in paths {
        assert_eq!(get(path)?.status, status, "{path}");
    }
    let mut page = RawPage::open_at(server.port(), "/palm/socket")?;
    assert!(matches!(page.hear()?, Heard::Text(text) if text.contains("the board of palm")));
    page.say("\"rezero\"")?;
    assert_eq!(of_palm.recv_timeout(Duration::from_secs(5))?, Request::Rezero);
    assert!(of_thumb.try_recv().is_err());
    Ok(())
}

#[test]
fn a_busy_port_is_named_and_the_default_gives_way() -> Result<()> {
    let rig = Rig::start(None)?;
    let start = |port| {
        let (_, receiver) = watch::channel(Arc::default());
        Server::start(local(port), Shown::alone(setup(None)?, receiver, sync_channel(1).0)).map_err(anyhow::Error::from)
    };
    let error = start(Some(rig.server.port())).err().context("a busy port")?;
    assert!(matches!(error.downcast_ref(), Some(ServerError::Busy { port, .. }) if *port == rig.server.port()));
    let (first, second) = (start(None)?, start(None)?);
    assert_ne!(first.port(), second.port());
    Ok(())
}

#[test]
fn a_stopped_server_is_gone() -> Result<()> {
    let rig = Rig::start(None)?;
    let port = rig.server.port();
    let mut page = RawPage::open(port)?;
    drop(rig.server);
    page.hear().context("the setup was sent before")?;
    assert!(page.hear().is_err());
    assert!(ask(port, "/", "localhost", &[]).is_err());
    Ok(())
}
