//! Calibrating from the page: a simulated board that is not the one described, and a finger that follows the page until that says that it is done.

use std::path::Path;
use std::time::{Duration, Instant};

use anyhow::{Context, Result, ensure};
use tactomo::detector::Detector;

use crate::chromium::Told;
use crate::live::Live;
use crate::stage::{Stage, in_front_of};

/// Longest that a person would follow; on two idle cores it takes a minute.
const PATIENCE: Duration = Duration::from_secs(180);
/// Time that the finger stays before it looks at the page again.
const AT_A_PLACE: Duration = Duration::from_millis(150);
/// Lightly and firmly.
const FIRMNESSES: [f64; 2] = [0.05, 0.8];

/// A finger that presses where the page says, as hard as it says, until the page tells what is wanted.
async fn follow_until(stage: &Stage<Live>, wanted: impl Fn(&Told) -> bool) -> Result<Told> {
    let begin = Instant::now();
    loop {
        let told = stage.browser.told().await?;
        if wanted(&told) {
            stage.behind.mouse.press(Vec::new());
            return Ok(told);
        }
        ensure!(begin.elapsed() < PATIENCE, "the guide does not end; the page tells {told:?}");
        // While all is fitted there is no target.
        if let Ok(at_mm) = serde_json::from_str::<[f64; 2]>(told.text("targetMm")) {
            stage.behind.press_with(at_mm, FIRMNESSES[usize::from(told.text("targetFirm") == "true")])?;
        }
        tokio::time::sleep(AT_A_PLACE).await;
    }
}

/// Distance from a press of where the page shows its contact (mm), in the mean over a few places.
async fn off_mm(stage: &Stage<Live>) -> Result<f64> {
    let places = [[-15.0, -12.0], [14.0, -15.0], [-13.0, 16.0]];
    let mut sum = 0.0;
    for [x_mm, y_mm] in places {
        stage.behind.press([x_mm, y_mm])?;
        tokio::time::sleep(Duration::from_secs(1)).await;
        let told = stage.browser.until("a contact", |told| !told.places_mm().is_empty()).await?;
        let off = |at: &[f64; 2]| (at[0] - x_mm).hypot(at[1] - y_mm);
        sum += told.places_mm().iter().map(off).fold(f64::INFINITY, f64::min);
    }
    stage.behind.mouse.press(Vec::new());
    Ok(sum / places.len() as f64)
}

async fn calibrates(stage: &Stage<Live>, folder: &Path) -> Result<()> {
    let before_mm = off_mm(stage).await?;
    stage.browser.click("calibrate").await?;
    stage.browser.until("rubbing", |told| told.text("calibrating") == "rubbing").await?;
    let first_mm = follow_until(stage, |told| told.number("fits") >= 1.0).await?.number("errorMm");
    let pictures = std::env::var_os("TACTOMO_SCREENSHOT").map(std::path::PathBuf::from);
    pictured(stage, pictures.as_deref(), "rubbing").await?;
    let begin = Instant::now();
    let done = follow_until(stage, |told| told.text("calibrating") == "done").await?;
    let last_mm = done.number("errorMm");
    eprintln!("expected {first_mm:.2} mm, after {:.0} s more {last_mm:.2} mm", begin.elapsed().as_secs_f64());
    ensure!(
        // The first fit of ten presses is nearly as good as it gets: six guides ended with 0.11 to 0.14 mm.
        last_mm < 0.2 && done.number("rubbed") > 0.8 && done.text("recommended") == "true",
        "from {first_mm} mm to {last_mm} mm: {done:?}"
    );
    pictured(stage, pictures.as_deref(), "done").await?;
    stage.browser.click("calibrate-save").await?;
    let saved = stage.browser.until("the file", |told| !told.text("calibrated").is_empty()).await?;
    let saved = Path::new(saved.text("calibrated")).to_owned();
    let name = saved.file_name().context("a file")?.to_owned();
    let detector = Detector::read(&folder.join(name))?;
    let calibration = detector.calibration.as_ref().context("what it was calibrated with")?;
    ensure!(
        calibration.board.is_some() && !calibration.date.is_empty() && calibration.presses > 20,
        "{} presses",
        calibration.presses
    );
    stage.browser.click("calibrate-use").await?;
    let in_use = "return document.getElementById('calibrate-use').disabled";
    tokio::time::sleep(Duration::from_secs(2)).await;
    ensure!(stage.browser.run(in_use).await? == true, "the detector is not in use");
    let after_mm = off_mm(stage).await?;
    eprintln!("contacts are off by {before_mm:.2} mm before, {after_mm:.2} mm after");
    pictured(stage, pictures.as_deref(), "used").await?;
    ensure!(after_mm < 2.0 * last_mm, "{before_mm} mm before, {after_mm} mm after, where {last_mm} mm were expected");
    stage.browser.click("calibrate-close").await?;
    stage.browser.until("the end", |told| told.text("calibrating").is_empty()).await?;
    Ok(())
}

/// Pictures of the page, if they are wanted.
async fn pictured(stage: &Stage<Live>, folder: Option<&Path>, name: &str) -> Result<()> {
    let Some(folder) = folder else { return Ok(()) };
    for theme in ["light", "dark"] {
        stage.browser.theme(theme).await?;
        tokio::time::sleep(Duration::from_millis(400)).await;
        std::fs::write(folder.join(format!("calibrate-{name}-{theme}.png")), stage.browser.client.screenshot().await?)?;
    }
    Ok(())
}

#[test]
fn who_follows_the_guide_finds_the_detector_that_was_built() -> Result<()> {
    let folder = std::env::temp_dir().join(format!("tactomo-calibrate-{}", std::process::id()));
    std::fs::create_dir_all(&folder)?;
    let outcome = in_front_of(|| Live::as_built(3, &folder), async |stage| calibrates(stage, &folder).await);
    std::fs::remove_dir_all(&folder)?;
    outcome
}
