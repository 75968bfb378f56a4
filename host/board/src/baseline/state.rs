//! How a baseline stands, and what a person should know of it.

/// How the baseline stands.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum BaselineState {
    /// It is being taken for the first time.
    #[default]
    Starting,
    /// It is taken, and follows what drifts.
    Held,
    /// Something has pressed since the start, with readings up to this (V): it stays zero until nothing does.
    Pressed(f64),
    /// It is being taken anew; until then the one before holds.
    Renewing,
    /// It was to be taken anew while something pressed, with readings up to this (V): the one before stays, and is followed once nothing does.
    Refused(f64),
    /// It was taken because a person asked for it, from readings that look like a light touch at x and y (m).
    Doubtful([f64; 2]),
    /// Readings at rest have come to look like a light touch at x and y (m): it no longer follows them.
    Drifted([f64; 2]),
    /// Something has touched for [`LASTING_S`] without a break, so it could not follow what drifts.
    Lasting,
}

/// Touches that last longer than this may be none (s).
pub const LASTING_S: f64 = 600.0;

impl BaselineState {
    /// Whether the baseline is being taken.
    pub fn is_taking(&self) -> bool {
        matches!(self, Self::Starting | Self::Renewing)
    }

    /// What a person should know of it, in a sentence or two.
    pub fn notice(&self) -> Option<String> {
        let mv = |volts: &f64| (1e3 * volts).round();
        let mm = |[x_m, y_m]: &[f64; 2]| format!("({:.0}, {:.0}) mm", 1e3 * x_m, 1e3 * y_m);
        match self {
            Self::Starting | Self::Held | Self::Renewing => None,
            Self::Pressed(largest_v) => Some(format!(
                "Something pressed at the start (up to {} mV) and is shown as touch. Zero is taken once it lifts; if nothing is there, re-zero.",
                mv(largest_v)
            )),
            Self::Refused(largest_v) => Some(format!(
                "Not re-zeroed: something presses (readings up to {} mV), and the zero of before stays. Let go: zero then follows by itself.",
                mv(largest_v)
            )),
            Self::Doubtful(place_m) => Some(format!(
                "Re-zeroed, but the readings looked like a light touch near {}. If something lies there, lift it: then zero is taken anew \
                 by itself.",
                mm(place_m)
            )),
            Self::Drifted(place_m) => Some(format!(
                "The readings at rest have come to look like a light touch near {}, and zero no longer follows them. If nothing lies there, \
                 re-zero.",
                mm(place_m)
            )),
            Self::Lasting => Some(format!(
                "Touched for more than {:.0} minutes without a break, with the zero of before. If nothing lies on the detector, re-zero.",
                LASTING_S / 60.0
            )),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn notices_say_what_is_and_what_to_do() {
        let notice = |state: BaselineState| state.notice().unwrap_or_default();
        assert!(notice(BaselineState::Pressed(1.5)).contains("1500 mV"));
        assert!(notice(BaselineState::Doubtful([0.0121, -0.0049])).contains("near (12, -5) mm"));
        assert!(notice(BaselineState::Lasting).contains("10 minutes"));
        assert!(notice(BaselineState::Refused(0.3)).contains("Let go"));
        for state in [BaselineState::Pressed(1.0), BaselineState::Drifted([0.0; 2]), BaselineState::Lasting] {
            assert!(notice(state).contains("re-zero"), "{state:?}");
        }
        assert_eq!([BaselineState::Held, BaselineState::Starting].map(|state| state.notice()), [None, None]);
    }
}
