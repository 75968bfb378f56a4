//! The talk with a board: who are you, here are your settings and your scan plan, start.
//!
//! A [`Session`] is given what came and tells what to send. Input and output are in [`Session::transmit`] alone, which also sets the line's rate.

mod damage;
mod greet;
mod line;
mod pace;
mod rate;
mod requested;
mod timing;
mod wish;

use std::time::{Duration, Instant};

use tactomo_protocol::{Command, Fault, Hello, Output, Plan, Request, Settings};

use self::pace::Paces;
use self::rate::{KEEP_ALIVE, Rates};
use self::timing::Timing;
use self::wish::Wish;

pub use greet::{GreetError, explain, greet};
pub use line::send;
pub use rate::RATES;
pub use requested::{Refusal, RequestedSettings};
pub use wish::WishState;

/// Time between two askings for Hello.
const ASK_EVERY: Duration = Duration::from_millis(250);

/// A board that was started and sends no frame for this long is asked again.
const SILENCE: Duration = Duration::from_millis(1500);

/// Time between two sendings of a command that the board has not answered. It obeys between two rows of a scan, of which the longest (16 x 271
/// conversions of 40 us, 66 ms to settle, 16 x 10 ms to select) takes 0.4 s; but one that is just starting, or a flipped bit on the line, loses them.
const REPEAT_EVERY: Duration = Duration::from_millis(500);
/// How often it is sent before it counts as refused: 2.5 s, in which a board has started anew, too.
const TRIES: u32 = 5;

/// A started board that sends no frame for this long, and the time of its slowest frame, is [mute](Session::is_mute): by then it was asked
/// again twice, and a chip that had just restarted would have answered.
pub const MUTE_AFTER: Duration = Duration::from_secs(4);
/// No board takes longer for a conversion: the slowest, the ESP32-C3, takes about 40 us (docs/firmware.md).
const CONVERSION: Duration = Duration::from_micros(50);

/// What a [mute](Session::is_mute) board means and what to do, for people.
pub const MUTE: &str = "the board answers but sends no frames: its scan hangs, or the line loses long packets. Press the board's reset button; \
     if that does not help, try another cable or USB port, a lower baud rate on both sides, and flash the firmware again";

/// A command that was sent and is not answered yet.
#[derive(Debug)]
struct Pending {
    request: Request,
    /// How often it was sent.
    tries: u32,
    /// When it was sent last.
    sent: Instant,
}

/// The talk with one board, from the opening of its link on. One command at a time is on its way.
///
/// A board names the command that it answers, so an answer to an earlier one is known as such.
///
/// ```
/// use std::time::Instant;
///
/// use tactomo_board::session::{RequestedSettings, Session};
/// use tactomo_protocol::Command;
///
/// let mut session = Session::new(RequestedSettings::default());
/// // Of a board of which nothing is known yet, it is asked first who it is.
/// let request = session.command(Instant::now());
/// assert!(request.is_some_and(|request| request.command == Command::Hello));
/// ```
#[derive(Debug)]
pub struct Session {
    /// Tag of the last command.
    tag: u8,
    requested: RequestedSettings,
    /// Whether the board's settings are to be compared with those requested.
    settings_due: bool,
    /// Whether settings were sent of which nobody knows if they arrived.
    settings_in_doubt: bool,
    plan: Wish<Plan>,
    /// What the board sends; until it sends something else, what it does by itself.
    output: Wish<Output>,
    /// The rate of the line; `None` where it has none, or before it is open.
    rates: Option<Rates>,
    /// Whether Start is to be sent.
    start_due: bool,
    /// What the board said of itself last, in answer to what it was asked last.
    hello: Option<Hello>,
    pending: Option<Pending>,
    /// How soon a command is sent again that was answered and not followed.
    paces: Paces,
    /// The last answer to a command that was not sent, while nobody knows the board: its tag.
    stray: Option<u8>,
    /// Since when frames are expected and none came: since the first Start after the last frame.
    waiting_since: Option<Instant>,
    /// Whether the board was started.
    started: bool,
    /// When the board was last heard of, or asked.
    heard: Option<Instant>,
    refusal: Option<Refusal>,
    timing: Timing,
}

impl Session {
    /// The talk with a board of which nothing is known yet.
    pub fn new(requested: RequestedSettings) -> Self {
        Self {
            tag: 0,
            requested,
            settings_due: false,
            settings_in_doubt: false,
            plan: Wish::new(None),
            output: Wish::new(Some(Output::Frames)),
            rates: None,
            start_due: false,
            hello: None,
            pending: None,
            paces: Paces::default(),
            stray: None,
            waiting_since: None,
            started: false,
            heard: None,
            refusal: None,
            timing: Timing::new(Instant::now()),
        }
    }

    /// Asks the board for other settings, which may be while frames come; what is `None` stays as it is. A board that starts anew gets
    /// them again. What was asked for before and is not sent yet, or not answered, is sent along with it.
    pub fn request(&mut self, requested: RequestedSettings) {
        self.requested = self.requested.changed_by(requested);
        self.refusal = None;
        self.settings_due = self.hello.is_some();
        self.paces.restart(&Command::Configure(Settings::default()));
        self.give_way(|command| matches!(command, Command::Configure(_)));
    }

    /// Whether a board has said who it is, by itself or in answer to what it was asked.
    pub fn knows_the_board(&self) -> bool {
        self.hello.is_some()
    }

    /// Of a board that only answers what it was not asked, the command that it names, and the one that was sent.
    pub fn stray(&self) -> Option<(u8, u8)> {
        self.stray.filter(|_| self.hello.is_none()).map(|named| (named, self.tag))
    }

    /// The settings that the board did not take, if there are such since the last [request](Self::request).
    pub fn refusal(&self) -> Option<Refusal> {
        self.refusal
    }

    /// Waits no longer for the answer to a command of this kind, or to a question of a board that is known; returns whether a command was
    /// under way.
    fn give_way(&mut self, kind: impl Fn(&Command) -> bool) -> bool {
        let is_known = self.hello.is_some();
        let idle = |pending: &mut Pending| is_known && pending.request.command == Command::Hello;
        self.pending.take_if(idle);
        self.pending.take_if(|pending| kind(&pending.request.command)).is_some()
    }

    /// The command to send now, if any.
    pub fn command(&mut self, now: Instant) -> Option<Request> {
        let request = match &self.rates {
            Some(rates) if rates.is_changing() => self.question()?,
            _ => self.next_request(now)?,
        };
        self.heard = Some(now);
        self.rates.iter_mut().for_each(|rates| rates.sent(now));
        self.timing.asked(request.tag, now);
        Some(request)
    }

    /// What the trial of a rate asks next.
    fn question(&mut self) -> Option<Request> {
        let command = self.rates.as_ref()?.question()?;
        let tag = self.next_tag();
        self.rates.iter_mut().for_each(|rates| rates.asked(tag));
        Some(Request { tag, command })
    }

    fn next_tag(&mut self) -> u8 {
        self.tag = self.tag.checked_add(1).unwrap_or(1);
        self.tag
    }

    fn next_request(&mut self, now: Instant) -> Option<Request> {
        let is_raised = self.is_raised();
        if let Some(pending) = &mut self.pending {
            let is_question = pending.request.command == Command::Hello;
            let patience = match is_question {
                true if is_raised => KEEP_ALIVE,
                true if self.started => SILENCE,
                true => ASK_EVERY,
                false => REPEAT_EVERY,
            };
            if now.saturating_duration_since(pending.sent) < patience {
                return None;
            }
            if is_question || pending.tries < TRIES {
                pending.tries += 1;
                pending.sent = now;
                return Some(pending.request.clone());
            }
            self.unanswered();
        }
        let command = self.due(now)?;
        Some(self.ask(command, now))
    }

    /// What is to be sent to the board next.
    fn due(&mut self, now: Instant) -> Option<Command> {
        let keep_alive = self.rates.as_ref().is_some_and(|rates| rates.is_keep_alive_due(now));
        let clock = self.started && self.timing.is_due(now);
        let silence = (keep_alive || clock || self.is_silent(now)).then_some(Command::Hello);
        let Some(hello) = &self.hello else { return silence };
        let wanted = self.requested.over(hello.settings);
        let is_other = wanted != hello.settings || self.settings_in_doubt;
        self.settings_due &= is_other;
        let due = [
            self.rates.as_ref().and_then(Rates::due).map(|baud| Command::Rate { baud }),
            self.settings_due.then_some(Command::Configure(wanted)),
            self.plan.due().cloned().map(Command::Scan),
            self.output.due().copied().map(Command::Output),
            self.start_due.then_some(Command::Start),
        ];
        let due = due.into_iter().flatten().find(|command| self.paces.allow(command, now));
        due.or(silence)
    }

    /// Gives a command a tag, and waits for its answer.
    fn ask(&mut self, command: Command, now: Instant) -> Request {
        let tag = self.next_tag();
        self.settings_in_doubt |= matches!(command, Command::Configure(_));
        self.paces.sent(&command, now);
        if command == Command::Start {
            self.started = true;
            self.waiting_since.get_or_insert(now);
        }
        let request = Request { tag, command };
        self.pending = Some(Pending { request: request.clone(), tries: 1, sent: now });
        request
    }

    fn is_silent(&self, now: Instant) -> bool {
        let patience = if self.started { SILENCE } else { ASK_EVERY };
        self.heard.is_none_or(|heard| now.saturating_duration_since(heard) >= patience)
    }

    /// Takes a Hello: an answer, an old one, or that of a board that has started anew and has to be sent everything again.
    pub fn hello(&mut self, hello: &Hello, now: Instant) {
        self.whole(now);
        if hello.answers == 0 {
            self.rates.iter_mut().for_each(Rates::board_has_started);
            return self.board_has_started(hello, now);
        }
        if self.rates.as_mut().is_some_and(|rates| rates.answered(hello.answers)) {
            return;
        }
        let is_answer = |pending: &mut Pending| pending.request.tag == hello.answers;
        let Some(answered) = self.pending.take_if(is_answer) else {
            self.stray = Some(hello.answers);
            return;
        };
        self.heard = Some(now);
        if let (Command::Rate { baud }, Some(rates)) = (&answered.request.command, &mut self.rates) {
            rates.taken(*baud);
        }
        let is_first = self.hello.replace(hello.clone()).is_none();
        if !is_first && !self.start_due && !hello.is_streaming {
            // It was started, and does not stream: it has started anew, and its Hello was lost.
            return self.board_has_started(hello, now);
        }
        self.settings_due = true;
        self.answered(answered.request.command, is_first, hello, now);
    }

    /// Takes the answer to a command.
    fn answered(&mut self, command: Command, is_first: bool, hello: &Hello, now: Instant) {
        let is_followed = match &command {
            Command::Start | Command::Stop => hello.is_streaming,
            Command::Configure(wanted) => *wanted == hello.settings,
            Command::Hello | Command::Scan(_) | Command::Rate { .. } | Command::Output(_) | Command::Table(_) => true,
        };
        if is_followed {
            self.paces.restart(&command);
        }
        match command {
            Command::Hello if is_first => self.greeted(hello, now),
            Command::Hello => {}
            Command::Start | Command::Stop => self.start_due = !is_followed,
            Command::Configure(_) if is_followed => self.settings_in_doubt = false,
            Command::Configure(wanted) => self.refused(wanted, true),
            Command::Scan(plan) => self.plan.set_in_force(Some(plan)),
            Command::Output(output) => self.output.set_in_force(Some(output)),
            Command::Rate { .. } | Command::Table(_) => {}
        }
    }

    /// The first answer of a board that may have been talked to before.
    fn greeted(&mut self, hello: &Hello, now: Instant) {
        self.start_due = !hello.is_streaming;
        self.plan.set_in_force(None);
        if hello.is_streaming {
            self.started = true;
            self.waiting_since.get_or_insert(now);
        }
    }

    /// The board knows nothing any more of what it was sent, but for a command that came after its start and before its Hello was heard here.
    fn board_has_started(&mut self, hello: &Hello, now: Instant) {
        self.heard = Some(now);
        self.pending = None;
        self.timing.restart();
        (self.settings_due, self.start_due) = (true, true);
        self.plan.set_in_force(None);
        self.output.set_in_force(Some(Output::Frames));
        self.hello = Some(hello.clone());
    }

    /// Takes note of a fault that the board reports; returns whether it was an answer, and no news for people.
    pub fn fault(&mut self, fault: &Fault) -> bool {
        match *fault {
            Fault::BadSettings { answers } if self.is_answer(answers) => {}
            Fault::BadPlan { answers } | Fault::BadRate { answers } | Fault::NoTable { answers }
                if self.is_answer(answers) => {}
            _ => return false,
        }
        match self.pending.take().map(|pending| pending.request.command) {
            Some(Command::Configure(wanted)) => self.refused(wanted, true),
            Some(Command::Scan(_)) => self.plan_refused("does not take"),
            Some(Command::Output(_)) => self.output.refused(),
            Some(Command::Rate { .. }) => self.rates.iter_mut().for_each(Rates::refused),
            _ => return false,
        }
        true
    }

    /// Whether what names this tag answers the command that is on its way.
    fn is_answer(&self, answers: u8) -> bool {
        self.pending.as_ref().is_some_and(|pending| pending.request.tag == answers)
    }

    /// Gives up the command that is on its way. A board that cannot be started is [mute](Self::is_mute).
    fn unanswered(&mut self) {
        match self.pending.take().map(|pending| pending.request.command) {
            Some(Command::Configure(wanted)) => self.refused(wanted, false),
            // Whole frames nobody has asked for; the frames themselves say what they are.
            Some(Command::Scan(plan)) if plan.is_whole() => self.plan.set_in_force(Some(plan)),
            Some(Command::Scan(_)) => self.plan_refused("did not confirm"),
            Some(Command::Output(_)) => self.output.refused(),
            Some(Command::Rate { .. }) => self.rates.iter_mut().for_each(Rates::refused),
            _ => self.start_due = false,
        }
    }

    /// Gives up the settings that were asked for; the board goes on with those that it has.
    fn refused(&mut self, wanted: Settings, is_said: bool) {
        if let Some(hello) = &self.hello {
            let refusal = Refusal { wanted, kept: hello.settings, is_said };
            tracing::warn!("{refusal}");
            self.refusal = Some(refusal);
        }
        self.requested = RequestedSettings::default();
        (self.settings_due, self.settings_in_doubt) = (false, false);
    }

    /// Whether the board answers and sends no frames, although it was started, and asked again.
    pub fn is_mute(&self, now: Instant) -> bool {
        let slowest = self.hello.as_ref().map(|hello| slowest_frame(hello, self.plan.in_force()));
        let patience = MUTE_AFTER + slowest.unwrap_or_default();
        self.waiting_since.is_some_and(|since| now.saturating_duration_since(since) >= patience)
    }
}

/// Longest that a board takes for a frame with its settings and its plan.
fn slowest_frame(hello: &Hello, plan: Option<&Plan>) -> Duration {
    let (electrodes, settings) = (u32::from(hello.electrodes), hello.settings);
    let (rows, average_log2) = match plan.filter(|plan| !plan.is_whole()) {
        Some(plan) => (u32::from(plan.rows_a_frame), plan.average_log2),
        None => (electrodes, settings.average_log2),
    };
    let conversions = (rows * electrodes) << average_log2.min(Settings::MAX_AVERAGE_LOG2);
    let discarded = rows * electrodes * u32::from(settings.discarded);
    let settling = u64::from(settings.settle_us) + u64::from(electrodes) * u64::from(settings.select_us);
    let scan = CONVERSION * (conversions + discarded) + Duration::from_micros(settling) * rows;
    let period = match settings.max_frames_per_s {
        0 => Duration::ZERO,
        rate => Duration::from_secs(1) / u32::from(rate),
    };
    scan.max(period)
}

#[cfg(test)]
mod tests;
