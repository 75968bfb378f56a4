//! The numbers of all that touches, by their names.

use serde::ser::{Serialize, SerializeMap, Serializer};

use crate::solve::Total;

/// A number of the [`Total`], by its name.
pub struct TotalColumn {
    /// Name with unit, after `total_`; in JSON, where the total is an object, without that.
    pub name: &'static str,
    of: fn(&Total) -> Option<f64>,
}

/// The numbers of the total, in the order of every format: force, conductance, area and centre of pressure.
pub const TOTAL_COLUMNS: [TotalColumn; 6] = [
    TotalColumn { name: "total_force_n", of: |total| total.force_n },
    TotalColumn { name: "total_conductance_s", of: |total| Some(total.conductance_s) },
    TotalColumn { name: "total_area_m2", of: |total| total.area_m2 },
    TotalColumn { name: "total_x_m", of: |total| Some(total.centre_m[0]) },
    TotalColumn { name: "total_y_m", of: |total| Some(total.centre_m[1]) },
    TotalColumn { name: "total_z_m", of: |total| Some(total.centre_m[2]) },
];

impl TotalColumn {
    /// Its value, if it is known.
    pub fn value(&self, total: &Total) -> Option<f64> {
        (self.of)(total)
    }
}

/// `{force_n?, conductance_s, area_m2?, x_m, y_m, z_m?}`; z is left out on a flat detector.
impl Serialize for Total {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(None)?;
        for column in &TOTAL_COLUMNS {
            match (column.name.trim_start_matches("total_"), column.value(self)) {
                ("z_m", Some(0.0)) | (_, None) => {}
                (name, Some(value)) => map.serialize_entry(name, &value)?,
            }
        }
        map.end()
    }
}
