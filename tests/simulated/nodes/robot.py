"""A robot without inertia and with exact sensors, for nodes that drive it."""

from __future__ import annotations

from geometry_msgs.msg import PoseStamped, Twist
from nav_msgs.msg import Odometry

from robot_stack.contract import topics
from robot_stack.core.geometry import IDENTITY, ZERO_TWIST, exp_se2
from robot_stack.middleware.conversions import pose_stamped, pose_to_msg, time_from_s, twist_from_msg, twist_to_msg
from tests.simulated.bench import Bench

# Parameters for a navigation controller without a LiDAR and without a map.
WITHOUT_MAP = {"map": ""}
BLIND = {**WITHOUT_MAP, "use_costmap": False}


class DrivenRobot:
    """Executes /cmd_vel and publishes odometry at 50 Hz and its pose at 10 Hz; odom equals map.

    held: it stands, whatever is commanded.
    """

    def __init__(self, bench: Bench) -> None:
        self._bench = bench
        self.pose, self.twist = IDENTITY, ZERO_TWIST
        self.driven_m = 0.0
        self.held = False
        self._last_s = bench.stamp_s()
        self.commands = bench.listen(topics.CMD_VEL, self._on_command)
        bench.repeat(topics.ODOM, self.odometry, 50.0)
        self.know_pose()

    def know_pose(self) -> None:
        """Publishes the pose until ``silence``."""
        self._bench.repeat(topics.CURRENT_POSE, self.current_pose, 10.0)

    def _on_command(self, message: Twist) -> None:
        self._move()
        self.twist = ZERO_TWIST if self.held else twist_from_msg(message)

    def _move(self) -> None:
        now_s = self._bench.stamp_s()
        self.pose = self.pose.compose(exp_se2(self.twist, now_s - self._last_s))
        self.driven_m += self.twist.speed() * (now_s - self._last_s)
        self._last_s = now_s

    def odometry(self) -> Odometry:
        self._move()
        message = Odometry(child_frame_id="base_link")
        message.header.frame_id, message.header.stamp = "odom", time_from_s(self._last_s)
        message.pose.pose, message.twist.twist = pose_to_msg(self.pose), twist_to_msg(self.twist)
        return message

    def current_pose(self) -> PoseStamped:
        self._move()
        return pose_stamped(self.pose, "map", time_from_s(self._last_s))
