//! The firmware library with detectors that are compiled and simulated, and as the simulated board. On mocked parts alone: `firmware/tests`.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

mod bench;
mod closed_loop;
mod contacts;
mod hid;
#[path = "../../../firmware/tests/board/parts.rs"]
mod parts;
mod wiring;
