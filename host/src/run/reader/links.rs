//! Links one after the other: the first, and another when that is lost.

use std::io;
use std::thread;
use std::time::Duration;

use tactomo_board::link::Link;
use tactomo_board::session::GreetError;
use tactomo_board::source::Source;
use tactomo_physics::causes::with_causes;

use super::Reader;
use crate::run::LinkState;
use crate::run::options::LiveError;

/// Time between two tries to open a link that was lost.
const REOPEN_EVERY: Duration = Duration::from_millis(500);

/// How a connection ended.
pub(super) enum End {
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

    /// No board has answered: at the start that is an error, unless it is waited for, later it may come back.
    pub(super) fn unanswered(&self, error: GreetError, link: &dyn Link) -> Result<End, LiveError> {
        if self.greeted.is_some() {
            return Ok(End::Lost(with_causes(&error)));
        }
        let error = LiveError::Greet { link: link.name(), error };
        if self.options.waits { Ok(End::Missed(error)) } else { Err(error) }
    }
}

/// What a link that breaks means.
pub(super) fn lost(link: &dyn Link, error: io::Error, comes_back: bool) -> Result<End, LiveError> {
    match error.kind() {
        io::ErrorKind::UnexpectedEof => Ok(End::Over(with_causes(&error))),
        _ if comes_back => Ok(End::Lost(with_causes(&error))),
        _ => Err(LiveError::Link { link: link.name(), source: error }),
    }
}
