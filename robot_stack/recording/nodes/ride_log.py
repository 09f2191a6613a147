"""Part of the black box: writes a record of each ride."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Any

from robot_stack.contract import topics
from robot_stack.core.comfort import load_seat
from robot_stack.core.rides import RideRecord, delete_rides, write_ride
from robot_stack.middleware.node import StackNode
from robot_stack.recording.black_box import Retention
from robot_stack.recording.ride_messages import RideMessages, add_motion
from robot_stack.recording.rides import RideWatch

_STEP_HZ = 5.0


class RideLog:
    """Files are written beside the tick. A failure is logged and costs the record only.

    Durations are of the steady clock; a step of the system clock shows in the next ride's begin only.
    """

    def __init__(self, node: StackNode, folder: Path, retention_days: float) -> None:
        self._node, self._folder, self._retention = node, folder, Retention(retention_days)
        self._watch, self._messages = RideWatch(load_seat()), RideMessages()
        self._worker = node.worker("rides")
        for row in self._messages.rows:
            node.listen(row, partial(self._on_message, row.name), raw=False)
        node.listen(topics.IMU, lambda message, *_: add_motion(self._watch, message), raw=False)
        node.every(_STEP_HZ, self._step)

    def _on_message(self, topic: str, message: Any, *_: int) -> None:
        self._messages.take(topic, message, self._node.steady_s())

    def _step(self) -> None:
        at_s, now_s = self._node.port.system_s(), self._node.steady_s()
        before_s = self._retention.before_s(at_s, now_s)
        ride = self._watch.step(self._messages.observation(at_s, now_s))
        if ride is not None:
            self._worker.submit(partial(self._write, ride, before_s), self._written)

    def _write(self, ride: RideRecord, before_s: float) -> str:
        try:
            write_ride(self._folder, ride)
            delete_rides(self._folder, before_s)
        except OSError as error:
            return f"the record of the ride {ride.id} cannot be written: {error.strerror or error}"
        return ""

    def _written(self, problem: str) -> None:
        if problem:
            self._node.log_throttled(problem)
