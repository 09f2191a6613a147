"""The commands of the robot: the drive's own limited one, and the requested one without limits."""

from __future__ import annotations

from robot_stack.contract import topics
from robot_stack.core.geometry import ZERO_TWIST, Twist2
from robot_stack.core.twist_limits import limit_speed
from robot_stack.safety.timing import age_s

# Highest first, as the drive arbitrates.
SOURCES = (topics.TELEOP_CMD_VEL.name, topics.DOCKING_CMD_VEL.name, topics.CMD_VEL.name)
# Of a faster command only the direction counts, as in the drive [m/s, rad/s].
_FASTEST = 100.0


class CommandWatch:
    """The newest commands, base_link. Steady seconds. stale_s: an older command does not count."""

    def __init__(self, stale_s: float) -> None:
        self._stale_s = stale_s
        self._limited: tuple[Twist2, float] | None = None
        self._requests: dict[str, tuple[Twist2, float]] = {}

    def limited(self, twist: Twist2, now_s: float) -> None:
        """The drive's own command. A non-finite one counts as not received."""
        if twist.is_finite():
            self._limited = (limit_speed(twist, _FASTEST, _FASTEST), now_s)

    def request(self, source: str, twist: Twist2, now_s: float) -> None:
        """A command of one of ``SOURCES``. A non-finite one is a standstill, as in the drive."""
        wanted = limit_speed(twist, _FASTEST, _FASTEST) if twist.is_finite() else ZERO_TWIST
        self._requests[source] = (wanted, now_s)

    def driven(self, now_s: float) -> Twist2 | None:
        """The drive's own command, None without a fresh one."""
        return self._fresh(self._limited, now_s)

    def leading(self, now_s: float) -> str | None:
        """The highest source that has a fresh command, None without any."""
        return next((name for name in SOURCES if self._fresh(self._requests.get(name), now_s) is not None), None)

    def requested(self, now_s: float) -> Twist2:
        """The command of the highest source that has a fresh one; standstill without any."""
        requests = (self._fresh(self._requests.get(source), now_s) for source in SOURCES)
        return next((twist for twist in requests if twist is not None), ZERO_TWIST)

    def _fresh(self, command: tuple[Twist2, float] | None, now_s: float) -> Twist2 | None:
        if command is None or not age_s(now_s, command[1]) <= self._stale_s:
            return None
        return command[0]
