"""World, engine, sensors and faults in lockstep, stepped by a process, a scenario or a test."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

import numpy as np

from robot_stack.contract import topics
from robot_stack.core.robot import Robot
from sim.params import SimParams
from sim.plant.battery import BatteryModel
from sim.plant.charging import ChargingContacts
from sim.plant.fault_table import FaultRefused
from sim.plant.imu import ImuModel, ImuSample
from sim.plant.world import Setup, World

_BATTERY_PERIOD_STEPS = 10
_CONTACTS_PERIOD_STEPS = 100


class Simulation:
    """One ``step`` is one cycle of 1 ms: engine, drives, physics, sensors.

    ``engine_cycle`` is called first in each step and exchanges with ``world.drives``; ``engine_begin`` and
    ``engine_end`` around a block of steps, to serve its clients. None of them while ``engine_stalled``.
    """

    def __init__(self, robot: Robot, params: SimParams, setup: Setup) -> None:
        self.world = World(robot, params, setup)
        random = self.world.sensor_random()
        dt_s = self.world.dt_s
        period_steps = round(1.0 / (topics.IMU.nominal_rate_hz * dt_s))
        self.imu = ImuModel(params.imu, period_steps, dt_s, random, setup.inclination_wxyz())
        self.battery = BatteryModel(params.battery, np.random.default_rng(random.integers(2**63)))
        self.contacts = ChargingContacts(setup.world)
        self.engine_cycle: Callable[[], None] = _no_engine
        self.engine_begin: Callable[[], None] = _no_engine
        self.engine_end: Callable[[], None] = _no_engine
        self.engine_stalled = False
        self.processes: StackProcesses = _NoProcesses()
        self._readings = self.world.data.sensordata[:6]
        self._orientation = self.world.data.qpos[3:7]

    @property
    def time_s(self) -> float:
        return self.world.time_s

    def begin_block(self) -> None:
        """Call before one or more steps."""
        if not self.engine_stalled:
            self.engine_begin()

    def end_block(self) -> None:
        """Call after them."""
        if not self.engine_stalled:
            self.engine_end()

    def step(self) -> ImuSample | None:
        """One cycle. Returns the inertial unit's sample of this cycle, if any. Raises SimulationDiverged."""
        if not self.engine_stalled:
            self.engine_cycle()
        world = self.world
        world.step()
        self.imu.measure(world.time_s, self._readings, self._orientation)
        if world.steps % _CONTACTS_PERIOD_STEPS == 0:
            self.battery.contacts_w = self.contacts.power_w(world.truth().pose())
        if world.steps % _BATTERY_PERIOD_STEPS == 0:
            speeds = world.joint_speeds_radps()
            self.battery.draw(world.drives.motor_torques_nm, speeds, _BATTERY_PERIOD_STEPS * world.dt_s)
        return self.imu.sample(world.time_s)


class StackProcesses(Protocol):
    """The processes of the stack, for faults. Raises FaultRefused for an unknown name."""

    def kill(self, name: str) -> None: ...
    def stop(self, name: str) -> None: ...
    def resume(self, name: str) -> None: ...


class _NoProcesses:
    """For a simulation without other processes."""

    def kill(self, name: str) -> None:
        raise FaultRefused("this simulation runs beside no processes")

    stop = kill

    def resume(self, name: str) -> None:
        """Does nothing: no process was stopped."""


def _no_engine() -> None:
    """A world without an engine: its drives stay off."""
