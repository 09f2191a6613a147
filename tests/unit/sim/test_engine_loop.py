"""An engine with its plant in one loop: cycles, faults, tasks, and a shutdown that waits for the clients."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from pathlib import Path

import pytest

from robot_stack.core.config import load
from robot_stack.wmx.api import EngineState
from robot_stack.wmx.config import EngineConfig
from robot_stack.wmx.engine_server.engine import Engine
from robot_stack.wmx.engine_server.server import EngineServer
from sim.plant.engine_loop import EngineLoop, EveryCycles
from sim.plant.fault_table import FaultRefused
from sim.plant.virtual_plant import VirtualPlant
from sim.run.requests import NotServed


class Rig:
    def __init__(self, folder: Path) -> None:
        config = load(EngineConfig, "wmx_engine_general")
        self.plant = VirtualPlant(config)
        self.engine = Engine(config, self.plant.bus)
        self.ticks = 0
        task = EveryCycles(10, self._tick)
        self.loop = EngineLoop(EngineServer(self.engine, folder), self.plant, 0.1, (task,))

    def state(self) -> EngineState:
        return EngineState(self.engine.condition.state)

    def _tick(self) -> None:
        self.ticks += 1

    def cycles(self, count: int) -> None:
        end = self.engine.condition.cycles + count
        self.loop.run(lambda: self.engine.condition.cycles >= end)

    def up(self) -> None:
        self.engine.create_device(0)
        self.engine.start_communication()
        self.cycles(40)
        assert self.state() is EngineState.Communicating

    def inject(self, *fault: object) -> str:
        """Injects a fault as a service does: from another thread, while the loop runs."""
        said: list[str] = []
        asker = threading.Thread(target=lambda: said.append(self.loop.inject(*fault)))  # type: ignore[arg-type]
        asker.start()
        self.loop.run(lambda: not asker.is_alive())
        asker.join()
        return said[0]


@pytest.fixture
def rig(tmp_path: Path) -> Iterator[Rig]:
    rig = Rig(tmp_path)
    yield rig
    rig.loop.server.close()


def test_a_fault_lasts_its_time(rig: Rig) -> None:
    rig.cycles(100)
    assert (rig.engine.condition.cycles, rig.ticks) == (100, 10)
    assert rig.plant.time_s == pytest.approx(0.1)
    rig.up()
    assert rig.inject("encoder_freeze", "axis2", 0.0, 0.02) == "encoder of axis2 repeats its last count for 0.02 s"
    assert rig.plant.bus.frozen.tolist() == [False, False, True, False]
    rig.cycles(30)
    assert not rig.plant.bus.frozen.any()


def test_a_lost_bus_ends_communication_and_comes_back_when_cleared(rig: Rig) -> None:
    rig.up()
    rig.inject("bus_loss", "", 0.0, 0.0)
    rig.cycles(40)
    assert rig.state() is EngineState.Running
    assert rig.inject("clear", "", 0.0, 0.0) == "cleared bus_loss"
    rig.engine.start_communication()
    rig.cycles(40)
    assert rig.state() is EngineState.Communicating


def test_an_alarm_waits_to_be_cleared_by_the_engine(rig: Rig) -> None:
    rig.up()
    rig.inject("drive_alarm", "axis1", 0.0, 0.01)
    rig.cycles(30)
    assert rig.plant.bus.alarms.tolist() == [0, 0x4210, 0, 0]
    rig.engine.clear_amp_alarm([1])
    rig.cycles(30)
    assert not rig.plant.bus.alarms.any()


def test_a_broken_drive_cannot_be_on(rig: Rig) -> None:
    rig.up()
    rig.engine.set_servo_on([0, 1, 2, 3], 1)
    rig.cycles(30)
    assert rig.plant.bus.servo_on.all()
    rig.inject("drive_broken", "axis3", 0.0, 0.0)
    rig.cycles(30)
    assert rig.plant.bus.servo_on.tolist() == [True, True, True, False]


def test_unknown_faults_are_refused_and_a_loop_that_stands_still_is_named(rig: Rig) -> None:
    refused: list[Exception] = []

    def ask() -> None:
        try:
            rig.loop.inject("slip", "", 0.0, 0.0)
        except FaultRefused as error:
            refused.append(error)

    asker = threading.Thread(target=ask)
    asker.start()
    rig.loop.run(lambda: not asker.is_alive())
    assert str(refused[0]).startswith("no fault 'slip'; there are drive_alarm, bus_loss")
    with pytest.raises(NotServed):
        rig.loop.inject("bus_loss", "", 0.0, 0.0, timeout_s=0.01)


@pytest.mark.parametrize("leaves", [True, False])
def test_the_end_waits_for_clients_that_leave(rig: Rig, monkeypatch: pytest.MonkeyPatch, leaves: bool) -> None:
    rig.up()
    if leaves:
        device = next(iter(rig.engine.devices)).id
        rig.loop._tasks = (EveryCycles(50, lambda: rig.engine.remove_device(device)),)
    else:
        monkeypatch.setattr("sim.plant.engine_loop._FAREWELL_S", 0.05)
    begun = rig.engine.condition.cycles
    rig.loop.shut_down()
    assert not leaves or 1 <= rig.engine.condition.cycles - begun <= 60
    assert rig.state() in (EngineState.Shutdown, EngineState.Idle)
