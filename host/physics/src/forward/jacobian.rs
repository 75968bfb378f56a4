//! The linear answer of a detector to contacts, kept as its factors.
//!
//! At no contact, `d reading[g][e] / d conductance[k] = Vcc (N(e,k) - N(g,k) - N(e,g) + N(g,g) + R_on)`. It is a function of
//! the fields `N(e,k)`, one number for each node and electrode, and so has only as many dimensions as there are electrodes:
//! the difference of fields gives all but one, the total conductance the last.

use nalgebra::DMatrix;

use super::{ForwardModel, ImageMesh};
use crate::detector::Detector;

/// Derivatives of the readings by contact conductance, at no contact, for each node of an image.
#[derive(Clone, Debug, PartialEq)]
pub struct Jacobian {
    /// Name of the model that it was made with.
    pub model: String,
    /// The detector.
    pub detector: Detector,
    /// Places of the image.
    pub image_mesh: ImageMesh,
    /// [`ForwardModel::fields_ohm`]: `nodes x electrodes`.
    pub fields_ohm: DMatrix<f64>,
    /// [`ForwardModel::electrode_fields_ohm`]: `electrodes x electrodes`.
    pub electrode_fields_ohm: DMatrix<f64>,
}

impl Jacobian {
    /// The linear theory of a model.
    pub fn of(model: &dyn ForwardModel) -> Self {
        Self {
            model: model.name().to_owned(),
            detector: model.detector().clone(),
            image_mesh: model.image_mesh().clone(),
            fields_ohm: model.fields_ohm().clone(),
            electrode_fields_ohm: model.electrode_fields_ohm().clone(),
        }
    }

    /// Change of a reading for conductance at a node (V/S): electrode `e` while `g` is grounded.
    ///
    /// # Panics
    /// If there is no such electrode or node.
    pub fn volts_per_s(&self, g: usize, e: usize, node: usize) -> f64 {
        let fields = self.fields_ohm[(node, e)] - self.fields_ohm[(node, g)];
        self.detector.drive_v * (fields + self.total_ohm(g, e))
    }

    /// What all conductance does alike, wherever it is (ohm): `N(g,g) - N(e,g) + R_on`, or `R_on` for the grounded electrode.
    pub fn total_ohm(&self, g: usize, e: usize) -> f64 {
        let pads = &self.electrode_fields_ohm;
        pads[(g, g)] - pads[(e, g)] + self.detector.on_resistance_ohm
    }

    /// All of it (V/S): row `g * electrodes + e`, one column a node. Large: for tests and for export.
    pub fn dense(&self) -> DMatrix<f64> {
        let electrodes = self.electrodes();
        DMatrix::from_fn(electrodes * electrodes, self.fields_ohm.nrows(), |row, node| {
            self.volts_per_s(row / electrodes, row % electrodes, node)
        })
    }

    /// Number of electrodes.
    pub fn electrodes(&self) -> usize {
        self.fields_ohm.ncols()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::forward::shell::Shell;
    use crate::forward::{ForwardError, readings_v};

    #[test]
    fn a_light_contact_moves_the_readings_as_the_jacobian_says() -> Result<(), ForwardError> {
        let Some(detector) = Detector::preset("square-60") else { panic!("no preset") };
        let shell = Shell::with_nodes(&detector, 1000)?;
        let jacobian = Jacobian::of(&shell);
        let (node, conductance_s) = (700, 1e-8);
        let image_s = shell.image_mesh().image_with([(node, conductance_s)]);
        let readings = readings_v(&shell.image_fields(&image_s)?.impedance_ohm, &detector);
        for (g, e) in [(0, 1), (3, 3), (7, 12), (15, 0)] {
            let linear_v = jacobian.volts_per_s(g, e, node) * conductance_s;
            assert!((readings.at(g, e) / linear_v - 1.0).abs() < 1e-3, "{} {linear_v}", readings.at(g, e));
        }
        Ok(())
    }

    #[test]
    fn its_rank_is_the_number_of_electrodes() -> Result<(), ForwardError> {
        let Some(detector) = Detector::preset("strip-13x60") else { panic!("no preset") };
        let values = Jacobian::of(&Shell::with_nodes(&detector, 800)?).dense().singular_values();
        assert!(values[15] > 1e-4 * values[0] && values[16] < 1e-11 * values[0], "{values}");
        Ok(())
    }
}
