//! A headless Chromium, driven through chromedriver.

use std::io::{BufRead, BufReader, Write};
use std::path::PathBuf;
use std::process::{Child, Command, Stdio};
use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::{Arc, Mutex, PoisonError, Weak};
use std::time::{Duration, Instant};

use anyhow::{Context, Result, bail, ensure};
use fantoccini::actions::{InputSource, MouseActions, PointerAction};
use fantoccini::{Client, ClientBuilder, Locator};
use hyper_util::client::legacy::connect::HttpConnector;
use serde_json::{Value, json};
use tactomo::solve::Method;
use tokio::runtime::Runtime;

/// How long the page is waited for, and time from one look at it to the next.
const PATIENCE: Duration = Duration::from_secs(20);
const LOOK_EVERY: Duration = Duration::from_millis(20);

/// Whether Chromium is here; if not, says what to install, and fails if nothing may be skipped.
pub fn is_here() -> Result<bool> {
    let runs = |name: &str| Command::new(name).arg("--version").output().is_ok_and(|output| output.status.success());
    let missing: Vec<&str> = ["chromium", "chromedriver"].into_iter().filter(|name| !runs(name)).collect();
    if missing.is_empty() {
        return Ok(true);
    }
    let line = format!("skipped, no {}: install Debian's chromium and chromium-driver\n", missing.join(" and no "));
    ensure!(std::env::var_os("TACTOMO_SKIP_NOTHING").is_none(), line);
    // Not by a macro: the test harness would hide it.
    std::io::stderr().write_all(line.as_bytes())?;
    Ok(false)
}

/// A browser with one window, and what its connection lives in.
pub struct Chromium {
    runtime: Runtime,
    client: Client,
    driver: Child,
    profile: PathBuf,
}

impl Chromium {
    /// The browser that tests share: it starts with the first that holds it, and ends with the last.
    pub fn shared() -> Result<Arc<Self>> {
        static RUNNING: Mutex<Weak<Chromium>> = Mutex::new(Weak::new());
        let mut running = RUNNING.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(chromium) = running.upgrade() {
            return Ok(chromium);
        }
        let chromium = Arc::new(Self::start()?);
        *running = Arc::downgrade(&chromium);
        Ok(chromium)
    }

    /// A browser of its own, with a new profile.
    pub fn start() -> Result<Self> {
        static PROFILES: AtomicU32 = AtomicU32::new(0);
        let number = PROFILES.fetch_add(1, Ordering::Relaxed);
        let profile = std::env::temp_dir().join(format!("tactomo-chromium-{}-{number}", std::process::id()));
        let runtime = tokio::runtime::Builder::new_multi_thread().worker_threads(2).enable_all().build()?;
        let (mut driver, port) = start_driver()?;
        match runtime.block_on(connect(port, &profile)) {
            Ok(client) => Ok(Self { runtime, client, driver, profile }),
            Err(error) => {
                driver.kill()?;
                Err(error)
            }
        }
    }

    /// Runs a test in the runtime of the connection.
    pub fn block_on<T>(&self, test: impl Future<Output = T>) -> T {
        self.runtime.block_on(test)
    }

    /// Opens `url` in the window, which is then of the usual size.
    pub async fn open(&self, url: &str) -> Result<Page> {
        let page = Page { client: self.client.clone() };
        page.client.goto(url).await?;
        page.resize(1280, 800).await?;
        Ok(page)
    }
}

impl Drop for Chromium {
    fn drop(&mut self) {
        // Whatever fails here, the test has said what it has to say; and Chromium may still be writing into its profile.
        let _ = self.runtime.block_on(self.client.clone().close());
        let _ = self.driver.kill().and_then(|()| self.driver.wait());
        let _ = std::fs::remove_dir_all(&self.profile);
    }
}

/// The page in a browser's window.
pub struct Page {
    pub client: Client,
}

impl Page {
    /// Leaves it as if it had never been there.
    pub async fn leave(&self) -> Result<()> {
        self.client.release_actions().await?;
        self.run("localStorage.clear()").await?;
        Ok(self.client.goto("about:blank").await?)
    }

    /// Waits until what a script in the page returns is what is wanted.
    pub async fn shows(&self, script: &str, wanted: impl Fn(&Value) -> bool) -> Result<Value> {
        let begin = Instant::now();
        loop {
            let shown = self.run(script).await?;
            if wanted(&shown) {
                return Ok(shown);
            }
            ensure!(begin.elapsed() < PATIENCE, "the page never shows what it should, but {shown}");
            tokio::time::sleep(LOOK_EVERY).await;
        }
    }

    /// Waits until the element of this id shows this text.
    pub async fn says(&self, id: &str, text: &str) -> Result<()> {
        let script = format!("return document.getElementById('{id}').textContent");
        self.shows(&script, |shown| shown == text).await.with_context(|| format!("{text:?} in {id}")).map(drop)
    }

    /// What the page tells through its root's `data-` attributes.
    pub async fn told(&self) -> Result<Told> {
        let script =
            "return {...document.documentElement.dataset, label: document.getElementById('rezero').textContent}";
        Ok(Told(self.client.execute(script, Vec::new()).await?))
    }

    /// Waits until the page tells what is wanted.
    pub async fn until(&self, what: &str, wanted: impl Fn(&Told) -> bool) -> Result<Told> {
        let begin = Instant::now();
        loop {
            let told = self.told().await?;
            if wanted(&told) {
                return Ok(told);
            }
            if begin.elapsed() > PATIENCE {
                bail!("the page never tells of {what}; it tells {}", told.0);
            }
            tokio::time::sleep(LOOK_EVERY).await;
        }
    }

    /// Puts the mouse's button down at a place of a detector of 60 x 60 mm (mm).
    pub async fn press(&self, [x_mm, y_mm]: [f64; 2]) -> Result<()> {
        let script = "const box = document.getElementById('image').getBoundingClientRect();
            return [box.left + box.width * (0.5 + arguments[0] / 60), box.top + box.height * (0.5 - arguments[1] / 60)]";
        let place = self.client.execute(script, vec![json!(x_mm), json!(y_mm)]).await?;
        let at = |axis: usize| place[axis].as_f64().map(f64::round).context("a place on the screen");
        let mouse = MouseActions::new("mouse".to_owned())
            .then(PointerAction::MoveTo { duration: None, x: at(0)?, y: at(1)? })
            .then(PointerAction::Down { button: fantoccini::actions::MOUSE_BUTTON_LEFT });
        Ok(self.client.perform_actions(mouse).await?)
    }

    /// Chooses a solver, as a person does in the list.
    pub async fn choose(&self, method: Method) -> Result<()> {
        self.select("method", method.name()).await
    }

    /// Lets go of the mouse's button.
    pub async fn release(&self) -> Result<()> {
        let mouse = MouseActions::new("mouse".to_owned())
            .then(PointerAction::Up { button: fantoccini::actions::MOUSE_BUTTON_LEFT });
        Ok(self.client.perform_actions(mouse).await?)
    }

    /// What a script in the page returns.
    pub async fn run(&self, script: &str) -> Result<Value> {
        Ok(self.client.execute(script, Vec::new()).await?)
    }

    /// Clicks on the element of this id.
    pub async fn click(&self, id: &str) -> Result<()> {
        Ok(self.client.find(Locator::Id(id)).await?.click().await?)
    }

    /// Chooses a value of the list of this id.
    pub async fn select(&self, id: &str, value: &str) -> Result<()> {
        Ok(self.client.find(Locator::Id(id)).await?.select_by_value(value).await?)
    }

    /// Shows the page `light` or `dark`.
    pub async fn theme(&self, name: &str) -> Result<()> {
        if self.told().await?.text("theme") == name { Ok(()) } else { self.click("theme").await }
    }

    /// Makes the page this large (CSS pixels).
    pub async fn resize(&self, width: u32, height: u32) -> Result<()> {
        // The window has a border that the page does not, and the page hears of a new size a moment later.
        let script = "return [innerWidth, innerHeight, outerWidth - innerWidth, outerHeight - innerHeight]";
        let begin = Instant::now();
        loop {
            let size = self.run(script).await?;
            let [inner_width, inner_height, across, down] = [0, 1, 2, 3]
                .map(|i| size[i].as_u64().and_then(|pixels| u32::try_from(pixels).ok()).unwrap_or_default());
            if [inner_width, inner_height] == [width, height] {
                return Ok(());
            }
            ensure!(begin.elapsed() < PATIENCE, "the page never is {width} x {height}, but {size}");
            self.client.set_window_size(width + across, height + down).await?;
            tokio::time::sleep(LOOK_EVERY).await;
        }
    }
}

/// What a page tells.
#[derive(Debug)]
pub struct Told(Value);

impl Told {
    /// A number; not a number if it is not told.
    pub fn number(&self, name: &str) -> f64 {
        self.0[name].as_str().and_then(|text| text.parse().ok()).unwrap_or(f64::NAN)
    }

    /// A text; empty if it is not told.
    pub fn text(&self, name: &str) -> &str {
        self.0[name].as_str().unwrap_or_default()
    }

    /// Places of the contacts (mm).
    pub fn places_mm(&self) -> Vec<[f64; 2]> {
        serde_json::from_str(self.text("placesMm")).unwrap_or_default()
    }

    /// Whether there is one contact, and that within `tolerance_mm` of a place (mm).
    pub fn is_pressed_at(&self, [x_mm, y_mm]: [f64; 2], tolerance_mm: f64) -> bool {
        matches!(self.places_mm()[..], [[x, y]] if (x - x_mm).hypot(y - y_mm) < tolerance_mm)
    }
}

fn start_driver() -> Result<(Child, u16)> {
    let mut driver = Command::new("chromedriver").arg("--port=0").stdout(Stdio::piped()).spawn()?;
    let stdout = driver.stdout.take().context("chromedriver's output")?;
    for line in BufReader::new(stdout).lines() {
        if let Some((_, port)) = line?.split_once("successfully on port ") {
            return Ok((driver, port.trim_end_matches('.').parse()?));
        }
    }
    bail!("chromedriver ended without a port")
}

async fn connect(port: u16, profile: &std::path::Path) -> Result<Client> {
    let mut arguments: Vec<String> = [
        "headless",
        "no-sandbox",
        "disable-gpu",
        "disable-quic",
        "no-first-run",
        "disable-background-networking",
        "disable-component-update",
        "disable-sync",
        "hide-scrollbars",
    ]
    .map(|name| format!("--{name}"))
    .to_vec();
    arguments.push(format!("--user-data-dir={}", profile.display()));
    // Pictures are as sharp as a good screen; a fourth of the pixels is enough to test by, and there is no graphics card to draw them.
    let pictures = std::env::var_os("TACTOMO_SCREENSHOT").is_some();
    arguments.push(format!("--force-device-scale-factor={}", if pictures { 2 } else { 1 }));
    let capabilities = json!({ "goog:chromeOptions": { "args": arguments } });
    let capabilities = capabilities.as_object().cloned().context("an object")?;
    let mut builder = ClientBuilder::new(HttpConnector::new());
    Ok(builder.capabilities(capabilities).connect(&format!("http://127.0.0.1:{port}")).await?)
}
