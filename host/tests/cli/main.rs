//! The program as a user calls it.

#![allow(clippy::unwrap_used, reason = "a test that unwraps fails where it should, and says where")]

mod body;
mod detector;
mod usage;
