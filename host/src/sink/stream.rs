//! Streams of JSON Lines: to a file, to stdout, to whoever connects, or in datagrams.

use std::io::{self, BufWriter, Write};
use std::time::{Duration, Instant};

use tactomo_physics::new_file;

use super::door::Limits;
use super::feed::{Delivery, Keeps};
use super::lines::Fields;
use super::running::{PATIENCE, Sink, Sinks};
use super::target::{DISK_PATIENCE, Form, StreamError, Target};
use super::{tcp, udp};

/// Longest that a line waits in the buffer of a file.
const FLUSH_EVERY: Duration = Duration::from_millis(20);

impl Sinks {
    /// Adds a stream; one that listens says where, since it may have been given any port.
    ///
    /// # Errors
    /// [`StreamError`] if the file is there already, the port is busy, or the address is nobody's.
    pub fn add_stream(&mut self, target: &Target, form: Form) -> Result<Option<std::net::SocketAddr>, StreamError> {
        let name = format!("the stream {target}");
        let pace = |keeps| (keeps, form.most_per_s);
        let started = match target {
            Target::Stdout => {
                let lines = Lines::new(io::stdout(), form.fields, Duration::ZERO);
                self.run(name.clone(), pace(Keeps::Newest), PATIENCE, lines)
            }
            Target::File(path) => {
                let lines = Lines::new(new_file::create(path)?, form.fields, FLUSH_EVERY);
                self.run(name.clone(), pace(Keeps::All), DISK_PATIENCE, lines)
            }
            Target::Tcp(address) => return tcp::serve(self, address, form, Limits::default()).map(Some),
            Target::Udp(address) => {
                let datagrams = udp::Datagrams::to(address, name.clone(), form.fields)?;
                self.run(name.clone(), pace(Keeps::Newest), PATIENCE, datagrams)
            }
        };
        started.map(|()| None).map_err(StreamError::thread(&name))
    }
}

/// Lines to whatever bytes are written to.
struct Lines<W: Write> {
    out: BufWriter<W>,
    fields: Fields,
    line: Vec<u8>,
    flush_every: Duration,
    flushed: Instant,
}

impl<W: Write> Lines<W> {
    fn new(out: W, fields: Fields, flush_every: Duration) -> Self {
        Self { out: BufWriter::new(out), fields, line: Vec::new(), flush_every, flushed: Instant::now() }
    }
}

impl<W: Write + Send + 'static> Sink for Lines<W> {
    fn take(&mut self, delivery: &Delivery, is_last: bool) -> io::Result<()> {
        self.fields.line(delivery, &mut self.line)?;
        self.out.write_all(&self.line)?;
        if is_last && self.flushed.elapsed() >= self.flush_every {
            self.rest()?;
        }
        Ok(())
    }

    fn rest(&mut self) -> io::Result<()> {
        self.flushed = Instant::now();
        self.out.flush()
    }

    fn finish(&mut self) -> io::Result<()> {
        self.out.flush()
    }
}

#[cfg(test)]
mod tests {
    use std::sync::{Arc, Mutex};

    use tactomo_touch::changes::Changes;
    use tactomo_touch::solve::Solution;

    use super::*;
    use crate::run::TouchEvent;
    use crate::sink::address::Address;

    #[derive(Clone, Default)]
    struct Shared(Arc<Mutex<Vec<u8>>>);

    impl Write for Shared {
        fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
            self.0.lock().unwrap().extend(bytes);
            Ok(bytes.len())
        }

        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }

    fn delivery(sequence: u64) -> Delivery {
        Delivery::at_once(TouchEvent::of(sequence, Solution::default()), &mut Changes::default())
    }

    #[test]
    fn targets_are_files_unless_they_say_otherwise() {
        let target = |text: &str| text.parse::<Target>();
        assert_eq!(target("-"), Ok(Target::Stdout));
        assert_eq!(target("touch.jsonl"), Ok(Target::File("touch.jsonl".into())));
        assert_eq!(target("tcp:9000"), Ok(Target::Tcp(Address::local(9000))));
        assert_eq!(target("udp:10.0.0.2:9000").map(|target| target.to_string()), Ok("udp:10.0.0.2:9000".to_owned()));
        assert!(target("tcp:nowhere").is_err() && target("udp:").is_err());
    }

    #[test]
    fn lines_go_out_when_nothing_waits_behind_them() {
        let out = Shared::default();
        let mut lines = Lines::new(out.clone(), Fields::default(), Duration::ZERO);
        lines.take(&delivery(1), false).unwrap();
        assert!(out.0.lock().unwrap().is_empty(), "more comes at once");
        lines.take(&delivery(2), true).unwrap();
        let text = String::from_utf8(out.0.lock().unwrap().clone()).unwrap();
        let sequences: Vec<_> = text
            .lines()
            .map(|line| serde_json::from_str::<serde_json::Value>(line).unwrap()["sequence"].as_u64())
            .collect();
        assert_eq!(sequences, [Some(1), Some(2)]);
    }

    #[test]
    fn a_file_is_never_replaced() {
        let path = std::env::temp_dir().join(format!("tactomo-{}-stream.jsonl", std::process::id()));
        std::fs::write(&path, "kept").unwrap();
        let refused = Sinks::default().add_stream(&Target::File(path.clone()), Form::default()).unwrap_err();
        assert!(refused.to_string().contains("exists already, and no file is replaced"), "{refused}");
        assert_eq!(std::fs::read_to_string(&path).unwrap(), "kept");
        std::fs::remove_file(&path).unwrap();
    }
}
