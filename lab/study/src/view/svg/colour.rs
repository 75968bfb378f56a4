//! A colour map that is even to the eye.
//!
//! Lightness rises evenly in Ottosson's Oklab (Bjorn Ottosson, "A perceptual color space for image processing", 2020, from which the matrices
//! are), from a dark blue to a light yellow, so that equal steps look equal, also in grey and to colour-blind eyes.

/// Lightness and hue (degrees) at both ends, and chroma in the middle and at the ends.
const LIGHTNESS: [f64; 2] = [0.27, 0.93];
const HUE: [f64; 2] = [285.0, 100.0];
const CHROMA: [f64; 2] = [0.125, 0.075];

/// The colour of a share from 0 to 1, as `#rrggbb`.
pub(super) fn of_share(share: f64) -> String {
    let share = share.clamp(0.0, 1.0);
    let between = |[from, to]: [f64; 2]| from + (to - from) * share;
    let ends = (2.0 * share - 1.0).powi(2);
    let chroma = CHROMA[0] + (CHROMA[1] - CHROMA[0]) * ends;
    let rgb = srgb(between(LIGHTNESS), chroma, between(HUE).to_radians());
    rgb.iter().fold("#".to_owned(), |text, part| text + &format!("{:02x}", (part * 255.0).round() as u8))
}

/// sRGB, each part from 0 to 1, of lightness, chroma and hue (radians).
fn srgb(lightness: f64, chroma: f64, hue: f64) -> [f64; 3] {
    let (a, b) = (chroma * hue.cos(), chroma * hue.sin());
    let [l, m, s] = [
        lightness + 0.396_337_777_4 * a + 0.215_803_757_3 * b,
        lightness - 0.105_561_345_8 * a - 0.063_854_172_8 * b,
        lightness - 0.089_484_177_5 * a - 1.291_485_548_0 * b,
    ]
    .map(|root| root.powi(3));
    [
        4.076_741_662_1 * l - 3.307_711_591_3 * m + 0.230_969_929_2 * s,
        -1.268_438_004_6 * l + 2.609_757_401_1 * m - 0.341_319_396_5 * s,
        -0.004_196_086_3 * l - 0.703_418_614_7 * m + 1.707_614_701_0 * s,
    ]
    .map(|linear| {
        let linear = linear.clamp(0.0, 1.0);
        if linear <= 0.003_130_8 { 12.92 * linear } else { 1.055 * linear.powf(1.0 / 2.4) - 0.055 }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Relative luminance of a colour (WCAG).
    fn luminance(colour: &str) -> f64 {
        let part = |at: usize| f64::from(u8::from_str_radix(&colour[at..at + 2], 16).unwrap()) / 255.0;
        let linear = |value: f64| if value <= 0.04045 { value / 12.92 } else { ((value + 0.055) / 1.055).powf(2.4) };
        0.2126 * linear(part(1)) + 0.7152 * linear(part(3)) + 0.0722 * linear(part(5))
    }

    #[test]
    fn it_gets_lighter_in_even_steps() {
        // The cube root of luminance is close to how light a colour looks (CIE 1976).
        let lights: Vec<f64> = (0..=20).map(|k| luminance(&of_share(f64::from(k) / 20.0)).cbrt()).collect();
        let steps: Vec<f64> = lights.windows(2).map(|pair| pair[1] - pair[0]).collect();
        let mean = steps.iter().sum::<f64>() / 20.0;
        assert!(steps.iter().all(|step| (step / mean - 1.0).abs() < 0.35), "{steps:?}");
        assert!(lights[0] < 0.35 && lights[20] > 0.9);
    }

    #[test]
    fn grey_has_no_hue() {
        let [r, g, b] = srgb(0.6, 0.0, 1.0);
        assert!((r - g).abs() < 1e-6 && (g - b).abs() < 1e-6);
        let [r, g, b] = srgb(1.0, 0.0, 0.0);
        assert!((r - 1.0).abs() < 1e-3 && (g - 1.0).abs() < 1e-3 && (b - 1.0).abs() < 1e-3);
    }
}
