//! MCAP files (<https://mcap.dev>), for Foxglove's app and everything that reads them: the [channels](super::channels) in compressed chunks with
//! an index.

pub mod ros2;
mod writer;

use std::collections::BTreeMap;
use std::io::{self, BufWriter, Write};
use std::path::Path;
use std::time::{Duration, Instant};

use tactomo_physics::new_file::{self, NewFileError};

use self::writer::{Schema, Writer};
use super::channels::{Messages, Topic, Topics};
use super::feed::{Delivery, Keeps};
use super::running::{Sink, Sinks};
use super::target::{DISK_PATIENCE, StreamError};

/// Longest that answers wait in memory: what a kill costs at most.
const CHUNK_LASTS: Duration = Duration::from_millis(500);
/// Size of a chunk before it is compressed, in bytes: half a second at 1200 answers a second without images is 4 MB.
const CHUNK_BYTES: usize = 4 << 20;
/// What writes the file, as its header says.
const LIBRARY: &str = concat!("tactomo ", env!("CARGO_PKG_VERSION"));

/// An MCAP file that is being written.
pub struct McapFile<W: Write> {
    writer: Writer<W>,
    topics: Topics,
    /// Channels, with their numbers in the file.
    channels: Vec<(Topic, u16)>,
    sequence: u32,
    out: Vec<u8>,
    flushed: Instant,
}

impl<W: Write> McapFile<W> {
    /// Begins a file of detectors whose names are different, with what is to be known of it, such as the detector.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn new(out: W, detectors: Vec<Messages>, about: BTreeMap<String, String>) -> io::Result<Self> {
        let mut writer = Writer::new(out, "", LIBRARY, CHUNK_BYTES)?;
        writer.metadata("tactomo", &about)?;
        let topics = Topics::new(detectors);
        let channel = |topic: Topic| {
            let data = &topic.channel.schema();
            let schema = Schema { name: topic.channel.schema_name(), encoding: "jsonschema", data };
            (topic, writer.channel(&topics.name(topic), "json", &[], &schema))
        };
        let channels = topics.all().map(channel).collect();
        Ok(Self { writer, topics, channels, sequence: 0, out: Vec::new(), flushed: Instant::now() })
    }

    /// Writes an event.
    ///
    /// # Errors
    /// If that fails: then nothing more can be written.
    pub fn write(&mut self, delivery: &Delivery) -> io::Result<()> {
        let time_ns = delivery.event.frame.arrived.unix_ns;
        for &(topic, number) in &self.channels {
            self.out.clear();
            if self.topics.write(topic, delivery, &mut self.out)? {
                self.writer.message(number, self.sequence, time_ns, &self.out)?;
            }
        }
        self.sequence = self.sequence.wrapping_add(1);
        Ok(())
    }

    /// Writes the index: the file is complete.
    ///
    /// # Errors
    /// If that fails.
    pub fn finish(mut self) -> io::Result<()> {
        self.writer.finish()
    }

    /// Ends the chunk, if it has lasted long enough.
    fn keep_safe(&mut self) -> io::Result<()> {
        if self.flushed.elapsed() < CHUNK_LASTS {
            return Ok(());
        }
        self.flushed = Instant::now();
        self.writer.end_chunk()
    }
}

impl<W: Write + Send + 'static> Sink for McapFile<W> {
    fn take(&mut self, delivery: &Delivery, _: bool) -> io::Result<()> {
        self.write(delivery)?;
        self.keep_safe()
    }

    fn rest(&mut self) -> io::Result<()> {
        self.keep_safe()
    }

    fn finish(&mut self) -> io::Result<()> {
        self.writer.finish()
    }
}

impl Sinks {
    /// Adds an MCAP file, which has to be a new one.
    ///
    /// # Errors
    /// [`StreamError`] if the file is there already or cannot be made.
    pub fn add_mcap(
        &mut self,
        path: &Path,
        detectors: Vec<Messages>,
        about: BTreeMap<String, String>,
    ) -> Result<(), StreamError> {
        let file = BufWriter::new(new_file::create(path)?);
        let file = McapFile::new(file, detectors, about).map_err(|source| NewFileError::of(path, source))?;
        let name = format!("{}", path.display());
        self.run(name.clone(), (Keeps::All, None), DISK_PATIENCE, file).map_err(StreamError::thread(&name))
    }
}
