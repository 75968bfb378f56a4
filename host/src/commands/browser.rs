//! Opens the page in the person's browser.

use std::process::{Command, Stdio};
use std::thread;

/// Opens `url` where there is a desktop to open it on. The address is printed too, so a failure needs no word.
pub fn open(url: &str) {
    let Some(mut command) = command(url) else { return };
    command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
    // Some of these programs stay until the browser is closed; waited for, so that none is left behind as a zombie.
    let _ = thread::Builder::new().name("browser".to_owned()).spawn(move || command.status());
}

#[cfg(target_os = "macos")]
fn command(url: &str) -> Option<Command> {
    let mut command = Command::new("open");
    command.arg(url);
    Some(command)
}

#[cfg(windows)]
fn command(url: &str) -> Option<Command> {
    let mut command = Command::new("cmd");
    // The empty text is the window's title, which `start` takes first.
    command.args(["/C", "start", "", url]);
    Some(command)
}

#[cfg(not(any(target_os = "macos", windows)))]
fn command(url: &str) -> Option<Command> {
    let is_set = |name| std::env::var_os(name).is_some_and(|value| !value.is_empty());
    (is_set("DISPLAY") || is_set("WAYLAND_DISPLAY")).then(|| {
        let mut command = Command::new("xdg-open");
        command.arg(url);
        command
    })
}
