"""Every action of the stack, one row each."""

from robot_stack.contract.model import Action, System
from robot_stack.contract.topics import OPERATOR_TOOL

_DOCKING_CLIENTS = ("mission_manager", "touch_ui", OPERATOR_TOOL)

DOCK = Action(
    "/docking/dock",
    "custom_msgs/action/Dock",
    "docking_controller",
    _DOCKING_CLIENTS,
    "dock to a dock of config/docks.yaml",
)
UNDOCK = Action(
    "/docking/undock", "custom_msgs/action/Undock", "docking_controller", _DOCKING_CLIENTS, "unlatch and back off"
)
NAVIGATE_TO_POSE = Action(
    "/navigate_to_pose",
    "nav2_msgs/action/NavigateToPose",
    "navigation_controller",
    ("mission_manager", "docking_controller", OPERATOR_TOOL),
    "drive to a pose in map, as in Nav2; a newer goal, also one of /goal_pose, preempts it",
)
FOLLOW_JOINT_TRAJECTORY = Action(
    "/movensys_manipulator_arm_controller/follow_joint_trajectory",
    "control_msgs/action/FollowJointTrajectory",
    "follow_joint_trajectory_server",
    (OPERATOR_TOOL,),
    "cubic spline through the points, or cubics and quintics by their velocities and accelerations; its other "
    "clients are motion planners outside the stack",
    System.WMX,
)

ACTIONS: tuple[Action, ...] = (NAVIGATE_TO_POSE, DOCK, UNDOCK, FOLLOW_JOINT_TRAJECTORY)
