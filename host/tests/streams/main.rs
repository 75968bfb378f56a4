//! Streams of the program as others take them: a pipe, TCP, UDP, Foxglove's protocol, and MCAP as Python reads it.

#![allow(clippy::unwrap_used, reason = "a test that unwraps fails where it should, and says where")]

mod folder;
mod foxglove;
mod lines;
mod program;
mod python;
mod ros2;
