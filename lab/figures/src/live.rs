//! Pictures and films of the live page.

use std::fs;
use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use anyhow::{Context, Result, bail, ensure};
use fantoccini::Locator;
use serde_json::Value;

use crate::browser::{Browser, Ended, runtime};
use crate::film::{Shot, film};
use crate::job::Tools;
use crate::picture::{Film, Live};

/// How long a page may take to tell what is wanted.
const PATIENCE: Duration = Duration::from_secs(40);
/// How long it is looked at before: until the course of the last seconds has something to show.
const SETTLES: Duration = Duration::from_secs(6);

/// From picture to picture of a film; longer where the browser takes longer.
const FILM_STEP: Duration = Duration::from_millis(100);
/// Less is a row of pictures (1/s).
const LEAST_FILM_RATE: f64 = 5.0;
/// Documents shall not grow by more with each film that is taken again.
const MOST_FILM_BYTES: usize = 1_000_000;

/// What the live page tells of itself. Contacts are those of its table.
const TELLS: &str =
    "return {...document.documentElement.dataset, choice: document.getElementById('choice').textContent}";

/// Starts the program with a simulated board and takes a picture of its page, once it tells what is wanted. Gives what it told.
///
/// # Errors
/// If the page never tells that, or there is no browser.
pub fn picture_of_live(tools: &Tools, live: &Live, size: [u32; 2], picture: &Path) -> Result<String> {
    on_page(tools, live, (size, 1.0), async |browser| taken(browser, live, picture).await)
}

/// Starts the program with a simulated board and takes a film of its page, from when it tells what is wanted. Gives what it told.
///
/// # Errors
/// If the page never tells that, there is no browser, or the machine is too busy for a film.
pub fn film_of_live(tools: &Tools, shown: &Film, size: [u32; 2], file: &Path) -> Result<String> {
    on_page(tools, &shown.live, (size, shown.scale), async |browser| filmed(browser, shown, file).await)
}

/// Starts the program, opens its page, of that size and scale, in that theme and with something behind it, and looks at it.
fn on_page(
    tools: &Tools,
    live: &Live,
    (size, scale): ([u32; 2], f64),
    look: impl AsyncFnOnce(&Browser) -> Result<String>,
) -> Result<String> {
    let (program, url) = serve(tools, live)?;
    let told = runtime()?.block_on(async {
        let browser = Browser::open(&url, size, scale).await?;
        let outcome = match settled(&browser, live).await {
            Ok(()) => look(&browser).await,
            Err(error) => Err(error),
        };
        browser.close().await?;
        outcome
    });
    drop(program);
    told
}

async fn settled(browser: &Browser, live: &Live) -> Result<()> {
    until(browser, |told| told["theme"].is_string() && told["updates"].is_string()).await?;
    if told(browser).await?["theme"] != live.theme {
        browser.client.find(Locator::Id("theme")).await?.click().await?;
    }
    tokio::time::sleep(SETTLES).await;
    // Scenes press from the start on, which the page has to say, and a person has read by now.
    browser.client.execute("document.getElementById('notice-close').click()", Vec::new()).await?;
    Ok(())
}

async fn taken(browser: &Browser, live: &Live, picture: &Path) -> Result<String> {
    let begun = Instant::now();
    while begun.elapsed() < PATIENCE {
        let before = until(browser, |told| is_wanted(told, live)).await?;
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
    bail!("the page does not show what it should for long enough to be paused")
}

async fn filmed(browser: &Browser, shown: &Film, file: &Path) -> Result<String> {
    until(browser, |told| is_wanted(told, &shown.live)).await?;
    let ends = Duration::from_secs_f64(shown.seconds);
    let (mut shots, mut wanted) = (Vec::new(), 0);
    let begun = Instant::now();
    // Browsers show what should stay for less than some 10 ms for 100.
    while begun.elapsed() + FILM_STEP / 2 < ends {
        // What the browser shows when it is asked; it takes as long to answer each time.
        let at = begun.elapsed();
        shots.push(Shot { at, png: browser.client.screenshot().await? });
        wanted += usize::from(is_wanted(&told(browser).await?, &shown.live));
        tokio::time::sleep((at + FILM_STEP).saturating_sub(begun.elapsed())).await;
    }
    let rate = shots.len() as f64 / shown.seconds;
    ensure!(rate > LEAST_FILM_RATE, "{rate:.1} pictures a second are no film: let nothing else run");
    let film = film(&shots, ends)?;
    ensure!(film.len() < MOST_FILM_BYTES, "a film of {} bytes, more than {MOST_FILM_BYTES}", film.len());
    fs::write(file, &film).with_context(|| file.display().to_string())?;
    let share = 100.0 * wanted as f64 / shots.len() as f64;
    let (seconds, kilobytes, wanted) = (shown.seconds, film.len() / 1000, shown.live.wanted());
    Ok(format!("{seconds} s, {rate:.1} pictures a second, {kilobytes} kB; {wanted} in {share:.0} % of them"))
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

async fn until(browser: &Browser, wanted: impl Fn(&Value) -> bool) -> Result<Value> {
    let begun = Instant::now();
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
