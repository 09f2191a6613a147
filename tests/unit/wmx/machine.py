"""An engine and its virtual drives without a process: cycles by hand, switches at positions set by a test."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

from robot_stack.wmx.api import (
    Config_HomeParam,
    Config_LimitParam,
    DetailOperationState,
    Motion_PosCommand,
    OperationState,
    Profile,
)
from robot_stack.wmx.axes import Flag, Real
from robot_stack.wmx.simulated import rows
from robot_stack.wmx.simulated.engine import Engine
from robot_stack.wmx.simulated.switches import DriveSwitches
from robot_stack.wmx.simulated.virtual_drives import VirtualDrives
from tests.unit.wmx.harness import N_AXES, engine_config

SLOW, FAST, ACC = 0.2, 1.0, 10.0
HOMING = Config_HomeParam(
    homingVelocitySlow=SLOW,
    homingVelocitySlowAcc=ACC,
    homingVelocitySlowDec=ACC,
    homingVelocityFast=FAST,
    homingVelocityFastAcc=ACC,
    homingVelocityFastDec=ACC,
    homeShiftVelocity=0.5,
    homeShiftAcc=ACC,
    homeShiftDec=ACC,
)


class Machine:
    """The test engine, communicating, servos on, at rest at position 0 of every axis."""

    def __init__(self, **changes: Any) -> None:
        config = engine_config(**changes)
        self.drives = VirtualDrives(config.n_axes, config.cycle_time_s, lag_s=0.0)
        self.engine = Engine(config, self.drives)
        self.flags, self.reals = self.engine.arrays.flags, self.engine.arrays.reals

    def restart(self) -> None:
        """Restores the initial state."""
        engine, drives = self.engine, self.drives
        drives.connected, drives.lose_cycles = True, 0
        engine.stop_engine()
        self.run(20)
        fresh = VirtualDrives(drives.n_axes, engine.config.cycle_time_s, lag_s=0.0)
        drives.__dict__.update(fresh.__dict__)
        engine.start_engine()
        engine.start_communication()
        self.run(30)
        assert engine.set_servo_on(range(drives.n_axes), 1) == 0
        self.until(lambda: self.flags[Flag.SERVO_ON].all(), "servos on")

    def run(self, cycles: int) -> None:
        for _ in range(cycles):
            self.engine.cycle()

    def until(self, holds: Callable[[], Any], what: str, cycles: int = 20_000) -> int:
        """Steps until ``holds``."""
        for count in range(cycles):
            if holds():
                return count
            self.engine.cycle()
        raise AssertionError(f"not within {cycles} cycles: {what}")

    def soft_stop(self, axis: int, dec: float) -> None:
        self.engine.motion.stop_axis(axis, dec, DetailOperationState.Stop)

    def rest(self, axis: int) -> None:
        self.until(lambda: self.flags[Flag.OP_STATE, axis] == OperationState.Idle, "at rest")

    def engine_at_rest(self) -> bool:
        return self.engine.at_rest

    def position(self, axis: int) -> float:
        return float(self.reals[Real.ACTUAL_POS, axis])

    def velocity(self, axis: int) -> float:
        return float(self.reals[Real.VELOCITY_CMD, axis])

    def flag(self, row: Flag, axis: int) -> int:
        return int(self.flags[row, axis])

    def counts_per_rad(self, axis: int) -> float:
        return abs(float(self.engine.arrays.params[rows.COUNTS_PER_UNIT, axis]))

    def switches(self, axis: int, **where_rad: float) -> None:
        """Sets the switches of a drive by name, in rad of the drive's own direction from its present position."""
        here, scale = float(self.drives.position[axis]), self.counts_per_rad(axis)
        counts = {name: value * scale + here for name, value in where_rad.items()}
        self.drives.switches[axis] = DriveSwitches(**counts)
        self.run(2)

    def limits(self, axis: int, **fields: Any) -> None:
        assert (
            self.engine.parameters.set("limit", axis, replace(Config_LimitParam(lsDec=10.0, lsSlowDec=2.0), **fields))
            == 0
        )

    def homing(self, axis: int, **fields: Any) -> None:
        assert self.engine.parameters.set("home", axis, replace(HOMING, **fields)) == 0

    def move(self, axis: int, target: float, speed: float = 1.0, acc: float = 10.0) -> int:
        profile = Profile.SetupTrapezoidal(speed, acc, acc)
        return self.engine.motion.start_position(0, [Motion_PosCommand(axis, target, profile)], relative=False)

    def along(self, axis: int, speed: float) -> int:
        """Starts a motion to a far target at a signed speed."""
        return self.move(axis, math.copysign(1000.0, speed), abs(speed))


def machine() -> Machine:
    """Returns a machine for a module's tests, which restart it."""
    made = Machine()
    assert made.drives.n_axes == N_AXES
    return made
