"""An operator's commands: emergency stop, its release, doors and missions; each waits for the response."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from custom_msgs.msg import MissionStatus, SafetyStatus, UICommand
from robot_stack.cli.errors import NoAnswer
from robot_stack.cli.nodes.operator import Operator
from robot_stack.contract import services, topics

# Period of repeating a refused reset: the monitor may not have received the released button yet.
_RESET_TRIES = 5
_RESET_PAUSE_S = 0.1


def emergency_stop(timeout_s: float) -> float | None:
    """Publishes the emergency stop. Returns the seconds until the safety monitor showed it; None if it did not.

    The message is sent at once and again for every new subscriber, independent of any response.
    """
    begun_s = time.monotonic()
    shown: list[float] = []

    def on_status(message: SafetyStatus) -> None:
        if message.safety_state == SafetyStatus.EMERGENCY_STOP:
            shown.append(time.monotonic() - begun_s)

    with Operator() as operator:
        source, stop, reports = operator.stop_source()
        source.publish(True)
        operator.subscribe(topics.SAFETY_STATUS, on_status)
        delivered = operator.deliver(stop, timeout_s)
        if operator.wait(lambda: reports.get_subscription_count() > 0, timeout_s - (time.monotonic() - begun_s)):
            source.repeat()  # late subscribers get the latched stop, but not its report
            operator.deliver(reports, timeout_s - (time.monotonic() - begun_s))
        if not operator.wait(lambda: shown, timeout_s - (time.monotonic() - begun_s)) or not delivered:
            return None
        return shown[0]


def confirm_door(name: str, timeout_s: float) -> tuple[bool, str]:
    """(accepted, what was done or why not). Raises NoAnswer without a navigation controller."""
    with Operator() as operator:
        answer = operator.call(services.CONFIRM_DOOR, timeout_s, name=name)
    return bool(answer.success), str(answer.message)


def reset(timeout_s: float, clear: Sequence[str] = ()) -> tuple[bool, str]:
    """Releases this operator's emergency stop and requests the reset from the safety monitor: (granted, reason).

    clear: sources whose press is cleared first, because they cannot release it themselves. A press of this tool is
    always cleared: the process that pressed has ended.
    Raises NoAnswer without a safety monitor.
    """
    with Operator() as operator:
        source, stop, _ = operator.stop_source()
        source.publish(False)
        if not operator.deliver(stop, timeout_s):
            raise NoAnswer("/emergency_stop has no subscriber: is the stack running?")
        operator.call(services.CLEAR_EMERGENCY_STOP, timeout_s, source=topics.OPERATOR_TOOL)
        for name in clear:
            answer = operator.call(services.CLEAR_EMERGENCY_STOP, timeout_s, source=name)
            if not answer.success:
                return False, str(answer.message)
        response = operator.call(services.SAFETY_RESET, timeout_s)
        for _ in range(_RESET_TRIES - 1):
            if response.success:
                break
            operator.wait(lambda: False, _RESET_PAUSE_S)
            response = operator.call(services.SAFETY_RESET, timeout_s)
        return bool(response.success), str(response.message)


@dataclass(frozen=True, slots=True)
class Mission:
    """``/mission/status`` as values; eta_s is None if unknown."""

    state: str
    mission_id: str
    waypoint: str
    completed: int
    total: int
    progress: float
    eta_s: float | None
    passenger: bool
    reason: str
    last_command: str
    accepted: bool


def _mission(message: MissionStatus) -> Mission:
    return Mission(
        state=message.state,
        mission_id=message.mission_id,
        waypoint=message.current_waypoint,
        completed=message.waypoints_completed,
        total=message.total_waypoints,
        progress=message.progress,
        eta_s=message.eta_s if math.isfinite(message.eta_s) else None,
        passenger=message.passenger_attached,
        reason=message.reason,
        last_command=message.last_command,
        accepted=message.last_command_accepted,
    )


def command_mission(command: str, mission_id: str, timeout_s: float) -> Mission:
    """Sends a UI command and returns the status with its answer. Raises NoAnswer without an answer."""
    received: list[Mission] = []
    with Operator() as operator:
        publisher = operator.advertise(topics.UI_COMMAND)
        operator.subscribe(topics.MISSION_STATUS, lambda message: received.append(_mission(message)))
        # The latched previous status arrives first; the next one that names the command is the answer.
        manager = operator.wait(lambda: received and publisher.get_subscription_count() > 0, timeout_s)
        if not manager:
            raise NoAnswer("no mission manager answers: is the stack running?")
        received.clear()
        message = UICommand(command_type=command, mission_id=mission_id)
        message.header.stamp = operator.node.get_clock().now().to_msg()
        publisher.publish(message)
        if not operator.wait(lambda: any(item.last_command == command for item in received), timeout_s):
            raise NoAnswer(f"the mission manager does not answer {command}")
        return next(item for item in received if item.last_command == command)


def watch_mission(report: Callable[[Mission], Any], timeout_s: float, follow: bool) -> None:
    """Calls ``report`` with the status and, to follow, with each new one until interrupted. Raises NoAnswer."""
    received: list[Mission] = []
    with Operator() as operator:
        operator.subscribe(topics.MISSION_STATUS, lambda message: received.append(_mission(message)))
        if not operator.wait(lambda: received, timeout_s):
            raise NoAnswer("no /mission/status: is the stack running?")
        while True:
            for item in received:
                report(item)
            received.clear()
            if not follow:
                return
            operator.wait(lambda: received, None)
