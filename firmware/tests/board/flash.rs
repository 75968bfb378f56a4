//! Tables in flash, which keeps to the rules of NOR flash, fails and loses power.

use std::sync::LazyLock;

use crc::{CRC_32_ISO_HDLC, Crc};
use proptest::prelude::*;
use proptest::sample::select;
use tactomo_firmware::{ContactFinder, FlashStore, RamCopy, TableStore, Touch, View};
use tactomo_protocol::{Hello, MAX_PIECE, Output, Settings, TablePiece, TableState};
use tactomo_touch_core::Contents;
use tactomo_touch_core::table::{Head, OTHERS, RADII};

use crate::nor_flash::{Chip, Trouble};

/// Room for a table (bytes), and where the two places begin: one behind the other.
const ROOM: usize = 128 * 1024;
const BASES: [usize; 2] = [2 * ROOM, ROOM];
/// What lies before and behind them.
const END: usize = 3 * ROOM;

static FIRST: LazyLock<Vec<u8>> = LazyLock::new(|| table_of([36, 36]));
static SECOND: LazyLock<Vec<u8>> = LazyLock::new(|| table_of([30, 36]));
/// As the first but for one coefficient.
static ALIKE: LazyLock<Vec<u8>> = LazyLock::new(|| {
    let mut table = FIRST.clone();
    let end = table.len() - 4;
    table[70_000] ^= 1;
    let checksum = Crc::<u32>::new(&CRC_32_ISO_HDLC).checksum(&table[..end]);
    table[end..].copy_from_slice(&checksum.to_le_bytes());
    table
});

/// A table with so many coefficients along its sides, which are anything.
fn table_of(sides: [usize; 2]) -> Vec<u8> {
    const N: usize = 16;
    let head = Head {
        step_x_m: 0.002,
        step_y_m: 0.002,
        radius_m: 0.002,
        radii_m: [0.001, 0.004],
        near_m: 0.002,
        ln_step: 0.5,
        drive_v: 2.0,
        noise_v: 0.001,
        full_v: 1.99,
        sheet_s: 1e-3,
        top_s_per_m: 0.2,
        constriction_ohm: 1.0,
        ..Head::default()
    };
    let mut random = fastrand::Rng::with_seed(sides[0] as u64);
    let cells = (sides[0] - 3) * (sides[1] - 3);
    let coefficients: Vec<_> = (0..sides[0] * sides[1] * RADII * (N + OTHERS)).map(|_| random.i16(..)).collect();
    let mut bytes = Vec::new();
    Contents {
        head,
        places_m: &[[0.0; 3]; N],
        sides,
        pads_ohm: &[1000.0; N * (N + 1) / 2],
        channels: &[[1.0, 0.0]; N],
        distances_ohm: &[0.0; 4],
        walls: &[0.0; (N + 1) * (N + 2) / 2],
        codes: &[[0.0, 1.0]; RADII * (N + OTHERS)],
        mask: &vec![255; cells.div_ceil(8)],
        coefficients: &coefficients,
    }
    .write(&mut bytes);
    bytes
}

/// Both ways to see flash.
enum Seen {
    Copied(RamCopy<Vec<u8>>),
    Mapped { base: usize, length: usize },
}

impl<'f, const WORD: usize, const SECTOR: usize> View<&'f mut Chip<WORD, SECTOR>> for Seen {
    fn bytes<'a>(&'a self, flash: &'a &'f mut Chip<WORD, SECTOR>) -> &'a [u8] {
        match self {
            Self::Copied(copy) => copy.bytes(flash),
            Self::Mapped { base, length } => &flash.bytes[*base..base + length],
        }
    }

    fn open(&mut self, flash: &mut &'f mut Chip<WORD, SECTOR>, at: u32) -> bool {
        match self {
            Self::Copied(copy) => copy.open(flash, at),
            Self::Mapped { base, .. } => {
                *base = at as usize;
                true
            }
        }
    }
}

type Finder<'a, const WORD: usize, const SECTOR: usize> =
    ContactFinder<FlashStore<&'a mut Chip<WORD, SECTOR>, Seen>, 256>;

fn store<const WORD: usize, const SECTOR: usize>(
    chip: &mut Chip<WORD, SECTOR>,
    length: usize,
) -> FlashStore<&mut Chip<WORD, SECTOR>, Seen> {
    let seen = match WORD {
        1 => Seen::Mapped { base: BASES[0], length },
        _ => Seen::Copied(RamCopy::new(vec![0; length])),
    };
    FlashStore::new(chip, seen, BASES.map(|base| base as u32))
}

/// A board of this flash, after a reset.
fn reset<const WORD: usize, const SECTOR: usize>(chip: &mut Chip<WORD, SECTOR>) -> Finder<'_, WORD, SECTOR> {
    let mut finder = ContactFinder::new(store(chip, ROOM));
    finder.meet(&Hello {
        answers: 0,
        firmware_version: "0".try_into().unwrap(),
        board: "test".try_into().unwrap(),
        electrodes: 16,
        adc_bits: 12,
        adc_full_scale_mv: 3300,
        drive_mv: 2000,
        settings: Settings::default(),
        is_streaming: false,
        ranges: Default::default(),
    });
    finder
}

/// Checksum of the table that a board uses.
fn usable(finder: &impl Touch) -> Option<u32> {
    finder.table().usable.map(|table| table.checksum)
}

fn checksum(table: &[u8]) -> Option<u32> {
    table.last_chunk().map(|four| u32::from_le_bytes(*four))
}

fn piece(at: usize, bytes: &[u8]) -> TablePiece {
    TablePiece { at: at as u32, bytes: bytes.iter().copied().collect() }
}

/// Sends a table as the host does, in pieces as long as `length` says; how often it was begun. `None` if it was refused.
fn send(finder: &mut impl Touch, table: &[u8], mut length: impl FnMut() -> usize) -> Option<usize> {
    let (mut at, mut begun) = (0, 0);
    loop {
        begun += usize::from(at == 0);
        assert!(begun < 4, "it never ends");
        let end = table.len().min(at + length());
        if !finder.take(&piece(at, &table[at..end])) {
            return None;
        }
        let TableState { held, usable, .. } = finder.table();
        if usable.is_some() {
            return Some(begun);
        }
        at = held as usize;
    }
}

fn whole() -> usize {
    MAX_PIECE
}

/// A table is kept, wears each of its sectors once, a second time none, and gives way to others.
fn tables_come_and_stay<const WORD: usize, const SECTOR: usize>() {
    let mut chip = Chip::<WORD, SECTOR>::new(END + SECTOR, 1);
    let around = |chip: &Chip<WORD, SECTOR>| [chip.bytes[..BASES[1]].to_vec(), chip.bytes[END..].to_vec()];
    let before = around(&chip);
    assert_eq!(usable(&reset(&mut chip)), None);

    let mut finder = reset(&mut chip);
    // A first piece whose answer was lost comes twice.
    assert!(finder.take(&piece(0, &FIRST[..MAX_PIECE])) && finder.take(&piece(0, &FIRST[..MAX_PIECE])));
    assert_eq!(send(&mut finder, &FIRST, whole), Some(1));
    assert_eq!(usable(&reset(&mut chip)), checksum(&FIRST));
    let sectors = FIRST.len().div_ceil(SECTOR);
    let worn = [vec![1; sectors], vec![0; ROOM / SECTOR - sectors]].concat();
    assert_eq!(BASES.map(|base| chip.erased(base)), [worn, vec![0; ROOM / SECTOR]]);

    let operations = chip.operations;
    assert_eq!(send(&mut reset(&mut chip), &FIRST, whole), Some(1));
    assert_eq!(chip.operations, operations, "what is there is written again");

    // Whatever is in the way: the host is told to begin anew where a table turns out to be another.
    for (table, begun) in [(&ALIKE, 2), (&SECOND, 1), (&FIRST, 1)] {
        assert_eq!(send(&mut reset(&mut chip), table, whole), Some(begun));
        assert_eq!(usable(&reset(&mut chip)), checksum(table));
    }
    assert!(around(&chip) == before, "what is around the places has changed");
}

#[test]
fn tables_come_and_stay_and_wear_little() {
    tables_come_and_stay::<4, 4096>();
    tables_come_and_stay::<1, ROOM>();
    tables_come_and_stay::<8, 2048>();
}

/// Whatever is sent: only a table that is whole and sound takes the place of the one before, and only one whose head is of this board wears flash.
#[test]
fn a_table_stays_until_another_is_whole_and_sound() {
    let mut chip = Chip::<4, 4096>::new(END, 5);
    assert_eq!(send(&mut reset(&mut chip), &FIRST, whole), Some(1));
    let with = |at: usize, bytes: &[u8]| {
        let mut table = SECOND.clone();
        table[at..at + bytes.len()].copy_from_slice(bytes);
        table
    };
    // Another magic, version, count of electrodes and of coefficients, length, and drive.
    let foreign: [(usize, &[u8]); 6] =
        [(0, b"X"), (4, &[9]), (6, &[8]), (8, &[200]), (16, &[1, 2, 3, 4]), (24 + 4 * 9, &[0, 0, 0x80, 0x40])];
    let operations = chip.operations;
    for (at, bytes) in foreign {
        assert_eq!(send(&mut reset(&mut chip), &with(at, bytes), whole), None, "byte {at}");
    }
    let mut finder = reset(&mut chip);
    assert!(finder.take(&piece(0, &SECOND[..MAX_PIECE])));
    assert_eq!(finder.table().usable, None, "while another comes");
    assert_eq!(chip.operations, operations, "nothing is erased before the head has come");

    let mut finder = reset(&mut chip);
    assert_eq!(send(&mut finder, &with(50_000, &[1, 2, 3]), whole), None, "a wrong checksum");
    assert_eq!(usable(&finder), checksum(&FIRST));
    assert_eq!(usable(&reset(&mut chip)), checksum(&FIRST));
    assert!(chip.operations > operations);
    for pieces in [2, 3, 700] {
        let mut finder = reset(&mut chip);
        let mut sent = SECOND.chunks(MAX_PIECE).take(pieces).enumerate();
        assert!(sent.all(|(number, bytes)| finder.take(&piece(number * MAX_PIECE, bytes))));
        assert!(finder.set_output(Output::Contacts), "contacts by the one before");
        assert_eq!(usable(&reset(&mut chip)), checksum(&FIRST), "cut off after {pieces} pieces");
    }
    // A piece too long for the table, at its end.
    let mut finder = reset(&mut chip);
    let mut long = SECOND.clone();
    long.extend([0; 8]);
    assert_eq!(send(&mut finder, &long, whole), None);
    assert_eq!(usable(&finder), checksum(&FIRST));
    assert_eq!(send(&mut finder, &SECOND, whole), Some(1));
    assert_eq!(usable(&reset(&mut chip)), checksum(&SECOND));
}

#[test]
fn a_table_too_long_and_a_region_that_is_none_are_refused() {
    let mut chip = Chip::<4, 4096>::new(END, 2);
    for (length, room) in [(ROOM, ROOM), (64 * 1024, 64 * 1024), (ROOM + 4096, 0), (4096 + 64, 0), (0, 0)] {
        let mut finder = ContactFinder::<_, 256>::new(store(&mut chip, length));
        assert_eq!(finder.table().room as usize, room);
        if room < FIRST.len() {
            assert_eq!(send(&mut finder, &FIRST, whole), None);
        }
    }
    let mut store = store(&mut chip, ROOM);
    assert!(!store.write(ROOM - 4, &[1; 8]) && !store.write(usize::MAX, &[1; 8]));
    for bases in
        [[BASES[0], BASES[1] + 64], [BASES[0] + 64, BASES[1]], BASES.map(|_| ROOM), [END, ROOM], [ROOM, ROOM + 4096]]
    {
        let mut none = FlashStore::new(&mut chip, RamCopy::new(vec![0; ROOM]), bases.map(|base| base as u32));
        assert!(none.bytes().is_empty() && !none.write(0, &[1; 8]) && !none.swap(), "{bases:x?}");
    }
}

/// What goes wrong in which operation, counted from the first or from the last.
type Plan = (Trouble, Result<usize, usize>);

/// Something goes wrong in any operation, while a table replaces nothing or another, in pieces of any length.
fn troubled<const WORD: usize, const SECTOR: usize>(
    old: Option<&[u8]>,
    new: &[u8],
    ((trouble, place), seed): (Plan, u64),
) -> Result<(), TestCaseError> {
    let chip_of_old = || {
        let mut chip = Chip::<WORD, SECTOR>::new(END, seed);
        old.iter().for_each(|old| assert!(send(&mut reset(&mut chip), old, whole).is_some()));
        chip
    };
    let random_length = || {
        let mut random = fastrand::Rng::with_seed(seed);
        move || random.usize(1..=MAX_PIECE)
    };
    let mut chip = chip_of_old();
    let before = chip.operations;
    prop_assert!(send(&mut reset(&mut chip), new, random_length()).is_some());
    let after = place.unwrap_or_else(|last| (chip.operations - before).saturating_sub(1 + last));

    let mut chip = chip_of_old();
    chip.plan(trouble, after);
    let mut finder = reset(&mut chip);
    let sent = send(&mut finder, new, random_length());
    if sent.is_none() && trouble != Trouble::PowerLoss && seed % 2 == 0 {
        prop_assert!(send(&mut finder, new, random_length()).is_some(), "it goes wrong once");
        prop_assert!(chip.end_trouble());
        prop_assert_eq!(usable(&reset(&mut chip)), checksum(new));
        return Ok(());
    }
    let happened = chip.end_trouble();
    prop_assert_eq!(happened, sent.is_none(), "what goes wrong is noticed");

    let found = usable(&reset(&mut chip));
    // The old one is there until the new one is.
    prop_assert!(found == checksum(new) || found == old.and_then(checksum), "{found:?}");
    if sent.is_some() {
        prop_assert_eq!(found, checksum(new));
    }
    prop_assert!(send(&mut reset(&mut chip), new, whole).is_some());
    prop_assert_eq!(usable(&reset(&mut chip)), checksum(new));
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(96))]
    #[test]
    fn whatever_goes_wrong_is_told_and_what_is_found_after_a_reset_is_whole(
        old in select(vec![None, Some(0), Some(1)]),
        trouble in select(vec![Trouble::Fails, Trouble::PowerLoss, Trouble::Weak]),
        place in prop_oneof![(0usize..40).prop_map(Ok), (0usize..9000).prop_map(Ok), (0usize..3).prop_map(Err)],
        seed in any::<u64>(),
        kind in 0..3,
    ) {
        let old = old.map(|old| if old == 0 { &FIRST[..] } else { &ALIKE[..] });
        match kind {
            0 => troubled::<4, 4096>(old, &FIRST, ((trouble, place), seed))?,
            1 => troubled::<1, ROOM>(old, &SECOND, ((trouble, place), seed))?,
            _ => troubled::<8, 2048>(old, &ALIKE, ((trouble, place), seed))?,
        }
    }
}

/// A board in the middle of a table that is asked for another, and for the same again.
#[test]
fn a_table_may_be_begun_anew_at_any_place() {
    let mut chip = Chip::<4, 4096>::new(END, 3);
    let mut finder = reset(&mut chip);
    for (table, pieces) in [(&FIRST, 3), (&SECOND, 700), (&SECOND, 20), (&ALIKE, 1200)] {
        for (number, bytes) in table.chunks(MAX_PIECE).take(pieces).enumerate() {
            assert!(finder.take(&piece(number * MAX_PIECE, bytes)));
        }
    }
    assert_eq!(send(&mut finder, &FIRST, whole), Some(1), "what was begun is in nobody's way");
    assert_eq!(usable(&reset(&mut chip)), checksum(&FIRST));
}
