//! The command loop: commands good and bad, the frame-rate cap, what is told after a reset.

use tactomo_firmware::mux::Transparent;
use tactomo_firmware::{Activity, Adc, Board16, Identity, NewBoardError, NoTouch, Parts};
use tactomo_protocol::{
    BoardMessage, Command, ConverterErrors, Fault, Hello, MAX_COMMAND, Plan, Range, Request, Settings, TablePiece,
    VERSION, encode_request,
};

use super::more_parts::*;
use super::parts::*;

#[test]
fn a_board_scans_from_start_to_stop_only() {
    let outside = Outside::default();
    let mut board = simple_board(&outside, numbered);
    assert_eq!(board.step(), Ok(Activity::Idle));
    outside.send(Command::Start);
    assert_eq!(board.step(), Ok(Activity::Row));
    outside.send(Command::Stop);
    assert_eq!(board.step(), Ok(Activity::Idle));
    let conversions = outside.conversions.get();
    assert_eq!(conversions, 16, "the scan was given up after its first row");

    outside.send(Command::Start);
    scan(&mut board, 2);
    assert_eq!(outside.conversions.get() - conversions, 512, "and begun anew");
    let messages = outside.messages();
    assert_eq!(frames(&messages).iter().map(|frame| frame.head.sequence).collect::<Vec<_>>(), [0, 1]);
}

#[test]
fn settings_take_effect_at_once_and_are_confirmed() {
    let outside = Outside::default();
    let mut board = simple_board(&outside, numbered);
    outside.send(Command::Start);
    board.step().unwrap();
    let settings = Settings { settle_us: 500, average_log2: 1, ..Settings::default() };
    outside.send(Command::Configure(settings));
    let (begin_us, before) = (outside.clock_us.get(), outside.conversions.get());
    scan(&mut board, 1);
    assert_eq!(outside.conversions.get() - before, 512);
    assert_eq!(outside.clock_us.get() - begin_us, 16 * (500 + 32 * CONVERSION_US));
    let messages = outside.messages();
    assert_eq!(
        hellos(&messages).iter().map(|hello| hello.settings).collect::<Vec<_>>(),
        [Settings::default(), Settings::default(), settings],
        "at the start, after Start, and after Configure"
    );
    let middle_us = begin_us + 8 * (500 + 32 * CONVERSION_US);
    assert_eq!(u64::from(frames(&messages)[0].head.time_us), middle_us, "a frame has settings of one kind");
}

#[test]
fn settings_out_of_range_are_refused_and_the_old_ones_stay() {
    let outside = Outside::default();
    let mut board = simple_board(&outside, numbered);
    board.step().unwrap();
    outside.messages();
    let refused = [
        Settings { average_log2: 9, ..Settings::default() },
        Settings { select_us: 10_001, ..Settings::default() },
        Settings { discarded: 16, ..Settings::default() },
    ];
    for settings in refused {
        outside.send(Command::Configure(settings));
        outside.send(Command::Hello);
        board.step().unwrap();
        let messages = outside.messages();
        assert_eq!(faults(&messages), [&Fault::BadSettings { answers: 1 }]);
        assert_eq!(hellos(&messages)[0].settings, Settings::default());
    }
}

#[test]
fn numbers_go_on_where_the_stream_was_stopped() {
    let outside = Outside::default();
    let mut board = simple_board(&outside, numbered);
    outside.send(Command::Start);
    scan(&mut board, 2);
    outside.send(Command::Stop);
    board.step().unwrap();
    outside.send(Command::Start);
    scan(&mut board, 1);
    board.step().unwrap();
    let messages = outside.messages();
    assert_eq!(frames(&messages).iter().map(|frame| frame.head.sequence).collect::<Vec<_>>(), [0, 1, 2]);
}

#[test]
fn a_new_plan_is_begun_at_once_whatever_the_frame_rate() {
    let outside = Outside::default();
    let mut board = simple_board(&outside, numbered);
    outside.send(Command::Configure(Settings { max_frames_per_s: 1, ..Settings::default() }));
    outside.send(Command::Start);
    scan(&mut board, 1);
    assert!(matches!(board.step(), Ok(Activity::Waiting { .. })));
    let plan = Plan { grounds: [3, 4].into_iter().collect(), reads: 0xFFFF, rows_a_frame: 2, average_log2: 0 };
    outside.send(Command::Scan(plan));
    assert_eq!(board.step(), Ok(Activity::Row));
    assert_eq!(board.step(), Ok(Activity::Frame));
    assert!(matches!(board.step(), Ok(Activity::Waiting { .. })), "the next one is due in a second");
}

/// The longest Hello that there can be: names of 24 bytes, four ranges, and numbers that take three bytes each.
#[test]
fn a_hello_with_four_ranges_and_the_longest_values_is_sent_whole() {
    let errors = ConverterErrors { noise_uv: u16::MAX, gain_ppm: u16::MAX, bow_uv: u16::MAX };
    let range = |electrodes| Range { electrodes, floor: u16::MAX - 1, ceiling: u16::MAX, errors };
    let adc = Adc::new(16, u16::MAX).with_ranges(&[range(1), range(2), range(3), range(4)]);
    let name = "123456789012345678901234";
    let identity = Identity { firmware_version: name, board: name, electrodes: 16, adc, drive_mv: u16::MAX };
    let outside = Outside::default();
    let parts = Parts { mux: NoMux, sampler: NullPart, serial: serial(&outside), chip: NullPart, touch: NoTouch };
    let mut board = Board16::new(parts, identity).unwrap();
    let settings = Settings {
        settle_us: u16::MAX,
        average_log2: 8,
        max_frames_per_s: u16::MAX,
        select_us: Settings::MAX_SELECT_US,
        discarded: Settings::MAX_DISCARDED,
    };
    outside.send_tagged(255, Command::Configure(settings));
    board.step().unwrap();
    let messages = outside.messages();
    let [start, answer] = hellos(&messages)[..] else { panic!("{messages:?}") };
    assert_eq!((start.board.as_str(), start.firmware_version.as_str()), (name, name));
    assert_eq!((answer.answers, answer.settings), (255, settings));
    let electrodes: Vec<_> = answer.ranges.iter().map(|range| (range.electrodes, range.ceiling)).collect();
    let ends = u16::MAX;
    assert_eq!(
        electrodes,
        [(1, ends), (2, ends), (3, ends), (10, ends)],
        "the last one reaches over those that are left"
    );
}

#[test]
fn every_command_is_answered_by_its_tag_and_the_repetition_changes_nothing() {
    let outside = Outside::default();
    let mut board = simple_board(&outside, numbered);
    board.step().unwrap();
    outside.messages();
    let settings = Settings { settle_us: 30, ..Settings::default() };
    let commands = [
        (Command::Hello, Settings::default(), false),
        (Command::Configure(settings), settings, false),
        (Command::Scan(Plan::default()), settings, false),
        (Command::Start, settings, true),
        (Command::Stop, settings, false),
    ];
    for (tag, (command, settings, is_streaming)) in (200..).step_by(10).zip(commands) {
        for tag in [tag, tag, tag + 1] {
            outside.send_tagged(tag, command.clone());
            board.step().unwrap();
            let messages = outside.messages();
            let [Hello { answers, settings: told, is_streaming: streams, .. }] = hellos(&messages)[..] else {
                panic!("{command:?}: {messages:?}")
            };
            assert_eq!((*answers, *told, *streams), (tag, settings, is_streaming));
        }
    }
}

#[test]
fn a_host_of_another_version_is_told_by_number_and_not_obeyed() {
    for version in (0..16).filter(|version| *version != VERSION) {
        let outside = Outside::default();
        let mut board = simple_board(&outside, numbered);
        outside.send_bytes(&in_version(version, Command::Start));
        assert_eq!(board.step(), Ok(Activity::Idle));
        assert_eq!(faults(&outside.messages()), [&Fault::UnknownVersion(version)]);
    }
}

/// Table, Clock, Hello; of a refusal Table, and the fault.
#[test]
fn what_answers_a_command_comes_in_its_order() {
    let outside = Outside::default();
    let mut board = simple_board(&outside, numbered);
    board.step().unwrap();
    outside.messages();
    let piece = |bytes: &[u8]| Command::Table(TablePiece { at: 0, bytes: bytes.iter().copied().collect() });
    for (command, order) in
        [(Command::Hello, "CH"), (piece(&[]), "TCH"), (piece(&[1]), "TX"), (Command::Rate { baud: 1 }, "X")]
    {
        outside.send_tagged(9, command);
        board.step().unwrap();
        let letter = |message: &BoardMessage| match message {
            BoardMessage::Table(state) if state.answers == 9 => 'T',
            BoardMessage::Clock(clock) if clock.answers == 9 => 'C',
            BoardMessage::Hello(hello) if hello.answers == 9 => 'H',
            BoardMessage::Fault(Fault::NoTable { answers: 9 } | Fault::BadRate { answers: 9 }) => 'X',
            other => panic!("{other:?}"),
        };
        assert_eq!(outside.messages().iter().map(letter).collect::<String>(), order);
    }
}

/// A command as another version of the protocol would send it: head, checksum and framing are the same in every version.
fn in_version(version: u8, command: Command) -> Vec<u8> {
    let mut packet = [0; MAX_COMMAND];
    let length = encode_request(&Request { tag: 1, command }, &mut packet).unwrap();
    let mut content = cobs::decode_vec(&packet[..length - 1]).unwrap();
    content.truncate(content.len() - 4);
    content[0] = version << 4 | content[0] & 15;
    let crc = crc::Crc::<u32>::new(&crc::CRC_32_ISO_HDLC).checksum(&content);
    content.extend(crc.to_le_bytes());
    let mut packet = cobs::encode_vec(&content);
    packet.push(0);
    packet
}

#[test]
fn commands_are_found_among_garbage() {
    let outside = Outside::default();
    let mut board = simple_board(&outside, numbered);
    board.step().unwrap();
    outside.messages();
    // A byte of every value, a run longer than any command, half a command; then a zero ends the junk.
    outside.send_bytes(&(0..=255).chain([0x55; 500]).collect::<Vec<u8>>());
    outside.send_bytes(&in_version(VERSION, Command::Start)[..3]);
    outside.send_bytes(&[0]);
    outside.send(Command::Hello);
    step(&mut board, 20);
    let messages = outside.messages();
    assert_eq!((messages.len(), hellos(&messages).len()), (2, 1), "the clock and Hello: {messages:?}");
}

#[test]
fn a_flood_of_garbage_does_not_hold_up_the_scan() {
    let outside = Outside::default();
    let mut board = simple_board(&outside, numbered);
    outside.send(Command::Start);
    outside.send_bytes(&[0xaa; 1_000_000]);
    scan(&mut board, 10);
    assert_eq!(frames(&outside.messages()).len(), 10);
    assert!(!outside.wire.borrow().to_board.is_empty());
}

#[test]
fn the_frame_rate_is_capped_without_drift() {
    let outside = Outside::default();
    let mut board = simple_board(&outside, numbered);
    outside.send(Command::Configure(Settings { max_frames_per_s: 300, ..Settings::default() }));
    outside.send(Command::Start);
    let mut begun = Vec::new();
    while begun.len() < 301 {
        match board.step().unwrap() {
            // The loop comes round every 7 us, which divides no period.
            Activity::Waiting { until_us } => {
                assert!(until_us > outside.clock_us.get());
                outside.advance_us(7);
            }
            Activity::Frame => begun.extend(frames(&outside.messages()).iter().map(|frame| frame.head.time_us)),
            Activity::Row | Activity::Idle => {}
        }
    }
    let duration_us = begun[300] - begun[0];
    assert!((1_000_000..1_000_300).contains(&duration_us), "300 frames in {duration_us} us");
    assert!(begun.windows(2).all(|pair| pair[1] - pair[0] >= 3334 - 7));
}

#[test]
fn after_a_pause_no_frames_are_caught_up() {
    let outside = Outside::default();
    let mut board = simple_board(&outside, numbered);
    outside.send(Command::Configure(Settings { max_frames_per_s: 100, ..Settings::default() }));
    outside.send(Command::Start);
    scan(&mut board, 1);
    outside.advance_us(1_000_000);
    scan(&mut board, 1);
    let Activity::Waiting { until_us } = board.step().unwrap() else { panic!("the next frame is due a period later") };
    let messages = outside.messages();
    let begun_us = u64::from(frames(&messages)[1].head.time_us) - 8 * (20 + 16 * CONVERSION_US);
    assert_eq!(until_us, begun_us + 10_000);
}

#[test]
fn a_fault_before_the_reset_is_told_at_once_and_to_the_first_host_that_asks() {
    let outside = Outside::default();
    let mut board = simple_board(&outside, numbered);
    let panic = Fault::Panic("src/main.rs:7".try_into().unwrap());
    board.report(panic.clone());
    board.step().unwrap();
    let messages = outside.messages();
    assert_eq!((hellos(&messages).len(), faults(&messages)), (1, vec![&panic]));

    outside.send(Command::Hello);
    board.step().unwrap();
    assert_eq!(faults(&outside.messages()), [&panic]);
    outside.send(Command::Hello);
    board.step().unwrap();
    assert!(faults(&outside.messages()).is_empty());
}

#[test]
fn an_identity_that_does_not_fit_is_refused() {
    let new = |identity| {
        let parts = Parts { mux: NoMux, sampler: NullPart, serial: NullPart, chip: NullPart, touch: NoTouch };
        Board16::new(parts, identity).err()
    };
    assert_eq!(new(IDENTITY), None);
    assert_eq!(new(Identity { electrodes: 17, ..IDENTITY }), Some(NewBoardError::Electrodes(17)));
    assert_eq!(new(Identity { electrodes: 3, ..IDENTITY }), Some(NewBoardError::Electrodes(3)));
    let adc = tactomo_firmware::Adc { bits: 17, ..IDENTITY.adc };
    assert_eq!(new(Identity { adc, ..IDENTITY }), Some(NewBoardError::AdcBits(17)));
    assert_eq!(new(Identity { drive_mv: 0, ..IDENTITY }), Some(NewBoardError::Millivolts));
}

#[test]
fn a_board_of_16_electrodes_takes_less_than_4850_bytes_of_ram() {
    type Parts0 = Board16<Transparent<NullPart, 4>, NullPart, NullPart, NullPart>;
    let bytes = size_of::<Parts0>();
    assert!(bytes < 4850, "{bytes} bytes");
}

#[test]
fn the_watchdog_is_fed_while_nothing_is_scanned() {
    let outside = Outside::default();
    let mut board = simple_board(&outside, numbered);
    for feeds in 1..10 {
        assert_eq!(board.step(), Ok(Activity::Idle));
        assert_eq!(outside.watchdog.get().feeds, feeds);
    }
    outside.send(Command::Configure(Settings { max_frames_per_s: 1, ..Settings::default() }));
    outside.send(Command::Start);
    scan(&mut board, 1);
    let feeds = outside.watchdog.get().feeds;
    assert!(matches!(board.step(), Ok(Activity::Waiting { .. })));
    assert_eq!(outside.watchdog.get().feeds, feeds + 1);
}

#[test]
fn other_settings_begin_a_frame_at_once_and_the_same_again_do_not() {
    let outside = Outside::default();
    let mut board = simple_board(&outside, numbered);
    let slow = Settings { max_frames_per_s: 1, ..Settings::default() };
    outside.send(Command::Configure(slow));
    outside.send(Command::Start);
    scan(&mut board, 1);
    for command in [Command::Configure(slow), Command::Start, Command::Scan(Plan::default()), Command::Hello] {
        outside.send(command.clone());
        assert!(matches!(board.step(), Ok(Activity::Waiting { .. })), "{command:?}");
    }
    outside.send(Command::Configure(Settings { settle_us: 30, ..slow }));
    assert_eq!(board.step(), Ok(Activity::Row));
}

#[test]
fn start_again_tells_a_stuck_converter_no_second_time() {
    let outside = Outside::default();
    let mut board = simple_board(&outside, |_, _| Err(tactomo_firmware::TimedOut));
    outside.send(Command::Start);
    scan(&mut board, 2);
    outside.send(Command::Start);
    scan(&mut board, 2);
    assert_eq!(faults(&outside.messages()), [&Fault::AdcStuck]);
    outside.send(Command::Stop);
    outside.send(Command::Start);
    scan(&mut board, 1);
    assert_eq!(faults(&outside.messages()), [&Fault::AdcStuck], "a host that starts anew hears it again");
}
