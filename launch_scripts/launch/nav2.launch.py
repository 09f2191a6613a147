"""The stack with Nav2 in place of its navigation: ``ros2 launch robot_stack nav2.launch.py profile:=sim``.

Nav2 serves /navigate_to_pose and publishes /plan, /local_costmap/costmap and /cmd_vel. The swerve controller and the
safety monitor keep their limits and stops.
"""

import os

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, IncludeLaunchDescription
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution, PythonExpression, ThisLaunchFileDir
from launch_ros.actions import Node
from launch_ros.substitutions import FindPackageShare

REPLACED = ("navigation_controller", "costmap_server")
# Package, executable and remappings. Controller and behaviours share the velocity smoother's input.
SERVERS = (
    ("nav2_controller", "controller_server", [("cmd_vel", "cmd_vel_nav")]),
    ("nav2_planner", "planner_server", []),
    ("nav2_behaviors", "behavior_server", [("cmd_vel", "cmd_vel_nav")]),
    ("nav2_bt_navigator", "bt_navigator", []),
    ("nav2_velocity_smoother", "velocity_smoother", [("cmd_vel", "cmd_vel_nav"), ("cmd_vel_smoothed", "cmd_vel")]),
)
# Fast DDS settings for clouds and images on this machine, as the stack's own processes have them.
PROFILE, RANGE = "FASTRTPS_DEFAULT_PROFILES_FILE", "ROS_AUTOMATIC_DISCOVERY_RANGE"


def nav2() -> list[Node]:
    time = {"use_sim_time": LaunchConfiguration("use_sim_time")}
    config = PathJoinSubstitution([FindPackageShare("robot_stack"), "config"])
    own_transport = PROFILE in os.environ or os.environ.get(RANGE, "LOCALHOST") != "LOCALHOST"
    transport = {PROFILE: PathJoinSubstitution([config, "fastdds.xml"]), RANGE: "SYSTEM_DEFAULT"}
    servers = [
        Node(
            package=package,
            executable=executable,
            output="screen",
            parameters=[LaunchConfiguration("params_file"), time],
            remappings=remappings,
            additional_env={} if own_transport else transport,
        )
        for package, executable, remappings in SERVERS
    ]
    manager = Node(
        package="nav2_lifecycle_manager",
        executable="lifecycle_manager",
        name="lifecycle_manager_navigation",
        output="screen",
        parameters=[time, {"autostart": True, "node_names": [executable for _, executable, _ in SERVERS]}],
        additional_env={} if own_transport else transport,
    )
    return [*servers, manager]


def generate_launch_description() -> LaunchDescription:
    share = FindPackageShare("robot_stack")
    stack = PathJoinSubstitution([ThisLaunchFileDir(), "stack.launch.py"])
    options = [LaunchConfiguration("options"), *(f" --without {process}" for process in REPLACED)]
    return LaunchDescription(
        [
            DeclareLaunchArgument("profile", default_value="sim", description="Profile of config/profiles, or a file"),
            DeclareLaunchArgument("options", default_value="", description="Further options of `robot-stack up`"),
            DeclareLaunchArgument("rviz", default_value="false", description="Start RViz too"),
            DeclareLaunchArgument(
                "use_sim_time",
                default_value=PythonExpression(["'", LaunchConfiguration("profile"), "' == 'sim'"]),
                description="For Nav2 and RViz: time from /clock",
            ),
            DeclareLaunchArgument(
                "params_file",
                default_value=PathJoinSubstitution([share, "config", "nav2", "nav2_params.yaml"]),
                description="Parameters of Nav2",
            ),
            IncludeLaunchDescription(
                PythonLaunchDescriptionSource(stack),
                launch_arguments={
                    "profile": LaunchConfiguration("profile"),
                    "options": options,
                    "rviz": LaunchConfiguration("rviz"),
                    "use_sim_time": LaunchConfiguration("use_sim_time"),
                }.items(),
            ),
            *nav2(),
        ]
    )
