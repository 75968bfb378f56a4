//! What a person is advised of pads that a board is too quick for.

use std::fmt;

use super::{Need, Settling};

impl fmt::Display for Settling {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let (board, kilohm, error_mv) = (self.board, 1e-3 * self.pad_ohm, 1e3 * self.error_v_per_v);
        write!(f, "pads of {kilohm:.1} kohm at the board {board}: ")?;
        if self.suits {
            return write!(f, "its settings suit them");
        }
        write!(f, "readings lag by up to {error_mv:.0} mV for each volt from one electrode to the next; ")?;
        match &self.need {
            Some(need) if need.wants_buffer => {
                write!(f, "a buffer behind each pad cures that, and without one {need}")
            }
            Some(need) => write!(f, "{need}"),
            None => write!(f, "only a buffer behind each pad cures that"),
        }
    }
}

impl fmt::Display for Need {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let Self { settle_us, select_us, discarded, times_as_long, .. } = self;
        let wait = if *select_us > 0 { format!("--select-us {select_us}") } else { format!("--settle-us {settle_us}") };
        write!(f, "`{wait} --discard {discarded}` does, with scans {times_as_long:.1} times as long")
    }
}

#[cfg(test)]
mod tests {
    use super::super::settling;
    use tactomo_protocol::Settings;

    #[test]
    fn advice_names_the_options_and_the_buffer_where_it_is_better() {
        let advice = |board, pad_ohm: f64| settling(board, &Settings::default(), pad_ohm).unwrap().to_string();
        assert_eq!(advice("esp32", 550.0), "pads of 0.6 kohm at the board esp32: its settings suit them");
        let thin = advice("esp32c3 (simulated)", 5_000.0);
        assert!(thin.contains("mV for each volt") && thin.contains("`--select-us 5 --discard 1` does"), "{thin}");
        assert!(!thin.contains("buffer"), "{thin}");
        let c = advice("esp32c6", 75_000.0);
        assert!(c.contains("a buffer behind each pad") && c.contains("--discard"), "{c}");
        let d = advice("esp32", 15_630.0);
        assert!(d.contains("--settle-us 20 --discard 1"), "{d}");
    }
}
