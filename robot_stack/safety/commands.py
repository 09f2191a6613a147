"""Where the robot is told to go: what the drive tries to do, and what it would do if nothing held it back."""

from __future__ import annotations

from robot_stack.core.geometry import ZERO_TWIST, Twist2
from robot_stack.core.twist_limits import limit_speed
from robot_stack.safety.timing import age_s

# Highest first, as the drive arbitrates.
SOURCES = ("/teleop/cmd_vel", "/docking/cmd_vel", "/cmd_vel")
# Faster is no robot: of such a command only the direction counts, as the drive takes it [m/s, rad/s].
_FASTEST = 100.0


class CommandWatch:
    """The newest commands, base_link. Steady seconds. stale_s: a command that is older counts no more."""

    def __init__(self, stale_s: float) -> None:
        self._stale_s = stale_s
        self._limited: tuple[Twist2, float] | None = None
        self._requests: dict[str, tuple[Twist2, float]] = {}

    def limited(self, twist: Twist2, now_s: float) -> None:
        """What the drive tries to do. One that is not finite counts as not received."""
        if twist.is_finite():
            self._limited = (limit_speed(twist, _FASTEST, _FASTEST), now_s)

    def request(self, source: str, twist: Twist2, now_s: float) -> None:
        """A command of one of ``SOURCES``. One that is not finite is a standstill, as the drive takes it."""
        wanted = limit_speed(twist, _FASTEST, _FASTEST) if twist.is_finite() else ZERO_TWIST
        self._requests[source] = (wanted, now_s)

    def driven(self, now_s: float) -> Twist2 | None:
        """What the drive tries to do, None if it does not say."""
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
