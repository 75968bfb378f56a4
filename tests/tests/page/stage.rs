//! A browser in front of a page.

use std::sync::{Mutex, PoisonError};

use anyhow::Result;

use crate::chromium::{self, Chromium, Page};
use crate::live::Live;
use crate::script::Script;

/// What a page is in front of.
pub trait Behind {
    /// Where the page is.
    fn url(&self) -> String;
}

impl Behind for Live {
    fn url(&self) -> String {
        self.server.url()
    }
}

impl Behind for Script {
    fn url(&self) -> String {
        self.server.url()
    }
}

/// A browser in front of the page of `behind`.
pub struct Stage<T> {
    pub behind: T,
    pub browser: Page,
}

/// Runs a test in front of what `start` gives, in the browser that tests share; without a browser on this machine it says so and does nothing.
pub fn in_front_of<T: Behind>(
    start: impl FnOnce() -> Result<T>,
    test: impl AsyncFnOnce(&Stage<T>) -> Result<()>,
) -> Result<()> {
    opened(start, async |stage| {
        let ready =
            stage.browser.until("frames", |told| told.text("state") == "streaming" && told.number("updates") > 5.0);
        ready.await?;
        test(stage).await
    })
}

/// The same, whatever page there is.
pub fn opened<T: Behind>(
    start: impl FnOnce() -> Result<T>,
    test: impl AsyncFnOnce(&Stage<T>) -> Result<()>,
) -> Result<()> {
    /// One page at a time: there is one window, and frame rates are compared.
    static TURN: Mutex<()> = Mutex::new(());
    if !chromium::is_here()? {
        return Ok(());
    }
    // Before it is this test's turn, so that the browser lives on from one to the next.
    let chromium = Chromium::shared()?;
    let _turn = TURN.lock().unwrap_or_else(PoisonError::into_inner);
    let behind = start()?;
    chromium.block_on(async {
        let stage = Stage { browser: chromium.open(&behind.url()).await?, behind };
        let outcome = test(&stage).await;
        let left = stage.browser.leave().await;
        outcome.and(left)
    })
}
