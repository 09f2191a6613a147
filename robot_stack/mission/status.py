"""The content of /mission/status, and when it must be published."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from robot_stack.contract.display import Display
from robot_stack.contract.states import MissionState
from robot_stack.mission import route
from robot_stack.mission.display import Docking, display_of
from robot_stack.mission.events import Inputs, Status
from robot_stack.mission.guards import finite
from robot_stack.mission.record import Record
from robot_stack.mission.states import ACTIVE, UNDER_WAY, State

# Below this mean speed the ETA is unreliable: at an obstacle, or just after the start.
_SLOWEST_ETA_MPS = 0.1

# States without a constant in MissionStatus; the reason shows the difference.
_SHOWN_AS = {
    State.STOPPED: MissionState.PAUSED,
    State.DOCKING: MissionState.RUNNING,
    State.UNDOCKING: MissionState.RUNNING,
}


@dataclass(frozen=True, slots=True)
class Answer:
    """The response to the last command: its name, and why it was refused (empty if it was not)."""

    command: str = ""
    refusal: str = ""


def progress(record: Record, inputs: Inputs) -> float:
    """Share of the route done, [0, 1]."""
    if record.mission is None:
        return 0.0
    return route.progress(record.start, finite(inputs.pose), record.stops, record.waypoint)


def eta_s(record: Record, inputs: Inputs, mean_speed_mps: float, waited_s: float) -> float:
    """Time to the end of the mission from the length left, the mean speed and the waits; NaN while unknown."""
    pose = finite(inputs.pose)
    if record.state not in UNDER_WAY or record.current is None or pose is None:
        return math.nan
    if not mean_speed_mps >= _SLOWEST_ETA_MPS:
        return math.nan
    waits_s = max(0.0, route.waiting_s(record.stops, record.waypoint) - waited_s)
    return route.remaining_m(pose, record.stops, record.waypoint) / mean_speed_mps + waits_s


def build(
    record: Record,
    answer: Answer,
    inputs: Inputs,
    *,
    reasons: tuple[str, ...],
    eta: float,
    emergency: bool,
    low: bool,
    docking: Docking,
    setting_out: bool,
    waiting: bool,
    moving: bool,
    awake: bool,
    announced: Display | None,
) -> Status:
    """The status: ``reasons`` are joined for people, the rest is for the external display (``display_of``)."""
    return Status(
        state=_SHOWN_AS.get(record.state) or MissionState(record.state.value),
        mission=record.mission,
        current_waypoint=record.current.name if record.current else "",
        waypoints_completed=min(record.waypoint, len(record.stops)),
        total_waypoints=len(record.stops),
        progress=progress(record, inputs),
        eta_s=eta,
        passenger_attached=record.passenger_attached,
        reason="; ".join(filter(None, (answer.refusal, *reasons))),
        last_command=answer.command,
        last_command_accepted=bool(answer.command) and not answer.refusal,
        display=int(
            display_of(
                record,
                inputs,
                emergency=emergency,
                battery_low=low,
                docking=docking,
                setting_out=setting_out,
                waiting=waiting,
                moving=moving,
                awake=awake,
                announced=announced,
            )
        ),
    )


class Reporting:
    """Decides when a status is sent: at once when more than its numbers changed, periodically while active."""

    def __init__(self, period_s: float) -> None:
        # Slightly less than the period: ticks are not exact, and a late one would cost a whole tick more.
        self._period_s = period_s - 1e-3
        self._since_s = 0.0
        self._sent: Status | None = None

    def due(self, status: Status, record: Record, dt_s: float, *, forced: bool) -> bool:
        """True if ``status`` is to be sent now; then it counts as sent."""
        self._since_s += dt_s
        periodic = record.state in ACTIVE and self._since_s >= self._period_s
        if not (forced or periodic or self._sent is None or _without_numbers(self._sent) != _without_numbers(status)):
            return False
        self._since_s, self._sent = 0.0, status
        return True


def _without_numbers(status: Status) -> Status:
    return replace(status, progress=0.0, eta_s=0.0)
