//! Writes MCAP files as <https://mcap.dev/spec> has them. Records, fields and sections have the specification's names.

use std::collections::BTreeMap;
use std::io::{self, Write};

use crc::{CRC_32_ISO_HDLC, Crc, Digest, Table};
use lz4_flex::frame::FrameEncoder;

/// First and last bytes of a file.
const MAGIC: &[u8] = b"\x89MCAP0\r\n";
/// Name of the LZ4 frame format in the specification's registry.
const COMPRESSION: &str = "lz4";
static CRC: Crc<u32, Table<16>> = Crc::<u32, Table<16>>::new(&CRC_32_ISO_HDLC);

/// Opcodes of records.
mod op {
    pub const HEADER: u8 = 0x01;
    pub const FOOTER: u8 = 0x02;
    pub const SCHEMA: u8 = 0x03;
    pub const CHANNEL: u8 = 0x04;
    pub const MESSAGE: u8 = 0x05;
    pub const CHUNK: u8 = 0x06;
    pub const MESSAGE_INDEX: u8 = 0x07;
    pub const CHUNK_INDEX: u8 = 0x08;
    pub const STATISTICS: u8 = 0x0b;
    pub const METADATA: u8 = 0x0c;
    pub const METADATA_INDEX: u8 = 0x0d;
    pub const SUMMARY_OFFSET: u8 = 0x0e;
    pub const DATA_END: u8 = 0x0f;
}

/// What the messages of a channel are.
pub(super) struct Schema<'a> {
    /// Its name.
    pub name: &'a str,
    /// What it is written in, such as `jsonschema`.
    pub encoding: &'a str,
    /// The schema itself.
    pub data: &'a str,
}

/// A file that is being written: chunks as they are ended, and an index of them at the end.
pub(super) struct Writer<W> {
    out: W,
    /// Bytes before the next record, and their checksum.
    written: u64,
    crc: Digest<'static, u32, Table<16>>,
    /// Size from which a chunk is ended, in bytes before it is compressed.
    chunk_bytes: usize,
    chunk: Chunk,
    summary: Summary,
}

/// Records that wait to be compressed and written.
#[derive(Default)]
struct Chunk {
    records: Vec<u8>,
    span: Span,
    /// Time and place of each message, by channel, as a Message Index has them.
    messages: BTreeMap<u16, Vec<u8>>,
}

/// Records of the summary section, and what its statistics count.
#[derive(Default)]
struct Summary {
    schemas: Vec<u8>,
    channels: Vec<u8>,
    chunk_indexes: Vec<u8>,
    metadata_indexes: Vec<u8>,
    chunks: u32,
    metadata: u32,
    /// Messages of each channel.
    messages: BTreeMap<u16, u64>,
    span: Span,
}

/// Earliest and latest log time of messages (ns).
#[derive(Clone, Copy, Default)]
struct Span(Option<(u64, u64)>);

impl Span {
    fn add(&mut self, time_ns: u64) {
        let (first, last) = self.0.unwrap_or((time_ns, time_ns));
        self.0 = Some((first.min(time_ns), last.max(time_ns)));
    }

    /// Both as a record has them: zero without messages.
    fn bytes(self) -> Vec<u8> {
        let (first, last) = self.0.unwrap_or_default();
        [first.to_le_bytes(), last.to_le_bytes()].concat()
    }
}

impl<W: Write> Writer<W> {
    /// Begins a file of a profile, `""` if of none, whose chunks end at a size, in bytes before they are compressed.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn new(out: W, profile: &str, library: &str, chunk_bytes: usize) -> io::Result<Self> {
        let (chunk, summary) = Default::default();
        let mut writer = Self { out, written: 0, crc: CRC.digest(), chunk_bytes, chunk, summary };
        let mut head = MAGIC.to_vec();
        put(&mut head, op::HEADER, &[&string(profile), &string(library)]);
        writer.write(&head)?;
        Ok(writer)
    }

    /// Writes a Metadata record.
    ///
    /// # Errors
    /// If that fails.
    pub fn metadata(&mut self, name: &str, metadata: &BTreeMap<String, String>) -> io::Result<()> {
        let entries = map(metadata.iter().map(|(key, value)| [string(key), string(value)].concat()));
        let mut record = Vec::new();
        put(&mut record, op::METADATA, &[&string(name), &entries]);
        let place = [self.written.to_le_bytes(), (record.len() as u64).to_le_bytes()].concat();
        put(&mut self.summary.metadata_indexes, op::METADATA_INDEX, &[&place, &string(name)]);
        self.summary.metadata += 1;
        self.write(&record)
    }

    /// Adds a channel with metadata and a schema of its own, and gives its number.
    pub fn channel(&mut self, topic: &str, message_encoding: &str, metadata: &[(&str, &str)], schema: &Schema) -> u16 {
        let id = self.summary.messages.len() as u16 + 1;
        self.summary.messages.insert(id, 0);
        let number = id.to_le_bytes();
        let described = [schema.name, schema.encoding, schema.data].map(string).concat();
        let metadata = map(metadata.iter().map(|(key, value)| [string(key), string(value)].concat()));
        let channel = [string(topic), string(message_encoding), metadata].concat();
        for records in [&mut self.chunk.records, &mut self.summary.schemas] {
            put(records, op::SCHEMA, &[&number, &described]);
        }
        for records in [&mut self.chunk.records, &mut self.summary.channels] {
            put(records, op::CHANNEL, &[&number, &number, &channel]);
        }
        id
    }

    /// Adds a message of a channel, whose log time is that of its publication (ns); ends the chunk if that is large enough.
    ///
    /// # Errors
    /// If that cannot be written.
    pub fn message(&mut self, channel: u16, sequence: u32, time_ns: u64, data: &[u8]) -> io::Result<()> {
        let (id, time) = (channel.to_le_bytes(), time_ns.to_le_bytes());
        let offset = (self.chunk.records.len() as u64).to_le_bytes();
        self.chunk.messages.entry(channel).or_default().extend([time, offset].concat());
        self.chunk.span.add(time_ns);
        self.summary.span.add(time_ns);
        *self.summary.messages.entry(channel).or_default() += 1;
        put(&mut self.chunk.records, op::MESSAGE, &[&id, &sequence.to_le_bytes(), &time, &time, data]);
        if self.chunk.records.len() < self.chunk_bytes {
            return Ok(());
        }
        self.end_chunk()
    }

    /// Writes the chunk, if there is anything in it.
    ///
    /// # Errors
    /// If that fails.
    pub fn end_chunk(&mut self) -> io::Result<()> {
        let Chunk { records, span, messages } = std::mem::take(&mut self.chunk);
        if records.is_empty() {
            return Ok(());
        }
        let compressed = compressed(&records)?;
        let sizes = [compressed.len(), records.len()].map(|size| (size as u64).to_le_bytes());
        let [compressed_size, size] = &sizes;
        let crc = CRC.checksum(&records).to_le_bytes();
        let mut out = Vec::with_capacity(compressed.len() + (1 << 16));
        put(&mut out, op::CHUNK, &[&span.bytes(), size, &crc, &string(COMPRESSION), compressed_size, &compressed]);
        let length = out.len() as u64;
        let mut index_offsets = Vec::new();
        for (channel, entries) in &messages {
            let offset = self.written + out.len() as u64;
            index_offsets.push([&channel.to_le_bytes()[..], &offset.to_le_bytes()].concat());
            put(&mut out, op::MESSAGE_INDEX, &[&channel.to_le_bytes(), &prefixed(entries)]);
        }
        let place = [self.written, length].map(u64::to_le_bytes).concat();
        let index_length = (out.len() as u64 - length).to_le_bytes();
        let fields: &[&[u8]] =
            &[&span.bytes(), &place, &map(index_offsets), &index_length, &string(COMPRESSION), &sizes.concat()];
        put(&mut self.summary.chunk_indexes, op::CHUNK_INDEX, fields);
        self.summary.chunks += 1;
        self.write(&out)?;
        self.out.flush()
    }

    /// Writes what is left and the summary: the file is complete, and nothing may be added.
    ///
    /// # Errors
    /// If that fails.
    pub fn finish(&mut self) -> io::Result<()> {
        self.end_chunk()?;
        let mut end = Vec::new();
        put(&mut end, op::DATA_END, &[&self.crc.clone().finalize().to_le_bytes()]);
        let start = self.written + end.len() as u64;
        end.extend(std::mem::take(&mut self.summary).section(start));
        end.extend(MAGIC);
        self.write(&end)?;
        self.out.flush()
    }

    fn write(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.out.write_all(bytes)?;
        self.crc.update(bytes);
        self.written += bytes.len() as u64;
        Ok(())
    }
}

impl Summary {
    /// The summary section, which begins at a place in the file, with its offsets and the footer.
    fn section(self, start: u64) -> Vec<u8> {
        let statistics = self.statistics();
        let groups = [
            (op::SCHEMA, self.schemas),
            (op::CHANNEL, self.channels),
            (op::STATISTICS, statistics),
            (op::CHUNK_INDEX, self.chunk_indexes),
            (op::METADATA_INDEX, self.metadata_indexes),
        ];
        let (mut section, mut offsets) = (Vec::new(), Vec::new());
        for (op, records) in groups.into_iter().filter(|(_, records)| !records.is_empty()) {
            let place = [start + section.len() as u64, records.len() as u64].map(u64::to_le_bytes).concat();
            put(&mut offsets, op::SUMMARY_OFFSET, &[&[op], &place]);
            section.extend(records);
        }
        let offset_start = start + section.len() as u64;
        section.extend(offsets);
        let no_crc = [0; 4];
        put(&mut section, op::FOOTER, &[&start.to_le_bytes(), &offset_start.to_le_bytes(), &no_crc]);
        // Of all before it, the beginning of the footer too.
        section.truncate(section.len() - no_crc.len());
        let crc = CRC.checksum(&section);
        section.extend(crc.to_le_bytes());
        section
    }

    fn statistics(&self) -> Vec<u8> {
        let channels = self.messages.len();
        let (schema_count, attachment_count) = (channels as u16, 0);
        let counts = [channels as u32, attachment_count, self.metadata, self.chunks].map(u32::to_le_bytes).concat();
        let messages =
            map(self.messages.iter().map(|(id, count)| [&id.to_le_bytes()[..], &count.to_le_bytes()].concat()));
        let all = self.messages.values().sum::<u64>().to_le_bytes();
        let mut record = Vec::new();
        put(&mut record, op::STATISTICS, &[&all, &schema_count.to_le_bytes(), &counts, &self.span.bytes(), &messages]);
        record
    }
}

/// Appends a record: its opcode, the length of its content, and its fields.
fn put(out: &mut Vec<u8>, op: u8, fields: &[&[u8]]) {
    let length: usize = fields.iter().map(|field| field.len()).sum();
    out.push(op);
    out.extend((length as u64).to_le_bytes());
    fields.iter().for_each(|field| out.extend_from_slice(field));
}

/// Bytes behind their number, as strings, arrays and maps are.
fn prefixed(bytes: &[u8]) -> Vec<u8> {
    [&(bytes.len() as u32).to_le_bytes(), bytes].concat()
}

fn string(text: &str) -> Vec<u8> {
    prefixed(text.as_bytes())
}

/// A map, of entries that are a key and its value in bytes.
fn map(entries: impl IntoIterator<Item = Vec<u8>>) -> Vec<u8> {
    prefixed(&entries.into_iter().flatten().collect::<Vec<_>>())
}

fn compressed(records: &[u8]) -> io::Result<Vec<u8>> {
    let mut encoder = FrameEncoder::new(Vec::new());
    encoder.write_all(records)?;
    Ok(encoder.finish()?)
}

#[cfg(test)]
mod tests;
