//! The numbers of what a pointer did, by their names.

use super::Kind;
use crate::pointer::PointerEvent;

/// A number of an event of the pointer, by its name.
pub struct EventColumn {
    /// Name with unit, after `event_`.
    pub name: &'static str,
    /// What kind of number it is.
    pub kind: Kind,
    of: fn(&PointerEvent) -> Option<f64>,
}

/// The numbers of an event, for arrays: its kind (0 a move, 1 a press, 2 a release, 3 a click) and what belongs to that.
pub const EVENT_COLUMNS: [EventColumn; 6] = [
    EventColumn {
        name: "kind",
        kind: Kind::Integer,
        of: |event| {
            Some(match event {
                PointerEvent::Move { .. } => 0.0,
                PointerEvent::Press => 1.0,
                PointerEvent::Release { .. } => 2.0,
                PointerEvent::Click { .. } => 3.0,
            })
        },
    },
    EventColumn { name: "dx_m", kind: Kind::Number, of: |event| moved(event).map(|[dx_m, _]| dx_m) },
    EventColumn { name: "dy_m", kind: Kind::Number, of: |event| moved(event).map(|[_, dy_m]| dy_m) },
    EventColumn {
        name: "held_s",
        kind: Kind::Number,
        of: |event| if let PointerEvent::Release { held_s } = event { Some(*held_s) } else { None },
    },
    EventColumn { name: "x_m", kind: Kind::Number, of: |event| clicked(event).map(|[x_m, _]| x_m) },
    EventColumn { name: "y_m", kind: Kind::Number, of: |event| clicked(event).map(|[_, y_m]| y_m) },
];

fn moved(event: &PointerEvent) -> Option<[f64; 2]> {
    if let PointerEvent::Move { dx_m, dy_m } = event { Some([*dx_m, *dy_m]) } else { None }
}

fn clicked(event: &PointerEvent) -> Option<[f64; 2]> {
    if let PointerEvent::Click { x_m, y_m } = event { Some([*x_m, *y_m]) } else { None }
}

impl EventColumn {
    /// Its value, if an event of its kind has it.
    pub fn value(&self, event: &PointerEvent) -> Option<f64> {
        (self.of)(event)
    }
}
