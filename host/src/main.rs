//! The `tactomo` program.

fn main() {}
