//! A headless Chromium, driven through chromedriver.

use std::fs;
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::Duration;

use anyhow::{Context, Result, bail};
use fantoccini::{Client, ClientBuilder};
use hyper_util::client::legacy::connect::HttpConnector;
use serde_json::json;

/// A browser, and the driver in front of it.
pub struct Browser {
    /// What commands it.
    pub client: Client,
    _driver: Ended,
    _profile: Folder,
}

/// A process that ends with this.
pub struct Ended(pub Child);

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
    /// Opens a page, so large (CSS pixels), with so many pixels of the picture for each of them.
    ///
    /// # Errors
    /// If there is no browser, or no such page.
    pub async fn open(url: &str, size: [u32; 2], scale: f64) -> Result<Self> {
        let profile = Folder(std::env::temp_dir().join(format!("tactomo-figures-{}", std::process::id())));
        let (driver, port) = driver()?;
        let arguments = [
            "--headless".to_owned(),
            "--no-sandbox".to_owned(),
            "--disable-gpu".to_owned(),
            "--no-first-run".to_owned(),
            "--disable-background-networking".to_owned(),
            "--hide-scrollbars".to_owned(),
            format!("--force-device-scale-factor={scale}"),
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

    /// Closes it.
    ///
    /// # Errors
    /// If it does not answer.
    pub async fn close(self) -> Result<()> {
        Ok(self.client.close().await?)
    }
}

/// Takes a picture of a page in a file.
///
/// # Errors
/// If there is no browser, or the picture cannot be written.
pub fn picture_of_file(page: &Path, size: [u32; 2], picture: &Path) -> Result<()> {
    runtime()?.block_on(async {
        let browser = Browser::open(&format!("file://{}", page.display()), size, 1.0).await?;
        tokio::time::sleep(Duration::from_millis(300)).await;
        let image = browser.client.screenshot().await?;
        browser.close().await?;
        fs::write(picture, image).with_context(|| picture.display().to_string())
    })
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

/// What a browser is waited for in.
///
/// # Errors
/// If the system gives no thread.
pub fn runtime() -> Result<tokio::runtime::Runtime> {
    Ok(tokio::runtime::Builder::new_multi_thread().worker_threads(1).enable_all().build()?)
}
