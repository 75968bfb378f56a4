//! Where touch goes: the page in the browser, and lines of JSON.

pub mod page;
pub mod parquet;
pub mod stream;
