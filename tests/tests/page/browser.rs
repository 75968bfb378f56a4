//! The page in a browser, in front of the simulated board.

use std::time::Duration;

use anyhow::{Context, Result, ensure};
use serde_json::Value;
use tactomo::scene::SceneName;
use tactomo::simulate::Fault;
use tactomo::solve::Method;

use crate::chromium::{self, Chromium, Page, Told};
use crate::live::Live;
use crate::stage::{Stage, in_front_of};

/// How far from the press the contact may be found (mm).
const TOLERANCE_MM: f64 = 1.0;

/// Runs a test in front of a simulated board.
fn on_stage(scene: SceneName, faults: &[Fault], test: impl AsyncFnOnce(&Stage<Live>) -> Result<()>) -> Result<()> {
    in_front_of(|| Live::start(scene, faults), test)
}

#[test]
fn the_picture_follows_the_contact() -> Result<()> {
    on_stage(SceneName::Rest, &[], async |stage| {
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

#[test]
fn the_picture_moves_by_itself() -> Result<()> {
    on_stage(SceneName::Wandering, &[], async |stage| {
        let first = stage.browser.until("a contact", |told| told.number("contacts") == 1.0).await?.places_mm();
        let elsewhere = |told: &Told| told.number("contacts") == 1.0 && !told.is_pressed_at(first[0], 10.0);
        stage.browser.until("a contact elsewhere", elsewhere).await?;
        Ok(())
    })
}

#[test]
fn the_mouse_presses_where_it_is() -> Result<()> {
    on_stage(SceneName::Rest, &[], async |stage| {
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

#[test]
fn a_press_is_never_re_zeroed() -> Result<()> {
    on_stage(SceneName::Rest, &[], async |stage| {
        stage.behind.press([10.0, 10.0])?;
        stage.browser.until("a contact", |told| told.number("contacts") > 0.0).await?;
        let button = stage.browser.client.find(fantoccini::Locator::Id("rezero")).await?;
        button.click().await?;
        let notice = "return document.getElementById('notice-text').textContent";
        let is_refused = |notice: &Value| notice.as_str().is_some_and(|text| text.starts_with("Not re-zeroed"));
        stage.browser.shows(notice, is_refused).await?;
        stage.browser.until("the contact still", |told| told.number("contacts") == 1.0).await?;
        stage.behind.mouse.press(Vec::new());
        let rezeros = stage.browser.until("rest", |told| told.number("contacts") == 0.0).await?.number("rezeros");
        button.click().await?;
        stage.browser.until("a re-zero", |told| told.number("rezeros") > rezeros).await?;
        stage.browser.says("notice-text", "").await
    })
}

#[test]
fn a_second_page_keeps_up() -> Result<()> {
    if !chromium::is_here()? {
        return Ok(());
    }
    // A window that is not in front is not drawn: each page is in a browser of its own.
    let other = Chromium::start()?;
    on_stage(SceneName::Rest, &[], async |stage| {
        let second = other.open(&stage.behind.server.url()).await?;
        both_follow(stage, &second).await
    })
}

async fn both_follow(stage: &Stage<Live>, second: &Page) -> Result<()> {
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

#[test]
fn a_page_that_hangs_does_not_slow_the_board() -> Result<()> {
    on_stage(SceneName::Rest, &[], async |stage| {
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

#[test]
fn every_solver_can_be_chosen_while_frames_come() -> Result<()> {
    on_stage(SceneName::Rest, &[], async |stage| {
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

#[test]
fn a_broken_wire_is_told_and_its_electrode_crossed_out() -> Result<()> {
    let faults = ["open:3".parse::<Fault>()?];
    on_stage(SceneName::Rest, &faults, async |stage| {
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
#[test]
fn screenshot() -> Result<()> {
    let Some(folder) = std::env::var_os("TACTOMO_SCREENSHOT") else { return Ok(()) };
    let folder = std::path::Path::new(&folder);
    picture("light", &folder.join("live.png"))?;
    picture("dark", &folder.join("live-dark.png"))
}

/// A picture of a hand.
fn picture(theme: &str, file: &std::path::Path) -> Result<()> {
    in_front_of(
        || Live::start(SceneName::FiveFingers, &[]),
        async |stage| {
            stage.browser.theme(theme).await?;
            let hand = |told: &Told| told.number("contacts") >= 4.0 && told.text("image") == "false";
            stage.browser.until("a hand", hand).await?;
            // Until the strip chart has something to show.
            tokio::time::sleep(Duration::from_secs(6)).await;
            stage.browser.until("a hand", hand).await?;
            std::fs::write(file, stage.browser.client.screenshot().await?).context("the picture's folder")
        },
    )
}
