"""An engine, the trajectory server and an action client, with a record of every engine cycle of a motion."""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from robot_stack.wmx import EngineError, MotionEngine, connect
from tests.benchmarks.support.framework import BenchError
from tests.benchmarks.support.own_engine import PRIORITY, Processes, own_environment

if TYPE_CHECKING:
    from tests.benchmarks.nodes.trajectory_client import TrajectoryClient

FloatArray = NDArray[np.float64]
JOINTS = 6
_UP_S = 60.0
_SETTLED_S = 0.15
_SAMPLE_PAUSE_S = 0.0004


@dataclass(frozen=True, slots=True)
class Record:
    """Recorded engine cycles: engine_s (n,), stamp_ns (n,) monotonic, the others (n, joints) rad, rad/s."""

    engine_s: FloatArray
    stamp_ns: NDArray[np.int64]
    command: FloatArray
    position: FloatArray
    command_velocity: FloatArray
    velocity: FloatArray


class Recorder(threading.Thread):
    """Polls the status more often than the engine changes it."""

    def __init__(self, engine: MotionEngine) -> None:
        super().__init__(daemon=True)
        self._engine = engine
        self._end = threading.Event()
        self._seen = -1
        self._rows: list[tuple[float, int, FloatArray]] = []

    def run(self) -> None:
        while not self._end.is_set():
            code, snapshot = self._engine.read_status()
            if not code and snapshot.cycle_counter != self._seen:
                self._seen = snapshot.cycle_counter
                self._rows.append((snapshot.engine_time_s, snapshot.stamp_ns, snapshot.reals[:4, :JOINTS].copy()))
            time.sleep(_SAMPLE_PAUSE_S)

    def finish(self) -> None:
        self._end.set()
        self.join()

    @property
    def record(self) -> Record:
        reals = np.array([row for _, _, row in self._rows])
        return Record(
            np.array([engine_s for engine_s, _, _ in self._rows]),
            np.array([stamp_ns for _, stamp_ns, _ in self._rows], np.int64),
            *(reals[:, quantity] for quantity in (0, 1, 2, 3)),
        )


class ArmRig:
    """The device of this process enables the servos and reads the status; it commands no motion."""

    def __init__(self, engine: MotionEngine, client: TrajectoryClient) -> None:
        self._engine, self._client = engine, client

    def position(self) -> FloatArray:
        """Commanded positions, (joints,) rad."""
        code, snapshot = self._engine.read_status()
        if code:
            raise BenchError(f"engine status: error {code}")
        return np.asarray(snapshot.pos_cmd[:JOINTS]).copy()

    @contextmanager
    def recording(self) -> Iterator[Recorder]:
        """Its record is complete when the block ends."""
        recorder = Recorder(self._engine)
        recorder.start()
        try:
            yield recorder
            time.sleep(_SETTLED_S)
        finally:
            recorder.finish()

    def follow(self, times_s: FloatArray, rows: FloatArray) -> tuple[int, int, str]:
        """Sends a trajectory and waits for its end: (monotonic time of sending in ns, error code, error text)."""
        return self._client.follow(times_s, rows)

    def cancel(self, times_s: FloatArray, rows: FloatArray, after_s: float) -> tuple[int, int]:
        """Sends a trajectory and cancels it: monotonic times of the cancellation and of the result, ns."""
        return self._client.cancel(times_s, rows, after_s)

    @property
    def feedback_errors(self) -> list[float]:
        return self._client.feedback_errors


@contextmanager
def arm_engine(domain: int, engine_module: tuple[str, ...]) -> Iterator[MotionEngine]:
    """An engine with its servos on, in a domain and a runtime folder of its own. Raises BenchError."""
    with ExitStack() as stack:
        environment = stack.enter_context(own_environment(domain))
        stack.enter_context(Processes(environment, PRIORITY)(*engine_module))
        yield stack.enter_context(_servos_on())


@contextmanager
def arm_rig(domain: int, engine: MotionEngine, server_module: tuple[str, ...]) -> Iterator[ArmRig]:
    """A trajectory server and its client at this engine. Raises BenchError."""
    from tests.benchmarks.nodes.trajectory_client import TrajectoryClient

    with Processes(os.environ, PRIORITY)(*server_module), TrajectoryClient(domain) as client:
        yield ArmRig(engine, client)


@contextmanager
def _servos_on() -> Iterator[MotionEngine]:
    try:
        engine = connect("bench", timeout_s=_UP_S)
    except EngineError as error:
        raise BenchError(str(error)) from error
    with engine:
        engine.api.StartCommunication(5000)
        for axis in range(JOINTS):
            engine.core_motion.axisControl.SetServoOn(axis, 1)
        end_s = time.monotonic() + _UP_S
        while not engine.read_status()[1].servo_on[:JOINTS].all():
            if time.monotonic() > end_s:
                raise BenchError("the servos do not come on")
            time.sleep(0.01)
        yield engine
