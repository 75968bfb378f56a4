//! Any order of what a board may say.

use proptest::prelude::*;

use super::*;

fn hello(settings: Settings) -> Hello {
    Hello { settings, ..Hello::example(16) }
}

fn settle(settle_us: u16) -> RequestedSettings {
    RequestedSettings { settle_us: Some(settle_us), ..RequestedSettings::default() }
}

fn with_settle(settle_us: u16) -> Settings {
    Settings { settle_us, ..Settings::default() }
}

#[test]
fn hello_is_asked_for_until_it_comes_and_then_the_board_is_started() {
    let begin = Instant::now();
    let mut session = Session::new(RequestedSettings::default());
    assert_eq!(session.command(begin), Some(Command::Hello));
    assert_eq!(session.command(begin), None);
    let later = begin + ASK_EVERY;
    assert_eq!(session.command(later), Some(Command::Hello));
    session.hello(&hello(Settings::default()), later);
    assert_eq!(session.command(later), Some(Command::Start));
    assert_eq!(session.command(later + ASK_EVERY), None, "frames may take their time");
    assert_eq!(session.command(later + SILENCE), Some(Command::Hello), "a silent board is asked again");
}

#[test]
fn settings_are_sent_and_an_old_hello_is_no_refusal() {
    let now = Instant::now();
    let mut session = Session::new(settle(70));
    session.hello(&hello(Settings::default()), now);
    assert_eq!(session.command(now), Some(Command::Configure(with_settle(70))));
    session.hello(&hello(Settings::default()), now); // The answer to a question that was asked before.
    assert_eq!(session.command(now), None, "they are on their way");
    session.hello(&hello(with_settle(70)), now);
    assert_eq!(session.command(now), Some(Command::Start));
    assert_eq!(session.refusal(), None);
}

#[test]
fn settings_that_the_board_calls_bad_or_never_confirms_are_refused_in_plain_words() {
    let now = Instant::now();
    let mut session = Session::new(settle(70));
    session.hello(&hello(Settings::default()), now);
    session.command(now);
    session.fault(&Fault::BadSettings);
    assert_eq!(session.command(now), Some(Command::Start), "the board goes on as it is");
    let refusal = session.refusal().unwrap().to_string();
    assert_eq!(refusal, "the board keeps a settle time of 20 us instead of 70 us");
    session.hello(&hello(Settings::default()), now);
    assert_eq!(session.command(now), Some(Command::Start), "what is refused is not asked for again");

    let mut session = Session::new(settle(70));
    session.hello(&hello(Settings::default()), now);
    let mut sent = 0;
    let started = (0..100).map(|step| now + CONFIGURE_EVERY * step / 4).find(|at| match session.command(*at) {
        Some(Command::Configure(_)) => {
            sent += 1;
            session.hello(&hello(Settings::default()), *at);
            false
        }
        command => command == Some(Command::Start),
    });
    assert_eq!((sent, started), (CONFIGURE_TRIES, Some(now + CONFIGURE_EVERY * CONFIGURE_TRIES)));
    assert!(session.refusal().is_some());
}

#[test]
fn every_setting_that_is_refused_is_named() {
    let wanted = Settings { settle_us: 70, average_log2: 3, max_frames_per_s: 100 };
    let refusal = Refusal { wanted, kept: Settings::default() }.to_string();
    assert_eq!(
        refusal,
        "the board keeps a settle time of 20 us instead of 70 us, and an average over 1 instead of 8 conversions, and as many \
         frames a second as it can instead of at most 100 frames a second"
    );
}

#[test]
fn settings_change_while_frames_come_and_a_board_that_restarts_gets_them_again() {
    let now = Instant::now();
    let mut session = Session::new(RequestedSettings::default());
    session.hello(&hello(Settings::default()), now);
    session.command(now);
    session.frame(now);
    session.request(settle(50));
    assert_eq!(session.command(now), Some(Command::Configure(with_settle(50))));
    session.frame(now);
    assert_eq!(session.command(now), None, "frames go on");
    session.hello(&hello(with_settle(50)), now);
    assert_eq!(session.command(now), Some(Command::Start), "which does nothing to a board that is started");
    session.request(settle(50));
    assert_eq!(session.command(now), None, "it has them");
    session.hello(&hello(Settings::default()), now);
    assert_eq!(session.command(now), Some(Command::Configure(with_settle(50))), "it has started anew");
    session.hello(&hello(with_settle(50)), now);
    assert_eq!(session.command(now), Some(Command::Start));
}

#[test]
fn a_board_that_says_hello_by_itself_is_started_again() {
    let now = Instant::now();
    let mut session = Session::new(RequestedSettings::default());
    session.hello(&hello(Settings::default()), now);
    session.command(now);
    session.frame(now);
    assert_eq!(session.command(now + SILENCE / 2), None);
    session.hello(&hello(Settings::default()), now);
    assert_eq!(session.command(now), Some(Command::Start));
}

#[test]
fn a_board_that_answers_and_sends_no_frames_is_mute_until_one_comes() {
    let begin = Instant::now();
    let mut session = Session::new(RequestedSettings::default());
    session.hello(&hello(Settings::default()), begin);
    session.command(begin);
    let (mut asked, mut now) = (0, begin);
    while !session.is_mute(now) {
        if session.command(now) == Some(Command::Hello) {
            asked += 1;
            session.hello(&hello(Settings::default()), now);
        }
        now += Duration::from_millis(10);
    }
    let waited = now - begin;
    assert!(
        asked >= 2 && waited >= MUTE_AFTER && waited < MUTE_AFTER + Duration::from_millis(100),
        "{asked} {waited:?}"
    );
    session.frame(now);
    assert!(!session.is_mute(now + 2 * MUTE_AFTER), "silence after frames is another thing: the frame rate says so");
}

#[test]
fn slow_scans_are_waited_for() {
    let begin = Instant::now();
    let mut session = Session::new(RequestedSettings::default());
    session.hello(&hello(Settings { average_log2: 8, settle_us: u16::MAX, max_frames_per_s: 0 }), begin);
    session.command(begin);
    // 65536 conversions of 50 us and 16 settle times of 65.5 ms: 4.3 s.
    assert!(!session.is_mute(begin + Duration::from_secs(8)) && session.is_mute(begin + Duration::from_secs(9)));
}

/// A board that obeys, or does not, and whose messages come in the order of a line, late.
#[derive(Default)]
struct Board {
    settings: Settings,
    streaming: bool,
    /// Messages on their way, and when they arrive (steps).
    line: std::collections::VecDeque<(u64, Hello)>,
}

impl Board {
    fn say_hello(&mut self, at: u64) {
        // What was sent earlier arrives earlier.
        let at = self.line.back().map_or(at, |last| at.max(last.0));
        self.line.push_back((at, hello(self.settings)));
    }

    fn obey(&mut self, command: Command, at: u64) {
        match command {
            Command::Hello => self.say_hello(at),
            Command::Configure(settings) => {
                self.settings = settings;
                self.say_hello(at);
            }
            Command::Start => self.streaming = true,
            Command::Stop => self.streaming = false,
        }
    }
}

/// What happens to the board or is asked of the session, in a step.
#[derive(Clone, Debug)]
enum Event {
    Nothing,
    /// The board says Hello by itself.
    Hello,
    /// It starts anew.
    Restart,
    /// It loses the next command.
    Deaf,
    Request(RequestedSettings),
}

fn any_request() -> impl Strategy<Value = RequestedSettings> {
    (prop::option::of(20..25u16), prop::option::of(0..4u8), prop::option::of(100..103u16)).prop_map(
        |(settle_us, average_log2, max_frames_per_s)| RequestedSettings { settle_us, average_log2, max_frames_per_s },
    )
}

fn any_event() -> impl Strategy<Value = Event> {
    prop_oneof![
        6 => Just(Event::Nothing),
        2 => Just(Event::Hello),
        1 => Just(Event::Restart),
        1 => Just(Event::Deaf),
        1 => any_request().prop_map(Event::Request),
    ]
}

proptest! {
    /// Steps of 20 ms; after the events, four seconds in which nothing more happens.
    #[test]
    fn whatever_order_hellos_come_in_the_settings_are_those_asked_for_last_and_nobody_cries_wolf(
        first in any_request(),
        events in prop::collection::vec(any_event(), 0..60),
        delays in prop::collection::vec(0..12u64, 300),
    ) {
        let begin = Instant::now();
        let (mut session, mut board, mut wanted) = (Session::new(first), Board::default(), first);
        board.say_hello(0);
        let mut deaf = false;
        for step in 0..260u64 {
            let now = begin + Duration::from_millis(20 * step);
            match events.get(step as usize).unwrap_or(&Event::Nothing) {
                Event::Nothing => {}
                Event::Hello => board.say_hello(step + delays[step as usize]),
                Event::Restart => {
                    board = Board { line: std::mem::take(&mut board.line), ..Board::default() };
                    board.say_hello(step + delays[step as usize]);
                }
                Event::Deaf => deaf = true,
                Event::Request(request) => {
                    session.request(*request);
                    wanted = wanted.changed_by(*request);
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
        prop_assert_eq!(board.settings, wanted.over(board.settings));
        prop_assert!(board.streaming);
        let now = begin + Duration::from_millis(20 * 260);
        prop_assert!(!session.is_mute(now));
    }
}
