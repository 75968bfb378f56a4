//! What came from a port on which no board said Hello, and what that means.

use std::fmt;

/// Bytes that are kept: a chip's boot text and some lines of a program's.
const KEPT: usize = 4096;
/// Lines of text that are shown, and characters of each.
const SHOWN: usize = 4;
const SHOWN_CHARACTERS: usize = 80;
/// What the boot loader of the ESP32 family says at each start.
const START: &str = "rst:0x";
/// Share of the bytes from which on they count as text: a wrong baud rate gives bytes of all values, of which 38 % are printable.
const TEXT_SHARE: f64 = 0.8;

/// Texts of boot loaders, and what they mean. After the boot loaders of the ESP32 family, and the hardware notes of this project.
const KNOWN: [(&str, &str); 5] = [
    (
        "waiting for download",
        "the chip waits for a download: its boot pin (GPIO 0 on the ESP32, GPIO 9 on the ESP32-C3 and C6) was low at reset. Let go of the \
         button, take your hand off the foam, and press reset",
    ),
    (
        "flash read err",
        "the chip cannot read its flash: on the ESP32, GPIO 12 was high at reset. See the strapping pins in docs/hardware.md",
    ),
    ("invalid header", "the chip has no program: flash it with `tactomo board flash`"),
    ("Guru Meditation", "another program runs on the chip, and has crashed: flash it with `tactomo board flash`"),
    ("brownout", "the supply is too weak: another cable, or a port that gives more current"),
];

/// Bytes outside of any frame of a board: what was no message.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct UnframedBytes {
    bytes: Vec<u8>,
    count: usize,
}

impl UnframedBytes {
    /// Takes what has come.
    pub fn add(&mut self, bytes: &[u8]) {
        self.count += bytes.len();
        let room = KEPT.saturating_sub(self.bytes.len());
        self.bytes.extend_from_slice(&bytes[..bytes.len().min(room)]);
    }

    /// Bytes that came, those included that were not kept.
    pub fn count(&self) -> usize {
        self.count
    }

    /// Whether it reads as text.
    pub fn is_text(&self) -> bool {
        let printable = self.bytes.iter().filter(|byte| byte.is_ascii_graphic() || byte.is_ascii_whitespace()).count();
        printable as f64 > TEXT_SHARE * self.bytes.len() as f64
    }

    /// The last lines of it, if it is text: their beginnings, with what cannot be printed escaped.
    pub fn lines(&self) -> Vec<String> {
        if !self.is_text() {
            return Vec::new();
        }
        let text = String::from_utf8_lossy(&self.bytes);
        let lines: Vec<&str> = text.split(['\n', '\r', '\0']).map(str::trim).filter(|line| !line.is_empty()).collect();
        let shown = |line: &&str| line.chars().take(SHOWN_CHARACTERS).flat_map(char::escape_debug).collect();
        lines[lines.len().saturating_sub(SHOWN)..].iter().map(shown).collect()
    }

    /// What it means and what to do.
    pub fn meaning(&self) -> &'static str {
        let text = String::from_utf8_lossy(&self.bytes);
        if let Some((_, meaning)) = KNOWN.iter().find(|(known, _)| text.contains(known)) {
            return meaning;
        }
        if text.matches(START).count() > 1 {
            return "the chip starts again and again: its program fails (flash the firmware with `tactomo board flash`), its supply is too weak, or \
                    something holds its reset";
        }
        match (self.count, self.is_text()) {
            (0, _) => {
                "not one byte came: is this the board's port (`tactomo ports` lists them), has the board power, does its cable carry data, and is \
                 the firmware on it (`tactomo board flash`)?"
            }
            (_, true) => {
                "text came, and no Hello: another program runs on the board, or it is still starting. Flash the firmware with `tactomo board \
                 flash`, or press reset and try again"
            }
            (_, false) => {
                "bytes came that are neither text nor messages: the baud rate is another one (give the board's with --baud), or another \
                 program runs on the board (`tactomo board flash`)"
            }
        }
    }
}

impl fmt::Display for UnframedBytes {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        if self.count > 0 {
            write!(f, "{} bytes came that were no message; ", self.count)?;
        }
        write!(f, "{}", self.meaning())?;
        let lines = self.lines();
        if lines.is_empty() { Ok(()) } else { write!(f, ". It said: \"{}\"", lines.join("\" \"")) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn unframed(bytes: &[u8]) -> UnframedBytes {
        let mut unframed = UnframedBytes::default();
        unframed.add(bytes);
        unframed
    }

    #[test]
    fn boot_text_is_shown_and_explained() {
        let text = b"ets Jul 29 2019 12:21:46\r\n\r\nrst:0x1 (POWERON_RESET),boot:0x3 (DOWNLOAD_BOOT)\r\nwaiting for download\r\n";
        let unframed = unframed(text);
        assert!(unframed.meaning().contains("GPIO 0"));
        assert_eq!(unframed.lines().last().map(String::as_str), Some("waiting for download"));
        assert!(unframed.to_string().contains("\"rst:0x1"), "{unframed}");
    }

    #[test]
    fn a_chip_that_starts_for_ever_is_told_and_long_lines_of_any_text_are_bounded_and_escaped() {
        let boots = unframed(&b"\r\nets Jun  8 2016\r\nrst:0x10 (RTCWDT_RTC_RESET),boot:0x13\r\n".repeat(20));
        assert!(boots.meaning().contains("again and again"), "{boots}");
        let text = unframed(format!("adc \u{1b}[2J{}\n", "1023,".repeat(400)).as_bytes());
        let [line] = &text.lines()[..] else { panic!("{text}") };
        assert!(line.starts_with("adc \\u{1b}[2J1023,") && line.len() < 100, "{line}");
        assert!(text.meaning().contains("another program"));
    }

    #[test]
    fn silence_noise_and_other_programs_are_distinguished() {
        let noise: Vec<u8> = (0..500u32).map(|i| (i * 167 % 251) as u8 | 0x80).collect();
        for (bytes, meaning) in [(&b""[..], "cable"), (&noise, "--baud"), (b"hello from blinky\n", "another program")] {
            assert!(unframed(bytes).meaning().contains(meaning), "{}", unframed(bytes));
        }
    }

    #[test]
    fn a_flood_is_counted_and_not_kept() {
        let flood = unframed(&[b'x'; 3 * KEPT]);
        assert_eq!((flood.count(), flood.bytes.len()), (3 * KEPT, KEPT));
    }
}
