//! The page of several detectors in a browser.

use std::cell::RefCell;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, sync_channel};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;

use anyhow::{Context, Result, ensure};
use serde_json::json;
use tactomo::detector::Detector;
use tactomo::readings::Readings;
use tactomo::run::{LinkState, Request, Snapshot};
use tactomo::sink::page::{Listen, PageSetup, Server, Shown};
use tactomo::sink::place::Place;
use tactomo::solve::{FoundContact, Solution};
use tokio::sync::watch;

use crate::access::{axe, findings};
use crate::script::{answer, grid, publish};
use crate::stage::{Behind, opened};

/// A page of detectors that are alike: one contact on the first, on the second two, and so on.
struct Several {
    server: Server,
    snapshots: Vec<Arc<Mutex<Snapshot>>>,
    requests: Vec<Receiver<Request>>,
    stop: Arc<AtomicBool>,
    publishers: Vec<JoinHandle<()>>,
}

impl Several {
    fn start(names: &[&str]) -> Result<Self> {
        Self::at(0, names, |_| None)
    }

    /// On a body, side by side along x, each turned a little more about y.
    fn on_a_body(names: &[&str]) -> Result<Self> {
        Self::at(0, names, |k| Some(Place { xyz_m: [0.08 * k, 0.0, 0.0], rpy_rad: [0.0, 0.3 * k, 0.0] }))
    }

    fn at(port: u16, names: &[&str], place: impl Fn(f64) -> Option<Place>) -> Result<Self> {
        let detector = Detector::preset(Detector::DEFAULT).context("the default preset")?;
        let stop = Arc::<AtomicBool>::default();
        let (mut shown, mut snapshots, mut publishers) = (Vec::new(), Vec::new(), Vec::new());
        let mut asked = Vec::new();
        for (name, count) in names.iter().zip(1..) {
            let (sender, receiver) = watch::channel(Arc::default());
            let setup = PageSetup {
                mesh: grid(&detector),
                detector: detector.clone(),
                usual_radius_m: 0.0025,
                source: "a scripted board".to_owned(),
                finger: None,
            };
            let (requests, asked_of_it) = sync_channel(4);
            asked.push(asked_of_it);
            shown.push(Shown {
                name: (*name).to_owned(),
                place: place(f64::from(count)),
                setup,
                snapshots: receiver,
                requests,
            });
            let contacts = (0..count).map(|k| FoundContact::flat(0.008 * f64::from(k) - 0.01, 0.005, 1e-3)).collect();
            let solution = Solution { contacts, ..Solution::default() };
            let touch = answer(0, Readings::from_fn(16, |_, _| 0.0), solution);
            let snapshot =
                Snapshot { link: LinkState::Streaming, answer: Some(Arc::new(touch)), ..Snapshot::default() };
            let snapshot = Arc::new(Mutex::new(snapshot));
            publishers.push(publish(sender, Arc::clone(&snapshot), Arc::<AtomicU64>::default(), Arc::clone(&stop)));
            snapshots.push(snapshot);
        }
        let server = Server::start(Listen { port: Some(port), ..Listen::default() }, shown)?;
        Ok(Self { server, snapshots, requests: asked, stop, publishers })
    }
}

impl Behind for Several {
    fn url(&self) -> String {
        self.server.url()
    }
}

impl Drop for Several {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        for publisher in self.publishers.drain(..) {
            // A panic in it has been reported.
            let _ = publisher.join();
        }
    }
}

/// What the tiles say, each with its name and where it leads.
const TILES: &str = "return [...document.querySelectorAll('a.tile')].map((tile) => [tile.querySelector('strong').textContent, \
    tile.querySelector('.muted').textContent, tile.getAttribute('href')])";

#[test]
fn a_tile_tells_of_its_own_detector_and_opens_its_page() -> Result<()> {
    opened(
        || Several::start(&["thumb", "index"]),
        async |stage| {
            let tiles = json!([["thumb", "1 contact", "thumb/"], ["index", "2 contacts", "index/"]]);
            stage.browser.shows(TILES, |told| *told == tiles).await?;
            let text = "return document.getElementById('state-text').textContent";
            stage.browser.shows(text, |told| told == "2 detectors live, 2 touched").await?;
            // Each is drawn: no canvas is empty.
            let drawn =
                "return [...document.querySelectorAll('a.tile canvas')].every((canvas) => canvas.getContext('2d')
                .getImageData(0, 0, canvas.width, canvas.height).data.some((value) => value > 0))";
            stage.browser.shows(drawn, |told| *told == true).await?;
            // One that is lost says so, and the other goes on.
            stage.behind.snapshots[0].lock().expect("no test panics with it").link =
                LinkState::Lost("unplugged".to_owned());
            stage.browser.shows(text, |told| told == "1 of 2 detectors live, 1 touched").await?;
            stage.browser.run("document.querySelector('a.tile:last-child').click()").await?;
            stage
                .browser
                .shows("return document.title", |title| title.as_str().is_some_and(|t| t.contains("index")))
                .await?;
            stage.browser.until("two contacts", |told| told.places_mm().len() == 2).await?;
            Ok(())
        },
    )
}

#[test]
fn all_together_have_a_total_a_chart_a_scale_and_are_recorded_at_once() -> Result<()> {
    opened(
        || Several::start(&["thumb", "index"]),
        async |stage| {
            let text = |id: &str| format!("return document.getElementById('{id}').textContent");
            stage.browser.shows(&text("touched"), |told| told == "2 of 2").await?;
            // Three contacts of a millisiemens each.
            stage.browser.shows(&text("total"), |told| told == "3.00\u{2009}mS").await?;
            let values = "return JSON.parse(document.getElementById('strip').dataset.values ?? '{}')";
            let near =
                |value: &serde_json::Value, expected: f64| value.as_f64().is_some_and(|s| (s - expected).abs() < 1e-6);
            stage.browser.shows(values, |told| near(&told["1"], 1e-3) && near(&told["2"], 2e-3)).await?;
            let colours = "const canvas = document.getElementById('colours');
                const { data } = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height);
                return new Set(new Uint32Array(data.buffer)).size";
            stage.browser.shows(colours, |told| told.as_i64().is_some_and(|colours| colours > 50)).await?;
            stage.browser.click("record").await?;
            for asked in &stage.behind.requests {
                assert_eq!(asked.recv_timeout(std::time::Duration::from_secs(10))?, Request::Record(true));
            }
            for snapshot in &stage.behind.snapshots {
                snapshot.lock().expect("no test panics with it").recording = Some("touch.tactomo".into());
            }
            stage.browser.shows(&text("record"), |told| told == "Stop").await?;
            stage.browser.click("record").await?;
            for asked in &stage.behind.requests {
                assert_eq!(asked.recv_timeout(std::time::Duration::from_secs(10))?, Request::Record(false));
            }
            Ok(())
        },
    )
}

#[test]
fn the_body_is_shown_where_there_are_places_alone() -> Result<()> {
    let is_hidden = "return document.getElementById('body').hidden";
    opened(
        || Several::start(&["thumb", "index"]),
        async |stage| {
            stage.browser.shows(TILES, |told| told.as_array().is_some_and(|tiles| tiles.len() == 2)).await?;
            stage.browser.shows(is_hidden, |told| *told == true).await?;
            Ok(())
        },
    )?;
    opened(
        || Several::on_a_body(&["thumb", "index"]),
        async |stage| {
            stage.browser.shows(is_hidden, |told| *told == false).await?;
            // Two contacts, and one of the other, are seen in colours of their own.
            stage.browser.shows(BODY, |told| told.as_i64().is_some_and(|colours| colours > 20)).await?;
            stage.behind.snapshots[1].lock().expect("no test panics with it").link =
                LinkState::Absent("no port".to_owned());
            let names = "return [...document.querySelectorAll('#body-names a')].map((name) => [name.textContent, name.className])";
            let told_names = json!([["index", "stale"], ["thumb", "touched"]]);
            stage.browser.shows(names, |told| *told == told_names).await?;
            let tile = json!(["index", "Waiting for the board: no port", "index/"]);
            stage.browser.shows(TILES, |told| told[1] == tile).await?;
            Ok(())
        },
    )
}

/// How many colours the body is drawn in.
const BODY: &str = "const canvas = document.getElementById('body-space');
    const { data } = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height);
    return new Set(new Uint32Array(data.buffer)).size";
/// Presses the mouse at the leftmost pixel of the body, or moves it by so many pixels from there if that is not 0, and lets go.
const MOUSE: &str = "const canvas = document.getElementById('body-space'), plot = document.getElementById('body-plot');
    const { data, width } = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height);
    const box = plot.getBoundingClientRect(), ratio = box.width / width;
    let found = [Infinity, 0];
    for (let i = 3; i < data.length; i += 4) {
        const pixel = (i - 3) / 4;
        if (data[i] > 0 && pixel % width < found[0]) found = [pixel % width, Math.floor(pixel / width)];
    }
    const [x, y] = [box.left + (found[0] + 2) * ratio, box.top + (found[1] + 0.5) * ratio];
    const send = (kind, by) => plot.dispatchEvent(new PointerEvent(kind, { clientX: x + by, clientY: y, pointerId: 1, buttons: 1, bubbles: true }));
    plot.setPointerCapture = () => {};
    send('pointerdown', 0);
    if (BY) send('pointermove', BY);
    send('pointerup', BY);
    send('click', BY);
    return true";

#[test]
fn the_body_is_turned_by_mouse_and_keyboard_and_a_click_opens_a_detector() -> Result<()> {
    opened(
        || Several::on_a_body(&["thumb", "index"]),
        async |stage| {
            stage.browser.shows(BODY, |told| told.as_i64().is_some_and(|colours| colours > 20)).await?;
            let looks = "return [...document.querySelectorAll('#body-names a')].map((name) => name.style.transform)";
            // Once the page has found its size.
            let last = RefCell::default();
            let mut before = stage.browser.shows(looks, |told| last.replace(told.clone()) == *told).await?;
            let key = |key: &str| {
                format!(
                    "const plot = document.getElementById('body-plot');
                    plot.focus();
                    document.activeElement.dispatchEvent(new KeyboardEvent('keydown', {{ key: '{key}', bubbles: true }}))"
                )
            };
            for turn in [key("ArrowLeft"), key("ArrowUp"), key("+"), MOUSE.replace("BY", "40")] {
                stage.browser.run(&turn).await?;
                stage.browser.shows(looks, |told| *told != before).await?;
                before = stage.browser.run(looks).await?;
            }
            // Back to the same look from any other; by now the page has found its size.
            stage.browser.run(&key("0")).await?;
            let first = stage.browser.shows(looks, |told| *told != before).await?;
            stage.browser.run(&key("ArrowRight")).await?;
            stage.browser.shows(looks, |told| *told != first).await?;
            stage.browser.run(&key("0")).await?;
            stage.browser.shows(looks, |told| *told == first).await?;
            stage.browser.run(&MOUSE.replace("BY", "0")).await?;
            let is_thumb = |title: &serde_json::Value| title.as_str().is_some_and(|title| title.contains("thumb"));
            stage.browser.shows("return document.title", is_thumb).await?;
            Ok(())
        },
    )
}

#[test]
fn axe_finds_nothing_on_the_tiles_and_the_body() -> Result<()> {
    let Some(axe) = axe()? else { return Ok(()) };
    opened(
        || Several::on_a_body(&["thumb", "index", "middle"]),
        async |stage| {
            stage.browser.shows(TILES, |told| told.as_array().is_some_and(|tiles| tiles.len() == 3)).await?;
            stage.browser.shows(BODY, |told| told.as_i64().is_some_and(|colours| colours > 20)).await?;
            let mut all = Vec::new();
            for theme in ["light", "dark"] {
                stage.browser.run(&format!("document.documentElement.dataset.theme = '{theme}'")).await?;
                for finding in findings(&stage.browser, &axe).await? {
                    all.push(format!("{theme}: {finding}"));
                }
            }
            ensure!(all.is_empty(), "{}", all.join("\n"));
            Ok(())
        },
    )
}

#[test]
fn tiles_are_those_of_whichever_program_has_the_address() -> Result<()> {
    opened(
        || Ok(SeveralThenOthers(Mutex::new(Some(Several::start(&["thumb", "index"])?)))),
        async |stage| {
            stage.browser.shows(TILES, |told| told.as_array().is_some_and(|tiles| tiles.len() == 2)).await?;
            let port = {
                let mut first = stage.behind.0.lock().expect("no test panics with it");
                first.take().context("the first program")?.server.port()
            };
            let _others = Several::at(port, &["palm", "wrist"], |_| None)?;
            let tiles = json!([["palm", "1 contact", "palm/"], ["wrist", "2 contacts", "wrist/"]]);
            stage.browser.shows(TILES, |told| *told == tiles).await?;
            Ok(())
        },
    )
}

/// A program that ends.
struct SeveralThenOthers(Mutex<Option<Several>>);

impl Behind for SeveralThenOthers {
    fn url(&self) -> String {
        let first = self.0.lock().expect("no test panics with it");
        first.as_ref().map(Behind::url).unwrap_or_default()
    }
}
