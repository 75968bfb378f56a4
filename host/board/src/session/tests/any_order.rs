//! Any order of what a board may say.

use std::collections::VecDeque;

use proptest::prelude::*;

use super::*;

/// A board that obeys, or does not, and whose messages come in the order of a line, late.
struct Board {
    settings: Settings,
    plan: Plan,
    output: Output,
    streaming: bool,
    /// Messages on their way, and when they arrive (steps).
    line: VecDeque<(u64, Hello)>,
}

impl Board {
    fn new() -> Self {
        let (settings, plan) = (Settings::default(), Plan::default());
        Self { settings, plan, output: Output::Frames, streaming: false, line: VecDeque::new() }
    }

    fn restart(&mut self) {
        *self = Self { line: std::mem::take(&mut self.line), ..Self::new() };
    }

    fn say_hello(&mut self, answers: u8, at: u64) {
        // What was sent earlier arrives earlier.
        let at = self.line.back().map_or(at, |last| at.max(last.0));
        self.line.push_back((at, hello(answers, self.settings, self.streaming)));
    }

    fn obey(&mut self, request: Request, at: u64) {
        match request.command {
            Command::Hello | Command::Rate { .. } | Command::Table(_) => {}
            Command::Configure(settings) => self.settings = settings,
            Command::Scan(plan) => self.plan = plan,
            Command::Output(output) => self.output = output,
            Command::Start => self.streaming = true,
            Command::Stop => self.streaming = false,
        }
        self.say_hello(request.tag, at);
    }
}

/// What happens to the board or is asked of the session, in a step.
#[derive(Clone, Debug)]
enum Event {
    Nothing,
    /// It starts anew.
    Restart,
    /// It loses the next command.
    Deaf,
    /// What it said last is lost.
    Dumb,
    Request(RequestedSettings),
    Plan(bool),
    Output(Output),
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
        1 => Just(Event::Restart),
        1 => Just(Event::Deaf),
        1 => Just(Event::Dumb),
        1 => any_request().prop_map(Event::Request),
        1 => any::<bool>().prop_map(Event::Plan),
        1 => prop_oneof![Just(Output::Frames), Just(Output::Contacts), Just(Output::Both)].prop_map(Event::Output),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(1000))]

    /// Steps of 20 ms; after the events, eight seconds in which nothing more happens.
    #[test]
    fn whatever_order_hellos_come_in_the_board_does_what_was_asked_for_last_and_nobody_cries_wolf(
        first in any_request(),
        events in prop::collection::vec(any_event(), 0..60),
        delays in prop::collection::vec(0..12u64, 500),
    ) {
        let begin = Instant::now();
        let (mut session, mut board, mut wanted) = (Session::new(first), Board::new(), first);
        let (mut plan, mut output) = (Plan::default(), Output::Frames);
        board.say_hello(0, 0);
        let mut deaf = false;
        for step in 0..460u64 {
            let now = begin + Duration::from_millis(20 * step);
            match events.get(step as usize).unwrap_or(&Event::Nothing) {
                Event::Nothing => {}
                Event::Restart => {
                    board.restart();
                    board.say_hello(0, step + delays[step as usize]);
                }
                Event::Deaf => deaf = true,
                // The Hello of a start is never lost: a restart would go unnoticed as long as the settings are those that the board starts
                // with, since its plan is not in its Hello.
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
                Event::Output(other) => {
                    output = *other;
                    session.request_output(output);
                }
            }
            while board.line.front().is_some_and(|(at, _)| *at <= step) {
                let (_, hello) = board.line.pop_front().unwrap();
                session.hello(&hello, now);
            }
            if let Some(command) = session.command(now) && !std::mem::take(&mut deaf) {
                board.obey(command, step + delays[step as usize]);
            }
            if board.streaming && board.output.has_contacts() {
                session.contacts(now);
            }
            if board.streaming && board.output.has_frames() {
                session.frame(now);
            }
            prop_assert_eq!(session.refusal(), None, "step {}", step);
        }
        prop_assert_eq!(board.settings, wanted.over(board.settings));
        prop_assert!(board.streaming);
        prop_assert_eq!(session.plan_state(), WishState::InForce);
        prop_assert_eq!(board.plan, plan);
        prop_assert_eq!((board.output, session.output_state()), (output, WishState::InForce));
        let now = begin + Duration::from_millis(20 * 460);
        prop_assert!(!session.is_mute(now));
    }
}
