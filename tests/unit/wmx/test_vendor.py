"""The vendor adapter on a fake of the vendor's module: probing, calls, numbers by name, blocks, status, splines."""

from __future__ import annotations

import ast
import subprocess
import sys
import textwrap
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import robot_stack
from robot_stack.wmx import EngineError, MotionEngine, connect, load_library
from robot_stack.wmx import api as port
from robot_stack.wmx.api import (
    AxisCommandMode,
    Config_HomeType,
    CoreMotionErrorCode,
    EngineState,
    ErrorCode,
    EStopLevel,
    OperationState,
    error_name,
)
from robot_stack.wmx.api.surface import BLOCKS, ENGINE_BLOCK
from robot_stack.wmx.axes import Flag, Real
from robot_stack.wmx.config import ClientConfig
from robot_stack.wmx.read_back import differences
from robot_stack.wmx.vendor.names import STRANGER, NumberMap, error_map
from robot_stack.wmx.vendor.probe import MODULE_NAME, VendorLibraryError, import_vendor
from robot_stack.wmx.vendor.snapshots import Age
from tests.support.waiting import wait_for
from tests.support.wmx.vendor_fake import VARIANTS
from tests.support.wmx.vendor_module import fake_module, no_module, write_module
from tests.unit.wmx.conformance import GOOD, pos, vel
from tests.unit.wmx.harness import N_AXES, POS, VEL, client_config, engine_config, status, wait_idle
from tests.unit.wmx.vendor_calls import CALLS, ELSEWHERE, check
from tests.unit.wmx.vendor_harness import VendorHarness, vendor_harness

# The vendor's status field for each row of a snapshot.
_FLAG_FIELDS: dict[Flag, str] = {
    Flag.SERVO_ON: "servoOn",
    Flag.SERVO_REQUESTED: "servoOn",
    Flag.SERVO_OFFLINE: "servoOffline",
    Flag.AMP_ALARM: "ampAlarm",
    Flag.AMP_ALARM_CODE: "ampAlarmCode",
    Flag.FOLLOWING_ERROR_ALARM: "followingErrorAlarm",
    Flag.OP_STATE: "opState",
    Flag.DETAIL_OP_STATE: "detailOpState",
    Flag.COMMAND_MODE: "axisCommandMode",
    Flag.COMMAND_READY: "commandReady",
    Flag.MOTION_COMPLETE: "motionComplete",
    Flag.IN_POS: "inPos",
    Flag.CMD_DISTRIBUTION_END: "cmdDistributionEnd",
    Flag.POS_SET: "posSet",
    Flag.DELAYED_POS_SET: "delayedPosSet",
    Flag.POSITIVE_SOFT_LIMIT: "positiveSoftLimit",
    Flag.NEGATIVE_SOFT_LIMIT: "negativeSoftLimit",
    Flag.HOME_STATE: "homeState",
    Flag.HOME_DONE: "homeDone",
    Flag.ACC_FLAG: "accFlag",
    Flag.DEC_FLAG: "decFlag",
    Flag.ENCODER_COMMAND: "encoderCommand",
    Flag.ENCODER_FEEDBACK: "encoderFeedback",
    Flag.POSITIVE_LS: "positiveLS",
    Flag.NEGATIVE_LS: "negativeLS",
    Flag.HOME_SWITCH: "homeSwitch",
    Flag.HOME_ERROR: "homeError",
}
_REAL_FIELDS: dict[Real, str] = {
    Real.POS_CMD: "posCmd",
    Real.ACTUAL_POS: "actualPos",
    Real.VELOCITY_CMD: "velocityCmd",
    Real.ACTUAL_VELOCITY: "actualVelocity",
    Real.ACTUAL_TORQUE: "actualTorque",
    Real.PROFILE_TARGET_POS: "profileTargetPos",
    Real.PROFILE_REMAINING_MS: "profileRemainingMilliseconds",
    Real.CMD_ACC: "cmdAcc",
    Real.HOME_OFFSET: "homeOffset",
}


@pytest.fixture
def config(tmp_path: Path) -> Iterator[ClientConfig]:
    with no_module():
        yield client_config(tmp_path).model_copy(update={"engine": "vendor", "library_path": str(tmp_path)})


ALL_VARIANTS = pytest.mark.parametrize("variant", list(VARIANTS), indirect=True, scope="module")


@pytest.fixture(scope="module", params=["newer"])
def variant(request: pytest.FixtureRequest) -> Iterator[VendorHarness]:
    with vendor_harness(request.param) as harness:
        yield harness


@pytest.fixture
def harness(variant: VendorHarness) -> Iterator[VendorHarness]:
    control = variant.module.CONTROL
    control.calls.clear()
    control.disorder.clear()
    control.faults.clear()
    yield variant
    variant.end_test()


class TestProbe:
    @pytest.mark.parametrize(
        ("path", "message"),
        [
            (None, r"(?=.*engine: simulated).*WMX3ApiPython was not found in .* set library_path"),
            ("", r"(?=.*engine: simulated).*library_path is empty"),
            ("/nowhere/at/all", r"library_path in config/wmx_client\.yaml: /nowhere/at/all is no folder"),
        ],
    )
    def test_missing_library(self, config: ClientConfig, path: str | None, message: str) -> None:
        changes = {} if path is None else {"library_path": path}
        with pytest.raises(EngineError, match=message) as raised:
            load_library(config.model_copy(update=changes))
        assert "\n" not in str(raised.value)

    @pytest.mark.parametrize(
        ("source", "message"),
        [
            ("raise OSError('IMDll.so: wrong ELF class')", "does not load: IMDll.so: wrong ELF class"),
            ("import no_such_native_part", "no_such_native_part was not found"),
            ("def broken(:", "does not load"),
        ],
    )
    def test_library_that_does_not_load(self, config: ClientConfig, tmp_path: Path, source: str, message: str) -> None:
        (tmp_path / f"{MODULE_NAME}.py").write_text(textwrap.dedent(source), encoding="utf-8")
        before = list(sys.path)
        with pytest.raises(VendorLibraryError, match=message):
            import_vendor(str(tmp_path))
        assert sys.path == before

    @pytest.mark.parametrize(
        ("broken", "message"),
        [
            ("del CoreMotion", "lacks CoreMotion;"),
            ("del Io", "lacks Io or IO;"),
            ("del CoreMotionAxisStatus.actualPos", "lacks CoreMotionAxisStatus.actualPos;"),
            ("del WMX3Api.StartCommunication, Io.GetInBytes", "lacks WMX3Api.StartCommunication, Io.GetInBytes;"),
            ("del type(CoreMotion(WMX3Api()).velocity).StartVel", "lacks CoreMotion.velocity.StartVel;"),
        ],
    )
    def test_unfit_library(self, config: ClientConfig, tmp_path: Path, broken: str, message: str) -> None:
        write_module(tmp_path, "3.5", broken)
        with pytest.raises(EngineError, match=message) as raised:
            load_library(config)
        assert "library_path in config/wmx_client.yaml" in str(raised.value)

    def test_library_from_another_folder_than_the_one_in_use(self, config: ClientConfig, tmp_path: Path) -> None:
        write_module(tmp_path / "one", "3.5")
        write_module(tmp_path / "other", "3.5")
        import_vendor(str(tmp_path / "one"))
        with pytest.raises(VendorLibraryError, match=r"is loaded from .*one.* already, not from .*other"):
            import_vendor(str(tmp_path / "other"))

    def test_parts_that_are_not_needed(self, tmp_path: Path) -> None:
        """A version without a network object, splines and selections can still drive a robot."""
        lacking = "del Ecat, AdvancedMotion\ndel type(CoreMotion(WMX3Api()).motion).Stop_AxisSel"
        with vendor_harness("3.5", lacking) as harness:
            engine = harness.ready()
            unsupported = ErrorCode.NoSupportedFunction
            assert engine.ecat.ScanNetwork(0) == unsupported
            assert engine.advanced_motion.advMotion.CreateSplineBuffer(0, 10) == unsupported
            assert engine.core_motion.motion.Stop_AxisSel(port.AxisSelection.of(POS)) == unsupported
            assert "no such part" in engine.ecat.ErrorToString(unsupported)
            assert engine.core_motion.motion.StartPos(pos(POS, 1.0)) == GOOD
            harness.end_test()

    def test_nothing_is_imported_unasked(self) -> None:
        script = f"import sys, robot_stack.wmx.vendor; sys.exit({MODULE_NAME!r} in sys.modules)"
        assert subprocess.run([sys.executable, "-c", script], check=False).returncode == 0


class TestCalls:
    def test_every_call_of_the_port_is_listed(self) -> None:
        protocols = ("WMX3Api", "AxisControl", "Motion", "Velocity", "Home", "Config", "CoreMotion", "AdvMotion")
        listed = (
            {name.partition(".")[2] for name in CALLS}
            | ELSEWHERE
            | {f"Set{block}" for block in (*BLOCKS, ENGINE_BLOCK)}
        )
        for protocol in (*protocols, "AdvancedMotion", "Io", "Ecat"):
            own = {name for name in vars(getattr(port, protocol)) if name[:1].isupper()}
            assert own <= listed, f"{protocol}: {sorted(own - listed)}"

    @ALL_VARIANTS
    def test_every_call_reaches_the_vendor_with_its_arguments(self, harness: VendorHarness) -> None:
        engine = harness.ready()
        inserted = harness.module.VARIANT.inserted
        for name in CALLS:
            if name == "axisControl.SetAxisCommandMode":
                CALLS[name][0](engine)  # its numbers depend on the variant
            elif not (inserted and "Start" in name and name.startswith(("motion", "velocity"))):
                check(engine, harness.module, name)

    @ALL_VARIANTS
    def test_session_of_a_node_is_in_order(self, harness: VendorHarness) -> None:
        """From connecting to closing, no call reaches the vendor out of order or after the end."""
        control = harness.module.CONTROL
        with connect("node", harness.config) as engine:
            assert engine.read_status()[0] == GOOD
            assert engine.api.StartCommunication(20000) == GOOD
            assert engine.core_motion.axisControl.SetServoOn(VEL, 1) == GOOD
            wait_for(lambda: status(engine).servo_on[VEL], "servo on", poll_s=0.001)
            assert engine.core_motion.velocity.StartVel(vel(VEL, 2.0)) == GOOD
            assert engine.core_motion.velocity.Stop(VEL) == GOOD
            wait_idle(engine, VEL)
        assert control.disorder == control.faults == []
        called = [name for name, _ in control.calls]
        first = ["WMX3Api.IsDeviceValid", "WMX3Api.CreateDevice", "WMX3Api.SetDeviceName"]
        assert called[:3] == first
        assert called[-1] == "WMX3Api.CloseDevice"

    def test_parameters_are_read_back(self, harness: VendorHarness) -> None:
        """The start's comparison reads the vendor's blocks; a value of one axis is named."""
        engine, names = harness.ready(), {axis: f"axis {axis}" for axis in range(N_AXES)}
        config = engine.core_motion.config
        found = [text for text in differences(engine, engine_config().parameters, names) if "cannot be read" in text]
        assert found == []
        code, motion = config.GetMotionParam(VEL)
        assert code == GOOD
        motion.quickStopDec = 12345.0
        assert config.SetMotionParam(VEL, motion)[0] == GOOD
        found = list(differences(engine, engine_config().parameters, names))
        assert f"axis {VEL} (axis {VEL}): quickStopDec is 12345, expected 200" in found

    def test_numbers_of_numpy(self, harness: VendorHarness) -> None:
        """Axes and values are often array elements, but the vendor's wrapper accepts only Python numbers."""
        engine = harness.ready()
        axis = np.arange(N_AXES)[POS]
        assert engine.core_motion.axisControl.SetServoOn(axis, np.int64(1)) == GOOD
        assert engine.core_motion.home.SetCommandPos(axis, np.float64(0.5)) == GOOD
        command = replace(pos(POS, 0.0), axis=axis, target=np.float32(0.25))
        assert engine.core_motion.motion.StartPos(command) == GOOD
        assert engine.io.SetOutBit(np.int32(0), np.int64(2), np.uint8(1)) == GOOD
        assert engine.io.GetOutBit(0, np.int8(2)) == (GOOD, 1)
        points = [port.AdvMotion_SplinePoint(list(row)) for row in np.array([[0.5], [0.75]])]
        command = port.AdvMotion_PointTimeSplineCommand(np.int64(1), [axis])
        splines = engine.advanced_motion.advMotion
        assert splines.CreateSplineBuffer(np.int64(0), np.int64(10)) == GOOD
        wait_idle(engine, POS)
        assert splines.StartCSplinePos_PointTime(0, command, np.int64(2), points, np.array([100.0, 200.0])) == GOOD

    @pytest.mark.parametrize("value", [-1, 256, 2**40])
    def test_number_too_large_for_its_c_type(self, harness: VendorHarness, value: int) -> None:
        engine = harness.ready()
        assert engine.io.SetOutBit(0, 0, value) == ErrorCode.ArgumentOutOfRange
        assert engine.io.GetOutBit(0, 0) == (GOOD, 0)
        if value > 2**32:  # an overloaded call reports only that its arguments are wrong
            assert engine.api.StartCommunication(value) == ErrorCode.ArgumentOutOfRange

    @pytest.mark.parametrize("values", [(99.0,), ()])
    def test_values_of_a_failure_are_not_looked_at(
        self, harness: VendorHarness, monkeypatch: pytest.MonkeyPatch, values: tuple[Any, ...]
    ) -> None:
        native = type(harness.module.CoreMotion(harness.module.WMX3Api()).config)
        failed = harness.module.ErrorCode.CommNotStarted
        monkeypatch.setattr(native, "GetGearRatio", lambda _, __: (failed, *values))
        assert harness.connect().core_motion.config.GetGearRatio(0) == (ErrorCode.CommNotStarted, 0.0, 0.0)

    def test_argument_of_a_wrong_type_is_the_callers_fault(self, harness: VendorHarness) -> None:
        engine = harness.ready()
        with pytest.raises(TypeError):
            engine.core_motion.motion.Stop("one")  # type: ignore[arg-type]
        with pytest.raises(AttributeError):
            engine.core_motion.motion.NoSuchCall()  # type: ignore[attr-defined]

    def test_call_without_timeout_does_not_report_timeout(
        self, harness: VendorHarness, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        """Nodes pass no time and poll the status, so a started operation is no failure."""
        engine, codes = harness.connect(), harness.module.ErrorCode
        native = harness.module.WMX3Api
        started, stopped = codes.CommNotStartedInSpecifiedTime, codes.CommNotStoppedInSpecifiedTime
        monkeypatch.setattr(native, "StartCommunication", lambda _, __: started)
        monkeypatch.setattr(native, "StopCommunication", lambda _, __: stopped)
        engine = harness.connect("again")
        assert engine.api.StartCommunication(0) == engine.api.StopCommunication(0) == GOOD
        assert engine.api.StartCommunication(10) == ErrorCode.CommNotStartedInSpecifiedTime
        assert engine.api.StopCommunication(10) == ErrorCode.CommNotStoppedInSpecifiedTime
        monkeypatch.setattr(native, "StartCommunication", lambda _, __: codes.StartCommunicationError)
        assert harness.connect("third").api.StartCommunication(0) == ErrorCode.StartCommunicationError

    @pytest.mark.parametrize("name", ["StartProcessLockError", "CreateDeviceLockError"])
    def test_lock_that_another_process_holds_is_waited_for(
        self, harness: VendorHarness, monkeypatch: pytest.MonkeyPatch, name: str
    ) -> None:
        native = harness.module.WMX3Api
        original, refusals = native.CreateDevice, [getattr(harness.module.ErrorCode, name)] * 2

        def locked(this: Any, *arguments: Any) -> int:
            return refusals.pop() if refusals else original(this, *arguments)  # type: ignore[no-any-return]

        monkeypatch.setattr(native, "CreateDevice", locked)
        assert harness.connect().api.IsDeviceValid()
        assert refusals == []

    @pytest.mark.parametrize("name", ["SystemInitializationNotDone", "EngineNotStartedInSpecifiedTime"])
    def test_device_that_came_after_its_time(
        self, harness: VendorHarness, monkeypatch: pytest.MonkeyPatch, name: str
    ) -> None:
        native = harness.module.WMX3Api
        original = native.CreateDevice

        def late(this: Any, *arguments: Any) -> int:
            assert original(this, *arguments) == 0
            return getattr(harness.module.ErrorCode, name)  # type: ignore[no-any-return]

        monkeypatch.setattr(native, "CreateDevice", late)
        engine = harness.connect()
        assert engine.api.IsDeviceValid()
        assert engine.api.CreateDevice(str(harness.folder)) == ErrorCode.ResourceInUse


class TestNumbers:
    @ALL_VARIANTS
    def test_codes_have_the_ports_numbers_whatever_the_vendors_are(self, harness: VendorHarness) -> None:
        engine = harness.communicating()
        assert engine.core_motion.motion.StartPos(pos(POS, 1.0)) == CoreMotionErrorCode.NotServoOn
        assert engine.core_motion.motion.Stop(N_AXES) == ErrorCode.AxisOutOfRange
        theirs = harness.module.CoreMotionErrorCode.NotServoOn
        if theirs != CoreMotionErrorCode.NotServoOn:
            assert engine.core_motion.motion.StartPos(pos(POS, 1.0)) != theirs

    @ALL_VARIANTS
    def test_error_text_is_requested_with_vendor_code_of_module(self, harness: VendorHarness) -> None:
        engine, control = harness.connect(), harness.module.CONTROL
        module, code = harness.module, CoreMotionErrorCode.NotServoOn
        assert engine.core_motion.ErrorToString(code) == "the servo is not on"
        assert control.named("CoreMotion.ErrorToString")[-1] == (module.CoreMotionErrorCode.NotServoOn,)
        assert engine.api.ErrorToString(code) == "error code not defined", "another module's code"
        for owner, part in (("WMX3Api", engine.api), ("Io", engine.io), ("Ecat", engine.ecat)):
            assert "being created" in part.ErrorToString(ErrorCode.CreateDeviceLockError)
            assert control.named(f"{owner}.ErrorToString")[-1] == (module.ErrorCode.CreateDeviceLockError,)
        close = port.AdvancedMotionErrorCode.TimeBetweenPointsTooClose
        text = port.error_text(close, port.AdvancedMotionErrorCode)
        assert engine.advanced_motion.ErrorToString(close) == text != "error code not defined"
        assert control.named("AdvancedMotion.ErrorToString")[-1] == (
            module.AdvancedMotionErrorCode.TimeBetweenPointsTooClose,
        )

    def test_unknown_vendor_error_code_is_offset_and_described(self) -> None:
        """The port uses its number under another name, which must not be returned."""
        with vendor_harness("newer") as harness:
            engine, module = harness.connect(), harness.module
            stranger = module.CoreMotionErrorCode.EntryOfANewerVersion
            assert stranger == CoreMotionErrorCode.CurrentEmergencyStopLevelIsHigher
            module.CoreMotion.ReleaseEStop = lambda _: stranger
            code = harness.connect().core_motion.ReleaseEStop()
            assert code == stranger + STRANGER
            assert error_name(code) == str(code)
            module.CoreMotion.ErrorToString = staticmethod(lambda number: f"text of {number}")
            assert engine.core_motion.ErrorToString(code) == f"text of {stranger} (vendor's number {stranger})"
            harness.end_test()

    @ALL_VARIANTS
    def test_states_and_modes(self, harness: VendorHarness) -> None:
        engine = harness.ready()
        assert engine.core_motion.motion.StartPos(pos(POS, 1000.0)) == GOOD
        snapshot = status(engine)
        assert snapshot.op_state[POS] == OperationState.Pos
        assert snapshot.command_mode[[POS, VEL]].tolist() == [AxisCommandMode.Position, AxisCommandMode.Velocity]
        assert engine.core_motion.axisControl.SetAxisCommandMode(VEL, AxisCommandMode.Velocity) == GOOD
        sent = harness.module.CONTROL.named("axisControl.SetAxisCommandMode")[-1]
        assert sent == (VEL, harness.module.AxisCommandMode.Velocity)
        raw = harness.module.CONTROL.named("motion.StartPos")[-1][0]
        assert raw["profile"]["type"] == harness.module.ProfileType.Trapezoidal
        assert engine.core_motion.axisControl.GetAxisCommandMode(VEL) == (GOOD, AxisCommandMode.Velocity)

    def test_number_map(self) -> None:
        numbers = NumberMap({"A": 1, "B": 2, "OnlyOurs": 7}, {"A": 1, "New": 2, "B": 3})
        assert [numbers.ours(number) for number in (1, 2, 3, 9)] == [1, 2 + STRANGER, 2, 9]
        assert [numbers.theirs(number) for number in (1, 2 + STRANGER, 2, 9)] == [1, 2, 3, 9]
        assert numbers.theirs(3) == 3 + STRANGER, "what we call 3 has no name; their 3 is B"

    def test_every_error_of_the_port_comes_back(self) -> None:
        for variant in VARIANTS:
            with vendor_harness(variant) as harness:
                codes = error_map(harness.module)
                for kind in (port.ErrorCode, port.CoreMotionErrorCode, port.AdvancedMotionErrorCode, port.EcErrorCode):
                    theirs = getattr(harness.module, kind.__name__)
                    for member in kind:
                        assert codes.ours(getattr(theirs, member.name)) == member
                        assert codes.theirs(member) == getattr(theirs, member.name)


class TestBlocks:
    def test_vendor_only_parameters_are_preserved(self, harness: VendorHarness) -> None:
        engine = harness.connect()
        native = harness.module.CoreMotion(engine.api.theirs)  # type: ignore[attr-defined]
        _, block = native.config.GetHomeParam(POS)
        block.homingVelocityFast, block.openLoopHoming = 12.5, True
        assert native.config.SetHomeParam(POS, block)[0] == 0
        _, param = engine.core_motion.config.GetHomeParam(POS)
        param.homePosition, param.homeType = 0.75, Config_HomeType.ZPulse
        assert engine.core_motion.config.SetHomeParam(POS, param) == (GOOD, param)
        _, block = native.config.GetHomeParam(POS)
        assert (block.homingVelocityFast, block.openLoopHoming, block.homePosition) == (12.5, True, 0.75)
        assert block.homeType == harness.module.Config_HomeType.ZPulse

    def test_field_that_a_version_lacks(self, tmp_path: Path) -> None:
        with vendor_harness(
            "3.5", "del Config_HomeParam.homePosition; del Config_HomeParam.FIELDS['homePosition']"
        ) as h:
            config = h.connect().core_motion.config
            code, param = config.GetHomeParam(POS)
            assert (code, param.homePosition) == (GOOD, 0.0)
            assert config.SetHomeParam(POS, param) == (ErrorCode.NoSupportedFunction, param)
            assert h.module.CONTROL.faults == [], "nothing is written into thin air"
            h.end_test()


class TestStatus:
    def test_inputs(self, harness: VendorHarness) -> None:
        engine = harness.ready()
        harness.drives.inputs[1] = 5
        snapshot = wait_for(lambda: status(engine) if status(engine).input_bit(1, 2) else None, "the inputs")
        assert [snapshot.input_bit(1, bit) for bit in range(3)] == [True, False, True]
        assert snapshot.age_s(snapshot.stamp_ns) == 0.0

    def test_following_error_is_in_user_units(self, harness: VendorHarness) -> None:
        """The vendor's value is in encoder counts, and 0 if the drive is not configured to send it."""
        engine = harness.ready()
        harness.drives.frozen[POS] = True
        assert engine.core_motion.motion.StartPos(pos(POS, 0.5)) == GOOD
        wait_for(lambda: status(engine).motion_complete[POS], "the command's end", poll_s=0.001)
        snapshot = status(engine)
        assert snapshot.reals[Real.FOLLOWING_ERROR, POS] == snapshot.pos_cmd[POS] - snapshot.actual_pos[POS]
        assert snapshot.reals[Real.FOLLOWING_ERROR, POS] == pytest.approx(0.5, abs=1e-3)
        harness.drives.frozen[POS] = False

    def test_engine_that_does_not_cycle_any_more(self, harness: VendorHarness) -> None:
        config = harness.config.model_copy(update={"status_stale_s": 0.05})
        with connect("node", config) as engine:
            assert engine.api.StartCommunication(20000) == GOOD
            control = harness.module.CONTROL
            control.frozen = 4711
            try:
                wait_for(lambda: engine.read_status()[0] == ErrorCode.StatusChannelError, "a stale status")
            finally:
                control.frozen = None
            assert engine.read_status()[0] == GOOD

    def test_age(self) -> None:
        age = Age(0.1)
        assert age.stamp(7, True, 1_000) == 1_000
        assert age.stamp(7, True, 90_001_000) == 1_000
        assert not age.stale(100_001_000)
        assert age.stale(100_001_001)
        assert age.stamp(7, False, 300_000_000) == 300_000_000, "without the bus nothing counts"
        assert age.stamp(8, True, 400_000_000) == 400_000_000
        assert age.epoch == 0
        age.stamp(3, True, 500_000_000)
        assert age.epoch == 1, "an engine that counts from the beginning is another one"

    def test_every_row_of_a_snapshot(self, harness: VendorHarness) -> None:
        engine = harness.connect()
        native = type(engine.core_motion.theirs)  # type: ignore[attr-defined]
        original = native.GetStatus
        names = dict.fromkeys((*_FLAG_FIELDS.values(), *_REAL_FIELDS.values()))
        values = {name: 100 + index for index, name in enumerate(names)}

        def marked(this: Any) -> Any:
            code, record = original(this)
            record.arrays["axesStatus"][3].values.update(values)
            record.values.update(emergencyStop=True, emergencyStopLevel=1)
            return code, record

        native.GetStatus = marked
        try:
            snapshot = status(engine)
        finally:
            native.GetStatus = original
        assert (snapshot.emergency_stop, snapshot.emergency_stop_level) == (True, EStopLevel.Level1)
        flags = {row: int(snapshot.flags[row, 3]) for row in Flag}
        not_told = {Flag.END_REASON: 0, Flag.OWNER: 0}
        assert flags == {row: values[name] for row, name in _FLAG_FIELDS.items()} | not_told
        reals = {row: snapshot.reals[row, 3] for row in Real if row != Real.FOLLOWING_ERROR}
        assert reals == {row: values[name] for row, name in _REAL_FIELDS.items()}

    def test_dead_bus_has_no_inputs(self, harness: VendorHarness, monkeypatch: pytest.MonkeyPatch) -> None:
        """The vendor's image may hold old inputs, but a normally closed contact must read as open."""
        native = getattr(harness.module, harness.module.VARIANT.io)
        monkeypatch.setattr(native, "GetInBytes", lambda _, __, size: (0, [255] * size))
        engine = harness.communicating()
        assert status(engine).input_bit(0, 0)
        assert engine.api.StopCommunication(20000) == GOOD
        assert not status(engine).input_bit(0, 0)

    def test_unknown_engine_state(self, harness: VendorHarness) -> None:
        engine = harness.connect()
        native = type(engine.core_motion.theirs)  # type: ignore[attr-defined]
        original = native.GetStatus

        def strange(this: Any) -> Any:
            code, record = original(this)
            record.values["engineState"] = 99
            return code, record

        native.GetStatus = strange
        try:
            assert status(engine).engine_state is EngineState.Unknown
        finally:
            native.GetStatus = original


class TestSplines:
    def _start(self, engine: MotionEngine, times_ms: list[float]) -> int:
        command = port.AdvMotion_PointTimeSplineCommand(1, [POS])
        points = [port.AdvMotion_SplinePoint([0.1 * (index + 1)]) for index in range(len(times_ms))]
        start = engine.advanced_motion.advMotion.StartCSplinePos_PointTime
        return start(0, command, len(times_ms), points, times_ms)

    @ALL_VARIANTS
    def test_times_in_the_shape_that_the_version_takes(self, harness: VendorHarness) -> None:
        engine, control = harness.ready(), harness.module.CONTROL
        assert engine.advanced_motion.advMotion.CreateSplineBuffer(0, 10) == GOOD
        for _ in range(2):
            assert self._start(engine, [200.4, 399.6]) == GOOD
            times = control.named("advMotion.StartCSplinePos_PointTime")[-1][4]
            whole = harness.module.VARIANT.spline_times == "uintArray"
            assert times == ([200, 400] if whole else [200.4, 399.6])
            wait_idle(engine, POS)
            assert status(engine).pos_cmd[POS] == pytest.approx(0.2)
            engine.core_motion.home.SetCommandPos(POS, 0.0)

    def test_points_in_one_millisecond(self) -> None:
        with vendor_harness("3.5 with whole milliseconds") as harness:
            engine = harness.ready()
            engine.advanced_motion.advMotion.CreateSplineBuffer(0, 10)
            close = port.AdvancedMotionErrorCode.TimeBetweenPointsTooClose
            assert self._start(engine, [100.1, 100.4]) == close
            assert self._start(engine, [100.0, float("nan")]) == CoreMotionErrorCode.TimeArgumentOutOfRange
            assert self._start(engine, [-1.0, 100.0]) == CoreMotionErrorCode.TimeArgumentOutOfRange
            assert not status(engine).op_state.any()
            harness.end_test()

    def test_version_that_takes_none_of_the_shapes(self) -> None:
        with vendor_harness("newer", "del doubleArray, uintArray") as harness:
            engine = harness.ready()
            assert self._start(engine, [100.0, 200.0]) == ErrorCode.NoSupportedFunction
            assert not status(engine).op_state.any()
            harness.end_test()


class TestNothingBlocks:
    WAITS = frozenset({"Wait", "Wait_AxisSel", "Wait_TimeMilli", "Wait_AxisSel_TimeMilli"})

    def test_no_code_of_the_stack_waits_in_the_engine(self) -> None:
        root = Path(str(robot_stack.__file__)).parent
        found = []
        for path in sorted(root.rglob("*.py")):
            source = path.read_text(encoding="utf-8")
            for node in ast.walk(ast.parse(source)) if "Wait" in source else ():
                if isinstance(node, ast.Attribute) and node.attr in self.WAITS:
                    found.append(f"{path.relative_to(root)}:{node.lineno}")
        assert found == []


class TestTheFake:
    """The fake rejects what the vendor's wrapper rejects. Without that it would prove nothing."""

    @pytest.fixture
    def module(self, tmp_path: Path) -> Iterator[Any]:
        with fake_module(tmp_path, "3.5") as module:
            yield module

    @pytest.mark.parametrize(
        ("code", "error"),
        [
            ("m.CoreMotion('api')", TypeError),
            ("m.CoreMotion(m.WMX3Api()).motion.Stop()", TypeError),
            ("m.CoreMotion(m.WMX3Api()).motion.Stop(np.int64(1))", TypeError),
            ("m.CoreMotion(m.WMX3Api()).motion.Stop(2**31)", OverflowError),
            ("m.CoreMotion(m.WMX3Api()).motion.StartPos(port.Motion_PosCommand())", NotImplementedError),
            ("m.CoreMotion(m.WMX3Api()).motion.Stop_AxisSel([0])", TypeError),
            ("m.Ecat(m.WMX3Api()).ScanNetwork(0)", TypeError),
            ("setattr(m.Profile(), 'type', 0.0)", TypeError),
            ("m.AxisSelection().SetAxis(128, 0)", IndexError),
            ("m.uintArray(1).__setitem__(0, 1.5)", TypeError),
            ("m.CoreMotionStatus().noSuchField", AttributeError),
        ],
    )
    def test_wrong_use_raises(self, module: Any, code: str, error: type[Exception]) -> None:
        with pytest.raises(error):
            eval(code, {"m": module, "np": np, "port": port})

    def test_misspelt_and_missing_fields_are_recorded(self, harness: VendorHarness) -> None:
        """The vendor's proxies accept any attribute."""
        command = harness.module.Motion_PosCommand()
        command.tragte = 1.0
        engine = harness.ready()
        engine.core_motion.theirs.motion.StartPos(harness.module.Motion_PosCommand())  # type: ignore[attr-defined]
        faults = harness.module.CONTROL.faults
        assert faults[0] == "Motion_PosCommand has no field tragte"
        assert "Motion_PosCommand.target was never written" in faults

    def test_wrong_order_is_recorded(self, harness: VendorHarness) -> None:
        module, control = harness.module, harness.module.CONTROL
        api = module.WMX3Api()
        core = module.CoreMotion(api)
        core.motion.Stop(0)
        assert control.disorder == ["motion.Stop before CreateDevice"]
        assert api.CreateDevice(str(harness.folder)) == 0
        core.motion.Stop(0)
        core.config.GetHomeParam(0)
        assert control.disorder[1:] == ["motion.Stop before StartCommunication"]
        assert api.StartCommunication(20000) == 0
        core.motion.Stop(0)
        assert api.CloseDevice() == 0
        core.GetStatus()
        assert control.disorder[2:] == ["CoreMotion.GetStatus after CloseDevice"]
