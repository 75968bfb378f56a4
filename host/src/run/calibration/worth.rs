//! Whether a detector that was found is to be used in place of the present one.

use tactomo_physics::detector::Detector;
use tactomo_touch::calibrate::{HeldOut, Rub};

/// Share of the expected error before by which a fit has to better it for more to be worth it.
pub(super) const WORTH: f64 = 0.05;
/// The sensor is another one than the detector in use was learned from where that leaves, of presses that were not fitted, so many times the
/// residual that the detector found leaves: of the same sensor 0.99 to 1.07 times, of others 1.33 to 2.6 times (six pairs as built, 3 to 11 presses).
pub(super) const OTHER: f64 = 1.2;
/// Most that is said to be missing at a time.
const TOLD: usize = 3;

/// The present detector and the one that was found, on presses that were not used.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Compared {
    /// How many presses.
    pub presses: usize,
    /// What a single contact on each leaves of them: median, in standard deviations of a frame's noise.
    pub residuals: [f64; 2],
    /// Expected standard error of places on each (m): median over the detector.
    pub place_errors_m: [f64; 2],
}

impl Compared {
    /// Of a fit, with the detector that was found before if one is in use, else with the description; `None` where no press could be spared.
    pub fn of(found: &Rub, used: Option<&Detector>) -> Option<Self> {
        let HeldOut { presses, residuals, place_errors_m, rival } = found.held_out?;
        let present_m = used.and_then(|used| used.calibration.as_ref()?.place_error_m);
        let [described, after] = residuals;
        let [described_m, after_m] = place_errors_m;
        Some(Self {
            presses,
            residuals: [rival.unwrap_or(described), after],
            place_errors_m: [present_m.unwrap_or(described_m), after_m],
        })
    }

    /// Whether the one that was found is better: it fits them no worse and tells places better, or the sensor is another one by now.
    fn is_better(&self) -> bool {
        let [before, after] = self.residuals;
        let Self { presses, residuals, place_errors_m } = *self;
        before > OTHER * after || HeldOut { presses, residuals, place_errors_m, rival: None }.helped()
    }
}

/// Why the present detector is to be kept, and what to do, as sentences for a person; `None` if the one that was found is better. An expected
/// error that has risen from the least one before (m) is none to end with, while anything is missing.
pub(super) fn why_keep(found: &Rub, compared: Option<Compared>, least_m: f64) -> Option<String> {
    let error_m = found.place_error_m();
    let has_risen = error_m > (1.0 + WORTH) * least_m && !found.missing.is_empty();
    let is_better = found.helped() && compared.is_some_and(|compared| compared.is_better());
    if is_better && !has_risen {
        return None;
    }
    let why = match compared {
        None => "There are too few presses to set some aside for a test".to_owned(),
        Some(_) if is_better => format!(
            "The expected error of places has risen from {:.2} to {:.2} mm while you pressed",
            1e3 * least_m,
            1e3 * error_m
        ),
        Some(Compared { residuals: [before, after], .. }) if after > (1.0 + HeldOut::CHANCE) * before => {
            "The new calibration explains presses that were set aside worse than the one in use".to_owned()
        }
        Some(Compared { place_errors_m: [before_m, after_m], .. }) => format!(
            "The new calibration tells places no better: to {:.2} mm, the one in use to {:.2} mm",
            1e3 * after_m,
            1e3 * before_m
        ),
    };
    let missing: Vec<_> = found.missing.iter().take(TOLD).map(ToString::to_string).collect();
    let what = if missing.is_empty() { "press more, with one fingertip alone".to_owned() } else { missing.join("; ") };
    Some(format!("{why}. To do better: {what}."))
}

#[cfg(test)]
pub(super) mod tests {
    use tactomo_physics::detector::Calibration;
    use tactomo_touch::calibrate::Missing;

    use super::*;

    /// What a fit found, with what it and the description, or else a rival, say of presses that were not fitted.
    pub fn found(place_errors_m: [f64; 2], residuals: [f64; 2], rival: Option<f64>, missing: &[Missing]) -> Rub {
        Rub {
            detector: Detector::default(),
            wires: None,
            left_out: Vec::new(),
            touched: 200,
            single: 200,
            presses: 160,
            known: 0,
            held_out: Some(HeldOut { presses: 24, residuals, place_errors_m, rival }),
            missing: missing.to_vec(),
            chi_square: [9.0, 1.0],
            place_errors_m: vec![([0.0; 2], place_errors_m[1])],
        }
    }

    fn why(rub: &Rub, used: Option<&Detector>, least_m: f64) -> String {
        why_keep(rub, Compared::of(rub, used), least_m).unwrap_or_default()
    }

    #[test]
    fn what_is_not_better_says_why_and_what_is_missing() {
        assert_eq!(why(&found([0.9e-3, 0.2e-3], [3.0, 1.0], None, &[]), None, 0.25e-3), "");
        let risen = why(&found([0.9e-3, 0.75e-3], [3.0, 1.0], None, &[Missing::Firm]), None, 0.68e-3);
        assert!(risen.contains("risen from 0.68 to 0.75 mm") && risen.contains("press harder"), "{risen}");
        let no_better = found([0.68e-3, 0.75e-3], [3.0, 2.9], None, &[Missing::Place([-0.02, 0.02])]);
        let no_better = why(&no_better, None, 0.75e-3);
        assert!(
            no_better.contains("to 0.75 mm, the one in use to 0.68 mm") && no_better.contains("(-20, 20) mm"),
            "{no_better}"
        );
        let worse = why(&found([0.9e-3, 0.2e-3], [1.0, 1.2], None, &[]), None, 0.25e-3);
        assert!(worse.contains("worse than the one in use"), "{worse}");
        let none = Rub { held_out: None, ..found([0.9e-3, 0.2e-3], [3.0, 1.0], None, &[]) };
        assert!(why(&none, None, 0.3e-3).contains("too few presses"));
    }

    #[test]
    fn it_is_compared_with_what_is_in_use_not_with_the_description() {
        let calibration = Calibration { place_error_m: Some(0.2e-3), ..Calibration::default() };
        let used = Detector { calibration: Some(calibration), ..Detector::default() };
        let same = found([0.9e-3, 0.19e-3], [3.0, 1.0], Some(1.0), &[]);
        let compared = Compared::of(&same, Some(&used)).unwrap();
        assert_eq!((compared.residuals, compared.place_errors_m), ([1.0, 1.0], [0.2e-3, 0.19e-3]));
        assert!(
            why(&same, Some(&used), 0.19e-3).contains("no better"),
            "half a hundredth of a millimetre is no reason"
        );
        assert_eq!(why(&found([0.9e-3, 0.15e-3], [3.0, 1.0], Some(1.0), &[]), Some(&used), 0.15e-3), "");
        let other = found([0.9e-3, 0.21e-3], [3.0, 1.0], Some(2.0), &[]);
        assert_eq!(why(&other, Some(&used), 0.21e-3), "", "the sensor has changed");
    }
}
