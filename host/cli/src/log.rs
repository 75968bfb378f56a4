//! The log on stderr, in which a kind of warning that comes again and again is said a few times, then counted.

use std::collections::HashMap;
use std::fmt;
use std::io::{IsTerminal, Write};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use tracing::field::{Field, Visit};
use tracing::level_filters::LevelFilter;
use tracing::span::{Attributes, Id, Record};
use tracing::{Event, Level, Metadata, Subscriber};

use crate::output;

/// A warning that comes again within this time of the first of its kind is counted only.
const SAID_EVERY: Duration = Duration::from_secs(60);
/// Warnings of a kind that differ in a number, as that of an electrode, are said so many times in that time.
const SAID_OF_KIND: usize = 4;
/// Kinds of warnings that are known at a time: more than the program has, but for names in them.
const MOST_KNOWN: usize = 256;

/// The log; says at its end what is still only counted.
pub struct Log(Arc<Mutex<Repeats>>);

impl Log {
    /// Begins to print the log on stderr.
    pub fn begin() -> Self {
        let repeats = Arc::new(Mutex::new(Repeats::default()));
        let colours = std::io::stderr().is_terminal();
        let printer = Printer { out: Mutex::new(output::Stderr), colours, repeats: Arc::clone(&repeats) };
        // It fails where a log has begun before, which goes on then.
        drop(tracing::subscriber::set_global_default(printer));
        Self(repeats)
    }
}

impl Drop for Log {
    fn drop(&mut self) {
        for (message, times) in lock(&self.0).counted() {
            output::message!("{}: {message}", again(times));
        }
    }
}

fn lock<T>(shared: &Mutex<T>) -> std::sync::MutexGuard<'_, T> {
    shared.lock().unwrap_or_else(PoisonError::into_inner)
}

fn again(times: u64) -> String {
    format!("{times} {} more", if times == 1 { "time" } else { "times" })
}

/// What a warning says but for its numbers, each of which is a `#`: so a kind of warning is told from others, not by what was measured.
fn kind(message: &str) -> String {
    let mut kind = String::with_capacity(message.len());
    let mut characters = message.chars().peekable();
    while let Some(c) = characters.next() {
        if !c.is_ascii_digit() {
            kind.push(c);
            continue;
        }
        kind.push('#');
        while characters.next_if(|c| c.is_ascii_digit() || *c == '.').is_some() {}
    }
    kind
}

/// Kinds of warnings and errors that were said, and how often each has come since.
#[derive(Debug, Default)]
struct Repeats(HashMap<String, Repeat>);

#[derive(Debug)]
struct Repeat {
    /// When the first of those that were said lately was.
    began: Instant,
    /// What was said since.
    said: Vec<String>,
    since: u64,
}

impl Repeat {
    fn begin(message: &str, now: Instant) -> Self {
        Self { began: now, said: vec![message.to_owned()], since: 0 }
    }
}

impl Repeats {
    /// Takes note of a message: `None` if it is only counted, else how often its kind was counted since it was said last.
    fn take(&mut self, message: &str, now: Instant) -> Option<u64> {
        let kind = kind(message);
        if let Some(known) = self.0.get_mut(&kind) {
            if now.saturating_duration_since(known.began) >= SAID_EVERY {
                return Some(std::mem::replace(known, Repeat::begin(message, now)).since);
            }
            if known.said.len() < SAID_OF_KIND && known.said.iter().all(|said| said != message) {
                known.said.push(message.to_owned());
                return Some(0);
            }
            known.since += 1;
            return None;
        }
        if self.0.len() >= MOST_KNOWN {
            let oldest = self.0.iter().min_by_key(|(_, repeat)| repeat.began).map(|(kind, _)| kind.clone());
            oldest.and_then(|oldest| self.0.remove(&oldest));
        }
        self.0.insert(kind, Repeat::begin(message, now));
        Some(0)
    }

    /// What was counted and not said yet, as it was said last, in the order in which kinds were said first.
    fn counted(&mut self) -> Vec<(String, u64)> {
        let mut counted: Vec<_> = self.0.drain().map(|(_, repeat)| repeat).filter(|repeat| repeat.since > 0).collect();
        counted.sort_by_key(|repeat| repeat.began);
        let last = |Repeat { mut said, since, .. }: Repeat| {
            let last = said.pop()?;
            Some((if said.is_empty() { last } else { format!("{last}, and others like it") }, since))
        };
        counted.into_iter().filter_map(last).collect()
    }
}

/// Prints events from INFO on, a line each: its level and its words. The program has no spans.
struct Printer<W> {
    out: Mutex<W>,
    colours: bool,
    repeats: Arc<Mutex<Repeats>>,
}

impl<W: Write + Send + 'static> Subscriber for Printer<W> {
    fn enabled(&self, metadata: &Metadata<'_>) -> bool {
        *metadata.level() <= Level::INFO
    }

    fn max_level_hint(&self) -> Option<LevelFilter> {
        Some(LevelFilter::INFO)
    }

    fn event(&self, event: &Event<'_>) {
        let level = *event.metadata().level();
        let mut message = Message::default();
        event.record(&mut message);
        let is_warning = level <= Level::WARN;
        let since = if is_warning { lock(&self.repeats).take(&message.0, Instant::now()) } else { Some(0) };
        let Some(since) = since else { return };
        let note = if since == 0 { String::new() } else { format!(" ({} in the meantime)", again(since)) };
        let words = output::message_of(&message.0);
        let line = match self.colours {
            true => format!("\x1b[{}m{level:>5}\x1b[0m {words}{note}\n", colour(level)),
            false => format!("{level:>5} {words}{note}\n"),
        };
        // Nobody can be told that the log cannot be written.
        drop(lock(&self.out).write_all(line.as_bytes()));
    }

    fn new_span(&self, _: &Attributes<'_>) -> Id {
        Id::from_u64(1)
    }

    fn record(&self, _: &Id, _: &Record<'_>) {}
    fn record_follows_from(&self, _: &Id, _: &Id) {}
    fn enter(&self, _: &Id) {}
    fn exit(&self, _: &Id) {}
}

/// Number of a level's colour in a terminal: red, yellow, green.
fn colour(level: Level) -> u8 {
    match level {
        Level::ERROR => 31,
        Level::WARN => 33,
        _ => 32,
    }
}

/// The words of an event.
#[derive(Default)]
struct Message(String);

impl Visit for Message {
    fn record_debug(&mut self, field: &Field, value: &dyn fmt::Debug) {
        match field.name() {
            "message" => self.0.push_str(&format!("{value:?}")),
            name => self.0.push_str(&format!(" {name}={value:?}")),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_comes_again_is_counted_and_said_again_after_a_minute() {
        let mut repeats = Repeats::default();
        let begin = Instant::now();
        let at = |seconds: u64| begin + Duration::from_secs(seconds);
        assert_eq!(repeats.take("refused", at(0)), Some(0));
        assert!((0..12_880).all(|i| repeats.take("refused", at(i % 4)).is_none()));
        assert_eq!(repeats.take("electrode 3", at(4)), Some(0), "another one is another one");
        assert_eq!(repeats.take("refused", at(60)), Some(12_880));
        assert_eq!(repeats.take("refused", at(61)), None);
        assert_eq!(repeats.counted(), [("refused".to_owned(), 1)]);
    }

    #[test]
    fn warnings_are_told_apart_by_their_kind_not_by_the_numbers_in_them() {
        let mut repeats = Repeats::default();
        let begin = Instant::now();
        let say = |repeats: &mut Repeats, mv: u32, seconds| {
            let message = format!("Not re-zeroed: {mv}.5 mV at electrode 3");
            repeats.take(&message, begin + Duration::from_secs(seconds))
        };
        let said = (0..750).filter(|i| say(&mut repeats, 286 + i, 1).is_some()).count();
        assert_eq!(said, SAID_OF_KIND);
        assert_eq!(repeats.take("the board is back", begin), Some(0), "another kind is said");
        assert_eq!(say(&mut repeats, 1036, 61), Some(750 - SAID_OF_KIND as u64));
        assert_eq!(repeats.counted(), []);
    }

    #[test]
    fn the_oldest_are_forgotten() {
        let mut repeats = Repeats::default();
        let begin = Instant::now();
        let of_kind = |i: usize| "x".repeat(i);
        for i in 0..2 * MOST_KNOWN {
            assert_eq!(repeats.take(&of_kind(i), begin + Duration::from_millis(i as u64)), Some(0));
        }
        assert_eq!(repeats.0.len(), MOST_KNOWN);
        assert!(repeats.take(&of_kind(2 * MOST_KNOWN - 1), begin).is_none());
    }

    #[test]
    fn the_log_says_a_warning_once() {
        #[derive(Clone, Default)]
        struct Written(Arc<Mutex<Vec<u8>>>);
        impl std::io::Write for Written {
            fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
                self.0.lock().unwrap_or_else(PoisonError::into_inner).extend_from_slice(bytes);
                Ok(bytes.len())
            }
            fn flush(&mut self) -> std::io::Result<()> {
                Ok(())
            }
        }
        let (written, repeats) = (Written::default(), Arc::new(Mutex::new(Repeats::default())));
        let kept = written.clone();
        let printer = Printer { out: Mutex::new(kept), colours: false, repeats: Arc::clone(&repeats) };
        tracing::subscriber::with_default(printer, || {
            for electrode in [3, 5] {
                (0..9).for_each(|_| tracing::warn!("electrode {electrode} is left out"));
                (0..2).for_each(|_| tracing::info!("found {electrode}\x1b[2J"));
                tracing::debug!("nobody reads this");
            }
        });
        let text = String::from_utf8(written.0.lock().unwrap().clone()).unwrap();
        let lines: Vec<_> = text.lines().collect();
        let found = " INFO found 3\\u001b[2J";
        let expected = [" WARN electrode 3 is left out", found, found];
        assert_eq!(lines[..3], expected, "{text}");
        assert_eq!(lines.len(), 6, "{text}");
        assert_eq!(lock(&repeats).counted(), [("electrode 5 is left out, and others like it".to_owned(), 16)]);
    }
}
