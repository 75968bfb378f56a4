//! One page's socket.

use std::future::pending;
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::Duration;

use futures_util::StreamExt;
use tactomo_board::link::Control;
use tactomo_touch::changes::Changes;
use tactomo_touch::solve::Total;
use tokio::sync::watch;
use tokio::time::{Instant, sleep_until};
use tokio_tungstenite::tungstenite::Message;
use tokio_tungstenite::tungstenite::protocol::CloseFrame;
use tokio_tungstenite::tungstenite::protocol::frame::coding::CloseCode;

use super::messages::PageMessage;
use super::update::{self, Shown};
use super::{PageSetup, Picture, wire};
use crate::run::{Request, Snapshot};
use crate::sink::web::{Beat, Pulse, WebSocket};

/// Least time between two updates: a little less than a screen's refresh, so that a page that asks at each refresh is served
/// at each.
const UPDATE_INTERVAL: Duration = Duration::from_millis(15);

const STATUS_INTERVAL: Duration = Duration::from_millis(250);
/// While the detector is calibrated: whoever rubs sees at once where that was.
const CALIBRATING_INTERVAL: Duration = Duration::from_millis(100);

/// Talks to a page until it leaves.
pub(super) async fn serve(mut socket: WebSocket, picture: &Picture) {
    let mut page = Page::new(picture);
    let reason = page.talk(&mut socket).await;
    if page.presses {
        page.ask(Request::Control(Control::Press(Vec::new())));
    }
    if let Some(reason) = reason {
        let frame = CloseFrame { code: CloseCode::Policy, reason: reason.into() };
        // The page may be gone already.
        let _ = page.pulse.send(&mut socket, Message::Close(Some(frame))).await;
    }
}

struct Page<'a> {
    picture: &'a Picture,
    snapshots: watch::Receiver<Arc<Snapshot>>,
    /// Whether the page has dealt with the last message.
    taken: bool,
    update_due: Instant,
    status_due: Instant,
    /// Points of the course of the readings that it has.
    course_points: u64,
    changes: Changes,
    /// Whether this page presses on the simulated detector.
    presses: bool,
    pulse: Pulse,
}

enum Turn {
    Status,
    Update,
}

impl<'a> Page<'a> {
    fn new(picture: &'a Picture) -> Self {
        let mut snapshots = picture.shown.snapshots.clone();
        snapshots.mark_changed();
        let now = Instant::now();
        let pulse = Pulse::new(picture.door.limits);
        Self {
            picture,
            snapshots,
            taken: false,
            update_due: now,
            status_due: now,
            course_points: 0,
            changes: Changes::default(),
            presses: false,
            pulse,
        }
    }

    /// Returns when the page has left, or with the reason to close.
    async fn talk(&mut self, socket: &mut WebSocket) -> Option<&'static str> {
        self.pulse.send(socket, Message::text(self.picture.setup_message.clone())).await.ok()?;
        loop {
            tokio::select! {
                heard = socket.next() => {
                    self.pulse.heard();
                    match heard?.ok()? {
                        Message::Text(text) => if let Err(reason) = self.hear(&text) {
                            return Some(reason);
                        },
                        Message::Binary(_) => return Some("pages send text only"),
                        Message::Close(_) => return None,
                        Message::Ping(_) | Message::Pong(_) | Message::Frame(_) => {}
                    }
                }
                beat = self.pulse.next() => match beat {
                    Beat::Ping => self.pulse.send(socket, Message::Ping(Vec::new().into())).await.ok()?,
                    Beat::Gone => return Some("nothing was heard of the page for too long"),
                },
                turn = next_turn(&mut self.snapshots, self.update_due, self.status_due), if self.taken => {
                    let message = match turn {
                        Turn::Status => self.status(),
                        Turn::Update => self.update(),
                    };
                    if let Some(message) = message {
                        self.taken = false;
                        // Waits here while the page does not read; nothing else waits for this.
                        self.pulse.send(socket, message).await.ok()?;
                    }
                }
            }
        }
    }

    fn hear(&mut self, text: &str) -> Result<(), &'static str> {
        let message = PageMessage::parse(text)?;
        self.taken |= message == PageMessage::Taken;
        let Some(request) = message.request(&self.picture.shown.setup)? else { return Ok(()) };
        match &request {
            Request::Rezero => {
                self.picture.rezeros.fetch_add(1, Ordering::Relaxed);
            }
            Request::Control(Control::Press(contacts)) => self.presses = !contacts.is_empty(),
            _ => {}
        }
        self.ask(request);
        Ok(())
    }

    fn ask(&self, request: Request) {
        if self.picture.shown.requests.try_send(request).is_err() {
            tracing::warn!("a request of the page was dropped: the program does not take it");
        }
    }

    fn status(&mut self) -> Option<Message> {
        let snapshot = self.snapshots.borrow().clone();
        let interval = if snapshot.calibrating.is_some() { CALIBRATING_INTERVAL } else { STATUS_INTERVAL };
        self.status_due = Instant::now() + interval;
        let rezeros = self.picture.rezeros.load(Ordering::Relaxed);
        wire::status(&snapshot, rezeros).ok().map(Message::text)
    }

    fn update(&mut self) -> Option<Message> {
        // Cloned, so that the pipeline can publish the next while this one is encoded.
        let snapshot = self.snapshots.borrow_and_update().clone();
        self.update_due = Instant::now() + UPDATE_INTERVAL;
        let answer = snapshot.answer.as_deref()?;
        let (course_v, points) = snapshot.course.points_since(self.course_points);
        self.course_points = points;
        let PageSetup { detector, mesh, .. } = &self.picture.shown.setup;
        let shown = Shown {
            answer,
            contacts: &self.changes.take(&answer.solution.contacts).contacts,
            frames: snapshot.statistics.frames,
            course_v: &course_v,
            detector,
            total: Total::of(&answer.solution, Some(mesh)),
        };
        Some(Message::binary(update::update(&shown)))
    }
}

/// Waits for what the page is to get next. May be dropped at any time: nothing is lost.
async fn next_turn(snapshots: &mut watch::Receiver<Arc<Snapshot>>, update_due: Instant, status_due: Instant) -> Turn {
    let update = async {
        sleep_until(update_due).await;
        if snapshots.changed().await.is_err() {
            // The pipeline has ended: the status says why, and there are no more frames.
            pending().await
        }
    };
    tokio::select! {
        biased;
        () = sleep_until(status_due) => Turn::Status,
        () = update => Turn::Update,
    }
}
