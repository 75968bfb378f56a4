//! What the page's controls ask.

use std::time::Duration;

use anyhow::{Result, bail, ensure};
use fantoccini::Locator;
use fantoccini::key::Key;
use tactomo::board::link::{Control, Playing};
use tactomo::board::record::Loss;
use tactomo::board::session::RequestedSettings;
use tactomo::run::scanning::ScanChoice;
use tactomo::run::{LinkState, Request, Scan, Snapshot};
use tactomo::scene::{Contact, SceneName};
use tactomo::schema::csv_heads;
use tactomo::simulate::Fault;
use tactomo::solve::FoundContact;
use tactomo_protocol::Hello;

use crate::chromium::Page;
use crate::script::{FINGER, Script};
use crate::stage::{Stage, in_front_of};

fn hello() -> Hello {
    Hello { adc_full_scale_mv: 2000, ..Hello::example(16) }
}

fn recording(position_s: f64, paused: bool) -> Playing {
    damaged(position_s, paused, Loss::default())
}

fn damaged(position_s: f64, paused: bool, damage: Loss) -> Playing {
    let ended = position_s >= 20.0;
    Playing::Recording { position_s, length_s: 20.0, speed: 1.0, paused, looped: false, ended, damage }
}

async fn visible(browser: &Page, id: &str) -> Result<bool> {
    Ok(browser.client.find(Locator::Id(id)).await?.is_displayed().await?)
}

/// Waits until the element of this id can be seen.
async fn appears(browser: &Page, id: &str) -> Result<()> {
    browser.shows(&format!("return document.getElementById('{id}').checkVisibility()"), |seen| seen == true).await?;
    Ok(())
}

async fn asks(stage: &Stage<Script>, expected: Request) -> Result<()> {
    let request = stage.behind.request()?;
    ensure!(request == expected, "{request:?} instead of {expected:?}");
    Ok(())
}

#[test]
fn a_simulated_board_takes_scenes_faults_and_settings() -> Result<()> {
    in_front_of(Script::start, async |stage| {
        let simulated = Playing::Simulated { scene: SceneName::Rest, faults: Vec::new() };
        stage.behind.set(|snapshot| {
            (snapshot.playing, snapshot.hello) = (simulated, Some(hello()));
        });
        appears(&stage.browser, "simulation").await?;
        stage.browser.select("scene", "five-fingers").await?;
        asks(stage, Request::Control(Control::Scene(SceneName::FiveFingers))).await?;
        for (scene, name) in [
            ("gripper", SceneName::Gripper),
            ("display", SceneName::Display),
            ("pointer", SceneName::Pointer),
            ("texture", SceneName::Texture),
            ("hand", SceneName::Hand),
        ] {
            stage.browser.select("scene", scene).await?;
            asks(stage, Request::Control(Control::Scene(name))).await?;
        }
        let said = "return document.querySelector('#scene option[value=gripper]').textContent";
        let said = stage.browser.run(said).await?;
        ensure!(said == "gripper (other sensor)", "{said}: it was made for another detector than this one");
        stage.browser.select("fault", "open:3").await?;
        asks(stage, Request::Control(Control::Faults(vec![Fault::Open { electrode: 3 }]))).await?;
        stage.browser.run("document.getElementById('details-card').open = true").await?;
        stage.browser.select("average", "3").await?;
        stage
            .browser
            .run("document.getElementById('settle').value = 25; document.getElementById('max-rate').value = 100")
            .await?;
        stage
            .browser
            .run("document.getElementById('select').value = 17; document.getElementById('discard').value = 1")
            .await?;
        stage.browser.run("document.getElementById('settings').requestSubmit()").await?;
        let settings = RequestedSettings {
            settle_us: Some(25),
            average_log2: Some(3),
            max_frames_per_s: Some(100),
            select_us: Some(17),
            discarded: Some(1),
        };
        asks(stage, Request::Settings(settings)).await?;
        stage.browser.click("rezero").await?;
        asks(stage, Request::Rezero).await
    })
}

#[test]
fn the_board_card_says_which_rows_are_scanned() -> Result<()> {
    in_front_of(Script::start, async |stage| {
        let adaptive = |grounds: Vec<u8>, others| Scan { choice: ScanChoice::Adaptive, grounds, others };
        for (scan, said) in [
            (Scan::default(), "whole frames, 1\u{2009}400 frames/s"),
            (
                adaptive(vec![5, 6, 10], true),
                "adaptive: grounds 5, 6, 10 and the others in turn, 1\u{2009}400 frames/s",
            ),
            (adaptive((0..16).collect(), false), "adaptive: all grounds in turn, 1\u{2009}400 frames/s"),
            (adaptive(Vec::new(), false), "adaptive: whole frames, 1\u{2009}400 frames/s"),
            (
                Scan { choice: ScanChoice::Grounds(vec![3]), grounds: vec![3], others: false },
                "ground 3, 1\u{2009}400 frames/s",
            ),
        ] {
            stage.behind.set(|snapshot| {
                (snapshot.hello, snapshot.scan) = (Some(hello()), scan);
                snapshot.statistics.frames_per_s = 1400.0;
            });
            let shown = "return [...document.querySelectorAll('#details dt')].find((term) => term.textContent === 'Scan').nextSibling.textContent";
            stage.browser.shows(shown, |shown| shown == said).await?;
        }
        Ok(())
    })
}

#[test]
fn the_board_card_names_the_file_that_was_learned_before() -> Result<()> {
    in_front_of(Script::start, async |stage| {
        let shown = "return [...document.querySelectorAll('#details dt')].find((term) => term.textContent === 'Detector').nextSibling.textContent";
        for (from, ending) in [
            (None, "16 electrodes"),
            (Some("/home/me/my.A7.learned.toml"), "16 electrodes, as learned in my.A7.learned.toml"),
            (None, "16 electrodes"),
        ] {
            stage.behind.set(|snapshot| {
                (snapshot.hello, snapshot.learned_from) = (Some(hello()), from.map(Into::into));
            });
            stage.browser.shows(shown, |shown| shown.as_str().is_some_and(|text| text.ends_with(ending))).await?;
        }
        Ok(())
    })
}

#[test]
fn recording_is_asked_for_and_its_file_shown() -> Result<()> {
    in_front_of(Script::start, async |stage| {
        stage.browser.click("record").await?;
        asks(stage, Request::Record(true)).await?;
        stage.behind.set(|snapshot| snapshot.recording = Some("/tmp/touch.tactomo".into()));
        stage.browser.says("notice-text", "Recording to /tmp/touch.tactomo").await?;
        stage.browser.client.find(Locator::Css("body")).await?.send_keys("r").await?;
        asks(stage, Request::Record(false)).await
    })
}

#[test]
fn what_is_damaged_in_a_recording_is_said() -> Result<()> {
    in_front_of(Script::start, async |stage| {
        let damage = Loss { damaged_places: 1, left_out_bytes: 70, ..Loss::default() };
        for (damage, said) in
            [(damage, "This recording is damaged: it is damaged in 1 place (70 bytes left out)"), (Loss::default(), "")]
        {
            stage.behind.set(|snapshot| snapshot.playing = damaged(1.0, false, damage));
            stage.browser.says("notice-text", said).await?;
        }
        Ok(())
    })
}

#[test]
fn a_recording_is_held_sought_and_played_again() -> Result<()> {
    in_front_of(Script::start, async |stage| {
        ensure!(!visible(&stage.browser, "transport").await?, "there is nothing to play");
        stage.behind.set(|snapshot| snapshot.playing = recording(5.0, false));
        appears(&stage.browser, "transport").await?;
        stage.browser.click("play").await?;
        asks(stage, Request::Control(Control::Pause(true))).await?;
        stage.browser.client.find(Locator::Id("seek")).await?.send_keys(&char::from(Key::End).to_string()).await?;
        asks(stage, Request::Control(Control::Seek(20.0))).await?;
        stage.browser.select("speed", "0.25").await?;
        asks(stage, Request::Control(Control::Speed(0.25))).await?;
        stage.browser.click("loop").await?;
        asks(stage, Request::Control(Control::Loop(true))).await?;
        ends_calmly(stage).await
    })
}

async fn ends_calmly(stage: &Stage<Script>) -> Result<()> {
    ensure!(!visible(&stage.browser, "ended").await?, "it has not ended yet");
    stage.behind.set(|snapshot| {
        *snapshot = Snapshot {
            link: LinkState::Ended("the recording is over".to_owned()),
            playing: recording(20.0, false),
            ..snapshot.clone()
        };
    });
    stage.browser.until("the end", |told| told.text("state") == "finished").await?;
    let said = stage.browser.run("return document.getElementById('state-text').textContent").await?;
    ensure!(said == "The recording has ended", "{said}");
    stage.browser.click("again").await?;
    asks(stage, Request::Control(Control::Seek(0.0))).await?;
    asks(stage, Request::Control(Control::Pause(false))).await
}

#[test]
fn a_paused_picture_stands_still_while_frames_come() -> Result<()> {
    in_front_of(Script::start, async |stage| {
        stage.browser.client.find(Locator::Css("body")).await?.send_keys("p").await?;
        let before = stage.browser.until("a pause", |told| told.text("frozen") == "true").await?;
        tokio::time::sleep(Duration::from_millis(300)).await;
        let after = stage.browser.told().await?;
        ensure!(after.number("updates") == before.number("updates"), "the picture goes on");
        ensure!(after.number("received") > before.number("received"), "no frames come");
        stage.browser.click("pause").await?;
        let updates = after.number("updates");
        stage.browser.until("the picture to go on", |told| told.number("updates") > updates).await?;
        Ok(())
    })
}

#[test]
fn shift_click_leaves_a_finger_down() -> Result<()> {
    in_front_of(Script::start, async |stage| {
        let click = |x: f64, y: f64, shift: bool| {
            format!(
                "const box = document.getElementById('image').getBoundingClientRect();
                const at = {{ clientX: box.left + box.width * (0.5 + {x} / 60), clientY: box.top + box.height * (0.5 - {y} / 60),
                  pointerId: 1, button: 0, shiftKey: {shift}, bubbles: true }};
                document.getElementById('plot').dispatchEvent(new PointerEvent('pointerdown', at));"
            )
        };
        let pressed = |request: Request| match request {
            Request::Control(Control::Press(contacts)) => contacts,
            _ => Vec::new(),
        };
        stage.browser.run(&click(10.0, 5.0, true)).await?;
        let one = pressed(stage.behind.request()?);
        ensure!(is_near(&one, &[[10.0, 5.0]]), "{one:?}");
        stage.browser.run(&click(-10.0, -5.0, true)).await?;
        let both = pressed(stage.behind.request()?);
        ensure!(is_near(&both, &[[10.0, 5.0], [-10.0, -5.0]]), "{both:?}");
        stage.browser.run(&click(10.0, 5.0, true)).await?;
        let other = pressed(stage.behind.request()?);
        ensure!(is_near(&other, &[[-10.0, -5.0]]), "{other:?}");
        Ok(())
    })
}

/// Whether the contacts are fingers within 0.5 mm of these places (mm).
fn is_near(contacts: &[Contact], places_mm: &[[f64; 2]]) -> bool {
    let near = |(contact, [x_mm, y_mm]): (&Contact, &[f64; 2])| {
        contact.conductance_s == FINGER.conductance_s
            && (contact.x_m * 1e3 - x_mm).hypot(contact.y_m * 1e3 - y_mm) < 0.5
    };
    contacts.len() == places_mm.len() && contacts.iter().zip(places_mm).all(near)
}

#[test]
fn picture_and_data_are_saved() -> Result<()> {
    in_front_of(Script::start, async |stage| {
        stage.behind.contacts(vec![FoundContact { id: Some(3), ..FoundContact::flat(0.01, -0.005, 2e-4) }]);
        for (key, ending) in [("s", ".png"), ("c", ".csv")] {
            stage.browser.client.find(Locator::Css("body")).await?.send_keys(key).await?;
            stage.browser.until(ending, |told| told.text("saved").ends_with(ending)).await?;
        }
        let script = "const done = arguments[0];
            const frame = { electrodes: 2, readings: [0, 0.5, 0.25, 0], sequence: 7, timeS: 1.5, residual: 1, certainty: null };
            const contact = { id: 3, place: [0.5, -0.25, 0], conductanceS: 0.125, apparentS: null, errorS: null, radiusM: null, forceN: 2,
              forceErrorN: 0.25, beyondMaximum: true, xErrorM: 0.5, yErrorM: 1, correlation: 0, depthM: null, areaM2: null };
            import('./save.js').then(({ csvOf }) => done(csvOf({ ...frame, contacts: [contact] }) + csvOf({ ...frame, contacts: [] })))";
        let csv = stage.browser.client.execute_async(script, Vec::new()).await?;
        let rows: Vec<Vec<_>> =
            csv.as_str().unwrap_or_default().lines().map(|line| line.split(',').collect()).collect();
        let [heads, touched, again, untouched] = &rows[..] else { bail!("{csv}") };
        // One table, whose columns are those of every output, but for the readings.
        let others = |head: &&&str| csv_heads().iter().all(|known| *known != **head);
        ensure!(heads.iter().filter(others).all(|head| head.starts_with("readings_v_")), "{csv}");
        ensure!(heads == again && rows.iter().all(|row| row.len() == heads.len()), "{csv}");
        ensure!(touched.join(",") == "7,1.5,1,,0,3,0.5,-0.25,0,0.125,,,2,0.25,true,0.5,1,0,,,,0,0.5,0.25,0", "{csv}");
        ensure!(untouched.join(",") == "7,1.5,1,,,,,,,,,,,,,,,,,,,0,0.5,0.25,0", "{csv}");
        Ok(())
    })
}
