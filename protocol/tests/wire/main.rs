//! The protocol as seen from outside: properties, limits, and the examples of its specification.
#![allow(clippy::unwrap_used, reason = "a test that unwraps fails where it should")]

mod coded;
mod common;
mod limits;
mod properties;
mod specification;
