"""The vendor adapter without the vendor: probing, a missing library, and the shapes it translates."""

from __future__ import annotations

import sys
import textwrap
from collections.abc import Iterator
from pathlib import Path

import pytest

from robot_stack.wmx import EngineError, connect, load_library
from robot_stack.wmx.api import (
    AxisSelection,
    EngineState,
    Motion_PosCommand,
    Profile,
    Velocity_VelCommand,
)
from robot_stack.wmx.config import ClientConfig
from robot_stack.wmx.vendor.probe import MODULE_NAME, REQUIRED, VendorLibraryError, import_vendor
from tests.unit.wmx.harness import client_config

FAKE = '''
"""Stands in for the vendor's module: same names, and like SWIG it accepts its own value classes only."""
import enum

CALLS = []


class Profile:
    pass


class Motion_PosCommand:
    def __init__(self):
        self.profile = Profile()


class Velocity_VelCommand(Motion_PosCommand):
    pass


class Motion_JogCommand(Motion_PosCommand):
    pass


class Motion_TimedJogCommand(Motion_PosCommand):
    pass


class Velocity_TimedVelCommand(Motion_PosCommand):
    pass


class AxisSelection:
    def __init__(self):
        self.axes = {}

    def SetAxis(self, index, value):
        self.axes[index] = value


def native(value, kind):
    if type(value) is not kind:
        raise TypeError(f"expected {kind.__name__}, got {type(value)}")
    return value


class WMX3Api:
    def CreateDevice(self, path, kind=0, wait=0):
        CALLS.append(("CreateDevice", path))
        return 0

    def SetDeviceName(self, name):
        return 0

    def CloseDevice(self):
        CALLS.append(("CloseDevice",))
        return 0

    def GetDeviceName(self):
        return (0, "vendor")

    @staticmethod
    def ErrorToString(code):
        return "text of %d" % code


class Motion:
    def StartPos(self, command, commands=None):
        for one in [native(command, Motion_PosCommand)] if commands is None else commands:
            native(one, Motion_PosCommand)
            native(one.profile, Profile)
            CALLS.append(("StartPos", one.axis, one.target, one.profile.velocity, one.profile.acc))
        return 0

    def Stop_AxisSel(self, selection):
        native(selection, AxisSelection)
        CALLS.append(("Stop_AxisSel", selection.axisCount, selection.axes))
        return 0


class Velocity:
    def StartVel(self, command):
        native(command, Velocity_VelCommand)
        CALLS.append(("StartVel", command.axis, command.profile.velocity))
        return 0


class AxisStatus:
    def __getattr__(self, name):
        if name.startswith("_"):
            raise AttributeError(name)
        return 0


class Status:
    engineState = 2
    emergencyStop = False
    emergencyStopLevel = 1

    def GetCycleTimeMilliseconds(self, index):
        return 1.0

    def GetCycleCounter(self, index):
        return 5000

    def GetAxesStatus(self, axis):
        status = AxisStatus()
        status.actualPos = 0.5 + axis
        status.servoOn = True
        return status


class CoreMotion:
    def __init__(self, api):
        native(api, WMX3Api)
        self.motion = Motion()
        self.velocity = Velocity()

    def GetStatus(self):
        return (0, Status())


class Io:
    def __init__(self, api):
        native(api, WMX3Api)

    def GetInBytes(self, byte, size):
        return (0, list(range(size)))

    def GetOutBytes(self, byte, size):
        return (0, [255] * size)


class Ecat:
    def __init__(self, api):
        native(api, WMX3Api)

    def ScanNetwork(self):
        CALLS.append(("ScanNetwork",))
        return 0
'''


@pytest.fixture
def config(tmp_path: Path) -> Iterator[ClientConfig]:
    yield client_config(tmp_path).model_copy(update={"engine": "vendor", "library_path": str(tmp_path)})
    sys.modules.pop(MODULE_NAME, None)


@pytest.fixture
def fake(config: ClientConfig, tmp_path: Path) -> ClientConfig:
    (tmp_path / f"{MODULE_NAME}.py").write_text(FAKE, encoding="utf-8")
    return config


class TestProbe:
    def test_missing_library(self, config: ClientConfig) -> None:
        with pytest.raises(EngineError, match=r"WMX3ApiPython was not found in .* set library_path") as raised:
            load_library(config)
        assert "engine: simulated" in str(raised.value), "the way out is named"

    def test_missing_library_on_pythons_own_path(self, config: ClientConfig) -> None:
        with pytest.raises(EngineError, match="library_path is empty"):
            connect("node", config.model_copy(update={"library_path": ""}))

    def test_no_such_folder(self, config: ClientConfig) -> None:
        with pytest.raises(EngineError, match="/nowhere/at/all is no folder"):
            load_library(config.model_copy(update={"library_path": "/nowhere/at/all"}))

    @pytest.mark.parametrize(
        ("source", "message"),
        [
            ("raise OSError('IMDll.so: wrong ELF class')", "does not load: IMDll.so: wrong ELF class"),
            ("import no_such_native_part", "no_such_native_part was not found"),
            ("def broken(:", "does not load"),
            ("WMX3Api = CoreMotion = object", "lacks Io, Ecat, AxisSelection"),
        ],
    )
    def test_unfit_library(self, config: ClientConfig, tmp_path: Path, source: str, message: str) -> None:
        (tmp_path / f"{MODULE_NAME}.py").write_text(textwrap.dedent(source), encoding="utf-8")
        before = list(sys.path)
        with pytest.raises(VendorLibraryError, match=message):
            import_vendor(str(tmp_path))
        assert sys.path == before

    def test_fit_library(self, fake: ClientConfig) -> None:
        module = import_vendor(fake.library_path)
        assert all(hasattr(module, name) for name in REQUIRED)

    def test_nothing_is_imported_unasked(self) -> None:
        import robot_stack.wmx.vendor  # noqa: F401

        assert MODULE_NAME not in sys.modules


class TestAdapter:
    def test_connect_and_close(self, fake: ClientConfig) -> None:
        with connect("node", fake) as engine:
            assert engine.api.GetDeviceName() == (0, "vendor")
            assert engine.api.ErrorToString(7) == "text of 7"
        calls = sys.modules[MODULE_NAME].CALLS
        assert calls == [("CreateDevice", fake.path), ("CloseDevice",)]

    def test_commands_become_the_vendors_objects(self, fake: ClientConfig) -> None:
        engine = connect("node", fake)
        calls = sys.modules[MODULE_NAME].CALLS
        calls.clear()
        profile = Profile.SetupTrapezoidal(3.0, 4.0, 5.0)
        assert engine.core_motion.motion.StartPos(Motion_PosCommand(2, 1.5, profile)) == 0
        assert engine.core_motion.motion.StartPos(2, [Motion_PosCommand(axis, 1.0, profile) for axis in (3, 4)]) == 0
        assert engine.core_motion.velocity.StartVel(Velocity_VelCommand(1, profile)) == 0
        assert engine.core_motion.motion.Stop_AxisSel(AxisSelection.of(5, 6)) == 0
        assert calls == [
            ("StartPos", 2, 1.5, 3.0, 4.0),
            ("StartPos", 3, 1.0, 3.0, 4.0),
            ("StartPos", 4, 1.0, 3.0, 4.0),
            ("StartVel", 1, 3.0),
            ("Stop_AxisSel", 2, {0: 5, 1: 6}),
        ]

    def test_scan_without_a_master(self, fake: ClientConfig) -> None:
        engine = connect("node", fake)
        assert engine.ecat.ScanNetwork(0) == 0
        assert sys.modules[MODULE_NAME].CALLS[-1] == ("ScanNetwork",)

    def test_status_as_arrays(self, fake: ClientConfig) -> None:
        code, snapshot = connect("node", fake).read_status()
        assert code == 0
        assert snapshot.engine_state is EngineState.Communicating
        assert snapshot.n_axes == fake.vendor_axes
        assert snapshot.actual_pos.tolist() == [0.5 + axis for axis in range(8)]
        assert snapshot.servo_on.all()
        assert snapshot.cycle_counter == 5000
        assert snapshot.engine_time_s == pytest.approx(5.0)
        assert snapshot.input_bit(1, 0)
        assert snapshot.output_bit(7, 7)

    def test_unknown_call_is_an_attribute_error(self, fake: ClientConfig) -> None:
        with pytest.raises(AttributeError):
            connect("node", fake).core_motion.motion.NoSuchCall()  # type: ignore[attr-defined]
