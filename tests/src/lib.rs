//! What tests of several packages share: the programs as a person runs them, and the files that they read and write.

#![allow(clippy::unwrap_used, reason = "a test that unwraps fails where it should, and says where")]

mod program;
mod samples;

pub use self::program::{LAB, Program, TACTOMO};
pub use self::samples::{Folder, csv, recording};
