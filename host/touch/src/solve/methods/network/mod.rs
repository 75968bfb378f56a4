//! Image and contacts by a [network](crate::learned::network) that was trained on simulated detectors as they are built.

mod grid;
mod peaks;

use std::sync::Arc;

use self::grid::{Grid, Spread};
use crate::learned::network::{Network, NetworkError, Outputs};
use crate::solve::answer::{Flags, FoundContact, Solution, SolveError, check};
use crate::solve::fit::linear::full_v;
use crate::solve::fit::locate::Locator;
use crate::solve::fit::policy;
use crate::solve::problem::Problem;
use crate::solve::solver::Solver;
use tactomo_physics::readings::Readings;

/// Logarithms of total conductances in sheet conductances, which are held between these: no scene that was trained with is outside.
const TOTALS: [f32; 2] = [-7.0, 4.0];

/// `network`: a network, on the image of a problem.
pub struct NetworkSolver {
    network: Arc<Network>,
    electrodes: usize,
    drive_v: f64,
    full_v: f64,
    sheet_s: f64,
    grid: Grid,
    /// From the grid to the problem's image.
    spread: Spread,
    locator: Locator,
    outputs: Outputs,
}

impl NetworkSolver {
    /// Runs a network on a detector.
    ///
    /// # Errors
    /// [`NetworkError::Detector`] if it was trained for another one.
    pub fn new(problem: &Problem, network: Arc<Network>) -> Result<Self, NetworkError> {
        let detector = problem.detector();
        network.check(detector)?;
        let grid = Grid::new(network.image.outputs(), network.size_m);
        Ok(Self {
            electrodes: detector.electrodes.len(),
            drive_v: detector.drive_v,
            full_v: full_v(detector),
            sheet_s: detector.sheet_conductance_s(),
            spread: Spread::new(&grid, &problem.jacobian.image_mesh.nodes_m),
            locator: Locator::new(&problem.jacobian.image_mesh, detector),
            grid,
            network,
            outputs: Outputs::default(),
        })
    }

    fn flags(&self, readings: &Readings, log_size: f32) -> Flags {
        let errors = self.outputs.features.iter().zip(&self.outputs.echo).map(|(is, echoed)| (is - echoed).powi(2));
        let echo_error = (errors.sum::<f32>() / self.outputs.echo.len() as f32).sqrt();
        let is_beyond = readings.volts().iter().any(|volts| volts.abs() > self.drive_v);
        Flags {
            saturated: readings.largest_v() >= self.full_v,
            misfit: is_beyond || !self.network.was_seen(log_size, echo_error),
            ..Flags::default()
        }
    }

    /// Contacts at the highest peaks of the map, each with the conductance (S) of the part of the grid's image that is nearest to it.
    fn contacts(&self, count: usize, image_s_per_m2: &[f32]) -> Vec<FoundContact> {
        let places_m = peaks::places_m(&self.grid, &self.outputs.map, count);
        let conductances_s = self.grid.conductances_s(image_s_per_m2, &places_m);
        let least_s = policy::NETWORK_LEAST_SHARE * conductances_s.iter().sum::<f64>();
        let contact = |([x_m, y_m], conductance_s): (&[f64; 2], f64)| {
            (conductance_s >= least_s).then(|| FoundContact::flat(*x_m, *y_m, conductance_s))
        };
        places_m.iter().zip(conductances_s).filter_map(contact).collect()
    }
}

impl Solver for NetworkSolver {
    fn name(&self) -> &'static str {
        "network"
    }

    fn solve(&mut self, readings: &Readings) -> Result<Solution, SolveError> {
        check(readings, self.electrodes)?;
        if self.locator.is_rest(readings) {
            return Ok(Solution::default());
        }
        let log_size = self.network.features.of(readings, self.drive_v, &mut self.outputs.features);
        self.network.run(&mut self.outputs);
        let flags = self.flags(readings, log_size);
        let count = largest(&self.outputs.count);
        let total = self.outputs.total[0].clamp(TOTALS[0], TOTALS[1]);
        let total_s = if count == 0 { 0.0 } else { f64::from(total).exp() * self.sheet_s };
        self.grid.scale(&mut self.outputs.image, total_s);
        // The last class is one shape, which is no contact.
        let is_shape = count + 1 == self.outputs.count.len();
        let contacts = if is_shape { Vec::new() } else { self.contacts(count, &self.outputs.image) };
        Ok(Solution {
            image_s_per_m2: Some(self.spread.image(&self.outputs.image)),
            contacts,
            flags,
            ..Solution::default()
        })
    }
}

/// Which of some numbers is largest.
fn largest(values: &[f32]) -> usize {
    (0..values.len()).max_by(|a, b| values[*a].total_cmp(&values[*b])).unwrap_or(0)
}

#[cfg(test)]
mod tests;
