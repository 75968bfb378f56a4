//! The page keeps still: nothing changes its place because of what is measured, and what is said changes no faster than it can be read.

use std::sync::Arc;
use std::time::Duration;

use anyhow::{Context, Result, ensure};
use serde_json::{Map, Value, json};
use tactomo::run::Beneath;
use tactomo::solve::{Flags, FoundContact, Solution};

use crate::chromium::Page;
use crate::script::Script;
use crate::stage::{Stage, in_front_of};
use crate::states::STATES;

/// Controls and headings that are seen, each with its place and its size (CSS pixels). What a person has opened beside them is none of them.
const BOXES: &str = "const all = [...document.querySelectorAll('button, select, input, summary, label, h1, h2, th, dt, #choice, #sure, #plot, #image')];
    const seen = all.filter((e) => e.getClientRects().length && !e.closest('#calibrate-card, #notice, dialog, tbody, #figures'));
    return Object.fromEntries(seen.map((e) => [`${e.tagName} ${e.id || e.closest('[id]')?.id} ${all.indexOf(e)}`,
      (({ left, top, width, height }) => [left, top, width, height].map(Math.round))(e.getBoundingClientRect())]));";

/// Elements whose words do not fit into them.
const CUT: &str = "return ['choice', 'sure', 'total', 'centre', 'record', 'mark', 'rezero', 'calibrate', 'strength', ...[...document.querySelectorAll('#contacts td')]]
    .map((of) => of.id === undefined ? document.getElementById(of) : of)
    .filter((e) => e.getClientRects().length && (e.scrollWidth > e.clientWidth + 1 || (e.id === 'sure' && e.scrollHeight > e.clientHeight + 1)))
    .map((e) => `${e.id} ${e.textContent}`)";

fn contact(id: u32, [x_mm, y_mm]: [f64; 2], conductance_s: f64) -> FoundContact {
    FoundContact { id: Some(id), ..FoundContact::flat(x_mm * 1e-3, y_mm * 1e-3, conductance_s) }
}

/// What is told where nothing was found.
const BENEATH: Beneath = Beneath { floor_v: 0.142, is_pressed: false };

/// A state of the page: its name, and what brings it about.
type State = (&'static str, fn(&Script));

/// What [`STATES`] do not have: what is told, after a page on which nothing touches.
const MORE: [State; 7] = [
    ("negative", |script| script.contacts(vec![contact(1, [-25.4, -16.1], 9.99e-4)])),
    ("eleven", |script| {
        script.contacts((1..=11).map(|k| contact(k, [5.0 * f64::from(k) - 30.0, 3.0 * f64::from(k)], 1e-4)).collect());
    }),
    ("forces", |script| {
        let pressed = |id, force_n| FoundContact {
            force_n: Some(force_n),
            force_deviation_n: Some(0.0612),
            ..contact(id, [-12.5, 10.0 * f64::from(id)], 3e-4)
        };
        script.contacts(vec![pressed(1, 0.734), pressed(2, 7.5)]);
    }),
    ("warnings", |script| {
        let flags =
            Flags { misfit: true, calibrate: true, saturated: true, excluded: vec![1, 3, 12], ..Flags::default() };
        script.solution(Solution { contacts: vec![contact(1, [5.0, 5.0], 3e-4)], flags, ..Solution::default() });
    }),
    ("beneath", |script| {
        script.set(|snapshot| {
            if let Some(answer) = &mut snapshot.answer {
                Arc::make_mut(answer).beneath = Some(BENEATH);
            }
        });
    }),
    ("recorded", |script| {
        script.set(|snapshot| {
            (snapshot.recording, snapshot.marks) = (Some("/a/long/way/to/touch-2026-11-28.tactomo".into()), 12);
        });
    }),
    ("noticed", |script| {
        let notice = "Something pressed at the start (up to 1222 mV) and is shown as touch. Zero is taken once it lifts; if nothing is there, re-zero.";
        script.set(|snapshot| snapshot.baseline = Some(notice.to_owned()));
    }),
];

/// Looks at a state until nothing is cut off, and checks that everything is where it was.
async fn is_still(page: &Page, before: &Value) -> Result<()> {
    let moved = |shown: &Value| {
        let [before, now] = [before, shown].map(|boxes| boxes.as_object().cloned().unwrap_or_default());
        let is_moved = |(name, at): (&String, &Value)| now.get(name) != Some(at);
        before
            .iter()
            .filter(|(name, at)| is_moved((name, at)))
            .map(|(name, at)| (name.clone(), json!([at, now.get(name)])))
            .collect::<Map<_, _>>()
    };
    let shown = page.run(BOXES).await?;
    ensure!(moved(&shown).is_empty(), "moved from and to: {}", Value::Object(moved(&shown)));
    let cut = page.run(CUT).await?;
    ensure!(cut == json!([]), "cut off: {cut}");
    Ok(())
}

#[test]
fn nothing_changes_its_place_with_what_is_measured() -> Result<()> {
    in_front_of(Script::start, async |stage| {
        let Stage { behind, browser } = stage;
        let nothing = STATES.iter().find(|state| state.name == "nothing").context("the state")?;
        let measured = ["one", "several", "line", "ring", "uncertain", "looking", "electrode", "notice"];
        for (theme, [width, height]) in
            [("light", [360, 740]), ("dark", [768, 1024]), ("light", [1440, 900]), ("dark", [844, 390])]
        {
            browser.resize(width, height).await?;
            nothing.enter(behind, browser).await?;
            browser.theme(theme).await?;
            browser.says("choice", "Nothing touches").await?;
            tokio::time::sleep(Duration::from_millis(700)).await;
            let before = browser.run(BOXES).await?;
            ensure!(before.as_object().is_some_and(|boxes| boxes.len() > 30), "{before}");
            let ones = STATES.iter().filter(|state| measured.contains(&state.name));
            for state in ones {
                state.enter(behind, browser).await?;
                browser.theme(theme).await?;
                tokio::time::sleep(Duration::from_millis(500)).await;
                is_still(browser, &before).await.with_context(|| format!("{} at {width} x {height}", state.name))?;
            }
            for (name, tell) in MORE {
                nothing.enter(behind, browser).await?;
                browser.theme(theme).await?;
                tell(behind);
                tokio::time::sleep(Duration::from_millis(500)).await;
                is_still(browser, &before).await.with_context(|| format!("{name} at {width} x {height}"))?;
            }
        }
        Ok(())
    })
}

#[test]
fn calibrating_leaves_the_picture_and_its_buttons_where_they_are() -> Result<()> {
    // Cards that it does not need make room.
    let boxes =
        BOXES.replace("#figures'", "#figures, #answer, #strip-card, #vibration-card, #readings-card, #details-card'");
    in_front_of(Script::start, async |stage| {
        for [width, height] in [[360, 740], [768, 1024], [1440, 900]] {
            stage.browser.resize(width, height).await?;
            let [nothing, calibrating] =
                ["nothing", "calibrating"].map(|name| STATES.iter().find(|state| state.name == name));
            nothing.context("the state")?.enter(&stage.behind, &stage.browser).await?;
            tokio::time::sleep(Duration::from_millis(700)).await;
            let before = stage.browser.run(&boxes).await?;
            calibrating.context("the state")?.enter(&stage.behind, &stage.browser).await?;
            stage.browser.until("calibrating", |told| told.text("calibrating") == "rubbing").await?;
            tokio::time::sleep(Duration::from_millis(300)).await;
            let after = stage.browser.run(&boxes).await?;
            ensure!(before == after, "{width} x {height}: {after} instead of {before}");
        }
        Ok(())
    })
}

/// What is told of updates that come every 7 ms of a clock that a test makes up, each of which says something else than the one before.
const TOLD: &str = "const done = arguments[0];
    import('./told.js').then(({ Told }) => {
      const told = new Told(), times = [], drawn = [];
      for (let now = 0; now < 3000; now += 7) {
        const contacts = Array.from({ length: 1 + (now / 7) % 3 }, (_, i) => ({ id: i + 1, apparentS: 1e-4, forceN: null }));
        const update = { contacts, shape: null, image: [], flags: [], excluded: [], exchanged: [], choice: null, otherContacts: null, total: null };
        const turn = told.take(update, now);
        if (turn === 'told') times.push(now);
        if (turn !== 'held') drawn.push([contacts.length, told.update.contacts.length]);
      }
      done([times, drawn]);
    })";

#[test]
fn what_is_said_stays_for_a_fifth_of_a_second_and_the_picture_shows_no_other_answer() -> Result<()> {
    in_front_of(Script::start, async |stage| {
        let shown = stage.browser.client.execute_async(TOLD, Vec::new()).await?;
        let times: Vec<f64> = serde_json::from_value(shown[0].clone())?;
        ensure!(times.len() > 12 && times.windows(2).all(|pair| pair[1] - pair[0] >= 200.0), "{times:?}");
        let drawn: Vec<[u64; 2]> = serde_json::from_value(shown[1].clone())?;
        ensure!(drawn.len() > 2 * times.len() && drawn.iter().all(|[picture, told]| picture == told), "{drawn:?}");
        Ok(())
    })
}

/// Numbers about a thousand microsiemens, every 100 ms of a clock that a test makes up.
const UNITS: &str = "const done = arguments[0];
    import('./units.js').then(({ HeldPrefix, withPrefix }) => {
      const held = new HeldPrefix();
      const values = [9.4e-4, 1.02e-3, ...Array.from({ length: 8 }, (_, i) => (i % 2 ? 1.01e-3 : 9.9e-4)), ...Array(12).fill(9.5e-4)];
      done(values.map((value, i) => withPrefix(value, 'S', 3, held.of(value, 100 * i)).slice(-2)));
    })";

#[test]
fn a_number_that_goes_about_a_thousand_keeps_its_unit_for_a_second() -> Result<()> {
    in_front_of(Script::start, async |stage| {
        let shown = stage.browser.client.execute_async(UNITS, Vec::new()).await?;
        let mut expected = vec!["µS"];
        // The last value above a thousand is the tenth; ten later a second is over.
        expected.extend([["mS"; 18].as_slice(), ["µS"; 3].as_slice()].concat());
        ensure!(shown == json!(expected), "{shown}");
        Ok(())
    })
}

#[test]
fn nobody_is_said_to_be_sure_of_what_the_readings_do_not_fit() -> Result<()> {
    in_front_of(Script::start, async |stage| {
        let both =
            "return [document.getElementById('sure').textContent, document.getElementById('warnings').textContent]";
        let answer = |misfit| Solution {
            contacts: vec![contact(1, [5.0, 5.0], 3e-4)],
            certainty: Some(1.0),
            flags: Flags { misfit, ..Flags::default() },
            ..Solution::default()
        };
        stage.behind.solution(answer(false));
        stage.browser.shows(both, |told| told[0] == "sure of the number (> 99 %)" && told[1] == "").await?;
        for misfit in [true, false].into_iter().cycle().take(12) {
            stage.behind.solution(answer(misfit));
            stage.behind.publish(4);
            let told = stage.browser.run(both).await?;
            let [sure, fits] = [told[0].as_str().unwrap_or_default().starts_with("sure"), told[1] == ""];
            ensure!(sure == fits, "{told}");
        }
        Ok(())
    })
}

#[test]
fn where_a_board_reads_nothing_lighter_the_page_says_so() -> Result<()> {
    in_front_of(Script::start, async |stage| {
        let lightly = "pressed more lightly than this board can read (0.14 V)";
        for (is_pressed, headline, said) in
            [(false, "Nothing touches", format!("or {lightly}")), (true, "Something touches", lightly.to_owned())]
        {
            stage.behind.set(|snapshot| {
                if let Some(answer) = &mut snapshot.answer {
                    Arc::make_mut(answer).beneath = Some(Beneath { is_pressed, ..BENEATH });
                }
            });
            stage.browser.says("choice", headline).await?;
            stage.browser.says("sure", &said).await?;
            stage.browser.says("no-contacts", &format!("{headline}.")).await?;
        }
        Ok(())
    })
}
