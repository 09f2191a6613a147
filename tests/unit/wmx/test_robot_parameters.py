"""The robot's parameters of the engine: from config/robot.yaml to a file, into an engine and back."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from robot_stack.cli.app import app
from robot_stack.contract.frames import JOINTS, STEER_AXES
from robot_stack.core.config import ConfigError, validate
from robot_stack.core.robot import Robot, load_robot
from robot_stack.wmx import MotionEngine
from robot_stack.wmx.api import (
    AxisCommandMode,
    Config_EStopSignalSource,
    Config_HomeType,
    CoreMotionErrorCode,
    EngineState,
    EStopLevel,
    Motion_PosCommand,
    OperationState,
    Profile,
    Velocity_VelCommand,
)
from robot_stack.wmx.axes import Flag, Real
from robot_stack.wmx.config import EngineParameters
from robot_stack.wmx.engine_server.engine import Engine
from robot_stack.wmx.home_steering import HomingError, home_axes
from robot_stack.wmx.parameter_blocks import file_values
from robot_stack.wmx.read_back import differences
from robot_stack.wmx.robot_parameters import robot_parameters, write_parameters
from robot_stack.wmx.simulated.parameter_file import read_file
from tests.support.local_engine import new_device, new_engine

ROBOT = load_robot()
PARAMETERS = robot_parameters(ROBOT)
NAMES = dict(enumerate(JOINTS))
STEERING = {axis: JOINTS[axis] for axis in STEER_AXES}


def robot(**changes: Any) -> Robot:
    """The robot with other values. changes: of a section by its name, merged into it."""
    data = ROBOT.model_dump()
    for section, values in changes.items():
        for name, value in values.items():
            data[section][name] = {**data[section][name], **value} if isinstance(value, dict) else value
    return validate(Robot, data, "robot.yaml")


class Bench:
    """An engine with a device, communicating. Cycles are counted in seconds of its time."""

    def __init__(self, parameters: EngineParameters | None = PARAMETERS) -> None:
        self.engine: Engine = new_engine()
        self.device: MotionEngine = new_device(self.engine)
        assert self.device.api.StartCommunication(0) == 0
        self.run(0.1)
        assert self.engine.condition.state is EngineState.Communicating
        if parameters is not None:
            values = file_values(parameters)
            assert self.engine.parameter_set.apply(values.of_engine, values.of_axes, communicating=True) == 0

    def run(self, seconds: float) -> None:
        for _ in range(round(seconds * 1000)):
            self.engine.cycle()

    def servos_on(self) -> Bench:
        for axis in range(8):
            assert self.device.core_motion.axisControl.SetServoOn(axis, 1) == 0
        self.run(0.1)
        return self

    def real(self, row: Real, axis: int) -> float:
        return float(self.engine.arrays.reals[row, axis])


class TestExport:
    def test_file_holds_the_robots_values(self, tmp_path: Path) -> None:
        written = tmp_path / "robot.xml"
        assert CliRunner().invoke(app, ["wmx", "export", str(written)]).exit_code == 0
        assert read_file(str(written), 8) == file_values(PARAMETERS)

    def test_values_reach_an_engine(self) -> None:
        engine = Bench().engine
        modes = [AxisCommandMode.Velocity, AxisCommandMode.Position] * 4
        assert engine.arrays.flags[Flag.COMMAND_MODE].tolist() == modes
        wheel = ROBOT.emergency_deceleration_mps2 / ROBOT.wheel_radius_m
        stop = engine.parameters.emergency_stop
        assert stop.eStopDec == pytest.approx([wheel, ROBOT.steer.emergency_deceleration_radps2] * 4)
        assert engine.parameters.gear == [(16384.0, math.tau), (65536.0, math.tau)] * 4
        edge = ROBOT.safety_edge
        assert edge is not None
        assert (stop.enableEStopSignal, stop.invertEStopSignalPolarity) == (True, True), "normally closed"
        assert (stop.eStopSignalByteAddress, stop.eStopSignalBitAddress) == (edge.byte, edge.relay_input_bit)
        assert (stop.eStopSignalSource, stop.eStopSignalLevel) == (Config_EStopSignalSource.Input, EStopLevel.Level1)

    def test_gear_polarity_and_zero(self) -> None:
        without_edge = validate(Robot, {**ROBOT.model_dump(), "safety_edge": None}, "robot.yaml")
        assert robot_parameters(without_edge).estop_signal is None
        geared = robot(
            drive={"encoder_counts_per_rev": 131072, "gear_numerator": 25.0, "gear_denominator": 2.0},
            axes={"fr_drive": {"polarity": -1}, "rl_steer": {"zero_rad": 0.25}},
        )
        axes = robot_parameters(geared).axes
        assert axes[0].counts_per_rad == pytest.approx(131072 * 12.5 / math.tau)
        assert axes[2].counts_per_rad == -axes[0].counts_per_rad
        assert [axis.home_offset_rad for axis in axes] == [0.0] * 5 + [0.25] + [0.0] * 2

    def test_axes_between_the_robots_keep_the_vendors_defaults(self) -> None:
        axes = robot_parameters(robot(axes={"rr_steer": {"number": 9}})).axes
        assert len(axes) == 10
        assert [axis.estop_dec_radps2 for axis in axes[7:9]] == [100000.0] * 2
        assert axes[9].mode == "position"

    def test_homing_of_the_steering(self) -> None:
        switch = robot(steer={"absolute_encoder": False, "homing": {"type": "home_switch", "direction": "negative"}})
        bench = Bench(robot_parameters(switch))
        code, home = bench.device.core_motion.config.GetHomeParam(1)
        assert (code, home.homeType, home.homingVelocityFast) == (0, Config_HomeType.HS, 0.5)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"axes": {"fl_steer": {"number": 0}}}, "axes.fl_steer.number 0 is fl_drive's too"),
        ({"axes": {"fl_steer": {"polarity": 0}}}, "axes.fl_steer.polarity: Input should be 1 or -1"),
        ({"axes": {"fl_drive": {"zero_rad": 0.1}}}, "axes.fl_drive.zero_rad must be 0 without an absolute encoder"),
        ({"drive": {"gear_numerator": 1e6}}, "must be within 1..2147483647, the engine's gear ratios, is 1.6384e\\+10"),
        ({"steer": {"homing": {"type": "limit_switch"}}}, "steer.homing.type: Input should be 'current_position' or"),
    ],
)
def test_wrong_axes_are_refused(changes: dict[str, Any], message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        robot(**changes)


@pytest.mark.parametrize("message", ["axes must have the joints .*; arm is no joint", "; rr_drive is missing"])
def test_axes_are_those_of_the_joints(message: str) -> None:
    data = ROBOT.model_dump()
    axes = data["axes"]
    if "arm" in message:
        axes["arm"] = {**axes["rr_drive"], "number": 9}
    else:
        del axes["rr_drive"]
    with pytest.raises(ConfigError, match=message):
        validate(Robot, data, "robot.yaml")


class TestReadBack:
    def test_imported_parameters_have_no_difference(self) -> None:
        assert list(differences(Bench().device, PARAMETERS, NAMES)) == []

    def test_an_engine_that_has_just_started_differs_in_every_axis(self) -> None:
        """Without an import 12 rad/s would be 12 encoder counts/s, and the emergency stop a step."""
        found = list(differences(Bench(None).device, PARAMETERS, NAMES))
        assert "engine: enableEStopSignal is 0, expected 1" in found
        assert "axis 0 (fl_drive): gearRatioNumerator is 1, expected 16384" in found
        assert "axis 0 (fl_drive): eStopDec is 100000, expected 24.24242424" in found
        assert "axis 7 (rr_steer): absoluteEncoderMode is 0, expected 1" in found
        for axis, name in NAMES.items():
            of_axis = [text for text in found if text.startswith(f"axis {axis} ({name}): ")]
            assert any("gearRatioNumerator" in text for text in of_axis)
            assert any("quickStopDec" in text for text in of_axis)

    @pytest.mark.parametrize(
        ("changes", "text"),
        [
            ({"gear_numerator": 16385.0}, "gearRatioNumerator is 16385, expected 16384"),
            ({"polarity": -1}, "axisPolarity is -1, expected 1"),
            ({"absolute_encoder": True}, "absoluteEncoderMode is 1, expected 0"),
            ({"estop_dec_radps2": 24.0}, "eStopDec is 24, expected 24.24242424"),
            ({"quick_stop_dec_radps2": 24.0}, "quickStopDec is 24, expected 24.24242424"),
            ({"servo_off_during_alarm": False}, "servoOffDuringAmpAlarm is 0, expected 1"),
        ],
    )
    def test_one_value_of_one_axis_is_named(self, changes: dict[str, Any], text: str) -> None:
        axes = (*PARAMETERS.axes[:4], PARAMETERS.axes[4].model_copy(update=changes), *PARAMETERS.axes[5:])
        bench = Bench(replace(PARAMETERS, axes=axes))
        assert list(differences(bench.device, PARAMETERS, NAMES)) == [f"axis 4 (rl_drive): {text}"]

    def test_other_axes_of_the_engine_are_not_compared(self) -> None:
        bench = Bench()
        moved = robot_parameters(robot(axes={"fl_steer": {"zero_rad": 0.25}}))
        expected = ["axis 1 (fl_steer): absoluteEncoderHomeOffset is 0, expected 0.25"]
        assert list(differences(bench.device, moved, NAMES)) == expected
        assert bench.engine.set_gear(7, 1.0, 1.0) == 0
        assert list(differences(bench.device, PARAMETERS, {axis: NAMES[axis] for axis in range(7)})) == []

    def test_an_axis_that_the_engine_does_not_have(self) -> None:
        wide = robot_parameters(robot(axes={"rr_steer": {"number": 9}}))
        names = {axis: joint for joint, axis in zip(JOINTS, (*range(7), 9), strict=True)}
        assert list(differences(Bench().device, wide, names)) == ["axis 9 (rr_steer): the engine has no such axis"]

    def test_a_device_that_is_gone(self) -> None:
        bench = Bench()
        bench.device.close()
        found = list(differences(bench.device, PARAMETERS, NAMES))
        assert found == ["axis parameters cannot be read: DeviceIsNull (error 301)"]


def test_an_engine_without_the_import_turns_by_counts() -> None:
    """The same command with and without the robot's parameters: 12 rad/s, or 12 encoder counts/s."""
    counts = []
    for parameters in (None, PARAMETERS):
        bench = Bench(parameters).servos_on()
        mode = bench.device.core_motion.axisControl.SetAxisCommandMode(0, AxisCommandMode.Velocity)
        assert mode == 0
        command = Velocity_VelCommand(0, Profile.SetupTrapezoidal(12.0, 1000.0, 1000.0))
        assert bench.device.core_motion.velocity.StartVel(command) == 0
        bench.run(1.0)
        counts.append(int(bench.engine.arrays.flags[Flag.ENCODER_FEEDBACK, 0]))
    assert counts[0] == pytest.approx(12, abs=1)
    assert counts[1] == pytest.approx(12.0 * 16384 / math.tau, rel=0.02)


class SwitchHoming:
    """Axes that search for their switches without end."""

    def __init__(self, refused: int | None) -> None:
        self.refused = refused
        self.started: list[int] = []
        self.cancelled: list[int] = []

    def StartHome(self, axis: int) -> int:
        if axis == self.refused:
            return int(CoreMotionErrorCode.EmergencyStopSignalOn)
        self.started.append(axis)
        return 0

    def Cancel(self, axis: int) -> int:
        self.cancelled.append(axis)
        return 0


class TestHoming:
    INCREMENTAL = robot_parameters(robot(steer={"absolute_encoder": False}))

    @pytest.fixture
    def bench(self) -> Bench:
        return Bench(self.INCREMENTAL).servos_on()

    def home(self, bench: Bench, timeout_s: float = 1.0) -> dict[str, float]:
        return home_axes(bench.device, STEERING, NAMES, pause=bench.run, timeout_s=timeout_s)

    def test_absolute_encoders_need_none(self) -> None:
        assert Bench().engine.arrays.flags[Flag.HOME_DONE, list(STEERING)].all()

    def test_present_headings_become_straight_ahead(self, bench: Bench) -> None:
        turn = Motion_PosCommand(1, 0.4, Profile.SetupTrapezoidal(4.0, 40.0, 40.0))
        assert bench.device.core_motion.motion.StartPos(turn) == 0
        bench.run(1.0)
        assert not bench.engine.arrays.flags[Flag.HOME_DONE, list(STEERING)].any()
        offsets = self.home(bench)
        assert list(offsets) == list(STEERING.values())
        assert offsets["fl_steer"] == pytest.approx(0.4, abs=1e-3)
        assert bench.engine.arrays.flags[Flag.HOME_DONE, list(STEERING)].all()
        assert bench.real(Real.ACTUAL_POS, 1) == pytest.approx(0.0, abs=1e-3)
        counts = bench.engine.arrays.flags[Flag.ENCODER_FEEDBACK, 1]
        assert counts == pytest.approx(0.4 * 65536 / math.tau, abs=20), "nothing moved"

    def test_zero_of_an_absolute_encoder_for_the_robots_file(self) -> None:
        """What ``robot-stack wmx home`` prints makes the next start begin at that zero."""
        bench = Bench().servos_on()
        turn = Motion_PosCommand(3, -0.3, Profile.SetupTrapezoidal(4.0, 40.0, 40.0))
        assert bench.device.core_motion.motion.StartPos(turn) == 0
        bench.run(1.0)
        zero_rad = self.home(bench)["fr_steer"]
        values = file_values(robot_parameters(robot(axes={"fr_steer": {"zero_rad": zero_rad}})))
        assert bench.engine.parameter_set.apply(values.of_engine, values.of_axes, communicating=True) == 0
        assert bench.real(Real.ACTUAL_POS, 3) == pytest.approx(0.0, abs=1e-3)

    def test_a_moving_robot_is_refused(self, bench: Bench) -> None:
        command = Velocity_VelCommand(0, Profile.SetupTrapezoidal(1.0, 10.0, 10.0))
        assert bench.device.core_motion.velocity.StartVel(command) == 0
        bench.run(0.2)
        with pytest.raises(HomingError, match="the robot must stand, these move: fl_drive"):
            self.home(bench)

    def test_a_robot_at_rest_under_the_drive_stands(self, bench: Bench) -> None:
        """The drive commands velocity 0 in every cycle, which is a motion for the engine."""
        for speed in (1.0, 0.0):
            command = Velocity_VelCommand(0, Profile.SetupTrapezoidal(speed, 10.0, 10.0))
            assert bench.device.core_motion.velocity.StartVel(command) == 0
            bench.run(0.5)
        assert bench.engine.arrays.flags[Flag.OP_STATE, 0] == OperationState.Velocity
        assert set(self.home(bench)) == set(STEERING.values())

    def test_steering_that_the_drive_commands_at_the_moment_is_homed_after_it(self, bench: Bench) -> None:
        status = bench.device.read_status

        def read_status() -> Any:
            before = status()
            if not bench.engine.arrays.flags[Flag.HOME_DONE].any():
                hold = Motion_PosCommand(5, 0.001, Profile.SetupTrapezoidal(4.0, 40.0, 40.0))
                assert bench.device.core_motion.motion.StartPos(hold) == 0
                bench.run(0.002)
            return before

        bench.device.read_status = read_status  # type: ignore[method-assign]
        assert set(self.home(bench)) == set(STEERING.values())
        assert bench.engine.arrays.flags[Flag.HOME_DONE, list(STEERING)].all()

    @pytest.mark.parametrize(
        ("fault", "message"),
        [
            ("refusal", "fr_steer: EmergencyStopSignalOn"),
            ("status", "engine status: "),
            ("interruption", "^$"),
            ("timeout", "not homed within 0.3 s: fl_steer, fr_steer, rl_steer, rr_steer"),
            ("emergency stop", "fl_steer: EmergencyStopSignalOn"),
            ("alarm", "fl_steer: AxisAmpAlarm"),
        ],
    )
    def test_homing_that_ends_early_is_cancelled(self, bench: Bench, fault: str, message: str) -> None:
        """Axes that turn towards their home switch stop."""
        home = SwitchHoming(refused=3 if fault == "refusal" else None)
        bench.device.core_motion.home = home  # type: ignore[assignment]

        def pause(seconds: float) -> None:
            bench.run(seconds)
            if fault == "status":
                bench.device.close()
            elif fault == "interruption":
                raise KeyboardInterrupt
            elif fault == "emergency stop":
                assert bench.device.core_motion.ExecEStop(EStopLevel.Level1) == 0
            elif fault == "alarm":
                bench.engine.arrays.flags[Flag.AMP_ALARM, 1] = 1

        with pytest.raises((HomingError, KeyboardInterrupt), match=message):
            home_axes(bench.device, STEERING, NAMES, pause=pause, timeout_s=0.3)
        assert home.started
        assert set(home.started) <= set(home.cancelled)

    def test_bus_servos_and_no_emergency_stop_are_needed(self, bench: Bench) -> None:
        with pytest.raises(HomingError, match="servo off: fl_steer, fr_steer, rl_steer, rr_steer; the drive"):
            self.home(Bench(self.INCREMENTAL))
        assert bench.device.core_motion.ExecEStop(EStopLevel.Level1) == 0
        with pytest.raises(HomingError, match="the engine is in emergency stop"):
            self.home(bench)
        assert bench.device.api.StopCommunication(0) == 0
        with pytest.raises(HomingError, match="the engine does not communicate"):
            self.home(bench)

    def test_refusal_of_the_engine_is_named(self) -> None:
        """No simulated drive has a home switch."""
        switch = robot(steer={"absolute_encoder": False, "homing": {"type": "home_switch"}})
        bench = Bench(robot_parameters(switch)).servos_on()
        with pytest.raises(HomingError, match=r"fl_steer: HomeSwitchDetectionUnsupported \(error \d+\)"):
            self.home(bench)


def test_the_drives_file_is_in_the_runtime_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ROBOT_STACK_RUNTIME_DIR", str(tmp_path / "own"))
    path = write_parameters(PARAMETERS)
    assert Path(path).parent == tmp_path / "own"
    assert read_file(path, 8) == file_values(PARAMETERS)


@pytest.mark.parametrize("joint", ["fl_drive", "rr_axle"])
def test_homing_of_another_joint_is_wrong_use(joint: str) -> None:
    result = CliRunner().invoke(app, ["wmx", "home", joint, "--yes"])
    assert f"{joint}: must be of fl_steer, fr_steer, rl_steer, rr_steer" in str(result.exception)


def test_homing_asks_first() -> None:
    result = CliRunner().invoke(app, ["wmx", "home"], input="n\n")
    assert "Do the wheels point straight ahead? The home of fl_steer, fr_steer" in result.stdout
    assert str(result.exception) == "nothing was homed"
