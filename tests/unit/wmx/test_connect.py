"""Connecting by configuration: no engine, a late engine, the stack's own folder."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from pathlib import Path

import pytest

from robot_stack.wmx import EngineError, connect, load_library
from robot_stack.wmx.api import CoreMotionErrorCode, EngineState, ErrorCode, error_name, error_text
from robot_stack.wmx.simulated.client import engine_folder
from robot_stack.wmx.simulated.library import simulated_library
from tests.unit.wmx.harness import ThreadHarness, client_config, runtime_folder, status


@pytest.fixture
def folder() -> Iterator[Path]:
    with runtime_folder() as folder:
        yield folder


def test_connect_without_engine_raises_without_blocking(folder: Path) -> None:
    with pytest.raises(EngineError, match="node: cannot create a device: no engine is running there") as raised:
        connect("node", client_config(folder), timeout_s=0.0)
    assert raised.value.code == ErrorCode.IMLibIsNotRunning


def test_waits_for_an_engine_that_comes_later(folder: Path) -> None:
    found: list[EngineState] = []

    def node() -> None:
        with connect("early", client_config(folder)) as engine:
            found.append(status(engine).engine_state)

    thread = threading.Thread(target=node)
    thread.start()
    harness = ThreadHarness(folder)
    try:
        thread.join(30.0)
        assert found == [EngineState.Running]
    finally:
        harness.stop()


def test_context_manager_gives_the_device_back(folder: Path) -> None:
    harness = ThreadHarness(folder)
    try:
        with connect("one", harness.config) as one:
            assert one.api.GetAllDevices()[1].count == 1
        assert not one.api.IsDeviceValid()
    finally:
        harness.stop()


def test_a_device_that_cannot_be_named_is_kept(folder: Path, caplog: pytest.LogCaptureFixture) -> None:
    """Closing it, as the only one, would end the engine that its creation has started."""
    harness = ThreadHarness(folder)
    try:
        with connect("n" * 64, harness.config) as engine:
            assert engine.api.IsDeviceValid()
            assert engine.api.GetAllDevices()[1].count == 1
        assert "the device has no name: " in caplog.text
        harness.end_test()
    finally:
        harness.stop()


def test_vendors_paths_mean_the_stacks_own_folder(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ROBOT_STACK_RUNTIME_DIR", str(folder))
    for path in ("", "/opt/lmx/", "/opt/lmx", "/opt/wmx3/"):
        assert engine_folder(path) == folder
    assert engine_folder("/somewhere/else") == Path("/somewhere/else")
    harness = ThreadHarness(folder)
    try:
        library = load_library(client_config(folder).model_copy(update={"path": ""}))
        api = library.WMX3Api()
        assert api.CreateDevice("/opt/lmx/", 0, 10000) == ErrorCode.PyNone
        assert api.CloseDevice() == ErrorCode.PyNone
    finally:
        harness.stop()


# Numbers confirmed by the vendor's C++ application and public samples, and the numbers derived from them.
NUMBERS = {
    ErrorCode: {
        "PyNone": 0,
        "StartProcessFailed": 256,
        "CreateDeviceLockError": 297,
        "DeviceIsNull": 301,
        "StartCommunicationError": 1288,
        "CommNotStarted": 1537,
        "NotIdleState": 1546,
        "AxisOutOfRange": 1547,
        "IOAddressOutOfRange": 1550,
        "ArgumentOutOfRange": 1555,
        "ServoOff": 1567,
        "AxisHardLimit": 1572,
    },
    CoreMotionErrorCode: {
        "ParameterSettingsInvalid": 65536,
        "CurrentEmergencyStopLevelIsHigher": 65546,
        "NotServoOn": 65556,
        "NotIdleOrVelocityState": 65560,
        "NotVelocityMode": 65572,
        "DecArgumentOutOfRange": 65583,
        "WaitTimeout": 65616,
        "ChannelBufferMemoryNotAllocated": 65627,
        "EmergencyStopSignalOn": 65632,
    },
}


def test_error_numbers_names_and_texts() -> None:
    for kind, numbers in NUMBERS.items():
        assert {name: kind[name].value for name in numbers} == numbers
        assert {name: error_name(number) for name, number in numbers.items()} == {name: name for name in numbers}
    assert error_name(8193) == "ScanNetworkFailed"
    assert error_name(94210) == "SplineStartingPositionNotCurrentPosition"
    assert error_name(424242) == "424242"
    assert error_text(1563, ErrorCode) == "starting previous command"


def test_api_objects_of_one_library_do_not_take_devices_of_another() -> None:
    library = simulated_library(1.0, 0.1)
    with pytest.raises(TypeError, match="must be one of the simulated engine"):
        library.CoreMotion(object())  # type: ignore[arg-type]
