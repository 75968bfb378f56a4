//! The latest of each reading, of scans that read some rows at a time.
//!
//! Rows that were read some milliseconds ago are those of contacts that have moved since. What they say of others than the contacts that are
//! followed is still true: so each reading is kept as what it is beside the model's at that time, and given as the model's now with that. It is
//! the motion of contacts that this follows; where a model takes the place of another, or does not fit, nothing has moved.

use tactomo_physics::readings::{Readings, Says};

/// The latest of each reading, beside what was expected of it.
#[derive(Clone, Debug)]
pub struct Latest {
    electrodes: usize,
    cells: Vec<Cell>,
}

#[derive(Clone, Copy, Debug)]
struct Cell {
    /// As read (V).
    volts: f64,
    says: Says,
    /// What was expected then (V); none where nothing was, or nothing that fits.
    expected_v: Option<f64>,
    /// Time since (s); infinite if it was never read.
    age_s: f64,
}

impl Cell {
    /// What it would read now, where `expected_v` (V) is expected.
    fn now_v(&self, expected_v: Option<f64>) -> f64 {
        match (self.says, self.expected_v, expected_v) {
            (Says::Voltage, Some(then_v), Some(now_v)) => self.volts - then_v + now_v,
            _ => self.volts,
        }
    }
}

impl Latest {
    /// None was read yet.
    pub fn new(electrodes: usize) -> Self {
        let never = Cell { volts: 0.0, says: Says::Nothing, expected_v: None, age_s: f64::INFINITY };
        Self { electrodes, cells: vec![never; electrodes * electrodes] }
    }

    /// Takes rows that come `elapsed_s` (s) after those before, of which a model expects `expected_v` (V); none where nothing is followed.
    pub fn add(&mut self, rows: &Readings, elapsed_s: f64, expected_v: Option<&[f64]>) {
        if rows.electrodes() != self.electrodes {
            *self = Self::new(rows.electrodes());
        }
        let n = self.electrodes;
        for (i, cell) in self.cells.iter_mut().enumerate() {
            cell.age_s += elapsed_s.max(0.0);
            let says = rows.says(i / n, i % n);
            if says != Says::Nothing {
                let expected_v = expected_v.map(|all| all[i]);
                *cell = Cell { volts: rows.volts()[i], says, expected_v, age_s: 0.0 };
            }
        }
    }

    /// Forgets all: what comes does not follow what was.
    pub fn forget(&mut self) {
        self.cells.iter_mut().for_each(|cell| cell.age_s = f64::INFINITY);
    }

    /// The readings that are younger than `oldest_s` (s), as they would be for a model that expects `expected_v` (V) now. Those that are bounds are
    /// given as they were read.
    pub fn readings(&self, oldest_s: f64, expected_v: Option<&[f64]>) -> Readings {
        let n = self.electrodes;
        let volts = |i: usize| self.cells[i].now_v(expected_v.map(|all| all[i]));
        let is_old = |i: usize| self.cells[i].age_s > oldest_s;
        let all = Readings::from_fn(n, |g, e| volts(g * n + e)).saying(|g, e| self.cells[g * n + e].says);
        all.hiding(|g, e| is_old(g * n + e))
    }

    /// Goes on with a model that expects `after_v` (V) now in place of one that expects `before_v` (V): the readings stay as they are given.
    pub fn change_model(&mut self, before_v: Option<&[f64]>, after_v: Option<&[f64]>) {
        for (i, cell) in self.cells.iter_mut().enumerate() {
            cell.volts = cell.now_v(before_v.map(|all| all[i]));
            cell.expected_v = after_v.map(|all| all[i]);
        }
    }

    /// Whether every reading was read within `oldest_s` (s).
    pub fn is_whole(&self, oldest_s: f64) -> bool {
        self.cells.iter().all(|cell| cell.age_s <= oldest_s)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(g: usize, volts: f64) -> Readings {
        Readings::from_fn(4, |_, _| volts).hiding(|ground, _| ground != g)
    }

    #[test]
    fn rows_are_given_as_long_as_they_are_young() {
        let mut latest = Latest::new(4);
        (0..4).for_each(|g| latest.add(&row(g, 0.1 * g as f64), 1e-3, None));
        assert!(latest.is_whole(3.5e-3) && !latest.is_whole(2.5e-3));
        let young = latest.readings(1.5e-3, None);
        assert_eq!([0, 1, 2, 3].map(|g| young.says(g, 1) == Says::Nothing), [true, true, false, false]);
        latest.forget();
        assert!(latest.readings(9.0, None).all_say().iter().all(|says| *says == Says::Nothing));
    }

    #[test]
    fn what_was_not_expected_goes_with_what_is() {
        let mut latest = Latest::new(4);
        latest.add(&row(1, 0.5), 0.0, Some(&[0.4; 16]));
        latest.add(&row(2, 0.5), 1e-3, Some(&[0.5; 16]));
        let now = latest.readings(1.0, Some(&[0.7; 16]));
        assert!((now.at(1, 3) - 0.8).abs() < 1e-12 && (now.at(2, 3) - 0.7).abs() < 1e-12);
        latest.change_model(Some(&[0.7; 16]), Some(&[0.2; 16]));
        assert!((latest.readings(1.0, Some(&[0.2; 16])).at(1, 3) - 0.8).abs() < 1e-12, "another model moves nothing");
        assert!((latest.readings(1.0, Some(&[0.3; 16])).at(1, 3) - 0.9).abs() < 1e-12);
        assert!((latest.readings(1.0, None).at(1, 3) - 0.8).abs() < 1e-12);
    }
}
