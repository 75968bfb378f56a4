//! What people need who do not see the page, or have no mouse.

use std::io::Write;

use anyhow::{Context, Result, bail, ensure};
use fantoccini::actions::{InputSource, KeyAction, KeyActions};
use fantoccini::key::Key;
use serde_json::Value;
use tactomo::solve::FoundContact;

use crate::chromium::Page;
use crate::script::Script;
use crate::stage::in_front_of;
use crate::states::STATES;

/// The check of accessibility, if the variable `TACTOMO_AXE` names its file (`axe.min.js` of the npm package axe-core), as `.ci/run tests` does.
pub fn axe() -> Result<Option<String>> {
    let Some(path) = std::env::var_os("TACTOMO_AXE") else {
        std::io::stderr().write_all(b"skipped: TACTOMO_AXE names no axe.min.js of axe-core\n")?;
        return Ok(None);
    };
    Ok(Some(std::fs::read_to_string(&path).with_context(|| path.display().to_string())?))
}

/// What axe-core finds, with the elements.
pub async fn findings(page: &Page, axe: &str) -> Result<Vec<String>> {
    page.run(&format!("{axe}; return 0")).await?;
    let script = "const done = arguments[0];
        axe.run(document, { resultTypes: ['violations'] }).then(({ violations }) => done(violations.map(({ id, help, nodes }) =>
          `${id}: ${help}: ${nodes.map(({ target, any }) => `${target} (${any[0]?.message ?? ''})`).slice(0, 6).join(', ')}`)), (error) => done([String(error)]))";
    let found = page.client.execute_async(script, Vec::new()).await?;
    let found = found.as_array().with_context(|| found.to_string())?;
    Ok(found.iter().map(|finding| finding.as_str().unwrap_or_default().to_owned()).collect())
}

#[test]
fn axe_finds_nothing_in_any_state() -> Result<()> {
    let Some(axe) = axe()? else { return Ok(()) };
    in_front_of(Script::start, async |stage| {
        let mut all = Vec::new();
        for state in &STATES {
            state.enter(&stage.behind, &stage.browser).await?;
            stage.browser.run("for (const card of document.querySelectorAll('details')) card.open = true").await?;
            for theme in ["light", "dark"] {
                // In the full picture the button for it is away.
                stage
                    .browser
                    .run(&format!(
                        "localStorage.setItem('theme', '{theme}'); document.documentElement.dataset.theme = '{theme}'"
                    ))
                    .await?;
                stage.behind.publish(3);
                tokio::time::sleep(std::time::Duration::from_millis(400)).await;
                for finding in findings(&stage.browser, &axe).await? {
                    all.push(format!("{}, {theme}: {finding}", state.name));
                }
            }
            state.leave(&stage.browser).await?;
        }
        ensure!(all.is_empty(), "{}", all.join("\n"));
        Ok(())
    })
}

/// Presses a key.
async fn press(page: &Page, key: Key) -> Result<()> {
    let (down, up) = (KeyAction::Down { value: key.into() }, KeyAction::Up { value: key.into() });
    Ok(page.client.perform_actions(KeyActions::new("keys".to_owned()).then(down).then(up)).await?)
}

/// Elements that the Tab key comes to, in their order, each with whether one sees that it is there.
async fn tabbed(page: &Page) -> Result<Vec<(String, bool)>> {
    let script = "const at = document.activeElement;
        const { outlineStyle, outlineWidth } = getComputedStyle(at);
        const name = at === document.body ? '' : at.id || at.closest('[id]').id + ' ' + at.tagName.toLowerCase();
        return [name, outlineStyle !== 'none' && parseFloat(outlineWidth) >= 2]";
    let mut all = Vec::new();
    for _ in 0..80 {
        press(page, Key::Tab).await?;
        let at = page.run(script).await?;
        let name = at[0].as_str().context("a name")?.to_owned();
        if name.is_empty() {
            return Ok(all);
        }
        all.push((name, at[1] == true));
    }
    bail!("the Tab key never comes to the end: {all:?}")
}

#[test]
fn every_control_is_reached_by_the_keyboard_and_seen_there() -> Result<()> {
    in_front_of(Script::start, async |stage| {
        for name in ["nothing", "notice", "recording", "calibrating", "calibrated"] {
            let state = STATES.iter().find(|state| state.name == name).context("the state")?;
            state.enter(&stage.behind, &stage.browser).await?;
            stage.behind.publish(3);
            tokio::time::sleep(std::time::Duration::from_millis(400)).await;
            stage.browser.run("document.activeElement.blur(); document.body.tabIndex = -1; document.body.focus(); document.body.removeAttribute('tabindex')").await?;
            let tabbed = tabbed(&stage.browser).await?;
            let script = "return [...document.querySelectorAll('button, select, input, summary, [tabindex=\"0\"]')]
                .filter((control) => control.checkVisibility() && !control.disabled).map((control) => control.id || control.closest('[id]').id + ' ' + control.tagName.toLowerCase())";
            let controls = stage.browser.run(script).await?;
            let controls: Vec<&str> =
                controls.as_array().context("controls")?.iter().filter_map(Value::as_str).collect();
            let reached: Vec<&str> = tabbed.iter().map(|(name, _)| name.as_str()).collect();
            // In the order in which they stand in the document: as they are read.
            ensure!(reached == controls, "{name}: Tab comes to {reached:?}, there are {controls:?}");
            let unseen: Vec<_> = tabbed.iter().filter(|(_, seen)| !seen).collect();
            ensure!(unseen.is_empty(), "{name}: nobody sees the focus at {unseen:?}");
        }
        Ok(())
    })
}

#[test]
fn a_screen_reader_is_told_what_touches_when_that_changes_and_not_with_every_frame() -> Result<()> {
    in_front_of(Script::start, async |stage| {
        let count = "window.said = 0; new MutationObserver(() => { window.said += 1 }).observe(document.getElementById('announced'),
            { childList: true, characterData: true, subtree: true }); return 0";
        stage.browser.run(count).await?;
        let press = |x_mm: f64| vec![FoundContact::flat(x_mm * 1e-3, 0.0, 2e-4)];
        stage.behind.contacts(press(0.0));
        stage.browser.says("announced", "1 contact").await?;
        // It moves: the same words, and none of them again.
        for step in 0..40 {
            stage.behind.contacts(press(0.2 * f64::from(step)));
            tokio::time::sleep(std::time::Duration::from_millis(50)).await;
        }
        let said = stage.browser.run("return window.said").await?;
        ensure!(said.as_u64() <= Some(2), "said {said} times in two seconds in which one contact moved");
        // What flickers is told once it stays.
        for step in 0..20 {
            stage.behind.contacts(if step % 2 == 0 { Vec::new() } else { press(0.0) });
            tokio::time::sleep(std::time::Duration::from_millis(80)).await;
        }
        stage.behind.contacts(Vec::new());
        stage.browser.says("announced", "Nothing touches").await?;
        let said = stage.browser.run("return window.said").await?;
        ensure!(said.as_u64() <= Some(6), "said {said} times");
        Ok(())
    })
}
