//! What is seen at once: the picture, how many, how firm, where, and how sure.

use anyhow::{Context, Result, ensure};
use serde_json::Value;
use tactomo::solve::{Alternative, FoundContact, Solution};

use crate::script::Script;
use crate::stage::{Stage, in_front_of};
use crate::states::STATES;

fn contact(id: u32, [x_mm, y_mm]: [f64; 2], apparent_s: f64) -> FoundContact {
    let flat = FoundContact::flat(x_mm * 1e-3, y_mm * 1e-3, 3.0 * apparent_s);
    FoundContact { id: Some(id), apparent_conductance_s: Some(apparent_s), ..flat }
}

/// Share of the window's height that the sensor has, and how much is cut off.
const SHARE: &str = "const image = document.getElementById('image').getBoundingClientRect();
    const card = document.getElementById('picture').getBoundingClientRect();
    return [image.height / innerHeight, document.documentElement.scrollHeight - innerHeight, image.bottom - card.bottom, innerWidth]";

/// Waits until it has 70 % at this size, and nothing is cut off.
async fn rules(stage: &Stage<Script>, [width, height]: [u32; 2]) -> Result<()> {
    stage.browser.resize(width, height).await?;
    let rules = |shown: &Value| {
        let [share, below] = [0, 2].map(|index| shown[index].as_f64());
        shown[3] == width && shown[1] == 0 && share >= Some(0.7) && below < Some(0.0)
    };
    stage.browser.shows(SHARE, rules).await.with_context(|| format!("{width} x {height}")).map(drop)
}

#[test]
fn a_square_sensor_has_most_of_the_height() -> Result<()> {
    in_front_of(Script::start, async |stage| {
        stage.behind.solution(Solution { contacts: vec![contact(1, [5.0, 5.0], 2e-4)], ..Solution::default() });
        for size in [[1280, 580], [1366, 628], [1366, 768], [1920, 1080], [844, 390]] {
            rules(stage, size).await?;
        }
        stage.behind.set(|snapshot| snapshot.baseline = Some("Something pressed at the start.".to_owned()));
        stage.browser.says("notice-text", "Something pressed at the start.").await?;
        rules(stage, [1280, 580]).await
    })
}

#[test]
fn the_total_and_its_centre_are_those_of_all_contacts() -> Result<()> {
    in_front_of(Script::start, async |stage| {
        let contacts = vec![contact(1, [10.0, 0.0], 3e-4), contact(2, [-20.0, 8.0], 1e-4)];
        stage.behind.solution(Solution { contacts, certainty: Some(0.99), ..Solution::default() });
        stage.browser.says("total", "400\u{2009}µS").await?;
        stage.browser.says("centre", "2.5, 2.0 mm").await?;
        stage.browser.says("sure", "sure of the number (99 %)").await?;
        let firm = |id, x_mm, force_n| FoundContact { force_n: Some(force_n), ..contact(id, [x_mm, 0.0], 1e-4) };
        let contacts = vec![firm(1, 10.0, 0.5), firm(2, -10.0, 1.5)];
        stage.behind.solution(Solution { contacts, ..Solution::default() });
        stage.browser.says("total-name", "force").await?;
        stage.browser.says("total", "2.00\u{2009}N").await?;
        stage.browser.says("centre", "\u{2212}5.0, 0.0 mm").await?;
        stage.behind.solution(Solution::default());
        stage.browser.says("total", "\u{2013}").await?;
        stage.browser.says("choice", "Nothing touches").await
    })
}

#[test]
fn another_number_that_may_be_right_is_in_the_headline() -> Result<()> {
    in_front_of(Script::start, async |stage| {
        let contacts: Vec<_> = (1..=4).map(|id| contact(id, [10.0 * f64::from(id) - 25.0, 0.0], 1e-4)).collect();
        let alternative = Some(Alternative { contacts: 3, certainty: 0.3 });
        stage.behind.solution(Solution { contacts, certainty: Some(0.66), alternative, ..Solution::default() });
        stage.browser.says("choice", "3 or 4 contacts").await?;
        stage.browser.says("sure", "not sure of the number (66 %)").await
    })
}

#[test]
fn a_notice_that_was_read_comes_again_only_with_other_words() -> Result<()> {
    in_front_of(Script::start, async |stage| {
        let hidden = "return document.getElementById('notice').hidden";
        let tell = |words: &'static str| {
            stage.behind.set(|snapshot| snapshot.baseline = Some(words.to_owned()));
        };
        tell("Something pressed at the start.");
        stage.browser.shows(hidden, |hidden| *hidden == Value::Bool(false)).await?;
        stage.browser.click("notice-close").await?;
        stage.behind.set(|snapshot| snapshot.statistics.frames += 1);
        tokio::time::sleep(std::time::Duration::from_millis(400)).await;
        ensure!(stage.browser.run(hidden).await? == Value::Bool(true));
        tell("Touched for long.");
        stage.browser.shows(hidden, |hidden| *hidden == Value::Bool(false)).await?;
        Ok(())
    })
}

/// Waits until these elements are within the window and within the box of the element around each that cuts it off.
async fn in_sight(stage: &Stage<Script>, ids: &[&str]) -> Result<()> {
    let script = format!(
        "return {ids:?}.filter((id) => {{
            const at = document.getElementById(id);
            const {{ left, top, right, bottom, width }} = at.getBoundingClientRect();
            const card = at.closest('.card').getBoundingClientRect();
            return !(width > 0 && left >= card.left && right <= card.right && top >= card.top && bottom <= Math.min(card.bottom, innerHeight) && right <= innerWidth);
        }})"
    );
    stage.browser.shows(&script, |hidden| hidden.as_array().is_some_and(Vec::is_empty)).await.map(drop)
}

#[test]
fn on_a_phone_that_lies_chart_and_calibration_need_no_scrolling() -> Result<()> {
    in_front_of(Script::start, async |stage| {
        stage.browser.resize(844, 390).await?;
        for (name, ids) in [
            ("several", &["strip", "strip-60", "save-history", "rescale"][..]),
            ("calibrating", &["calibrate-now", "calibrate-error", "calibrate-finish"]),
            (
                "calibrated",
                &["calibrate-now", "calibrate-compared", "calibrate-more", "calibrate-save", "calibrate-use"],
            ),
            ("kept", &["calibrate-now", "calibrate-compared", "calibrate-note", "calibrate-more"]),
        ] {
            let state = STATES.iter().find(|state| state.name == name).context("the state")?;
            state.enter(&stage.behind, &stage.browser).await?;
            in_sight(stage, ids).await.context(name)?;
        }
        Ok(())
    })
}

#[test]
fn no_label_lies_over_the_ring_to_press_at() -> Result<()> {
    // Between the ring and its dot nothing is drawn: how much is there, and whether there is a ring.
    let script = "const target = JSON.parse(document.documentElement.dataset.targetMm ?? 'null');
        if (!target) return [-1, 0];
        const [canvas, image] = ['marks', 'image'].map((id) => document.getElementById(id));
        const ratio = canvas.width / canvas.clientWidth;
        const at = [image.offsetLeft + (target[0] / 60 + 0.5) * image.clientWidth, image.offsetTop + (0.5 - target[1] / 60) * image.clientHeight];
        const most = (radius) => Math.max(...Array.from({ length: 32 }, (_, i) => canvas.getContext('2d').getImageData(
          ratio * (at[0] + radius * Math.cos(i * Math.PI / 16)), ratio * (at[1] + radius * Math.sin(i * Math.PI / 16)), 1, 1).data[3]));
        return [most(8), most(17)]";
    in_front_of(Script::start, async |stage| {
        let state = STATES.iter().find(|state| state.name == "calibrating").context("the state")?;
        state.enter(&stage.behind, &stage.browser).await?;
        for [width, height] in [[844, 390], [390, 844], [1280, 800]] {
            stage.browser.resize(width, height).await?;
            stage
                .browser
                .shows(script, |shown| shown[0] == 0 && shown[1] == 255)
                .await
                .with_context(|| format!("{width} x {height}"))?;
        }
        Ok(())
    })
}
