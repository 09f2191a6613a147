"""Every service of the stack, one row each."""

from robot_stack.contract.model import Service, System

_WMX = System.WMX

SAFETY_RESET = Service(
    "/safety/reset", "std_srvs/srv/Trigger", "safety_monitor", "second key of the release from an emergency stop"
)
RESET_ODOMETRY = Service(
    "/swerve/reset_odometry",
    "std_srvs/srv/Trigger",
    "swerve_controller",
    "odom starts again at the identity; refused while moving",
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
    "raises or clears a fault of a simulated camera, or of what it looks at",
    System.SIMULATION,
)
INJECT_LIDAR_FAULT = Service(
    "/sim/inject_lidar_fault",
    "custom_msgs/srv/InjectFault",
    "lidar_driver",
    "raises or clears a fault of the simulated LiDAR",
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

# Beyond the documents: optional nodes, in no profile by default.
IO_GET_INPUT_BIT = Service(
    "/wmx/io/get_input_bit",
    "wmx_ros2_message/srv/GetIoBit",
    "wmx_io_node",
    "one digital input",
    _WMX,
)
IO_GET_OUTPUT_BIT = Service(
    "/wmx/io/get_output_bit",
    "wmx_ros2_message/srv/GetIoBit",
    "wmx_io_node",
    "one digital output as commanded",
    _WMX,
)
IO_GET_INPUT_BYTES = Service(
    "/wmx/io/get_input_bytes",
    "wmx_ros2_message/srv/GetIoBytes",
    "wmx_io_node",
    "bytes of the input image",
    _WMX,
)
IO_GET_OUTPUT_BYTES = Service(
    "/wmx/io/get_output_bytes",
    "wmx_ros2_message/srv/GetIoBytes",
    "wmx_io_node",
    "bytes of the output image as commanded",
    _WMX,
)
IO_SET_OUTPUT_BIT = Service(
    "/wmx/io/set_output_bit",
    "wmx_ros2_message/srv/SetIoBit",
    "wmx_io_node",
    "writes one digital output",
    _WMX,
)
IO_SET_OUTPUT_BYTES = Service(
    "/wmx/io/set_output_bytes",
    "wmx_ros2_message/srv/SetIoBytes",
    "wmx_io_node",
    "writes bytes of the output image",
    _WMX,
)
PARAMS_LOAD = Service(
    "/wmx/params/load",
    "wmx_ros2_message/srv/LoadWmxParams",
    "wmx_params_node",
    "imports a parameter file into the engine",
    _WMX,
)
PARAMS_GET = Service(
    "/wmx/params/get",
    "wmx_ros2_message/srv/GetWmxParams",
    "wmx_params_node",
    "parameters of axes as text",
    _WMX,
)
ECAT_GET_NETWORK_STATE = Service(
    "/wmx/ecat/get_network_state",
    "wmx_ros2_message/srv/EcatGetNetworkState",
    "wmx_ethercat_node",
    "an EtherCAT master and its slaves",
    _WMX,
)
ECAT_REGISTER_READ = Service(
    "/wmx/ecat/register_read",
    "wmx_ros2_message/srv/EcatRegisterRead",
    "wmx_ethercat_node",
    "registers of a slave",
    _WMX,
)
ECAT_RESET_STATISTICS = Service(
    "/wmx/ecat/reset_statistics",
    "wmx_ros2_message/srv/EcatResetStatistics",
    "wmx_ethercat_node",
    "starts a master's counters anew",
    _WMX,
)
ECAT_START_HOTCONNECT = Service(
    "/wmx/ecat/start_hotconnect",
    "wmx_ros2_message/srv/EcatStartHotconnect",
    "wmx_ethercat_node",
    "takes in slaves connected while communicating",
    _WMX,
)

SERVICES: tuple[Service, ...] = tuple(value for value in list(globals().values()) if isinstance(value, Service))
