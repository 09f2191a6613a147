"""A simulated motion engine in its own process, with inputs and faults set by the test."""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

from robot_stack.wmx import EngineError, MotionEngine, connect
from robot_stack.wmx.config import load_engine_config
from tests.support.processes import ROOT, NodeProcess
from tests.support.waiting import wait_for

BUTTON_RELEASED, BUTTON_PRESSED = 1, 0


class TestEngine:
    """The engine process and a device on it. The device only starts bus and servos and clears alarms."""

    __test__ = False

    def __init__(self, start: Callable[..., NodeProcess], folder: Path) -> None:
        self._start = start
        self._control = folder / "engine_control.json"
        self._requested: dict[str, Any] = {"input0": BUTTON_RELEASED, "alarms": {}, "connected": True}
        self._device: MotionEngine | None = None
        self.process: NodeProcess | None = None

    def run(self) -> TestEngine:
        """Starts the process without starting communication."""
        self.set()
        script = ROOT / "tests" / "nodes" / "scripts" / "engine_process.py"
        self.process = self._start("engine", command=[sys.executable, str(script), str(self._control)])
        self._device = wait_for(self._try_connect, "a device on the engine", 60.0)
        return self

    def up(self) -> TestEngine:
        """Starts the bus and switches the servos on."""
        assert self.device.api.StartCommunication(5000) == 0
        self.servos(1)
        return self

    def servos(self, on: int) -> None:
        for axis in range(self.n_axes):
            assert self.device.core_motion.axisControl.SetServoOn(axis, on) == 0
        wait_for(lambda: all(self.device.read_status()[1].servo_on) == bool(on), f"servos {on}")

    def set(self, **requested: Any) -> None:
        """Changes the inputs and faults: ``input0``, ``alarms``, ``connected``."""
        self._requested |= requested
        beside = self._control.with_suffix(".new")
        beside.write_text(json.dumps(self._requested))
        os.replace(beside, self._control)

    def kill(self) -> None:
        assert self.process is not None
        self.process.process.kill()
        self.process.process.wait()

    def close(self) -> None:
        if self._device is not None:
            self._device.close()

    @property
    def n_axes(self) -> int:
        """Number of axes in the active configuration: 8 unless ROBOT_STACK_WMX_ENGINE_CONFIG names another."""
        return load_engine_config().n_axes

    @property
    def device(self) -> MotionEngine:
        assert self._device is not None
        return self._device

    def _try_connect(self) -> MotionEngine | None:
        try:
            return connect("test", timeout_s=0.0)
        except EngineError:
            return None
