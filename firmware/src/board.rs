//! The command loop: what a board does from its reset on.

use heapless::String;
use tactomo_protocol::{
    BoardMessage, Clock, Command, CommandReceiver, DecodeError, Fault, Hello, MAX_ELECTRODES, MIN_ELECTRODES, Output,
    Plan, Request, Settings, TableState, contacts, frame, scope, wire_bytes,
};

use crate::inbox::Inbox;
use crate::pace::Pace;
use crate::rate::Rate;
use crate::row::Attended;
use crate::scan::{FrontEnd, Scan, Scanned};
use crate::uplink::Uplink;
use crate::{Adc, Chip, Mux, NoTouch, Parts, Sampler, Serial, Touch};

/// Longest packets of a frame of `electrodes` and its contacts on the wire, in bytes.
pub const fn frame_bytes(electrodes: usize) -> usize {
    wire_bytes(
        1 + frame::HEAD_BYTES + scope::MAX_SCOPE_BYTES + 2 * electrodes * electrodes + tactomo_protocol::CRC_BYTES,
    ) + contacts::MAX_WIRE
}

/// A board with room for 16 electrodes.
pub type Board16<M, S, L, C, T = NoTouch> = Board<M, S, L, C, T, 256, { frame_bytes(16) }>;
/// A board with room for 32 electrodes.
pub type Board32<M, S, L, C, T = NoTouch> = Board<M, S, L, C, T, 1024, { frame_bytes(32) }>;

/// What a board says about itself.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Identity<'a> {
    /// Version of the board's firmware; the first 24 bytes are sent.
    pub firmware_version: &'a str,
    /// Name of the board, such as `esp32`; the first 24 bytes are sent.
    pub board: &'a str,
    /// Electrodes scanned.
    pub electrodes: u8,
    /// What the converter gives.
    pub adc: Adc,
    /// Voltage of the driving layer (mV).
    pub drive_mv: u16,
}

/// A board that cannot be made.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum NewBoardError {
    /// The protocol carries 4 to 32 electrodes, and the readings need room.
    #[error("{0} electrodes: a board scans {MIN_ELECTRODES} to {MAX_ELECTRODES}, as far as its type has room")]
    Electrodes(u8),
    /// A reading has 16 bits.
    #[error("a converter of {0} bits: 1 to 16 fit")]
    AdcBits(u8),
    /// A range without electrodes or codes.
    #[error("the converters' ranges do not fit the electrodes and codes")]
    Ranges,
    /// Without them the host cannot make volts of readings.
    #[error("the converter's full scale and the drive need to be above 0 mV")]
    Millivolts,
}

/// What a step did.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Activity {
    /// Nothing to scan until the host says so, or gives a table to a board that needs no host.
    Idle,
    /// Nothing to scan before this board time (us): the frame-rate cap.
    Waiting {
        /// Board time at which the next frame is due (us).
        until_us: u64,
    },
    /// One row of a frame.
    Row,
    /// The last row of a frame, which is to be sent if anybody streams.
    Frame,
}

/// A board: its parts, the scan, the uplink, and the state that commands change.
#[derive(Debug)]
pub struct Board<M, S, L, C, T, const READINGS: usize, const WIRE: usize> {
    parts: Parts<M, S, L, C, T>,
    adc: Adc,
    hello: Hello,
    inbox: Inbox,
    receiver: CommandReceiver,
    scan: Scan<READINGS>,
    uplink: Uplink<READINGS, WIRE>,
    pace: Pace,
    rate: Rate,
    /// Whether the host knows that the converter is stuck.
    stuck_reported: bool,
    /// What went wrong before the reset, until a host has surely heard of it.
    boot_fault: Option<Fault>,
}

impl<M: Mux, S: Sampler, L: Serial, C: Chip, T: Touch, const READINGS: usize, const WIRE: usize>
    Board<M, S, L, C, T, READINGS, WIRE>
{
    /// A board that will say Hello and wait for commands.
    ///
    /// # Errors
    /// [`NewBoardError`] if the identity does not fit the protocol or this type's room.
    pub fn new(mut parts: Parts<M, S, L, C, T>, identity: Identity) -> Result<Self, NewBoardError> {
        let electrodes = NewBoardError::Electrodes(identity.electrodes);
        if usize::from(identity.electrodes) < MIN_ELECTRODES || WIRE < frame_bytes(usize::from(identity.electrodes)) {
            return Err(electrodes);
        }
        if !(1..=16).contains(&identity.adc.bits) {
            return Err(NewBoardError::AdcBits(identity.adc.bits));
        }
        if identity.adc.full_scale_mv == 0 || identity.drive_mv == 0 {
            return Err(NewBoardError::Millivolts);
        }
        let hello = hello(&identity, M::SELECT_US);
        if !hello.is_valid() {
            return Err(NewBoardError::Ranges);
        }
        let scan = Scan::new(identity.electrodes, &identity.adc).ok_or(electrodes)?;
        let mut uplink = Uplink::default();
        uplink.message(&BoardMessage::Hello(hello.clone()));
        parts.touch.meet(&hello);
        Ok(Self {
            parts,
            adc: identity.adc,
            hello,
            inbox: Inbox::default(),
            receiver: CommandReceiver::default(),
            scan,
            uplink,
            pace: Pace::default(),
            rate: Rate::default(),
            stuck_reported: false,
            boot_fault: None,
        })
    }

    /// Tells the host what went wrong before the reset. A host that was not listening yet hears it again after its first
    /// command.
    pub fn report(&mut self, fault: Fault) {
        self.fault(fault.clone());
        self.boot_fault = Some(fault);
    }

    /// Runs until a pin of the multiplexer fails: forever, where pins are infallible.
    pub fn run(&mut self) -> M::Error {
        loop {
            if let Err(error) = self.step() {
                return error;
            }
        }
    }

    /// Handles what was received and scans one row, if one is due. Takes one settle time and one row of conversions at most, and what the touch part takes for a
    /// [piece](Touch::go_on) of its work.
    ///
    /// # Errors
    /// If a pin of the multiplexer cannot be driven.
    pub fn step(&mut self) -> Result<Activity, M::Error> {
        self.parts.chip.feed_watchdog();
        self.rate.turn(&mut self.parts.serial, &mut self.parts.chip, &mut self.uplink);
        self.receive();
        self.go_on();
        let activity = self.scan_if_due();
        self.uplink.poll(&mut self.parts.serial, &mut self.parts.chip);
        activity
    }

    fn receive(&mut self) {
        // A flood does not hold up the scan: no more than fits the inbox is looked at in one step.
        self.inbox.fill(&mut self.parts.serial);
        let mut looked_at = 0;
        while let Some(request) = self.next_request(&mut looked_at) {
            match request {
                Ok(request) => self.obey(request),
                Err(DecodeError::Version(version)) => self.fault(Fault::UnknownVersion(version)),
                // Noise is dropped; a body that this version does not know cannot be answered.
                Err(_) => {}
            }
        }
        self.inbox.clear();
    }

    /// The next command among the bytes that came, of which so many were looked at.
    fn next_request(&mut self, looked_at: &mut usize) -> Option<Result<Request, DecodeError>> {
        let mut input = self.inbox.bytes().get(*looked_at..)?;
        let request = self.receiver.receive(&mut input);
        *looked_at = self.inbox.bytes().len() - input.len();
        request
    }

    fn obey(&mut self, Request { tag, command }: Request) {
        match self.carry_out(tag, command) {
            Ok(()) => {
                // Before the Hello, behind which nothing may come while the line's rate changes.
                let time_us = self.parts.chip.now_us() as u32;
                self.uplink.message(&BoardMessage::Clock(Clock { answers: tag, time_us }));
                self.say_hello(tag);
            }
            Err(refusal) => self.fault(refusal),
        }
        self.boot_fault.take().into_iter().for_each(|fault| self.fault(fault));
        self.rate.heard(&mut self.parts.chip, &mut self.uplink);
    }

    /// # Errors
    /// The fault that refuses the command.
    fn carry_out(&mut self, answers: u8, command: Command) -> Result<(), Fault> {
        match command {
            Command::Hello => {}
            Command::Start => self.start(),
            Command::Stop => self.stop(),
            Command::Configure(settings) if settings.is_valid() => self.configure(settings),
            Command::Configure(_) => return Err(Fault::BadSettings { answers }),
            Command::Scan(plan) if plan == *self.scan.plan() => {}
            Command::Scan(plan) => self.follow(plan, answers)?,
            Command::Rate { baud } if self.rate.ask(baud, &self.parts.serial) => {}
            Command::Rate { .. } => return Err(Fault::BadRate { answers }),
            Command::Output(output) => self.choose(output, answers)?,
            Command::Table(piece) => {
                let fits = self.parts.touch.take(&piece);
                if self.parts.touch.needs_frames() && !self.scan.plan().is_whole() {
                    self.scan.set_plan(Plan::default());
                }
                self.uplink.message(&BoardMessage::Table(TableState { answers, ..self.parts.touch.table() }));
                return if fits { Ok(()) } else { Err(Fault::NoTable { answers }) };
            }
        }
        Ok(())
    }

    /// Chooses what is streamed.
    fn choose(&mut self, output: Output, answers: u8) -> Result<(), Fault> {
        let had_frames = self.parts.touch.output().has_frames();
        if !self.parts.touch.set_output(output) {
            return Err(Fault::NoTable { answers });
        }
        if output.has_frames() && !had_frames {
            self.uplink.forget_keys();
        }
        Ok(())
    }

    fn start(&mut self) {
        if !self.hello.is_streaming {
            // One that was scanned all the time knows of rest, and of what touches.
            if !self.scans() {
                self.parts.touch.restart();
            }
            self.hello.is_streaming = true;
            self.stuck_reported = false;
            // Who starts it may be another host than before.
            self.uplink.forget_keys();
            self.scan.abandon();
            self.restart_pace();
        }
    }

    /// Whether there is anything to scan for.
    fn scans(&self) -> bool {
        self.hello.is_streaming || self.parts.touch.needs_frames()
    }

    /// Ends the stream; a frame that is already on its way may follow.
    fn stop(&mut self) {
        self.hello.is_streaming = false;
        self.scan.abandon();
    }

    /// Takes the settings over; the scan under way, begun under the old ones, is abandoned without a number.
    fn configure(&mut self, settings: Settings) {
        if self.hello.settings != settings {
            self.hello.settings = settings;
            self.scan.abandon();
            self.restart_pace();
        }
    }

    /// Takes a plan over; the frame under way is abandoned without a number.
    fn follow(&mut self, plan: Plan, answers: u8) -> Result<(), Fault> {
        let needs_all = !plan.is_whole() && self.parts.touch.needs_frames();
        if needs_all || !self.scan.set_plan(plan) {
            return Err(Fault::BadPlan { answers });
        }
        self.restart_pace();
        Ok(())
    }

    fn restart_pace(&mut self) {
        let now_us = self.parts.chip.now_us();
        self.pace.reset(now_us);
    }

    fn scan_if_due(&mut self) -> Result<Activity, M::Error> {
        if !self.scans() {
            return Ok(Activity::Idle);
        }
        if !self.scan.is_under_way() {
            let now_us = self.parts.chip.now_us();
            let until_us = self.pace.next_us();
            if now_us < until_us {
                return Ok(Activity::Waiting { until_us });
            }
            self.pace.begin(now_us, self.hello.settings.max_frames_per_s);
        }
        self.scan_row()
    }

    /// Goes on with what is still worked on of frames before.
    fn go_on(&mut self) {
        if self.scans() {
            let Self { parts: Parts { serial, chip, touch, .. }, uplink, inbox, .. } = self;
            touch.go_on(&mut attending(chip, uplink, serial, inbox));
        }
    }

    fn scan_row(&mut self) -> Result<Activity, M::Error> {
        let Self { parts, scan, uplink, inbox, .. } = self;
        let Parts { mux, sampler, serial, chip, touch } = parts;
        let line = &mut Line { uplink, serial, inbox, waits: !touch.needs_frames() };
        let mut front_end = FrontEnd { mux, sampler, chip, line, adc: self.adc, settings: self.hello.settings };
        match scan.row(&mut front_end)? {
            None => Ok(Activity::Row),
            Some(scanned) => {
                self.send(scanned);
                Ok(Activity::Frame)
            }
        }
    }

    fn send(&mut self, scanned: Scanned) {
        // What is scanned for the touch part alone goes nowhere else.
        let is_silent = self.parts.touch.needs_frames() && !self.hello.is_streaming;
        if scanned.stuck && !self.stuck_reported && !is_silent {
            self.fault(Fault::AdcStuck);
        }
        self.stuck_reported = scanned.stuck;
        let Self { parts, scan, uplink, inbox, .. } = self;
        let Parts { serial, chip, touch, .. } = parts;
        let mut attend = attending(chip, uplink, serial, inbox);
        let contacts = touch.contacts(&scanned, scan.scope(), scan.readings(), &mut attend);
        drop(attend);
        if !is_silent {
            let readings = touch.output().has_frames().then(|| (scan.scope(), scan.readings()));
            uplink.frame(&scanned, readings, contacts);
            let electrodes = touch.take_broken_wires();
            if electrodes != 0 {
                self.fault(Fault::BrokenWires { electrodes });
            }
        }
    }

    /// Says Hello in answer to the command with this tag, or, with 0, by itself.
    fn say_hello(&mut self, answers: u8) {
        self.uplink.message(&BoardMessage::Hello(Hello { answers, ..self.hello.clone() }));
    }

    fn fault(&mut self, fault: Fault) {
        self.uplink.message(&BoardMessage::Fault(fault));
    }
}

/// The line while a row is scanned.
struct Line<'a, L, const READINGS: usize, const WIRE: usize> {
    uplink: &'a mut Uplink<READINGS, WIRE>,
    serial: &'a mut L,
    inbox: &'a mut Inbox,
    /// Whether frames wait for it.
    waits: bool,
}

/// Keeps watchdog and line alive while something else goes on.
fn attending<C: Chip, L: Serial, const READINGS: usize, const WIRE: usize>(
    chip: &mut C,
    uplink: &mut Uplink<READINGS, WIRE>,
    serial: &mut L,
    inbox: &mut Inbox,
) -> impl FnMut() {
    move || {
        chip.feed_watchdog();
        Line { uplink, serial, inbox, waits: true }.transfer(chip);
    }
}

impl<L: Serial, C: Chip, const READINGS: usize, const WIRE: usize> Attended<C> for Line<'_, L, READINGS, WIRE> {
    fn has_room(&self) -> bool {
        !self.waits || self.uplink.has_room()
    }

    fn push(&mut self, chip: &mut C) {
        self.uplink.poll(self.serial, chip);
    }

    fn transfer(&mut self, chip: &mut C) {
        self.uplink.poll(self.serial, chip);
        self.inbox.fill(self.serial);
    }
}

fn hello(identity: &Identity, select_us: u16) -> Hello {
    Hello {
        answers: 0,
        firmware_version: cut(identity.firmware_version),
        board: cut(identity.board),
        electrodes: identity.electrodes,
        adc_bits: identity.adc.bits,
        adc_full_scale_mv: identity.adc.full_scale_mv,
        drive_mv: identity.drive_mv,
        settings: Settings { select_us, ..Settings::default() },
        is_streaming: false,
        ranges: identity.adc.ranges_of(identity.electrodes),
    }
}

/// As much of `text` as fits.
fn cut<const N: usize>(text: &str) -> String<N> {
    let mut short = String::new();
    let _ = text.chars().try_for_each(|letter| short.push(letter));
    short
}
