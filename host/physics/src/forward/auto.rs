//! Which model a detector needs.

use super::shell::Shell;
use super::{DrivingLayer, ForwardError, ForwardModel, Resolution, Slab};
use crate::detector::Detector;

/// Thickness, in radii of the smallest pad, up to which the shell's readings are within 0.6 % of the slab's. Measured by
/// `cargo run --release --example shell_or_slab`: the error grows in proportion, 10 % for each radius of a uniform layer. It is all at the rims of
/// pads, which the slab resolves from about there on; contacts at a rim are then off by a fraction of a millimetre, or far where a wide one
/// elsewhere explains the difference.
const SHELL_THICKNESS: f64 = 0.05;

/// Largest over smallest conductivity in depth up to which that holds.
const SHELL_CONTRAST: f64 = 2.0;

/// The model for a detector, and why that one.
pub struct Auto {
    /// The model.
    pub model: Box<dyn ForwardModel>,
    /// Why, in words.
    pub reason: String,
}

impl Auto {
    /// Chooses: the shell where it is all that there is or as good, else the slab. `shell_nodes`: of the shell's mesh, or the default.
    ///
    /// # Errors
    /// [`ForwardError::Detector`] if the model cannot be made.
    pub fn new(detector: &Detector, shell_nodes: Option<usize>) -> Result<Self, ForwardError> {
        Self::under(detector, shell_nodes, DrivingLayer::default())
    }

    /// Chooses the shell or the slab, with a driving layer that need not be ideal.
    ///
    /// # Errors
    /// As for [`new`](Self::new).
    pub fn under(detector: &Detector, shell_nodes: Option<usize>, driving: DrivingLayer) -> Result<Self, ForwardError> {
        let (needs_slab, reason) = match needs_slab(detector) {
            (false, _) if driving.sheet_ohm > 0.0 && detector.outline.as_rectangle().is_some() => {
                (true, "its driving layer has a sheet resistance, which only the slab can have".to_owned())
            }
            needs => needs,
        };
        let model: Box<dyn ForwardModel> = if needs_slab {
            Box::new(Slab::under(detector, Resolution::STANDARD, driving)?)
        } else {
            let nodes = shell_nodes.unwrap_or_else(|| Shell::default_nodes(detector));
            Box::new(Shell::with_nodes(detector, nodes)?.under(driving)?)
        };
        Ok(Self { model, reason })
    }
}

/// Whether a detector needs the slab, and why.
fn needs_slab(detector: &Detector) -> (bool, String) {
    if detector.surface.is_some() {
        return (false, "it is curved, which only the shell can be".to_owned());
    }
    if detector.outline.as_rectangle().is_none() {
        return (false, "its outline is not a rectangle, which the slab has to be".to_owned());
    }
    if detector.bond().is_some() {
        return (true, "dots of glue join its layers, which only the slab can have".to_owned());
    }
    let pad_m = detector.electrodes.iter().map(|pad| pad.radius_m).fold(f64::INFINITY, f64::min);
    let thickness = detector.thickness_m() / pad_m;
    if thickness > SHELL_THICKNESS {
        return (true, format!("it is {thickness:.1} pad radii thick; the shell is for {SHELL_THICKNESS} at most"));
    }
    let conductivities = || detector.layers.iter().flat_map(|layer| [layer.bottom_s_per_m, layer.top_s_per_m]);
    let contrast = conductivities().fold(0.0, f64::max) / conductivities().fold(f64::INFINITY, f64::min);
    if contrast > SHELL_CONTRAST {
        return (
            true,
            format!("its conductivity varies {contrast:.1} times in depth; the shell is for {SHELL_CONTRAST}"),
        );
    }
    (false, format!("it is thin, {thickness:.2} pad radii, so the shell is within 0.6 % of the slab"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::detector::Layer;

    #[test]
    fn thick_and_layered_rectangles_need_the_slab() {
        let mut detector = Detector::preset(Detector::DEFAULT).unwrap();
        assert_eq!(Auto::new(&detector, None).unwrap().model.name(), "slab");
        detector.layers = vec![Layer::uniform(0.0004, 0.2)];
        assert_eq!(Auto::new(&detector, None).unwrap().model.name(), "slab");
        detector.layers = vec![Layer::uniform(0.0001, 0.2)];
        assert_eq!(Auto::new(&detector, None).unwrap().model.name(), "shell");
        let driving = DrivingLayer { sheet_ohm: 100.0, ..DrivingLayer::default() };
        assert_eq!(Auto::under(&detector, None, driving).unwrap().model.name(), "slab");
        detector.layers[0].top_s_per_m = 2.0;
        assert!(needs_slab(&detector).0 && needs_slab(&detector).1.contains("10.0 times"));
    }

    #[test]
    fn layers_joined_by_dots_need_the_slab_however_thin() {
        let mut detector = Detector::preset("BB-5x5").unwrap();
        detector.layers.iter_mut().for_each(|layer| layer.thickness_m = 0.0001);
        assert!(needs_slab(&detector).0 && needs_slab(&detector).1.contains("dots of glue"));
    }

    #[test]
    fn other_outlines_are_shells_however_thick() {
        let mut detector = Detector::preset(Detector::DEFAULT).unwrap();
        detector.outline.outer.truncate(3);
        assert!(!needs_slab(&detector).0 && needs_slab(&detector).1.contains("not a rectangle"));
    }
}
