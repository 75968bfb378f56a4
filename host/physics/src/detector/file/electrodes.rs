//! The table of electrodes.

use std::fmt::Write as _;

use serde::Deserialize;

use super::super::check::{ELECTRODES, LENGTH_M, Problem, within};
use super::super::preset::electrode_grid;
use super::super::{Detector, Electrode, Outline, Surface};
use crate::space;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ElectrodeTable {
    grid: Option<[usize; 2]>,
    positions_m: Option<Vec<Vec<f64>>>,
    diameter_m: Option<f64>,
    diameters_m: Option<Vec<f64>>,
    contact_impedances_ohm_m2: Option<Vec<f64>>,
    gains: Option<Vec<f64>>,
    unseen_offsets_v: Option<Vec<f64>>,
    offsets_v: Option<Vec<f64>>,
}

impl Detector {
    /// Writes the table.
    pub(super) fn write_electrodes(&self, text: &mut String) -> std::fmt::Result {
        writeln!(text, "\n[electrodes]")?;
        match self.grid() {
            Some([columns, rows]) => writeln!(text, "grid = [{columns}, {rows}]")?,
            None => {
                writeln!(text, "positions_m = [")?;
                let axes = if self.surface.is_some() { 3 } else { 2 };
                let moved_m = self.surface.as_ref().map_or([0.0; 2], |surface| surface.moved_m);
                for pad in &self.electrodes {
                    // The file's surface is where it was drawn, not where it was moved to.
                    let place_m = [pad.x_m - moved_m[0], pad.y_m - moved_m[1], pad.z_m];
                    writeln!(text, "  {:?},", &place_m[..axes])?;
                }
                writeln!(text, "]")?;
            }
        }
        let diameters_m: Vec<f64> = self.electrodes.iter().map(|pad| 2.0 * pad.radius_m).collect();
        match diameters_m.split_first() {
            Some((first, others)) if others.iter().all(|other| other == first) => {
                writeln!(text, "diameter_m = {first:?}")?;
            }
            _ => writeln!(text, "diameters_m = {diameters_m:?}")?,
        }
        if self.electrodes.iter().any(|pad| pad.contact_impedance_ohm_m2.is_some()) {
            let ohm_m2: Vec<f64> = self.electrodes.iter().map(|pad| self.pad_impedance_ohm_m2(pad)).collect();
            writeln!(text, "contact_impedances_ohm_m2 = {ohm_m2:?}")?;
        }
        if self.electrodes.iter().any(|pad| pad.gain != 1.0) {
            let gains: Vec<f64> = self.electrodes.iter().map(|pad| pad.gain).collect();
            writeln!(text, "gains = {gains:?}")?;
        }
        if self.electrodes.iter().any(|pad| pad.unseen_offset_v != 0.0) {
            let offsets_v: Vec<f64> = self.electrodes.iter().map(|pad| pad.unseen_offset_v).collect();
            writeln!(text, "unseen_offsets_v = {offsets_v:?}")?;
        }
        if self.electrodes.iter().any(|pad| pad.offset_v != 0.0) {
            let offsets_v: Vec<f64> = self.electrodes.iter().map(|pad| pad.offset_v).collect();
            writeln!(text, "offsets_v = {offsets_v:?}")?;
        }
        Ok(())
    }

    /// Columns and rows, if the electrodes are a grid.
    fn grid(&self) -> Option<[usize; 2]> {
        let (count, radius_m) = (self.electrodes.len(), self.electrodes.first()?.radius_m);
        if self.surface.is_some() {
            return None;
        }
        let [width_m, height_m] = self.outline.size_m();
        let is_grid = |&[columns, rows]: &[usize; 2]| {
            let grid = electrode_grid(width_m, height_m, columns, rows, radius_m);
            let places_m = |pads: &[Electrode]| pads.iter().map(Electrode::place_m).collect::<Vec<_>>();
            places_m(&grid) == places_m(&self.electrodes)
        };
        (1..=count).filter(|columns| count % columns == 0).map(|columns| [columns, count / columns]).find(is_grid)
    }
}

impl ElectrodeTable {
    /// The electrodes of the table, on a surface if there is one; what was moved by `shift_m` takes them along.
    pub(super) fn into_list(
        self,
        outline: &Outline,
        surface: Option<&Surface>,
        shift_m: [f64; 2],
    ) -> Result<Vec<Electrode>, Problem> {
        let mut electrodes = match (self.grid, self.positions_m) {
            (Some(grid), None) if surface.is_none() => grid_electrodes(grid, outline)?,
            (None, Some(positions_m)) => positions(&positions_m, surface.is_some(), shift_m)?,
            _ if surface.is_some() => {
                return Err(Problem::new("electrodes", "on a surface has to have positions_m, no grid"));
            }
            _ => return Err(Problem::new("electrodes", "has to have either grid = [columns, rows] or positions_m")),
        };
        let diameters_m = diameters_m(self.diameter_m, self.diameters_m, electrodes.len())?;
        electrodes.iter_mut().zip(diameters_m).for_each(|(pad, diameter_m)| pad.radius_m = diameter_m / 2.0);
        if let Some(each) = self.contact_impedances_ohm_m2 {
            let each = one_for_each("electrodes.contact_impedances_ohm_m2", each, electrodes.len())?;
            electrodes.iter_mut().zip(each).for_each(|(pad, ohm_m2)| pad.contact_impedance_ohm_m2 = Some(ohm_m2));
        }
        if let Some(each) = self.gains {
            let each = one_for_each("electrodes.gains", each, electrodes.len())?;
            electrodes.iter_mut().zip(each).for_each(|(pad, gain)| pad.gain = gain);
        }
        if let Some(each) = self.unseen_offsets_v {
            let each = one_for_each("electrodes.unseen_offsets_v", each, electrodes.len())?;
            electrodes.iter_mut().zip(each).for_each(|(pad, offset_v)| pad.unseen_offset_v = offset_v);
        }
        if let Some(each) = self.offsets_v {
            let each = one_for_each("electrodes.offsets_v", each, electrodes.len())?;
            electrodes.iter_mut().zip(each).for_each(|(pad, offset_v)| pad.offset_v = offset_v);
        }
        if let Some(surface) = surface {
            electrodes.iter_mut().enumerate().try_for_each(|(index, pad)| pad.lay_on(surface, index))?;
        }
        Ok(electrodes)
    }
}

impl Electrode {
    /// Moves it to the nearest place of a surface, which must not be farther than the pad is wide.
    fn lay_on(&mut self, surface: &Surface, index: usize) -> Result<(), Problem> {
        let foot_m = surface.nearest(self.place_m()).place_m;
        let distance_m = space::distance(foot_m, self.place_m());
        if distance_m > self.radius_m {
            let what = format!(
                "puts electrode {index} {:.3} mm away from the surface, farther than its radius of {:.3} mm: see surface_unit, \
                 and that positions_m are metres from the same origin",
                distance_m * 1e3,
                self.radius_m * 1e3
            );
            return Err(Problem::new(format!("electrodes.positions_m[{index}]"), what));
        }
        [self.x_m, self.y_m, self.z_m] = foot_m;
        Ok(())
    }
}

/// Electrodes at places of two numbers, or of three on a surface.
fn positions(positions_m: &[Vec<f64>], is_curved: bool, shift_m: [f64; 2]) -> Result<Vec<Electrode>, Problem> {
    let electrode = |(index, place): (usize, &Vec<f64>)| match (is_curved, place.as_slice()) {
        (false, &[x, y]) => Ok(Electrode::flat(x + shift_m[0], y + shift_m[1], f64::NAN)),
        (true, &[x, y, z]) => Ok(Electrode { z_m: z, ..Electrode::flat(x + shift_m[0], y + shift_m[1], f64::NAN) }),
        _ => {
            let wanted = if is_curved { "[x, y, z] on a surface" } else { "[x, y]" };
            let what = format!("has {} numbers, but has to be {wanted}", place.len());
            Err(Problem::new(format!("electrodes.positions_m[{index}]"), what))
        }
    };
    positions_m.iter().enumerate().map(electrode).collect()
}

fn grid_electrodes([columns, rows]: [usize; 2], outline: &Outline) -> Result<Vec<Electrode>, Problem> {
    let count = columns.checked_mul(rows).filter(|count| ELECTRODES.contains(count));
    if count.is_none() {
        let what = format!(
            "is [{columns}, {rows}], but columns times rows has to be {} to {}",
            ELECTRODES.start(),
            ELECTRODES.end()
        );
        return Err(Problem::new("electrodes.grid", what));
    }
    let [width_m, height_m] = outline.size_m();
    Ok(electrode_grid(width_m, height_m, columns, rows, f64::NAN))
}

/// One diameter for all, or one for each.
fn diameters_m(one: Option<f64>, each: Option<Vec<f64>>, count: usize) -> Result<Vec<f64>, Problem> {
    match (one, each) {
        (Some(diameter_m), None) => {
            within("electrodes.diameter_m", diameter_m, LENGTH_M)?;
            Ok(vec![diameter_m; count])
        }
        (None, Some(diameters_m)) => one_for_each("electrodes.diameters_m", diameters_m, count),
        _ => Err(Problem::new("electrodes", "has to have either diameter_m, for all, or diameters_m, one for each")),
    }
}

fn one_for_each(field: &str, numbers: Vec<f64>, count: usize) -> Result<Vec<f64>, Problem> {
    if numbers.len() == count {
        return Ok(numbers);
    }
    let what = format!("has {} numbers, but has to have one for each of {count} electrodes", numbers.len());
    Err(Problem::new(field, what))
}
