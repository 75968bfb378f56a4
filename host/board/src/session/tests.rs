//! What boards say, and what the session says to that.

mod any_order;
mod rates;

use super::*;

fn settle(settle_us: u16) -> RequestedSettings {
    RequestedSettings { settle_us: Some(settle_us), ..RequestedSettings::default() }
}

fn with_settle(settle_us: u16) -> Settings {
    Settings { settle_us, ..Settings::default() }
}

/// A Hello that answers the command with this tag; 0 for that of a board's start.
fn hello(answers: u8, settings: Settings, is_streaming: bool) -> Hello {
    Hello { answers, settings, is_streaming, ..Hello::example(16) }
}

fn four_rows() -> Plan {
    Plan { grounds: [0, 5, 10, 15].into_iter().collect(), reads: 0xFFFF, rows_a_frame: 4, average_log2: 0 }
}

/// What the session says now, and its tag.
fn said(session: &mut Session, now: Instant) -> Option<(u8, Command)> {
    session.command(now).map(|request| (request.tag, request.command))
}

fn command(session: &mut Session, now: Instant) -> Option<Command> {
    said(session, now).map(|(_, command)| command)
}

/// A session with a board that has just started, was sent its settings, and streams.
fn streaming(requested: RequestedSettings, now: Instant) -> Session {
    let mut session = Session::new(requested);
    session.hello(&hello(0, Settings::default(), false), now);
    let mut settings = Settings::default();
    while let Some((tag, command)) = said(&mut session, now) {
        if let Command::Configure(wanted) = command {
            settings = wanted;
        }
        session.hello(&hello(tag, settings, command == Command::Start), now);
    }
    session.frame(now);
    session
}

#[test]
fn hello_is_asked_for_until_it_comes_and_then_the_board_is_started() {
    let begin = Instant::now();
    let mut session = Session::new(RequestedSettings::default());
    assert_eq!(said(&mut session, begin), Some((1, Command::Hello)));
    assert_eq!(said(&mut session, begin), None);
    let later = begin + ASK_EVERY;
    assert_eq!(said(&mut session, later), Some((1, Command::Hello)), "the same question");
    session.hello(&hello(1, Settings::default(), false), later);
    assert_eq!(
        said(&mut session, later),
        Some((2, Command::Scan(Plan::default()))),
        "an earlier host may have asked for any"
    );
    assert_eq!(said(&mut session, later), None);
    session.hello(&hello(2, Settings::default(), false), later);
    assert_eq!(said(&mut session, later), Some((3, Command::Start)));
    assert_eq!(said(&mut session, later + REPEAT_EVERY), Some((3, Command::Start)), "it was not answered");
    session.hello(&hello(3, Settings::default(), true), later + REPEAT_EVERY);
    assert_eq!(command(&mut session, later + REPEAT_EVERY + ASK_EVERY), None, "frames may take their time");
    assert_eq!(
        command(&mut session, later + REPEAT_EVERY + SILENCE),
        Some(Command::Hello),
        "a silent board is asked again"
    );
}

#[test]
fn two_hellos_in_one_read_are_one_board() {
    let now = Instant::now();
    let mut session = Session::new(settle(70));
    assert_eq!(said(&mut session, now), Some((1, Command::Hello)));
    session.hello(&hello(0, Settings::default(), false), now);
    session.hello(&hello(1, Settings::default(), false), now);
    assert_eq!(said(&mut session, now), Some((2, Command::Configure(with_settle(70)))));
    session.hello(&hello(1, Settings::default(), false), now);
    assert_eq!(said(&mut session, now), None, "an earlier question's answer says nothing of the settings");
    session.hello(&hello(2, with_settle(70), false), now);
    assert_eq!(said(&mut session, now), Some((3, Command::Scan(Plan::default()))));
    assert_eq!(session.refusal(), None);
}

#[test]
fn only_the_answer_to_our_settings_refuses_them() {
    let now = Instant::now();
    let mut session = Session::new(settle(70));
    session.hello(&hello(0, Settings::default(), false), now);
    let (tag, _) = said(&mut session, now).unwrap();
    assert!(!session.fault(&Fault::BadSettings { answers: tag + 1 }), "another host's");
    assert!(!session.fault(&Fault::BadPlan { answers: tag + 1 }));
    assert_eq!((said(&mut session, now), session.refusal()), (None, None));
    assert!(session.fault(&Fault::BadSettings { answers: tag }));
    let whole = Some(Command::Scan(Plan::default()));
    assert_eq!(command(&mut session, now), whole, "the board goes on as it is");
    let refusal = session.refusal().unwrap().to_string();
    assert_eq!(refusal, "the board keeps a settle time of 20 us instead of 70 us");
    session.hello(&hello(0, Settings::default(), false), now);
    assert_eq!(command(&mut session, now), whole, "what is refused is not asked for again");
}

#[test]
fn settings_that_are_never_answered_are_given_up_with_one_word() {
    let now = Instant::now();
    let mut session = Session::new(settle(70));
    session.hello(&hello(0, Settings::default(), false), now);
    let (mut tags, mut at) = (Vec::new(), now);
    let next = loop {
        match said(&mut session, at) {
            Some((tag, Command::Configure(_))) => tags.push(tag),
            Some((_, command)) => break command,
            None => at += REPEAT_EVERY / 4,
        }
    };
    assert_eq!((tags, next, at), (vec![1; TRIES as usize], Command::Scan(Plan::default()), now + REPEAT_EVERY * TRIES));
    let refusal = session.refusal().unwrap().to_string();
    assert_eq!(refusal, "the board did not confirm its settings, and may keep a settle time of 20 us instead of 70 us");
}

#[test]
fn changes_in_a_row_are_sent_as_one_and_none_is_lost() {
    let now = Instant::now();
    let mut session = streaming(RequestedSettings::default(), now);
    session.request(settle(50));
    session.request(RequestedSettings { average_log2: Some(2), ..RequestedSettings::default() });
    let both = Settings { average_log2: 2, ..with_settle(50) };
    let (tag, sent) = said(&mut session, now).unwrap();
    assert_eq!((sent, said(&mut session, now)), (Command::Configure(both), None));
    // A third one while these are on their way, and back again: the board may have taken either.
    session.request(settle(60));
    let (second, sent) = said(&mut session, now).unwrap();
    assert_eq!(sent, Command::Configure(Settings { settle_us: 60, ..both }));
    session.request(RequestedSettings { settle_us: Some(20), average_log2: Some(0), ..RequestedSettings::default() });
    let (third, sent) = said(&mut session, now).unwrap();
    assert_eq!(sent, Command::Configure(Settings::default()), "though the board had it when it was last heard");
    session.hello(&hello(tag, both, true), now);
    session.hello(&hello(second, both, true), now);
    assert_eq!(said(&mut session, now), None);
    session.hello(&hello(third, Settings::default(), true), now);
    assert_eq!((said(&mut session, now), session.refusal()), (None, None));
}

#[test]
fn a_board_that_restarts_gets_everything_again() {
    let now = Instant::now();
    let mut session = streaming(settle(50), now);
    session.request_plan(Some(four_rows()));
    let (tag, _) = said(&mut session, now).unwrap();
    session.hello(&hello(tag, with_settle(50), true), now);
    assert_eq!((session.plan_state(), said(&mut session, now)), (WishState::InForce, None));
    // It says so, or only answers a question in a way that shows it.
    for answers in [0, 1] {
        let mut at = now;
        let mut answers = answers;
        if answers == 1 {
            at = now + SILENCE;
            let (tag, question) = said(&mut session, at).unwrap();
            assert_eq!(question, Command::Hello);
            answers = tag;
        }
        session.hello(&hello(answers, Settings::default(), false), at);
        assert_eq!(session.plan_state(), WishState::Pending);
        let expected = [Command::Configure(with_settle(50)), Command::Scan(four_rows()), Command::Start];
        for expected in expected {
            let (tag, command) = said(&mut session, at).unwrap();
            assert_eq!(command, expected);
            session.hello(&hello(tag, with_settle(50), command == Command::Start), at);
        }
        assert_eq!(session.plan_state(), WishState::InForce);
    }
}

#[test]
fn a_plan_is_taken_or_refused_or_never_answered() {
    let now = Instant::now();
    let mut session = streaming(RequestedSettings::default(), now);
    assert_eq!(session.plan_state(), WishState::InForce, "whole frames");
    session.request_plan(Some(four_rows()));
    assert_eq!(session.plan_state(), WishState::Pending);
    let (tag, command) = said(&mut session, now).unwrap();
    assert_eq!(command, Command::Scan(four_rows()));
    assert!(!session.fault(&Fault::BadPlan { answers: tag + 1 }) && session.fault(&Fault::BadPlan { answers: tag }));
    assert_eq!((session.plan_state(), said(&mut session, now)), (WishState::Refused, None));
    // One whose answer is lost may be in force, so whole frames have to be asked for.
    session.request_plan(Some(four_rows()));
    said(&mut session, now).unwrap();
    session.request_plan(None);
    let (tag, command) = said(&mut session, now).unwrap();
    assert_eq!(command, Command::Scan(Plan::default()));
    session.hello(&hello(tag, Settings::default(), true), now);
    assert_eq!((session.plan_state(), said(&mut session, now)), (WishState::InForce, None));
    // One that is never answered.
    session.request_plan(Some(four_rows()));
    let steps = (0..100).map(|step| now + REPEAT_EVERY * step / 4);
    let sent = steps.filter(|at| self::command(&mut session, *at) == Some(Command::Scan(four_rows()))).count();
    assert_eq!((sent, session.plan_state()), (TRIES as usize, WishState::Refused));
}

#[test]
fn contacts_are_asked_for_and_a_board_that_another_host_has_left_sending_them_is_asked_for_frames() {
    let now = Instant::now();
    let mut session = streaming(RequestedSettings::default(), now);
    assert_eq!(
        (session.output_state(), said(&mut session, now)),
        (WishState::InForce, None),
        "nothing is said of frames"
    );
    session.contacts(now);
    let (tag, command) = said(&mut session, now).unwrap();
    assert_eq!(command, Command::Output(Output::Frames));
    session.hello(&hello(tag, Settings::default(), true), now);
    session.frame(now);
    assert_eq!((session.output_state(), said(&mut session, now)), (WishState::InForce, None));
    // The same once more begins contacts anew.
    session.renew_output();
    let (tag, command) = said(&mut session, now).unwrap();
    assert_eq!(command, Command::Output(Output::Frames));
    session.hello(&hello(tag, Settings::default(), true), now);
    assert_eq!((session.output_state(), said(&mut session, now)), (WishState::InForce, None));
    session.request_output(Output::Contacts);
    let (tag, command) = said(&mut session, now).unwrap();
    assert_eq!((command, session.output_state()), (Command::Output(Output::Contacts), WishState::Pending));
    assert!(session.fault(&Fault::NoTable { answers: tag }));
    assert_eq!((session.output_state(), said(&mut session, now)), (WishState::Refused, None));
}

/// A board that answers each command at once in its own way, for so long in steps of a millisecond: how many commands it got.
fn commands_within(time: Duration, mut answer: impl FnMut(&mut Session, u8, Command, Instant)) -> u32 {
    let begin = Instant::now();
    let mut session = Session::new(RequestedSettings::default());
    session.hello(&hello(0, Settings::default(), false), begin);
    let mut count = 0;
    for millis in 0..time.as_millis() as u64 {
        let now = begin + Duration::from_millis(millis);
        if let Some((tag, command)) = said(&mut session, now) {
            count += 1;
            answer(&mut session, tag, command, now);
        }
    }
    count
}

#[test]
fn what_a_board_does_not_follow_is_asked_for_again_with_longer_and_longer_pauses() {
    let all_plans = commands_within(Duration::from_secs(8), |session, tag, command, now| match command {
        Command::Scan(_) => assert!(session.fault(&Fault::BadPlan { answers: tag })),
        Command::Start => {
            session.hello(&hello(tag, Settings::default(), true), now);
            session.frame(now);
        }
        _ => session.hello(&hello(tag, Settings::default(), true), now),
    });
    // Whole frames at 0, 0, 0.5, 1.5, 3.5 and 7.5 s, one Start, and a question for each 1.5 s of silence.
    assert!((7..=12).contains(&all_plans), "{all_plans}");
    let never_started = commands_within(Duration::from_secs(8), |session, tag, command, now| {
        drop(command);
        session.hello(&hello(tag, Settings::default(), false), now);
    });
    // A plan, six Starts, and questions.
    assert!((7..=13).contains(&never_started), "{never_started}");
    let always_restarts = commands_within(Duration::from_secs(8), |session, _, _, now| {
        session.hello(&hello(0, Settings::default(), false), now);
    });
    assert!((7..=40).contains(&always_restarts), "{always_restarts}");
}

#[test]
fn a_plan_that_is_refused_holds_up_no_start_and_another_one_is_sent_at_once() {
    let now = Instant::now();
    let mut session = Session::new(RequestedSettings::default());
    session.hello(&hello(0, Settings::default(), false), now);
    for _ in 0..2 {
        let (tag, command) = said(&mut session, now).unwrap();
        assert_eq!(command, Command::Scan(Plan::default()));
        assert!(session.fault(&Fault::BadPlan { answers: tag }));
    }
    let (tag, command) = said(&mut session, now).unwrap();
    assert_eq!((command, session.plan_state()), (Command::Start, WishState::Refused));
    session.hello(&hello(tag, Settings::default(), true), now);
    session.request_plan(Some(four_rows()));
    assert_eq!(self::command(&mut session, now), Some(Command::Scan(four_rows())));
}

#[test]
fn an_earlier_hosts_stream_is_joined_and_its_plan_ended() {
    let now = Instant::now();
    let mut session = Session::new(RequestedSettings::default());
    session.hello(&hello(9, Settings::default(), true), now);
    assert_eq!(said(&mut session, now), Some((1, Command::Hello)), "what another host asked tells nothing");
    session.hello(&hello(1, Settings::default(), true), now);
    let (tag, command) = said(&mut session, now).unwrap();
    assert_eq!(command, Command::Scan(Plan::default()));
    session.hello(&hello(tag, Settings::default(), true), now);
    assert_eq!(said(&mut session, now), None, "it streams already");
    assert!(session.is_mute(now + 2 * MUTE_AFTER), "if it does");
}

#[test]
fn every_setting_that_is_refused_is_named() {
    let wanted = Settings { settle_us: 70, average_log2: 3, max_frames_per_s: 100, select_us: 35, discarded: 1 };
    let refusal = Refusal { wanted, kept: Settings::default(), is_said: true }.to_string();
    assert_eq!(
        refusal,
        "the board keeps a settle time of 20 us instead of 70 us, and an average over 1 instead of 8 conversions, and as many \
         frames a second as it can instead of at most 100 frames a second, and a select time of 0 us instead of 35 us, and 0 discarded \
         conversions instead of 1"
    );
}

#[test]
fn a_board_that_answers_and_sends_no_frames_is_mute_until_one_comes() {
    let begin = Instant::now();
    let mut session = Session::new(RequestedSettings::default());
    session.hello(&hello(0, Settings::default(), false), begin);
    let (mut asked, mut now) = (0, begin);
    while !session.is_mute(now) {
        if let Some((tag, command)) = said(&mut session, now) {
            asked += u32::from(command == Command::Hello);
            session.hello(&hello(tag, Settings::default(), true), now);
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
    let settings = Settings { average_log2: 8, settle_us: u16::MAX, ..Settings::default() };
    session.hello(&hello(0, settings, false), begin);
    while let Some((tag, command)) = said(&mut session, begin) {
        session.hello(&hello(tag, settings, command == Command::Start), begin);
    }
    // 65536 conversions of 50 us and 16 settle times of 65.5 ms: 4.3 s.
    assert!(!session.is_mute(begin + Duration::from_secs(8)) && session.is_mute(begin + Duration::from_secs(9)));
}
