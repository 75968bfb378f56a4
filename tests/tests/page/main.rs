//! The live page: its server, spoken to byte by byte, and the page in a browser.

mod access;
mod browser;
mod calibrate;
mod chromium;
mod colours;
mod controls;
mod gallery;
mod live;
mod notices;
mod picture;
mod raw;
mod script;
mod seen;
mod server;
mod several;
mod stage;
mod states;
mod still;
mod view;
