//! From what a person wants to a detector that can be ordered.

mod answer;
mod find;
mod foams;
mod rating;
mod space;
mod view;
mod wishes;

pub use self::answer::{Answer, Choice, Compared, Plan, Unmet, answer};
pub use self::find::{Found, find};
pub use self::foams::{FoamsError, Material, WrongFoam};
pub use self::rating::{Rating, frames_per_s};
pub use self::space::{Candidate, Space};
pub use self::view::view;
pub use self::wishes::{Wish, Wishes, WrongWish};
