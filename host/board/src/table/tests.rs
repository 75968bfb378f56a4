//! What boards say to a table, and what becomes of it.

use tactomo_protocol::{CommandReceiver, Hello, encode_board};

use super::*;

const TABLE: [u8; 300] = [7; 300];
const ID: TableId = TableId { layout: 1, checksum: 0x0707_0707 };
const OTHER: TableId = TableId { layout: 1, checksum: 1 };

/// A board that answers a piece as `says` has it; `None` is a refusal.
struct Board<F> {
    receiver: CommandReceiver,
    to_host: Vec<u8>,
    pieces: Vec<(u32, usize)>,
    says: F,
}

impl<F: FnMut(&TablePiece) -> Option<TableState> + Send> Board<F> {
    fn new(says: F) -> Self {
        Self { receiver: CommandReceiver::default(), to_host: Vec::new(), pieces: Vec::new(), says }
    }

    fn say(&mut self, message: &BoardMessage) {
        let mut packet = [0; 256];
        let length = encode_board(message, &mut packet).unwrap();
        self.to_host.extend(&packet[..length]);
    }

    fn give(&mut self) -> Result<TableId, TableError> {
        send(self, &TABLE, |_| {})
    }
}

impl<F: FnMut(&TablePiece) -> Option<TableState> + Send> Link for Board<F> {
    fn name(&self) -> String {
        "board".to_owned()
    }

    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let count = buffer.len().min(self.to_host.len());
        buffer.iter_mut().zip(self.to_host.drain(..count)).for_each(|(to, byte)| *to = byte);
        Ok(count)
    }

    fn write_all(&mut self, mut bytes: &[u8]) -> io::Result<()> {
        while let Some(request) = self.receiver.receive(&mut bytes) {
            let Ok(Request { tag, command }) = request else { continue };
            // Answers to others come before.
            for answers in [0, tag.wrapping_add(1).max(1)] {
                self.say(&BoardMessage::Table(TableState { answers, room: 0, held: 9, usable: Some(ID) }));
                self.say(&BoardMessage::Hello(Hello { answers, ..Hello::example(16) }));
                self.say(&BoardMessage::Fault(Fault::NoTable { answers }));
            }
            if let Command::Table(piece) = command {
                if !piece.bytes.is_empty() {
                    self.pieces.push((piece.at, piece.bytes.len()));
                }
                match (self.says)(&piece) {
                    Some(state) => self.say(&BoardMessage::Table(TableState { answers: tag, ..state })),
                    None => {
                        self.say(&BoardMessage::Fault(Fault::NoTable { answers: tag }));
                        continue;
                    }
                }
            }
            self.say(&BoardMessage::Hello(Hello { answers: tag, ..Hello::example(16) }));
        }
        Ok(())
    }
}

fn state(held: usize, usable: Option<TableId>) -> Option<TableState> {
    Some(TableState { answers: 0, room: 1000, held: held as u32, usable })
}

/// Where a piece ends; the whole table is usable then.
fn taken(piece: &TablePiece) -> Option<TableState> {
    let end = piece.at as usize + piece.bytes.len();
    state(end, (end == TABLE.len()).then_some(ID))
}

#[test]
fn a_table_goes_over_in_pieces_once_and_one_that_is_there_not_at_all() {
    let mut board = Board::new(taken);
    assert_eq!(board.give().unwrap(), ID);
    assert_eq!(board.pieces, [(0, 64), (64, 64), (128, 64), (192, 64), (256, 44)]);
    let mut board = Board::new(|_: &TablePiece| state(TABLE.len(), Some(ID)));
    assert_eq!(board.give().unwrap(), ID);
    assert_eq!(board.pieces, []);
    // What it uses meanwhile is not what it is given.
    let mut board = Board::new(|piece: &TablePiece| match taken(piece) {
        Some(TableState { usable: None, held, .. }) => state(held as usize, Some(OTHER)),
        whole => whole,
    });
    assert_eq!((board.give().unwrap(), board.pieces.len()), (ID, 5));
}

#[test]
fn a_board_that_has_lost_some_is_given_it_again_and_one_that_loses_it_for_ever_is_given_up() {
    // It starts anew at one byte, so often.
    let restarting = |at: u32, mut times: u32| {
        Board::new(move |piece: &TablePiece| {
            let restarts = piece.at == at && !piece.bytes.is_empty() && times > 0;
            times -= u32::from(restarts);
            if restarts { state(0, None) } else { taken(piece) }
        })
    };
    for at in [0, 64, 256] {
        for times in 0..=3 {
            let mut board = restarting(at, times);
            assert_eq!(board.give().unwrap(), ID, "{times} times at {at}");
            assert_eq!(board.pieces.iter().filter(|piece| **piece == (0, 64)).count(), 1 + times as usize);
        }
        for times in [4, u32::MAX] {
            let mut board = restarting(at, times);
            let error = board.give().unwrap_err();
            assert!(matches!(error, TableError::Forgets { at: found, .. } if found == at as usize), "{error}");
            assert_eq!(board.pieces.iter().filter(|piece| piece.0 == 0).count(), 4);
        }
    }
    // One that goes back a little each time, and one that says that it has what was never sent.
    let mut board = Board::new(|piece: &TablePiece| state((piece.at as usize).saturating_sub(1), None));
    assert!(matches!(board.give(), Err(TableError::Forgets { .. })));
    assert!(board.pieces.len() <= 4);
    let mut board = Board::new(|piece: &TablePiece| state(if piece.bytes.is_empty() { 0 } else { usize::MAX }, None));
    assert!(matches!(board.give(), Err(TableError::Refused { at: 300, .. })));
}

#[test]
fn a_board_without_room_is_sent_nothing_and_a_refusal_says_where() {
    for (room, sent) in [(0, 0), (299, 0), (300, 5)] {
        let mut board = Board::new(move |piece: &TablePiece| Some(TableState { room, ..taken(piece)? }));
        let result = board.give();
        assert_eq!(board.pieces.len(), sent);
        match room {
            0 => assert!(matches!(result, Err(TableError::NoRoom { .. }))),
            299 => assert!(matches!(result, Err(TableError::TooLong { bytes: 300, room: 299, .. }))),
            _ => assert_eq!(result.unwrap(), ID),
        }
    }
    for at in [0, 64, 256] {
        let mut board =
            Board::new(move |piece: &TablePiece| taken(piece).filter(|_| piece.bytes.is_empty() || piece.at != at));
        let result = board.give();
        assert!(matches!(result, Err(TableError::Refused { at: found, .. }) if found == at as usize), "{result:?}");
    }
}
