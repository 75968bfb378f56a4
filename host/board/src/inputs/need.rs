//! What settings a board needs for pads of such a resistance.

use serde::Serialize;
use tactomo_firmware::mux::ONE_INPUT_SELECT_US;
use tactomo_protocol::Settings;

use super::{BoardInputs, Input};

/// Bits of a converter: half an LSB is this share of a step over its whole scale, 9.0 time constants.
const BITS: i32 = 12;
/// A scan that takes this many times as long as with the settings after a reset is one too slow: a buffer does better.
const TOO_SLOW: f64 = 2.0;
/// Select times that are tried, and settle times (us).
const TRIED_US: [u16; 30] = [
    0, 2, 5, 10, 17, 20, 25, 30, 35, 40, 50, 60, 70, 80, 100, 120, 140, 160, 180, 200, 250, 300, 400, 500, 700, 1000,
    1500, 2000, 5000, 10_000,
];

/// The quickest settings with which a step is read to half an LSB.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Need {
    /// Wait after grounding (us).
    pub settle_us: u16,
    /// Wait after bringing an electrode to the one input (us); 0 for a board with an input for each.
    pub select_us: u16,
    /// Conversions that are thrown away.
    pub discarded: u8,
    /// How many times as long a scan of 16 electrodes takes as with the settings after a reset.
    pub times_as_long: f64,
    /// Whether a buffer behind every pad does better: the scan takes more than twice as long.
    pub wants_buffer: bool,
}

/// How a board's settings suit a detector's pads.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Settling {
    /// Name of the board.
    pub board: &'static str,
    /// Resistance of the pad that has most (ohm).
    pub pad_ohm: f64,
    /// What is missing of a step of 1 V at such a pad, in the settings that the board has (V).
    pub error_v_per_v: f64,
    /// Whether that is half an LSB at most.
    pub suits: bool,
    /// The quickest settings that suit; `None` if none does.
    pub need: Option<Need>,
}

/// How the settings of the board of that name suit pads of `pad_ohm`; `None` for a board of which nothing is known.
pub fn settling(board: &str, settings: &Settings, pad_ohm: f64) -> Option<Settling> {
    let inputs = BoardInputs::of(board)?;
    let error_v_per_v = inputs.error(pad_ohm, settings);
    let suits = error_v_per_v <= allowed();
    Some(Settling { board: inputs.board, pad_ohm, error_v_per_v, suits, need: inputs.need(pad_ohm) })
}

/// Half an LSB, as a share of the scale.
fn allowed() -> f64 {
    0.5 / 2f64.powi(BITS)
}

impl BoardInputs {
    /// The settings that the board's firmware has after a reset.
    pub fn after_reset(&self) -> Settings {
        let select_us = if self.is_one { ONE_INPUT_SELECT_US } else { 0 };
        Settings { select_us, ..Settings::default() }
    }

    /// What is missing of a step (as a share of it) of a pad of `pad_ohm` in the first conversion that counts. The pin, and the sampling capacitor,
    /// come from where the step begins: another electrode has been there, or another one grounded.
    pub fn error(&self, pad_ohm: f64, settings: &Settings) -> f64 {
        let mut input = Input::new(self.input, pad_ohm);
        input.follow(0.0, 1.0);
        let wait_us = if self.is_one { settings.select_us } else { settings.settle_us };
        let first_s = 1e-6 * f64::from(wait_us);
        let mut held_v = 0.0;
        for conversion in 0..=settings.discarded {
            input.follow(first_s + f64::from(conversion) * self.conversion_s, 1.0);
            held_v = input.sample(held_v);
        }
        (1.0 - held_v).abs()
    }

    /// The quickest settings with which pads of `pad_ohm` are read to half an LSB; `None` if none does.
    pub fn need(&self, pad_ohm: f64) -> Option<Need> {
        let usual_s = self.row_s(&self.after_reset());
        let tried = (0..=Settings::MAX_DISCARDED).filter_map(|discarded| {
            let with = |wait_us: u16| {
                let usual = Settings { discarded, ..self.after_reset() };
                if self.is_one {
                    Settings { select_us: wait_us, ..usual }
                } else {
                    // Less than the usual wait is nothing to ask for: the detector itself has to settle, too.
                    Settings { settle_us: wait_us.max(usual.settle_us), ..usual }
                }
            };
            TRIED_US.into_iter().map(with).find(|settings| self.error(pad_ohm, settings) <= allowed())
        });
        let quickest = tried.min_by(|a, b| self.row_s(a).total_cmp(&self.row_s(b)))?;
        let Settings { settle_us, select_us, discarded, .. } = quickest;
        let times_as_long = self.row_s(&quickest) / usual_s;
        Some(Need { settle_us, select_us, discarded, times_as_long, wants_buffer: times_as_long > TOO_SLOW })
    }

    /// Time of a row of 16 electrodes (s), but for the firmware's own work.
    fn row_s(&self, settings: &Settings) -> f64 {
        let slot_s = f64::from(1 + settings.discarded) * self.conversion_s + 1e-6 * f64::from(settings.select_us);
        1e-6 * f64::from(settings.settle_us) + f64::from(self.slots) * slot_s
    }
}

#[cfg(test)]
mod tests {
    use super::super::BOARDS;
    use super::*;
    use tactomo_physics::detector::Detector;

    fn pad_ohm(foam: &str) -> f64 {
        Detector::default().in_material(&foam.parse().unwrap()).unwrap().largest_pad_ohm()
    }

    /// The rows of `docs/hardware.md`: what is missing of a step (mV a volt) in the settings after a reset, then the settings that suit.
    #[test]
    fn the_page_has_what_each_foam_needs_on_each_board() {
        let page = include_str!("../../../../docs/hardware.md");
        for inputs in BOARDS.iter().filter(|inputs| inputs.board != "esp32c6") {
            for foam in ["A", "B", "C", "D"] {
                let pad_ohm = pad_ohm(foam);
                let error = 1e3 * inputs.error(pad_ohm, &inputs.after_reset());
                let Need { settle_us, select_us, discarded, times_as_long, wants_buffer } =
                    inputs.need(pad_ohm).expect("some settings suit");
                let waits = if inputs.is_one { select_us } else { settle_us };
                let error = if error < 0.1 { "under 0.1".to_owned() } else { format!("{error:.1}") };
                let buffer = if wants_buffer { "yes" } else { "no" };
                let row = format!(
                    "| {foam} | `{}` | {error} | {waits} us, {discarded} | {times_as_long:.2} | {buffer} |",
                    inputs.board
                );
                assert!(page.contains(&row), "docs/hardware.md should have\n{row}");
            }
        }
    }

    /// 2 us, which was a constant once, is right for foams A and B only; of C not even a tenth has come by then.
    #[test]
    fn a_c3_settles_for_the_pad_it_has() {
        let c3 = BoardInputs::of("esp32c3 (simulated)").unwrap();
        let after = |select_us, discarded, foam| {
            c3.error(pad_ohm(foam), &Settings { select_us, discarded, ..Settings::default() })
        };
        assert!(after(2, 0, "A") < 1e-6 && after(2, 0, "B") < 1e-6);
        assert!(after(2, 0, "C") > 0.75 && after(2, 0, "D") > 0.3, "{} {}", after(2, 0, "C"), after(2, 0, "D"));
        assert!(after(17, 0, "D") < 0.03 && after(17, 1, "D") < 5e-4);
        assert!(after(160, 2, "C") < 1e-3);
        // 228 pF and 8.3 kilohm are half an LSB after the 17 us of the firmware, as its source says.
        let limit = (-17e-6f64 / (8.3e3 * 228e-12)).exp();
        assert!((limit / allowed() - 1.0).abs() < 0.05, "{limit}");
    }

    #[test]
    fn what_is_needed_suits_and_nothing_quicker_of_what_is_tried_does() {
        for inputs in &BOARDS {
            for pad_ohm in [100.0, 1e3, 5e3, 16e3, 75e3, 300e3] {
                let Some(need) = inputs.need(pad_ohm) else { continue };
                let Need { settle_us, select_us, discarded, .. } = need;
                let settings = Settings { settle_us, select_us, discarded, ..Settings::default() };
                let found = settling(inputs.board, &settings, pad_ohm).unwrap();
                assert!(found.suits && found.need == Some(need), "{found:?}");
                if discarded > 0 {
                    let fewer = Settings { discarded: discarded - 1, ..settings };
                    assert!(inputs.error(pad_ohm, &fewer) > inputs.error(pad_ohm, &settings));
                }
            }
        }
        assert_eq!(settling("simulated", &Settings::default(), 1e3), None, "the ideal board has no such thing");
    }
}
