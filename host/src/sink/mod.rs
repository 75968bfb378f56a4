//! Where touch goes: the page in the browser.

pub mod page;
