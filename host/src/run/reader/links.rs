//! Links one after the other: the first, and another when that is lost.

use std::io;
use std::thread;
use std::time::{Duration, Instant};

use tactomo_board::link::Link;
use tactomo_board::session::{GreetError, WishState};
use tactomo_board::source::Source;
use tactomo_physics::causes::with_causes;

use super::Reader;
use crate::run::LinkState;
use crate::run::connection::Connection;
use crate::run::options::LiveError;

/// Time between two tries to open a link that was lost.
const REOPEN_EVERY: Duration = Duration::from_millis(500);
/// Bytes of one read: 40 ms at 921600 baud, 14 ms at 3 million.
const READ_BYTES: usize = 4096;

/// How a connection ended.
enum End {
    /// Time is over, or the user has enough.
    Stopped,
    /// There is nothing more to come.
    Over(String),
    /// The link is lost and may come back.
    Lost(String),
    /// No board has answered at the start, and it is waited for.
    Missed(LiveError),
}

impl Reader {
    /// Returns the name of the last link, or of the source if there was none.
    pub(super) fn run(&mut self, source: &mut dyn Source) -> Result<String, LiveError> {
        let mut name = source.name();
        let mut next = self.first(source)?;
        while let Some(mut link) = next {
            name = link.name();
            match self.serve(link.as_mut(), source.comes_back())? {
                End::Stopped => return Ok(name),
                End::Over(reason) => {
                    tracing::info!("{reason}");
                    self.enter(LinkState::Ended(reason));
                    return Ok(name);
                }
                End::Lost(reason) => {
                    tracing::warn!("{name}: {reason}; waiting for it to come back");
                    self.enter(LinkState::Lost(reason));
                }
                End::Missed(error) => self.miss(error),
            }
            drop(link); // A port that stays open keeps its name from the board that is plugged in again.
            next = self.reopen(source);
        }
        match self.missed.take().filter(|_| self.has_waited()) {
            Some(error) => Err(error),
            None => Ok(name),
        }
    }

    /// The first link; `None` if the run ends before there is one.
    fn first(&mut self, source: &mut dyn Source) -> Result<Option<Box<dyn Link>>, LiveError> {
        match source.open() {
            Err(error) if self.options.waits && source.comes_back() => {
                self.miss(error.into());
                Ok(self.reopen(source))
            }
            opened => Ok(Some(opened?)),
        }
    }

    /// Opens the source again as soon as that is possible; `None` if the run ends before.
    fn reopen(&mut self, source: &mut dyn Source) -> Option<Box<dyn Link>> {
        while !self.is_over() && !self.has_waited() {
            match source.open() {
                Ok(link) => return Some(link),
                Err(error) if self.is_missing() => self.miss(error.into()),
                Err(error) => tracing::debug!("{}", with_causes(&error)),
            }
            self.answer_requests(None);
            self.notice.keep_fresh();
            thread::sleep(REOPEN_EVERY);
        }
        None
    }

    /// Whether the first board is waited for.
    fn is_missing(&self) -> bool {
        self.options.waits && self.greeted.is_none()
    }

    /// Whether the first board was waited for as long as the run was to last.
    fn has_waited(&self) -> bool {
        self.is_missing() && self.options.seconds.is_some_and(|limit| self.begun.elapsed() >= limit)
    }

    /// Tells why there is no board, each reason once.
    fn miss(&mut self, error: LiveError) {
        let reason = with_causes(&error);
        if self.missed.as_ref().is_none_or(|before| with_causes(before) != reason) {
            tracing::warn!("{reason}; waiting for it");
        }
        self.missed = Some(error);
        self.enter(LinkState::Absent(reason));
    }

    /// Talks with the board on `link` to the end.
    fn serve(&mut self, link: &mut dyn Link, comes_back: bool) -> Result<End, LiveError> {
        let mut connection = Connection::new(self.options.settings, comes_back);
        self.plans.ask_again(&mut connection.session);
        connection.session.request_output(self.options.output);
        let mut buffer = [0; READ_BYTES];
        self.sequence.restart();
        (self.newest, self.found) = (None, None);
        // Who did not answer here before is waited for as before.
        if !matches!(self.missed, Some(LiveError::Greet { .. })) {
            self.enter(LinkState::Waiting);
        }
        while !self.is_over() {
            self.answer_requests(Some((&mut *link, &mut connection)));
            self.plans.ask(&mut connection.session);
            match connection.exchange(link, &mut buffer) {
                Ok(count) => {
                    self.recordings.asked(connection.session.take_sent());
                    if link.jumped() {
                        self.sequence.restart();
                        (self.newest, self.found) = (None, None);
                        connection.jumped();
                        self.inbox.jump();
                    }
                    self.receive(&mut connection, link, &buffer[..count])?;
                }
                Err(error) => {
                    self.take_found_alone(&mut connection, Instant::now());
                    return lost(link, error, comes_back);
                }
            }
            if connection.answers && connection.session.output_state() == WishState::Refused {
                let error = LiveError::NoContacts { link: link.name() };
                // When it is opened again it is given its table again.
                return if comes_back { Ok(End::Lost(with_causes(&error))) } else { Err(error) };
            }
            if comes_back && let Some(error) = connection.in_vain() {
                return self.unanswered(error, link);
            }
            self.show_link(link, &mut connection);
        }
        connection.session.leave(link);
        let frames = self.notice.count(|meter| meter.statistics(Instant::now()).frames);
        if comes_back && frames == 0 && self.is_timed_out() {
            return Err(LiveError::Mute { link: link.name() });
        }
        Ok(End::Stopped)
    }

    /// No board has answered: at the start that is an error, unless it is waited for, later it may come back.
    fn unanswered(&self, error: GreetError, link: &dyn Link) -> Result<End, LiveError> {
        if self.greeted.is_some() {
            return Ok(End::Lost(with_causes(&error)));
        }
        let error = LiveError::Greet { link: link.name(), error };
        if self.options.waits { Ok(End::Missed(error)) } else { Err(error) }
    }
}

/// What a link that breaks means.
fn lost(link: &dyn Link, error: io::Error, comes_back: bool) -> Result<End, LiveError> {
    match error.kind() {
        io::ErrorKind::UnexpectedEof => Ok(End::Over(with_causes(&error))),
        _ if comes_back => Ok(End::Lost(with_causes(&error))),
        _ => Err(LiveError::Link { link: link.name(), source: error }),
    }
}
