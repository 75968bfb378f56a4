//! Files read back by a reader of the specification's tables, which knows nothing of the writer.

use std::io::Read;

use super::*;

const SCHEMA: Schema = Schema { name: "a.Schema", encoding: "jsonschema", data: "{}" };

/// What is left of a record, or of a file.
struct Bytes<'a>(&'a [u8]);

impl<'a> Bytes<'a> {
    fn take(&mut self, count: usize) -> &'a [u8] {
        self.0.split_off(..count).unwrap()
    }

    fn number(&mut self, count: usize) -> u64 {
        self.take(count).iter().rev().fold(0, |number, byte| number << 8 | u64::from(*byte))
    }

    fn prefixed(&mut self) -> &'a [u8] {
        let count = self.number(4) as usize;
        self.take(count)
    }

    fn text(&mut self) -> &'a str {
        std::str::from_utf8(self.prefixed()).unwrap()
    }

    /// A map, or an array of pairs, of numbers of so many bytes.
    fn pairs(&mut self, [key, value]: [usize; 2]) -> Vec<(u64, u64)> {
        let mut entries = Bytes(self.prefixed());
        std::iter::from_fn(|| (!entries.0.is_empty()).then(|| (entries.number(key), entries.number(value)))).collect()
    }

    fn record(&mut self) -> (u8, Bytes<'a>) {
        let (op, length) = (self.number(1) as u8, self.number(8) as usize);
        (op, Bytes(self.take(length)))
    }
}

/// The record at a place in a file.
fn at(file: &[u8], place: u64) -> (u8, Bytes<'_>) {
    Bytes(&file[place as usize..]).record()
}

/// Opcodes of all records one after another.
fn opcodes(records: &[u8]) -> Vec<u8> {
    let mut rest = Bytes(records);
    std::iter::from_fn(|| (!rest.0.is_empty()).then(|| rest.record().0)).collect()
}

/// CRC-32 bit by bit, as ISO 3309 has it.
fn crc_of(bytes: &[u8]) -> u64 {
    let crc = bytes.iter().fold(u32::MAX, |crc, byte| {
        (0..8).fold(crc ^ u32::from(*byte), |crc, _| if crc & 1 == 1 { crc >> 1 ^ 0xedb8_8320 } else { crc >> 1 })
    });
    u64::from(!crc)
}

/// Size, checksum and records of a chunk after its two times.
fn unpacked(mut chunk: Bytes) -> Vec<u8> {
    let (size, crc, compression, stored) = (chunk.number(8), chunk.number(4), chunk.text(), chunk.number(8));
    assert_eq!((compression, stored), ("lz4", chunk.0.len() as u64));
    let mut records = Vec::new();
    lz4_flex::frame::FrameDecoder::new(chunk.0).read_to_end(&mut records).unwrap();
    assert_eq!((records.len() as u64, crc_of(&records)), (size, crc));
    records
}

/// A writer of two channels; the number of a message's channel is its time modulo 2.
fn begun(chunk_bytes: usize) -> (Writer<Vec<u8>>, [u16; 2]) {
    let mut writer = Writer::new(Vec::new(), "", "tests", chunk_bytes).unwrap();
    writer.metadata("about", &BTreeMap::from([("detector".to_owned(), "round".to_owned())])).unwrap();
    let channels = ["/even", "/odd"].map(|topic| writer.channel(topic, "json", &[], &SCHEMA));
    (writer, channels)
}

/// Twenty messages with times that go back and forth (ns).
fn twenty(writer: &mut Writer<Vec<u8>>, channels: [u16; 2]) {
    for i in 0..20 {
        let time_ns = 1000 + (i * 7) % 20;
        writer.message(channels[time_ns as usize % 2], i as u32, time_ns, format!("message {i}").as_bytes()).unwrap();
    }
}

#[test]
fn the_index_leads_to_every_message() {
    let (mut writer, channels) = begun(300);
    twenty(&mut writer, channels);
    writer.finish().unwrap();
    let file = writer.out;
    assert!(file.starts_with(b"\x89MCAP0\r\n") && file.ends_with(b"\x89MCAP0\r\n"));

    let mut footer = at(&file, file.len() as u64 - 8 - 29);
    assert_eq!((footer.0, footer.1.0.len()), (2, 20));
    let [start, offset_start] = [footer.1.number(8), footer.1.number(8)];
    assert_eq!(footer.1.number(4), crc_of(&file[start as usize..file.len() - 12]));
    let (op, mut data_end) = at(&file, start - 13);
    assert_eq!((op, data_end.number(4)), (0x0f, crc_of(&file[..start as usize - 13])));

    let mut groups = Bytes(&file[offset_start as usize..file.len() - 8 - 29]);
    let (mut chunks, mut found, mut place) = (0, Vec::new(), start);
    for expected in [3, 4, 0x0b, 8, 0x0d] {
        let (op, mut group) = groups.record();
        let [group_op, group_start, length] = [group.number(1), group.number(8), group.number(8)];
        assert_eq!((op, group_op, group_start), (0x0e, expected, place));
        place += length;
        let records = &file[group_start as usize..place as usize];
        assert!(opcodes(records).iter().all(|op| u64::from(*op) == expected));
        let mut rest = Bytes(records);
        while !rest.0.is_empty() {
            match rest.record() {
                (8, index) => {
                    chunks += 1;
                    found.extend(messages(&file, index));
                }
                (0x0d, mut index) => {
                    let (offset, length, name) = (index.number(8), index.number(8), index.text());
                    let (op, mut metadata) = at(&file, offset);
                    assert_eq!(
                        (op, length, metadata.text(), name),
                        (0x0c, metadata_length(&metadata), "about", "about")
                    );
                    let mut entries = Bytes(metadata.prefixed());
                    assert_eq!((entries.text(), entries.text()), ("detector", "round"));
                }
                (0x0b, mut statistics) => {
                    let counts = [8, 2, 4, 4, 4, 4].map(|size| statistics.number(size));
                    assert_eq!(counts[..5], [20, 2, 2, 0, 1]);
                    assert!(counts[5] > 2, "{counts:?}");
                    assert_eq!([statistics.number(8), statistics.number(8)], [1000, 1019]);
                    assert_eq!(statistics.pairs([2, 8]), channels.map(|id| (u64::from(id), 10)));
                }
                _ => {}
            }
        }
    }
    assert!(groups.0.is_empty() && place == offset_start && chunks > 2);
    found.sort();
    let expected = (0..20).map(|i| (i, 1000 + (i * 7) % 20, format!("message {i}").into_bytes()));
    assert!(found.into_iter().eq(expected));
}

/// Length of a metadata record with its opcode and the length itself.
fn metadata_length(metadata: &Bytes) -> u64 {
    // The name was read already.
    metadata.0.len() as u64 + 4 + 5 + 9
}

/// Sequence number, time and data of the messages of a chunk, as its index finds them.
fn messages(file: &[u8], mut index: Bytes) -> Vec<(u64, u64, Vec<u8>)> {
    let [first, last, chunk_place, chunk_length] = [8; 4].map(|size| index.number(size));
    let (op, mut chunk) = at(file, chunk_place);
    assert_eq!((op, chunk.0.len() as u64 + 9), (6, chunk_length));
    assert_eq!([chunk.number(8), chunk.number(8)], [first, last]);
    let records = unpacked(chunk);
    let (mut all, mut next) = (Vec::new(), chunk_place + chunk_length);
    for (channel, place) in index.pairs([2, 8]) {
        assert_eq!(place, next, "indexes follow their chunk");
        let (op, mut entries) = at(file, place);
        next += entries.0.len() as u64 + 9;
        assert_eq!((op, entries.number(2)), (7, channel));
        for (time_ns, offset) in entries.pairs([8, 8]) {
            let (op, mut message) = at(&records, offset);
            let head = [2, 4, 8, 8].map(|size| message.number(size));
            assert_eq!((op, head[0], head[2], head[3]), (5, channel, time_ns, time_ns));
            assert!((first..=last).contains(&time_ns));
            all.push((head[1], time_ns, message.0.to_vec()));
        }
    }
    assert_eq!(index.number(8), next - chunk_place - chunk_length);
    assert_eq!((index.text(), index.number(8) + 9 + 16 + 8 + 4 + 7 + 8), ("lz4", chunk_length));
    assert_eq!((index.number(8), index.0.len()), (records.len() as u64, 0));
    all
}

#[test]
fn what_was_written_of_an_unfinished_file_is_whole_chunks_that_explain_themselves() {
    let (mut writer, channels) = begun(usize::MAX);
    twenty(&mut writer, channels);
    writer.end_chunk().unwrap();
    let written = writer.out.len();
    writer.end_chunk().unwrap();
    assert_eq!(writer.out.len(), written, "nothing is written of an empty chunk");
    writer.message(channels[0], 20, 3000, b"lost").unwrap();
    assert_eq!(opcodes(&writer.out[8..]), [1, 0x0c, 6, 7, 7]);
    let mut rest = Bytes(&writer.out[8..]);
    let (_, mut chunk) = [rest.record(), rest.record(), rest.record()].into_iter().next_back().unwrap();
    assert_eq!([chunk.number(8), chunk.number(8)], [1000, 1019]);
    let records = unpacked(chunk);
    let expected: Vec<_> = [3, 4, 3, 4].into_iter().chain([5; 20]).collect();
    assert_eq!(opcodes(&records), expected);
    let mut rest = Bytes(&records);
    let ((_, mut schema), (_, mut channel)) = (rest.record(), rest.record());
    assert_eq!((schema.number(2), schema.text(), schema.text(), schema.text()), (1, "a.Schema", "jsonschema", "{}"));
    assert_eq!((channel.number(2), channel.number(2), channel.text(), channel.text()), (1, 1, "/even", "json"));
    assert!(channel.prefixed().is_empty() && channel.0.is_empty() && schema.0.is_empty());
}

#[test]
fn a_file_without_messages_is_complete() {
    let (mut writer, _) = begun(300);
    writer.finish().unwrap();
    let file = &writer.out[8..writer.out.len() - 8];
    let expected = [1, 0x0c, 6, 0x0f, 3, 3, 4, 4, 0x0b, 8, 0x0d, 0x0e, 0x0e, 0x0e, 0x0e, 0x0e, 2];
    assert_eq!(opcodes(file), expected);
}
