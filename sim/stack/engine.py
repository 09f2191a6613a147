"""The motion engine of a world on the scheduler, as the nodes reach it: devices in the same process.

A call acts at once, between two blocks of the world. The status is as old as the last block; a stalled engine
answers no call and its status becomes stale, as on a socket and in shared memory.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any, Final

from robot_stack.middleware.port import Port
from robot_stack.wmx import EngineError, MotionEngine
from robot_stack.wmx.api import ErrorCode
from robot_stack.wmx.axes import StatusSnapshot, empty_snapshot
from robot_stack.wmx.config import load_client_config
from robot_stack.wmx.engine_server.engine import Engine
from robot_stack.wmx.session import EngineSession
from robot_stack.wmx.simulated.library import library_of
from robot_stack.wmx.view import PATIENCE, RETRY_S
from sim.plant.local_engine import LocalDevice
from sim.plant.simulation import Simulation

_NANOSECONDS: Final = 1e9


class WorldEngine:
    """The engine of ``sim``.

    now_s: virtual time. ``published_s`` is the end of the newest block in which the engine has cycled.
    """

    def __init__(self, engine: Engine, sim: Simulation, now_s: Callable[[], float], *, epoch: int = 1) -> None:
        self.engine, self._sim, self._now_s = engine, sim, now_s
        self._stale_s = load_client_config().status_stale_s
        self._owners: dict[int, Callable[[], bool]] = {}
        self.published_s = now_s()
        self.ended = False
        engine.alive = self._alive
        engine.condition.epoch = epoch

    def end_block(self) -> None:
        if not self._sim.engine_stalled:
            self.published_s = self._now_s()

    @property
    def stalled(self) -> bool:
        return self.ended or self._sim.engine_stalled

    def age_s(self) -> float:
        return self._now_s() - self.published_s

    @property
    def stale(self) -> bool:
        return self.age_s() > self._stale_s

    def open(self, port: Port, responsive: Callable[[], bool]) -> MotionEngine:
        """A device for the node of ``port``. responsive: its process runs. Raises EngineError."""
        device = _Device(self, port)
        library = library_of(lambda: device)
        api = library.WMX3Api()
        code = api.CreateDevice("", 0, 0) or api.SetDeviceName(port.name)
        if code:
            raise EngineError(f"{port.name}: cannot create a device", code, api.ErrorToString(code))
        self._owners[device.number] = responsive
        return MotionEngine(library, api)

    def _alive(self, device: int) -> bool:
        responsive = self._owners.get(device)
        return responsive is None or responsive()


class _Device(LocalDevice):
    """Its stamps are of the monotonic clock of its node."""

    def __init__(self, world: WorldEngine, port: Port) -> None:
        super().__init__(world.engine)
        self._world, self._port = world, port

    @property
    def number(self) -> int:
        return self._session.device

    def call(self, method: str, *arguments: Any) -> tuple[int, list[Any]]:
        if self._world.ended:
            return ErrorCode.IMLibIsNotRunning, []
        return (ErrorCode.APIChannelTimeOut, []) if self._world.stalled else super().call(method, *arguments)

    def snapshot(self) -> tuple[int, StatusSnapshot]:
        code, snapshot = super().snapshot()
        if code:
            return code, empty_snapshot()
        stamp_ns = round(_NANOSECONDS * (self._port.monotonic_s() - self._world.age_s()))
        stale = ErrorCode.StatusChannelError if self._world.stale else ErrorCode.PyNone
        return stale, replace(snapshot, stamp_ns=max(1, stamp_ns))


class ScheduledView:
    """The counterpart of ``EngineView``: the status at ``poll_hz``, by a timer of the node."""

    def __init__(
        self,
        port: Port,
        open_engine: Callable[[], MotionEngine],
        poll_hz: float,
        on_status: Callable[[StatusSnapshot | None], None],
    ) -> None:
        self._port, self._on_status, self._period_s = port, on_status, 1.0 / poll_hz
        self._session = EngineSession(open_engine, PATIENCE)
        self._read_at_s = port.monotonic_s()
        self._timer: Any = None

    @property
    def engine(self) -> MotionEngine | None:
        return self._session.engine

    def start(self) -> None:
        self._timer = self._port.add_real_timer(self._period_s, self._poll)

    def catch_up(self) -> None:
        """Does nothing: the view is always up to date."""

    def close(self) -> None:
        if self._timer is not None:
            self._timer.destroy()
        self._session.close()

    def _poll(self) -> None:
        snapshot, now_s = self._session.read(), self._port.monotonic_s()
        if snapshot is not None:
            self._read_at_s = now_s
        elif now_s >= self._read_at_s + RETRY_S:
            self._session.close()
        self._on_status(snapshot)
        if self._session.engine is None and self._session.connect(now_s):
            self._read_at_s = now_s
