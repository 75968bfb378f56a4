//! Definitions of messages, as schemas of the encoding `ros2msg`: that of the message, then those of all that it is made of.

/// What begins the definition of another message: a line of 80 signs, then its name.
const RULE: &str = "================================================================================";

/// A message's definition by its name, as definitions name each other.
struct Definition {
    name: &'static str,
    text: &'static str,
}

const TIME: Definition = Definition { name: "builtin_interfaces/Time", text: "int32 sec\nuint32 nanosec\n" };
const HEADER: Definition =
    Definition { name: "std_msgs/Header", text: "builtin_interfaces/Time stamp\nstring frame_id\n" };
const VECTOR3: Definition = Definition { name: "geometry_msgs/Vector3", text: "float64 x\nfloat64 y\nfloat64 z\n" };
const WRENCH: Definition =
    Definition { name: "geometry_msgs/Wrench", text: "geometry_msgs/Vector3 force\ngeometry_msgs/Vector3 torque\n" };
const WRENCH_STAMPED: Definition =
    Definition { name: "geometry_msgs/WrenchStamped", text: "std_msgs/Header header\ngeometry_msgs/Wrench wrench\n" };
const POINT_FIELD: Definition = Definition {
    name: "sensor_msgs/PointField",
    text: "uint8 INT8=1\nuint8 UINT8=2\nuint8 INT16=3\nuint8 UINT16=4\nuint8 INT32=5\nuint8 UINT32=6\nuint8 FLOAT32=7\n\
           uint8 FLOAT64=8\nstring name\nuint32 offset\nuint8 datatype\nuint32 count\n",
};
const POINT_CLOUD: Definition = Definition {
    name: "sensor_msgs/PointCloud2",
    text: "std_msgs/Header header\nuint32 height\nuint32 width\nsensor_msgs/PointField[] fields\nbool is_bigendian\n\
           uint32 point_step\nuint32 row_step\nuint8[] data\nbool is_dense\n",
};

/// The package's own messages have one definition, which ROS 2 builds them from.
macro_rules! own {
    ($name:literal) => {
        Definition {
            name: concat!("tactomo_msgs/", $name),
            text: include_str!(concat!("../../../../python/adapters/ros2/tactomo_msgs/msg/", $name, ".msg")),
        }
    };
}
const CONTACT: Definition = own!("Contact");
const CONTACTS: Definition = own!("Contacts");
const FRAME: Definition = own!("Frame");

/// A message and all that it is made of, as a schema.
fn schema(message: &Definition, parts: &[Definition]) -> String {
    let parts = parts.iter().map(|part| format!("{RULE}\nMSG: {}\n{}", part.name, part.text));
    std::iter::once(message.text.to_owned()).chain(parts).collect()
}

/// Of `sensor_msgs/msg/PointCloud2`.
pub(super) fn point_cloud() -> String {
    schema(&POINT_CLOUD, &[HEADER, TIME, POINT_FIELD])
}

/// Of `geometry_msgs/msg/WrenchStamped`.
pub(super) fn wrench() -> String {
    schema(&WRENCH_STAMPED, &[HEADER, TIME, WRENCH, VECTOR3])
}

/// Of `tactomo_msgs/msg/Contacts`.
pub(super) fn contacts() -> String {
    schema(&CONTACTS, &[HEADER, TIME, CONTACT])
}

/// Of `tactomo_msgs/msg/Frame`.
pub(super) fn frame() -> String {
    schema(&FRAME, &[HEADER, TIME])
}
