//! A headless Chromium, driven through chromedriver.

use std::io::{BufRead, BufReader, Write};
use std::path::PathBuf;
use std::process::{Child, Command, Stdio};
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::{Duration, Instant};

use anyhow::{Context, Result, bail, ensure};
use fantoccini::actions::{InputSource, MouseActions, PointerAction};
use fantoccini::{Client, ClientBuilder, Locator};
use hyper_util::client::legacy::connect::HttpConnector;
use serde_json::{Value, json};
use tactomo::solve::Method;

const PATIENCE: Duration = Duration::from_secs(20);

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

/// A browser with one page.
pub struct Browser {
    pub client: Client,
    driver: Child,
    profile: PathBuf,
}

impl Browser {
    /// Opens `url` in a new browser with a new profile.
    pub async fn open(url: &str) -> Result<Self> {
        static PROFILES: AtomicU32 = AtomicU32::new(0);
        let number = PROFILES.fetch_add(1, Ordering::Relaxed);
        let profile = std::env::temp_dir().join(format!("tactomo-chromium-{}-{number}", std::process::id()));
        let (mut driver, port) = start_driver()?;
        match connect(port, &profile).await {
            Ok(client) => {
                let browser = Self { client, driver, profile };
                browser.client.goto(url).await?;
                browser.resize(1280, 800).await?;
                Ok(browser)
            }
            Err(error) => {
                driver.kill()?;
                Err(error)
            }
        }
    }

    /// Ends the browser.
    pub async fn close(mut self) -> Result<()> {
        let closed = self.client.close().await;
        self.driver.kill()?;
        self.driver.wait()?;
        // Chromium may still be writing there.
        let _ = std::fs::remove_dir_all(&self.profile);
        Ok(closed?)
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
            tokio::time::sleep(Duration::from_millis(50)).await;
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
        // The window has a border that the page does not; asked once, it is known.
        self.client.set_window_size(width, height).await?;
        let inner = self.client.execute("return [innerWidth, innerHeight]", Vec::new()).await?;
        let border = |axis: usize, wanted: u32| Some(wanted.saturating_sub(u32::try_from(inner[axis].as_u64()?).ok()?));
        let [across, down] = [border(0, width), border(1, height)].map(Option::unwrap_or_default);
        Ok(self.client.set_window_size(width + across, height + down).await?)
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
        "force-device-scale-factor=2",
        "hide-scrollbars",
    ]
    .map(|name| format!("--{name}"))
    .to_vec();
    arguments.push(format!("--user-data-dir={}", profile.display()));
    let capabilities = json!({ "goog:chromeOptions": { "args": arguments } });
    let capabilities = capabilities.as_object().cloned().context("an object")?;
    let mut builder = ClientBuilder::new(HttpConnector::new());
    Ok(builder.capabilities(capabilities).connect(&format!("http://127.0.0.1:{port}")).await?)
}
