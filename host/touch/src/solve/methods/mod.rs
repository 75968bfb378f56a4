//! The methods, a folder each. They know none of each other, but for [`contacts`], which begins with those of [`compiled`], and [`auto`], which chooses among `contacts`, `shapes` and `image`.

pub(crate) mod auto;
pub(crate) mod comparisons;
pub(crate) mod compiled;
pub(crate) mod contacts;
pub(crate) mod image;
pub(crate) mod kernel;
pub(crate) mod linear;
pub(crate) mod network;
pub(crate) mod shapes;
