"""A node that publishes what touches a detector, as `tactomo export --profile ros2` writes it."""

import threading

import numpy as np
import rclpy
import tactomo
from geometry_msgs.msg import WrenchStamped
from rclpy.node import Node
from rclpy.qos import qos_profile_sensor_data
from sensor_msgs.msg import PointCloud2, PointField
from std_srvs.srv import Trigger
from tactomo_msgs.msg import Contact, Contacts, Frame

# Without a port, the board on whichever USB serial port answers. Readings are published only if they are wanted.
PARAMETERS = {
    "port": "",
    "simulate": False,
    "detector": "square-60",
    "solver": "auto",
    "scan": "whole",
    "frame_id": "tactomo",
    "readings": False,
}
POINT = np.dtype([(name, "<f4") for name in ("x", "y", "z", "force_n", "conductance_s", "radius_m")] + [("id", "<i4")])
STATES = {"start": Contact.START, "move": Contact.MOVE, None: Contact.UNKNOWN}
# What stands for a value that is not known, by its type.
UNKNOWN = {"int64": -1, "double": float("nan"), "boolean": False}


def stamped(message, event, frame_id):
    """The message with its header: when the frame was scanned, as far as is known, else when it came."""
    nanoseconds = event.host_time_ns or round(event.arrived_unix_s * 1e9)
    message.header.stamp.sec, message.header.stamp.nanosec = divmod(nanoseconds, 1_000_000_000)
    message.header.frame_id = frame_id
    return message


def contact_message(found):
    contact = Contact(state=STATES[found.state])
    for name, kind in Contact.get_fields_and_field_types().items():
        if name != "state":
            value = getattr(found, name)
            setattr(contact, name, UNKNOWN[kind] if value is None else value)
    return contact


def contacts_message(event):
    solution, flags = event.solution, event.solution.flags
    known = {name: value for name in ("residual", "certainty") if (value := getattr(solution, name)) is not None}
    return Contacts(
        sequence=event.sequence,
        time_s=event.time_s,
        lost_before=event.lost_before,
        rezeroing=event.rezeroing,
        contacts=[contact_message(found) for found in event.contacts],
        ended=event.ended,
        choice=solution.choice[0] if solution.choice else "",
        excluded=flags.excluded,
        faults=flags.faults,
        **{name: getattr(flags, name) for name in ("saturated", "misfit", "unfinished", "calibrate")},
        **{"residual": UNKNOWN["double"], "certainty": UNKNOWN["double"], **known},
    )


def points_message(event):
    def values(found):
        """What is not known becomes NaN."""
        known = (found.x_m, found.y_m, found.z_m, found.force_n, found.conductance_s or None, found.radius_m)
        return *(UNKNOWN["double"] if value is None else value for value in known), -1 if found.id is None else found.id

    points = np.array([values(found) for found in event.contacts], POINT)
    fields = [
        PointField(name=name, offset=offset, count=1, datatype=PointField.INT32 if name == "id" else PointField.FLOAT32)
        for name, (_, offset) in POINT.fields.items()
    ]
    step = POINT.itemsize
    return PointCloud2(
        height=1, width=len(points), fields=fields, point_step=step, row_step=step * len(points), data=points.tobytes(), is_dense=True
    )


def wrench_message(event, detector):
    """What pushes on a flat detector, about its middle; `None` where a force is not known. How contacts pull along the foam is not felt."""
    solution = event.solution
    forces = [contact.force_n for contact in event.contacts]
    if not solution.is_contacts or None in forces or not (forces or detector.has_newtons) or detector.electrodes_m[:, 2].any():
        return None
    message = WrenchStamped()
    message.wrench.force.z = float(-sum(forces))
    message.wrench.torque.x = float(-sum(contact.y_m * contact.force_n for contact in event.contacts))
    message.wrench.torque.y = float(sum(contact.x_m * contact.force_n for contact in event.contacts))
    return message


def frame_message(event):
    volts = {name: getattr(event, name).ravel().tolist() for name in ("readings_v", "used_v", "touch_v")}
    electrodes = len(event.readings_v)
    return Frame(sequence=event.sequence, time_s=event.time_s, electrodes=electrodes, averaged=event.averaged, **volts)


class Touch(Node):
    """Publishes each answer of a board."""

    def __init__(self):
        super().__init__("tactomo")
        of = {name: self.declare_parameter(name, default).value for name, default in PARAMETERS.items()}
        self.frame_id, self.has_readings = of["frame_id"], of["readings"]
        detector = tactomo.Detector(of["detector"])
        self.live = tactomo.Live(
            of["port"] or None, simulate=of["simulate"], detector=detector, solver=of["solver"], scan=of["scan"]
        )
        topics = {"points": PointCloud2, "wrench": WrenchStamped, "contacts": Contacts, "frame": Frame}
        self.topics = {
            name: self.create_publisher(kind, f"tactomo/{name}", qos_profile_sensor_data) for name, kind in topics.items()
        }
        self.create_service(Trigger, "tactomo/rezero", self.rezero)

    def rezero(self, _request, response):
        """Takes the next frames as the baseline; nothing must press."""
        self.live.rezero()
        response.success = True
        return response

    def publish(self, event):
        messages = {
            "points": points_message(event),
            "wrench": wrench_message(event, self.live.detector),
            "contacts": contacts_message(event),
            "frame": frame_message(event) if self.has_readings else None,
        }
        for name, message in messages.items():
            if message is not None:
                self.topics[name].publish(stamped(message, event, self.frame_id))

    def run(self):
        """Until the board ends, or ROS does."""
        with self.live as live:
            for event in live:
                if not rclpy.ok():
                    break
                self.publish(event)


def main():
    rclpy.init()
    node = Touch()
    threading.Thread(target=rclpy.spin, args=(node,), daemon=True).start()
    try:
        node.run()
    except KeyboardInterrupt:
        pass
    finally:
        node.destroy_node()
        rclpy.try_shutdown()
