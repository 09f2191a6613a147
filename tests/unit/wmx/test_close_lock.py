"""Devices that cannot be closed immediately."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from robot_stack.wmx.api import EngineState, ErrorCode
from tests.unit.wmx.harness import ThreadHarness, engine_in_thread, status


@pytest.fixture
def harness() -> Iterator[ThreadHarness]:
    with engine_in_thread() as made:
        yield made


def test_a_locked_close_leaves_the_device_open(harness: ThreadHarness) -> None:
    engine = harness.connect()
    harness.server.inject_close_lock(60.0)
    assert engine.api.CloseDevice() == int(ErrorCode.CloseDeviceLockError) == 298
    assert engine.api.IsDeviceValid()
    assert engine.api.SetDeviceName("still here") == 0
    assert "being closed" in engine.api.ErrorToString(ErrorCode.CloseDeviceLockError)
    harness.server.inject_close_lock(0.0)
    assert engine.api.CloseDevice() == 0
    assert not engine.api.IsDeviceValid()


def test_close_outwaits_the_lock(harness: ThreadHarness) -> None:
    one, two = harness.connect("one"), harness.connect("two")
    harness.server.inject_close_lock(0.05)
    one.close()
    assert not one.api.IsDeviceValid()
    assert status(two).engine_state is EngineState.Running
    assert two.api.GetAllDevices()[1].count == 1
    harness.end_test()
