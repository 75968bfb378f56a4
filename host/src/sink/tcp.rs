//! A stream for all who connect to a port. Each has its own place in the queue: one that goes or stalls costs nobody else anything.

use std::io;
use std::net::SocketAddr;
use std::sync::Arc;

use tokio::io::{AsyncRead, AsyncReadExt, AsyncWrite, AsyncWriteExt};
use tokio::net::TcpListener;
use tokio::sync::Semaphore;
use tokio::task::JoinSet;
use tokio::time::timeout;

use super::address::Address;
use super::door::Limits;
use super::feed::{Keeps, Next, Tail, Taps};
use super::lines::Fields;
use super::running::{PATIENCE, Sinks};
use super::target::{Form, StreamError};
use super::web::within;
use tactomo_physics::causes::with_causes;

/// Readers at a time.
const MOST_READERS: usize = 32;

/// Listens in a thread of its own.
pub(super) fn serve(
    sinks: &mut Sinks,
    address: &Address,
    form: Form,
    limits: Limits,
) -> Result<SocketAddr, StreamError> {
    let refused = StreamError::address("a stream", address);
    let listener = address.resolve(0).and_then(std::net::TcpListener::bind).map_err(&refused)?;
    let at = listener.local_addr().map_err(&refused)?;
    listener.set_nonblocking(true).map_err(&refused)?;
    let (name, taps) = (format!("the stream tcp:{at}"), sinks.taps());
    let work = move |runtime: tokio::runtime::Runtime| {
        if let Err(error) = runtime.block_on(accept(listener, taps, form, limits)) {
            tracing::error!("the stream tcp:{at} takes no more readers: {}", with_causes(&error));
        }
    };
    sinks.thread(name.clone(), 2 * PATIENCE, work).map_err(StreamError::thread(&name))?;
    Ok(at)
}

async fn accept(listener: std::net::TcpListener, taps: Taps, form: Form, limits: Limits) -> io::Result<()> {
    let listener = TcpListener::from_std(listener)?;
    let room = Arc::new(Semaphore::new(MOST_READERS));
    let (mut readers, mut alive) = (JoinSet::new(), taps.clone());
    loop {
        let (stream, from) = tokio::select! {
            // A connection that fails before it is accepted is no reason to take no other.
            accepted = listener.accept() => match accepted {
                Ok(accepted) => accepted,
                Err(error) => {
                    tracing::debug!("a reader could not connect: {}", with_causes(&error));
                    tokio::time::sleep(PATIENCE / 10).await;
                    continue;
                }
            },
            () = alive.ended() => break,
        };
        while readers.try_join_next().is_some() {}
        let Ok(place) = Arc::clone(&room).try_acquire_owned() else {
            tracing::warn!("{} cannot read the stream too: {MOST_READERS} do already", from.ip());
            continue;
        };
        let Some(tail) = taps.open(&format!("the stream's reader {from}"), Keeps::Newest, form.most_per_s) else {
            break;
        };
        readers.spawn(async move {
            // One that has gone is missed by nobody.
            let _ = stream.set_nodelay(true);
            let _ = write(stream, tail, form.fields, limits).await;
            drop(place);
        });
    }
    // What is left is for those who read; a stalled one is not waited for.
    let _ = timeout(PATIENCE, async { while readers.join_next().await.is_some() {} }).await;
    Ok(())
}

/// Writes to a reader until it goes, takes nothing for too long, or nothing more comes.
async fn write<S: AsyncRead + AsyncWrite + Unpin>(
    mut stream: S,
    mut tail: Tail,
    fields: Fields,
    limits: Limits,
) -> io::Result<()> {
    let (mut line, mut lines, mut heard, mut hears) = (Vec::new(), Vec::new(), [0; 64], true);
    loop {
        tokio::select! {
            next = tail.next() => match next {
                Next::Event(delivery) => {
                    fields.line(&delivery, &mut line)?;
                    lines.extend_from_slice(&line);
                    if tail.is_drained() || lines.len() > 1 << 16 {
                        tail.wait_for(within(limits, stream.write_all(&lines))).await?;
                        lines.clear();
                    }
                }
                Next::Quiet => {
                    tail.wait_for(within(limits, stream.write_all(&lines))).await?;
                    lines.clear();
                }
                Next::End => {
                    tail.wait_for(within(limits, stream.write_all(&lines))).await?;
                    return stream.shutdown().await;
                }
            },
            // Nothing is expected of a reader; one that says that it will say nothing may still read.
            count = stream.read(&mut heard), if hears => hears = count? > 0,
        }
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use tactomo_touch::solve::Solution;

    use super::super::feed::Feed;
    use super::*;
    use crate::run::{Listener, TouchEvent};

    #[test]
    fn a_reader_that_takes_nothing_for_too_long_has_gone() {
        let mut feed = Feed::default();
        let tail = feed.taps().open("a reader", Keeps::Newest, None).unwrap();
        (0..100).for_each(|sequence| feed.touched(&Arc::new(TouchEvent::of(sequence, Solution::default()))));
        let limits = Limits { gone_after: Duration::from_millis(50), ..Limits::default() };
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().unwrap();
        let ended = runtime.block_on(async {
            let (ours, _theirs) = tokio::io::duplex(64);
            write(ours, tail, Fields::default(), limits).await
        });
        assert_eq!(ended.unwrap_err().kind(), io::ErrorKind::TimedOut);
    }
}
