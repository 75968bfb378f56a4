//! The messages of an event.

use tactomo_physics::detector::Detector;
use tactomo_physics::readings::Readings;
use tactomo_physics::space::{self, Place};
use tactomo_touch::schema::{CONTACT_COLUMNS, Kind};
use tactomo_touch::solve::FoundContact;

use super::cdr::Cdr;
use crate::sink::channels::frame_id;
use crate::sink::feed::Delivery;

/// Types of fields, as `sensor_msgs/PointField` counts them.
const INT32: u8 = 5;
const FLOAT32: u8 = 7;
/// Fields of a point, 4 bytes each, in their order.
const FIELDS: [(&str, u8); 7] = [
    ("x", FLOAT32),
    ("y", FLOAT32),
    ("z", FLOAT32),
    ("force_n", FLOAT32),
    ("conductance_s", FLOAT32),
    ("radius_m", FLOAT32),
    ("id", INT32),
];
/// A contact whose state is not known, as `tactomo_msgs/Contact` has it.
const UNKNOWN: u8 = 255;

/// A message that begins with a header: when the frame was scanned, as far as is known, and what places are relative to.
fn stamped(delivery: &Delivery) -> Cdr {
    let stamp_ns = delivery.event.frame.stamp_ns();
    let (seconds, nanoseconds) = (stamp_ns / 1_000_000_000, stamp_ns % 1_000_000_000);
    let mut message = Cdr::new();
    // Seconds of ROS 2 are signed and of 32 bits: they end in 2038.
    message.put(i32::try_from(seconds).unwrap_or(i32::MAX).to_le_bytes());
    message.put((nanoseconds as u32).to_le_bytes()).text(frame_id(&delivery.patch));
    message
}

/// Contacts as points (`sensor_msgs/msg/PointCloud2`).
pub(super) fn points(delivery: &Delivery) -> Cdr {
    let contacts = &delivery.changed.contacts;
    let point = |contact: &FoundContact| {
        let known = [contact.force_n, contact.known_conductance_s(), contact.radius_m];
        let [force_n, conductance_s, radius_m] = known.map(|value| value.unwrap_or(f64::NAN));
        let numbers = [contact.x_m, contact.y_m, contact.z_m, force_n, conductance_s, radius_m];
        let id = contact.id.and_then(|id| i32::try_from(id).ok()).unwrap_or(-1);
        numbers.into_iter().map(|number| (number as f32).to_le_bytes()).chain([id.to_le_bytes()]).flatten()
    };
    let data: Vec<u8> = contacts.iter().flat_map(point).collect();
    let (height, width, step) = (1_u32, contacts.len() as u32, 4 * FIELDS.len() as u32);
    let mut message = stamped(delivery);
    message.put(height.to_le_bytes()).put(width.to_le_bytes());
    message.all(FIELDS.iter().enumerate(), |message, (index, (name, datatype))| {
        message.text(name).put((4 * index as u32).to_le_bytes()).put([*datatype]).put(1_u32.to_le_bytes());
    });
    let (is_big_endian, is_dense) = (false, true);
    message.flag(is_big_endian).put(step.to_le_bytes()).put((step * width).to_le_bytes()).octets(&data).flag(is_dense);
    message
}

/// Force on the detector and torque about its middle (`geometry_msgs/msg/WrenchStamped`), where the force of all that touches is known. Contacts
/// press straight into the foam: how they pull along it is not felt.
pub(super) fn wrench(delivery: &Delivery, detector: &Detector) -> Option<Cdr> {
    let event = &*delivery.event;
    let solution = &event.solution;
    let are_known = solution.contacts.iter().all(|contact| contact.force_n.is_some());
    let has_law = detector.force.is_some() || !solution.contacts.is_empty();
    let (mut force_n, mut torque_n_m) = ([0.0; 3], [0.0; 3]);
    for contact in &solution.contacts {
        let at_m = [contact.x_m, contact.y_m, contact.z_m];
        let push_n = outwards(detector, at_m).map(|share| -share * contact.force_n.unwrap_or_default());
        let turn_n_m = space::cross(at_m, push_n);
        for axis in 0..3 {
            force_n[axis] += push_n[axis];
            torque_n_m[axis] += turn_n_m[axis];
        }
    }
    (solution.is_contacts() && are_known && has_law).then(|| {
        let mut message = stamped(delivery);
        for value in force_n.into_iter().chain(torque_n_m) {
            message.number(Some(value));
        }
        message
    })
}

/// The direction away from the foam at a place (m).
fn outwards(detector: &Detector, at_m: Place) -> Place {
    let Some(surface) = &detector.surface else { return [0.0, 0.0, 1.0] };
    let normal = space::normal(surface.corners(surface.nearest(at_m).triangle));
    normal.map(|along| along / space::length(normal))
}

/// Contacts with all that is known of them (`tactomo_msgs/msg/Contacts`).
pub(super) fn contacts(delivery: &Delivery) -> Cdr {
    let event = &*delivery.event;
    let solution = &event.solution;
    let flags = &solution.flags;
    let mut message = stamped(delivery);
    message.put(event.frame.sequence.to_le_bytes()).number(Some(event.frame.time_s()));
    message.put(delivery.lost_before.to_le_bytes()).flag(event.is_taking_baseline);
    message.all(delivery.changed.contacts.iter(), contact);
    message.all(delivery.changed.ended.iter(), |message, id| {
        message.put(i64::from(*id).to_le_bytes());
    });
    message.number(solution.residual).number(solution.certainty);
    message.text(solution.choice.as_ref().map_or("", |choice| &choice.what));
    message.flag(flags.saturated).flag(flags.misfit).flag(flags.unfinished).flag(flags.calibrate);
    message.all(flags.excluded.iter(), |message, electrode| {
        message.put((*electrode as u16).to_le_bytes());
    });
    message.all(flags.faults.iter(), |message, fault| {
        message.text(fault.name());
    });
    message
}

fn contact(message: &mut Cdr, contact: &FoundContact) {
    for column in &CONTACT_COLUMNS {
        let value = column.value(contact);
        match column.kind {
            Kind::Integer => message.put(value.map_or(-1, |value| value as i64).to_le_bytes()),
            Kind::Flag => message.flag(value.is_some_and(|value| value != 0.0)),
            Kind::Number => message.number(value),
            Kind::Word(_) => message.put([value.map_or(UNKNOWN, |value| value as u8)]),
        };
    }
}

/// Readings (`tactomo_msgs/msg/Frame`).
pub(super) fn frame(delivery: &Delivery) -> Cdr {
    let event = &*delivery.event;
    let mut message = stamped(delivery);
    message.put(event.frame.sequence.to_le_bytes()).number(Some(event.frame.time_s()));
    message.put((event.frame.measured.electrodes() as u16).to_le_bytes());
    for readings in [&event.frame.measured, &event.frame.used, &event.touch] {
        volts(&mut message, readings);
    }
    message.put(event.averaged.to_le_bytes());
    message
}

fn volts(message: &mut Cdr, readings: &Readings) {
    let all: Vec<f64> = readings.read_v().collect();
    message.all(all.into_iter(), |message, volts| {
        message.number(Some(volts));
    });
}
