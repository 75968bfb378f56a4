//! The scan, the uplink and the command loop of a tomographic tactile sensor board, over embedded-hal.
//!
//! A board crate brings its parts and hands them to [`Board`]:
//!
//! | part | trait | what it stands for |
//! |---|---|---|
//! | multiplexer | [`Mux`] | grounds an electrode; [`mux`] has the ADG726 in both of its wirings |
//! | converter | [`Sampler`] | bounded conversions of the electrodes' voltages, one by one or a row at a time |
//! | serial line | [`Serial`] | a UART or USB port that never waits |
//! | chip | [`Chip`] | clock, delay, watchdog, log bytes |
//! | touch | [`Touch`] | [`NoTouch`], or a [`ContactFinder`] with a [`TableStore`]: contacts without a computer; a [`Digitizer`] around it is a touch screen ([`hid`]) too |
//!
//! ```ignore
//! let mut board = Board16::new(Parts { mux, sampler, serial, chip, touch: NoTouch }, IDENTITY)?;
//! board.report(Fault::Reset(reason));
//! let error = board.run(); // comes back only if a pin of the multiplexer fails
//! ```
//!
//! Guarantees: no allocation, no floating point but to find contacts, no wait without a bound. Sending overlaps sampling: bytes are pushed between
//! conversions and during waits, as many as the line takes at that moment, so a slow host never delays the scan. While the line has no
//! room for a frame its rows are scanned again, and their mean is sent. A [`Board16`] takes about 5 kB of RAM.
#![no_std]

mod adc;
mod board;
pub mod hid;
mod inbox;
#[cfg(feature = "defmt")]
pub mod log;
#[cfg(any(feature = "defmt", test))]
mod log_queue;
pub mod mux;
mod pace;
mod parts;
mod rate;
mod row;
mod scan;
mod side_by_side;
mod touch;
mod uplink;

pub use adc::Adc;
pub use board::{Activity, Board, Board16, Board32, Identity, NewBoardError};
pub use mux::Mux;
pub use parts::{Chip, Parts, Sampler, Serial, TimedOut};
pub use row::Row;
pub use scan::Scanned;
pub use side_by_side::{ConverterPair, SideBySide};
pub use touch::{CHUNK, ContactFinder, Digitizer, FlashStore, NoTouch, RamCopy, RamStore, TableStore, Touch, View};
