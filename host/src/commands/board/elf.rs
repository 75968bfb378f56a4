//! Whether an image can run on a board: the head of an ELF file, and where its segments lie
//! (System V ABI, "Object Files", <https://refspecs.linuxfoundation.org/elf/gabi4+/ch4.eheader.html>).

use std::ops::Range;
use std::path::Path;

use anyhow::{Context, bail, ensure};
use tactomo::table::file::Format;

use super::firmware::Board;

/// An image with its symbols: ours are 2 MB.
const FORMAT: Format = Format::new("an image of a board", 256 << 20);
/// Bytes of the head and of an entry of the table of segments, in 32 bits.
const HEAD: usize = 52;
const SEGMENT: usize = 32;
/// Kinds: an executable file, and a segment that is loaded.
const EXECUTABLE: u16 = 2;
const LOADED: u32 = 1;
/// Flag of a segment that is run.
const RUNS: u32 = 1;

/// What an image has to be for a chip.
struct Chip {
    /// Number of its processor (`e_machine`), and its name.
    machine: (u16, &'static str),
    /// Addresses that it has.
    memories: &'static [Range<u64>],
    /// Room for an image in flash (bytes).
    flash: u64,
}

/// Numbers of processors (`e_machine`).
const XTENSA: (u16, &str) = (94, "Xtensa");
const RISC_V: (u16, &str) = (243, "RISC-V");
const ARM: (u16, &str) = (40, "ARM");
/// Of 4 MB of flash behind espflash's boot loader and partition table (espflash 4: `factory` from 0x10000, 0x3f0000 long), without the last 256 kB, where the
/// board keeps its tables (`firmware/boards/espressif/src/table.rs`).
const ESP_FLASH: u64 = 0x3b_0000;

impl Chip {
    /// Addresses are those of esp-hal 1.2's `ld/CHIP/memory.x`, caches and parts kept for the boot loader included, and of our `memory.x`.
    fn of(board: Board) -> Self {
        match board {
            Board::Esp32 => Self {
                machine: XTENSA,
                memories: &[
                    0x3f40_0000..0x3f80_0000,
                    0x3ff8_0000..0x3ff8_2000,
                    0x3ffa_e000..0x4000_0000,
                    0x4007_0000..0x400a_0000,
                    0x400c_0000..0x400c_2000,
                    0x400d_0000..0x4040_0000,
                    0x5000_0000..0x5000_2000,
                ],
                flash: ESP_FLASH,
            },
            Board::Esp32c3 => Self {
                machine: RISC_V,
                memories: &[
                    0x3c00_0000..0x3c80_0000,
                    0x3fc8_0000..0x3fce_0000,
                    0x4037_c000..0x403e_0000,
                    0x4200_0000..0x4280_0000,
                    0x5000_0000..0x5000_2000,
                ],
                flash: ESP_FLASH,
            },
            Board::Esp32c6 => Self {
                machine: RISC_V,
                memories: &[0x4080_0000..0x4088_0000, 0x4200_0000..0x4300_0000, 0x5000_0000..0x5000_4000],
                flash: ESP_FLASH,
            },
            Board::Stm32f405 => Self {
                machine: ARM,
                memories: &[0x0800_0000..0x080c_0000, 0x1000_0000..0x1001_0000, 0x2000_0000..0x2002_0000],
                flash: 0xc_0000,
            },
        }
    }

    fn has(&self, part: &Range<u64>) -> bool {
        self.memories.iter().any(|memory| memory.start <= part.start && part.end <= memory.end)
    }
}

/// A segment that is loaded.
struct Segment {
    /// Where it lies while the program runs.
    addresses: Range<u64>,
    /// Bytes of it in the file, and so in flash.
    bytes: Range<u64>,
    runs: bool,
}

/// Looks at an image before a tool is called.
///
/// # Errors
/// If it is no image, or none for this board: what it is, and what to do.
pub fn check(path: &Path, board: Board) -> anyhow::Result<()> {
    let named = || path.display().to_string();
    let bytes = FORMAT.read(path).with_context(|| format!("cannot read the image {}", named()))?;
    judge(&bytes, board).with_context(|| {
        format!(
            "{} is no image for the board {}: build one with {}, or name another with --image",
            named(),
            board.name(),
            board.build()
        )
    })
}

fn judge(bytes: &[u8], board: Board) -> anyhow::Result<()> {
    let chip = Chip::of(board);
    ensure!(!bytes.is_empty(), "it is empty");
    ensure!(bytes.starts_with(b"\x7fELF"), "it is no ELF file, which a build gives");
    ensure!(bytes.len() >= HEAD, "it is cut off");
    ensure!(
        bytes[4] == 1 && bytes[5] == 1,
        "it is for a computer: boards have 32 bits, the least significant byte first"
    );
    let machine = half(bytes, 18);
    ensure!(
        machine == chip.machine.0,
        "it is for the processor {}, and the {} has {}",
        [XTENSA, RISC_V, ARM].iter().find(|known| known.0 == machine).map_or("of another board", |known| known.1),
        board.name(),
        chip.machine.1
    );
    ensure!(half(bytes, 16) == EXECUTABLE, "it is a part of a program, not linked yet");
    let segments = segments(bytes)?;
    ensure!(!segments.is_empty(), "there is nothing in it that could be flashed");
    for Segment { addresses, .. } in &segments {
        ensure!(
            chip.has(addresses),
            "it has something at {:#010x}, where the {} has no memory: it was built for another chip",
            addresses.start,
            board.name()
        );
    }
    // The lowest bit tells ARM's processors which instructions these are.
    let entry = u64::from(word(bytes, 24)) & if chip.machine == ARM { !1 } else { !0 };
    let begins =
        segments.iter().any(|segment| segment.runs && !segment.bytes.is_empty() && segment.addresses.contains(&entry));
    ensure!(begins, "it begins at {entry:#010x}, where it has no code");
    let size: u64 = segments.iter().map(|segment| segment.bytes.end - segment.bytes.start).sum();
    ensure!(size <= chip.flash, "it takes {size} bytes of flash, and there are {}", chip.flash);
    Ok(())
}

fn segments(bytes: &[u8]) -> anyhow::Result<Vec<Segment>> {
    let (offset, size, count) = (word(bytes, 28) as usize, usize::from(half(bytes, 42)), usize::from(half(bytes, 44)));
    let Some(table) = bytes.get(offset..).and_then(|rest| rest.get(..size.checked_mul(count)?)) else {
        bail!("it is cut off");
    };
    ensure!(count == 0 || size == SEGMENT, "its table of segments is none of 32 bits");
    let mut segments = Vec::new();
    for entry in table.chunks_exact(SEGMENT) {
        let [kind, from, address, _, in_file, in_memory, flags] = [0, 4, 8, 12, 16, 20, 24].map(|at| word(entry, at));
        if kind != LOADED || in_memory == 0 {
            continue;
        }
        let along = |from: u32, length: u32| u64::from(from)..u64::from(from) + u64::from(length);
        let part =
            Segment { addresses: along(address, in_memory), bytes: along(from, in_file), runs: flags & RUNS != 0 };
        ensure!(part.bytes.end <= bytes.len() as u64, "it is cut off");
        segments.push(part);
    }
    Ok(segments)
}

/// The numbers at an offset; zero beyond the end, which nobody asks for.
fn half(bytes: &[u8], at: usize) -> u16 {
    bytes.get(at..at + 2).and_then(|two| two.try_into().ok()).map_or(0, u16::from_le_bytes)
}

fn word(bytes: &[u8], at: usize) -> u32 {
    bytes.get(at..at + 4).and_then(|four| four.try_into().ok()).map_or(0, u32::from_le_bytes)
}
