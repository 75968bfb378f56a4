//! Colours for people who see fewer of them.
//!
//! Colour vision deficiencies are simulated as in G. M. Machado, M. M. Oliveira and L. A. F. Fernandes, "A Physiologically-based Model for
//! Simulation of Color Vision Deficiency", IEEE Trans. Visualization and Computer Graphics 15 (2009), 1291-1298: matrices of severity 1 on linear
//! RGB. Distances are Euclidean in Oklab (B. Ottosson, "A perceptual color space for image processing", 2020).

use anyhow::{Context, Result, ensure};
use serde_json::Value;

use crate::chromium::Page;
use crate::script::Script;
use crate::stage::in_front_of;

type Colour = [f64; 3];

/// How people see, each with what it makes of linear RGB.
const VISIONS: [(&str, [Colour; 3]); 4] = [
    ("normal", [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]),
    ("protanopia", [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]]),
    (
        "deuteranopia",
        [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881]],
    ),
    ("tritanopia", [[1.255528, -0.076749, -0.178779], [-0.078411, 0.930809, 0.147602], [0.004733, 0.691367, 0.303900]]),
];

/// Eight colours that are taken as safe: M. Okabe and K. Ito, "Color Universal Design", 2002. Those of contacts are to be told apart no worse.
const OKABE_ITO: [&str; 8] = ["#000000", "#e69f00", "#56b4e9", "#009e73", "#f0e442", "#0072b2", "#d55e00", "#cc79a7"];

/// Smallest step of lightness over an eighth of a map: twice what is just noticed in Oklab, by CSS Color 4 (section 14.2.2).
const LIGHTER: f64 = 0.04;

fn linear(byte: f64) -> f64 {
    let value = byte / 255.0;
    if value <= 0.04045 { value / 12.92 } else { ((value + 0.055) / 1.055).powf(2.4) }
}

/// Linear RGB of `#rrggbb`.
fn parsed(colour: &str) -> Result<Colour> {
    let digits =
        colour.trim().strip_prefix('#').filter(|digits| digits.len() == 6).with_context(|| colour.to_owned())?;
    let byte = |at: usize| Ok::<_, anyhow::Error>(linear(u8::from_str_radix(&digits[at..at + 2], 16)?.into()));
    Ok([byte(0)?, byte(2)?, byte(4)?])
}

fn seen(colour: Colour, vision: &[Colour; 3]) -> Colour {
    vision.map(|row| row.iter().zip(colour).map(|(factor, value)| factor * value).sum::<f64>().clamp(0.0, 1.0))
}

fn oklab([r, g, b]: Colour) -> Colour {
    let l = (0.4122214708 * r + 0.5363325363 * g + 0.0514459929 * b).cbrt();
    let m = (0.2119034982 * r + 0.6806995451 * g + 0.1073969566 * b).cbrt();
    let s = (0.0883024619 * r + 0.2817188376 * g + 0.6299787005 * b).cbrt();
    [
        0.2104542553 * l + 0.7936177850 * m - 0.0040720468 * s,
        1.9779984951 * l - 2.4285922050 * m + 0.4505937099 * s,
        0.0259040371 * l + 0.7827717662 * m - 0.8086757660 * s,
    ]
}

/// The two of these colours that are nearest for this vision, and how far apart they are.
fn nearest(colours: &[Colour], vision: &[Colour; 3]) -> (f64, [usize; 2]) {
    let lab: Vec<Colour> = colours.iter().map(|colour| oklab(seen(*colour, vision))).collect();
    let far = |a: usize, b: usize| lab[a].iter().zip(lab[b]).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt();
    let pairs = (0..lab.len()).flat_map(|b| (0..b).map(move |a| [a, b]));
    pairs.map(|[a, b]| (far(a, b), [a, b])).min_by(|a, b| a.0.total_cmp(&b.0)).unwrap_or((0.0, [0, 0]))
}

/// Linear RGB of what a script gives as `#rrggbb`.
async fn colours(page: &Page, script: &str) -> Result<Vec<Colour>> {
    let shown = page.run(script).await?;
    shown
        .as_array()
        .with_context(|| shown.to_string())?
        .iter()
        .map(|colour| parsed(colour.as_str().unwrap_or_default()))
        .collect()
}

#[test]
fn contacts_are_told_apart_by_people_who_see_fewer_colours() -> Result<()> {
    let reference: Vec<Colour> = OKABE_ITO.iter().map(|colour| parsed(colour)).collect::<Result<_>>()?;
    let least = VISIONS.iter().map(|(_, vision)| nearest(&reference, vision).0).fold(f64::INFINITY, f64::min);
    in_front_of(Script::start, async |stage| {
        for theme in ["light", "dark"] {
            stage.browser.theme(theme).await?;
            let script = "const style = getComputedStyle(document.documentElement);
                return Array.from({ length: 8 }, (_, i) => style.getPropertyValue(`--hue-${i}`).trim())";
            let hues = colours(&stage.browser, script).await?;
            for (name, vision) in &VISIONS {
                let (apart, [a, b]) = nearest(&hues, vision);
                eprintln!("{theme}, {name}: {apart:.3} at least, and {least:.3} of Okabe and Ito");
                ensure!(apart > least, "{theme}, {name}: hues {a} and {b} are {apart:.3} apart, less than {least:.3}");
            }
        }
        Ok(())
    })
}

#[test]
fn maps_grow_lighter_or_darker_all_the_way_however_one_sees() -> Result<()> {
    in_front_of(Script::start, async |stage| {
        for (theme, map) in [("light", "image"), ("light", "readings"), ("dark", "image"), ("dark", "readings")] {
            let script = format!(
                "const done = arguments[0]; import(new URL('colours.js', location.href)).then(({{ colourMaps }}) => {{
                    const table = Array.from(colourMaps('{theme}').{map});
                    done(table.map((pixel) => '#' + [0, 8, 16].map((at) => ((pixel >>> at) & 255).toString(16).padStart(2, '0')).join('')));
                }}, (error) => done(String(error)))"
            );
            let shown = stage.browser.client.execute_async(&script, Vec::new()).await?;
            let table: Vec<&str> =
                shown.as_array().with_context(|| shown.to_string())?.iter().filter_map(Value::as_str).collect();
            ensure!(table.len() == 256, "{} colours", table.len());
            let table: Vec<Colour> = table.into_iter().map(parsed).collect::<Result<_>>()?;
            for (name, vision) in &VISIONS {
                let lightness: Vec<f64> = table.iter().map(|colour| oklab(seen(*colour, vision))[0]).collect();
                let way = (lightness[255] - lightness[0]).signum();
                let steps: Vec<f64> =
                    (0..8).map(|i| way * (lightness[(i + 1) * 255 / 8] - lightness[i * 255 / 8])).collect();
                let least = steps.iter().copied().fold(f64::INFINITY, f64::min);
                eprintln!("{theme} {map}, {name}: steps of {least:.3} at least");
                ensure!(least > LIGHTER, "{theme} {map}, {name}: {steps:.3?}");
            }
        }
        Ok(())
    })
}
