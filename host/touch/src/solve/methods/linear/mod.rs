//! Linear images.

mod laplace;
mod noser;
mod tikhonov;
mod tsvd;

pub use self::tikhonov::{Tikhonov, Variant};
pub use self::tsvd::Tsvd;
