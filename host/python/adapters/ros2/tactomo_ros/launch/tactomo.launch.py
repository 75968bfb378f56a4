"""The node of one detector: ros2 launch tactomo_ros tactomo.launch.py port:=/dev/ttyUSB0 detector:=my-cal.toml namespace:=left"""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue

# Parameters of the node, with their defaults and types.
PARAMETERS = {
    "port": ("", str),
    "simulate": ("false", bool),
    "detector": ("square-60", str),
    "solver": ("auto", str),
    "scan": ("whole", str),
    "frame_id": ("tactomo", str),
    "readings": ("false", bool),
}


def generate_launch_description():
    arguments = [DeclareLaunchArgument(name, default_value=default) for name, (default, _) in PARAMETERS.items()]
    parameters = {name: ParameterValue(LaunchConfiguration(name), value_type=kind) for name, (_, kind) in PARAMETERS.items()}
    node = Node(
        package="tactomo_ros",
        executable="touch",
        namespace=LaunchConfiguration("namespace"),
        parameters=[parameters],
        output="screen",
    )
    return LaunchDescription([DeclareLaunchArgument("namespace", default_value=""), *arguments, node])
