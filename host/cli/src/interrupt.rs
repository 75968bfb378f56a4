//! Ctrl-C, the signal by which systems end programs (SIGTERM), and that of a terminal which is closed (SIGHUP) end a command in good order.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;

/// Exit code of a program that was ended at once.
const INTERRUPTED: i32 = 130;

/// What asks a command to end.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Asked {
    /// A person or a system: the second time at once.
    Ended,
    /// A terminal that is closed. Its shell may say so too, which asks for nothing more.
    #[cfg(unix)]
    HungUp,
}

/// A flag that Ctrl-C sets, or SIGTERM, the second of which ends the program at once; or SIGHUP.
pub fn flag() -> std::io::Result<Arc<AtomicBool>> {
    let flag = Arc::new(AtomicBool::new(false));
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build()?;
    let interrupted = Arc::clone(&flag);
    thread::Builder::new().name("interrupt".to_owned()).spawn(move || {
        let interrupt = |asked| {
            if interrupted.swap(true, Ordering::Relaxed) && asked == Asked::Ended {
                std::process::exit(INTERRUPTED);
            }
        };
        // Without signals, the program ends as others do.
        drop(runtime.block_on(at_each(interrupt)));
    })?;
    Ok(flag)
}

/// Calls a function at each Ctrl-C, SIGTERM and SIGHUP.
#[cfg(unix)]
async fn at_each(mut call: impl FnMut(Asked)) -> std::io::Result<()> {
    use tokio::signal::unix::{SignalKind, signal};

    let mut terminated = signal(SignalKind::terminate())?;
    let mut hung_up = if ignores_hangup() { None } else { Some(signal(SignalKind::hangup())?) };
    loop {
        let asked = tokio::select! {
            interrupted = tokio::signal::ctrl_c() => interrupted.map(|()| Asked::Ended)?,
            _ = terminated.recv() => Asked::Ended,
            Some(()) = async { hung_up.as_mut()?.recv().await } => Asked::HungUp,
        };
        call(asked);
    }
}

/// Whether the program was begun to go on without its terminal, as `nohup` does: then SIGHUP is ignored from the start, and stays so. Told by
/// Linux; elsewhere it is taken.
#[cfg(unix)]
fn ignores_hangup() -> bool {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let ignored = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    // A bit for each signal, from the first: SIGHUP.
    ignored.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok()).is_some_and(|mask| mask & 1 == 1)
}

/// Calls a function at each Ctrl-C.
#[cfg(not(unix))]
async fn at_each(mut call: impl FnMut(Asked)) -> std::io::Result<()> {
    loop {
        tokio::signal::ctrl_c().await?;
        call(Asked::Ended);
    }
}
