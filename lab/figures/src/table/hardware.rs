//! Frames a second of simulated boards: docs/firmware.md, README.

use super::figure;
use crate::figure::Figure;

pub(super) fn figures() -> Vec<Figure> {
    let rate = |job: &'static str, says: &str| {
        figure(job, format!("{job}.rate"), says, "frames_per_s").unit("frames/s", 1.0).share(0.03)
    };
    vec![
        rate("live-ideal", "frames a second at the host, board `ideal`"),
        rate("live-esp32", "frames a second at the host, board `esp32`, light contacts (10 bits)"),
        rate("live-esp32-firm", "frames a second at the host, board `esp32`, firm contacts (11 bits)"),
        rate("live-esp32c3", "frames a second at the host, board `esp32c3`"),
        rate("live-adaptive", "answers a second of `--scan adaptive`, board `esp32`"),
    ]
}
