//! What led to a boot, and what of it is reported to a host.

use heapless::String;
use tactomo_protocol::Fault;

use crate::PanicRecord;

/// What restarted the chip.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reset {
    /// Power came, somebody pressed the reset button, or the host asked for it: no fault.
    AsWanted,
    /// The supply sagged.
    BrownOut,
    /// The firmware fed its watchdog no more.
    Watchdog,
    /// The chip's own watchdog, of its slow clock.
    RtcWatchdog,
    /// The firmware itself, as after a panic.
    Software,
    /// The supply or the clock had a glitch.
    Glitch,
    /// Something else.
    Other,
    /// The chip does not say.
    Unknown,
}

impl Reset {
    /// Its name in a fault; `None` if it is none.
    pub const fn fault(self) -> Option<&'static str> {
        Some(match self {
            Self::AsWanted => return None,
            Self::BrownOut => "brown-out",
            Self::Watchdog => "watchdog",
            Self::RtcWatchdog => "RTC watchdog",
            Self::Software => "software",
            Self::Glitch => "power or clock glitch",
            Self::Other => "other",
            Self::Unknown => "unknown",
        })
    }

    /// What went wrong before this boot, if something did: a panic, whose record is forgotten, says more than the reset after it.
    pub fn boot_fault(self, record: &mut PanicRecord) -> Option<Fault> {
        match record.take() {
            Some(text) => Some(Fault::Panic(text)),
            None => String::try_from(self.fault()?).ok().map(Fault::Reset),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::RECORD_BYTES;

    const ALL: [Reset; 8] = [
        Reset::AsWanted,
        Reset::BrownOut,
        Reset::Watchdog,
        Reset::RtcWatchdog,
        Reset::Software,
        Reset::Glitch,
        Reset::Other,
        Reset::Unknown,
    ];

    #[test]
    fn every_reset_but_a_wanted_one_is_reported_by_its_name() {
        for reset in ALL {
            let mut memory = [0xA5; RECORD_BYTES];
            let reported = match reset.boot_fault(&mut PanicRecord(&mut memory)) {
                Some(Fault::Reset(name)) => Some(name),
                Some(other) => panic!("{other:?}"),
                None => None,
            };
            assert_eq!(reported.as_deref(), reset.fault(), "{reset:?} fits a fault");
            assert_eq!(reported.is_none(), reset == Reset::AsWanted);
        }
        assert_eq!((Reset::BrownOut.fault(), Reset::Watchdog.fault()), (Some("brown-out"), Some("watchdog")));
    }

    /// Whatever restarted the chip: a panic says more, once.
    #[test]
    fn a_panic_is_reported_in_place_of_the_reset_after_it_and_once() {
        for reset in ALL {
            let mut memory = [0xA5; RECORD_BYTES];
            let mut record = PanicRecord(&mut memory);
            let text = String::try_from("main.rs:7: no").unwrap_or_default();
            record.store_text(&text);
            assert_eq!(reset.boot_fault(&mut record), Some(Fault::Panic(text)), "{reset:?}");
            let after = reset.boot_fault(&mut record);
            assert!(!matches!(after, Some(Fault::Panic(_))) && after.is_some() == reset.fault().is_some(), "{after:?}");
        }
    }
}
