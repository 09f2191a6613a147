"""One process of the stack: ``ros2 launch robot_stack node.launch.py node:=swerve_controller``."""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, Shutdown
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node


def generate_launch_description() -> LaunchDescription:
    return LaunchDescription(
        [
            DeclareLaunchArgument("node", description="Name of the process, as in docs/interfaces.md"),
            DeclareLaunchArgument(
                "use_sim_time", default_value="false", description="true beside a simulated world: time from /clock"
            ),
            Node(
                package="robot_stack",
                executable=LaunchConfiguration("node"),
                output="screen",
                parameters=[{"use_sim_time": LaunchConfiguration("use_sim_time")}],
                on_exit=Shutdown(),
            ),
        ]
    )
