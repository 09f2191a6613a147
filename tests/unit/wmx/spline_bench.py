"""An engine of six position axes, stepped by hand, and the reference curve of its splines."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from robot_stack.wmx.api import DetailOperationState, ErrorCode, OperationState
from robot_stack.wmx.axes import Flag, Real
from robot_stack.wmx.engine_server.engine import Engine
from robot_stack.wmx.engine_server.virtual_drives import VirtualDrives
from tests.unit.wmx.harness import axis_kind, engine_config

Array = NDArray[np.float64]

N_ARM = 6
CHANNEL = 3
CYCLE_S = 0.001
QUICK_DEC, ESTOP_DEC = 20.0, 40.0
AXES = list(range(N_ARM))
# All axes move during the whole path; the fastest reaches about 2 rad/s.
WAY_MS = [500.0, 1000.0, 1500.0, 2000.0]
WAY = np.array([[0.4], [1.3], [2.2], [2.6]]) * np.array([1.0, -0.8, 0.5, 0.25, -0.6, 0.1])


class Arm:
    """An engine with servos on, all positions 0, and a buffer on CHANNEL."""

    def __init__(self, **kind: Any) -> None:
        motion = {"quick_stop_dec_radps2": QUICK_DEC, "estop_dec_radps2": ESTOP_DEC}
        kinds = {
            "plain": axis_kind(gear_numerator=42467328.0, **{**motion, **kind}),
            "mirrored": axis_kind(gear_numerator=52953088.0, polarity=-1, **{**motion, **kind}),
        }
        axes = [{"name": f"joint{axis + 1}", "kind": "mirrored" if axis % 2 else "plain"} for axis in range(N_ARM)]
        config = engine_config(kinds=kinds, axes=axes)
        self.drives = VirtualDrives(N_ARM, config.cycle_time_s)
        self.engine = Engine(config, self.drives)
        device = self.engine.create_device(0)[1]
        assert device is not None
        self.device = device.id
        self.motion = self.engine.motion
        self.splines = self.engine.motion.splines
        assert self.engine.start_communication() == ErrorCode.PyNone
        self.step(10)
        assert self.engine.set_servo_on(AXES, 1) == ErrorCode.PyNone
        self.step(10)
        assert self.flag(Flag.SERVO_ON).all()
        assert self.splines.create(CHANNEL, 1000) == ErrorCode.PyNone

    def step(self, cycles: int = 1) -> None:
        for _ in range(cycles):
            self.engine.cycle()

    def until(self, holds: Callable[[], Any], cycles: int = 20000) -> int:
        """Steps until ``holds`` and returns the number of cycles."""
        for count in range(cycles):
            if holds():
                return count
            self.step()
        raise AssertionError(f"not within {cycles} cycles")

    def at_rest(self) -> int:
        """Steps until every axis is idle and returns the number of cycles."""
        return self.until(lambda: self.engine.at_rest)

    def flag(self, row: Flag) -> NDArray[np.int64]:
        return self.engine.arrays.flags[row]

    def real(self, row: Real) -> Array:
        return self.engine.arrays.reals[row]

    @property
    def position(self) -> Array:
        return self.real(Real.POS_CMD).copy()

    @property
    def velocity(self) -> Array:
        return self.real(Real.VELOCITY_CMD).copy()

    @property
    def states(self) -> set[int]:
        """Operation states of all axes."""
        return {int(state) for state in self.flag(Flag.OP_STATE)}

    def start(
        self,
        points: Any = WAY,
        times_ms: Sequence[float] = WAY_MS,
        axes: Sequence[int] = tuple(AXES),
        channel: int = CHANNEL,
    ) -> int:
        path = np.array(points, np.float64).reshape(len(times_ms), len(axes))
        return self.motion.start_spline(self.device, channel, list(axes), path, np.array(times_ms, np.float64))

    def soft_stop(self, axis: int = 0, dec: float = 1e-3) -> None:
        """Stops one axis with a low deceleration."""
        self.motion.stop_axis(axis, dec, DetailOperationState.Stop)

    def moving(self, cycles: int = 900) -> Arm:
        """Starts the path and steps until all axes are in motion."""
        assert self.start() == ErrorCode.PyNone
        self.step(cycles)
        assert self.states == {OperationState.Intpl}
        assert (np.abs(self.velocity) > 0.1).all()
        return self


def clamped(points: Any, times_ms: Sequence[float], start: Any = None) -> CubicSpline:
    """Returns the curve from ``start`` at time 0 through the points, at rest at both ends; time in s."""
    path = np.array(points, np.float64).reshape(len(times_ms), -1)
    begin = np.zeros(path.shape[1]) if start is None else np.asarray(start)
    return CubicSpline(np.concatenate(([0.0], np.array(times_ms) * 1e-3)), np.vstack((begin, path)), bc_type="clamped")


def off_path(curve: CubicSpline, position: Array, duration_s: float, axes: Sequence[int] = tuple(AXES)) -> float:
    """Returns the largest deviation of a position from a curve. Dimension 0 is monotonic and gives the path time."""
    low, high = 0.0, duration_s
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if curve(middle)[0] < position[0] else (low, middle)
    return float(np.abs(curve(0.5 * (low + high)) - position)[list(axes)].max())
