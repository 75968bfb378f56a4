//! Images of contact on a few hundred nodes, over and over: for solvers that step towards one.

use nalgebra::DMatrix;

use super::contact::conducting_patches;
use super::{ContactFields, ForwardError, ForwardModel};

/// The fields of a bare detector between electrodes and the nodes of an image, once and for all: then an image costs as much as
/// the nodes that conduct, whatever the model.
#[derive(Clone, Debug)]
pub struct Patches {
    electrodes_ohm: DMatrix<f64>,
    cross_ohm: DMatrix<f64>,
    nodes_ohm: DMatrix<f64>,
}

impl Patches {
    /// The patches of a model's image.
    ///
    /// # Errors
    /// As for [`ForwardModel::node_fields_ohm`].
    pub fn of(model: &dyn ForwardModel) -> Result<Self, ForwardError> {
        Ok(Self {
            electrodes_ohm: model.electrode_fields_ohm().clone(),
            cross_ohm: model.fields_ohm().clone(),
            nodes_ohm: model.node_fields_ohm()?,
        })
    }

    /// Number of nodes.
    pub fn nodes(&self) -> usize {
        self.cross_ohm.nrows()
    }

    /// As [`ForwardModel::image_fields`]; `None` if no node conducts or the fields are not those of a detector to rounding.
    ///
    /// # Panics
    /// If there is another number of conductances than nodes.
    pub fn fields(&self, image_s: &[f64]) -> Option<ContactFields> {
        assert_eq!(image_s.len(), self.nodes(), "a conductance for each node");
        let touched: Vec<_> = (0..image_s.len()).filter(|&node| image_s[node] > 0.0).collect();
        let conductance_s: Vec<_> = touched.iter().map(|&node| image_s[node]).collect();
        let cross = self.cross_ohm.select_rows(&touched);
        let between = DMatrix::from_fn(touched.len(), touched.len(), |i, j| self.nodes_ohm[(touched[i], touched[j])]);
        let solved = conducting_patches(&self.electrodes_ohm, &cross, between, &conductance_s).solve()?;
        let mut nodes_ohm = self.cross_ohm.clone();
        let untouched = usize::from(touched.len() < self.nodes());
        for (e, mut column) in nodes_ohm.column_iter_mut().enumerate().take(untouched * self.electrodes_ohm.ncols()) {
            column.add_scalar_mut(solved.constant_ohm[e]);
            for (row, (&node, conductance_s)) in touched.iter().zip(&conductance_s).enumerate() {
                let current = solved.unknowns[(row, e)] * conductance_s.sqrt();
                column.axpy(current, &self.nodes_ohm.column(node), 1.0);
            }
        }
        // Where current flows, Ohm's law at the contact has more digits.
        for (row, (&node, conductance_s)) in touched.iter().zip(&conductance_s).enumerate() {
            nodes_ohm.row_mut(node).copy_from(&(solved.unknowns.row(row) / -conductance_s.sqrt()));
        }
        Some(ContactFields { impedance_ohm: solved.impedance_ohm, nodes_ohm })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::detector::Detector;
    use crate::forward::Slab;
    use crate::forward::shell::Shell;

    #[test]
    fn images_are_those_of_the_model() {
        let detector = Detector::preset(Detector::DEFAULT).unwrap();
        let slab = Slab::new(&detector).unwrap().on_image(200);
        let shell = Shell::with_nodes(&detector, 300).unwrap();
        let models: [&dyn ForwardModel; 2] = [&slab, &shell];
        for model in models {
            let patches = Patches::of(model).unwrap();
            let all = (0..patches.nodes()).map(|node| (node, 1e-6 * (1 + node % 7) as f64));
            let few = [(17, 1e-3), (18, 2e-5), (140, 1e-8)].into_iter();
            for image_s in [model.image_mesh().image_with(all), model.image_mesh().image_with(few)] {
                let (found, expected) = (patches.fields(&image_s).unwrap(), model.image_fields(&image_s).unwrap());
                let off = (&found.impedance_ohm - &expected.impedance_ohm).amax();
                assert!(off < 1e-6 * expected.impedance_ohm.amax(), "{}: {off}", model.name());
                let off = (&found.nodes_ohm - &expected.nodes_ohm).amax();
                assert!(off < 1e-6 * expected.nodes_ohm.amax(), "{}: {off}", model.name());
                let touched = model.touched_fields(&image_s).unwrap();
                let off = (&touched.nodes_ohm - &expected.of_touched(&image_s).nodes_ohm).amax();
                assert!(off < 1e-6 * touched.nodes_ohm.amax(), "{}: {off}", model.name());
                assert!((&touched.impedance_ohm - &found.impedance_ohm).amax() < 1e-6 * found.impedance_ohm.amax());
            }
            assert_eq!(patches.fields(&vec![0.0; patches.nodes()]), None);
        }
    }
}
