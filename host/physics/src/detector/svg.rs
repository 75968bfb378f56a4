//! A picture of a detector: seen from above, and cut through its layers.

use std::fmt::{self, Write as _};

use super::{Correction, Detector, Layer};
use crate::hertz::Skin;

/// Largest size of the view from above (px).
const PLAN_PX: [f64; 2] = [460.0, 420.0];
const LEFT_PX: f64 = 74.0;
const TOP_PX: f64 = 84.0;
/// Between the view and its axes (px).
const AXIS_GAP_PX: f64 = 8.0;
const SECTION_WIDTH_PX: f64 = 132.0;
const SECTION_HEIGHT_PX: f64 = 190.0;
const LABEL_WIDTH_PX: f64 = 175.0;
const MIN_LAYER_PX: f64 = 15.0;
/// A pad of this radius holds its number (px).
const NUMBERED_PX: f64 = 8.0;
/// Between ticks (px), at least.
const TICK_PX: f64 = 42.0;

/// Surfaces of more facets are drawn without them.
const MOST_FACETS: usize = 4000;

const STYLE: &str = ".facet { stroke: #4b4653; stroke-opacity: 0.25; fill: none } text { font: 12px -apple-system, 'Segoe UI', Roboto, 'Helvetica Neue', Arial, sans-serif; \
    fill: #1d1b22 } .title { font-size: 19px; font-weight: 650 } .muted { fill: #66626e } .middle { text-anchor: middle } \
    .end { text-anchor: end } .pad { fill: #1d1b22 } .on { fill: #ffffff; font-weight: 600 } \
    .dot { stroke: #4b4653; stroke-dasharray: 3 3; fill: none } .axis { stroke: #8b8793; fill: none } .edge { stroke: #4b4653; stroke-width: 1.5; stroke-linejoin: round }";

impl Detector {
    /// A picture of it (SVG): outline, electrodes with the numbers of their channels, axes in millimetres, layers.
    pub fn to_svg(&self) -> String {
        let mut text = String::new();
        // Writing to a string cannot fail.
        let _ = Picture::of(self).write(&mut text);
        text
    }
}

struct Picture<'a> {
    detector: &'a Detector,
    low_m: [f64; 2],
    size_m: [f64; 2],
    px_per_m: f64,
}

impl<'a> Picture<'a> {
    fn of(detector: &'a Detector) -> Self {
        let [low_m, _] = detector.outline.bounds();
        let size_m = detector.outline.size_m();
        let px_per_m = (PLAN_PX[0] / size_m[0]).min(PLAN_PX[1] / size_m[1]);
        Self { detector, low_m, size_m, px_per_m }
    }

    fn plan_px(&self) -> [f64; 2] {
        self.size_m.map(|size_m| size_m * self.px_per_m)
    }

    fn x_px(&self, x_m: f64) -> f64 {
        LEFT_PX + (x_m - self.low_m[0]) * self.px_per_m
    }

    fn y_px(&self, y_m: f64) -> f64 {
        TOP_PX + self.plan_px()[1] - (y_m - self.low_m[1]) * self.px_per_m
    }

    fn section_left_px(&self) -> f64 {
        LEFT_PX + self.plan_px()[0] + 84.0
    }

    fn section_height_px(&self) -> f64 {
        heights_px(&self.detector.layers).iter().sum()
    }

    fn write(&self, out: &mut String) -> fmt::Result {
        let width = self.section_left_px() + SECTION_WIDTH_PX + LABEL_WIDTH_PX;
        let facts_bottom = TOP_PX + 100.0 + self.section_height_px() + 18.0 * self.facts().len() as f64;
        let height = (TOP_PX + self.plan_px()[1] + 62.0).max(facts_bottom);
        writeln!(
            out,
            r#"<svg xmlns="http://www.w3.org/2000/svg" width="{width:.0}" height="{height:.0}" viewBox="0 0 {width:.0} {height:.0}">"#
        )?;
        writeln!(out, r##"<style>{STYLE}</style><rect width="100%" height="100%" fill="#ffffff"/>"##)?;
        let name = escaped(&self.detector.name);
        writeln!(out, r#"<title>{name}</title><text class="title" x="24" y="34">{name}</text>"#)?;
        writeln!(out, r#"<text class="muted" x="24" y="55">{}</text>"#, escaped(&self.detector.summary()))?;
        self.write_outline(out)?;
        self.write_facets(out)?;
        self.write_electrodes(out)?;
        self.write_dots(out)?;
        self.write_axes(out)?;
        self.write_section(out)?;
        self.write_facts(out)?;
        writeln!(out, "</svg>")
    }

    fn write_outline(&self, out: &mut String) -> fmt::Result {
        let top = self.detector.layers.last().map_or(1.0, |layer| layer.top_s_per_m);
        write!(out, r#"<path class="edge" fill="{}" fill-rule="evenodd" d=""#, colour(top))?;
        let outline = &self.detector.outline;
        for polygon in std::iter::once(&outline.outer).chain(&outline.holes) {
            for (index, corner) in polygon.iter().enumerate() {
                let command = if index == 0 { 'M' } else { 'L' };
                write!(out, "{command}{:.1} {:.1}", self.x_px(corner[0]), self.y_px(corner[1]))?;
            }
            write!(out, "Z")?;
        }
        writeln!(out, r#""/>"#)
    }

    /// The facets of a curved surface, on its map.
    fn write_facets(&self, out: &mut String) -> fmt::Result {
        let Some(surface) = self.detector.surface.as_ref().filter(|surface| surface.triangles.len() <= MOST_FACETS)
        else {
            return Ok(());
        };
        write!(out, r#"<path class="facet" d=""#)?;
        for triangle in 0..surface.triangles.len() {
            let corners = surface.corners(triangle).map(|corner| surface.map_m(corner));
            if corners.iter().all(|corner| surface.shows(*corner)) {
                let [a, b, c] = corners.map(|[x, y]| format!("{:.1} {:.1}", self.x_px(x), self.y_px(y)));
                write!(out, "M{a}L{b}L{c}Z")?;
            }
        }
        writeln!(out, r#""/>"#)
    }

    fn write_electrodes(&self, out: &mut String) -> fmt::Result {
        for (channel, pad) in self.detector.electrodes.iter().enumerate() {
            let [x_m, y_m] = self.detector.map_m(pad.place_m());
            let (x, y, radius) = (self.x_px(x_m), self.y_px(y_m), pad.radius_m * self.px_per_m);
            writeln!(out, r#"<circle class="pad" cx="{x:.1}" cy="{y:.1}" r="{radius:.1}"/>"#)?;
            let (class, x, y) =
                if radius >= NUMBERED_PX { ("on middle", x, y + 4.2) } else { ("", x + radius + 2.0, y - radius) };
            writeln!(out, r#"<text class="{class}" x="{x:.1}" y="{y:.1}">{channel}</text>"#)?;
        }
        Ok(())
    }

    /// Outlines of the dots of glue between two layers.
    fn write_dots(&self, out: &mut String) -> fmt::Result {
        let Some((_, bond)) = self.detector.bond() else { return Ok(()) };
        for [x_m, y_m] in bond.centres_m(self.size_m) {
            let (x, y, radius) = (self.x_px(x_m), self.y_px(y_m), bond.diameter_m / 2.0 * self.px_per_m);
            writeln!(out, r#"<circle class="dot" cx="{x:.1}" cy="{y:.1}" r="{radius:.1}"/>"#)?;
        }
        Ok(())
    }

    fn write_axes(&self, out: &mut String) -> fmt::Result {
        let [width, height] = self.plan_px();
        let (left, bottom) = (LEFT_PX - AXIS_GAP_PX, TOP_PX + height + AXIS_GAP_PX);
        let (right, low) = (LEFT_PX + width, TOP_PX + height);
        writeln!(
            out,
            r#"<path class="axis" d="M{left:.1} {TOP_PX:.1}V{low:.1}M{LEFT_PX:.1} {bottom:.1}H{right:.1}"/>"#
        )?;
        for (x_m, label) in self.ticks(0) {
            let (x, end, under) = (self.x_px(x_m), bottom + 5.0, bottom + 19.0);
            writeln!(out, r#"<path class="axis" d="M{x:.1} {bottom:.1}V{end:.1}"/>"#)?;
            writeln!(out, r#"<text class="muted middle" x="{x:.1}" y="{under:.1}">{label}</text>"#)?;
        }
        for (y_m, label) in self.ticks(1) {
            let (y, end) = (self.y_px(y_m), left - 5.0);
            writeln!(out, r#"<path class="axis" d="M{left:.1} {y:.1}H{end:.1}"/>"#)?;
            let (x, y) = (end - 4.0, y + 4.2);
            writeln!(out, r#"<text class="muted end" x="{x:.1}" y="{y:.1}">{label}</text>"#)?;
        }
        let (x, y) = (LEFT_PX + width / 2.0, bottom + 38.0);
        writeln!(out, r#"<text class="middle" x="{x:.1}" y="{y:.1}">x (mm)</text>"#)?;
        let y = TOP_PX + height / 2.0;
        writeln!(out, r#"<text class="middle" transform="translate(24 {y:.1}) rotate(-90)">y (mm)</text>"#)
    }

    /// Places of the ticks of an axis (m) and what is written there.
    fn ticks(&self, axis: usize) -> Vec<(f64, String)> {
        let (low_mm, high_mm) = (self.low_m[axis] * 1e3, (self.low_m[axis] + self.size_m[axis]) * 1e3);
        // A narrow side has three ticks, too.
        let least_px = TICK_PX.min(self.plan_px()[axis] / 3.0);
        let (step_mm, decimals) = round_step(least_px / self.px_per_m * 1e3);
        let (first, last) = ((low_mm / step_mm - 1e-9).ceil() as i64, (high_mm / step_mm + 1e-9).floor() as i64);
        let label = |mm: f64| format!("{mm:.decimals$}").replace('-', "\u{2212}");
        (first..=last).map(|i| i as f64 * step_mm).map(|mm| (mm * 1e-3, label(mm))).collect()
    }

    fn write_section(&self, out: &mut String) -> fmt::Result {
        let (left, right) = (self.section_left_px(), self.section_left_px() + SECTION_WIDTH_PX);
        let top = TOP_PX + 34.0;
        let label = right + 10.0;
        writeln!(
            out,
            r##"<rect x="{left:.1}" y="{TOP_PX:.1}" width="{SECTION_WIDTH_PX}" height="11" fill="#b9b5c0"/>"##
        )?;
        writeln!(out, r#"<text x="{label:.1}" y="{:.1}">driving layer</text>"#, TOP_PX + 10.0)?;
        let mesh = TOP_PX + 22.5;
        writeln!(
            out,
            r#"<path class="axis" stroke-width="3" stroke-dasharray="5 7" d="M{left:.1} {mesh:.1}H{right:.1}"/>"#
        )?;
        writeln!(out, r#"<text class="muted" x="{label:.1}" y="{:.1}">mesh</text>"#, mesh + 4.2)?;
        self.write_layers(out, left, top)?;
        let bottom = top + self.section_height_px();
        for index in 0..4 {
            let x = left + SECTION_WIDTH_PX * (f64::from(index) + 0.5) / 4.0 - 8.0;
            writeln!(out, r#"<rect class="pad" x="{x:.1}" y="{bottom:.1}" width="16" height="6"/>"#)?;
        }
        writeln!(out, r#"<text x="{label:.1}" y="{:.1}">electrodes</text>"#, bottom + 12.0)?;
        let (x, y) = (left - 34.0, top + (bottom - top) / 2.0);
        writeln!(out, r#"<text class="middle" transform="translate({x:.1} {y:.1}) rotate(-90)">z (mm)</text>"#)
    }

    /// Layers from the top down, with the height of each boundary.
    fn write_layers(&self, out: &mut String, left: f64, mut y: f64) -> fmt::Result {
        let layers = &self.detector.layers;
        let mut z_mm = self.detector.thickness_m() * 1e3;
        for (index, (layer, height)) in layers.iter().zip(heights_px(layers)).enumerate().rev() {
            writeln!(out, r#"<linearGradient id="layer{index}" x1="0" y1="0" x2="0" y2="1">"#)?;
            writeln!(out, r#"<stop offset="0" stop-color="{}"/>"#, colour(layer.top_s_per_m))?;
            writeln!(out, r#"<stop offset="1" stop-color="{}"/></linearGradient>"#, colour(layer.bottom_s_per_m))?;
            writeln!(
                out,
                r#"<rect class="edge" x="{left:.1}" y="{y:.1}" width="{SECTION_WIDTH_PX}" height="{height:.1}" fill="url(#layer{index})"/>"#
            )?;
            let (x, middle) = (left + SECTION_WIDTH_PX + 10.0, y + height / 2.0 + 4.2);
            writeln!(out, r#"<text x="{x:.1}" y="{middle:.1}">{}</text>"#, layer.summary())?;
            self.write_height(out, left, y, z_mm)?;
            z_mm -= layer.thickness_m * 1e3;
            y += height;
        }
        self.write_height(out, left, y, 0.0)
    }

    fn write_height(&self, out: &mut String, left: f64, y: f64, z_mm: f64) -> fmt::Result {
        let (x, y) = (left - 6.0, y + 4.2);
        writeln!(out, r#"<text class="muted end" x="{x:.1}" y="{y:.1}">{}</text>"#, short(z_mm))
    }

    fn facts(&self) -> Vec<(&'static str, String)> {
        self.detector.facts()
    }

    fn write_facts(&self, out: &mut String) -> fmt::Result {
        let left = self.section_left_px();
        let mut y = TOP_PX + 34.0 + self.section_height_px() + 50.0;
        for (what, value) in self.facts() {
            let right = left + SECTION_WIDTH_PX + 10.0;
            writeln!(out, r#"<text class="muted" x="{left:.1}" y="{y:.1}">{what}</text>"#)?;
            writeln!(out, r#"<text x="{right:.1}" y="{y:.1}">{value}</text>"#)?;
            y += 18.0;
        }
        Ok(())
    }
}

impl Detector {
    /// Size and electrodes, in a line.
    pub fn summary(&self) -> String {
        let [width_m, height_m] = self.outline.size_m();
        let diameters_mm = self.electrodes.iter().map(|pad| 2e3 * pad.radius_m);
        let [least, most] =
            diameters_mm.fold([f64::INFINITY, 0.0], |[least, most]: [f64; 2], mm| [least.min(mm), most.max(mm)]);
        let diameters =
            if short(least) == short(most) { short(most) } else { format!("{} to {}", short(least), short(most)) };
        let size = match &self.surface {
            Some(surface) => format!("{} cm\u{b2} of {} \u{d7}", short(surface.area_m2() * 1e4), surface.file),
            None => format!("{} \u{d7} {} \u{d7}", short(width_m * 1e3), short(height_m * 1e3)),
        };
        let thickness_mm = short(self.thickness_m() * 1e3);
        format!("{size} {thickness_mm} mm, {} electrodes of {diameters} mm", self.electrodes.len())
    }

    /// What else there is to know, each with its name.
    pub fn facts(&self) -> Vec<(&'static str, String)> {
        let mut facts = vec![
            ("sheet conductance", format!("{} mS", short(self.sheet_conductance_s() * 1e3))),
            ("contact impedance", format!("{} ohm cm\u{b2}", short(self.contact_impedance_ohm_m2 * 1e4))),
            ("drive", format!("{} V", short(self.drive_v))),
            ("on-resistance", format!("{} ohm", short(self.on_resistance_ohm))),
            ("ADC", format!("{} bits to {} V", self.adc.bits, short(self.adc.full_scale_v))),
            ("noise", format!("{} LSB", short(self.adc.noise_lsb))),
        ];
        let elasticity = |skin: Skin| ("elasticity", format!("{} MPa", short(skin.young_pa * 1e-6)));
        facts.extend(self.skin.map(elasticity));
        facts.extend(self.skin.map(|skin| ("surface touched", skin.surface.summary())));
        facts.extend(self.bond().map(|(_, bond)| ("layers joined by", bond.summary())));
        facts.extend(self.force.as_ref().map(|law| ("forces", format!("up to {} N", short(law.limit_n())))));
        let presses = |correction: &Correction| ("corrected", format!("by {} known presses", correction.presses()));
        facts.extend(self.correction.as_ref().map(presses));
        facts
    }
}

impl Layer {
    /// Thickness and conductivity, in a line.
    pub fn summary(&self) -> String {
        let thickness_mm = short(self.thickness_m * 1e3);
        if self.bottom_s_per_m == self.top_s_per_m {
            return format!("{thickness_mm} mm of {} S/m", short(self.top_s_per_m));
        }
        format!("{thickness_mm} mm, {} to {} S/m", short(self.bottom_s_per_m), short(self.top_s_per_m))
    }
}

/// Heights of the layers in the picture (px), bottom first; thin ones are drawn thicker than they are.
fn heights_px(layers: &[Layer]) -> Vec<f64> {
    let total_m: f64 = layers.iter().map(|layer| layer.thickness_m).sum();
    layers.iter().map(|layer| (SECTION_HEIGHT_PX * layer.thickness_m / total_m).max(MIN_LAYER_PX)).collect()
}

/// Colour of a conductivity: the darker, the more conductive, from 0.001 to 100 S/m in equal steps of its logarithm.
fn colour(s_per_m: f64) -> String {
    let share = ((s_per_m.log10() + 3.0) / 5.0).clamp(0.0, 1.0);
    let [r, g, b] = [(0xf7, 0x9a), (0xef, 0x5f), (0xdf, 0xb4)]
        .map(|(light, dark)| (f64::from(light) + share * (f64::from(dark) - f64::from(light))).round() as u8);
    format!("#{r:02x}{g:02x}{b:02x}")
}

/// The smallest of 1, 2, 5, 10, ... that is not below `least`, and the decimals that it needs.
fn round_step(least: f64) -> (f64, usize) {
    let decade = 10f64.powf(least.log10().floor());
    let step = [1.0, 2.0, 5.0, 10.0].map(|factor| factor * decade).into_iter().find(|step| *step >= least * 0.999);
    let step = step.unwrap_or(10.0 * decade);
    (step, (-step.log10().floor()).clamp(0.0, 9.0) as usize)
}

/// A number with four digits at most.
pub fn short(value: f64) -> String {
    if value == 0.0 {
        return "0".to_owned();
    }
    let decade = value.abs().log10().floor();
    if !(-4.0..6.0).contains(&decade) {
        return format!("{value:.2e}");
    }
    let text = format!("{value:.*}", (3.0 - decade).max(0.0) as usize);
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_picture_has_every_electrode_at_its_place_with_its_number() {
        let detector = Detector::preset("square-60").unwrap();
        let svg = detector.to_svg();
        assert_eq!(svg.matches("<circle").count(), 16);
        // 420 px for 60 mm: electrode 0 is 22.5 mm left of and below the middle.
        assert!(svg.contains(r#"<circle class="pad" cx="126.5" cy="451.5" r="14.0"/>"#), "{svg}");
        assert!((0..16).all(|channel| svg.contains(&format!(">{channel}</text>"))), "{svg}");
        assert!(svg.contains("x (mm)") && svg.contains("5 mm of 0.2273 S/m") && svg.ends_with("</svg>\n"), "{svg}");
    }

    #[test]
    fn dots_of_glue_are_drawn_and_named() {
        let svg = Detector::preset("BB-7x7").unwrap().to_svg();
        assert_eq!(svg.matches(r#"<circle class="dot""#).count(), 49);
        // 7.22 mm at 7 px a millimetre.
        assert!(
            svg.contains(r#"cx="284.0" cy="294.0" r="25.3""#) && svg.contains("7 \u{d7} 7 dots of 7.22 mm"),
            "{svg}"
        );
    }

    #[test]
    fn names_cannot_leave_their_place() {
        let mut detector = Detector::preset("square-60").unwrap();
        detector.name = "<script> & more".to_owned();
        assert!(detector.to_svg().contains("&lt;script&gt; &amp; more"));
    }

    #[test]
    fn numbers_and_steps_are_round() {
        let numbers = [0.2273, 60.0, 0.001667, 1e-5, 123_456.0, 0.0].map(short);
        assert_eq!(numbers, ["0.2273", "60", "0.001667", "1.00e-5", "123456", "0"]);
        assert_eq!(round_step(0.3), (0.5, 1));
        assert_eq!(round_step(7.0), (10.0, 0));
        assert_eq!(round_step(12.0), (20.0, 0));
    }
}
