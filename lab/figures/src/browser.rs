//! Pictures by a headless Chromium, driven through chromedriver.

use std::fs;
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use anyhow::{Context, Result, bail};
use fantoccini::{Client, ClientBuilder, Locator};
use hyper_util::client::legacy::connect::HttpConnector;
use serde_json::{Value, json};

use crate::job::Tools;
use crate::picture::Live;

/// How long a page may take to tell what is wanted.
const PATIENCE: Duration = Duration::from_secs(40);
/// How long it is looked at before: until the course of the last seconds has something to show.
const SETTLES: Duration = Duration::from_secs(6);

/// What the live page tells of itself. Contacts are those of its table.
const TELLS: &str =
    "return {...document.documentElement.dataset, choice: document.getElementById('choice').textContent}";

/// A browser, and the driver in front of it.
struct Browser {
    client: Client,
    _driver: Ended,
    _profile: Folder,
}

/// A process that ends with this.
struct Ended(Child);

impl Drop for Ended {
    fn drop(&mut self) {
        // It may have ended by itself.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// A folder that goes with this.
struct Folder(PathBuf);

impl Drop for Folder {
    fn drop(&mut self) {
        // Chromium may still be writing there.
        let _ = fs::remove_dir_all(&self.0);
    }
}

impl Browser {
    async fn open(url: &str, size: [u32; 2]) -> Result<Self> {
        let profile = Folder(std::env::temp_dir().join(format!("tactomo-figures-{}", std::process::id())));
        let (driver, port) = driver()?;
        let arguments = [
            "--headless".to_owned(),
            "--no-sandbox".to_owned(),
            "--disable-gpu".to_owned(),
            "--no-first-run".to_owned(),
            "--disable-background-networking".to_owned(),
            "--hide-scrollbars".to_owned(),
            "--force-device-scale-factor=1".to_owned(),
            format!("--user-data-dir={}", profile.0.display()),
        ];
        let capabilities = json!({ "goog:chromeOptions": { "args": arguments } });
        let capabilities = capabilities.as_object().cloned().context("an object")?;
        let mut builder = ClientBuilder::new(HttpConnector::new());
        let client = builder.capabilities(capabilities).connect(&format!("http://127.0.0.1:{port}")).await?;
        let browser = Self { client, _driver: driver, _profile: profile };
        browser.client.goto(url).await?;
        // The window has a border that the page does not; asked once, it is known.
        browser.client.set_window_size(size[0], size[1]).await?;
        let inner = browser.client.execute("return [innerWidth, innerHeight]", Vec::new()).await?;
        let border = |axis: usize| size[axis].saturating_sub(inner[axis].as_u64().unwrap_or_default() as u32);
        browser.client.set_window_size(size[0] + border(0), size[1] + border(1)).await?;
        Ok(browser)
    }

    async fn close(self) -> Result<()> {
        Ok(self.client.close().await?)
    }
}

/// Takes a picture of a page in a file.
///
/// # Errors
/// If there is no browser, or the picture cannot be written.
pub fn picture_of_file(page: &Path, size: [u32; 2], picture: &Path) -> Result<()> {
    runtime()?.block_on(async {
        let browser = Browser::open(&format!("file://{}", page.display()), size).await?;
        tokio::time::sleep(Duration::from_millis(300)).await;
        let image = browser.client.screenshot().await?;
        browser.close().await?;
        fs::write(picture, image).with_context(|| picture.display().to_string())
    })
}

/// Starts the program with a simulated board and takes a picture of its page, once it tells what is wanted. Gives what it told.
///
/// # Errors
/// If the page never tells that, or there is no browser.
pub fn picture_of_live(tools: &Tools, live: &Live, size: [u32; 2], picture: &Path) -> Result<String> {
    let (program, url) = serve(tools, live)?;
    let told = runtime()?.block_on(async {
        let browser = Browser::open(&url, size).await?;
        let outcome = taken(&browser, live, picture).await;
        browser.close().await?;
        outcome
    });
    drop(program);
    told
}

async fn taken(browser: &Browser, live: &Live, picture: &Path) -> Result<String> {
    let begun = Instant::now();
    until(browser, begun, |told| told["theme"].is_string() && told["updates"].is_string()).await?;
    if told(browser).await?["theme"] != live.theme {
        browser.client.find(Locator::Id("theme")).await?.click().await?;
    }
    tokio::time::sleep(SETTLES).await;
    let begun = Instant::now();
    loop {
        let before = until(browser, begun, |told| is_wanted(told, live)).await?;
        // Paused, the page stays as it is told to be.
        browser.client.find(Locator::Id("pause")).await?.click().await?;
        let now = told(browser).await?;
        if is_wanted(&now, live) {
            // It looks as it does while frames come.
            browser
                .client
                .execute(
                    "const pause = document.getElementById('pause'); pause.blur(); pause.textContent = 'Pause';
                     pause.setAttribute('aria-pressed', 'false'); document.getElementById('frozen').hidden = true",
                    Vec::new(),
                )
                .await?;
            let image = browser.client.screenshot().await?;
            fs::write(picture, image).with_context(|| picture.display().to_string())?;
            return Ok(format!("{}, {} contacts told", text(&now, "choice"), text(&now, "contacts")));
        }
        eprintln!("{} before, {} when it was paused: once more", text(&before, "choice"), text(&now, "choice"));
        browser.client.find(Locator::Id("pause")).await?.click().await?;
    }
}

fn text(told: &Value, name: &str) -> String {
    told[name].as_str().unwrap_or_default().to_owned()
}

fn is_wanted(told: &Value, live: &Live) -> bool {
    let contacts = told["contacts"].as_str().and_then(|count| count.parse().ok());
    (live.contacts == 0 || contacts == Some(live.contacts)) && text(told, "choice").contains(live.headline)
}

async fn told(browser: &Browser) -> Result<Value> {
    Ok(browser.client.execute(TELLS, Vec::new()).await?)
}

async fn until(browser: &Browser, begun: Instant, wanted: impl Fn(&Value) -> bool) -> Result<Value> {
    loop {
        let told = told(browser).await?;
        if wanted(&told) {
            return Ok(told);
        }
        if begun.elapsed() > PATIENCE {
            bail!("the page does not show what it should; it tells {told}");
        }
        tokio::time::sleep(Duration::from_millis(40)).await;
    }
}

/// The program, and the address of its page.
fn serve(tools: &Tools, live: &Live) -> Result<(Ended, String)> {
    let mut command = Command::new(tools.programs.join("tactomo"));
    command.args(["live", "--simulate", "--no-open"]).args(live.args.split(' '));
    let mut program = Ended(command.stderr(Stdio::piped()).stdin(Stdio::null()).spawn()?);
    let stderr = program.0.stderr.take().context("the program's log")?;
    let mut lines = BufReader::new(stderr).lines();
    let url = loop {
        let line = lines.next().context("the program ended without a page")??;
        if let Some(url) = line.strip_prefix("live picture: ") {
            break url.trim().to_owned();
        }
    };
    // Read on, so that the program never waits for a reader of its log.
    std::thread::spawn(move || lines.for_each(drop));
    Ok((program, url))
}

fn driver() -> Result<(Ended, u16)> {
    let driver = Command::new("chromedriver").arg("--port=0").stdout(Stdio::piped()).spawn();
    let mut driver = Ended(driver.context("chromedriver: install Debian's chromium and chromium-driver")?);
    let stdout = driver.0.stdout.take().context("chromedriver's output")?;
    for line in BufReader::new(stdout).lines() {
        if let Some((_, port)) = line?.split_once("successfully on port ") {
            return Ok((driver, port.trim_end_matches('.').parse()?));
        }
    }
    bail!("chromedriver ended without a port")
}

fn runtime() -> Result<tokio::runtime::Runtime> {
    Ok(tokio::runtime::Builder::new_multi_thread().worker_threads(1).enable_all().build()?)
}
