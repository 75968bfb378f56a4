//! Any order of what a board may say, in all versions of the protocol.

use std::collections::VecDeque;

use proptest::prelude::*;

use super::*;

/// A board that obeys, or does not, and whose messages come in the order of a line, late.
struct Board {
    version: u8,
    settings: Settings,
    plan: Plan,
    streaming: bool,
    /// Messages on their way, and when they arrive (steps).
    line: VecDeque<(u64, Hello)>,
}

impl Board {
    fn new(version: u8) -> Self {
        let (settings, plan) = (Settings::default(), Plan::default());
        Self { version, settings, plan, streaming: false, line: VecDeque::new() }
    }

    fn restart(&mut self) {
        *self = Self { line: std::mem::take(&mut self.line), ..Self::new(self.version) };
    }

    fn say_hello(&mut self, answers: u8, at: u64) {
        // What was sent earlier arrives earlier.
        let at = self.line.back().map_or(at, |last| at.max(last.0));
        let message = match self.version {
            1 => old_hello(self.settings),
            2 => Hello { version: 2, ..hello(answers, self.settings, self.streaming) },
            _ => hello(answers, self.settings, self.streaming),
        };
        self.line.push_back((at, message));
    }

    fn obey(&mut self, Outgoing { version, request }: Outgoing, at: u64) {
        if version != self.version {
            return self.say_hello(0, at); // Only to a board of an older version, and as good as the fault.
        }
        let has_answer = version != 1 || matches!(request.command, Command::Hello | Command::Configure(_));
        match request.command {
            Command::Hello => {}
            Command::Configure(settings) => self.settings = settings,
            Command::Scan(plan) => self.plan = plan,
            Command::Start => self.streaming = true,
            Command::Stop => self.streaming = false,
        }
        if has_answer {
            self.say_hello(request.tag, at);
        }
    }
}

/// What happens to the board or is asked of the session, in a step.
#[derive(Clone, Debug)]
enum Event {
    Nothing,
    /// A board of version 1 says Hello once more.
    Hello,
    /// It starts anew.
    Restart,
    /// It loses the next command.
    Deaf,
    /// What it said last is lost.
    Dumb,
    Request(RequestedSettings),
    Plan(bool),
}

fn any_request() -> impl Strategy<Value = RequestedSettings> {
    let scan = (prop::option::of(20..25u16), prop::option::of(0..4u8), prop::option::of(100..103u16));
    (scan, prop::option::of(0..3u16), prop::option::of(0..2u8)).prop_map(|(scan, select_us, discarded)| {
        let (settle_us, average_log2, max_frames_per_s) = scan;
        RequestedSettings { settle_us, average_log2, max_frames_per_s, select_us, discarded }
    })
}

fn any_event() -> impl Strategy<Value = Event> {
    prop_oneof![
        8 => Just(Event::Nothing),
        1 => Just(Event::Hello),
        1 => Just(Event::Restart),
        1 => Just(Event::Deaf),
        1 => Just(Event::Dumb),
        1 => any_request().prop_map(Event::Request),
        1 => any::<bool>().prop_map(Event::Plan),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(1000))]

    /// Steps of 20 ms; after the events, eight seconds in which nothing more happens.
    #[test]
    fn whatever_order_hellos_come_in_the_board_does_what_was_asked_for_last_and_nobody_cries_wolf(
        version in 1..=3u8,
        first in any_request(),
        events in prop::collection::vec(any_event(), 0..60),
        delays in prop::collection::vec(0..12u64, 500),
    ) {
        let begin = Instant::now();
        let (mut session, mut board, mut wanted) = (Session::new(first), Board::new(version), first);
        let mut plan = Plan::default();
        board.say_hello(0, 0);
        let mut deaf = false;
        for step in 0..460u64 {
            let now = begin + Duration::from_millis(20 * step);
            match events.get(step as usize).unwrap_or(&Event::Nothing) {
                Event::Hello if version == 1 => board.say_hello(0, step + delays[step as usize]),
                Event::Nothing | Event::Hello => {}
                Event::Restart => {
                    board.restart();
                    board.say_hello(0, step + delays[step as usize]);
                }
                Event::Deaf => deaf = true,
                // A board of version 1 that loses the Hello of its start may go unnoticed as long as settings are confirmed.
                Event::Dumb if version == 1 => {}
                // Nor may one of version 2, as long as its settings are those that it starts with: its plan is not in its Hello.
                Event::Dumb => {
                    if let Some(answer) = board.line.pop_back_if(|(_, hello)| hello.answers != 0) {
                        drop(answer);
                    }
                }
                Event::Request(request) => {
                    session.request(*request);
                    wanted = wanted.changed_by(*request);
                }
                Event::Plan(rows) => {
                    plan = if *rows { four_rows() } else { Plan::default() };
                    session.request_plan(Some(plan.clone()));
                }
            }
            while board.line.front().is_some_and(|(at, _)| *at <= step) {
                let (_, hello) = board.line.pop_front().unwrap();
                session.hello(&hello, now);
            }
            if let Some(command) = session.command(now) && !std::mem::take(&mut deaf) {
                board.obey(command, step + delays[step as usize]);
            }
            if board.streaming {
                session.frame(now);
            }
            prop_assert_eq!(session.refusal(), None, "step {}", step);
        }
        prop_assert_eq!(board.settings, wanted.in_version(version).over(board.settings));
        prop_assert!(board.streaming);
        let expected = if version == 1 && !plan.is_whole() { PlanState::Refused } else { PlanState::InForce };
        prop_assert_eq!(session.plan_state(), expected);
        prop_assert_eq!(board.plan, if version == 1 { Plan::default() } else { plan });
        let now = begin + Duration::from_millis(20 * 460);
        prop_assert!(!session.is_mute(now));
    }
}
