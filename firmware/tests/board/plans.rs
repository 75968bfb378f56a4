//! Scan plans: which rows a board scans, and what its frames say of them.

use tactomo_firmware::{Activity, Adc, Board16, Identity, NoTouch, Parts};
use tactomo_protocol::{Command, Fault, Plan, Range, Scope, Settings, Status};

use super::more_parts::*;
use super::parts::*;

fn plan(grounds: &[u8], reads: u32, rows_a_frame: u8, average_log2: u8) -> Plan {
    Plan { grounds: grounds.iter().copied().collect(), reads, rows_a_frame, average_log2 }
}

/// The code of an electrode under whatever ground.
fn by_electrode(_number: u64, electrode: u8) -> Result<u16, tactomo_firmware::TimedOut> {
    Ok(100 + u16::from(electrode))
}

#[test]
fn rows_come_round_and_round_and_each_frame_says_which_they_are() {
    let outside = Outside::default();
    let mut board = simple_board(&outside, by_electrode);
    let rows = plan(&[3, 0, 3, 9, 15, 15], 0b1000_0000_0000_0110, 2, 1);
    outside.send(Command::Scan(rows));
    outside.send(Command::Start);
    scan(&mut board, 4);
    assert_eq!(outside.conversions.get(), 4 * 2 * 3 * 2, "two rows of three electrodes, each twice");
    let messages = outside.messages();
    let frames = frames(&messages);
    let expected = [[3, 0], [3, 9], [15, 15], [3, 0]];
    for (frame, grounds) in frames.iter().zip(expected) {
        assert_eq!(Some(&frame.scope), Scope::of_rows(16, &grounds, 0b1000_0000_0000_0110).as_ref());
        assert_eq!(frame.head.fraction_bits, 1, "the plan's average counts");
        assert_eq!(frame.readings, [202, 204, 230, 202, 204, 230]);
    }
    assert_eq!(frames.iter().map(|frame| frame.head.sequence).collect::<Vec<_>>(), [0, 1, 2, 3]);
    // Six conversions of two times three, and two settle times.
    let step_us = frames[1].head.time_us - frames[0].head.time_us;
    assert_eq!(u64::from(step_us), 2 * (20 + 6 * CONVERSION_US));
}

/// As fast as a slow line is, whatever it takes.
#[test]
fn a_slow_line_carries_each_frame_of_a_plan_in_turn() {
    let outside = Outside::default();
    outside.set_room(1);
    let mut board = simple_board(&outside, restless);
    outside.send(Command::Scan(plan(&[3, 0, 9, 1, 12], 0xFFFF, 1, 0)));
    outside.send(Command::Start);
    scan(&mut board, 100);
    outside.set_room(usize::MAX);
    board.step().unwrap();
    let messages = outside.messages();
    let (frames, turn) = (frames(&messages), [3, 0, 9, 1, 12]);
    assert!(frames.len() >= 100);
    for (frame, ground) in frames.iter().zip(turn.iter().cycle()) {
        assert_eq!(frame.scope.ground(0), *ground);
    }
    let folded: u32 = frames.iter().map(|frame| u32::from(frame.head.folded)).sum();
    assert!(folded > 50, "{folded}");
}

#[test]
fn the_multiplexer_grounds_what_the_plan_says() {
    let grounded = std::rc::Rc::new(std::cell::RefCell::new(Vec::new()));
    let outside = Outside::default();
    let mux = NotingMux(std::rc::Rc::clone(&grounded));
    let mut board = board(&outside, mux, numbered, embedded_hal_mock::eh1::delay::NoopDelay::new());
    outside.send(Command::Scan(plan(&[7, 2, 7], 1 << 4 | 1 << 9, 3, 0)));
    outside.send(Command::Start);
    scan(&mut board, 2);
    assert_eq!(grounded.take(), [7, 104, 109, 2, 104, 109, 7, 104, 109].repeat(2));
}

/// Notes grounds, and selected electrodes as a hundred more.
struct NotingMux(std::rc::Rc<std::cell::RefCell<Vec<u8>>>);

impl tactomo_firmware::Mux for NotingMux {
    type Error = std::convert::Infallible;
    const SELECT_US: u16 = 0;

    fn ground(&mut self, electrode: u8) -> Result<(), Self::Error> {
        self.0.borrow_mut().push(electrode);
        Ok(())
    }

    fn select(&mut self, electrode: u8) -> Result<(), Self::Error> {
        self.0.borrow_mut().push(100 + electrode);
        Ok(())
    }
}

#[test]
fn a_plan_begins_at_once_with_its_first_row_and_the_frame_before_has_no_number() {
    let outside = Outside::default();
    let mut board = simple_board(&outside, by_electrode);
    outside.send(Command::Start);
    scan(&mut board, 1);
    step(&mut board, 5);
    outside.send(Command::Scan(plan(&[1, 2, 3, 4, 5, 6], 0xFFFF, 2, 0)));
    scan(&mut board, 1);
    board.step().unwrap();
    // Other settings: the plan stays, and begins anew.
    outside.send(Command::Configure(Settings { settle_us: 7, average_log2: 4, ..Settings::default() }));
    scan(&mut board, 1);
    step(&mut board, 1);
    outside.send(Command::Scan(Plan::default()));
    scan(&mut board, 1);
    let messages = outside.messages();
    let told: Vec<_> = frames(&messages)
        .iter()
        .map(|frame| (frame.head.sequence, frame.scope.clone(), frame.head.fraction_bits))
        .collect();
    let rows = Scope::of_rows(16, &[1, 2], 0xFFFF).unwrap();
    let whole = Scope::whole(16).unwrap();
    assert_eq!(told, [(0, whole.clone(), 0), (1, rows.clone(), 0), (2, rows, 0), (3, whole, 4)]);
}

#[test]
fn a_plan_that_does_not_fit_is_refused_and_the_old_one_stays() {
    let outside = Outside::default();
    let mut board = simple_board(&outside, by_electrode);
    let good = plan(&[5, 6], 1, 2, 0);
    outside.send_tagged(9, Command::Scan(good));
    board.step().unwrap();
    outside.messages();
    for bad in [plan(&[16], 1, 1, 0), plan(&[0], 1 << 16, 1, 0), plan(&[0; 17], 0xFFFF, 17, 0), plan(&[0], 1, 1, 9)] {
        outside.send_tagged(10, Command::Scan(bad));
        board.step().unwrap();
        let messages = outside.messages();
        assert_eq!(faults(&messages), [&Fault::BadPlan { answers: 10 }]);
        assert_eq!(messages.len(), 1);
    }
    outside.send(Command::Start);
    scan(&mut board, 1);
    assert_eq!(frames(&outside.messages())[0].readings, [100, 100]);
}

#[test]
fn the_largest_frames_of_rows_fit() {
    let outside = Outside::default();
    let mut board = simple_board(&outside, |_, _| Ok(4095));
    let backwards: Vec<u8> = (0..16).rev().collect();
    for (grounds, reads) in [(&backwards[..], 0xFFFF), (&[3; 32], 0xFF)] {
        outside.send(Command::Scan(plan(grounds, reads, grounds.len() as u8, 4)));
        outside.send(Command::Start);
        scan(&mut board, 2);
        let messages = outside.messages();
        assert_eq!(frames(&messages)[0].readings, [0xFFF0; 256]);
        assert_eq!(frames(&messages)[0].scope.rows(), grounds.len());
    }
}

#[test]
fn every_electrode_saturates_where_its_own_converter_does_and_the_last_range_has_those_that_are_left() {
    // The last range is told of too few electrodes, and of too many.
    for (electrodes, of_the_last) in [(4, 15), (99, 6)] {
        let outside = Outside::default();
        let ranges = [(6, 142, 3000), (electrodes, 128, 2000)].map(|(electrodes, floor, ceiling)| Range {
            floor,
            ceiling,
            ..Range::of_codes(electrodes, 12)
        });
        let identity = Identity { adc: Adc::new(12, 4096).with_ranges(&ranges), ..IDENTITY };
        let sample = |number: u64, electrode: u8| {
            Ok(match (number / 256, electrode) {
                (0, 5) => 2999,
                (0, _) => 1999,
                (1, 5) => 2500,
                (2, electrode) if electrode == of_the_last => 2500,
                _ => 0,
            })
        };
        let parts = Parts {
            mux: NoMux,
            sampler: sampler(&outside, sample),
            serial: serial(&outside),
            chip: NullPart,
            touch: NoTouch,
        };
        let mut board = Board16::new(parts, identity).unwrap();
        outside.send(Command::Start);
        let mut scanned = 0;
        while scanned < 4 {
            scanned += u32::from(board.step().unwrap() == Activity::Frame);
        }
        board.step().unwrap();
        let messages = outside.messages();
        let status: Vec<_> = frames(&messages).iter().map(|frame| frame.head.status).collect();
        assert_eq!(status[..3], [Status::default(), Status::default(), Status::SATURATED]);
        let told: Vec<_> = hellos(&messages)[0].ranges.iter().map(|range| (range.electrodes, range.floor)).collect();
        assert_eq!(told, [(6, 142), (10, 128)]);
    }
}
