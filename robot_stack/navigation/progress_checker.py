"""Detects a robot that is commanded to move and does not, as Nav2's progress checker: blocked wheels, a kerb, slip."""

from __future__ import annotations

from robot_stack.core.geometry import ZERO_TWIST, Pose2, Twist2, wrap_angle

# Motion of this size, m or rad, is progress.
_MOVED = 0.1
# Net commanded motion, m or rad, without progress. The lag of many short starts stays below it.
_COMMANDED = 0.5


class ProgressChecker:
    """Only commanded motion counts: waiting for a person, a warning or a release is no lack of progress.

    allowance_s: time for which the robot may be commanded to move without progress.
    """

    def __init__(self, allowance_s: float) -> None:
        self._allowance_s = allowance_s
        self.reset()

    def reset(self) -> None:
        self._at: Pose2 | None = None
        self._stalled_s = 0.0
        self._commanded = ZERO_TWIST

    def is_stalled(self, pose: Pose2, command: Twist2, dt_s: float) -> bool:
        """command: in force for the last ``dt_s``. pose: after it, in map."""
        at, sum_ = self._at, self._commanded
        stayed = at is not None and pose.distance_to(at) <= _MOVED and abs(wrap_angle(pose.yaw - at.yaw)) <= _MOVED
        if not stayed:
            self.reset()
            self._at = pose
        elif command != ZERO_TWIST:
            self._stalled_s += dt_s
            self._commanded = Twist2(
                sum_.vx + command.vx * dt_s, sum_.vy + command.vy * dt_s, sum_.omega + command.omega * dt_s
            )
        far = self._commanded.speed() + abs(self._commanded.omega) >= _COMMANDED
        return far and self._stalled_s >= self._allowance_s
