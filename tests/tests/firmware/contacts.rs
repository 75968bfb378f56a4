//! Contacts that a board finds by itself, and the table that it finds them by.

use std::sync::LazyLock;

use tactomo::detector::Detector;
use tactomo::solve::{Problem, compile};
use tactomo_firmware::Identity;
use tactomo_protocol::{
    BoardMessage, Command, ContactFlags, Contacts, Fault, MAX_PIECE, Output, Range, TablePiece, TableState,
};

use crate::bench::{
    Bench, DETECTOR, ROOM, TABLE, faulty_simulation, finder, finger, memory_of, simulated_on, simulation, table_memory,
};
use crate::parts::{IDENTITY, Outside, simple_board, step};

#[test]
fn contacts_are_where_something_presses_and_follow_a_rest_that_is_known() {
    let mut bench = Bench::new(finder(table_memory()));
    bench.command(Command::Output(Output::Contacts));
    bench.command(Command::Start);
    let at_rest = bench.scan(&mut simulation(&[]), 80);
    assert!(at_rest[0].flags.has(ContactFlags::RESTING) && !at_rest[79].flags.has(ContactFlags::RESTING));
    assert!(at_rest.iter().all(|contacts| contacts.found.is_empty()));
    let place_m = [0.011, -0.007];
    let pressed = bench.scan(&mut simulation(&[finger(place_m)]), 20);
    let [contact] = pressed[19].found[..] else { panic!("{:?}", pressed[19]) };
    let off_m = contact.at_m().map(f64::from);
    assert!((off_m[0] - place_m[0]).hypot(off_m[1] - place_m[1]) < 3e-4, "{contact:?}");
    assert!(contact.sigma_m().is_some_and(|sigma_m| sigma_m < 1e-3), "{contact:?}");
    assert_eq!(pressed[19].flags, ContactFlags::default());
    // It lands in the first, and is searched from the second on, while frames go on: with misfit until it is found.
    let found = pressed.iter().position(|contacts| !contacts.found.is_empty()).unwrap();
    assert!(found < 8 && pressed[..found].iter().all(|contacts| contacts.flags.has(ContactFlags::MISFIT)), "{found}");
    assert!(pressed[found..].iter().all(|contacts| contacts.found.first().is_some_and(|first| first.id == contact.id)));
    let sequences: Vec<_> = pressed.iter().map(|contacts| contacts.head.sequence).collect();
    assert!(sequences.windows(2).all(|two| two[1] == two[0] + 1));
}

#[test]
fn a_press_in_the_first_frame_is_told_and_rest_is_learned_when_it_goes() {
    let mut bench = Bench::new(finder(table_memory()));
    let mut pressing = simulation(&[finger([0.0, 0.01])]);
    bench.read(&mut pressing);
    bench.command(Command::Output(Output::Contacts));
    bench.command(Command::Start);
    let pressed = bench.scan(&mut pressing, 200);
    let is_told = |contacts: &Contacts| contacts.found.len() == 1 && contacts.flags.has(ContactFlags::RESTING);
    // But for those that come while it is searched.
    assert_eq!(pressed[8..].iter().position(|contacts| !is_told(contacts)), None, "{:?}", pressed.first());
    let after = bench.scan(&mut simulation(&[]), 100);
    let last = &after[99];
    assert!(last.found.is_empty() && !last.flags.has(ContactFlags::RESTING), "{last:?}");
}

/// A search takes many frames. Each command is obeyed between two rows.
#[test]
fn commands_are_obeyed_and_frames_go_on_while_a_search_is_under_way() {
    let mut bench = Bench::new(finder(table_memory()));
    bench.command(Command::Output(Output::Contacts));
    bench.command(Command::Start);
    bench.scan(&mut simulation(&[]), 80);
    let three = [[0.011, -0.007], [-0.014, 0.009], [0.002, 0.019]].map(finger);
    // Landing; then the search begins.
    let begun = bench.scan(&mut simulation(&three), 3);
    assert!(begun.iter().all(|contacts| contacts.flags.has(ContactFlags::MISFIT)), "{begun:?}");
    // A row later there is an answer.
    let answers = bench.command(Command::Hello);
    assert!(answers.iter().any(|message| matches!(message, BoardMessage::Hello(_))), "{answers:?}");
    let sequences: Vec<_> = begun.iter().map(|contacts| contacts.head.sequence).collect();
    assert!(sequences.windows(2).all(|two| two[1] == two[0] + 1), "{sequences:?}");
    let found = bench.scan(&mut simulation(&three), 40);
    let last = &found[found.len() - 1];
    assert!(last.found.len() == 3 && !last.flags.has(ContactFlags::MISFIT), "{last:?}");
    // One that is stopped is given up.
    bench.scan(&mut simulation(&[finger([0.0, 0.01])]), 2);
    let stopped = bench.command(Command::Stop);
    assert!(stopped.iter().any(|m| matches!(m, BoardMessage::Hello(hello) if !hello.is_streaming)), "{stopped:?}");
    bench.command(Command::Start);
    assert!(bench.scan(&mut simulation(&[]), 4).iter().all(|contacts| contacts.found.is_empty()));
}

/// Places that are looked at for a first contact, which is the longest piece of a search, and then those for one more in the other pieces that the step may do.
const LOOKS_A_STEP: usize = 260 + 6 * 40;

/// However long a search takes, a command is answered in the step after it came: behind a piece of the search and a row. The line is looked at after each look at contacts or
/// at a place, so these are counted.
#[test]
fn a_command_waits_for_no_more_than_a_piece_of_a_search() {
    let mut bench = Bench::new(finder(table_memory()));
    bench.command(Command::Output(Output::Contacts));
    bench.command(Command::Start);
    bench.scan(&mut simulation(&[]), 80);
    let pressed = [&[[0.011, -0.007], [-0.014, 0.009], [0.002, 0.019]][..], &[], &[[0.0, 0.01]], &[[0.011, -0.007]]];
    let (mut most, mut is_searched) = (0, false);
    for places_m in pressed {
        bench.read(&mut simulation(&places_m.iter().map(|at_m| finger(*at_m)).collect::<Vec<_>>()));
        for number in 0..16 * 20 {
            let before = bench.outside.wire.borrow().pulls;
            // A stop ends the search; it begins anew with the stream.
            let command = match number % 100 {
                98 => Command::Stop,
                99 => Command::Start,
                _ => Command::Hello,
            };
            let is_stop = command == Command::Stop;
            let answers = bench.command(command);
            let told = answers.iter().find_map(|message| match message {
                BoardMessage::Hello(hello) => Some(!hello.is_streaming),
                _ => None,
            });
            assert_eq!(told, Some(is_stop), "{answers:?}");
            most = most.max(bench.outside.wire.borrow().pulls - before);
            is_searched |= answers.iter().any(|message| {
                matches!(message, BoardMessage::Contacts(contacts) if contacts.flags.has(ContactFlags::MISFIT))
            });
        }
    }
    assert!(is_searched && (100..=LOOKS_A_STEP).contains(&most), "{most}");
}

#[test]
fn contacts_that_are_asked_for_once_more_begin_anew_with_rest() {
    let mut bench = Bench::new(finder(table_memory()));
    bench.command(Command::Output(Output::Contacts));
    bench.command(Command::Start);
    let mut resting = simulation(&[]);
    let before = bench.scan(&mut resting, 80);
    bench.command(Command::Output(Output::Contacts));
    let after = bench.scan(&mut resting, 80);
    let is_resting = |contacts: &Contacts| contacts.flags.has(ContactFlags::RESTING);
    assert_eq!([&before[79], &after[1], &after[79]].map(is_resting), [false, true, false]);
}

#[test]
fn a_broken_wire_is_told_once_and_contacts_are_found_without_it() {
    let mut bench = Bench::new(finder(table_memory()));
    bench.command(Command::Output(Output::Contacts));
    bench.command(Command::Start);
    bench.scan(&mut faulty_simulation(&[], "open:5"), 80);
    bench.read(&mut faulty_simulation(&[finger([0.011, -0.007])], "open:5"));
    step(&mut bench.board, 16 * 20);
    let messages = bench.outside.messages();
    let told: Vec<_> = messages.iter().filter(|message| matches!(message, BoardMessage::Fault(_))).collect();
    assert_eq!(told, [&BoardMessage::Fault(Fault::BrokenWires { electrodes: 1 << 5 })]);
    let last = messages.iter().rev().find_map(|message| match message {
        BoardMessage::Contacts(contacts) => Some(contacts),
        _ => None,
    });
    let Contacts { flags, found, .. } = last.unwrap();
    let [contact] = found[..] else { panic!("{last:?}") };
    let off_m = contact.at_m().map(f64::from);
    assert!((off_m[0] - 0.011).hypot(off_m[1] + 0.007) < 3e-4, "{contact:?}");
    assert!(flags.has(ContactFlags::FAULT) && !flags.has(ContactFlags::MISFIT), "{last:?}");
}

#[test]
fn both_are_sent_under_one_number_and_frames_alone_again() {
    let mut bench = Bench::new(finder(table_memory()));
    bench.command(Command::Output(Output::Both));
    bench.command(Command::Start);
    step(&mut bench.board, 16 * 4);
    let numbers = |messages: Vec<BoardMessage>| -> Vec<(char, u16)> {
        let number = |message| match message {
            BoardMessage::Contacts(contacts) => Some(('A', contacts.head.sequence)),
            BoardMessage::Frame(frame) => Some(('F', frame.head.sequence)),
            _ => None,
        };
        messages.into_iter().filter_map(number).collect()
    };
    let both = numbers(bench.outside.messages());
    assert_eq!(both[..4], [('A', 0), ('F', 0), ('A', 1), ('F', 1)]);
    bench.command(Command::Output(Output::Frames));
    step(&mut bench.board, 16 * 3);
    let frames = numbers(bench.outside.messages());
    assert!(frames.len() >= 2 && frames.iter().all(|(kind, _)| *kind == 'F'), "{frames:?}");
}

#[test]
fn without_a_table_contacts_are_refused_and_one_that_comes_in_pieces_is_used() {
    let mut bench = Bench::new(finder(vec![0; ROOM]));
    let refused = bench.command(Command::Output(Output::Contacts));
    assert!(refused.contains(&BoardMessage::Fault(Fault::NoTable { answers: 1 })), "{refused:?}");
    let (empty, _) = bench.piece(0, &[]);
    assert_eq!((empty.room, empty.held, empty.usable), (ROOM as u32, 0, None));
    // A piece that comes twice, and one that comes too early, change nothing.
    bench.piece(0, &TABLE[..64]);
    assert_eq!(bench.piece(128, &TABLE[128..192]), (TableState { answers: 4, held: 64, ..empty }, false));
    bench.piece(64, &TABLE[64..128]);
    assert_eq!(bench.piece(64, &TABLE[64..128]).0.held, 128);
    let (state, is_refused) = bench.send(&TABLE);
    assert!(!is_refused && state.held as usize == TABLE.len());
    let checksum = state.usable.map(|usable| usable.checksum.to_le_bytes());
    assert_eq!(checksum.as_ref(), TABLE.last_chunk());
    bench.command(Command::Output(Output::Contacts));
    bench.command(Command::Start);
    assert_eq!(bench.scan(&mut simulation(&[]), 4).len(), 4);
    // Contacts go on by the old one until a new one is whole, and are then to be asked for anew.
    for (number, bytes) in OTHER.chunks(MAX_PIECE).enumerate() {
        assert_eq!(bench.piece(number * MAX_PIECE, bytes).0.usable.is_some(), (number + 1) * MAX_PIECE >= OTHER.len());
        if number % 400 == 0 {
            assert_eq!(bench.scan(&mut simulation(&[]), 4).len(), 4);
        }
    }
    assert_eq!(bench.scan(&mut simulation(&[]), 4), []);
}

/// The detector's own, but for a drive that is a little lower.
static OTHER: LazyLock<Vec<u8>> = LazyLock::new(|| {
    let detector = Detector { drive_v: 1.99, ..DETECTOR.clone() };
    compile(&Problem::of(&detector).unwrap()).unwrap()
});

#[test]
fn tables_that_are_damaged_or_of_another_detector_are_refused() {
    let mut damaged = TABLE.to_vec();
    damaged[5000] ^= 1;
    let other = compile(&Problem::of(&Detector::preset("display-140x70").unwrap()).unwrap()).unwrap();
    let stronger = Detector { drive_v: 3.0, ..DETECTOR.clone() };
    let of_another_drive = compile(&Problem::of(&stronger).unwrap()).unwrap();
    for (table, room) in [(&damaged, ROOM), (&other, 2 * ROOM), (&of_another_drive, ROOM), (&TABLE.to_vec(), 1000)] {
        let mut bench = Bench::new(finder(vec![0; room]));
        let mut was_refused = false;
        for (number, bytes) in table.chunks(MAX_PIECE).enumerate() {
            let (state, is_refused) = bench.piece(number * MAX_PIECE, bytes);
            was_refused |= is_refused;
            assert_eq!(state.usable, None);
        }
        assert!(was_refused);
    }
}

/// Other electrode counts, a ground that is lifted, and a converter that sees nothing below a floor: with the ground above it a light press is read, and what
/// is at the floor is no voltage, nor a rest.
#[test]
fn boards_of_any_electrodes_grounds_and_floors_find_what_presses_where_it_is() {
    let floor_mv = 142u16;
    let floor = Range { floor: (f64::from(floor_mv) / 3300.0 * 4096.0) as u16, ..Range::of_codes(16, 12) };
    let floored = IDENTITY.adc.with_ranges(&[floor]);
    let place_m = [0.008, -0.006];
    // Electrodes that are left out, how far the ground is lifted, and the converter.
    for (left_out, ground_v, adc) in [
        (&[][..], 0.25, IDENTITY.adc),
        (&[], 0.25, floored),
        (&[], 0.0, floored),
        (&[0, 5, 10, 15], 0.0, IDENTITY.adc),
        (&[1, 2, 7, 8, 11, 13, 14], 0.25, floored),
    ] {
        let mut detector = DETECTOR.clone();
        let mut number = 0;
        detector.electrodes.retain(|_| {
            number += 1;
            !left_out.contains(&(number - 1))
        });
        let electrodes = detector.electrodes.len() as u8;
        let drive_mv = 2000 + (1000.0 * ground_v) as u16;
        let identity = Identity { electrodes, adc, drive_mv, ..IDENTITY };
        let table = compile(&Problem::of(&detector).unwrap()).unwrap();
        let mut bench = Bench::of(finder(memory_of(&table)), identity, ground_v);
        bench.command(Command::Output(Output::Contacts));
        bench.command(Command::Start);
        let described = format!("{electrodes} electrodes, {ground_v} V, {:?}", adc.ranges[0]);
        let resting = bench.scan(&mut simulated_on(&detector, &[], &[]), 80);
        assert!(resting.iter().all(|contacts| contacts.found.is_empty()), "{described}");
        assert!(!resting.last().unwrap().flags.has(ContactFlags::RESTING), "{described}");
        let pressed = bench.scan(&mut simulated_on(&detector, &[finger(place_m)], &[]), 12);
        let [contact] = pressed.last().unwrap().found[..] else { panic!("{described}: {:?}", pressed.last()) };
        let off_m = contact.at_m().map(f64::from);
        assert!((off_m[0] - place_m[0]).hypot(off_m[1] - place_m[1]) < 5e-4, "{described}: {contact:?}");
        // Where all readings are at the floor too.
        let after = bench.scan(&mut simulated_on(&detector, &[], &[]), 6);
        assert!(after.last().unwrap().found.is_empty(), "{described}: {after:?}");
    }
}

/// Any pieces in any order leave a table that is sound, or none.
#[test]
fn whatever_pieces_come_there_is_a_sound_table_or_none() {
    let mut bench = Bench::new(finder(vec![0; ROOM]));
    let mut seed = 7u64;
    let mut random = move |below: usize| {
        seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (seed >> 33) as usize % below
    };
    let mut at = 0;
    for _ in 0..20_000 {
        let mut bytes = TABLE[at..TABLE.len().min(at + MAX_PIECE)].to_vec();
        match random(40) {
            0 => at = random(TABLE.len()),
            1 => bytes.iter_mut().for_each(|byte| *byte ^= random(256) as u8),
            2 => bytes.truncate(random(MAX_PIECE)),
            3 => at = 0,
            4 => at = usize::try_from(u32::MAX).unwrap() - random(100),
            5 => _ = bench.command(Command::Output([Output::Both, Output::Contacts][random(2)])),
            6 => _ = bench.command(Command::Start),
            _ => {}
        }
        let (state, is_refused) = bench.piece(at, &bytes);
        at = if is_refused { 0 } else { state.held as usize % TABLE.len() };
        let sound = state.usable.map(|usable| usable.checksum.to_le_bytes());
        assert!(sound.is_none() || sound.as_ref() == TABLE.last_chunk());
    }
}

#[test]
fn a_board_without_memory_for_a_table_says_so() {
    let outside = Outside::default();
    let mut board = simple_board(&outside, |_, _| Ok(0));
    outside.send_tagged(9, Command::Table(TablePiece::default()));
    outside.send_tagged(10, Command::Table(TablePiece { at: 0, bytes: [1].into_iter().collect() }));
    outside.send_tagged(11, Command::Output(Output::Both));
    step(&mut board, 4);
    let messages = outside.messages();
    assert!(messages.contains(&BoardMessage::Table(TableState { answers: 9, ..TableState::default() })));
    for answers in [10, 11] {
        assert!(messages.contains(&BoardMessage::Fault(Fault::NoTable { answers })), "{messages:?}");
    }
}
