//! The firmware library on mocked parts.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

mod commands;
mod failures;
mod flash;
mod more_parts;
mod nor_flash;
mod parts;
mod plans;
mod rate;
mod samplers;
mod scan;
mod switches;
mod uplink;
