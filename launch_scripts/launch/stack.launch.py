"""The stack of a profile under its supervisor: ``ros2 launch robot_stack stack.launch.py profile:=sim rviz:=true``.

The supervisor starts, watches and restarts the processes, so the launch file starts the supervisor alone.
"""

import os
import shlex

from launch import LaunchContext, LaunchDescription
from launch.actions import DeclareLaunchArgument, ExecuteProcess, OpaqueFunction, Shutdown
from launch.conditions import IfCondition
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution, PythonExpression
from launch_ros.actions import Node
from launch_ros.substitutions import FindPackageShare

# Time for the robot to brake and for every process to end, before the supervisor is killed.
STOP_S = "30"
# Fast DDS settings for clouds and images on this machine, as the stack's own processes have them.
PROFILE, RANGE = "FASTRTPS_DEFAULT_PROFILES_FILE", "ROS_AUTOMATIC_DISCOVERY_RANGE"


def supervisor(context: LaunchContext) -> list[ExecuteProcess]:
    profile = LaunchConfiguration("profile").perform(context)
    options = shlex.split(LaunchConfiguration("options").perform(context))
    command = ["robot-stack", "up", "--foreground", "--profile", profile, *options]
    return [ExecuteProcess(cmd=command, output="screen", sigterm_timeout=STOP_S, on_exit=Shutdown())]


def rviz() -> Node:
    config = PathJoinSubstitution([FindPackageShare("robot_stack"), "config"])
    own_transport = PROFILE in os.environ or os.environ.get(RANGE, "LOCALHOST") != "LOCALHOST"
    transport = {PROFILE: PathJoinSubstitution([config, "fastdds.xml"]), RANGE: "SYSTEM_DEFAULT"}
    return Node(
        package="rviz2",
        executable="rviz2",
        name="rviz",
        arguments=["-d", PathJoinSubstitution([config, "rviz", "robot.rviz"])],
        parameters=[{"use_sim_time": LaunchConfiguration("use_sim_time")}],
        additional_env={} if own_transport else transport,
        condition=IfCondition(LaunchConfiguration("rviz")),
    )


def generate_launch_description() -> LaunchDescription:
    return LaunchDescription(
        [
            DeclareLaunchArgument("profile", default_value="sim", description="Profile of config/profiles, or a file"),
            DeclareLaunchArgument("options", default_value="", description="Further options of `robot-stack up`"),
            DeclareLaunchArgument("rviz", default_value="false", description="Start RViz too"),
            DeclareLaunchArgument(
                "use_sim_time",
                default_value=PythonExpression(["'", LaunchConfiguration("profile"), "' == 'sim'"]),
                description="For RViz: time from /clock",
            ),
            OpaqueFunction(function=supervisor),
            rviz(),
        ]
    )
