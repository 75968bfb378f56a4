//! The ADG726: two 16-channel switches (halves A and B) on common address lines, with a latch for each half.
//!
//! After its data sheet (Analog Devices, ADG726/ADG732), times rounded to the safe side: with WR and a half's chip select (CSA, CSB) low, that half follows the
//! address lines; it keeps what it had once WR or its chip select is high. EN is active low and is latched along with the
//! address. A change of address breaks before it makes, so two electrodes are never joined. All its times are shorter than
//! two writes to a GPIO register of the chips used here, so that only `select` needs a wait of its own, for the
//! analogue side: [`Mux::SELECT_US`]. The ADG732 (one switch, 32 channels, five lines) works as [`Transparent`] does, two of them as [`Latched`] does, and two
//! ADG726 as [`Paired`] does.

use embedded_hal::digital::OutputPin;

/// Time from a new address to the new switch's conduction (ns), at most, at 3 V and over temperature.
pub const TRANSITION_NS: u32 = 50;
/// Time for which no switch conducts when the address changes (ns), at least.
pub const BREAK_BEFORE_MAKE_NS: u32 = 1;
/// Shortest low pulse of WR that latches an address (ns).
pub const WRITE_PULSE_NS: u32 = 10;
/// Time that the address and EN are stable before WR rises (ns), at least.
pub const ADDRESS_SETUP_NS: u32 = 5;

/// Brings electrodes to ground, and where there is one ADC input only, to that.
pub trait Mux {
    /// Error of the pins.
    type Error;

    /// Wait between [`select`](Self::select) and the first conversion after a reset, in microseconds (us); the host may set another one
    /// ([`Settings::select_us`](tactomo_protocol::Settings::select_us)). 0 where every electrode has an input of its own: then none is waited.
    const SELECT_US: u16;

    /// Grounds `electrode` and lets go of the one grounded before.
    ///
    /// # Errors
    /// If a pin cannot be driven.
    fn ground(&mut self, electrode: u8) -> Result<(), Self::Error>;

    /// Brings `electrode` to the ADC.
    ///
    /// # Errors
    /// If a pin cannot be driven.
    fn select(&mut self, electrode: u8) -> Result<(), Self::Error>;
}

/// Address lines A0 (first) and up, driven one after the other. An electrode beyond them wraps.
#[derive(Debug)]
struct Address<P, const LINES: usize>([P; LINES]);

impl<P: OutputPin, const LINES: usize> Address<P, LINES> {
    fn set(&mut self, electrode: u8) -> Result<(), P::Error> {
        let bits = usize::from(electrode);
        self.0.iter_mut().enumerate().try_for_each(|(line, pin)| pin.set_state((bits >> line & 1 == 1).into()))
    }
}

/// WR, CSA, CSB and EN tied low, so that the address lines act at once: four GPIOs ground an electrode, and every electrode has
/// an ADC input of its own.
#[derive(Debug)]
pub struct Transparent<P, const LINES: usize = 4>(Address<P, LINES>);

impl<P: OutputPin, const LINES: usize> Transparent<P, LINES> {
    /// A multiplexer on the address lines A0, A1, A2, A3 (and A4 of an ADG732).
    pub fn new(address: [P; LINES]) -> Self {
        Self(Address(address))
    }
}

impl<P: OutputPin, const LINES: usize> Mux for Transparent<P, LINES> {
    type Error = P::Error;
    const SELECT_US: u16 = 0;

    fn ground(&mut self, electrode: u8) -> Result<(), P::Error> {
        self.0.set(electrode)
    }

    /// Nothing to do: every electrode has an ADC input of its own.
    fn select(&mut self, _electrode: u8) -> Result<(), P::Error> {
        Ok(())
    }
}

/// Half A (drain DA at 0 V) grounds an electrode, half B (drain DB at the one ADC input) brings an electrode to the converter;
/// both halves' sources go to the same 16 electrodes. With five address lines the halves are two ADG732, of 32 electrodes, whose CS are
/// `csa` and `csb`.
#[derive(Debug)]
pub struct Latched<P, const LINES: usize = 4> {
    address: Address<P, LINES>,
    lines: LatchLines<P>,
}

/// The lines that latch an address, all active low.
#[derive(Debug)]
pub struct LatchLines<P> {
    /// Write.
    pub wr: P,
    /// Chip select of half A, or of the chip that grounds.
    pub csa: P,
    /// Chip select of half B, or of the chip that reads.
    pub csb: P,
}

impl<P: OutputPin, const LINES: usize> Latched<P, LINES> {
    /// A multiplexer on the address lines A0 to A3 (and A4 of two ADG732) and the lines of its latches, which are driven high (idle).
    ///
    /// # Errors
    /// If a pin cannot be driven.
    pub fn new(address: [P; LINES], lines: LatchLines<P>) -> Result<Self, P::Error> {
        Ok(Self { address: Address(address), lines: lines.idle()? })
    }
}

impl<P: OutputPin> LatchLines<P> {
    /// Drives all of them high.
    fn idle(mut self) -> Result<Self, P::Error> {
        self.wr.set_high()?;
        self.csa.set_high()?;
        self.csb.set_high()?;
        Ok(self)
    }
}

/// Passes the address on to the half whose chip select is `select`: the latch opens only while the address is at rest.
fn latch<P: OutputPin>(wr: &mut P, select: &mut P) -> Result<(), P::Error> {
    select.set_low()?;
    wr.set_low()?;
    wr.set_high()?;
    select.set_high()
}

/// [`Mux::SELECT_US`] of [`Latched`], in microseconds (us).
///
/// Half B, the ADC input and its sampling capacitor hold 228 pF (200, 20 and 8: data sheet of the ADG726, and `docs/hardware.md`). Half an LSB of
/// 12 bits is 9.0 time constants: so long, up to 8.3 kilohm charge them. That is more than the pads of the smallest detector of foam A have
/// (electrodes of a radius of 0.5 mm: 2.2 kilohm, and as much again on the way to ground), with 1 kilohm of protection. What has more needs a
/// longer wait, or conversions that are thrown away for the charge that the last electrode has left: `tactomo board check` says which.
pub const ONE_INPUT_SELECT_US: u16 = 17;

impl<P: OutputPin, const LINES: usize> Mux for Latched<P, LINES> {
    type Error = P::Error;
    const SELECT_US: u16 = ONE_INPUT_SELECT_US;

    fn ground(&mut self, electrode: u8) -> Result<(), P::Error> {
        self.address.set(electrode)?;
        latch(&mut self.lines.wr, &mut self.lines.csa)
    }

    fn select(&mut self, electrode: u8) -> Result<(), P::Error> {
        self.address.set(electrode)?;
        latch(&mut self.lines.wr, &mut self.lines.csb)
    }
}

/// Electrodes of each ADG726 of a pair.
const PAIRED: u8 = 16;

/// Two ADG726 for 32 electrodes: electrodes 0 to 15 at the first one, 16 to 31 at the second. Address lines, WR, CSA and CSB go to both; each
/// has its EN to itself, which is the fifth line of the address: as the latches take EN along, the half of the chip that is not meant is latched
/// off. Both DA are at ground, both DB at the one ADC input.
#[derive(Debug)]
pub struct Paired<P> {
    address: Address<P, 4>,
    lines: LatchLines<P>,
    enables: [P; 2],
    /// Which chip's half A and half B conduct.
    conducting: [Option<usize>; 2],
}

/// A half of both chips.
#[derive(Clone, Copy, Debug)]
enum Half {
    A = 0,
    B = 1,
}

impl<P: OutputPin> Paired<P> {
    /// Multiplexers on the address lines A0 to A3, the lines of the latches, and EN of the first and of the second one, which are driven
    /// high (idle and off).
    ///
    /// # Errors
    /// If a pin cannot be driven.
    pub fn new(address: [P; 4], lines: LatchLines<P>, mut enables: [P; 2]) -> Result<Self, P::Error> {
        enables.iter_mut().try_for_each(OutputPin::set_high)?;
        Ok(Self { address: Address(address), lines: lines.idle()?, enables, conducting: [None; 2] })
    }

    /// Brings a half to an electrode. A half that changes chips is off in both for a moment, as two chips do not break before they make.
    fn set(&mut self, half: Half, electrode: u8) -> Result<(), P::Error> {
        let chip = usize::from(electrode / PAIRED) % self.enables.len();
        self.address.set(electrode % PAIRED)?;
        self.enables.iter_mut().try_for_each(OutputPin::set_high)?;
        if self.conducting[half as usize] != Some(chip) {
            self.strobe(half)?;
            self.conducting[half as usize] = Some(chip);
        }
        self.enables[chip].set_low()?;
        self.strobe(half)
    }

    fn strobe(&mut self, half: Half) -> Result<(), P::Error> {
        let select = match half {
            Half::A => &mut self.lines.csa,
            Half::B => &mut self.lines.csb,
        };
        latch(&mut self.lines.wr, select)
    }
}

impl<P: OutputPin> Mux for Paired<P> {
    type Error = P::Error;
    /// Twice what one chip needs, as two drains are at the ADC input: 428 pF.
    const SELECT_US: u16 = 2 * ONE_INPUT_SELECT_US;

    fn ground(&mut self, electrode: u8) -> Result<(), P::Error> {
        self.set(Half::A, electrode)
    }

    fn select(&mut self, electrode: u8) -> Result<(), P::Error> {
        self.set(Half::B, electrode)
    }
}

/// A multiplexer whose EN (active low) has a pin: all switches stay open from the reset until the first scan, so that the
/// detector cannot pull on inputs that the chip reads at its start.
#[derive(Debug)]
pub struct Enabled<M, P> {
    mux: M,
    enable: P,
}

impl<P: OutputPin, M: Mux<Error = P::Error>> Enabled<M, P> {
    /// Drives EN high (off) until the first electrode is grounded.
    ///
    /// # Errors
    /// If the pin cannot be driven.
    pub fn new(mux: M, mut enable: P) -> Result<Self, P::Error> {
        enable.set_high()?;
        Ok(Self { mux, enable })
    }
}

impl<P: OutputPin, M: Mux<Error = P::Error>> Mux for Enabled<M, P> {
    type Error = P::Error;
    const SELECT_US: u16 = M::SELECT_US;

    fn ground(&mut self, electrode: u8) -> Result<(), P::Error> {
        self.enable.set_low()?;
        self.mux.ground(electrode)
    }

    fn select(&mut self, electrode: u8) -> Result<(), P::Error> {
        self.mux.select(electrode)
    }
}
