//! The files of the page, held in the program.

use hyper::StatusCode;

use crate::sink::web::{PLAIN, Response, response};

const HTML: &str = "text/html; charset=utf-8";
const CSS: &str = "text/css; charset=utf-8";
const SCRIPT: &str = "text/javascript; charset=utf-8";
pub(super) const SVG: &str = "image/svg+xml";

/// Path, type and contents of a file.
type Asset = (&'static str, &'static str, &'static str);

const ASSETS: &[Asset] = &[
    ("/", HTML, include_str!("web/index.html")),
    ("/style.css", CSS, include_str!("web/style.css")),
    ("/detectors.css", CSS, include_str!("web/detectors.css")),
    ("/icon.svg", SVG, include_str!("web/icon.svg")),
    ("/app.js", SCRIPT, include_str!("web/app.js")),
    ("/bars.js", SCRIPT, include_str!("web/bars.js")),
    ("/board.js", SCRIPT, include_str!("web/board.js")),
    ("/body.js", SCRIPT, include_str!("web/body.js")),
    ("/calibrate.js", SCRIPT, include_str!("web/calibrate.js")),
    ("/calibrate-maps.js", SCRIPT, include_str!("web/calibrate-maps.js")),
    ("/camera.js", SCRIPT, include_str!("web/camera.js")),
    ("/colours.js", SCRIPT, include_str!("web/colours.js")),
    ("/contacts.js", SCRIPT, include_str!("web/contacts.js")),
    ("/controls.js", SCRIPT, include_str!("web/controls.js")),
    ("/detectors.js", SCRIPT, include_str!("web/detectors.js")),
    ("/figures.js", SCRIPT, include_str!("web/figures.js")),
    ("/flat.js", SCRIPT, include_str!("web/flat.js")),
    ("/frame.js", SCRIPT, include_str!("web/frame.js")),
    ("/gain.js", SCRIPT, include_str!("web/gain.js")),
    ("/heat.js", SCRIPT, include_str!("web/heat.js")),
    ("/headline.js", SCRIPT, include_str!("web/headline.js")),
    ("/history.js", SCRIPT, include_str!("web/history.js")),
    ("/layout.js", SCRIPT, include_str!("web/layout.js")),
    ("/link.js", SCRIPT, include_str!("web/link.js")),
    ("/marks.js", SCRIPT, include_str!("web/marks.js")),
    ("/method.js", SCRIPT, include_str!("web/method.js")),
    ("/notice.js", SCRIPT, include_str!("web/notice.js")),
    ("/overview.js", SCRIPT, include_str!("web/overview.js")),
    ("/palette.js", SCRIPT, include_str!("web/palette.js")),
    ("/picture.js", SCRIPT, include_str!("web/picture.js")),
    ("/pointer.js", SCRIPT, include_str!("web/pointer.js")),
    ("/press.js", SCRIPT, include_str!("web/press.js")),
    ("/protocol.js", SCRIPT, include_str!("web/protocol.js")),
    ("/raster.js", SCRIPT, include_str!("web/raster.js")),
    ("/readings.js", SCRIPT, include_str!("web/readings.js")),
    ("/save.js", SCRIPT, include_str!("web/save.js")),
    ("/scale.js", SCRIPT, include_str!("web/scale.js")),
    ("/shapes.js", SCRIPT, include_str!("web/shapes.js")),
    ("/share.js", SCRIPT, include_str!("web/share.js")),
    ("/simulation.js", SCRIPT, include_str!("web/simulation.js")),
    ("/solid.js", SCRIPT, include_str!("web/solid.js")),
    ("/space.js", SCRIPT, include_str!("web/space.js")),
    ("/strength.js", SCRIPT, include_str!("web/strength.js")),
    ("/strip.js", SCRIPT, include_str!("web/strip.js")),
    ("/svg.js", SCRIPT, include_str!("web/svg.js")),
    ("/target.js", SCRIPT, include_str!("web/target.js")),
    ("/tile.js", SCRIPT, include_str!("web/tile.js")),
    ("/theme.js", SCRIPT, include_str!("web/theme.js")),
    ("/told.js", SCRIPT, include_str!("web/told.js")),
    ("/totals.js", SCRIPT, include_str!("web/totals.js")),
    ("/trails.js", SCRIPT, include_str!("web/trails.js")),
    ("/transport.js", SCRIPT, include_str!("web/transport.js")),
    ("/triangles.js", SCRIPT, include_str!("web/triangles.js")),
    ("/units.js", SCRIPT, include_str!("web/units.js")),
    ("/verdict.js", SCRIPT, include_str!("web/verdict.js")),
    ("/vibration.js", SCRIPT, include_str!("web/vibration.js")),
    ("/words.js", SCRIPT, include_str!("web/words.js")),
];

/// What the page of several detectors has in place of one's.
const OF_ALL: &[Asset] = &[("/", HTML, include_str!("web/detectors.html"))];

/// Answer to a request for `path` of the page of several detectors.
pub(super) fn of_all(path: &str) -> Response {
    match OF_ALL.iter().find(|asset| asset.0 == path) {
        Some((_, kind, contents)) => response(StatusCode::OK, kind, contents),
        None => answer(path),
    }
}

/// Answer to a request for `path`.
pub(super) fn answer(path: &str) -> Response {
    match ASSETS.iter().find(|asset| asset.0 == path) {
        Some((_, kind, contents)) => response(StatusCode::OK, kind, contents),
        None => response(StatusCode::NOT_FOUND, PLAIN, ""),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_import_of_a_script_is_served() {
        for (path, _, text) in ASSETS.iter().filter(|asset| asset.1 == SCRIPT) {
            for line in text.lines().filter(|line| line.starts_with("import ")) {
                let name = line.split('"').nth(1).and_then(|name| name.strip_prefix('.'));
                assert!(name.is_some_and(|name| answer(name).status() == StatusCode::OK), "{path}: {line}");
            }
        }
    }
}
