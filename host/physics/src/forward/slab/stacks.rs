//! The layers of a slab: one stack, or two with dots of glue between them.

use super::driving::Covered;
use super::green::Surface;
use crate::detector::Detector;
use crate::forward::driving::DrivingLayer;

/// The kernels' split length is at least this share of a pad's radius.
const SPLIT_IN_PAD: f64 = 1.0;

/// The layers below dots of glue and those above, with what lies on them; without dots all of them, twice.
pub(super) fn stacks(detector: &Detector, size_m: [f64; 2], driving: DrivingLayer) -> [Covered<'_>; 2] {
    match detector.bond() {
        None => [Covered::new(&detector.layers, size_m, driving); 2],
        Some((above, _)) => {
            let (lower, upper) = detector.layers.split_at(above);
            [Covered::new(lower, size_m, DrivingLayer::default()), Covered::new(upper, size_m, driving)]
        }
    }
}

/// Radius of the widest pad (m).
pub(super) fn widest_m(detector: &Detector) -> f64 {
    detector.electrodes.iter().map(|pad| pad.radius_m).fold(0.0, f64::max)
}

/// Length at which the kernels of layers with discs of up to a radius are split: short enough that the near part fades within a few thicknesses,
/// long enough that the tables stay small, and that what bends the current on a disc is in the near part, which is resolved to high orders there.
pub(super) fn split_m(thickness_m: f64, size_m: [f64; 2], widest_m: f64) -> f64 {
    (0.6 * thickness_m).min(0.05 * size_m[0].max(size_m[1])).max(SPLIT_IN_PAD * widest_m)
}

pub(super) fn top_surface<'a>(covered: Covered<'a>) -> Surface<impl Fn(f64) -> f64 + use<'a>> {
    Surface {
        response: move |k| covered.response(k).tt,
        floating: covered.floating().tt,
        sheet_s: covered.gap_sheet_s(),
        sigma: covered.layers().last().map_or(0.0, |layer| layer.top_s_per_m),
    }
}

pub(super) fn bottom_surface<'a>(covered: Covered<'a>) -> Surface<impl Fn(f64) -> f64 + use<'a>> {
    Surface {
        response: move |k| covered.response(k).bb,
        floating: covered.floating().bb,
        sheet_s: covered.sheet_s(),
        sigma: covered.layers().first().map_or(0.0, |layer| layer.bottom_s_per_m),
    }
}
