//! Sinks at work, each in a thread of its own.

use std::io;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use super::feed::{Delivery, Feed, Keeps, Next, Tail, Taps};
use crate::run::Listener;
use tactomo_physics::causes::with_causes;

/// Longest wait at the end for a sink to take what is left.
pub(super) const PATIENCE: Duration = Duration::from_secs(1);

/// Why a sink ended before the run.
#[derive(Debug, thiserror::Error)]
#[error("{name} ended early")]
pub struct SinkError {
    /// What a person calls it.
    pub name: String,
    /// Why.
    pub source: io::Error,
}

/// What takes events, one after the other, in a thread of its own.
pub(super) trait Sink: Send + 'static {
    /// Takes one; `is_last` of those that wait, so that what is buffered may go out.
    fn take(&mut self, delivery: &Delivery, is_last: bool) -> io::Result<()>;

    /// Does what is due while none comes.
    fn rest(&mut self) -> io::Result<()> {
        Ok(())
    }

    /// Writes what is left: there are no more.
    fn finish(&mut self) -> io::Result<()>;
}

/// All sinks of a run: made before it, fed while it lasts, waited for after it.
#[derive(Default)]
pub struct Sinks {
    feed: Option<Feed>,
    running: Vec<Running>,
    ended: Arc<Ended>,
}

/// One sink's thread.
struct Running {
    name: String,
    thread: JoinHandle<()>,
    patience: Duration,
}

/// What has ended early, while the run goes on.
#[derive(Default)]
struct Ended {
    /// Set to end the run, when whoever reads its output has gone.
    stop: Arc<AtomicBool>,
    reader_is_gone: AtomicBool,
    failure: Mutex<Option<SinkError>>,
}

impl Sinks {
    /// None yet. `stop` is set when whoever reads what goes to stdout has gone.
    pub fn new(stop: Arc<AtomicBool>) -> Self {
        Self { ended: Arc::new(Ended { stop, ..Ended::default() }), ..Self::default() }
    }

    /// Who listens for all of them; `None` if there are none. The sinks end once that is dropped and they have taken what is left.
    pub fn listener(&mut self) -> Option<Box<dyn Listener>> {
        self.feed.take().map(|feed| Box::new(feed) as Box<dyn Listener>)
    }

    /// Who listens to detectors of such names for all of them; nobody if there are none.
    pub fn listeners<'a>(&mut self, patches: impl Iterator<Item = &'a str>) -> Vec<Option<Box<dyn Listener>>> {
        let feed = self.feed.take();
        patches.map(|patch| Some(Box::new(feed.as_ref()?.of(patch)) as Box<dyn Listener>)).collect()
    }

    /// Whether the run was ended because whoever reads its output has gone.
    pub fn reader_is_gone(&self) -> bool {
        self.ended.reader_is_gone.load(Ordering::Relaxed)
    }

    /// Waits for all of them; of one that does not take what is left, not for long.
    ///
    /// # Errors
    /// The first that ended early.
    pub fn finish(mut self) -> Result<(), SinkError> {
        self.feed = None;
        for Running { name, thread, patience } in self.running {
            let end = Instant::now() + patience;
            while !thread.is_finished() && Instant::now() < end {
                thread::sleep(Duration::from_millis(2));
            }
            if !thread.is_finished() {
                tracing::warn!("{name} does not take what is left: the last answers are lost");
            }
        }
        let failure = self.ended.failure.lock().unwrap_or_else(PoisonError::into_inner).take();
        failure.map_or(Ok(()), Err)
    }

    /// What opens tails for sinks.
    pub(super) fn taps(&mut self) -> Taps {
        self.feed.get_or_insert_default().taps()
    }

    /// Runs a sink.
    pub(super) fn run(
        &mut self,
        name: String,
        (keeps, most_per_s): (Keeps, Option<f64>),
        patience: Duration,
        sink: impl Sink,
    ) -> io::Result<()> {
        let tail = self.taps().open(&name, keeps, most_per_s);
        let ended = Arc::clone(&self.ended);
        let called = name.clone();
        self.thread(name, patience, move |runtime| {
            if let Err(error) = tail.map_or(Ok(()), |tail| runtime.block_on(pour(tail, sink))) {
                ended.early(called, error);
            }
        })
    }

    /// Runs whatever takes events by itself, in a thread and on a runtime of its own.
    pub(super) fn thread(
        &mut self,
        name: String,
        patience: Duration,
        work: impl FnOnce(tokio::runtime::Runtime) + Send + 'static,
    ) -> io::Result<()> {
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build()?;
        let thread = thread::Builder::new().name("sink".to_owned()).spawn(move || work(runtime))?;
        self.running.push(Running { name, thread, patience });
        Ok(())
    }
}

impl Ended {
    /// Takes note of a sink that has ended while the run goes on.
    fn early(&self, name: String, source: io::Error) {
        if source.kind() == io::ErrorKind::BrokenPipe {
            // Whoever reads has enough, as `head` has.
            self.reader_is_gone.store(true, Ordering::Relaxed);
            self.stop.store(true, Ordering::Relaxed);
            return;
        }
        let error = SinkError { name, source };
        tracing::error!("{}", with_causes(&error));
        self.failure.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert(error);
    }
}

/// Gives a sink all that comes.
async fn pour(mut tail: Tail, mut sink: impl Sink) -> io::Result<()> {
    loop {
        match tail.next().await {
            Next::Event(delivery) => sink.take(&delivery, tail.is_drained())?,
            Next::Quiet => sink.rest()?,
            Next::End => return sink.finish(),
        }
    }
}

#[cfg(test)]
mod tests {
    use tactomo_touch::solve::Solution;

    use super::*;
    use crate::run::TouchEvent;

    /// Counts what it takes, and fails at a number.
    struct Counting(Arc<Mutex<Vec<u64>>>, u64, io::ErrorKind);

    impl Sink for Counting {
        fn take(&mut self, delivery: &Delivery, _: bool) -> io::Result<()> {
            if delivery.event.frame.sequence == self.1 {
                return Err(self.2.into());
            }
            self.0.lock().unwrap().push(delivery.event.frame.sequence);
            Ok(())
        }

        fn finish(&mut self) -> io::Result<()> {
            Ok(())
        }
    }

    /// What each of two sinks has got, the first of which fails at 5, and how the sinks ended.
    fn two(kind: io::ErrorKind) -> ([usize; 2], bool, bool, Result<(), SinkError>) {
        let stop = Arc::new(AtomicBool::new(false));
        let mut sinks = Sinks::new(Arc::clone(&stop));
        let got = [Arc::default(), Arc::default()];
        for (fails_at, got) in [5, u64::MAX].iter().zip(&got) {
            let sink = Counting(Arc::clone(got), *fails_at, kind);
            sinks.run(format!("sink {fails_at}"), (Keeps::All, None), PATIENCE, sink).unwrap();
        }
        let mut listener = sinks.listener().unwrap();
        for sequence in 0..20 {
            listener.touched(&Arc::new(TouchEvent::of(sequence, Solution::default())));
        }
        drop(listener);
        while !sinks.running.iter().all(|running| running.thread.is_finished()) {
            thread::sleep(Duration::from_millis(1));
        }
        let gone = sinks.reader_is_gone();
        (got.map(|got| got.lock().unwrap().len()), gone, stop.load(Ordering::Relaxed), sinks.finish())
    }

    #[test]
    fn a_sink_that_fails_is_told_at_the_end_and_costs_the_others_nothing() {
        let (got, gone, stopped, ended) = two(io::ErrorKind::StorageFull);
        assert_eq!((got, gone, stopped), ([5, 20], false, false));
        assert!(ended.is_err_and(|error| error.name == "sink 5"));
    }

    #[test]
    fn a_reader_that_goes_ends_the_run_without_an_error() {
        let (got, gone, stopped, ended) = two(io::ErrorKind::BrokenPipe);
        assert_eq!((got, gone, stopped, ended.is_ok()), ([5, 20], true, true, true));
    }
}
