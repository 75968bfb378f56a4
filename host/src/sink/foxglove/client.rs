//! One app's connection.

use std::io;

use futures_util::StreamExt;
use tokio_tungstenite::tungstenite::Message;

use super::Shared;
use super::protocol::{self, Asked, Subscription};
use crate::sink::channels::Topic;
use crate::sink::feed::{Delivery, Keeps, Next, Tail};
use crate::sink::web::{Beat, Pulse, WebSocket};

/// Talks to an app until it leaves or nothing more comes.
pub(super) async fn serve(mut socket: WebSocket, shared: &Shared) {
    let pulse = Pulse::new(shared.door.limits);
    let mut app = App { shared, subscriptions: Vec::new(), tail: None, out: Vec::new(), told_ns: 0, pulse };
    // It fails when the app has gone, which is its business.
    let _ = app.talk(&mut socket).await;
    let _ = app.pulse.send(&mut socket, Message::Close(None)).await;
}

/// Time between two tellings of the time (ns): as often as a screen shows it.
const TELL_EVERY_NS: u64 = 20_000_000;

struct App<'a> {
    shared: &'a Shared,
    subscriptions: Vec<(u32, Topic)>,
    /// While something is subscribed to.
    tail: Option<Tail>,
    out: Vec<u8>,
    /// The time that was told last (ns since 1970).
    told_ns: u64,
    pulse: Pulse,
}

impl App<'_> {
    async fn talk(&mut self, socket: &mut WebSocket) -> io::Result<()> {
        self.pulse.send(socket, Message::text(protocol::server_info(&self.shared.session))).await?;
        self.pulse.send(socket, Message::text(protocol::advertise(&self.shared.topics))).await?;
        let mut alive = self.shared.taps.clone();
        loop {
            tokio::select! {
                heard = socket.next() => {
                    self.pulse.heard();
                    match heard {
                        Some(Ok(Message::Text(text))) => for warning in self.hear(&text) {
                            self.pulse.send(socket, Message::text(protocol::warning(&warning))).await?;
                        },
                        Some(Ok(Message::Close(_))) | None => return Ok(()),
                        Some(Err(error)) => return Err(io::Error::other(error)),
                        // Nothing that an app sends in bytes is for a server that offers nothing of the kind.
                        Some(Ok(Message::Binary(_) | Message::Ping(_) | Message::Pong(_) | Message::Frame(_))) => {}
                    }
                }
                beat = self.pulse.next() => match beat {
                    Beat::Ping => self.pulse.send(socket, Message::Ping(Vec::new().into())).await?,
                    Beat::Gone => return Ok(()),
                },
                next = next(&mut self.tail), if self.tail.is_some() => match next {
                    Next::Event(delivery) => self.send(socket, &delivery).await?,
                    Next::Quiet => {}
                    Next::End => return Ok(()),
                },
                () = alive.ended(), if self.tail.is_none() => return Ok(()),
            }
        }
    }

    /// Does what the app asks; gives warnings for whoever sits there.
    fn hear(&mut self, text: &str) -> Vec<String> {
        let mut warnings = Vec::new();
        match serde_json::from_str(text) {
            Ok(Asked::Subscribe { subscriptions }) => {
                warnings.extend(subscriptions.into_iter().filter_map(|asked| self.subscribe(asked).err()));
            }
            Ok(Asked::Unsubscribe { subscription_ids }) => {
                self.subscriptions.retain(|(id, _)| !subscription_ids.contains(id));
            }
            Ok(Asked::Other) => {}
            Err(error) => warnings.push(format!("a message was not understood: {error}")),
        }
        if self.subscriptions.is_empty() {
            self.tail = None;
        } else if self.tail.is_none() {
            self.tail = self.shared.taps.open("Foxglove", Keeps::Newest, None);
        }
        warnings
    }

    fn subscribe(&mut self, asked: Subscription) -> Result<(), String> {
        let topic =
            asked.topic(&self.shared.topics).ok_or_else(|| format!("there is no channel {}", asked.channel_id))?;
        if self.subscriptions.iter().any(|(id, known)| *id == asked.id || *known == topic) {
            return Err(format!("subscription {} to channel {} is there already", asked.id, asked.channel_id));
        }
        self.subscriptions.push((asked.id, topic));
        Ok(())
    }

    async fn send(&mut self, socket: &mut WebSocket, delivery: &Delivery) -> io::Result<()> {
        let Self { shared, subscriptions, tail: Some(tail), out, told_ns, pulse } = self else { return Ok(()) };
        let now_ns = delivery.event.frame.arrived.unix_ns;
        if now_ns.saturating_sub(*told_ns) >= TELL_EVERY_NS {
            *told_ns = now_ns;
            tail.wait_for(pulse.send(socket, Message::binary(protocol::time(now_ns)))).await?;
        }
        for (id, topic) in subscriptions {
            protocol::begin_data(*id, now_ns, out);
            if shared.topics.write(*topic, delivery, out)? {
                // Waits here while the app does not read; nobody else waits for it.
                tail.wait_for(pulse.send(socket, Message::binary(out.clone()))).await?;
            }
        }
        Ok(())
    }
}

/// The next event of a tail; nothing ever without one.
async fn next(tail: &mut Option<Tail>) -> Next {
    match tail {
        Some(tail) => tail.next().await,
        None => std::future::pending().await,
    }
}
