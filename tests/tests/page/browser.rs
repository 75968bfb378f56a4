//! The page in a browser, in front of the simulated board.

use std::time::Duration;

use anyhow::{Context, Result, ensure};
use tactomo::scene::SceneName;
use tokio::sync::{Mutex, MutexGuard};

use crate::chromium::{self, Browser};
use crate::live::Live;

/// One browser at a time: each has several processes, and frame rates are compared.
static TURN: Mutex<()> = Mutex::const_new(());

/// How far from the contact the image may peak (mm). Between electrodes a linear image peaks at the nearest of them, up to 11 mm
/// off on a pitch of 15 mm; the places pressed are three times as far apart.
const PEAK_TOLERANCE_MM: f64 = 10.0;

/// A browser in front of a simulated board.
struct Stage {
    live: Live,
    browser: Browser,
    _turn: MutexGuard<'static, ()>,
}

impl Stage {
    /// Sets it up; `None` without a browser on this machine.
    async fn set(scene: SceneName) -> Result<Option<Self>> {
        if !chromium::is_here()? {
            return Ok(None);
        }
        let turn = TURN.lock().await;
        let live = Live::start(scene)?;
        let browser = Browser::open(&live.server.url()).await?;
        let stage = Self { live, browser, _turn: turn };
        let ready =
            stage.browser.until("frames", |told| told.text("state") == "streaming" && told.number("updates") > 5.0);
        match ready.await {
            Ok(_) => Ok(Some(stage)),
            Err(error) => stage.end(Err(error)).await.map(|()| None),
        }
    }

    /// Ends the browser, whatever came of the test.
    async fn end(self, outcome: Result<()>) -> Result<()> {
        let closed = self.browser.close().await;
        outcome.and(closed)
    }
}

/// Runs `$body` with a [`Stage`] named `$stage`.
macro_rules! on_stage {
    ($scene:expr, $stage:ident, $body:block) => {{
        let Some($stage) = Stage::set($scene).await? else { return Ok(()) };
        let outcome: Result<()> = async { $body }.await;
        $stage.end(outcome).await
    }};
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn the_picture_follows_the_contact() -> Result<()> {
    on_stage!(SceneName::Rest, stage, {
        for place in [[12.0, 9.0], [-14.0, 5.0], [3.0, -16.0]] {
            stage.live.press(place)?;
            let what = format!("a contact near {place:?}");
            let near = stage
                .browser
                .until(&what, |told| told.number("contacts") > 0.0 && told.peak_from_mm(place) < PEAK_TOLERANCE_MM);
            near.await?;
        }
        stage.live.mouse.press(None);
        stage.browser.until("rest", |told| told.number("contacts") == 0.0).await?;
        Ok(())
    })
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn the_picture_moves_by_itself() -> Result<()> {
    on_stage!(SceneName::Wandering, stage, {
        let first = stage.browser.until("a contact", |told| told.number("contacts") > 0.0).await?;
        let place = [first.number("peakXMm"), first.number("peakYMm")];
        stage
            .browser
            .until("a contact elsewhere", |told| told.number("contacts") > 0.0 && told.peak_from_mm(place) > 10.0)
            .await?;
        Ok(())
    })
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn the_mouse_presses_where_it_is() -> Result<()> {
    on_stage!(SceneName::Rest, stage, {
        for place in [[-10.0, 12.0], [16.0, -8.0]] {
            stage.browser.press(place).await?;
            let what = format!("a contact near {place:?}");
            let near = stage
                .browser
                .until(&what, |told| told.number("contacts") > 0.0 && told.peak_from_mm(place) < PEAK_TOLERANCE_MM);
            near.await?;
            stage.browser.release().await?;
            stage.browser.until("rest", |told| told.number("contacts") == 0.0).await?;
        }
        Ok(())
    })
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_press_becomes_rest_when_re_zeroed() -> Result<()> {
    on_stage!(SceneName::Rest, stage, {
        stage.live.press([10.0, 10.0])?;
        stage.browser.until("a contact", |told| told.number("contacts") > 0.0).await?;
        let button = stage.browser.client.find(fantoccini::Locator::Id("rezero")).await?;
        button.click().await?;
        stage.browser.until("a re-zero", |told| told.text("label") == "Re-zeroed").await?;
        stage.browser.until("rest", |told| told.number("contacts") == 0.0).await?;
        Ok(())
    })
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_second_page_keeps_up() -> Result<()> {
    on_stage!(SceneName::Rest, stage, {
        let second = Browser::open(&stage.live.server.url()).await?;
        let outcome = both_follow(&stage, &second).await;
        second.close().await?;
        outcome
    })
}

async fn both_follow(stage: &Stage, second: &Browser) -> Result<()> {
    for place in [[12.0, 12.0], [-12.0, -12.0]] {
        stage.live.press(place)?;
        for page in [&stage.browser, second] {
            page.until("the contact", |told| {
                told.number("contacts") > 0.0 && told.peak_from_mm(place) < PEAK_TOLERANCE_MM
            })
            .await?;
        }
    }
    for page in [&stage.browser, second] {
        let behind = stage.live.statistics().frames as f64 - page.told().await?.number("received");
        ensure!(behind < 1000.0, "a page is {behind} frames behind");
    }
    Ok(())
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_page_that_hangs_does_not_slow_the_board() -> Result<()> {
    on_stage!(SceneName::Rest, stage, {
        let (before, dropped_before) = stage.live.rate_over(Duration::from_secs(2)).await;
        let hang = "const end = performance.now() + 3000; while (performance.now() < end); return true";
        let updates = stage.browser.told().await?.number("updates");
        let (hung, (during, dropped)) =
            tokio::join!(stage.browser.client.execute(hang, Vec::new()), stage.live.rate_over(Duration::from_secs(2)));
        hung?;
        ensure!(during > 0.8 * before, "{during} frames/s instead of {before} while the page hung");
        // A busy machine may drop some either way; a board that waited for the page would drop nearly all.
        ensure!(
            dropped as f64 <= dropped_before as f64 + 0.02 * before,
            "{dropped} frames dropped while the page hung, {dropped_before} before"
        );
        stage.browser.until("new updates", |told| told.number("updates") > updates + 10.0).await?;
        Ok(())
    })
}

/// Pictures for the README: `TACTOMO_SCREENSHOT=docs cargo test -p tactomo-tests --test page screenshot`.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn screenshot() -> Result<()> {
    let Some(folder) = std::env::var_os("TACTOMO_SCREENSHOT") else { return Ok(()) };
    // Tests run in their package's folder; a person means the workspace's.
    let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("..").join(folder);
    on_stage!(SceneName::Rest, stage, {
        stage.live.press([9.0, 7.0])?;
        tokio::time::sleep(Duration::from_secs(3)).await;
        let button = stage.browser.client.find(fantoccini::Locator::Id("theme")).await?;
        for _ in 0..2 {
            let theme = stage.browser.told().await?.text("theme").to_owned();
            let name = if theme == "dark" { "live-dark.png" } else { "live.png" };
            std::fs::write(folder.join(name), stage.browser.client.screenshot().await?)
                .context("the picture's folder")?;
            button.click().await?;
            tokio::time::sleep(Duration::from_millis(400)).await;
        }
        Ok(())
    })
}
