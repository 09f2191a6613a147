"""The contract's rows against the interface documents, transcribed by hand, one line per documented interface."""

from __future__ import annotations

import importlib
import re
from collections import Counter
from dataclasses import dataclass

import pytest

from robot_stack.contract import actions, faults, frames, processes, services, topics
from robot_stack.contract.model import (
    ContractViolation,
    Criticality,
    Durability,
    Reliability,
    SafetyAction,
    SafetyState,
    System,
)

R, B = Reliability.RELIABLE, Reliability.BEST_EFFORT
VOLATILE, LATCHED = Durability.VOLATILE, Durability.TRANSIENT_LOCAL
EVERY = topics.EVERY_NODE


@dataclass(frozen=True)
class Documented:
    """One documented topic. ``publishers`` and ``subscribers`` must be among the row's; the row may name more."""

    name: str
    type: str
    reliability: Reliability
    durability: Durability
    depth: int
    rate_hz: float | None
    publishers: tuple[str, ...] = ()
    subscribers: tuple[str, ...] = ()


# Robot interface document, sections 2-9.
ROBOT = (
    Documented("/emergency_stop", "std_msgs/msg/Bool", R, LATCHED, 1, None, ("touch_ui", "emergency_stop_button"),
        (EVERY,)),
    Documented("/robot_status", "custom_msgs/msg/RobotStatus", B, VOLATILE, 1, 10.0, ("system_monitor",),
        ("touch_ui", "mission_manager")),
    Documented("/passenger_attached", "std_msgs/msg/Bool", R, LATCHED, 1, None, ("docking_controller",),
        ("swerve_controller", "safety_monitor", "ehmi_bridge")),
    Documented("/swerve/wheel_commands", "custom_msgs/msg/SwerveModuleCommandArray", R, VOLATILE, 1, 20.0,
        ("swerve_controller",), ("swerve_hardware_interface",)),
    Documented("/joint_states", "sensor_msgs/msg/JointState", B, VOLATILE, 1, 50.0, ("swerve_hardware_interface",),
        ("swerve_controller",)),
    Documented("/odom", "nav_msgs/msg/Odometry", B, VOLATILE, 1, 50.0, ("swerve_controller",),
        ("navigation_controller", "ndt_localization")),
    Documented("/cmd_vel", "geometry_msgs/msg/Twist", R, VOLATILE, 1, 20.0, ("navigation_controller",),
        ("swerve_controller", "safety_monitor")),
    Documented("/current_pose", "geometry_msgs/msg/PoseStamped", B, VOLATILE, 1, 10.0, ("ndt_localization",),
        ("navigation_controller", "mission_manager", "touch_ui")),
    Documented("/goal_pose", "geometry_msgs/msg/PoseStamped", R, VOLATILE, 1, None, ("mission_manager", "touch_ui"),
        ("navigation_controller",)),
    Documented("/sensors/lidar/points", "sensor_msgs/msg/PointCloud2", B, VOLATILE, 1, 10.0, ("lidar_driver",),
        ("perception_pipeline", "ndt_localization")),
    Documented("/perception/obstacles", "sensor_msgs/msg/PointCloud2", B, VOLATILE, 1, 20.0,
        ("perception_pipeline",), ("costmap_server", "safety_monitor")),
    Documented("/local_costmap/costmap", "nav_msgs/msg/OccupancyGrid", B, VOLATILE, 1, 5.0, ("costmap_server",),
        ("navigation_controller", "touch_ui")),
    Documented("/docking/aruco_detections", "custom_msgs/msg/ArucoDetectionArray", B, VOLATILE, 1, 10.0,
        ("aruco_detector",), ("docking_controller", "touch_ui")),
    Documented("/docking/status", "custom_msgs/msg/DockingStatus", B, VOLATILE, 1, 10.0, ("docking_controller",),
        ("mission_manager", "touch_ui", "ehmi_bridge")),
    Documented("/safety/status", "custom_msgs/msg/SafetyStatus", B, VOLATILE, 1, 10.0, ("safety_monitor",),
        (EVERY,)),
    # Its rate is not documented: see the decision about its timeout.
    Documented("/safety/velocity_limit", "custom_msgs/msg/VelocityLimit", R, LATCHED, 1, 20.0, ("safety_monitor",),
        ("swerve_controller",)),
    # rosidl refuses the documented type name eHMIState.
    Documented("/ehmi/state_command", "custom_msgs/msg/EHMIState", R, VOLATILE, 1, None, ("mission_manager",
        "docking_controller"), ("ehmi_bridge",)),
    Documented("/ui/command", "custom_msgs/msg/UICommand", R, VOLATILE, 10, None, ("touch_ui",),
        ("mission_manager",)),
    Documented("/sensors/imu", "sensor_msgs/msg/Imu", B, VOLATILE, 1, 100.0, ("imu_driver",),
        ("perception_pipeline", "ndt_localization")),
    Documented("/sensors/camera/front/image_raw", "sensor_msgs/msg/Image", B, VOLATILE, 1, 10.0, ("camera_driver",),
        ("aruco_detector",)),
    Documented("/sensors/camera/rear/image_raw", "sensor_msgs/msg/Image", B, VOLATILE, 1, 10.0, ("camera_driver",),
        ("aruco_detector",)),
)  # fmt: skip

# Interfaces that the robot needs beyond the documented ones.
ADDITIONS = (
    Documented("/tf", "tf2_msgs/msg/TFMessage", R, VOLATILE, 100, None, ("ndt_localization", "swerve_controller")),
    Documented("/robot_description", "std_msgs/msg/String", R, LATCHED, 1, None, ("swerve_controller",), ("rviz",)),
    Documented("/ui/language", "std_msgs/msg/String", R, LATCHED, 1, None, ("touch_ui",), ("mission_manager",)),
    Documented("/map", "nav_msgs/msg/OccupancyGrid", R, LATCHED, 1, None, ("ndt_localization",), ("rviz",)),
    Documented("/map_cloud", "sensor_msgs/msg/PointCloud2", R, LATCHED, 1, None, ("ndt_localization",), ("rviz",)),
    Documented("/tf_static", "tf2_msgs/msg/TFMessage", R, LATCHED, 1, None, ("imu_driver",)),
    Documented("/docking/latch", "custom_msgs/msg/LatchStatus", B, VOLATILE, 1, 10.0, ("docking_controller",),
        ("safety_monitor", "swerve_controller", "perception_pipeline")),
    Documented("/docking/cmd_vel", "geometry_msgs/msg/TwistStamped", R, VOLATILE, 1, 20.0, ("docking_controller",),
        ("swerve_controller",)),
    Documented("/teleop/cmd_vel", "geometry_msgs/msg/TwistStamped", R, VOLATILE, 1, 20.0, ("touch_ui",),
        ("swerve_controller",)),
    Documented("/swerve/cmd_vel_limited", "geometry_msgs/msg/TwistStamped", B, VOLATILE, 1, 20.0,
        ("swerve_controller",)),
    Documented("/localization/quality", "std_msgs/msg/Float32", B, VOLATILE, 1, 10.0, ("ndt_localization",),
        ("safety_monitor",)),
    Documented("/localization/pose", "geometry_msgs/msg/PoseWithCovarianceStamped", B, VOLATILE, 1, 10.0,
        ("ndt_localization",)),
    Documented("/initialpose", "geometry_msgs/msg/PoseWithCovarianceStamped", R, VOLATILE, 1, None, ("touch_ui",
        "rviz"), ("ndt_localization",)),
    Documented("/battery_state", "sensor_msgs/msg/BatteryState", B, VOLATILE, 1, 1.0, ("battery_driver",)),
    Documented("/diagnostics", "diagnostic_msgs/msg/DiagnosticArray", R, VOLATILE, 10, 1.0, (EVERY,)),
    Documented("/diagnostics_agg", "diagnostic_msgs/msg/DiagnosticArray", R, VOLATILE, 1, 1.0, ("system_monitor",)),
    Documented("/system/temperature", "sensor_msgs/msg/Temperature", B, VOLATILE, 1, 5.0, ("system_monitor",),
        ("safety_monitor",)),
    Documented("/ui/heartbeat", "std_msgs/msg/Header", R, VOLATILE, 1, 1.0, ("touch_ui",), ("safety_monitor",)),
    Documented("/ehmi/status", "custom_msgs/msg/EHMIStatus", B, VOLATILE, 1, 1.0, ("ehmi_bridge",)),
    Documented("/mission/status", "custom_msgs/msg/MissionStatus", R, LATCHED, 1, None, ("mission_manager",)),
    Documented("/plan", "nav_msgs/msg/Path", R, LATCHED, 1, None, ("navigation_controller",)),
    Documented("/sensors/camera/front/camera_info", "sensor_msgs/msg/CameraInfo", B, VOLATILE, 1, 10.0,
        ("camera_driver",)),
    Documented("/sensors/camera/rear/camera_info", "sensor_msgs/msg/CameraInfo", B, VOLATILE, 1, 10.0,
        ("camera_driver",)),
)  # fmt: skip

# WMX topic document. Its nodes create every endpoint with depth 1: KeepLast(1), reliable, volatile.
WMX = (
    Documented("/joint_states", "sensor_msgs/msg/JointState", R, VOLATILE, 1, 500.0, ("manipulator_state",)),
    Documented("/isaacsim/joint_command", "sensor_msgs/msg/JointState", R, VOLATILE, 1, 500.0,
        ("manipulator_state",)),
    Documented("/gazebo_position_controller/commands", "std_msgs/msg/Float64MultiArray", R, VOLATILE, 1, 500.0,
        ("manipulator_state",)),
    Documented("/wmx/axis/state", "wmx_ros2_message/msg/AxisState", R, VOLATILE, 1, 100.0,
        ("wmx_ros2_general_node",)),
    Documented("/wmx/axis/velocity", "wmx_ros2_message/msg/AxisVelocity", R, VOLATILE, 1, None, (),
        ("wmx_ros2_general_node",)),
    Documented("/wmx/axis/position", "wmx_ros2_message/msg/AxisPose", R, VOLATILE, 1, None, (),
        ("wmx_ros2_general_node",)),
    Documented("/wmx/axis/position/relative", "wmx_ros2_message/msg/AxisPose", R, VOLATILE, 1, None, (),
        ("wmx_ros2_general_node",)),
    Documented("/cmd_vel", "geometry_msgs/msg/Twist", R, VOLATILE, 1, None, (), ("diff_drive_controller",)),
    Documented("/cmd_vel_check", "geometry_msgs/msg/Twist", R, VOLATILE, 1, None, ("diff_drive_controller",)),
    Documented("/velocity_controller/commands", "std_msgs/msg/Float64MultiArray", R, VOLATILE, 1, 100.0,
        ("diff_drive_controller",)),
    Documented("/odom_enc", "nav_msgs/msg/Odometry", R, VOLATILE, 1, 100.0, ("diff_drive_controller",)),
)  # fmt: skip

# name -> (type, server)
SERVICES = {
    "/wmx/engine/set_device": ("wmx_ros2_message/srv/SetEngine", "wmx_ros2_general_node"),
    "/wmx/engine/set_comm": ("std_srvs/srv/SetBool", "wmx_ros2_general_node"),
    "/wmx/engine/get_status": ("std_srvs/srv/Trigger", "wmx_ros2_general_node"),
    "/wmx/axis/set_on": ("wmx_ros2_message/srv/SetAxis", "wmx_ros2_general_node"),
    "/wmx/axis/clear_alarm": ("wmx_ros2_message/srv/SetAxis", "wmx_ros2_general_node"),
    "/wmx/axis/set_mode": ("wmx_ros2_message/srv/SetAxis", "wmx_ros2_general_node"),
    "/wmx/axis/set_polarity": ("wmx_ros2_message/srv/SetAxis", "wmx_ros2_general_node"),
    "/wmx/axis/set_gear_ratio": ("wmx_ros2_message/srv/SetAxisGearRatio", "wmx_ros2_general_node"),
    "/wmx/axis/homing": ("wmx_ros2_message/srv/SetAxis", "wmx_ros2_general_node"),
    "/wmx/axis/stop": ("wmx_ros2_message/srv/SetAxis", "wmx_ros2_general_node"),
    "/wmx/engine/estop": ("std_srvs/srv/SetBool", "wmx_ros2_general_node"),
    "/wmx/set_gripper": ("std_srvs/srv/SetBool", "follow_joint_trajectory_server"),
    "/safety/reset": ("std_srvs/srv/Trigger", "safety_monitor"),
    "/swerve/reset_odometry": ("std_srvs/srv/Trigger", "swerve_controller"),
}  # fmt: skip
ACTIONS = {
    "/navigate_to_pose": ("nav2_msgs/action/NavigateToPose", "navigation_controller"),
    "/movensys_manipulator_arm_controller/follow_joint_trajectory": (
        "control_msgs/action/FollowJointTrajectory",
        "follow_joint_trajectory_server",
    ),
    "/docking/dock": ("custom_msgs/action/Dock", "docking_controller"),
    "/docking/undock": ("custom_msgs/action/Undock", "docking_controller"),
}  # fmt: skip

# code -> (most severe action, state, latched until a reset, seconds it must be absent)
FAULTS = {
    "ESTOP_PRESSED": (SafetyAction.EMERGENCY_STOP, SafetyState.EMERGENCY_STOP, True, 0.0),
    "CONTACT": (SafetyAction.EMERGENCY_STOP, SafetyState.EMERGENCY_STOP, True, 0.0),
    "CHAIR_LOOSE": (SafetyAction.EMERGENCY_STOP, SafetyState.EMERGENCY_STOP, True, 0.0),
    "DRIVE_FAULT": (SafetyAction.EMERGENCY_STOP, SafetyState.EMERGENCY_STOP, True, 0.0),
    "STEERING_FAULT": (SafetyAction.EMERGENCY_STOP, SafetyState.EMERGENCY_STOP, True, 0.0),
    "JOINT_STATES_TIMEOUT": (SafetyAction.EMERGENCY_STOP, SafetyState.EMERGENCY_STOP, True, 0.0),
    "OVERSPEED": (SafetyAction.EMERGENCY_STOP, SafetyState.EMERGENCY_STOP, True, 0.0),
    "TILT": (SafetyAction.EMERGENCY_STOP, SafetyState.EMERGENCY_STOP, True, 0.0),
    "LATCH_NOT_CLOSED": (SafetyAction.STOP, SafetyState.DEGRADED, False, 0.0),
    "COLLISION_IMMINENT": (SafetyAction.STOP, SafetyState.COLLISION_AVOIDANCE, False, 0.5),
    "OBSTACLE_NEAR": (SafetyAction.LIMIT, SafetyState.COLLISION_AVOIDANCE, False, 0.0),
    "LIDAR_TIMEOUT": (SafetyAction.STOP, SafetyState.DEGRADED, False, 1.0),
    "OBSTACLES_TIMEOUT": (SafetyAction.STOP, SafetyState.DEGRADED, False, 1.0),
    "LOCALIZATION_LOST": (SafetyAction.STOP, SafetyState.DEGRADED, False, 2.0),
    "IMU_TIMEOUT": (SafetyAction.LIMIT, SafetyState.DEGRADED, False, 1.0),
    "CAMERA_TIMEOUT": (SafetyAction.WARN, SafetyState.DEGRADED, False, 0.0),
    "NODE_DEAD": (SafetyAction.STOP, SafetyState.DEGRADED, False, 0.0),
    "SLOPE": (SafetyAction.STOP, SafetyState.DEGRADED, False, 0.0),
    "LATCH_NOT_STORED": (SafetyAction.LIMIT, SafetyState.DEGRADED, False, 0.0),
    "BATTERY_LOW": (SafetyAction.WARN, SafetyState.DEGRADED, False, 0.0),
    "BATTERY_CRITICAL": (SafetyAction.LIMIT, SafetyState.DEGRADED, False, 0.0),
    "OVERHEAT": (SafetyAction.WARN, SafetyState.DEGRADED, False, 0.0),
    "CPU_HIGH": (SafetyAction.WARN, SafetyState.DEGRADED, False, 0.0),
    "MEMORY_HIGH": (SafetyAction.WARN, SafetyState.DEGRADED, False, 0.0),
    "DISK_FULL": (SafetyAction.WARN, SafetyState.DEGRADED, False, 0.0),
    "EHMI_LINK_LOST": (SafetyAction.WARN, SafetyState.DEGRADED, False, 0.0),
    "UI_LINK_LOST": (SafetyAction.WARN, SafetyState.DEGRADED, False, 0.0),
}  # fmt: skip

DOCUMENTED = [
    *(pytest.param(System.ROBOT, item, id=f"robot{item.name}") for item in (*ROBOT, *ADDITIONS)),
    *(pytest.param(System.WMX, item, id=f"wmx{item.name}") for item in WMX),
]
TYPES = sorted(
    {row.type for row in (*topics.TOPICS, *services.SERVICES, *actions.ACTIONS)},
)
NODES = {node for process in processes.PROCESSES for node in process.nodes}


@pytest.mark.parametrize(("system", "documented"), DOCUMENTED)
def test_documented_topic_has_its_row(system: System, documented: Documented) -> None:
    rows = [row for row in topics.of_system(system) if row.name == documented.name]
    assert len(rows) == 1, f"{documented.name} has {len(rows)} rows in {system.value}"
    (row,) = rows
    assert row.type == documented.type
    assert (row.qos.reliability, row.qos.durability, row.qos.depth) == (
        documented.reliability,
        documented.durability,
        documented.depth,
    )
    assert row.rate_hz == documented.rate_hz
    assert set(documented.publishers) <= set(row.publishers)
    assert set(documented.subscribers) <= set(row.subscribers)


@pytest.mark.parametrize("name", sorted(SERVICES))
def test_documented_service_has_its_row(name: str) -> None:
    assert [(row.type, row.server) for row in services.SERVICES if row.name == name] == [SERVICES[name]]


@pytest.mark.parametrize("name", sorted(ACTIONS))
def test_documented_action_has_its_row(name: str) -> None:
    assert [(row.type, row.server) for row in actions.ACTIONS if row.name == name] == [ACTIONS[name]]


@pytest.mark.parametrize("row", actions.ACTIONS, ids=lambda row: row.name)
def test_action_has_a_known_server_and_known_clients(row: actions.Action) -> None:
    assert row.server in NODES
    assert set(row.clients) <= NODES | set(topics.OUTSIDE)
    assert row.note


def test_missions_screens_and_operators_may_dock() -> None:
    for row in (actions.DOCK, actions.UNDOCK):
        assert row.clients == ("mission_manager", "touch_ui", topics.OPERATOR_TOOL)


def test_fault_list_is_closed_and_complete() -> None:
    rows = {
        row.code: (row.action, row.state, row.clears.name == "ON_RESET", row.clear_after_s) for row in faults.FAULTS
    }
    assert rows == FAULTS
    assert len(faults.FAULTS) == len(faults.BY_CODE)


@pytest.mark.parametrize("type_name", TYPES)
def test_type_can_be_imported(type_name: str) -> None:
    package, kind, name = type_name.split("/")
    assert hasattr(importlib.import_module(f"{package}.{kind}"), name)


def test_a_name_has_one_row_in_its_system() -> None:
    counts = Counter((row.system, row.name) for row in topics.TOPICS)
    assert [key for key, count in counts.items() if count > 1] == []


def test_only_a_periodic_topic_has_a_nominal_rate_and_a_staleness_limit() -> None:
    assert topics.IMU.nominal_rate_hz == topics.IMU.rate_hz
    assert topics.IMU.stale_limit_s == topics.IMU.stale_s
    with pytest.raises(ContractViolation, match="/plan has no rate"):
        _ = topics.PLAN.nominal_rate_hz
    with pytest.raises(ContractViolation, match="/plan has no staleness limit"):
        _ = topics.PLAN.stale_limit_s


@pytest.mark.parametrize("row", topics.TOPICS, ids=lambda row: f"{row.system.value}{row.name}")
def test_row_is_sound(row: topics.Topic) -> None:
    assert re.fullmatch(r"(/[a-z][a-z0-9_]*)+", row.name)
    known = NODES | {EVERY, *topics.OUTSIDE, "supervisor"}
    assert set(row.publishers) <= known, "unknown publisher"
    assert set(row.subscribers) <= known, "unknown subscriber"
    assert row.publishers, "a topic nobody publishes"
    assert row.note
    assert (row.rate_hz is None) == (row.stale_s is None), "a rate and a staleness limit belong together"
    if row.rate_hz is not None and row.stale_s is not None:
        # One lost message of a periodic topic must not raise a fault.
        assert row.stale_s >= 2.0 / row.rate_hz
    if row.qos.durability is LATCHED:
        assert row.qos.reliability is R, "best effort makes a latched message worthless"


def test_servers_are_known_nodes() -> None:
    assert {row.server for row in (*services.SERVICES, *actions.ACTIONS)} <= NODES


def test_ground_truth_is_for_tests_operators_and_simulated_drivers_only() -> None:
    drivers = {node for process in processes.PROCESSES if process.system is System.SIMULATION for node in process.nodes}
    for row in topics.TOPICS:
        if row.name.startswith("/sim/"):
            assert set(row.subscribers) <= {*topics.OUTSIDE, *drivers}, f"{row.name} must not reach the stack"


def test_only_these_nodes_may_move_the_wheels() -> None:
    assert topics.WHEEL_COMMANDS.publishers == ("swerve_controller",)
    assert topics.WHEEL_COMMANDS.subscribers == ("swerve_hardware_interface", "safety_monitor")  # for comparison only


def test_process_names_are_unique_and_lead_their_nodes() -> None:
    counts = Counter(process.name for process in processes.PROCESSES)
    assert max(counts.values()) == 1
    assert all(process.nodes[0] == process.name for process in processes.PROCESSES)
    assert all(process.max_restarts > 0 for process in processes.PROCESSES)


def test_the_chain_that_moves_the_robot_is_critical() -> None:
    for name in ("swerve_hardware_interface", "swerve_controller", "safety_monitor", "ndt_localization"):
        assert processes.BY_NAME[name].criticality is Criticality.CRITICAL


def test_joints_follow_the_engine_axes() -> None:
    assert frames.JOINTS == (
        "fl_drive",
        "fl_steer",
        "fr_drive",
        "fr_steer",
        "rl_drive",
        "rl_steer",
        "rr_drive",
        "rr_steer",
    )
    assert [frames.JOINTS[axis] for axis in frames.DRIVE_AXES] == ["fl_drive", "fr_drive", "rl_drive", "rr_drive"]
    assert [frames.JOINTS[axis] for axis in frames.STEER_AXES] == ["fl_steer", "fr_steer", "rl_steer", "rr_steer"]
