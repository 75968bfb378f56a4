//! The page in a browser, in front of the simulated board.

use std::time::Duration;

use anyhow::{Context, Result, ensure};
use tactomo::scene::SceneName;
use tactomo::simulate::Fault;
use tactomo::solve::Method;
use tokio::sync::{Mutex, MutexGuard};

use crate::chromium::{self, Browser, Told};
use crate::live::Live;

/// One browser at a time: each has several processes, and frame rates are compared.
static TURN: Mutex<()> = Mutex::const_new(());

/// How far from the press the contact may be found (mm).
const TOLERANCE_MM: f64 = 1.0;

/// A browser in front of a simulated board.
struct Stage {
    live: Live,
    browser: Browser,
    _turn: MutexGuard<'static, ()>,
}

impl Stage {
    /// Sets it up; `None` without a browser on this machine.
    async fn set(scene: SceneName, faults: &[Fault]) -> Result<Option<Self>> {
        if !chromium::is_here()? {
            return Ok(None);
        }
        let turn = TURN.lock().await;
        let live = Live::start(scene, faults)?;
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
    ($scene:expr, $stage:ident, $body:block) => {
        on_stage!($scene, &[], $stage, $body)
    };
    ($scene:expr, $faults:expr, $stage:ident, $body:block) => {{
        let Some($stage) = Stage::set($scene, $faults).await? else { return Ok(()) };
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
            let near = stage.browser.until(&what, |told| told.is_pressed_at(place, TOLERANCE_MM));
            near.await?;
        }
        stage.live.mouse.press(Vec::new());
        stage.browser.until("rest", |told| told.number("contacts") == 0.0).await?;
        Ok(())
    })
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn the_picture_moves_by_itself() -> Result<()> {
    on_stage!(SceneName::Wandering, stage, {
        let first = stage.browser.until("a contact", |told| told.number("contacts") == 1.0).await?.places_mm();
        let elsewhere = |told: &Told| told.number("contacts") == 1.0 && !told.is_pressed_at(first[0], 10.0);
        stage.browser.until("a contact elsewhere", elsewhere).await?;
        Ok(())
    })
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn the_mouse_presses_where_it_is() -> Result<()> {
    on_stage!(SceneName::Rest, stage, {
        for place in [[-10.0, 12.0], [16.0, -8.0]] {
            stage.browser.press(place).await?;
            let what = format!("a contact near {place:?}");
            let near = stage.browser.until(&what, |told| told.is_pressed_at(place, TOLERANCE_MM));
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
            page.until("the contact", |told| told.is_pressed_at(place, TOLERANCE_MM)).await?;
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

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn every_solver_can_be_chosen_while_frames_come() -> Result<()> {
    on_stage!(SceneName::Rest, stage, {
        stage.live.press([9.0, 7.0])?;
        for method in Method::ALL {
            let dropped = stage.live.statistics().dropped;
            stage.browser.choose(method).await?;
            let name = method.name();
            let told = stage.browser.until(name, |told| told.text("solver") == name && told.text("making").is_empty());
            let updates = told.await?.number("updates");
            let shown = |told: &Told| {
                told.number("updates") > updates + 5.0
                    && (told.number("contacts") > 0.0 || told.text("image") == "true")
            };
            stage.browser.until(&format!("what {name} finds"), shown).await?;
            eprintln!("{name}: {} frames dropped", stage.live.statistics().dropped - dropped);
        }
        Ok(())
    })
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_broken_wire_is_told_and_its_electrode_crossed_out() -> Result<()> {
    let faults = ["open:3".parse::<Fault>()?];
    on_stage!(SceneName::Rest, &faults, stage, {
        let place = [9.0, 7.0];
        stage.live.press(place)?;
        let told = |told: &Told| told.text("excluded") == "3" && told.is_pressed_at(place, TOLERANCE_MM);
        stage.browser.until("electrode 3 left out", told).await?;
        let script =
            "return [document.getElementById('warnings').textContent, document.querySelectorAll('.excluded').length]";
        let shown = stage.browser.client.execute(script, Vec::new()).await?;
        ensure!(
            shown[0].as_str().is_some_and(|text| text.contains("electrode 3 left out")) && shown[1] == 1,
            "{shown}"
        );
        Ok(())
    })
}

/// Pictures for the README: `TACTOMO_SCREENSHOT=$PWD/docs cargo test --workspace --test page screenshot`.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn screenshot() -> Result<()> {
    let Some(folder) = std::env::var_os("TACTOMO_SCREENSHOT") else { return Ok(()) };
    let folder = std::path::Path::new(&folder);
    picture(Method::Auto, "light", &folder.join("live.png")).await?;
    picture(Method::Tikhonov, "dark", &folder.join("live-dark.png")).await
}

/// A picture of one contact.
async fn picture(method: Method, theme: &str, file: &std::path::Path) -> Result<()> {
    on_stage!(SceneName::Rest, stage, {
        stage.live.press([9.0, 7.0])?;
        stage.browser.choose(method).await?;
        if stage.browser.told().await?.text("theme") != theme {
            stage.browser.client.find(fantoccini::Locator::Id("theme")).await?.click().await?;
        }
        // Until the figures are those of a steady run.
        tokio::time::sleep(Duration::from_secs(3)).await;
        stage.browser.until("a contact", |told| told.number("contacts") == 1.0).await?;
        std::fs::write(file, stage.browser.client.screenshot().await?).context("the picture's folder")
    })
}
