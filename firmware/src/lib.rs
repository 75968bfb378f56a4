//! The scan, the uplink and the command loop of a tomographic tactile sensor board, over embedded-hal.
#![no_std]
