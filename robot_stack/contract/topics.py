"""Every topic of the stack, one row each.

Node names that stand for people and tools outside the process table are listed in ``OUTSIDE``.
"""

from robot_stack.contract import qos
from robot_stack.contract.model import EVERY_NODE, System, Topic

OPERATOR_TOOL = "robot_stack_cli"
TEST_TOOL = "scenario_runner"
# Third-party programs: a planner, ros2 topic pub, a screen on another computer.
EXTERNAL = "external"
OUTSIDE = (OPERATOR_TOOL, TEST_TOOL, EXTERNAL, "rviz")

# Nodes that start autonomous motion.
_DEPARTING = ("mission_manager", "navigation_controller", "docking_controller")

# Drivers of real devices (robot_stack.drivers): a profile runs one for each sensor instead of the simulated one.
_CAMERA_PORTS = ("v4l2_camera_driver", "camera_adapter")
_BATTERY_PORTS = ("pylontech_driver", "modbus_battery_driver", "battery_adapter")
_IMU_PORTS = ("xsens_driver", "imu_adapter")
_LIDAR_PORTS = ("point_cloud_adapter", "velodyne_driver", "ouster_driver")
_OVERHEAD_LIDAR_PORTS = ("overhead_lidar_adapter",)

_WMX = System.WMX
_SIM = System.SIMULATION

# --- system -------------------------------------------------------------------------------------------------------
_STOP_SOURCES = (
    "emergency_stop_button",
    "touch_ui",
    "mission_manager",
    "docking_controller",
    "supervisor",
    OPERATOR_TOOL,
)
EMERGENCY_STOP = Topic(
    "/emergency_stop",
    "std_msgs/msg/Bool",
    qos.LATCHED,
    _STOP_SOURCES,
    (EVERY_NODE,),
    "true: stop at once; false: a request to release, which the safety monitor alone grants",
    queue=10,  # a true followed at once by a false must still be received
    wakes=(EVERY_NODE,),
)
EMERGENCY_STOP_SOURCES = Topic(
    "/emergency_stop/sources",
    "custom_msgs/msg/EmergencyStopSource",
    qos.REQUEST_QUEUE,
    _STOP_SOURCES,
    ("safety_monitor", "touch_ui"),
    "state of each source of /emergency_stop: a press holds until the process that pressed releases it",
    rate_hz=5.0,
    stale_s=1.0,
    queue=50,
    sometimes=("touch_ui",),  # while a page shows the self test
)
ROBOT_STATUS = Topic(
    "/robot_status",
    "custom_msgs/msg/RobotStatus",
    qos.STATUS,
    ("system_monitor",),
    ("touch_ui", "mission_manager", "safety_monitor"),
    "battery, pose, safety, mission and computer health in one message; NaN and empty are unknown",
    rate_hz=10.0,
    stale_s=1.0,
)
PASSENGER_ATTACHED = Topic(
    "/passenger_attached",
    "std_msgs/msg/Bool",
    qos.LATCHED,
    ("docking_controller", TEST_TOOL),
    (
        "swerve_controller",
        "safety_monitor",
        "ehmi_bridge",
        "mission_manager",
        "navigation_controller",
        "costmap_server",
        "fleet_agent",
    ),
    "a wheelchair with its passenger is latched to the robot",
)
HEARTBEAT = Topic(
    "/system/heartbeat",
    "custom_msgs/msg/Heartbeat",
    qos.HEARTBEAT,
    (EVERY_NODE,),
    (EXTERNAL,),
    "for other machines: safety monitor and supervisor read the nodes' records in shared memory (5 Hz)",
    rate_hz=1.0,
    stale_s=3.0,
)
DIAGNOSTICS = Topic(
    "/diagnostics",
    "diagnostic_msgs/msg/DiagnosticArray",
    qos.DIAGNOSTICS,
    (EVERY_NODE,),
    ("system_monitor", "touch_ui"),
    "each node's inputs (age, rate), faults and loop statistics",
    rate_hz=1.0,
    stale_s=3.0,
    queue=100,  # all nodes of a stack that were started together report together
    sometimes=("touch_ui",),  # while a page shows it
)
DIAGNOSTICS_AGG = Topic(
    "/diagnostics_agg",
    "diagnostic_msgs/msg/DiagnosticArray",
    qos.COMMAND,  # diagnostic_aggregator's
    ("system_monitor",),
    (EXTERNAL,),
    "/diagnostics of all nodes as one tree with slash paths, by diagnostic_aggregator's conventions",
    rate_hz=1.0,
    stale_s=3.0,
)
COMPUTER_TEMPERATURE = Topic(
    "/system/temperature",
    "sensor_msgs/msg/Temperature",
    qos.STATUS,
    ("system_monitor",),
    ("safety_monitor",),
    "the computer's hottest thermal zone, which frame_id names; NaN where the kernel has none",
    rate_hz=5.0,
    stale_s=1.0,
)
BATTERY_STATE = Topic(
    "/battery_state",
    "sensor_msgs/msg/BatteryState",
    qos.STATUS,
    ("battery_driver", *_BATTERY_PORTS),
    (
        "system_monitor",
        "safety_monitor",
        "mission_manager",
        "touch_ui",
        "docking_controller",
        "fleet_agent",
    ),
    "48 V pack",
    rate_hz=1.0,
    stale_s=5.0,
)
TF = Topic(
    "/tf",
    "tf2_msgs/msg/TFMessage",
    qos.TF,
    ("ndt_localization", "swerve_controller"),
    ("rviz",),
    "map->odom from localization (10 Hz); odom->base_link and the steering and wheel frames of the robot's "
    "description, as robot_state_publisher names them, from the swerve controller (50 Hz)",
)
TF_STATIC = Topic(
    "/tf_static",
    "tf2_msgs/msg/TFMessage",
    qos.TF_STATIC,
    (
        "imu_driver",
        "lidar_driver",
        "overhead_lidar_driver",
        "camera_driver",
        *_CAMERA_PORTS,
        *_IMU_PORTS,
        *_LIDAR_PORTS,
        *_OVERHEAD_LIDAR_PORTS,
    ),
    ("rviz",),
    "base_link->sensor, each from the sensor's driver",
)

ROBOT_DESCRIPTION = Topic(
    "/robot_description",
    "std_msgs/msg/String",
    qos.LATCHED,
    ("swerve_controller",),
    ("rviz",),
    "URDF made from config/robot.yaml: frames, joints and looks",
)

# --- swerve drive -------------------------------------------------------------------------------------------------
WHEEL_COMMANDS = Topic(
    "/swerve/wheel_commands",
    "custom_msgs/msg/SwerveModuleCommandArray",
    qos.COMMAND,
    ("swerve_controller",),
    ("swerve_hardware_interface", "safety_monitor"),
    "m/s and rad per module, order FL FR RL RR",
    rate_hz=20.0,
    stale_s=0.15,
    wakes=("swerve_hardware_interface",),
)
JOINT_STATES = Topic(
    "/joint_states",
    "sensor_msgs/msg/JointState",
    qos.SENSOR,
    ("swerve_hardware_interface",),
    ("swerve_controller", "safety_monitor", "docking_controller"),
    "8 joints fl_drive, fl_steer, ... rr_steer; rad, rad/s, Nm; drive position is the accumulated wheel angle",
    rate_hz=50.0,
    stale_s=0.1,
    queue=5,
    wakes=("swerve_controller",),  # odometry is due with each
)
ODOM = Topic(
    "/odom",
    "nav_msgs/msg/Odometry",
    qos.SENSOR,
    ("swerve_controller",),
    (
        "ndt_localization",
        "navigation_controller",
        "docking_controller",
        "perception_pipeline",
        "mission_manager",
        "touch_ui",
        "fleet_agent",
    ),
    "wheel odometry, odom -> base_link, with covariance",
    rate_hz=50.0,
    stale_s=0.2,
    queue=15,
    sometimes=("touch_ui",),  # while a page shows it
)
CMD_VEL_LIMITED = Topic(
    "/swerve/cmd_vel_limited",
    "geometry_msgs/msg/TwistStamped",
    qos.SENSOR,
    ("swerve_controller",),
    ("touch_ui", "safety_monitor"),
    "target twist of the swerve controller after arbitration and limits, base_link",
    rate_hz=20.0,
    stale_s=0.2,
)

# --- motion commands ----------------------------------------------------------------------------------------------
CMD_VEL = Topic(
    "/cmd_vel",
    "geometry_msgs/msg/Twist",
    qos.COMMAND,
    ("navigation_controller",),
    ("swerve_controller", "safety_monitor"),
    "velocity in base_link from navigation; lowest priority of the three command sources",
    rate_hz=20.0,
    stale_s=0.2,
)
DOCKING_CMD_VEL = Topic(
    "/docking/cmd_vel",
    "geometry_msgs/msg/TwistStamped",
    qos.COMMAND,
    ("docking_controller",),
    ("swerve_controller", "safety_monitor"),
    "velocity in base_link while docking controls the motion",
    rate_hz=20.0,
    stale_s=0.2,
    on_demand=True,
)
TELEOP_CMD_VEL = Topic(
    "/teleop/cmd_vel",
    "geometry_msgs/msg/TwistStamped",
    qos.COMMAND,
    ("touch_ui", "joystick_driver", TEST_TOOL),
    ("swerve_controller", "safety_monitor", "mission_manager", "navigation_controller"),
    "velocity in base_link from manual control; highest priority of the three command sources",
    rate_hz=20.0,
    stale_s=0.2,
    on_demand=True,
)
# Sources of the drive's commands: a later row has priority; a source that is silent for its stale_s loses control.
DRIVE_COMMANDS = (CMD_VEL, DOCKING_CMD_VEL, TELEOP_CMD_VEL)

# --- pose and navigation ------------------------------------------------------------------------------------------
CURRENT_POSE = Topic(
    "/current_pose",
    "geometry_msgs/msg/PoseStamped",
    qos.SENSOR,
    ("ndt_localization",),
    (
        "navigation_controller",
        "mission_manager",
        "docking_controller",
        "safety_monitor",
        "system_monitor",
        "touch_ui",
        "fleet_agent",
    ),
    "base_link in map",
    rate_hz=10.0,
    stale_s=0.5,
)
LOCALIZATION_QUALITY = Topic(
    "/localization/quality",
    "std_msgs/msg/Float32",
    qos.SENSOR,
    ("ndt_localization",),
    ("safety_monitor", "system_monitor", "touch_ui", "fleet_agent"),
    "[0, 1]",
    rate_hz=10.0,
    stale_s=0.5,
)
LOCALIZATION_POSE = Topic(
    "/localization/pose",
    "geometry_msgs/msg/PoseWithCovarianceStamped",
    qos.SENSOR,
    ("ndt_localization",),
    ("rviz", EXTERNAL),
    "base_link in map as in /current_pose, with the covariance of x, y, yaw (the others are 0): it grows "
    "during dead reckoning by wheels and gyro, and is 1e6 m2 while the pose is searched for",
    rate_hz=10.0,
    stale_s=0.5,
)
MAP = Topic(
    "/map",
    "nav_msgs/msg/OccupancyGrid",
    qos.LATCHED,
    ("ndt_localization",),
    ("rviz", EXTERNAL),
    "the site's grid as map_server publishes it, in map: free (0), occupied (100), unknown (-1); once, at the start",
    sometimes=("ndt_localization",),  # with a map
)
MAP_CLOUD = Topic(
    "/map_cloud",
    "sensor_msgs/msg/PointCloud2",
    qos.LATCHED,
    ("ndt_localization",),
    ("rviz", EXTERNAL),
    "the site's map for localization, thinned: one point for each of its cells, in map; once, at the start",
    sometimes=("ndt_localization",),  # with a map
)
INITIAL_POSE = Topic(
    "/initialpose",
    "geometry_msgs/msg/PoseWithCovarianceStamped",
    qos.COMMAND,
    ("touch_ui", "fleet_agent", "navigation_controller", "rviz"),
    ("ndt_localization",),
    "start or correction of the pose in map, and its change to another level in a lift",
    wakes=("ndt_localization",),
)
GOAL_POSE = Topic(
    "/goal_pose",
    "geometry_msgs/msg/PoseStamped",
    qos.COMMAND,
    ("mission_manager", "touch_ui", "rviz", TEST_TOOL),
    ("navigation_controller",),
    "goal in map, without a result (/navigate_to_pose has one); an empty frame_id ends the goal of any client",
    wakes=("navigation_controller",),
)
PLAN = Topic(
    "/plan",
    "nav_msgs/msg/Path",
    qos.LATCHED,
    ("navigation_controller",),
    ("touch_ui", "mission_manager"),
    "path to the current goal in map; empty without a goal",
)
NAVIGATION_STATUS = Topic(
    "/navigation/status",
    "std_msgs/msg/String",
    qos.LATCHED,
    ("navigation_controller",),
    ("mission_manager", "touch_ui"),
    "internal: activity of navigation or the reason of its failure, for operators; no node depends on it",
)
BUILDING_REQUEST = Topic(
    "/building/request",
    "custom_msgs/msg/BuildingRequest",
    qos.REQUEST_QUEUE,
    ("navigation_controller",),
    ("mission_manager", "touch_ui", "sim_world", EXTERNAL),
    "requests to open a door and to hold it open, until the robot has left it; only in a site with door zones",
    rate_hz=1.0,
    stale_s=2.5,
    on_demand=True,
    sometimes=("sim_world",),  # in a world with doors
)
BUILDING_STATE = Topic(
    "/building/state",
    "custom_msgs/msg/BuildingState",
    qos.REQUEST_QUEUE,
    ("sim_world", EXTERNAL),
    ("navigation_controller",),
    "state of each door of the building, from its interface; two that contradict each other let no robot pass",
    rate_hz=2.0,
    stale_s=2.5,
    queue=50,
    on_demand=True,
    sometimes=("sim_world", "navigation_controller"),  # in a world, and at a site, with doors
)
NAVIGATION_PEOPLE = Topic(
    "/navigation/people",
    "visualization_msgs/msg/MarkerArray",
    qos.SENSOR,
    ("navigation_controller",),
    ("touch_ui",),
    "internal: the people and objects of /perception/people that are used, in odom at its stamp: a cylinder each, with "
    "the namespace walking, person (has walked) or object, and for each walking one an arrow, namespace velocity, to "
    "its position in 1 s; for visualization, only while subscribed",
    rate_hz=5.0,
    stale_s=1.0,
    on_demand=True,
    sometimes=("touch_ui",),  # while a page shows it
)

# --- sensors and perception ---------------------------------------------------------------------------------------
IMU = Topic(
    "/sensors/imu",
    "sensor_msgs/msg/Imu",
    qos.SENSOR,
    ("imu_driver", *_IMU_PORTS),
    ("ndt_localization", "safety_monitor", "perception_pipeline"),
    "at base_link",
    rate_hz=100.0,
    stale_s=0.1,
    queue=30,
)
LIDAR_POINTS = Topic(
    "/sensors/lidar/points",
    "sensor_msgs/msg/PointCloud2",
    qos.SENSOR,
    ("lidar_driver", *_LIDAR_PORTS),
    ("perception_pipeline", "ndt_localization", "safety_monitor", "remote_view"),
    "full sweep, about 150k points: x y z intensity ring time",
    rate_hz=10.0,
    stale_s=0.5,
    bulk=True,
    # The perception pipeline while there are no half sweeps, localization with a map, the remote view for a viewer.
    sometimes=("perception_pipeline", "ndt_localization", "remote_view"),
    wakes=("ndt_localization",),
)
LIDAR_HALF_SWEEP = Topic(
    "/sensors/lidar/half_sweep",
    "sensor_msgs/msg/PointCloud2",
    qos.SENSOR,
    ("lidar_driver",),
    ("perception_pipeline",),
    "internal: each half sweep as it arrives",
    rate_hz=20.0,
    stale_s=0.3,
    bulk=True,
    wakes=("perception_pipeline",),
)
OVERHEAD_LIDAR_POINTS = Topic(
    "/sensors/overhead_lidar/points",
    "sensor_msgs/msg/PointCloud2",
    qos.SENSOR,
    ("overhead_lidar_driver", *_OVERHEAD_LIDAR_PORTS),
    ("perception_pipeline", "safety_monitor"),
    "frames of up to 20k points around and ahead of robot and chair: x y z intensity ring time",
    rate_hz=10.0,
    stale_s=0.3,
    bulk=True,
)
VENDOR_POINTS = Topic(
    "/lidar/vendor_points",
    "sensor_msgs/msg/PointCloud2",
    qos.SENSOR,
    (EXTERNAL,),
    ("point_cloud_adapter",),
    "the main LiDAR's cloud by its vendor's own ROS driver, in that driver's layout; the name is a parameter",
    rate_hz=10.0,
    stale_s=0.5,
    bulk=True,
    wakes=("point_cloud_adapter",),
    sometimes=("point_cloud_adapter",),  # under the name that its parameters give
)
OVERHEAD_VENDOR_POINTS = Topic(
    "/overhead_lidar/vendor_points",
    "sensor_msgs/msg/PointCloud2",
    qos.SENSOR,
    (EXTERNAL,),
    ("overhead_lidar_adapter",),
    "likewise the overhead LiDAR's",
    rate_hz=10.0,
    stale_s=0.5,
    bulk=True,
    wakes=("overhead_lidar_adapter",),
    sometimes=("overhead_lidar_adapter",),  # under the name that its parameters give
)
VENDOR_FRONT_IMAGE = Topic(
    "/camera/front/vendor_image",
    "sensor_msgs/msg/Image",
    qos.SENSOR,
    (EXTERNAL,),
    ("camera_adapter",),
    "the front camera's image by its vendor's own ROS driver; name and reliability are parameters",
    rate_hz=10.0,
    stale_s=0.5,
    bulk=True,
    wakes=("camera_adapter",),
    sometimes=("camera_adapter",),  # under the name that its parameters give
)
VENDOR_REAR_IMAGE = Topic(
    "/camera/rear/vendor_image",
    "sensor_msgs/msg/Image",
    qos.SENSOR,
    (EXTERNAL,),
    ("camera_adapter",),
    "likewise the rear camera's",
    rate_hz=10.0,
    stale_s=0.5,
    bulk=True,
    wakes=("camera_adapter",),
    sometimes=("camera_adapter",),  # under the name that its parameters give
)
VENDOR_IMU = Topic(
    "/imu/vendor_data",
    "sensor_msgs/msg/Imu",
    qos.SENSOR,
    (EXTERNAL,),
    ("imu_adapter",),
    "likewise the inertial unit's data, in its own axes",
    rate_hz=100.0,
    stale_s=0.1,
    wakes=("imu_adapter",),
    sometimes=("imu_adapter",),  # under the name that its parameters give
)
VENDOR_BATTERY_STATE = Topic(
    "/battery/vendor_state",
    "sensor_msgs/msg/BatteryState",
    qos.SENSOR,
    (EXTERNAL,),
    ("battery_adapter",),
    "likewise the battery's state",
    rate_hz=1.0,
    stale_s=5.0,
    wakes=("battery_adapter",),
    sometimes=("battery_adapter",),  # under the name that its parameters give
)
FRONT_IMAGE = Topic(
    "/sensors/camera/front/image_raw",
    "sensor_msgs/msg/Image",
    qos.SENSOR,
    ("camera_driver", *_CAMERA_PORTS),
    ("aruco_detector", "touch_ui", "remote_view"),
    "1280x720 mono8; stamp: middle of the exposure of the middle row",
    rate_hz=10.0,
    stale_s=0.5,
    bulk=True,
    wakes=("aruco_detector",),
    sometimes=("touch_ui", "remote_view"),  # while a page or a viewer shows it
)
REAR_IMAGE = Topic(
    "/sensors/camera/rear/image_raw",
    "sensor_msgs/msg/Image",
    qos.SENSOR,
    ("camera_driver", *_CAMERA_PORTS),
    ("aruco_detector", "touch_ui", "remote_view"),
    "1280x720 mono8; stamp: middle of the exposure of the middle row",
    rate_hz=10.0,
    stale_s=0.5,
    bulk=True,
    wakes=("aruco_detector",),
    sometimes=("touch_ui", "remote_view"),  # while a page or a viewer shows it
)
FRONT_CAMERA_INFO = Topic(
    "/sensors/camera/front/camera_info",
    "sensor_msgs/msg/CameraInfo",
    qos.SENSOR,
    ("camera_driver", *_CAMERA_PORTS),
    ("aruco_detector", "safety_monitor"),
    "intrinsics of the front camera, with each image",
    rate_hz=10.0,
    stale_s=0.5,
)
REAR_CAMERA_INFO = Topic(
    "/sensors/camera/rear/camera_info",
    "sensor_msgs/msg/CameraInfo",
    qos.SENSOR,
    ("camera_driver", *_CAMERA_PORTS),
    ("aruco_detector", "safety_monitor"),
    "intrinsics of the rear camera, with each image",
    rate_hz=10.0,
    stale_s=0.5,
)
OBSTACLES = Topic(
    "/perception/obstacles",
    "sensor_msgs/msg/PointCloud2",
    qos.SENSOR,
    ("perception_pipeline",),
    ("costmap_server", "safety_monitor", "touch_ui"),
    "obstacle points without ground, 0.1-2.0 m above it, seen or remembered; base_link at the stamp, which is the "
    "newest point's time",
    rate_hz=20.0,
    stale_s=0.3,
    queue=8,
    sometimes=("touch_ui",),  # while a page shows it
)
UNSEEN_SPACE = Topic(
    "/perception/unseen",
    "sensor_msgs/msg/PointCloud2",
    qos.SENSOR,
    ("perception_pipeline",),
    ("safety_monitor",),
    "with each obstacle cloud, the boundary of the seen or remembered space: the cells beside it",
    rate_hz=20.0,
    stale_s=0.3,
    queue=8,
)
NO_GROUND = Topic(
    "/perception/no_ground",
    "sensor_msgs/msg/PointCloud2",
    qos.SENSOR,
    ("perception_pipeline",),
    ("safety_monitor",),
    "with each obstacle cloud, the boundary of the ground that was seen or driven on: the cells beyond it",
    rate_hz=20.0,
    stale_s=0.3,
    queue=8,
)
MOVING = Topic(
    "/perception/moving",
    "sensor_msgs/msg/PointCloud2",
    qos.SENSOR,
    ("perception_pipeline",),
    ("safety_monitor",),
    "with each obstacle cloud, points of moving objects and their velocity over ground: x, y, z, vx, vy along "
    "base_link's axes",
    rate_hz=20.0,
    stale_s=0.3,
    queue=8,
)
SPACE = Topic(
    "/perception/space",
    "nav_msgs/msg/OccupancyGrid",
    qos.SENSOR,
    ("perception_pipeline",),
    ("costmap_server",),
    "internal: rolling grid in odom: free (0), occupied (100), neither seen nor remembered (-1)",
    rate_hz=5.0,
    stale_s=1.0,
    wakes=("costmap_server",),
)
PEOPLE = Topic(
    "/perception/people",
    "sensor_msgs/msg/PointCloud2",
    qos.SENSOR,
    ("perception_pipeline",),
    ("navigation_controller",),
    "with each grid of /perception/space and its stamp, in odom: tracked people and objects of a person's size, one "
    "point each, with velocity, radius, standard deviations, box, age, number, and whether it walks or has walked "
    "(robot_stack/core/people.py)",
    rate_hz=5.0,
    stale_s=1.0,
    sometimes=("navigation_controller",),  # parameters can disable it
)
LOCAL_COSTMAP = Topic(
    "/local_costmap/costmap",
    "nav_msgs/msg/OccupancyGrid",
    qos.SENSOR,
    ("costmap_server",),
    ("navigation_controller", "touch_ui"),
    "rolling grid in odom",
    rate_hz=5.0,
    stale_s=1.0,
    sometimes=("navigation_controller", "touch_ui"),  # parameters can disable it
)

# --- docking ------------------------------------------------------------------------------------------------------
ARUCO_DETECTIONS = Topic(
    "/docking/aruco_detections",
    "custom_msgs/msg/ArucoDetectionArray",
    qos.SENSOR,
    ("aruco_detector",),
    ("docking_controller", "touch_ui"),
    "markers of both cameras, each in its camera's frame; empty while docking needs none",
    rate_hz=10.0,
    stale_s=0.5,
    queue=3,
    sometimes=("touch_ui",),  # while a page shows it
)
DOCKING_STATUS = Topic(
    "/docking/status",
    "custom_msgs/msg/DockingStatus",
    qos.STATUS,
    ("docking_controller",),
    ("mission_manager", "touch_ui", "ehmi_bridge", "aruco_detector", "safety_monitor"),
    "state and errors of the docking",
    rate_hz=10.0,
    stale_s=0.5,
)
DOCKING_TARGET = Topic(
    "/docking/target",
    "geometry_msgs/msg/PoseStamped",
    qos.STATUS,
    ("docking_controller",),
    ("safety_monitor",),
    "internal: the dock's frame in base_link while SERVOING or FINE_ALIGN: its region is no obstacle then",
    rate_hz=10.0,
    stale_s=0.3,
    on_demand=True,
)
LATCH_STATUS = Topic(
    "/docking/latch",
    "custom_msgs/msg/LatchStatus",
    qos.STATUS,
    ("docking_controller",),
    (
        "safety_monitor",
        "swerve_controller",
        "perception_pipeline",
        "navigation_controller",
        "costmap_server",
        "ehmi_bridge",
        "mission_manager",
        "fleet_agent",
    ),
    "internal: latch confirmed closed, wheelchair attached, undocking under way; also at each change",
    rate_hz=10.0,
    stale_s=0.5,
)

# --- safety -------------------------------------------------------------------------------------------------------
SAFETY_STATUS = Topic(
    "/safety/status",
    "custom_msgs/msg/SafetyStatus",
    qos.STATUS,
    ("safety_monitor",),
    (EVERY_NODE,),
    "state, active faults, nearest obstacle, e-stop",
    rate_hz=10.0,
    stale_s=0.5,
    queue=10,  # slow subscribers must still receive an emergency that is followed by its end
)
VELOCITY_LIMIT = Topic(
    "/safety/velocity_limit",
    "custom_msgs/msg/VelocityLimit",
    qos.LATCHED,
    ("safety_monitor",),
    ("swerve_controller", "navigation_controller", "docking_controller", "touch_ui", OPERATOR_TOOL),
    "the smallest limit in force and its reason; 0 is a stop, and so is a timeout",
    rate_hz=20.0,
    stale_s=0.18,
    wakes=("swerve_controller",),
)

# --- mission, eHMI, UI --------------------------------------------------------------------------------------------
UI_COMMAND = Topic(
    "/ui/command",
    "custom_msgs/msg/UICommand",
    qos.REQUEST_QUEUE,
    ("touch_ui", OPERATOR_TOOL),
    ("mission_manager",),
    "START_MISSION, PAUSE, RESUME, ABORT, EMERGENCY_STOP",
    wakes=("mission_manager",),
)
UI_LANGUAGE = Topic(
    "/ui/language",
    "std_msgs/msg/String",
    qos.LATCHED,
    ("touch_ui",),
    ("mission_manager",),
    "the rider's language, en, ja or zh, after a choice or a start on a rider page: for mission names and the external "
    "display",
)
MISSION_STATUS = Topic(
    "/mission/status",
    "custom_msgs/msg/MissionStatus",
    qos.LATCHED,
    ("mission_manager",),
    ("touch_ui", "system_monitor", "ehmi_bridge", "fleet_agent", OPERATOR_TOOL),
    "state, waypoint, progress, ETA, reason of a refusal",
)
MISSION_QUEUE = Topic(
    "/mission/queue",
    "custom_msgs/msg/MissionQueue",
    qos.LATCHED,
    ("mission_manager",),
    ("touch_ui", "fleet_agent", OPERATOR_TOOL),
    "orders: waiting, under way, ended last; why no order starts",
)
MISSION_VELOCITY_LIMIT = Topic(
    "/mission/velocity_limit",
    "custom_msgs/msg/VelocityLimit",
    qos.LATCHED,
    ("mission_manager",),
    ("navigation_controller",),
    "of the way to the present waypoint; infinite without one",
)
UI_HEARTBEAT = Topic(
    "/ui/heartbeat",
    "std_msgs/msg/Header",
    qos.COMMAND,
    ("touch_ui",),
    ("safety_monitor", "system_monitor", "sim_computer"),
    "only while a page is connected and answers; frame_id unused",
    rate_hz=1.0,
    stale_s=5.0,
    on_demand=True,
)
DEPARTURE_WARNING = Topic(
    "/departure_warning",
    "std_msgs/msg/Header",
    qos.COMMAND,
    _DEPARTING,
    _DEPARTING,
    "warning before a start; frame_id: the node that is about to start the motion, stamp: the time of the start; "
    "published once more at that time",
    rate_hz=10.0,
    stale_s=0.5,
    queue=10,
    on_demand=True,
)
EHMI_STATE_COMMAND = Topic(
    "/ehmi/state_command",
    "custom_msgs/msg/EHMIState",
    qos.COMMAND,
    ("mission_manager", "docking_controller"),
    ("ehmi_bridge",),
    "state 0-28, language, volume of the external display",
)
EHMI_STATUS = Topic(
    "/ehmi/status",
    "custom_msgs/msg/EHMIStatus",
    qos.STATUS,
    ("ehmi_bridge",),
    ("safety_monitor", "system_monitor", "touch_ui"),
    "link, acknowledged state, firmware fault",
    rate_hz=1.0,
    stale_s=5.0,
    sometimes=("touch_ui",),  # while a page shows it
)

# --- remote viewers: copies behind a slow link, published only with a subscriber ------------------------------------
_REMOTE_HZ = 6.0  # 5 Hz at the viewer with one message of six lost

REMOTE_POINTS = Topic(
    "/remote/points",
    "sensor_msgs/msg/PointCloud2",
    qos.SENSOR,
    ("remote_view",),
    ("rviz", EXTERNAL),
    "/sensors/lidar/points thinned to 60 kB at most: x y z in its frame, at its stamp, not de-skewed",
    rate_hz=_REMOTE_HZ,
    stale_s=1.0,
    on_demand=True,
)
REMOTE_FRONT_IMAGE = Topic(
    "/remote/front_camera/compressed",
    "sensor_msgs/msg/CompressedImage",
    qos.SENSOR,
    ("remote_view",),
    ("rviz", EXTERNAL),
    "/sensors/camera/front/image_raw as JPEG, smaller; named as image_transport's compressed transport",
    rate_hz=_REMOTE_HZ,
    stale_s=1.0,
    on_demand=True,
)
REMOTE_REAR_IMAGE = Topic(
    "/remote/rear_camera/compressed",
    "sensor_msgs/msg/CompressedImage",
    qos.SENSOR,
    ("remote_view",),
    ("rviz", EXTERNAL),
    "likewise the rear camera's",
    rate_hz=_REMOTE_HZ,
    stale_s=1.0,
    on_demand=True,
)
REMOTE_COPIES = (REMOTE_POINTS, REMOTE_FRONT_IMAGE, REMOTE_REAR_IMAGE)

# --- WMX layer (vendor default QoS: KeepLast(1), reliable, volatile) ----------------------------------------------
WMX_JOINT_STATES = Topic(
    "/joint_states",
    "sensor_msgs/msg/JointState",
    qos.COMMAND,
    ("manipulator_state",),
    (),
    "6 joints and 2 gripper fingers, rad, rad/s",
    rate_hz=500.0,
    stale_s=0.1,
    system=_WMX,
)
ISAAC_JOINT_COMMAND = Topic(
    "/isaacsim/joint_command",
    "sensor_msgs/msg/JointState",
    qos.COMMAND,
    ("manipulator_state",),
    (),
    "the joint states for Isaac Sim, stamp zero",
    rate_hz=500.0,
    stale_s=0.1,
    sometimes=("manipulator_state",),  # where its parameters name the topic
    system=_WMX,
)
GAZEBO_COMMANDS = Topic(
    "/gazebo_position_controller/commands",
    "std_msgs/msg/Float64MultiArray",
    qos.COMMAND,
    ("manipulator_state",),
    (),
    "8 positions for the Gazebo position controller",
    rate_hz=500.0,
    stale_s=0.1,
    sometimes=("manipulator_state",),  # where its parameters name the topic
    system=_WMX,
)
WMX_AXIS_STATE = Topic(
    "/wmx/axis/state",
    "wmx_ros2_message/msg/AxisState",
    qos.COMMAND,
    ("wmx_ros2_general_node",),
    (),
    "status of the configured axes",
    rate_hz=100.0,
    stale_s=0.1,
    system=_WMX,
)
WMX_AXIS_VELOCITY = Topic(
    "/wmx/axis/velocity",
    "wmx_ros2_message/msg/AxisVelocity",
    qos.COMMAND,
    (EXTERNAL,),
    ("wmx_ros2_general_node",),
    "velocity motion per axis, rad/s",
    system=_WMX,
    wakes=("wmx_ros2_general_node",),
)
WMX_AXIS_POSITION = Topic(
    "/wmx/axis/position",
    "wmx_ros2_message/msg/AxisPose",
    qos.COMMAND,
    (EXTERNAL,),
    ("wmx_ros2_general_node",),
    "absolute position motion per axis, rad",
    system=_WMX,
    wakes=("wmx_ros2_general_node",),
)
WMX_AXIS_POSITION_RELATIVE = Topic(
    "/wmx/axis/position/relative",
    "wmx_ros2_message/msg/AxisPose",
    qos.COMMAND,
    (EXTERNAL,),
    ("wmx_ros2_general_node",),
    "relative position motion per axis, rad",
    system=_WMX,
    wakes=("wmx_ros2_general_node",),
)
WMX_CMD_VEL = Topic(
    "/cmd_vel",
    "geometry_msgs/msg/Twist",
    qos.COMMAND,
    (EXTERNAL,),
    ("diff_drive_controller",),
    "twist of the differential base",
    system=_WMX,
    wakes=("diff_drive_controller",),
)
WMX_CMD_VEL_STAMPED = Topic(
    "/diff_drive_controller/cmd_vel",
    "geometry_msgs/msg/TwistStamped",
    qos.COMMAND,
    (EXTERNAL,),
    ("diff_drive_controller",),
    "twist of the differential base, for senders that stamp it; the newest message of both topics applies",
    sometimes=("diff_drive_controller",),  # where its parameters name the topic
    system=_WMX,
    wakes=("diff_drive_controller",),
)
WMX_CMD_VEL_CHECK = Topic(
    "/cmd_vel_check",
    "geometry_msgs/msg/Twist",
    qos.COMMAND,
    ("diff_drive_controller",),
    (),
    "echo of the received twist",
    sometimes=("diff_drive_controller",),  # where its parameters name the topic
    system=_WMX,
)
WMX_WHEEL_VELOCITIES = Topic(
    "/velocity_controller/commands",
    "std_msgs/msg/Float64MultiArray",
    qos.COMMAND,
    ("diff_drive_controller",),
    (),
    "measured [left, right] wheel speed, rad/s",
    rate_hz=100.0,
    stale_s=0.1,
    sometimes=("diff_drive_controller",),  # where its parameters name the topic
    system=_WMX,
)
WMX_ODOM_ENC = Topic(
    "/odom_enc",
    "nav_msgs/msg/Odometry",
    qos.COMMAND,
    ("diff_drive_controller",),
    (),
    "encoder twist of the differential base",
    rate_hz=100.0,
    stale_s=0.1,
    sometimes=("diff_drive_controller",),  # where its parameters name the topic
    system=_WMX,
)
WMX_TF = Topic(
    "/tf",
    "tf2_msgs/msg/TFMessage",
    qos.TF,
    ("diff_drive_controller",),
    ("rviz",),
    "odom->base_link of the differential base, if its parameter publish_tf is true",
    sometimes=("diff_drive_controller",),  # where its parameters name the topic
    system=_WMX,
)

# --- simulation (ground truth; no node of the stack may read it) --------------------------------------------------
CLOCK = Topic(
    "/clock",
    "rosgraph_msgs/msg/Clock",
    qos.CLOCK,
    ("sim_world",),
    (EVERY_NODE,),
    "simulation time; published only when the world does not run at real time",
    sometimes=("sim_world", EVERY_NODE),  # nodes of this machine have the world's time from shared memory
    system=_SIM,
    wakes=(EVERY_NODE,),
)
SIM_GROUND_TRUTH = Topic(
    "/sim/ground_truth",
    "nav_msgs/msg/Odometry",
    qos.SENSOR,
    ("sim_world",),
    (TEST_TOOL, OPERATOR_TOOL),
    "true pose and twist of base_link in the world",
    rate_hz=50.0,
    stale_s=0.2,
    system=_SIM,
)
SIM_JOINT_STATES = Topic(
    "/sim/joint_states",
    "sensor_msgs/msg/JointState",
    qos.SENSOR,
    ("sim_world", "sim_manipulator"),
    (TEST_TOOL, OPERATOR_TOOL),
    "true joint positions, speeds and torques: of the robot's eight drives, or of the arm and its gripper's fingers",
    rate_hz=50.0,
    stale_s=0.2,
    system=_SIM,
)

SIM_BODIES = Topic(
    "/sim/bodies",
    "tf2_msgs/msg/TFMessage",
    qos.SENSOR,
    ("sim_world",),
    ("camera_driver", "lidar_driver", "overhead_lidar_driver", TEST_TOOL, OPERATOR_TOOL),
    "true poses of base_link, wheelchair, station boards and people in map: the scene of the simulated sensors",
    rate_hz=50.0,
    stale_s=0.2,
    system=_SIM,
    wakes=("camera_driver", "lidar_driver", "overhead_lidar_driver"),
)

SIM_TOUCHED = Topic(
    "/sim/touched",
    "std_msgs/msg/String",
    qos.LATCHED,
    ("sim_world",),
    (TEST_TOOL, OPERATOR_TOOL),
    "names of the solids and people that robot or wheelchair have touched since the start, joined by commas",
    system=_SIM,
)
SIM_EHMI_DISPLAY = Topic(
    "/sim/ehmi_display",
    "std_msgs/msg/String",
    qos.STATUS,
    ("ehmi_display",),
    (TEST_TOOL, OPERATOR_TOOL),
    "what the simulated external display shows, JSON: state, colour, motion, pictogram, text, sound; changes at once",
    rate_hz=1.0,
    stale_s=5.0,
    system=_SIM,
)

ROWS: dict[str, Topic] = {key: value for key, value in list(globals().items()) if isinstance(value, Topic)}
TOPICS: tuple[Topic, ...] = tuple(ROWS.values())


def of_system(*systems: System) -> tuple[Topic, ...]:
    """The topics of the given systems, in the order of this file."""
    return tuple(topic for topic in TOPICS if topic.system in systems)
