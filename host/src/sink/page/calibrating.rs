//! What the page gets of a calibration by rubbing, within the status.

use serde::Serialize;
use tactomo_touch::calibrate::Rub;

use crate::run::calibration::{Calibrating, Compared, Stage, Target};

/// A calibration under way.
#[derive(Serialize)]
pub(super) struct CalibratingMessage<'a> {
    stage: &'static str,
    /// Cells along x and y, and what was felt in each, row by row from the smallest y: 1 light, 2 firm, 3 both, `null` beside the detector.
    cells: [usize; 2],
    felt: &'a [Option<u8>],
    /// Share of the cells that were rubbed.
    share: f64,
    target: Option<TargetMessage>,
    touched: u64,
    fitting: bool,
    errors_m: &'a [f64],
    fit: Option<FitMessage<'a>>,
    compared: Option<ComparedMessage>,
    /// Why the present detector is to be kept.
    keep: Option<&'a str>,
    trouble: Option<&'a str>,
    saved: Option<String>,
    used: bool,
}

/// Where to press next (m), and how hard.
#[derive(Serialize)]
struct TargetMessage {
    at_m: [f64; 2],
    firm: bool,
}

/// What is in use and what was found, on presses that were not used: residuals, in standard deviations of the noise, and expected errors of
/// places (m).
#[derive(Serialize)]
struct ComparedMessage {
    presses: usize,
    residuals: [f64; 2],
    place_errors_m: [f64; 2],
}

/// A fit.
#[derive(Serialize)]
struct FitMessage<'a> {
    /// x, y and the expected standard error there (m).
    places_m: Vec<[f64; 3]>,
    presses: usize,
    /// Electrode of each channel, if wires are exchanged.
    wires: Option<&'a [usize]>,
    left_out: &'a [usize],
}

impl<'a> CalibratingMessage<'a> {
    pub(super) fn of(calibrating: &'a Calibrating) -> Self {
        Self {
            stage: match calibrating.stage {
                Stage::Learning => "learning",
                Stage::Rubbing => "rubbing",
                Stage::Finishing => "finishing",
                Stage::Done => "done",
            },
            cells: calibrating.coverage.cells,
            felt: &calibrating.coverage.felt,
            share: calibrating.coverage.share(),
            target: calibrating.target.map(|Target { at_m, firm }| TargetMessage { at_m, firm }),
            touched: calibrating.touched,
            fitting: calibrating.fitting,
            errors_m: &calibrating.errors_m,
            fit: calibrating.fit.as_deref().map(FitMessage::of),
            compared: calibrating.compared.map(|Compared { presses, residuals, place_errors_m }| ComparedMessage {
                presses,
                residuals,
                place_errors_m,
            }),
            keep: calibrating.keep.as_deref(),
            trouble: calibrating.trouble.as_deref(),
            saved: calibrating.saved.as_ref().map(|path| path.display().to_string()),
            used: calibrating.used,
        }
    }
}

impl<'a> FitMessage<'a> {
    fn of(rub: &'a Rub) -> Self {
        let Rub { place_errors_m, presses, wires, left_out, .. } = rub;
        Self {
            places_m: place_errors_m.iter().map(|([x_m, y_m], error_m)| [*x_m, *y_m, *error_m]).collect(),
            presses: *presses,
            wires: wires.as_deref(),
            left_out,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::run::calibration::Coverage;

    #[test]
    fn a_page_gets_where_has_been_rubbed_and_why_there_is_no_fit() {
        let coverage =
            Coverage { cells: [2, 2], bounds_m: [[0.0; 2], [0.02; 2]], felt: vec![Some(0), Some(3), None, Some(1)] };
        let calibrating = Calibrating {
            stage: Stage::Rubbing,
            coverage,
            target: Some(Target { at_m: [0.01, -0.01], firm: true }),
            touched: 7,
            fitting: true,
            errors_m: vec![1e-3, 5e-4],
            fit: None,
            compared: None,
            keep: None,
            trouble: Some("press with one fingertip alone".to_owned()),
            saved: None,
            used: false,
        };
        let value = serde_json::to_value(CalibratingMessage::of(&calibrating)).expect("plain numbers and texts");
        assert_eq!(value["felt"], serde_json::json!([0, 3, null, 1]));
        assert_eq!((&value["stage"], &value["errors_m"]), (&"rubbing".into(), &serde_json::json!([1e-3, 5e-4])));
        assert_eq!(value["share"], 2.0 / 3.0);
        assert_eq!(value["target"], serde_json::json!({ "at_m": [0.01, -0.01], "firm": true }));
        assert_eq!(value["trouble"], "press with one fingertip alone");
        assert!(value["fit"].is_null());
    }
}
