//! MCAP files of the profile `ros2`: messages as ROS 2 passes them on, for its tools and whoever reads its bags.
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

use tactomo_physics::detector::Detector;

use self::cdr::Cdr;
use super::writer::{Schema, Writer};
use super::{CHUNK_BYTES, LIBRARY};
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

    /// Its name, its type, and the definition of that.
    fn described(self) -> (&'static str, &'static str, String) {
        match self {
            Self::Points => ("/tactomo/points", "sensor_msgs/msg/PointCloud2", schemas::point_cloud()),
            Self::Wrench => ("/tactomo/wrench", "geometry_msgs/msg/WrenchStamped", schemas::wrench()),
            Self::Contacts => ("/tactomo/contacts", "tactomo_msgs/msg/Contacts", schemas::contacts()),
            Self::Frame => ("/tactomo/frame", "tactomo_msgs/msg/Frame", schemas::frame()),
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

/// An MCAP file of the profile `ros2` that is being written.
pub struct Ros2File<W: Write> {
    writer: Writer<W>,
    detector: Detector,
    /// Number of each topic in the file.
    channels: [u16; Topic::ALL.len()],
    sequence: u32,
}

impl<W: Write> Ros2File<W> {
    /// Begins a file of a detector's touch, with what is to be known of it.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn new(out: W, detector: &Detector, about: &BTreeMap<String, String>) -> io::Result<Self> {
        let mut writer = Writer::new(out, "ros2", LIBRARY, CHUNK_BYTES)?;
        writer.metadata("tactomo", about)?;
        let channels = Topic::ALL.map(|topic| {
            let (name, r#type, data) = topic.described();
            // Without it readers of bags find no quality of service; empty is their usual one.
            let metadata = [("offered_qos_profiles", "")];
            writer.channel(name, "cdr", &metadata, &Schema { name: r#type, encoding: "ros2msg", data: &data })
        });
        Ok(Self { writer, detector: detector.clone(), channels, sequence: 0 })
    }

    /// Writes an event.
    ///
    /// # Errors
    /// If that fails: then nothing more can be written.
    pub fn write(&mut self, delivery: &Delivery) -> io::Result<()> {
        let time_ns = delivery.event.frame.arrived.unix_ns;
        for (topic, number) in Topic::ALL.into_iter().zip(self.channels) {
            if let Some(message) = topic.message(delivery, &self.detector) {
                self.writer.message(number, self.sequence, time_ns, message.bytes())?;
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
