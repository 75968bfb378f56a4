//! The picture of the touch: what shapes look like, up to where its colours go, and the history that it leaves.

use anyhow::{Context, Result, ensure};
use fantoccini::Locator;
use serde_json::Value;
use tactomo::solve::{FoundContact, FoundRing, FoundShape, Solution};

use crate::script::Script;
use crate::stage::{Stage, in_front_of};

#[test]
fn a_ring_is_as_wide_as_it_is_whatever_the_mesh() -> Result<()> {
    // How far pixels along a radius are from the colour of the ring's middle, 0 to 1: in the middle, where it is, within and beyond its edges.
    let script = "const canvas = document.getElementById('image');
        const colour = (xM, yM) => [...canvas.getContext('2d').getImageData(
            Math.floor((xM / 0.06 + 0.5) * canvas.width), Math.floor((0.5 - yM / 0.06) * canvas.height), 1, 1).data];
        const at = (rM) => colour(0.004 + rM * Math.cos(0.7), -0.002 + rM * Math.sin(0.7));
        const far = (rM) => Math.hypot(...at(rM).map((v, k) => v - colour(-0.029, 0.029)[k])) / 441;
        return [far(0), far(0.013), far(0.0116), far(0.0144), far(0.0085), far(0.0175)];";
    in_front_of(Script::start, async |stage| {
        let ring = FoundRing {
            centre_m: [0.004, -0.002],
            radius_m: 0.013,
            width_m: 0.004,
            conductance_s: 3e-3,
            ..FoundRing::default()
        };
        stage.behind.solution(Solution { shape: Some(FoundShape::Ring(ring)), ..Solution::default() });
        let is_ring = |seen: &Value| {
            let far = |i: usize| seen[i].as_f64().unwrap_or(f64::NAN);
            far(0) < 0.02
                && far(1) > 0.3
                && [2, 3].iter().all(|&i| far(i) > 0.7 * far(1))
                && far(4) < 0.02
                && far(5) < 0.02
        };
        stage.browser.shows(script, is_ring).await?;
        Ok(())
    })
}

async fn scale(stage: &Stage<Script>) -> Result<f64> {
    Ok(stage.browser.told().await?.number("scaleMaxSPerM2"))
}

#[test]
fn a_fixed_end_of_the_colours_stays_is_remembered_and_is_let_go() -> Result<()> {
    in_front_of(Script::start, async |stage| {
        let press = |conductance_s| vec![FoundContact { id: Some(1), ..FoundContact::flat(0.01, 0.0, conductance_s) }];
        let options = "return Array.from(document.getElementById('gain').options, (option) => option.value)";
        let options = stage.browser.run(options).await?;
        let chosen = options[6].as_str().context("a choice of ends")?;
        let end: f64 = chosen.parse()?;
        stage.browser.select("gain", chosen).await?;
        let is_end = |end: f64| move |told: &crate::chromium::Told| told.number("scaleMaxSPerM2") == end;
        stage.browser.until("the end that was chosen", is_end(end)).await?;
        // Far more and far less than it shows leave it as it is.
        for conductance_s in [1.0, 1e-6] {
            stage.behind.contacts(press(conductance_s));
            stage.behind.publish(60);
            ensure!(scale(stage).await? == end, "{} instead of {end}", scale(stage).await?);
        }
        stage.browser.client.find(Locator::Css("body")).await?.send_keys("+").await?;
        let less: f64 = options[5].as_str().context("a smaller end")?.parse()?;
        stage.browser.until("more gain", is_end(less)).await?;
        stage.browser.client.refresh().await?;
        stage.browser.until("the same after a reload", is_end(less)).await?;
        stage.behind.contacts(press(1.0));
        stage.browser.client.find(Locator::Css("body")).await?.send_keys("a").await?;
        stage.browser.until("it follows again", |told| told.number("scaleMaxSPerM2") > 10.0 * less).await?;
        ensure!(stage.browser.run("return document.getElementById('gain').value").await? == "");
        Ok(())
    })
}

#[test]
fn the_history_is_saved_with_the_boards_time() -> Result<()> {
    in_front_of(Script::start, async |stage| {
        let press = |id: u32, apparent_s: f64| FoundContact {
            id: Some(id),
            apparent_conductance_s: Some(apparent_s),
            ..FoundContact::flat(0.001 * f64::from(id), 0.0, 1.0)
        };
        stage.behind.contacts(vec![press(3, 0.25)]);
        stage.behind.publish(30);
        stage.behind.contacts(vec![press(3, 0.25), press(12, 0.5)]);
        stage.behind.publish(30);
        let catch = "window.saved = null; const url = URL.createObjectURL;
            URL.createObjectURL = (blob) => { blob.text().then((text) => { window.saved = text; }); return url.call(URL, blob); };";
        stage.browser.run(catch).await?;
        stage.browser.click("save-history").await?;
        let csv = stage.browser.shows("return window.saved", Value::is_string).await?;
        let csv = csv.as_str().context("a text")?;
        let mut rows = csv.lines();
        ensure!(rows.next() == Some("time_s,total_s,contact_3_s,contact_12_s"), "{csv}");
        let rows: Vec<Vec<&str>> = rows.map(|row| row.split(',').collect()).collect();
        ensure!(rows.len() > 5 && rows.iter().all(|row| row.len() == 4), "{csv}");
        for shown in [["0.25", "0.25", ""], ["0.75", "0.25", "0.5"]] {
            ensure!(rows.iter().any(|row| row[1..] == shown), "{shown:?} is missing: {csv}");
        }
        let times = rows.iter().map(|row| row[0].parse()).collect::<Result<Vec<f64>, _>>()?;
        ensure!(times.windows(2).all(|pair| pair[1] > pair[0] && pair[1] - pair[0] < 1.0), "{times:?}");
        stage.browser.until("a name", |told| told.text("saved").starts_with("tactomo-history-")).await?;
        Ok(())
    })
}
