//! Multiplexers of 32 electrodes against switches that follow the data sheet, level by level.

use std::cell::RefCell;
use std::convert::Infallible;
use std::rc::Rc;

use embedded_hal::digital::{ErrorType, OutputPin};
use tactomo_firmware::mux::{LatchLines, Latched, Mux, Paired};

/// What the lines go to.
#[derive(Clone, Copy, Debug)]
enum Line {
    Address(usize),
    Write,
    Select(usize),
    Enable(usize),
}

/// Two halves of each chip, or two chips of one half each; a half is what a chip select belongs to.
#[derive(Default)]
struct Switches {
    address: usize,
    write: bool,
    selects: [bool; 2],
    /// EN of each chip (high is off).
    enables: [bool; 2],
    /// Electrodes of a chip.
    channels: usize,
    /// Chips that share the chip selects.
    chips: usize,
    /// What each half of each chip conducts to.
    closed: [[Option<usize>; 2]; 2],
    /// Whether two electrodes were ever joined by one half.
    joined: bool,
}

impl Switches {
    fn of(chips: usize, channels: usize) -> Rc<RefCell<Self>> {
        Rc::new(RefCell::new(Self { chips, channels, ..Self::default() }))
    }

    fn set(&mut self, line: Line, high: bool) {
        match line {
            Line::Address(bit) => self.address = self.address & !(1 << bit) | usize::from(high) << bit,
            Line::Write => self.write = high,
            Line::Select(half) => self.selects[half] = high,
            Line::Enable(chip) => self.enables[chip] = high,
        }
        let before = self.closed;
        // Latches are transparent while WR and their chip select are low, for the address and for EN.
        for chip in 0..self.chips {
            for half in (0..2).filter(|half| !self.write && !self.selects[*half]) {
                self.closed[chip][half] = (!self.enables[chip]).then_some(chip * self.channels + self.address);
            }
        }
        // Of two chips, the one may close before the other opens; each by itself breaks before it makes.
        let [first, second] = self.closed;
        self.joined |= (0..2).any(|half| {
            let meets =
                |before: [Option<usize>; 2], now: [Option<usize>; 2]| before[half].is_some() && now[half].is_some();
            meets(before[0], second) || meets(before[1], first)
        });
    }

    /// Electrodes that a half conducts to.
    fn conducting(&self, half: usize) -> Vec<usize> {
        self.closed.iter().filter_map(|chip| chip[half]).collect()
    }
}

struct Pin(Line, Rc<RefCell<Switches>>);

impl ErrorType for Pin {
    type Error = Infallible;
}

impl OutputPin for Pin {
    fn set_low(&mut self) -> Result<(), Infallible> {
        self.1.borrow_mut().set(self.0, false);
        Ok(())
    }

    fn set_high(&mut self) -> Result<(), Infallible> {
        self.1.borrow_mut().set(self.0, true);
        Ok(())
    }
}

fn latches(pin: impl Fn(Line) -> Pin) -> LatchLines<Pin> {
    LatchLines { wr: pin(Line::Write), csa: pin(Line::Select(0)), csb: pin(Line::Select(1)) }
}

/// Goes through a scan of 32 electrodes; every reading is of the electrode and the ground that it should be.
fn scan(mut mux: impl Mux<Error = Infallible>, switches: &Rc<RefCell<Switches>>) {
    for ground in 0..32 {
        let Ok(()) = mux.ground(ground);
        for electrode in 0..32 {
            let Ok(()) = mux.select(electrode);
            let switches = switches.borrow();
            assert_eq!(switches.conducting(0), [usize::from(ground)], "half A, at ({ground}, {electrode})");
            assert_eq!(switches.conducting(1), [usize::from(electrode)], "half B, at ({ground}, {electrode})");
        }
    }
    assert!(!switches.borrow().joined, "two electrodes were joined on the way");
}

#[test]
fn two_adg726_ground_and_select_each_of_32_electrodes_and_never_join_two() {
    let switches = Switches::of(2, 16);
    // What the latches hold at power-on is anything.
    switches.borrow_mut().closed = [[Some(3), None], [None, Some(20)]];
    let pin = |line| Pin(line, Rc::clone(&switches));
    let enables = [pin(Line::Enable(0)), pin(Line::Enable(1))];
    let Ok(mux) = Paired::new([0, 1, 2, 3].map(|bit| pin(Line::Address(bit))), latches(pin), enables);
    switches.borrow_mut().joined = false;
    scan(mux, &switches);
}

#[test]
fn two_adg732_ground_and_select_each_of_32_electrodes() {
    // One chip for each chip select, whose EN is tied low.
    let switches = Switches::of(1, 32);
    let pin = |line| Pin(line, Rc::clone(&switches));
    let Ok(mux) = Latched::new([0, 1, 2, 3, 4].map(|bit| pin(Line::Address(bit))), latches(pin));
    switches.borrow_mut().joined = false;
    scan(mux, &switches);
}
