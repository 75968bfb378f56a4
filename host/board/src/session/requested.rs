//! Settings that the user asks for, and what a board makes of them.

use std::fmt;

use tactomo_protocol::Settings;

/// Settings of the scan that the user asks for; what is `None` stays as the board has it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct RequestedSettings {
    /// Wait between grounding an electrode and its first conversion, in microseconds (us).
    pub settle_us: Option<u16>,
    /// Base-2 logarithm of the conversions averaged into one reading.
    pub average_log2: Option<u8>,
    /// Frames a second at most; 0 for as fast as the board can.
    pub max_frames_per_s: Option<u16>,
    /// Wait between bringing an electrode to the converter and its first conversion (us).
    pub select_us: Option<u16>,
    /// Conversions of each electrode that are thrown away before those that count.
    pub discarded: Option<u8>,
}

impl RequestedSettings {
    /// These, with those that are asked for later.
    pub fn changed_by(self, later: Self) -> Self {
        Self {
            settle_us: later.settle_us.or(self.settle_us),
            average_log2: later.average_log2.or(self.average_log2),
            max_frames_per_s: later.max_frames_per_s.or(self.max_frames_per_s),
            select_us: later.select_us.or(self.select_us),
            discarded: later.discarded.or(self.discarded),
        }
    }

    /// Whether a board may take them.
    pub fn is_valid(&self) -> bool {
        self.over(Settings::default()).is_valid()
    }

    /// The settings `now`, with those that are asked for.
    pub(super) fn over(&self, now: Settings) -> Settings {
        Settings {
            settle_us: self.settle_us.unwrap_or(now.settle_us),
            average_log2: self.average_log2.unwrap_or(now.average_log2),
            max_frames_per_s: self.max_frames_per_s.unwrap_or(now.max_frames_per_s),
            select_us: self.select_us.unwrap_or(now.select_us),
            discarded: self.discarded.unwrap_or(now.discarded),
        }
    }
}

/// Settings that a board does not take.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Refusal {
    /// What was asked for.
    pub wanted: Settings,
    /// What the board keeps, as far as is known.
    pub kept: Settings,
    /// Whether the board has said so; if not, it did not answer.
    pub is_said: bool,
}

impl fmt::Display for Refusal {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let Self { wanted, kept, is_said } = self;
        let rate = |settings: &Settings| match settings.max_frames_per_s {
            0 => "as many frames a second as it can".to_owned(),
            rate => format!("at most {rate} frames a second"),
        };
        let parts = [
            (wanted.settle_us != kept.settle_us)
                .then(|| format!("a settle time of {} us instead of {} us", kept.settle_us, wanted.settle_us)),
            (wanted.average_log2 != kept.average_log2).then(|| {
                format!("an average over {} instead of {} conversions", kept.conversions(), wanted.conversions())
            }),
            (wanted.max_frames_per_s != kept.max_frames_per_s)
                .then(|| format!("{} instead of {}", rate(kept), rate(wanted))),
            (wanted.select_us != kept.select_us)
                .then(|| format!("a select time of {} us instead of {} us", kept.select_us, wanted.select_us)),
            (wanted.discarded != kept.discarded)
                .then(|| format!("{} discarded conversions instead of {}", kept.discarded, wanted.discarded)),
        ];
        let parts: Vec<String> = parts.into_iter().flatten().collect();
        let says = if *is_said { "keeps" } else { "did not confirm its settings, and may keep" };
        write!(f, "the board {says} {}", parts.join(", and "))
    }
}
