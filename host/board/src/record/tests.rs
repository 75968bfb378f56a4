//! Files that are whole, cut and damaged.

use std::io::Cursor;
use std::path::Path;

use proptest::prelude::*;

use super::*;

type Chunks = Vec<(u64, Vec<u8>)>;

fn header() -> Header {
    Header {
        detector: "square-60".into(),
        source: "test".into(),
        started_unix_s: 1,
        started_unix_us: 1_000_000,
        notes: "ä".into(),
        ..Header::default()
    }
}

/// The recording, and where its headers and each chunk end.
fn written(chunks: &Chunks) -> (Vec<u8>, Vec<usize>) {
    let mut writer = RecordWriter::new(Vec::new(), &header()).unwrap();
    let mut ends = vec![writer.get_ref().len()];
    for (time_us, bytes) in chunks {
        writer.write(*time_us, bytes).unwrap();
        ends.push(writer.get_ref().len());
    }
    (writer.out, ends)
}

fn open(file: &[u8]) -> Result<RecordReader<Cursor<&[u8]>>, RecordError> {
    RecordReader::new(Cursor::new(file), Path::new("some.file"))
}

fn rest(reader: &mut RecordReader<Cursor<&[u8]>>) -> Chunks {
    let mut bytes = Vec::new();
    std::iter::from_fn(|| reader.next_into(&mut bytes).unwrap().map(|time_us| (time_us, bytes.clone()))).collect()
}

fn read(file: &[u8]) -> Option<(Chunks, Loss)> {
    let mut reader = open(file).ok()?;
    Some((rest(&mut reader), reader.loss()))
}

/// Chunks with times that never fall.
fn any_chunks(count: std::ops::Range<usize>) -> impl Strategy<Value = Chunks> {
    prop::collection::vec((0u64..10_000_000, prop::collection::vec(any::<u8>(), 1..300)), count).prop_map(
        |mut chunks| {
            chunks.sort();
            chunks
        },
    )
}

#[test]
fn long_reads_are_cut_and_come_back_whole() {
    let bytes: Vec<u8> = (0..200_000u32).map(|i| i as u8).collect();
    let (chunks, loss) = read(&written(&vec![(9, bytes.clone())]).0).unwrap();
    assert_eq!((chunks.len(), loss), (4, Loss::default()));
    assert_eq!(chunks.into_iter().flat_map(|chunk| chunk.1).collect::<Vec<_>>(), bytes);
}

#[test]
fn other_files_and_recordings_of_other_versions_are_refused() {
    let refusal = |file: &[u8]| open(file).unwrap_err();
    assert!(matches!(refusal(b"a letter to somebody"), RecordError::NotARecording { .. }));
    assert!(matches!(refusal(b""), RecordError::NotARecording { .. }));
    assert!(matches!(refusal(&MAGIC), RecordError::NotARecording { .. }));
    for version in [1, 3] {
        let other = [&MAGIC[..], &[version], b"whatever it may be"].concat();
        assert_eq!(
            refusal(&other).to_string(),
            format!(
                "some.file is a recording in version {version} of the format, and this program reads version 2: use the program that \
                 recorded it"
            )
        );
    }
}

#[test]
fn both_headers_damaged_cost_what_they_said_and_no_chunk() {
    let chunks = vec![(3, b"first".to_vec()), (9, b"second".to_vec())];
    let (mut file, ends) = written(&chunks);
    let length = (ends[0] - MAGIC.len() - 1) / 2;
    for copy in 0..2 {
        file[MAGIC.len() + 1 + copy * length + 30] ^= 1;
    }
    let mut reader = open(&file).unwrap();
    assert_eq!(reader.header(), &Header::default());
    assert_eq!(rest(&mut reader), chunks);
    assert_eq!(reader.loss().header, HeaderDamage::Lost);
    assert!(reader.loss().to_string().contains("its header is lost"));
}

#[test]
fn the_detector_is_in_the_recording_a_curved_one_with_its_surface() {
    use tactomo_physics::detector::Detector;
    let preset = Detector::preset("fingertip-10").unwrap();
    let header = Header::of(&preset, "test".into(), 7);
    let file = RecordWriter::new(Vec::new(), &header).unwrap().out;
    let read = open(&file).unwrap().header().clone();
    assert_eq!(read.detector(Path::new("x")).unwrap().as_ref(), Some(&preset));
    assert!(read.is_of(&preset) && !read.is_of(&Detector::preset("square-60").unwrap()));
    let force = Some(tactomo_physics::detector::ForceLaw::siemens());
    assert!(read.is_of(&Detector { force, skin: None, ..preset }), "whatever is known of its forces and its softness");

    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../examples/detectors/fingertip.toml");
    let curved = Detector::read(&path).unwrap();
    let file = RecordWriter::new(Vec::new(), &Header::of(&curved, "test".into(), 7)).unwrap().out;
    let read = open(&file).unwrap().header().clone();
    let again = read.detector(Path::new("x")).unwrap().unwrap();
    assert_eq!(again.surface.as_ref().map(|s| &s.triangles), curved.surface.as_ref().map(|s| &s.triangles));
    assert!(read.is_of(&curved));

    // A header that names a file without having it is damaged or meant badly.
    for named in ["fingertip.obj", "/dev/zero"] {
        let toml = read.detector_toml.as_ref().map(|toml| toml.replace("fingertip.obj", named));
        let without = Header { detector_toml: toml, surface_obj: None, ..read.clone() };
        let error = without.detector(Path::new("some.file")).unwrap_err();
        let source = std::error::Error::source(&error).map(ToString::to_string).unwrap_or_default();
        assert!(format!("{error} {source}").contains("may name another one"), "{error} {source}");
    }

    assert!(self::header().detector(Path::new("x")).unwrap().is_none(), "the name alone tells no detector");
    let wrong = Header { detector_toml: Some("drive_v = \"two\"".into()), ..self::header() };
    let error = wrong.detector(Path::new("some.file")).unwrap_err().to_string();
    assert!(error.contains("some.file") && error.contains("--detector"), "{error}");
}

/// The chunks that were not damaged have to come back, in order; in place of the damaged one there may be one of the same length.
fn assert_others_survive(kept: &Chunks, chunks: &Chunks, victim: Option<usize>) -> Result<(), TestCaseError> {
    let others: Chunks =
        chunks.iter().enumerate().filter(|(i, _)| Some(*i) != victim).map(|(_, c)| c.clone()).collect();
    let mut without = kept.clone();
    if let Some(victim) = victim.filter(|_| kept.len() == chunks.len()) {
        let salvaged = without.remove(victim);
        prop_assert_eq!(salvaged.1.len(), chunks[victim].1.len());
    }
    prop_assert_eq!(without, others);
    Ok(())
}

proptest! {
    #[test]
    fn what_is_written_is_read(chunks in any_chunks(0..8)) {
        let file = written(&chunks).0;
        let reader = open(&file).unwrap();
        prop_assert_eq!(reader.header(), &header());
        prop_assert_eq!(read(&file), Some((chunks, Loss::default())));
    }

    #[test]
    fn a_file_that_was_cut_keeps_every_whole_chunk(chunks in any_chunks(0..8), cut in any::<prop::sample::Index>()) {
        let copy = (written(&Vec::new()).0.len() - MAGIC.len() - 1) / 2;
        let (file, ends) = written(&chunks);
        let cut = cut.index(file.len() + 1);
        let whole = ends.iter().filter(|end| **end <= cut).count();
        let Some(last_end) = whole.checked_sub(1).map(|last| ends[last]) else {
            let expects_none = cut < ends[0] - copy;
            prop_assert_eq!(read(&file[..cut]).map(|read| read.0), (!expects_none).then(Vec::new), "cut inside the header");
            return Ok(());
        };
        let (kept, loss) = read(&file[..cut]).unwrap();
        prop_assert_eq!(&kept[..], &chunks[..whole - 1]);
        prop_assert_eq!(loss, Loss { tail_bytes: (cut - last_end) as u64, ..Loss::default() });
    }

    #[test]
    fn one_flipped_bit_anywhere_costs_its_chunk_alone_and_is_counted(
        chunks in any_chunks(1..8),
        at in any::<prop::sample::Index>(),
        bit in 0..8u32,
    ) {
        let (mut file, ends) = written(&chunks);
        let at = at.index(file.len());
        file[at] ^= 1u8 << bit;
        let victim = ends.iter().position(|end| at < *end).unwrap_or_default().checked_sub(1);
        let (kept, loss) = read(&file).unwrap();
        assert_others_survive(&kept, &chunks, victim)?;
        prop_assert!(loss.is_any(), "at {} of {}", at, file.len());
        match victim {
            None => prop_assert!(loss.header != HeaderDamage::None && loss.damaged_places == 0, "{:?}", loss),
            // A last chunk that claims to be longer than the file looks like one that was cut.
            Some(victim) => prop_assert!(
                loss.damaged_places == 1 || victim + 1 == chunks.len() && loss.tail_bytes > 0, "{:?}", loss
            ),
        }
    }

    #[test]
    fn several_flipped_bits_cost_their_chunks_alone(
        chunks in any_chunks(2..10),
        flips in prop::collection::vec((any::<prop::sample::Index>(), 0..8u32), 1..6),
    ) {
        let (mut file, ends) = written(&chunks);
        let mut victims = Vec::new();
        for (at, bit) in &flips {
            let at = ends[0] + at.index(file.len() - ends[0]);
            file[at] ^= 1u8 << bit;
            victims.push(ends.iter().position(|end| at < *end).unwrap_or_default() - 1);
        }
        let (kept, loss) = read(&file).unwrap();
        let survive = chunks.iter().enumerate().all(|(i, chunk)| victims.contains(&i) || kept.contains(chunk));
        prop_assert!(survive, "{} of {} kept, {:?} damaged", kept.len(), chunks.len(), victims);
        // Two flips may undo each other.
        prop_assert!(loss.is_any() || kept == chunks);
    }

    #[test]
    fn bytes_that_are_put_in_or_taken_out_cost_their_chunk_alone(
        chunks in any_chunks(1..8),
        at in any::<prop::sample::Index>(),
        junk in prop::collection::vec(any::<u8>(), 0..100),
        taken in 0..60usize,
    ) {
        let (mut file, ends) = written(&chunks);
        let at = ends[0] + at.index(file.len() - ends[0]);
        let victim = ends.iter().position(|end| at < *end).unwrap_or_default() - 1;
        // Within one chunk, so that it is known which.
        let taken = taken.min(ends[victim + 1] - at);
        file.splice(at..at + taken, junk.iter().copied());
        let (kept, _) = read(&file).unwrap();
        let others: Chunks = [&chunks[..victim], &chunks[victim + 1..]].concat();
        let found = others.iter().all(|chunk| kept.contains(chunk));
        prop_assert!(found, "{} of {} kept", kept.len(), chunks.len());
    }

    #[test]
    fn what_stands_before_a_recording_is_passed_over_and_counted(
        chunks in any_chunks(0..5),
        junk in prop::collection::vec(any::<u8>(), 1..3000),
    ) {
        let file = written(&chunks).0;
        let before = [&junk[..], &file].concat();
        prop_assert!(is_recording(&before));
        let loss = Loss { junk_bytes: junk.len() as u64, ..Loss::default() };
        prop_assert_eq!(read(&before), Some((chunks.clone(), loss)));
        let mut reader = open(&before).unwrap();
        reader.seek(0).unwrap();
        prop_assert_eq!(rest(&mut reader), chunks.clone());
    }

    #[test]
    fn any_bytes_are_read_without_panic(tail in prop::collection::vec(any::<u8>(), 0..2000), to_us in any::<u64>()) {
        prop_assert!(read(&tail).is_none());
        let mut file = written(&Vec::new()).0;
        file.extend(&tail);
        let (chunks, _) = read(&file).unwrap();
        prop_assert!(chunks.iter().map(|chunk| chunk.1.len()).sum::<usize>() <= tail.len());
        let mut reader = open(&file).unwrap();
        reader.last_time_us().unwrap();
        reader.seek(to_us).unwrap();
        prop_assert!(rest(&mut reader).len() <= chunks.len());
    }

    #[test]
    fn seeking_finds_the_first_chunk_of_a_time(
        count in 1..200u64,
        length in 1..5000usize,
        to in any::<prop::sample::Index>(),
        damage in prop::option::of(any::<prop::sample::Index>()),
    ) {
        let chunks: Chunks = (0..count).map(|i| (i * 1000, vec![i as u8; length])).collect();
        let (mut file, ends) = written(&chunks);
        let to = to.index(chunks.len() + 1) as u64;
        let victim = damage.map(|damage| damage.index(chunks.len()));
        if let Some(victim) = victim {
            file[ends[victim]] ^= 0x10; // Mark or time.
        }
        let mut reader = open(&file).unwrap();
        let last = chunks.iter().enumerate().rev().find(|(i, _)| Some(*i) != victim).map(|(_, chunk)| chunk.0);
        prop_assert_eq!(reader.last_time_us().unwrap(), last);
        reader.seek(to * 1000).unwrap();
        let mut bytes = Vec::new();
        let expected = chunks.iter().enumerate().find(|(i, _)| *i as u64 >= to && Some(*i) != victim);
        prop_assert_eq!(reader.next_into(&mut bytes).unwrap(), expected.map(|(_, chunk)| chunk.0));
        reader.rewind().unwrap();
        prop_assert!(rest(&mut reader).len() + 1 >= chunks.len());
        let loss = reader.loss();
        reader.rewind().unwrap();
        rest(&mut reader);
        prop_assert_eq!(reader.loss(), loss, "what is read again is not counted again");
    }
}
