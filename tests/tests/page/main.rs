//! The live page: its server, spoken to byte by byte, and the page in a browser.

mod browser;
mod chromium;
mod live;
mod raw;
mod server;
