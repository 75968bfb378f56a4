//! From what a person wants to a detector that can be ordered.

mod answer;
mod board;
mod find;
mod foams;
mod rating;
mod space;
mod view;
mod wishes;

pub use self::answer::{Answer, Choice, Compared, Costliest, Plan, Unmet, answer};
pub use self::board::Board;
pub use self::find::{Found, find};
pub use self::foams::{FoamsError, Material, WrongFoam};
pub use self::rating::Rating;
pub(crate) use self::rating::hertz;
pub(crate) use self::space::DRIVE_V;
pub use self::space::{Candidate, Space};
pub use self::view::view;
pub use self::wishes::{Wish, Wishes, WrongWish};
