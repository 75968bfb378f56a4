//! A browser in front of a page.

use anyhow::Result;
use tokio::sync::{Mutex, MutexGuard};

use crate::chromium::{self, Browser};

/// One browser at a time: each has several processes, and frame rates are compared.
static TURN: Mutex<()> = Mutex::const_new(());

/// A browser in front of the page of `behind`.
pub struct Stage<T> {
    pub behind: T,
    pub browser: Browser,
    _turn: MutexGuard<'static, ()>,
}

impl<T> Stage<T> {
    /// Sets it up; `None` without a browser on this machine.
    pub async fn set(start: impl FnOnce() -> Result<T>, url: impl Fn(&T) -> String) -> Result<Option<Self>> {
        if !chromium::is_here()? {
            return Ok(None);
        }
        let turn = TURN.lock().await;
        let behind = start()?;
        let browser = Browser::open(&url(&behind)).await?;
        let stage = Self { behind, browser, _turn: turn };
        let ready =
            stage.browser.until("frames", |told| told.text("state") == "streaming" && told.number("updates") > 5.0);
        match ready.await {
            Ok(_) => Ok(Some(stage)),
            Err(error) => stage.end(Err(error)).await.map(|()| None),
        }
    }

    /// Ends the browser, whatever came of the test.
    pub async fn end(self, outcome: Result<()>) -> Result<()> {
        let closed = self.browser.close().await;
        outcome.and(closed)
    }
}

/// Runs `$body` with a [`Stage`] named `$stage` in front of what `$start` gives.
macro_rules! in_front_of {
    ($start:expr, $stage:ident, $body:block) => {{
        let set = $crate::stage::Stage::set(|| $start, |behind| behind.server.url());
        let Some($stage) = set.await? else { return Ok(()) };
        let outcome: anyhow::Result<()> = async { $body }.await;
        $stage.end(outcome).await
    }};
}

pub(crate) use in_front_of;
