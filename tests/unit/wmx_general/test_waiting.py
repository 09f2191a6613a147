"""Waiting for statuses one by one, and stopping axes singly if a group is refused, without an engine."""

from __future__ import annotations

import logging
from collections.abc import Generator, Sequence
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import pytest

from robot_stack.wmx.api import AxisSelection, CoreMotionErrorCode, EngineState, ErrorCode
from robot_stack.wmx.axes import Flag, StatusSnapshot
from robot_stack.wmx.general.device import SETTLED_CYCLES, Device
from robot_stack.wmx.general.waiting import Waits
from tests.unit.wmx_general.snapshots import standing


class Script:
    """A device that shows statuses set by the test, and a fake clock."""

    def __init__(self) -> None:
        self.now_s = 0.0
        self.shown: tuple[int, StatusSnapshot | None] = (0, standing(cycle_counter=100))

    def read(self) -> tuple[int, StatusSnapshot | None]:
        return self.shown

    def show(self, cycle: int, on: Sequence[int] = (), **fields: Any) -> None:
        snapshot = replace(standing(), **{"cycle_counter": cycle, **fields})
        snapshot.flags[Flag.SERVO_ON] = 0
        snapshot.flags[Flag.SERVO_ON, list(on)] = 1
        self.shown = 0, snapshot


@pytest.fixture
def script() -> Script:
    return Script()


def servo_is_on(snapshot: StatusSnapshot, axis: int) -> int | None:
    return 0 if snapshot.servo_on[axis] else None


def waiting(script: Script, axes: Sequence[int], timeout_s: float = 1.0) -> Generator[None, None, dict[int, int]]:
    return Waits(script, lambda: script.now_s).until(axes, servo_is_on, timeout_s)  # type: ignore[arg-type]


def result(steps: Generator[None, None, dict[int, int]]) -> dict[int, int] | None:
    """Returns the result if the wait ends at this step, otherwise None."""
    try:
        next(steps)
    except StopIteration as end:
        codes: dict[int, int] = end.value
        return codes
    return None


def test_a_status_from_before_the_request_decides_nothing(script: Script) -> None:
    steps = waiting(script, [0])
    for cycle in range(100, 100 + SETTLED_CYCLES + 1):
        script.show(cycle, on=[0])
        assert result(steps) is None
    script.show(100 + SETTLED_CYCLES + 1, on=[0])
    assert result(steps) == {0: 0}


def test_each_axis_has_its_own_end_and_time_runs_out_for_the_rest(script: Script) -> None:
    assert result(waiting(script, [])) == {}
    steps = waiting(script, [0, 1, 2])
    assert result(steps) is None
    script.show(200, on=[1])
    script.now_s = 0.5
    assert result(steps) is None
    script.show(300, on=[2])  # axis 1 has its result and is not checked again
    script.now_s = 1.0
    late = int(CoreMotionErrorCode.WaitTimeout)
    assert result(steps) == {0: late, 1: 0, 2: 0}


def test_a_lost_bus_and_a_lost_device_end_it(script: Script) -> None:
    steps = waiting(script, [0, 1])
    assert result(steps) is None
    script.show(200, engine_state=EngineState.Running)
    assert result(steps) == dict.fromkeys((0, 1), ErrorCode.CommNotStarted)
    script.shown = ErrorCode.DeviceIsNull, None
    assert result(waiting(script, [0])) == {0: ErrorCode.DeviceIsNull}


class Family:
    """The stops of a mode: refuses every group, and axis 2 alone."""

    def __init__(self) -> None:
        self.asked: list[list[int]] = []

    def Stop_AxisSel(self, selection: AxisSelection) -> int:  # noqa: N802 - the vendor's name
        axes = [selection.GetAxis(place) for place in range(selection.axisCount)]
        self.asked.append(axes)
        return 7 if len(axes) > 1 or axes == [2] else 0


def test_a_group_that_is_refused_is_stopped_axis_by_axis() -> None:
    position, velocity = Family(), Family()
    api = SimpleNamespace(GetDeviceID=lambda: (0, 1))
    engine = SimpleNamespace(api=api, core_motion=SimpleNamespace(motion=position, velocity=velocity))
    device = Device("x", lambda *_: engine, logging.getLogger(), 1, 1.0, 1.0)  # type: ignore[arg-type, return-value]
    device.poll(0.0)
    snapshot = standing(4)
    snapshot.flags[Flag.COMMAND_MODE, 3] = 1
    assert device.stop([0, 2, 3], snapshot) == {0: 0, 2: 7, 3: 0}
    assert position.asked == [[0, 2], [0], [2]]
    assert velocity.asked == [[3]]
