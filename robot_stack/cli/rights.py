"""User rights required by ``config/supervisor.yaml``, and the missing ones."""

from __future__ import annotations

import resource
from dataclasses import dataclass
from pathlib import Path

from robot_stack.supervisor.params import SupervisorParams

# capabilities(7): with these the limits do not apply.
_CAP_IPC_LOCK, _CAP_SYS_NICE = 14, 23
_UNLIMITED = resource.RLIM_INFINITY
# setrlimit(2): RLIMIT_NICE is this minus the lowest nice value allowed.
_NICE_CEILING = 20


@dataclass(frozen=True, slots=True)
class Right:
    """needed, allowed: of the resource limit, as in setrlimit(2). item, value: its entry in limits.conf(5).
    purpose: the effect of its absence on a busy machine.
    """

    name: str
    needed: int
    allowed: int
    item: str
    value: str
    purpose: str

    @property
    def granted(self) -> bool:
        return self.allowed == _UNLIMITED or (self.needed != _UNLIMITED and self.allowed >= self.needed)


def rights(params: SupervisorParams) -> tuple[Right, ...]:
    """The rights required by the stack, and those of this process."""
    priority = max(params.realtime_priority.values(), default=0)
    niceness = min(params.own_niceness, 0, *params.niceness.values())
    return (
        Right(
            "real-time priority",
            priority,
            _allowed(resource.RLIMIT_RTPRIO, _CAP_SYS_NICE),
            "rtprio",
            str(priority),
            "the processes that stop the wheels may be late: false JOINT_STATES_TIMEOUT and DRIVE_FAULT",
        ),
        Right(
            "nice values below 0",
            _NICE_CEILING - niceness,
            _allowed(resource.RLIMIT_NICE, _CAP_SYS_NICE),
            "nice",
            str(niceness),
            "other programs take time from perception and navigation",
        ),
        Right(
            "locked memory",
            _UNLIMITED if any(params.lock_memory.values()) else 0,
            _allowed(resource.RLIMIT_MEMLOCK, _CAP_IPC_LOCK),
            "memlock",
            "unlimited",
            "memory that was paged out costs up to 0.2 s when it is needed again",
        ),
    )


def _allowed(limit: int, capability: int) -> int:
    return _UNLIMITED if _capabilities() >> capability & 1 else resource.getrlimit(limit)[0]


def _capabilities() -> int:
    """The effective ones, as a bit mask."""
    for line in Path("/proc/self/status").read_text(encoding="ascii", errors="replace").splitlines():
        if line.startswith("CapEff:"):
            return int(line.split()[1], 16)
    return 0
