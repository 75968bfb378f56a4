//! The rate of the line: a host sets it on trial and confirms it, and where no host is heard it goes back by itself.

use crate::uplink::Uplink;
use crate::{Chip, Serial};

/// How long a rate is on trial (us). A host needs four round trips, of which each takes up to 32 ms over a bridge that keeps bytes back for 16 ms.
const TRIAL_US: u64 = 300_000;
/// Without a whole command for so long (us) the line goes back to its first rate. A host that is there says one every half second.
const SILENCE_US: u64 = 2_000_000;

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Phase {
    /// A host has confirmed the rate, or it is the first.
    #[default]
    Kept,
    /// The rate is changed as soon as what is being sent and the answers that wait have gone.
    Leaving { to: usize, is_trial: bool },
    /// Nothing is sent before a whole command has come at the new rate, and the rate is given up unless it is confirmed.
    Trial,
}

/// Which of [`Serial::rates`] the line has.
#[derive(Debug, Default)]
pub(crate) struct Rate {
    now: usize,
    /// The last that was confirmed.
    kept: usize,
    phase: Phase,
    /// When the trial began, or, at a rate that is kept, when a whole command came last (us).
    since_us: u64,
}

impl Rate {
    /// Sets the line to `baud` on trial, once the answer has gone, or confirms the rate that it has; returns whether the line has such a rate.
    pub(crate) fn ask(&mut self, baud: u32, serial: &impl Serial) -> bool {
        let Some(to) = serial.rates().iter().position(|rate| *rate == baud) else { return false };
        if to == self.now {
            (self.kept, self.phase) = (to, Phase::Kept);
        } else {
            self.phase = Phase::Leaving { to, is_trial: true };
        }
        true
    }

    /// Takes note of a whole command, which was obeyed and answered.
    pub(crate) fn heard<const R: usize, const W: usize>(&mut self, chip: &mut impl Chip, uplink: &mut Uplink<R, W>) {
        if self.now > 0 && self.phase == Phase::Kept {
            self.since_us = chip.now_us();
        }
        match self.phase {
            Phase::Leaving { .. } => uplink.hold(),
            Phase::Kept | Phase::Trial => uplink.release(),
        }
    }

    /// Changes the rate where that is due.
    #[inline]
    pub(crate) fn turn<const R: usize, const W: usize>(
        &mut self,
        serial: &mut impl Serial,
        chip: &mut impl Chip,
        uplink: &mut Uplink<R, W>,
    ) {
        if self.now > 0 || self.phase != Phase::Kept {
            self.look(serial, chip, uplink);
        }
    }

    #[cold]
    fn look<const R: usize, const W: usize>(
        &mut self,
        serial: &mut impl Serial,
        chip: &mut impl Chip,
        uplink: &mut Uplink<R, W>,
    ) {
        match self.phase {
            Phase::Kept => self.leave_after(SILENCE_US, 0, chip, uplink),
            Phase::Trial => self.leave_after(TRIAL_US, self.kept, chip, uplink),
            Phase::Leaving { to, is_trial } if uplink.is_held() => {
                self.change(to, is_trial, serial);
                self.since_us = chip.now_us();
                if !is_trial {
                    uplink.release();
                }
            }
            Phase::Leaving { .. } => {}
        }
    }

    fn change(&mut self, to: usize, is_trial: bool, serial: &mut impl Serial) {
        if let Some(baud) = serial.rates().get(to) {
            serial.set_baud(*baud);
        }
        self.now = to;
        // From the first rate there is nowhere to go back to.
        if !is_trial || to == 0 {
            self.kept = to;
        }
        self.phase = if is_trial { Phase::Trial } else { Phase::Kept };
    }

    /// Leaves for a rate without being asked, if the phase has taken this long.
    fn leave_after<const R: usize, const W: usize>(
        &mut self,
        bound_us: u64,
        to: usize,
        chip: &mut impl Chip,
        uplink: &mut Uplink<R, W>,
    ) {
        if chip.now_us().saturating_sub(self.since_us) >= bound_us {
            self.phase = Phase::Leaving { to, is_trial: false };
            uplink.hold();
        }
    }
}
