//! Images that are there to be compared with.

mod bsbl;
mod nonnegative;
mod tv;

pub use self::bsbl::Bsbl;
pub use self::nonnegative::Nonnegative;
pub use self::tv::Tv;
