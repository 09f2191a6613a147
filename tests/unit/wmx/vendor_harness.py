"""Engines behind the vendor adapter: the fake module on a simulated engine in a thread, and the vendor's engine."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import ModuleType
from typing import Any

from robot_stack.wmx import MotionEngine, load_library
from robot_stack.wmx.api import AxisCommandMode, EngineState
from robot_stack.wmx.config import AxisKind
from tests.support.wmx.vendor_module import fake_module
from tests.unit.wmx.harness import ESTOP_DEC, N_AXES, Harness, ThreadHarness, engine_config, runtime_folder

LIBRARY_VARIABLE = "ROBOT_STACK_WMX_TEST_LIBRARY"
ROOT_VARIABLE = "ROBOT_STACK_WMX_TEST_ROOT"
N_IO_BYTES = 4


class VendorHarness(ThreadHarness):
    """``config`` selects the vendor's engine; ``module`` is the fake that the adapter imports."""

    def __init__(self, folder: Path, module: ModuleType, **changes: Any) -> None:
        super().__init__(folder, **changes)
        self.module = module
        self.config = self.config.model_copy(
            update={
                "engine": "vendor",
                "library_path": str(Path(str(module.__file__)).parent),
                "vendor_axes": N_AXES,
                "vendor_io_bytes": N_IO_BYTES,
            }
        )


@contextmanager
def vendor_harness(variant: str, more: str = "", **changes: Any) -> Iterator[VendorHarness]:
    """Yields a running engine behind the adapter."""
    with runtime_folder() as folder, fake_module(folder / "module", variant, more) as module:
        harness = VendorHarness(folder, module, **changes)
        try:
            yield harness
        finally:
            harness.stop()


class RealHarness(Harness):
    """The vendor's own engine, its first axes configured like those of the test engine.

    Untested, since no such engine was available. Axes 0 to 4 must be virtual, or machinery that may turn freely.
    """

    def __init__(self, folder: Path) -> None:
        super().__init__(folder)
        self.folder = Path(os.environ.get(ROOT_VARIABLE, "/opt/lmx/"))
        self.config = self.config.model_copy(
            update={
                "engine": "vendor",
                "path": f"{self.folder}/",
                "library_path": os.environ[LIBRARY_VARIABLE],
                "vendor_axes": N_AXES,
                "vendor_io_bytes": N_IO_BYTES,
            }
        )
        self._set_up = False

    def connect(self, name: str = "test") -> MotionEngine:
        """Returns a client. The first one of a test sets the parameters, since the engine forgets them when it ends."""
        client = super().connect(name)
        if not self._set_up:
            self._set_up = True
            for axis, kind in enumerate(engine_config().kinds.values()):
                self._configure(client, axis, kind)
            self._set_stops(client)
        return client

    def engine_state(self) -> EngineState:
        """Returns the state read by a handle without a device. If the call fails, the engine is idle."""
        code, status = load_library(self.config).WMX3Api().GetEngineStatus()
        return EngineState.Idle if code else EngineState(status.state)

    @staticmethod
    def _configure(client: MotionEngine, axis: int, kind: AxisKind) -> None:
        config = client.core_motion.config
        mode = AxisCommandMode.Velocity if kind.mode == "velocity" else AxisCommandMode.Position
        assert client.core_motion.axisControl.SetAxisCommandMode(axis, mode) == 0
        assert config.SetGearRatio(axis, kind.gear_numerator, kind.gear_denominator) == 0
        assert config.SetAxisPolarity(axis, kind.polarity) == 0
        _, feedback = config.GetFeedbackParam(axis)
        feedback.inPosWidth, feedback.posSetWidth = kind.in_pos_width_rad, kind.pos_set_width_rad
        assert config.SetFeedbackParam(axis, feedback)[0] == 0
        _, motion = config.GetMotionParam(axis)
        motion.quickStopDec = kind.quick_stop_dec_radps2
        assert config.SetMotionParam(axis, motion)[0] == 0

    @staticmethod
    def _set_stops(client: MotionEngine) -> None:
        _, stops = client.core_motion.config.GetEmergencyStopParam()
        stops.eStopDec = [ESTOP_DEC] * N_AXES
        assert client.core_motion.config.SetEmergencyStopParam(stops)[0] == 0
