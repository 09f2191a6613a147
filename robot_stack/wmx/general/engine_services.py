"""The services of the engine: device, communication, state, emergency stop."""

from __future__ import annotations

from collections.abc import Callable, Generator

from robot_stack.wmx.api import ErrorCode, EStopLevel, OperationState
from robot_stack.wmx.axes import StatusSnapshot
from robot_stack.wmx.failures import ABSENT
from robot_stack.wmx.general.answers import Answer, failure, state_name
from robot_stack.wmx.general.device import Device
from robot_stack.wmx.general.params import GeneralParams
from robot_stack.wmx.general.waiting import Clock, Waits
from robot_stack.wmx.general.worker import Job
from robot_stack.wmx.session import Log

# Resolved by waiting: another client creates a device, or the engine is not ready yet.
_PASSING = ABSENT - {ErrorCode.IMLibIsNotRunning}


class EngineServices:
    """Jobs of one device. ``stopped`` returns whether an emergency stop is active."""

    def __init__(
        self, device: Device, waits: Waits, params: GeneralParams, clock: Clock, stopped: Callable[[], bool], log: Log
    ) -> None:
        self._device, self._waits, self._params, self._clock = device, waits, params, clock
        self._stopped, self._log = stopped, log

    def set_device(self, create: bool, path: str, name: str) -> Job:
        return self._create(path or None, name or self._device.name) if create else self._close()

    def set_comm(self, start: bool) -> Job:
        return self._start() if start else self._stop()

    def get_status(self) -> Job:
        """Always a success; Unknown if the query fails."""
        yield from ()
        engine = self._device.engine
        code, status = engine.api.GetEngineStatus() if engine is not None else (int(ErrorCode.DeviceIsNull), None)
        if status is None or code:
            self._device.check_code(code)
            self._log.warning(f"engine status: Error={int(code)} ({self._device.base_text(code)})")
            return Answer(True, "Unknown")
        return Answer(True, state_name(status.state))

    def estop(self, on: bool) -> Job:
        """The engine's own emergency stop, of all axes, latched."""
        yield from ()
        device = self._device
        if on:
            code = device.call(lambda engine: engine.core_motion.ExecEStop(EStopLevel.Level1))
            if code:
                return failure("Failed to execute emergency stop", code, device.motion_text)
            return Answer(True, "Emergency stop is executed")
        if self._stopped():
            return Answer(False, "Failed to release emergency stop: /emergency_stop is in force")
        code = device.call(lambda engine: engine.core_motion.ReleaseEStop())
        if code:
            return failure("Failed to release emergency stop", code, device.motion_text)
        return Answer(True, "Emergency stop is released")

    # --- device ------------------------------------------------------------------------------------------------------

    def _create(self, path: str | None, name: str) -> Job:
        device = self._device
        if device.engine is not None and device.is_at(path):
            code = device.rename(name)
            return failure("Failed to create device", code, device.base_text) if code else _created(name)
        if device.engine is not None:  # another engine: one device at a time
            yield from self.stand(device.moving, self._params.stop_timeout_s)
            device.close()
        deadline_s = self._clock() + self._params.device_retry_s
        while True:
            error = device.open(path, name)
            if error is None:
                return _created(name)
            if error.code not in _PASSING or self._clock() >= deadline_s:
                return Answer(False, f"Failed to create device. Error={int(error.code)} ({error.text})")
            yield

    def _close(self) -> Job:
        device = self._device
        device.wanted = False
        yield from self.stand(device.moving, self._params.stop_timeout_s)
        code = device.close()
        return failure("Failed to close device", code, device.base_text) if code else Answer(True, "Device stopped")

    # --- communication -----------------------------------------------------------------------------------------------

    def _start(self) -> Job:
        device = self._device
        _, before = device.read()
        code = device.call(lambda engine: engine.api.StartCommunication(0))
        if not code:
            late = int(ErrorCode.CommNotStartedInSpecifiedTime)
            timeout_s = self._params.communication_timeout_s
            code = yield from self._waits.engine(lambda snapshot: snapshot.communicating, timeout_s, late)
        if code:
            return failure("Failed to start communication", code, device.base_text)
        if before is not None and not before.communicating:
            device.started_communication = True
        return Answer(True, "Communication is started")

    def _stop(self) -> Job:
        """Stops every axis first, because a bus that ends cuts motions off without a ramp."""
        device = self._device
        yield from self.stand(_moving, self._params.stop_timeout_s)
        code = device.call(lambda engine: engine.api.StopCommunication(0))
        if not code:
            late = int(ErrorCode.CommNotStoppedInSpecifiedTime)
            timeout_s = self._params.communication_timeout_s
            code = yield from self._waits.engine(lambda snapshot: not snapshot.communicating, timeout_s, late)
        if code:
            return failure("Failed to stop communication", code, device.base_text)
        device.started_communication = False
        return Answer(True, "Communication is stopped")

    def stand(self, which: Callable[[StatusSnapshot], list[int]], timeout_s: float) -> Generator[None, None, None]:
        """Stops the axes that ``which`` names and waits for them, at most ``timeout_s``."""
        _, snapshot = self._device.read()
        if snapshot is None or not snapshot.communicating:
            return
        axes = which(snapshot)
        self._device.stop(axes, snapshot)

        def decided(now: StatusSnapshot, axis: int) -> int | None:
            return 0 if now.op_state[axis] == OperationState.Idle else None

        yield from self._waits.until(axes, decided, timeout_s)


def _moving(snapshot: StatusSnapshot) -> list[int]:
    return [axis for axis in range(snapshot.n_axes) if snapshot.op_state[axis] != OperationState.Idle]


def _created(name: str) -> Answer:
    return Answer(True, f"Created a device with name: {name}")
