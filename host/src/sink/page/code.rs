//! The page's address as a QR code (ISO/IEC 18004), for the camera of a phone: in the terminal and on the page.

use std::fmt::Write;

use qrcodegen::{QrCode, QrCodeEcc};

/// Modules that are left light around a code, so that cameras find it: four, as the standard asks.
const QUIET: i32 = 4;

/// The code of a text; `None` if it is longer than codes get, some 3000 bytes.
fn code(text: &str) -> Option<QrCode> {
    QrCode::encode_text(text, QrCodeEcc::Low).ok()
}

/// All modules from the first row to the last, with those around: whether the one in column `x` of row `y` is dark.
fn is_dark(code: &QrCode, x: i32, y: i32) -> bool {
    code.get_module(x - QUIET, y - QUIET)
}

/// The code as lines of a terminal, two rows of it in each; empty if there is none. Light is drawn and dark left, for terminals are dark as a rule;
/// `painted`, escape sequences say what is light.
pub fn lines(text: &str, painted: bool) -> String {
    let Some(code) = code(text) else { return String::new() };
    let side = code.size() + 2 * QUIET;
    let [begin, end] = if painted { ["\x1b[97;40m", "\x1b[0m"] } else { [""; 2] };
    let cell = |x: i32, y: i32| match [y, y + 1].map(|y| y < side && !is_dark(&code, x, y)) {
        [true, true] => '█',
        [true, false] => '▀',
        [false, true] => '▄',
        [false, false] => ' ',
    };
    let line = |y: i32| format!("{begin}{}{end}", (0..side).map(|x| cell(x, y)).collect::<String>());
    (0..side).step_by(2).map(line).collect::<Vec<_>>().join("\n")
}

/// The code as a picture, dark on light whatever the page's colours; empty if there is none.
pub(super) fn svg(text: &str) -> String {
    let Some(code) = code(text) else { return String::new() };
    let side = code.size() + 2 * QUIET;
    let mut path = String::new();
    for (x, y) in (0..side).flat_map(|y| (0..side).map(move |x| (x, y))).filter(|(x, y)| is_dark(&code, *x, *y)) {
        // Writing to a text does not fail.
        let _ = write!(path, "M{x} {y}h1v1h-1z");
    }
    format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {side} {side}\" shape-rendering=\"crispEdges\">\
         <rect width=\"{side}\" height=\"{side}\" fill=\"#fff\"/><path d=\"{path}\"/></svg>"
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    const ADDRESS: &str = "http://192.168.1.5:7878/0123456789abcdef0123456789abcdef/";

    /// What the lines say of each module, and what the picture does.
    #[test]
    fn terminal_and_picture_show_the_same_modules_with_light_around() {
        let (lines, svg) = (lines(ADDRESS, false), svg(ADDRESS));
        let light = |half: char| lines.lines().map(move |line| line.chars().map(|c| c == '█' || c == half).collect());
        let [upper, lower]: [Vec<Vec<bool>>; 2] = ['▀', '▄'].map(|half| light(half).collect());
        let side = upper[0].len();
        let mut dark = 0;
        for (y, x) in (0..side).flat_map(|y| (0..side).map(move |x| (y, x))) {
            let is_light = if y % 2 == 0 { upper[y / 2][x] } else { lower[y / 2][x] };
            assert_eq!(svg.contains(&format!("M{x} {y}h1v1h-1z")), !is_light, "column {x}, row {y}");
            let is_around = [x, y].iter().any(|at| *at < 4 || *at >= side - 4);
            assert!(is_light || !is_around, "column {x}, row {y}");
            dark += usize::from(!is_light);
        }
        // 33 modules with 4 on either side; codes are about half dark.
        assert!(side == 41 && (400..700).contains(&dark), "{side} {dark}");
    }

    #[test]
    fn what_is_too_long_for_a_code_has_none() {
        assert_eq!((lines(&"x".repeat(4000), true), svg(&"x".repeat(4000))), Default::default());
    }
}
