//! A page that is no browser: HTTP and WebSocket (RFC 6455) over a plain stream, to send what no browser would.

use std::io::{BufRead, BufReader, Read, Write};
use std::net::{Ipv4Addr, TcpStream};
use std::time::Duration;

use anyhow::{Context, Result, bail, ensure};

const PATIENCE: Duration = Duration::from_secs(5);

/// What came from the server.
#[derive(Debug, PartialEq)]
pub enum Heard {
    Text(String),
    Binary(Vec<u8>),
    /// The reason given.
    Close(String),
}

/// Status and headers of an answer, and the stream behind them.
pub struct Answer {
    pub status: u16,
    pub headers: String,
    stream: BufReader<TcpStream>,
}

impl Answer {
    /// What the headers say follows them, as text.
    pub fn body(mut self) -> Result<String> {
        let of = |line: &str| line.to_ascii_lowercase().strip_prefix("content-length: ").map(str::to_owned);
        let length: usize = self.headers.lines().find_map(of).context("a length")?.trim().parse()?;
        let mut body = vec![0; length];
        self.stream.read_exact(&mut body)?;
        Ok(String::from_utf8(body)?)
    }

    /// The stream behind the headers; what of it was read already is lost.
    pub fn stream(self) -> TcpStream {
        self.stream.into_inner()
    }
}

/// Asks for `path` under the name `host`, with further header lines.
pub fn ask(port: u16, path: &str, host: &str, headers: &[(&str, &str)]) -> Result<Answer> {
    let mut stream = TcpStream::connect((Ipv4Addr::LOCALHOST, port))?;
    stream.set_read_timeout(Some(PATIENCE))?;
    let lines: String = headers.iter().map(|(name, value)| format!("{name}: {value}\r\n")).collect();
    write!(stream, "GET {path} HTTP/1.1\r\nHost: {host}\r\n{lines}\r\n")?;
    let mut stream = BufReader::new(stream);
    let mut headers = String::new();
    while !headers.ends_with("\r\n\r\n") {
        ensure!(stream.read_line(&mut headers)? > 0, "the server hung up after {headers:?}");
    }
    let status = headers.split(' ').nth(1).context("a status line")?.parse()?;
    Ok(Answer { status, headers, stream })
}

/// Asks to open the socket.
pub fn ask_socket(port: u16, host: &str, origin: Option<&str>) -> Result<Answer> {
    ask_socket_at(port, "/socket", host, origin)
}

/// Asks to open the socket at `path`.
pub fn ask_socket_at(port: u16, path: &str, host: &str, origin: Option<&str>) -> Result<Answer> {
    let mut headers = vec![
        ("Connection", "Upgrade"),
        ("Upgrade", "websocket"),
        ("Sec-WebSocket-Version", "13"),
        ("Sec-WebSocket-Key", "dGhlIHNhbXBsZSBub25jZQ=="),
    ];
    headers.extend(origin.map(|origin| ("Origin", origin)));
    ask(port, path, host, &headers)
}

/// An open socket.
pub struct RawPage {
    stream: BufReader<TcpStream>,
    /// Whether a message came that was not taken.
    holds: bool,
}

impl RawPage {
    /// Opens the socket as the page itself would.
    pub fn open(port: u16) -> Result<Self> {
        Self::open_at(port, "/socket")
    }

    /// Opens the socket at `path` as the page beside it would.
    pub fn open_at(port: u16, path: &str) -> Result<Self> {
        let host = format!("127.0.0.1:{port}");
        let answer = ask_socket_at(port, path, &host, Some(&format!("http://{host}")))?;
        ensure!(answer.status == 101, "the server answers {}", answer.status);
        Ok(Self { stream: answer.stream, holds: false })
    }

    /// Sends a text.
    pub fn say(&mut self, text: &str) -> Result<()> {
        let mut frame = vec![0x81];
        match text.len() {
            length @ ..126 => frame.push(0x80 | length as u8),
            length => {
                frame.push(0x80 | 126);
                frame.extend((length as u16).to_be_bytes());
            }
        }
        // A mask of zeros: the payload passes as it is.
        frame.extend([0; 4]);
        frame.extend(text.as_bytes());
        Ok(self.stream.get_mut().write_all(&frame)?)
    }

    /// The next message.
    pub fn hear(&mut self) -> Result<Heard> {
        let [head, length] = self.read::<2>()?;
        let length = match length {
            126 => u64::from(u16::from_be_bytes(self.read()?)),
            127 => u64::from_be_bytes(self.read()?),
            short => u64::from(short),
        };
        let mut payload = vec![0; usize::try_from(length)?];
        self.stream.read_exact(&mut payload)?;
        self.holds = true;
        Ok(match head {
            0x81 => Heard::Text(String::from_utf8(payload)?),
            0x82 => Heard::Binary(payload),
            0x88 => Heard::Close(String::from_utf8_lossy(payload.get(2..).unwrap_or_default()).into_owned()),
            other => bail!("a WebSocket frame that starts with {other:#x}"),
        })
    }

    /// Whether nothing comes within `wait`.
    pub fn is_silent_for(&mut self, wait: Duration) -> Result<bool> {
        self.stream.get_ref().set_read_timeout(Some(wait))?;
        let silent = self.stream.fill_buf().is_err();
        self.stream.get_ref().set_read_timeout(Some(PATIENCE))?;
        Ok(silent)
    }

    /// Takes the message that came last, if that was not taken yet.
    pub fn take(&mut self) -> Result<()> {
        if std::mem::take(&mut self.holds) { self.say("\"taken\"") } else { Ok(()) }
    }

    /// Takes messages until an update comes; its sequence number, which is the first of its words.
    pub fn next_sequence(&mut self) -> Result<u32> {
        loop {
            self.take()?;
            if let Heard::Binary(bytes) = self.hear()? {
                let word = bytes.get(..4).and_then(|word| word.try_into().ok()).context("an update")?;
                return Ok(u32::from_le_bytes(word));
            }
        }
    }

    fn read<const N: usize>(&mut self) -> Result<[u8; N]> {
        let mut bytes = [0; N];
        self.stream.read_exact(&mut bytes)?;
        Ok(bytes)
    }
}
