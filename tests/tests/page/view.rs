//! What the page shows of snapshots that are made up, by pixels and by what it tells.

use std::time::Duration;

use anyhow::{Context, Result, bail, ensure};
use serde_json::Value;
use tactomo::run::LinkState;
use tactomo::solve::{Choice, Flags, FoundContact, FoundLine, FoundRing, FoundShape, Solution, Uncertainty};

use crate::chromium::Told;
use crate::script::Script;
use crate::stage::{Stage, in_front_of};

/// The place (mm) of the pixel of the flat picture that differs most from nothing, and by how much, 0 to 1.
const HOTTEST: &str = "const canvas = document.getElementById('image');
    const { width, height } = canvas;
    const { data } = canvas.getContext('2d').getImageData(0, 0, width, height);
    const far = (i) => Math.hypot(data[i] - data[at], data[i + 1] - data[at + 1], data[i + 2] - data[at + 2]);
    const at = 4 * (Math.floor(height * 0.97) * width + Math.floor(width * 0.97));
    let best = 0, sum = [0, 0, 0];
    for (let i = 0; i < data.length; i += 4) best = Math.max(best, far(i));
    for (let i = 0; i < data.length; i += 4) {
      if (far(i) < best - 3) continue;
      sum = [sum[0] + 1, sum[1] + (i / 4) % width, sum[2] + Math.floor(i / 4 / width)];
    }
    return [(sum[1] / sum[0] / width - 0.5) * 60, (0.5 - sum[2] / sum[0] / height) * 60, best / 441];";

/// How much the [`HOTTEST`] pixel differs; not a number if it is not told.
fn heat(hottest: &Value) -> f64 {
    hottest[2].as_f64().unwrap_or(f64::NAN)
}

/// Whether the [`HOTTEST`] pixel is within 1 mm of a place (mm).
fn is_at(hottest: &Value, [x_mm, y_mm]: [f64; 2]) -> bool {
    matches!((hottest[0].as_f64(), hottest[1].as_f64()), (Some(x), Some(y)) if (x - x_mm).hypot(y - y_mm) < 1.0)
}

fn contact(id: u32, [x_mm, y_mm]: [f64; 2], conductance_s: f64) -> FoundContact {
    FoundContact { id: Some(id), ..FoundContact::flat(x_mm * 1e-3, y_mm * 1e-3, conductance_s) }
}

async fn settled(stage: &Stage<Script>) {
    stage.behind.publish(3);
    tokio::time::sleep(Duration::from_millis(700)).await;
}

#[test]
fn heat_is_drawn_where_a_contact_is() -> Result<()> {
    in_front_of(Script::start, async |stage| {
        let at_rest = stage.browser.run(HOTTEST).await?;
        ensure!(heat(&at_rest) < 0.01, "at rest there are colours: {at_rest}");
        for place in [[12.0, 9.0], [-14.0, -20.0]] {
            stage.behind.contacts(vec![contact(1, place, 3e-4)]);
            stage.browser.shows(HOTTEST, |hottest| is_at(hottest, place) && heat(hottest) > 0.3).await?;
        }
        Ok(())
    })
}

#[test]
fn a_shape_is_named_outlined_and_listed_without_the_contacts_beside_it() -> Result<()> {
    let line = FoundLine {
        from_m: [-0.018, -0.01],
        to_m: [0.014, 0.014],
        width_m: 0.004,
        conductance_s: 2e-3,
        uncertainty: None,
    };
    let ring = FoundRing { centre_m: [0.005, 0.0], radius_m: 0.013, width_m: 0.004, ..FoundRing::default() };
    let script = "const dark = (xM, yM) => { const canvas = document.getElementById('marks');
            const image = document.getElementById('image');
            const ratio = canvas.width / canvas.clientWidth;
            const [x, y] = [image.offsetLeft + (xM / 0.06 + 0.5) * image.clientWidth, image.offsetTop + (0.5 - yM / 0.06) * image.clientHeight];
            const { data } = canvas.getContext('2d').getImageData(x * ratio - 4, y * ratio - 4, 8, 8);
            let most = 0; for (let i = 3; i < data.length; i += 4) most = Math.max(most, data[i]); return most; };
        return [document.getElementById('choice').textContent, document.getElementById('contacts').textContent,
            dark(-0.0032, 0.0036), dark(0.005, 0.015), dark(-0.01, 0.02)];";
    in_front_of(Script::start, async |stage| {
        let shapes = [
            (FoundShape::Line(line), "Line, 40 mm", "to 14.0, 14.0", 2),
            (FoundShape::Ring(ring), "Ring, 26 mm", "5.0, 0.0", 3),
        ];
        for (shape, name, place, outlined) in shapes {
            stage.behind.solution(Solution {
                contacts: vec![contact(1, [-10.0, 20.0], 2e-4)],
                shape: Some(shape),
                residual: Some(1.0),
                choice: Some(Choice { what: shape.name().to_owned(), why: "residual 1.0 x noise".to_owned() }),
                ..Solution::default()
            });
            let is_told = |told: &Told| told.text("shape") == shape.name() && told.text("contacts") == "0";
            stage.browser.until(name, is_told).await?;
            let is_shown = |shown: &Value| {
                let text = |i: usize| shown[i].as_str().unwrap_or_default();
                text(0).starts_with(name) && text(1).contains(place) && shown[outlined].as_u64() > Some(60)
            };
            let shown = stage.browser.shows(script, is_shown).await?;
            ensure!(shown[4].as_u64() == Some(0), "the contact beside it is drawn: {shown}");
        }
        Ok(())
    })
}

#[test]
fn while_a_touch_is_searched_nothing_says_that_nothing_touches() -> Result<()> {
    in_front_of(Script::start, async |stage| {
        for (what, headline, table) in [
            ("searching", "Something touches", "Looking for what touches."),
            ("nothing", "Nothing touches", "Nothing touches."),
        ] {
            let choice = Some(Choice { what: what.to_owned(), why: "residual 9.0 x noise".to_owned() });
            stage.behind.solution(Solution { choice, residual: Some(9.0), ..Solution::default() });
            stage.browser.says("choice", headline).await?;
            stage.browser.says("no-contacts", table).await?;
        }
        Ok(())
    })
}

#[test]
fn a_warning_goes_with_its_answer_though_no_other_answer_comes() -> Result<()> {
    in_front_of(Script::start, async |stage| {
        let flagged = |misfit| Flags { misfit, ..Flags::default() };
        let answer = |misfit| Solution {
            contacts: vec![contact(1, [5.0, 5.0], 3e-4)],
            residual: Some(1.0),
            flags: flagged(misfit),
            ..Solution::default()
        };
        stage.behind.solution(answer(true));
        stage.browser.says("warnings", "readings do not fit").await?;
        // The last answer has no warning, and then the stream stands still.
        stage.behind.solution(answer(false));
        let is_without = |told: &Told| told.text("flags").is_empty();
        stage.browser.until("an answer without a warning", is_without).await?;
        stage.behind.set(|snapshot| snapshot.answer = None);
        // It would be of an answer that is no longer shown.
        stage.browser.says("warnings", "").await
    })
}

/// The end of the colours' scale (S/m2), once it no longer moves: on a busy machine that takes longer.
async fn still_scale(stage: &Stage<Script>) -> Result<f64> {
    let mut last = f64::INFINITY;
    for _ in 0..40 {
        tokio::time::sleep(Duration::from_millis(500)).await;
        let now = stage.browser.told().await?.number("scaleMaxSPerM2");
        if (now / last).ln().abs() < 0.02 {
            return Ok(now);
        }
        last = now;
    }
    bail!("the scale still moves after 20 s: {last} S/m2")
}

#[test]
fn one_sharp_frame_changes_no_colours() -> Result<()> {
    in_front_of(Script::start, async |stage| {
        stage.behind.patch([5.0, 5.0], 2.0);
        let before = still_scale(stage).await?;
        let hottest = stage.browser.run(HOTTEST).await?;
        ensure!(heat(&hottest) > 0.15, "an image of 2 S/m2 is hardly to be seen: {hottest}");
        stage.behind.patch([5.0, 5.0], 200.0);
        stage.behind.publish(3);
        stage.behind.patch([5.0, 5.0], 2.0);
        settled(stage).await;
        let after = stage.browser.told().await?.number("scaleMaxSPerM2");
        ensure!((after / before).ln().abs() < 0.3, "the scale went from {before} to {after} S/m2");
        Ok(())
    })
}

#[test]
fn a_light_touch_shows_soon_after_a_hard_one() -> Result<()> {
    in_front_of(Script::start, async |stage| {
        stage.behind.patch([5.0, 5.0], 200.0);
        // The scale ends between the largest value that is drawn of this coarse grid, 152 S/m2, and 15 % above it.
        let hard = stage.browser.until("a hard press", |told| told.number("scaleMaxSPerM2") > 150.0);
        hard.await?;
        stage.behind.patch([5.0, 5.0], 0.5);
        tokio::time::sleep(Duration::from_millis(2500)).await;
        let hottest = stage.browser.run(HOTTEST).await?;
        ensure!(heat(&hottest) > 0.1, "after 2.5 s a touch of 0.5 S/m2 is hardly to be seen: {hottest}");
        Ok(())
    })
}

#[test]
fn the_strip_chart_has_each_contacts_value() -> Result<()> {
    in_front_of(Script::start, async |stage| {
        stage.behind.contacts(vec![contact(7, [5.0, 5.0], 2e-4), contact(9, [-5.0, 5.0], 4e-4)]);
        let script = "const strip = document.getElementById('strip');
            const { data } = strip.getContext('2d').getImageData(0, 0, strip.width, strip.height);
            const hue = (id) => getComputedStyle(document.documentElement).getPropertyValue(`--hue-${(id - 1) % 8}`).trim();
            const rgb = (text) => [1, 3, 5].map((i) => parseInt(text.slice(i, i + 2), 16));
            const count = ([r, g, b]) => { let n = 0; for (let i = 0; i < data.length; i += 4)
              n += Math.hypot(data[i] - r, data[i + 1] - g, data[i + 2] - b) < 12 && data[i + 3] > 200; return n; };
            return [JSON.parse(strip.dataset.values), count(rgb(hue(7))), count(rgb(hue(9)))]";
        let has = |shown: &Value, id, value_s: f64| shown[0][id].as_f64().is_some_and(|s| (s - value_s).abs() < 1e-6);
        let is_drawn = |line: &Value| line.as_u64() > Some(5);
        let both = |shown: &Value| {
            has(shown, "7", 2e-4) && has(shown, "9", 4e-4) && is_drawn(&shown[1]) && is_drawn(&shown[2])
        };
        stage.browser.shows(script, both).await?;
        Ok(())
    })
}

#[test]
fn a_label_and_its_row_show_the_same_number_at_any_moment() -> Result<()> {
    in_front_of(Script::start, async |stage| {
        let script = "const row = document.querySelector('#contacts .value');
            return [JSON.parse(document.documentElement.dataset.labels), row?.textContent]";
        stage.behind.contacts(vec![contact(4, [10.0, 0.0], 3e-4)]);
        settled(stage).await;
        let mut numbers = Vec::new();
        for i in 0..100 {
            stage.behind.contacts(vec![contact(4, [10.0, 0.0], 3e-4 + 2e-6 * f64::from(i))]);
            stage.behind.publish(1);
            let shown = stage.browser.run(script).await?;
            ensure!(shown[0].as_array().is_some_and(|labels| labels.len() == 1), "{shown}");
            ensure!(shown[0][0] == shown[1], "{shown}");
            numbers.push(shown[1].clone());
        }
        numbers.dedup();
        ensure!(numbers.len() > 3, "the numbers stand still: {numbers:?}");
        Ok(())
    })
}

/// A contact with a force.
fn pressed(contact: FoundContact, force_n: f64, deviation_n: f64, is_beyond: bool) -> FoundContact {
    FoundContact {
        force_n: Some(force_n),
        force_deviation_n: Some(deviation_n),
        force_beyond_maximum: Some(is_beyond),
        ..contact
    }
}

#[test]
fn newtons_are_shown_with_their_error_where_the_detector_has_a_law() -> Result<()> {
    in_front_of(Script::start, async |stage| {
        let script = "const cells = [...document.querySelectorAll('#contacts .value')];
            return [document.getElementById('strength').textContent, ...cells.map((cell) => cell.textContent),
              ...cells.map((cell) => cell.closest('td').title), JSON.parse(document.getElementById('strip').dataset.values)[4]]";
        stage.behind.contacts(vec![contact(4, [10.0, 0.0], 3e-4)]);
        stage.browser.shows(script, |shown| shown[0] == "firmness" && shown[1] == "300\u{2009}µS").await?;
        let light = pressed(contact(4, [10.0, 0.0], 3e-4), 0.734, 0.0612, false);
        stage.behind.contacts(vec![light, pressed(contact(5, [-10.0, 0.0], 5e-3), 7.5, 3.0, true)]);
        let told = "force 7.50 ± 3.00\u{2009}N, beyond the largest that can be told; conductance 5.00\u{2009}mS";
        let forces = |shown: &Value| {
            shown[0] == "force"
                && shown[1] == "734 ± 61\u{2009}mN"
                && shown[2] == "\u{2273}\u{2009}7.50\u{2009}N"
                && shown[3] == "force 734 ± 61\u{2009}mN; conductance 300\u{2009}µS"
                && shown[4] == told
                && shown[5].as_f64().is_some_and(|force_n| (force_n - 0.734).abs() < 1e-6)
        };
        stage.browser.shows(script, forces).await?;
        Ok(())
    })
}

#[test]
fn the_view_in_space_rises_where_it_is_pressed() -> Result<()> {
    in_front_of(Script::start, async |stage| {
        stage.browser.click("view-space").await?;
        settled(stage).await;
        let script = "const canvas = document.getElementById('space');
            const { data } = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height);
            let top = canvas.height, drawn = 0;
            for (let i = 3; i < data.length; i += 4) if (data[i]) { drawn += 1; top = Math.min(top, Math.floor(i / 4 / canvas.width)); }
            const colours = new Set(new Uint32Array(data.buffer)).size;
            return [drawn / (canvas.width * canvas.height), colours, top / canvas.height]";
        let rest = stage.browser.run(script).await?;
        ensure!(rest[0].as_f64() > Some(0.1), "the detector covers {} of the picture", rest[0]);
        // Far from the eye, so that it rises over the edge behind.
        stage.behind.contacts(vec![contact(1, [-20.0, 24.0], 1e-3)]);
        let rises = |pressed: &Value| {
            pressed[1].as_u64() > rest[1].as_u64().map(|colours| colours + 20) && pressed[2].as_f64() < rest[2].as_f64()
        };
        stage.browser.shows(script, rises).await.with_context(|| format!("after {rest}"))?;
        eprintln!("drawn in {} ms", stage.browser.told().await?.text("drawMs"));
        Ok(())
    })
}

/// Width of what does not fit across, and what is cut off below (CSS pixels).
const OVERFLOW: &str = "const box = document.getElementById('tools').getBoundingClientRect();
    const plot = document.getElementById('image').getBoundingClientRect();
    const wide = [...document.querySelectorAll('body *')].filter((e) => !e.closest('svg') && getComputedStyle(e).position !== 'absolute'
      && e.getBoundingClientRect().right > innerWidth + 0.5).map((e) => e.id || e.tagName);
    for (const card of document.querySelectorAll('.card')) if (card.scrollWidth > card.clientWidth + 1) wide.push(`within ${card.id}`);
    return [document.documentElement.scrollWidth - innerWidth, document.documentElement.scrollHeight - innerHeight,
      box.bottom - innerHeight, plot.width, wide.join(' ')]";

#[test]
fn nothing_is_cut_off_on_a_phone_or_a_low_window() -> Result<()> {
    in_front_of(Script::start, async |stage| {
        let at = |i: u32| contact(i + 100, [10.0 * f64::from(i) - 20.0, 5.0], 1e-4);
        let five = (0..5).map(|i| pressed(at(i), 0.123 * f64::from(i + 1), 0.0456, i == 4)).collect();
        stage.behind.contacts(five);
        stage.behind.set(|snapshot| snapshot.baseline = Some("Something pressed at the start.".to_owned()));
        stage.browser.resize(1280, 760).await?;
        settled(stage).await;
        let low = stage.browser.run(OVERFLOW).await?;
        ensure!(low[0] == 0 && low[1] == 0 && low[4] == "", "{low}");
        ensure!(low[2].as_f64() < Some(0.0) && low[3].as_f64() > Some(380.0), "{low}");
        phone(stage).await
    })
}

/// A phone of 390 px, within a frame: windows of a browser on a desktop are not made as narrow.
async fn phone(stage: &Stage<Script>) -> Result<()> {
    stage.browser.resize(390, 844).await?;
    settled(stage).await;
    let width = stage.browser.run("return innerWidth").await?;
    ensure!(width == 390, "the window is {width} px wide");
    let shown = stage.browser.run(OVERFLOW).await?;
    ensure!(shown[0] == 0 && shown[4] == "", "{shown}");
    ensure!(shown[3].as_f64() > Some(240.0), "{shown}");
    Ok(())
}

#[test]
fn the_board_card_leaves_the_readings_as_they_are() -> Result<()> {
    in_front_of(Script::start, async |stage| {
        let script = "const map = document.getElementById('readings-map').getBoundingClientRect();
            const card = document.getElementById('readings-card').getBoundingClientRect();
            const board = document.getElementById('details-card').getBoundingClientRect();
            return [map.width, map.height, map.bottom <= card.bottom, card.bottom <= board.top]";
        for (width, height) in [(1280, 760), (1280, 560), (800, 900)] {
            stage.browser.resize(width, height).await?;
            settled(stage).await;
            let before = stage.browser.run(script).await?;
            stage.browser.run("document.getElementById('details-card').open = true").await?;
            settled(stage).await;
            let after = stage.browser.run(script).await?;
            ensure!(before == after, "{after} instead of {before}");
            ensure!(after[0] == after[1] && after[0].as_f64() > Some(150.0), "{after}");
            ensure!(after[2] == true && after[3] == true, "{after}");
            stage.browser.run("document.getElementById('details-card').open = false").await?;
        }
        Ok(())
    })
}

#[test]
fn a_silent_board_is_never_live() -> Result<()> {
    in_front_of(Script::start, async |stage| {
        let words = "The board has said Hello, and sends no frames: is its firmware stuck?";
        stage.behind.set(|snapshot| snapshot.link = LinkState::Silent(words.to_owned()));
        stage.browser.until("silence", |told| told.text("state") == "silent").await?;
        let script = "return [document.getElementById('state-text').textContent,
            getComputedStyle(document.querySelector('.dot')).backgroundColor,
            getComputedStyle(document.documentElement).getPropertyValue('--good')]";
        let shown = stage.browser.run(script).await?;
        ensure!(shown[0].as_str().is_some_and(|text| text.contains(words) && !text.contains("Live")), "{shown}");
        ensure!(shown[1] != "rgb(31, 138, 76)" && shown[2] == "#1f8a4c", "the dot is green: {shown}");
        Ok(())
    })
}

#[test]
fn what_the_program_says_is_shown_in_plain_words() -> Result<()> {
    in_front_of(Script::start, async |stage| {
        let sentence = "Something pressed at the start: let go, and re-zero.";
        stage.behind.set(|snapshot| snapshot.baseline = Some(sentence.to_owned()));
        let errors = Uncertainty { x_m: 0.004, y_m: 0.002, correlation: 0.3, conductance_s: 1e-6 };
        let blurred = FoundContact { uncertainty: Some(errors), ..contact(2, [-10.0, 0.0], 1e-4) };
        let flags = Flags { excluded: vec![3], ..Flags::default() };
        let contacts = vec![contact(1, [10.0, 0.0], 3e-4), blurred];
        stage.behind.solution(Solution { contacts, residual: Some(1.04), flags, ..Solution::default() });
        stage.browser.says("choice", "2 contacts").await?;
        stage.browser.says("warnings", "electrode 3 left out").await?;
        stage.browser.says("notice-text", sentence).await?;
        let residual = "return document.getElementById('residual').textContent";
        let is_told =
            |shown: &Value| shown.as_str().is_some_and(|s| s.starts_with("unexplained 1.0 × noise · answer "));
        stage.browser.shows(residual, is_told).await?;
        let another = "my-sensor was calibrated on another board.";
        stage.behind.set(|snapshot| (snapshot.baseline, snapshot.calibration) = (None, Some(another.to_owned())));
        stage.browser.says("notice-text", another).await?;
        ensure!(stage.browser.run("return document.getElementById('notice').className").await? == "warning");
        Ok(())
    })
}
