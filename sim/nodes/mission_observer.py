"""Starts a mission like the touch screen, and records the events of the ride."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from typing import Any

from nav_msgs.msg import Odometry

from custom_msgs.msg import MissionStatus, SafetyStatus, UICommand
from robot_stack.cli.nodes.operator import Operator
from robot_stack.contract import topics
from robot_stack.core.world_clock import WorldClock
from sim.run.ride import Ride
from sim.run.ride_notes import RideNotes

_ANSWER_S = 10.0


class MissionObserver:
    """A context manager. ``ride`` grows while ``wait`` waits; its times count from the start of the mission.

    They are times of the world, which may run slower than the clock on the wall: that one is ``now_s``.
    """

    def __init__(self) -> None:
        self.received_s = math.nan  # time of the world's last message, by ``now_s``
        self._begun_s = time.monotonic()
        self._operator = Operator()
        self._commands = self._operator.advertise(topics.UI_COMMAND)
        self.notes = RideNotes(self._operator.subscribe)
        self._operator.subscribe(topics.SIM_GROUND_TRUTH, self._on_truth)

    def __enter__(self) -> MissionObserver:
        return self

    def __exit__(self, *_: object) -> None:
        self._operator.__exit__()

    @property
    def operator(self) -> Operator:
        """The operator, whose node subscribes and publishes."""
        return self._operator

    def now_s(self) -> float:
        return time.monotonic() - self._begun_s

    # --- what was noted ----------------------------------------------------------------------------------------------

    @property
    def ride(self) -> Ride:
        return self.notes.ride

    @property
    def mission(self) -> MissionStatus | None:
        return self.notes.mission

    @property
    def safety(self) -> SafetyStatus | None:
        return self.notes.safety

    @property
    def docking(self) -> Any:
        return self.notes.docking

    @property
    def moved_m(self) -> float:
        return self.notes.moved_m

    @property
    def world_s(self) -> float:
        return self.notes.world_s

    def may_move(self) -> bool:
        return self.notes.may_move()

    def docking_now(self) -> bool:
        return self.notes.docking_now()

    @property
    def pace(self) -> float:
        """Simulated over real time in the last second; 0 if unknown."""
        clock = WorldClock.find()
        return 0.0 if clock is None else clock.pace

    @property
    def waiting_for(self) -> str:
        """The nodes that the world waits for, with reasons; empty while it runs."""
        clock = WorldClock.find()
        return "" if clock is None else clock.waiting_for

    # --- acting ------------------------------------------------------------------------------------------------------

    def wait(self, condition: Callable[[], Any], timeout_s: float | None) -> bool:
        """Records until the condition holds (True) or the time is over (False)."""
        return self._operator.wait(condition, timeout_s)

    def board(self) -> None:
        """Waits until all topics have been received. Raises TimeoutError."""
        received = self.wait(
            lambda: self.mission and self.safety and self.ride.samples and self._commands.get_subscription_count(),
            _ANSWER_S,
        )
        if not received:
            raise TimeoutError("the stack is silent: no message of mission, safety or world")

    def start(self, mission_id: str) -> None:
        """Sends START_MISSION on /ui/command. Raises TimeoutError without an answer, ValueError if it is refused."""
        self._command(UICommand.START_MISSION, mission_id)
        if self.mission is not None and not self.mission.last_command_accepted:
            raise ValueError(self.mission.reason)
        self._begun_s = time.monotonic()
        self.notes.begin()

    def _command(self, command_type: str, mission_id: str) -> None:
        self.notes.mission = None
        # Without a stamp: the world's time may be another than this node's.
        self._commands.publish(UICommand(command_type=command_type, mission_id=mission_id))
        if not self.wait(lambda: self.mission and self.mission.last_command == command_type, _ANSWER_S):
            raise TimeoutError(f"the mission manager does not answer {command_type}")

    def _on_truth(self, _: Odometry) -> None:
        self.received_s = self.now_s()
