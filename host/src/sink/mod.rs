//! Where touch goes: the page in the browser; and each answer to streams, files and apps, as many as are wanted, none of which slows the
//! others or the board.

pub mod address;
pub mod channels;
mod decimator;
pub mod door;
mod feed;
pub mod foxglove;
pub mod lines;
pub mod mcap;
pub mod page;
pub mod place;
mod running;
pub mod stream;
pub mod target;
mod tcp;
mod udp;
mod web;

pub use self::feed::{Delivery, Renewal};
pub use self::running::{SinkError, Sinks};
