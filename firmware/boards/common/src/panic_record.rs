//! Where a panic leaves its message for the next boot: memory that a reset does not clear.

use core::fmt::{self, Write};
use core::panic::Location;

use heapless::String;

/// Longest message kept, in bytes: what a fault packet can carry.
const MAX_TEXT: usize = 96;
/// Marks a record that was written whole.
const MAGIC: [u8; 4] = *b"PNC1";

/// Bytes of a record: a mark, the sum of the text and its length, the length of the text, the text.
pub const RECORD_BYTES: usize = 4 + 1 + 1 + MAX_TEXT;

/// A view of the memory that outlives a reset. After power-on it holds anything.
pub struct PanicRecord<'a>(pub &'a mut [u8; RECORD_BYTES]);

impl PanicRecord<'_> {
    /// Writes down where and why, cut at the longest message: of the path the last two parts, since a crate's folder is long and the same for all
    /// its files.
    pub fn store(&mut self, place: Option<&Location<'_>>, message: impl fmt::Display) {
        self.store_text(&text(place.map(|place| (place.file(), place.line())), message).0);
    }

    pub(crate) fn store_text(&mut self, text: &String<MAX_TEXT>) {
        let (head, rest) = self.0.split_at_mut(6);
        rest[..text.len()].copy_from_slice(text.as_bytes());
        head.copy_from_slice(&[MAGIC[0], MAGIC[1], MAGIC[2], MAGIC[3], sum(text.as_bytes()), text.len() as u8]);
    }

    /// Takes the message of the last panic, if there was one since the last call.
    pub fn take(&mut self) -> Option<String<MAX_TEXT>> {
        let text = self.text();
        self.0[..MAGIC.len()].fill(0);
        text
    }

    fn text(&self) -> Option<String<MAX_TEXT>> {
        let (magic, rest) = self.0.split_first_chunk::<4>()?;
        let [check, length, text @ ..] = rest else { return None };
        let text = text.get(..usize::from(*length))?;
        if *magic != MAGIC || sum(text) != *check {
            return None;
        }
        String::try_from(core::str::from_utf8(text).ok()?).ok()
    }
}

/// What is reported of a panic.
fn text(place: Option<(&str, u32)>, message: impl fmt::Display) -> Cut {
    let mut text = Cut::default();
    if let Some((file, line)) = place {
        // Cannot fail: `Cut` takes any text.
        let _ = write!(text, "{}:{line}: ", end_of(file));
    }
    let _ = write!(text, "{message}");
    text
}

/// The last two parts of a path, or the last one if they are longer than a third of what is kept.
fn end_of(path: &str) -> &str {
    let mut slashes = path.rmatch_indices('/').map(|(at, _)| &path[at + 1..]);
    let (last, last_two) = (slashes.next().unwrap_or(path), slashes.next().unwrap_or(path));
    if last_two.len() <= MAX_TEXT / 3 { last_two } else { last }
}

/// A checksum that notices memory that decayed while the power was off.
fn sum(text: &[u8]) -> u8 {
    // From its length on: zeros behind a text would be none of it else.
    text.iter().fold(text.len() as u8, |sum, byte| sum.rotate_left(1) ^ byte)
}

/// Text that keeps what fits and forgets the rest.
#[derive(Default)]
struct Cut(String<MAX_TEXT>);

impl Write for Cut {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        for character in text.chars() {
            if self.0.push(character).is_err() {
                break;
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_message_is_taken_once() {
        let mut memory = [0xA5; RECORD_BYTES];
        let mut record = PanicRecord(&mut memory);
        assert_eq!(record.take(), None);
        let (here, long) = (Location::caller(), "x".repeat(MAX_TEXT));
        record.store(Some(here), format_args!("{long}"));
        let place = format!("src/panic_record.rs:{}: ", here.line());
        assert_eq!(record.take().as_deref(), Some(&*format!("{place}{}", &long[place.len()..])));
        assert_eq!(record.take(), None);
    }

    #[test]
    fn the_end_of_the_path_and_the_message_are_kept() {
        let reported = |file: &str, message: &str| text(Some((file, 77)), message).0;
        assert_eq!(reported("src/main.rs", "no"), "src/main.rs:77: no");
        assert_eq!(reported("main.rs", "no"), "main.rs:77: no");
        let folder = "/home/somebody/.cargo/registry/src/index.crates.io-1949cf8c6b5b557f/esp-hal-1.2.2/src/analog";
        assert_eq!(reported(&format!("{folder}/adc/esp32.rs"), "no"), "adc/esp32.rs:77: no");
        let long = format!("{folder}/a-folder-with-a-name-of-its-own-that-is-long/esp32.rs");
        let message = "index out of bounds: the len is 16 but the index is 16";
        assert_eq!(reported(&long, message).as_str(), format!("esp32.rs:77: {message}"));
        assert_eq!(text(None, "no").0, "no");
    }

    #[test]
    fn decayed_memory_is_no_message() {
        let mut memory = [0; RECORD_BYTES];
        PanicRecord(&mut memory).store_text(&Cut(String::try_from("main.rs:7").unwrap_or_default()).0);
        assert_eq!(PanicRecord(&mut memory).text().as_deref(), Some("main.rs:7"));
        // Any bit of it, and of its mark, sum and length.
        for bit in 0..8 * (6 + "main.rs:7".len()) {
            let mut decayed = memory;
            decayed[bit / 8] ^= 1 << (bit % 8);
            assert_eq!(PanicRecord(&mut decayed).take(), None, "bit {bit}");
        }
        memory[5] = 97;
        assert_eq!(PanicRecord(&mut memory).take(), None, "longer than there is room for");
    }

    #[test]
    fn a_text_of_any_length_comes_back_and_a_shorter_one_ends_where_it_ends() {
        let mut memory = [0xFF; RECORD_BYTES];
        for length in (0..=MAX_TEXT).rev() {
            let text = "y".repeat(length);
            let mut record = PanicRecord(&mut memory);
            record.store_text(&String::try_from(text.as_str()).unwrap_or_default());
            assert_eq!(record.take().as_deref(), Some(&*text));
        }
    }

    extern crate std;
    use std::format;
}
