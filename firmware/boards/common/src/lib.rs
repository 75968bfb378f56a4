//! What the boards share beside the firmware library, and what of them decides something: it is compiled and tested without a chip
//! (`cargo test -p tactomo-board-common`). What is left in the boards' own crates are registers and pins.
#![no_std]

pub mod bounded;
pub mod brown_out;
pub mod clock;
pub mod converters;
pub mod paint;
pub mod panic_record;
pub mod quartz;
pub mod range;
pub mod reset;
#[cfg(feature = "usb")]
pub mod usb_digitizer;

pub use panic_record::{PanicRecord, RECORD_BYTES};
pub use reset::Reset;

/// A scan that feeds the watchdog no more in this time is stuck (ms): it does so before every conversion, of which a stuck pair of converters makes
/// the longest, and every 0.25 ms of a wait.
pub const WATCHDOG_TIMEOUT_MS: u32 = 1000;
