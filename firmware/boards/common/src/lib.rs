//! What the boards share beside the firmware library: the record of a panic, which outlives the reset that follows.
#![no_std]

pub mod panic_record;

pub use panic_record::{PanicRecord, RECORD_BYTES};
