//! Ctrl-C, and the signal by which systems end programs (SIGTERM), end a command in good order.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;

/// Exit code of a program that was ended at once.
const INTERRUPTED: i32 = 130;

/// A flag that Ctrl-C sets, or SIGTERM; the second of them ends the program at once.
pub fn flag() -> std::io::Result<Arc<AtomicBool>> {
    let flag = Arc::new(AtomicBool::new(false));
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build()?;
    let interrupted = Arc::clone(&flag);
    thread::Builder::new().name("interrupt".to_owned()).spawn(move || {
        let interrupt = || {
            if interrupted.swap(true, Ordering::Relaxed) {
                std::process::exit(INTERRUPTED);
            }
        };
        // Without signals, the program ends as others do.
        drop(runtime.block_on(at_each(interrupt)));
    })?;
    Ok(flag)
}

/// Calls a function at each Ctrl-C and each SIGTERM.
#[cfg(unix)]
async fn at_each(mut call: impl FnMut()) -> std::io::Result<()> {
    let mut terminated = tokio::signal::unix::signal(tokio::signal::unix::SignalKind::terminate())?;
    loop {
        tokio::select! {
            interrupted = tokio::signal::ctrl_c() => interrupted?,
            _ = terminated.recv() => {}
        }
        call();
    }
}

/// Calls a function at each Ctrl-C.
#[cfg(not(unix))]
async fn at_each(mut call: impl FnMut()) -> std::io::Result<()> {
    loop {
        tokio::signal::ctrl_c().await?;
        call();
    }
}
