"""The process table: every operating-system process of the stack, one row each.

A profile (``config/profiles/``) says which of them run together. ``module`` is None where a process is specified but
not built; tools then name it as missing instead of leaving it out.
"""

from robot_stack.contract.model import Criticality, Process, System

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
    _process("ndt_localization", "robot_stack.localization.node", _CRITICAL, "pose in map"),
    _process("navigation_controller", "robot_stack.navigation.node", _LIMITING, "drives to goal poses"),
    _process("mission_manager", "robot_stack.mission.node", _LIMITING, "missions from UI commands"),
    _process("recorder", "robot_stack.recording.node", _OPTIONAL, "every contract topic into MCAP"),
    _process(
        "lidar_driver",
        "sim.nodes.lidar_driver",
        _CRITICAL,
        "simulated LiDAR; a real driver publishes the same topics",
        system=System.SIMULATION,
    ),
    _process(
        "camera_driver",
        "sim.nodes.camera_driver",
        _LIMITING,
        "simulated front and rear cameras; a real driver publishes the same topics",
        system=System.SIMULATION,
    ),
    _process("imu_driver", None, _CRITICAL, "IMU of a real robot; the simulation brings its own"),
    _process("battery_driver", None, _LIMITING, "battery of a real robot; the simulation brings its own"),
    _process("perception_pipeline", "robot_stack.perception.node", _CRITICAL, "obstacle points"),
    _process("costmap_server", "robot_stack.costmap.node", _LIMITING, "local costmap"),
    _process("aruco_detector", "robot_stack.docking.nodes.aruco_detector", _LIMITING, "markers in the camera images"),
    _process(
        "docking_controller",
        "robot_stack.docking.nodes.docking_controller",
        _LIMITING,
        "docking and undocking, and the latch",
    ),
    _process("ehmi_bridge", None, _OPTIONAL, "external display over a serial line"),
    _process("touch_ui", None, _OPTIONAL, "touch screen"),
    _process("system_monitor", None, _OPTIONAL, "robot status and computer health"),
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
    _process(
        "wmx_io_node",
        "robot_stack.wmx.nodes.wmx_io_node",
        _OPTIONAL,
        "services of digital inputs and outputs of the motion engine",
        system=System.WMX,
    ),
    _process(
        "wmx_ethercat_node",
        "robot_stack.wmx.nodes.wmx_ethercat_node",
        _OPTIONAL,
        "services of the EtherCAT network",
        system=System.WMX,
    ),
    _process(
        "wmx_params_node",
        "robot_stack.wmx.nodes.wmx_params_node",
        _OPTIONAL,
        "services of parameter files and parameters of axes",
        system=System.WMX,
    ),
)

BY_NAME: dict[str, Process] = {process.name: process for process in PROCESSES}


def available() -> tuple[Process, ...]:
    """The processes that are built."""
    return tuple(process for process in PROCESSES if process.available)


def process_of_node(node: str) -> Process:
    """The built process a node lives in, else the row of the node's own name; KeyError for an unknown node."""
    for process in available():
        if node in process.nodes:
            return process
    return BY_NAME[node]
