//! MCAP files of the profile `ros2`: messages as ROS 2 passes them on, for its tools and whoever reads its bags. Of several detectors, each has
//! topics of its own, such as `/tactomo/thumb/points`, and a frame of its own name.
//!
//! | topic | type | what |
//! |---|---|---|
//! | `/tactomo/points` | `sensor_msgs/msg/PointCloud2` | contacts: place, force, conductance, radius, number |
//! | `/tactomo/wrench` | `geometry_msgs/msg/WrenchStamped` | force and torque of all that touches, where its force is known |
//! | `/tactomo/contacts` | `tactomo_msgs/msg/Contacts` | contacts with standard errors and flags |
//! | `/tactomo/frame` | `tactomo_msgs/msg/Frame` | the readings as measured, as they are used, and as the solver got them |

mod cdr;
mod messages;
mod schemas;
#[cfg(test)]
mod tests;

use std::collections::BTreeMap;
use std::io::{self, Write};
use std::sync::Arc;

use tactomo_physics::detector::Detector;

use self::cdr::Cdr;
use super::writer::{Schema, Writer};
use super::{CHUNK_BYTES, LIBRARY};
use crate::sink::channels::topic;
use crate::sink::feed::Delivery;

/// A topic.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Topic {
    Points,
    Wrench,
    Contacts,
    Frame,
}

impl Topic {
    const ALL: [Self; 4] = [Self::Points, Self::Wrench, Self::Contacts, Self::Frame];

    /// What its name ends in, its type, and the definition of that.
    fn described(self) -> (&'static str, &'static str, String) {
        match self {
            Self::Points => ("points", "sensor_msgs/msg/PointCloud2", schemas::point_cloud()),
            Self::Wrench => ("wrench", "geometry_msgs/msg/WrenchStamped", schemas::wrench()),
            Self::Contacts => ("contacts", "tactomo_msgs/msg/Contacts", schemas::contacts()),
            Self::Frame => ("frame", "tactomo_msgs/msg/Frame", schemas::frame()),
        }
    }

    /// Its message of an event, if there is one.
    fn message(self, delivery: &Delivery, detector: &Detector) -> Option<Cdr> {
        match self {
            Self::Points => Some(messages::points(delivery)),
            Self::Wrench => messages::wrench(delivery, detector),
            Self::Contacts => Some(messages::contacts(delivery)),
            Self::Frame => Some(messages::frame(delivery)),
        }
    }
}

/// What a detector is called in topics: as ROS 2 has names, of letters, digits and `_`, with no digit first.
pub fn name(patch: &str) -> String {
    let name: String = patch.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '_' }).collect();
    // What begins with `_` is hidden from the tools of ROS 2.
    if name.starts_with(|first: char| !first.is_ascii_alphabetic()) { format!("patch_{name}") } else { name }
}

/// An MCAP file of the profile `ros2` that is being written.
pub struct Ros2File<W: Write> {
    writer: Writer<W>,
    detectors: Vec<Channels>,
    sequence: u32,
}

/// A detector in it.
struct Channels {
    /// Its name among several; empty if it is alone.
    patch: Arc<str>,
    detector: Detector,
    /// Number of each topic in the file.
    numbers: [u16; Topic::ALL.len()],
}

impl<W: Write> Ros2File<W> {
    /// Begins a file of the touch of detectors whose [names](name) are different, or of one, whose name is empty; with what is to be known of
    /// them.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn new(out: W, detectors: Vec<(Arc<str>, Detector)>, about: &BTreeMap<String, String>) -> io::Result<Self> {
        let mut writer = Writer::new(out, "ros2", LIBRARY, CHUNK_BYTES)?;
        writer.metadata("tactomo", about)?;
        let detectors = detectors.into_iter().map(|(patch, detector)| {
            let numbers = Topic::ALL.map(|of| {
                let (what, r#type, data) = of.described();
                // Without it readers of bags find no quality of service; empty is their usual one.
                let metadata = [("offered_qos_profiles", "")];
                let schema = Schema { name: r#type, encoding: "ros2msg", data: &data };
                writer.channel(&topic(&name(&patch), what), "cdr", &metadata, &schema)
            });
            Channels { patch, detector, numbers }
        });
        Ok(Self { detectors: detectors.collect(), writer, sequence: 0 })
    }

    /// Writes an event of one of the detectors; of any other, nothing.
    ///
    /// # Errors
    /// If that fails: then nothing more can be written.
    pub fn write(&mut self, delivery: &Delivery) -> io::Result<()> {
        let time_ns = delivery.event.frame.arrived.unix_ns;
        for Channels { detector, numbers, .. } in self.detectors.iter().filter(|of| of.patch == delivery.patch) {
            for (topic, number) in Topic::ALL.into_iter().zip(numbers) {
                if let Some(message) = topic.message(delivery, detector) {
                    self.writer.message(*number, self.sequence, time_ns, message.bytes())?;
                }
            }
        }
        self.sequence = self.sequence.wrapping_add(1);
        Ok(())
    }

    /// Writes the index: the file is complete.
    ///
    /// # Errors
    /// If that fails.
    pub fn finish(mut self) -> io::Result<()> {
        self.writer.finish()
    }
}
