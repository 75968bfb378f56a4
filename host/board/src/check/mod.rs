//! What a first look at a board needs: a talk with it that remembers what else was heard, and which pin every electrode is wired to.

mod listen;
mod unframed;
pub mod wiring;

pub use self::listen::{Counted, ListenError, Listening};
pub use self::unframed::UnframedBytes;
