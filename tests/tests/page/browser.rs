//! The page in a browser, in front of the simulated board.

use std::time::Duration;

use anyhow::{Context, Result, ensure};
use tactomo::scene::SceneName;
use tactomo::simulate::Fault;
use tactomo::solve::Method;

use crate::chromium::{Browser, Told};
use crate::live::Live;
use crate::stage::{Stage, in_front_of};

/// How far from the press the contact may be found (mm).
const TOLERANCE_MM: f64 = 1.0;

/// Runs `$body` with a [`Stage`] named `$stage` in front of a simulated board.
macro_rules! on_stage {
    ($scene:expr, $stage:ident, $body:block) => {
        on_stage!($scene, &[], $stage, $body)
    };
    ($scene:expr, $faults:expr, $stage:ident, $body:block) => {
        in_front_of!(Live::start($scene, $faults), $stage, $body)
    };
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn the_picture_follows_the_contact() -> Result<()> {
    on_stage!(SceneName::Rest, stage, {
        for place in [[12.0, 9.0], [-14.0, 5.0], [3.0, -16.0]] {
            stage.behind.press(place)?;
            let what = format!("a contact near {place:?}");
            let near = stage.browser.until(&what, |told| told.is_pressed_at(place, TOLERANCE_MM));
            near.await?;
        }
        stage.behind.mouse.press(Vec::new());
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
async fn a_press_is_never_re_zeroed() -> Result<()> {
    on_stage!(SceneName::Rest, stage, {
        stage.behind.press([10.0, 10.0])?;
        stage.browser.until("a contact", |told| told.number("contacts") > 0.0).await?;
        let button = stage.browser.client.find(fantoccini::Locator::Id("rezero")).await?;
        button.click().await?;
        tokio::time::sleep(Duration::from_secs(1)).await;
        let notice = stage.browser.run("return document.getElementById('notice').textContent").await?;
        ensure!(notice.as_str().is_some_and(|text| text.starts_with("Not re-zeroed")), "{notice}");
        stage.browser.until("the contact still", |told| told.number("contacts") == 1.0).await?;
        stage.behind.mouse.press(Vec::new());
        stage.browser.until("rest", |told| told.number("contacts") == 0.0).await?;
        button.click().await?;
        tokio::time::sleep(Duration::from_secs(1)).await;
        let notice = stage.browser.run("return document.getElementById('notice').textContent").await?;
        ensure!(notice.as_str() == Some(""), "{notice}");
        Ok(())
    })
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_second_page_keeps_up() -> Result<()> {
    on_stage!(SceneName::Rest, stage, {
        let second = Browser::open(&stage.behind.server.url()).await?;
        let outcome = both_follow(&stage, &second).await;
        second.close().await?;
        outcome
    })
}

async fn both_follow(stage: &Stage<Live>, second: &Browser) -> Result<()> {
    for place in [[12.0, 12.0], [-12.0, -12.0]] {
        stage.behind.press(place)?;
        for page in [&stage.browser, second] {
            page.until("the contact", |told| told.is_pressed_at(place, TOLERANCE_MM)).await?;
        }
    }
    for page in [&stage.browser, second] {
        let behind = stage.behind.statistics().frames as f64 - page.told().await?.number("received");
        ensure!(behind < 1000.0, "a page is {behind} frames behind");
    }
    Ok(())
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_page_that_hangs_does_not_slow_the_board() -> Result<()> {
    on_stage!(SceneName::Rest, stage, {
        let (before, dropped_before) = stage.behind.rate_over(Duration::from_secs(2)).await;
        let hang = "const end = performance.now() + 3000; while (performance.now() < end); return true";
        let updates = stage.browser.told().await?.number("updates");
        let (hung, (during, dropped)) = tokio::join!(
            stage.browser.client.execute(hang, Vec::new()),
            stage.behind.rate_over(Duration::from_secs(2))
        );
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
        stage.behind.press([9.0, 7.0])?;
        for method in Method::ALL {
            let dropped = stage.behind.statistics().dropped;
            stage.browser.choose(method).await?;
            let name = method.name();
            let told = stage.browser.until(name, |told| told.text("solver") == name && told.text("making").is_empty());
            let updates = told.await?.number("updates");
            let shown = |told: &Told| {
                told.number("updates") > updates + 5.0
                    && (told.number("contacts") > 0.0 || told.text("image") == "true")
            };
            stage.browser.until(&format!("what {name} finds"), shown).await?;
            eprintln!("{name}: {} frames dropped", stage.behind.statistics().dropped - dropped);
        }
        Ok(())
    })
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_broken_wire_is_told_and_its_electrode_crossed_out() -> Result<()> {
    let faults = ["open:3".parse::<Fault>()?];
    on_stage!(SceneName::Rest, &faults, stage, {
        let place = [9.0, 7.0];
        stage.behind.press(place)?;
        let told = |told: &Told| told.text("excluded") == "3" && told.is_pressed_at(place, TOLERANCE_MM);
        stage.browser.until("electrode 3 left out", told).await?;
        let script = "return document.getElementById('warnings').textContent";
        let shown = stage.browser.client.execute(script, Vec::new()).await?;
        ensure!(shown.as_str().is_some_and(|text| text.contains("electrode 3 left out")), "{shown}");
        Ok(())
    })
}

/// Pictures for the README: `TACTOMO_SCREENSHOT=$PWD/docs cargo test --release -p tactomo-tests --test page screenshot`.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn screenshot() -> Result<()> {
    let Some(folder) = std::env::var_os("TACTOMO_SCREENSHOT") else { return Ok(()) };
    let folder = std::path::Path::new(&folder);
    picture("light", &folder.join("live.png")).await?;
    picture("dark", &folder.join("live-dark.png")).await
}

/// A picture of a hand.
async fn picture(theme: &str, file: &std::path::Path) -> Result<()> {
    in_front_of!(Live::start(SceneName::FiveFingers, &[]), stage, {
        stage.browser.theme(theme).await?;
        let hand = |told: &Told| told.number("contacts") >= 4.0 && told.text("image") == "false";
        stage.browser.until("a hand", hand).await?;
        // Until the strip chart has something to show.
        tokio::time::sleep(Duration::from_secs(6)).await;
        stage.browser.until("a hand", hand).await?;
        std::fs::write(file, stage.browser.client.screenshot().await?).context("the picture's folder")
    })
}
