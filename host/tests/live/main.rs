//! The live pipeline on a board of bytes only: what it makes of them, and that it stays small.
#![allow(clippy::unwrap_used, reason = "a test that unwraps fails where it should, and says where")]

mod fake;
#[cfg(target_os = "linux")]
mod memory;
mod pipeline;
