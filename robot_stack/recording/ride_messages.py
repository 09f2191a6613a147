"""The topics that describe a ride, live or from a recording, as observations."""

from __future__ import annotations

import math
import time
from typing import Any

from robot_stack.contract import topics
from robot_stack.recording.rides import Observation, RideWatch

_ROWS = (
    topics.MISSION_STATUS,
    topics.ROBOT_STATUS,
    topics.ODOM,
    topics.VELOCITY_LIMIT,
    topics.DOCKING_STATUS,
)
# Of topics without a limit in the contract: latched ones hold until they change.
_STALE_S = {row.name: row.stale_s or math.inf for row in _ROWS}


def add_motion(watch: RideWatch, message: Any) -> None:
    """Adds a message of /sensors/imu."""
    stamp, a, w = message.header.stamp, message.linear_acceleration, message.angular_velocity
    watch.add_motion(stamp.sec + 1e-9 * stamp.nanosec, (a.x, a.y, a.z), (w.x, w.y, w.z))


class RideMessages:
    """Keeps the newest message of each topic. time_s: as ``Observation.time_s``."""

    names = tuple(_STALE_S)
    rows = _ROWS

    def __init__(self) -> None:
        self._newest: dict[str, tuple[float, Any]] = {}

    def take(self, topic: str, message: Any, time_s: float) -> None:
        self._newest[topic] = (time_s, message)

    def observation(self, at_s: float, time_s: float) -> Observation:
        """at_s: system clock, s since the epoch."""
        mission, robot, odom, limit, docking = (self._fresh(row.name, time_s) for row in _ROWS)
        known: dict[str, Any] = {}
        if mission is not None:
            known |= {
                "mission_id": mission.mission_id,
                "mission_name": mission.mission_name,
                "state": mission.state,
                "waypoint": mission.current_waypoint,
                "reason": mission.reason,
                "attached": mission.passenger_attached,
            }
        if robot is not None:
            position = robot.pose.position
            known |= {"x": position.x, "y": position.y, "battery": robot.battery_percent / 100.0}
        if odom is not None:
            linear = odom.twist.twist.linear
            known["speed_mps"] = math.hypot(linear.x, linear.y)
        if limit is not None:
            known |= {"allowed_mps": limit.max_linear_velocity, "limited_by": limit.reason}
        if docking is not None:
            known |= {
                "docking": docking.state,
                "docking_error_m": docking.position_error,
                "docking_error_rad": docking.orientation_error,
            }
        # Two rides may begin within a second.
        begin = f"{time.strftime('%Y%m%d-%H%M%S', time.gmtime(at_s))}-{int(1e3 * (at_s % 1.0)):03d}"
        return Observation(begin, at_s, time_s, **known)

    def _fresh(self, topic: str, time_s: float) -> Any:
        received_s, message = self._newest.get(topic, (-math.inf, None))
        return message if time_s - received_s <= _STALE_S[topic] else None
