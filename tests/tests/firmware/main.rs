//! The firmware library: on mocked parts, and as the simulated board.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

mod bench;
mod closed_loop;
mod commands;
mod contacts;
mod failures;
mod flash;
mod hid;
mod nor_flash;
mod parts;
mod plans;
mod rate;
mod samplers;
mod scan;
mod switches;
mod uplink;
mod wiring;
