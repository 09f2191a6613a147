"""Every action of the stack, one row each."""

from robot_stack.contract.model import Action, System

DOCK = Action("/docking/dock", "custom_msgs/action/Dock", "docking_controller", "dock to a dock of config/docks.yaml")
UNDOCK = Action("/docking/undock", "custom_msgs/action/Undock", "docking_controller", "unlatch and back off")
FOLLOW_JOINT_TRAJECTORY = Action(
    "/movensys_manipulator_arm_controller/follow_joint_trajectory",
    "control_msgs/action/FollowJointTrajectory",
    "follow_joint_trajectory_server",
    "cubic spline through the trajectory's points",
    System.WMX,
)

ACTIONS: tuple[Action, ...] = (DOCK, UNDOCK, FOLLOW_JOINT_TRAJECTORY)
