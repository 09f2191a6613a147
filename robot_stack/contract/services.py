"""Every service of the stack, one row each."""

from robot_stack.contract.model import Service, System

_WMX = System.WMX

SAFETY_RESET = Service(
    "/safety/reset", "std_srvs/srv/Trigger", "safety_monitor", "second key of the release from an emergency stop"
)
CLEAR_EMERGENCY_STOP = Service(
    "/safety/clear_emergency_stop",
    "custom_msgs/srv/ClearEmergencyStop",
    "safety_monitor",
    "an operator clears the press of a source that is gone or unknown, by name",
)
RESET_ODOMETRY = Service(
    "/swerve/reset_odometry",
    "std_srvs/srv/Trigger",
    "swerve_controller",
    "odom starts again at the identity; refused while moving",
)
EDIT_MISSION_QUEUE = Service(
    "/mission/queue/edit",
    "custom_msgs/srv/EditMissionQueue",
    "mission_manager",
    "adds, removes or moves an order, holds or releases the queue, or changes the destination of the ride",
)
CONFIRM_DOOR = Service(
    "/building/confirm",
    "custom_msgs/srv/ConfirmDoor",
    "navigation_controller",
    "staff confirm that the door for which the robot waits is open, for one passage",
)
INJECT_FAULT = Service(
    "/sim/inject_fault",
    "custom_msgs/srv/InjectFault",
    "sim_world",
    "raises or clears a simulated fault",
    System.SIMULATION,
)
INJECT_CAMERA_FAULT = Service(
    "/sim/inject_camera_fault",
    "custom_msgs/srv/InjectFault",
    "camera_driver",
    "raises or clears a fault of a simulated camera or of its scene",
    System.SIMULATION,
)
INJECT_LIDAR_FAULT = Service(
    "/sim/inject_lidar_fault",
    "custom_msgs/srv/InjectFault",
    "lidar_driver",
    "raises or clears a fault of the simulated LiDAR",
    System.SIMULATION,
)
INJECT_OVERHEAD_LIDAR_FAULT = Service(
    "/sim/inject_overhead_lidar_fault",
    "custom_msgs/srv/InjectFault",
    "overhead_lidar_driver",
    "raises or clears a fault of the simulated overhead LiDAR",
    System.SIMULATION,
)
INJECT_EHMI_FAULT = Service(
    "/sim/inject_ehmi_fault",
    "custom_msgs/srv/InjectFault",
    "ehmi_display",
    "raises or clears a fault of the simulated external display or of its cable; durations are real time",
    System.SIMULATION,
)
INJECT_COMPUTER_FAULT = Service(
    "/sim/inject_computer_fault",
    "custom_msgs/srv/InjectFault",
    "sim_computer",
    "raises or clears a fault of the simulated robot's computer or of its screen; durations are real time",
    System.SIMULATION,
)
INJECT_ENGINE_FAULT = Service(
    "/sim/inject_engine_fault",
    "custom_msgs/srv/InjectFault",
    "wmx_engine",
    "raises or clears a fault of the virtual drives",
    System.SIMULATION,
)
INJECT_ARM_FAULT = Service(
    "/sim/inject_arm_fault",
    "custom_msgs/srv/InjectFault",
    "sim_manipulator",
    "raises or clears a fault of the simulated arm or of its drives",
    System.SIMULATION,
)

ENGINE_SET_DEVICE = Service(
    "/wmx/engine/set_device",
    "wmx_ros2_message/srv/SetEngine",
    "wmx_ros2_general_node",
    "creates or closes the device",
    _WMX,
)
ENGINE_SET_COMM = Service(
    "/wmx/engine/set_comm", "std_srvs/srv/SetBool", "wmx_ros2_general_node", "starts or stops communication", _WMX
)
ENGINE_GET_STATUS = Service(
    "/wmx/engine/get_status", "std_srvs/srv/Trigger", "wmx_ros2_general_node", "engine state by name", _WMX
)
AXIS_SET_ON = Service(
    "/wmx/axis/set_on", "wmx_ros2_message/srv/SetAxis", "wmx_ros2_general_node", "servo on (1) or off (0)", _WMX
)
AXIS_CLEAR_ALARM = Service(
    "/wmx/axis/clear_alarm", "wmx_ros2_message/srv/SetAxis", "wmx_ros2_general_node", "clears amplifier alarms", _WMX
)
AXIS_SET_MODE = Service(
    "/wmx/axis/set_mode",
    "wmx_ros2_message/srv/SetAxis",
    "wmx_ros2_general_node",
    "position (0) or velocity (1) mode",
    _WMX,
)
AXIS_SET_POLARITY = Service(
    "/wmx/axis/set_polarity", "wmx_ros2_message/srv/SetAxis", "wmx_ros2_general_node", "1 or -1", _WMX
)
AXIS_SET_GEAR_RATIO = Service(
    "/wmx/axis/set_gear_ratio",
    "wmx_ros2_message/srv/SetAxisGearRatio",
    "wmx_ros2_general_node",
    "pulses per user unit",
    _WMX,
)
AXIS_HOMING = Service(
    "/wmx/axis/homing",
    "wmx_ros2_message/srv/SetAxis",
    "wmx_ros2_general_node",
    "the current position becomes home",
    _WMX,
)
AXIS_STOP = Service(
    "/wmx/axis/stop",
    "wmx_ros2_message/srv/SetAxis",
    "wmx_ros2_general_node",
    "stops the axes, each with its own deceleration; data is not used; beyond the documents",
    _WMX,
)
ENGINE_ESTOP = Service(
    "/wmx/engine/estop",
    "std_srvs/srv/SetBool",
    "wmx_ros2_general_node",
    "the engine's emergency stop of all axes (true) and its release (false); beyond the documents",
    _WMX,
)
SET_GRIPPER = Service(
    "/wmx/set_gripper",
    "std_srvs/srv/SetBool",
    "follow_joint_trajectory_server",
    "closes (true) or opens (false) the gripper",
    _WMX,
)

SERVICES: tuple[Service, ...] = tuple(value for value in list(globals().values()) if isinstance(value, Service))
