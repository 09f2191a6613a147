"""The general node's side of the engine: everything that happens in the engine's thread."""

from __future__ import annotations

import re
import time
from collections.abc import Callable

from robot_stack.wmx.api import ErrorCode, OperationState
from robot_stack.wmx.axes import StatusSnapshot, empty_snapshot
from robot_stack.wmx.general.axis_services import AxisServices
from robot_stack.wmx.general.commands import AxisOrder, CommandLimits
from robot_stack.wmx.general.device import Device, OpenEngine
from robot_stack.wmx.general.engine_services import EngineServices
from robot_stack.wmx.general.motion import AxisMotion
from robot_stack.wmx.general.params import GeneralParams
from robot_stack.wmx.general.requests import Refused
from robot_stack.wmx.general.waiting import Waits
from robot_stack.wmx.general.worker import EngineWorker
from robot_stack.wmx.session import Log

_END_POLL_S = 0.005
_END_CALLS_S = 3.0
# Reporting period of a refusal that differs from the previous one only in measured values.
_REPEATED_S = 1.0
_FRACTIONS = re.compile(r"\d+\.\d+")

Move = Callable[[AxisOrder], None]


class GeneralSession:
    """Device, services and motion of the general node, in a separate thread.

    on_status: called in that thread, ``rate_hz`` times per second: from the first tick on with servos off,
    until there is a status, and then while it is valid. Callbacks of the node use ``worker`` for the
    rest, and ``stop`` and ``release`` directly.
    """

    def __init__(
        self,
        name: str,
        params: GeneralParams,
        rate_hz: float,
        open_engine: OpenEngine,
        log: Log,
        on_status: Callable[[StatusSnapshot], None],
    ) -> None:
        self._params, self._log, self._on_status = params, log, on_status
        self.device = Device(
            name, open_engine, log, params.device_attempts, params.device_retry_s, params.probe_period_s
        )
        waits = Waits(self.device, time.monotonic)
        self.axes = AxisServices(self.device, waits, params, lambda: self._stopped)
        self.engine = EngineServices(self.device, waits, params, time.monotonic, lambda: self._stopped, log)
        limits = CommandLimits(params.max_velocity_radps, params.max_acceleration_radps2)
        self.motion = AxisMotion(self.device, params.velocity_timeout_s, limits)
        self.worker = EngineWorker(1.0 / rate_hz, self._tick, self._close)
        self.problem, self.state = "starting", "Unknown"
        self.n_axes: int | None = None
        self.refused = 0
        self.last_refusal = ""
        self._stopped = False
        self._logged = ("", 0.0)
        self._published = (-1, -1)

    # --- from the node's callbacks -----------------------------------------------------------------------------------

    def move(self, topic: str, move: Move, order: AxisOrder) -> None:
        """Executes an order in the engine's thread; a refusal is reported."""
        asked_s = time.monotonic()
        self.worker.order(lambda: self._move(topic, move, order, asked_s))

    def stop(self) -> None:
        """Stops all motion of this node at once and blocks further motion until ``release``."""
        self._stopped = True
        self.worker.order(self._hold, urgent=True)

    def release(self) -> None:
        self._stopped = False

    @property
    def stopped(self) -> bool:
        return self._stopped

    def end(self) -> None:
        """Stops this node's motion and closes the device."""
        self.worker.end(self._params.end_timeout_s + _END_CALLS_S)

    # --- in the engine's thread --------------------------------------------------------------------------------------

    def _tick(self) -> None:
        self.device.poll(time.monotonic())
        code, snapshot = self.device.read()
        if snapshot is None:
            self.problem = f"no status of the engine: {self.device.base_text(code)}"
            if self.n_axes is None:
                self._on_status(empty_snapshot(self._params.axis_count))
            return
        self.n_axes = snapshot.n_axes
        self.problem, self.state = "", snapshot.engine_state.name
        if not snapshot.communicating:
            self._report(snapshot)
            return
        self.device.settle_doubts(snapshot)
        if self._stopped:
            moving = [axis for axis in self.device.moving(snapshot) if not _stopping(snapshot, axis)]
            self._stop_moving(snapshot, moving)
        cycle = (snapshot.epoch, snapshot.cycle_counter)
        if cycle != self._published:  # an unchanged cycle is not published
            self._published = cycle
            self._report(snapshot)

    def _report(self, snapshot: StatusSnapshot) -> None:
        if snapshot.n_axes >= self._params.axis_count:
            self._on_status(snapshot)

    def _hold(self) -> None:
        _, snapshot = self.device.read()
        if snapshot is not None and snapshot.communicating:
            self._stop_moving(snapshot, self.device.moving(snapshot))

    def _stop_moving(self, snapshot: StatusSnapshot, axes: list[int]) -> None:
        for axis, code in self.device.stop(axes, snapshot, quick=True).items():
            if code:
                self._log.error(f"emergency stop of axis {axis}: Error={code} ({self.device.motion_text(code)})")

    def _move(self, topic: str, move: Move, order: AxisOrder, asked_s: float) -> None:
        waited_s = time.monotonic() - asked_s
        try:
            if self._stopped:
                raise Refused("/emergency_stop is in force")
            if waited_s > self._params.command_max_wait_s:
                limit_s = self._params.command_max_wait_s
                raise Refused(f"it waited {waited_s:.2f} s for the engine, at most {limit_s} s")
            move(order)
        except Refused as refused:
            self._refuse(f"{topic} refused: {refused}")

    def _refuse(self, text: str) -> None:
        self.refused += 1
        self.last_refusal = text
        kind, now_s, (logged, logged_s) = _FRACTIONS.sub("#", text), time.monotonic(), self._logged
        if kind != logged or now_s - logged_s > _REPEATED_S:
            self._logged = (kind, now_s)
            self._log.error(text)

    def _close(self) -> None:
        for _ in self.engine.stand(self.device.moving, self._params.end_timeout_s):
            time.sleep(_END_POLL_S)
        if self._params.stop_communication_at_exit and self.device.started_communication:
            self.device.call(lambda engine: engine.api.StopCommunication(0))
        if self.device.engine is not None and self.device.close() != ErrorCode.PyNone:
            self._log.warning("the device could not be closed")


def _stopping(snapshot: StatusSnapshot, axis: int) -> bool:
    return bool(snapshot.op_state[axis] == OperationState.Stop)
