"""The process table: every operating-system process of the stack, one row each.

A profile (``config/profiles/``) says which of them run together. ``module`` is None where a process is specified but
not built; tools then name it as missing instead of leaving it out.
"""

from robot_stack.contract.model import Criticality, Process, System

# Of a node's record in shared memory (``robot_stack.core.node_record``): its heartbeat rate, and the silence after
# which it counts as dead. Receivers on other machines use the topic /system/heartbeat.
HEARTBEAT_HZ = 5.0
HEARTBEAT_STALE_S = 1.0

_CRITICAL, _LIMITING, _OPTIONAL = Criticality.CRITICAL, Criticality.LIMITING, Criticality.OPTIONAL


def _process(
    name: str,
    module: str | None,
    criticality: Criticality,
    note: str,
    *,
    also: tuple[str, ...] = (),
    system: System = System.ROBOT,
) -> Process:
    return Process(name, module, criticality, note, (name, *also), system)


PROCESSES: tuple[Process, ...] = (
    _process(
        "sim_world",
        "sim.node",
        _CRITICAL,
        "physics, simulated motion engine in lockstep with it, and the drivers of the simulated sensors",
        also=("imu_driver", "battery_driver"),
        system=System.SIMULATION,
    ),
    _process(
        "swerve_hardware_interface",
        "robot_stack.drive.nodes.swerve_hardware_interface",
        _CRITICAL,
        "wheel commands to the motion engine and encoders back",
    ),
    _process(
        "swerve_controller",
        "robot_stack.drive.nodes.swerve_controller",
        _CRITICAL,
        "arbitration, limits, kinematics, odometry",
    ),
    _process(
        "emergency_stop_button", "robot_stack.safety.nodes.emergency_stop_button", _CRITICAL, "the physical button"
    ),
    _process(
        "safety_monitor",
        "robot_stack.safety.nodes.safety_monitor",
        _CRITICAL,
        "faults, speed limits, release from an emergency stop",
    ),
    _process("ndt_localization", "robot_stack.localization.nodes.ndt_localization", _CRITICAL, "pose in map"),
    _process(
        "navigation_controller", "robot_stack.navigation.nodes.navigation_controller", _LIMITING, "drives to goal poses"
    ),
    _process("mission_manager", "robot_stack.mission.nodes.mission_manager", _LIMITING, "missions from UI commands"),
    _process("recorder", "robot_stack.recording.nodes.recorder", _OPTIONAL, "every contract topic into MCAP"),
    _process(
        "black_box",
        "robot_stack.recording.nodes.black_box",
        _OPTIONAL,
        "the last minute of every contract topic on the disk, and events that are kept",
    ),
    _process(
        "lidar_driver",
        "sim.nodes.lidar_driver",
        _CRITICAL,
        "simulated LiDAR; a real driver publishes the same topics",
        system=System.SIMULATION,
    ),
    _process(
        "overhead_lidar_driver",
        "sim.nodes.overhead_lidar_driver",
        _CRITICAL,
        "simulated overhead LiDAR; a real driver publishes the same topic",
        system=System.SIMULATION,
    ),
    _process(
        "point_cloud_adapter",
        "robot_stack.drivers.nodes.point_cloud_adapter",
        _CRITICAL,
        "main LiDAR by its vendor's own ROS driver",
    ),
    _process(
        "joystick_driver",
        "robot_stack.drivers.nodes.joystick_driver",
        _OPTIONAL,
        "driving by hand with a joystick while its dead-man button is held",
    ),
    _process(
        "velodyne_driver",
        "robot_stack.drivers.nodes.velodyne_driver",
        _CRITICAL,
        "main LiDAR, a Velodyne VLP-16, by its packets",
    ),
    _process(
        "ouster_driver",
        "robot_stack.drivers.nodes.ouster_driver",
        _CRITICAL,
        "main LiDAR, an Ouster OS sensor, by its packets",
    ),
    _process(
        "overhead_lidar_adapter",
        "robot_stack.drivers.nodes.overhead_lidar_adapter",
        _CRITICAL,
        "overhead LiDAR by its vendor's own ROS driver",
    ),
    _process(
        "camera_driver",
        "sim.nodes.camera_driver",
        _LIMITING,
        "simulated front and rear cameras; a real driver publishes the same topics",
        system=System.SIMULATION,
    ),
    _process(
        "v4l2_camera_driver",
        "robot_stack.drivers.nodes.v4l2_camera_driver",
        _LIMITING,
        "front and rear camera by Video4Linux",
    ),
    _process(
        "xsens_driver", "robot_stack.drivers.nodes.xsens_driver", _CRITICAL, "Xsens inertial unit on a serial line"
    ),
    _process(
        "pylontech_driver",
        "robot_stack.drivers.nodes.pylontech_driver",
        _LIMITING,
        "battery on a CAN bus, Pylontech's protocol",
    ),
    _process(
        "modbus_battery_driver",
        "robot_stack.drivers.nodes.modbus_battery_driver",
        _LIMITING,
        "battery with a monitor that is read over Modbus",
    ),
    _process(
        "camera_adapter",
        "robot_stack.drivers.nodes.camera_adapter",
        _LIMITING,
        "front and rear camera by their vendors' own ROS drivers",
    ),
    _process(
        "imu_adapter",
        "robot_stack.drivers.nodes.imu_adapter",
        _CRITICAL,
        "inertial unit by its vendor's own ROS driver",
    ),
    _process(
        "battery_adapter",
        "robot_stack.drivers.nodes.battery_adapter",
        _LIMITING,
        "battery by its vendor's own ROS driver",
    ),
    _process("perception_pipeline", "robot_stack.perception.nodes.perception_pipeline", _CRITICAL, "obstacle points"),
    _process("costmap_server", "robot_stack.costmap.nodes.costmap_server", _LIMITING, "local costmap"),
    _process("aruco_detector", "robot_stack.docking.nodes.aruco_detector", _LIMITING, "markers in the camera images"),
    _process(
        "docking_controller",
        "robot_stack.docking.nodes.docking_controller",
        _LIMITING,
        "docking and undocking, and the latch",
    ),
    _process("ehmi_bridge", "robot_stack.ehmi.nodes.ehmi_bridge", _OPTIONAL, "external display over a serial line"),
    _process(
        "ehmi_display",
        "sim.nodes.ehmi_display",
        _OPTIONAL,
        "simulated external display on a pseudo terminal; on a robot the firmware of the real one",
        system=System.SIMULATION,
    ),
    _process(
        "remote_view",
        "robot_stack.view.nodes.remote_view",
        _OPTIONAL,
        "thinned clouds and compressed images for viewers behind a slow link",
    ),
    _process("touch_ui", "robot_stack.ui.nodes.touch_ui", _OPTIONAL, "touch screen"),
    _process(
        "fleet_agent",
        "robot_stack.fleet.nodes.fleet_agent",
        _OPTIONAL,
        "orders of a fleet's master control by VDA 5050 over MQTT",
    ),
    _process(
        "system_monitor",
        "robot_stack.system_monitor.nodes.system_monitor",
        _OPTIONAL,
        "robot status, computer health, diagnostics as a tree",
    ),
    _process(
        "sim_computer",
        "sim.nodes.sim_computer",
        _OPTIONAL,
        "simulated kernel figures of the robot's computer, and the browser on its screen",
        system=System.SIMULATION,
    ),
    _process(
        "wmx_engine",
        "sim.nodes.wmx_engine",
        _CRITICAL,
        "simulated motion engine on virtual drives; on a real machine the engine is the vendor's",
        system=System.SIMULATION,
    ),
    _process(
        "sim_manipulator",
        "sim.nodes.sim_manipulator",
        _CRITICAL,
        "six-axis arm with a gripper in a physics simulation, and the simulated motion engine in lockstep with it",
        system=System.SIMULATION,
    ),
    _process(
        "manipulator_state",
        "robot_stack.wmx.nodes.manipulator_state",
        _CRITICAL,
        "joint states of the manipulator",
        system=System.WMX,
    ),
    _process(
        "follow_joint_trajectory_server",
        "robot_stack.wmx.nodes.follow_joint_trajectory_server",
        _CRITICAL,
        "trajectories of the manipulator",
        system=System.WMX,
    ),
    _process(
        "wmx_ros2_general_node",
        "robot_stack.wmx.nodes.wmx_ros2_general_node",
        _LIMITING,
        "axis services and topics of the motion engine",
        system=System.WMX,
    ),
    _process(
        "diff_drive_controller",
        "robot_stack.wmx.nodes.diff_drive_controller",
        _CRITICAL,
        "differential base on the motion engine",
        system=System.WMX,
    ),
)

BY_NAME: dict[str, Process] = {process.name: process for process in PROCESSES}


def available() -> tuple[Process, ...]:
    """The processes that are built."""
    return tuple(process for process in PROCESSES if process.available)
