"""The node's messages, with stand-ins for ROS 2: classes made of the definitions, which take nothing that is not in them, as rclpy's do."""

import importlib.util
import math
import pathlib
import re
import sys
import types

import numpy as np
import pytest
import tactomo

HERE = pathlib.Path(__file__).parent
# What the messages of others have that are used here.
STANDARD = {
    "std_msgs/Header": "Time stamp\nstring frame_id",
    "std_msgs/Time": "int32 sec\nuint32 nanosec",
    "geometry_msgs/Vector3": "float64 x\nfloat64 y\nfloat64 z",
    "geometry_msgs/Wrench": "Vector3 force\nVector3 torque",
    "geometry_msgs/WrenchStamped": "std_msgs/Header header\nWrench wrench",
    "sensor_msgs/PointField": "uint8 INT32=5\nuint8 FLOAT32=7\nstring name\nuint32 offset\nuint8 datatype\nuint32 count",
    "sensor_msgs/PointCloud2": "std_msgs/Header header\nuint32 height\nuint32 width\nPointField[] fields\nbool is_bigendian\n"
    "uint32 point_step\nuint32 row_step\nuint8[] data\nbool is_dense",
}
OWN = {f"tactomo_msgs/{path.stem}": path.read_text() for path in sorted((HERE / "tactomo_msgs/msg").glob("*.msg"))}
PYTHON = {"bool": (bool, "boolean"), "string": (str, "string"), "float64": (float, "double")}


def is_in_range(value, kind):
    bits = int(re.sub(r"\D", "", kind))
    low = 0 if kind.startswith("u") else -(1 << (bits - 1))
    return type(value) is int and low <= value < low + (1 << bits)


def message_class(name, classes):
    package, _, short = name.partition("/")
    lines = [line.split("#")[0].strip() for line in {**STANDARD, **OWN}[name].splitlines()]
    constants = dict(re.fullmatch(r"\w+ (\w+)=(\d+)", line).groups() for line in lines if "=" in line)
    fields = {line.split()[1]: line.split()[0] for line in lines if line and "=" not in line}

    def made(kind):
        """A class by its name in a definition, which leaves out its own package."""
        return classes[kind if "/" in kind else f"{package}/{kind}"]

    def check(field, kind, value):
        if kind == "uint8[]":
            assert isinstance(value, (bytes, list)), field
        elif kind.endswith("[]"):
            assert isinstance(value, list), field
            for item in value:
                check(field, kind[:-2], item)
        elif kind in PYTHON:
            assert type(value) is PYTHON[kind][0], (field, value)
        elif re.fullmatch(r"u?int\d+", kind):
            assert is_in_range(value, kind), (field, value)
        else:
            assert type(value) is made(kind), (field, value)

    class Message:
        def __init__(self, **values):
            for field, kind in fields.items():
                default = [] if kind.endswith("[]") else PYTHON.get(kind, (int,))[0]() if kind[0].islower() and "/" not in kind else made(kind)()
                setattr(self, field, values.pop(field, default))
            assert not values, f"{name} has no {list(values)}"

        def __setattr__(self, field, value):
            check(field, fields[field], value)
            object.__setattr__(self, field, value)

        @classmethod
        def get_fields_and_field_types(cls):
            return {field: PYTHON.get(kind, (None, kind))[1] for field, kind in fields.items()}

    for constant, value in constants.items():
        setattr(Message, constant, int(value))
    Message.__name__ = short
    return Message


@pytest.fixture
def node(monkeypatch):
    """The node's module, and what it publishes by topic."""
    classes = {}
    for name in [*STANDARD, *OWN]:
        classes[name] = message_class(name, classes)
    published = {}

    class Node:
        def __init__(self, name):
            assert name == "tactomo"

        def declare_parameter(self, name, default):
            given = {"simulate": True, "readings": True, "solver": "contacts", "frame_id": "left"}
            return types.SimpleNamespace(value=given.get(name, default))

        def create_publisher(self, kind, topic, _quality):
            def publish(message):
                assert type(message) is kind
                published.setdefault(topic, []).append(message)

            return types.SimpleNamespace(publish=publish)

        def create_service(self, _kind, name, _answer):
            assert name == "tactomo/rezero"

    def module(name, **has):
        monkeypatch.setitem(sys.modules, name, types.ModuleType(name))
        vars(sys.modules[name]).update(has)

    module("rclpy", ok=lambda: len(published.get("tactomo/contacts", [])) < 400)
    module("rclpy.node", Node=Node)
    module("rclpy.qos", qos_profile_sensor_data=None)
    module("std_srvs.srv", Trigger=None)
    for package in ("std_msgs", "geometry_msgs", "sensor_msgs", "tactomo_msgs"):
        module(f"{package}.msg", **{name.partition("/")[2]: made for name, made in classes.items() if name.startswith(package)})
    spec = importlib.util.spec_from_file_location("tactomo_node", HERE / "tactomo_ros/tactomo_ros/node.py")
    loaded = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(loaded)
    return loaded, published


def test_the_node_publishes_each_answer_on_its_topics(node):
    module, published = node
    module.Touch().run()
    points, contacts, frames = (published[f"tactomo/{name}"] for name in ("points", "contacts", "frame"))
    assert len(points) == len(contacts) == len(frames) == 400 and "tactomo/wrench" not in published
    pressed = [index for index, message in enumerate(contacts) if message.contacts]
    assert pressed, "something wanders over the simulated detector"
    for index in pressed:
        cloud, message = points[index], contacts[index]
        assert message.header.frame_id == "left" and message.header.stamp.sec > 1_700_000_000
        assert [field.name for field in cloud.fields] == ["x", "y", "z", "force_n", "conductance_s", "radius_m", "id"]
        assert [field.offset for field in cloud.fields] == list(range(0, 28, 4))
        assert len(cloud.data) == cloud.row_step == 28 * len(message.contacts) and cloud.point_step == 28
        point = np.frombuffer(cloud.data, module.POINT)[0]
        first = message.contacts[0]
        assert (point["x"], point["id"]) == (np.float32(first.x_m), first.id) and math.isnan(point["force_n"])
        assert 0 < first.sigma_x_m < 0.1 and math.isnan(first.force_n) and first.state in (first.START, first.MOVE)
    frame = frames[-1]
    assert frame.electrodes == 16 and len(frame.touch_v) == len(frame.readings_v) == 256 and frame.averaged >= 1


def test_a_wrench_is_that_of_all_contacts(node):
    module, _ = node

    def event(*contacts, is_contacts=True):
        solution = types.SimpleNamespace(is_contacts=is_contacts)
        contacts = [types.SimpleNamespace(x_m=x_m, y_m=y_m, force_n=force_n) for x_m, y_m, force_n in contacts]
        return types.SimpleNamespace(solution=solution, contacts=contacts)

    flat = tactomo.Detector()
    wrench = module.wrench_message(event((0.01, -0.02, 2.0), (0.0, 0.01, 1.0)), flat).wrench
    assert (wrench.force.z, wrench.torque.x, wrench.torque.y) == pytest.approx((-3.0, 0.03, 0.02))
    assert wrench.force.x == wrench.force.y == wrench.torque.z == 0
    for unknown in (event((0.0, 0.0, None)), event((0.0, 0.0, 1.0), is_contacts=False), event()):
        assert module.wrench_message(unknown, flat) is None


def test_the_launch_file_has_the_nodes_parameters(node):
    module, _ = node
    text = (HERE / "tactomo_ros/launch/tactomo.launch.py").read_text()
    spoken = re.findall(r'^    "(\w+)": \("(.*)", (\w+)\),$', text, re.MULTILINE)
    of = {"str": str, "bool": lambda text: text == "true"}
    assert {name: of[kind](default) for name, default, kind in spoken} == module.PARAMETERS


def test_packages_name_the_messages_that_are_there():
    cmake = (HERE / "tactomo_msgs/CMakeLists.txt").read_text()
    assert re.findall(r'"msg/(\w+)\.msg"', cmake) == [name.partition("/")[2] for name in OWN]
