"""The engine session, tick by tick in fake time. The engine is a fake that returns the real return codes.

Its parameters are those of a simulated engine, which starts with the vendor's defaults.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from robot_stack.contract.frames import JOINTS
from robot_stack.core.config import load, validate
from robot_stack.core.robot import Robot
from robot_stack.drive.hardware_params import SwerveHardwareParams, axis_settings
from robot_stack.drive.kinematics import ModuleSetPoints
from robot_stack.drive.session import DriveSession
from robot_stack.drive.wheel_axes import AxisSettings, DriveMove, SteerMove, drive_moves
from robot_stack.wmx import EngineError
from robot_stack.wmx.api import EngineState, ErrorCode, EStopLevel, ProfileType
from robot_stack.wmx.axes import Flag, Real, StatusSnapshot, empty_snapshot
from robot_stack.wmx.config import EngineParameters
from robot_stack.wmx.parameter_blocks import file_values
from robot_stack.wmx.robot_parameters import robot_parameters
from robot_stack.wmx.simulated.parameter_file import write_file
from robot_stack.wmx.start_up import Stage
from tests.support.local_engine import new_device
from tests.unit.drive.robot import ROBOT

PARAMS = load(SwerveHardwareParams, "swerve_hardware_interface")
AXES = axis_settings(PARAMS, ROBOT, 50.0)
PARAMETERS = robot_parameters(ROBOT)
TICK_S = 0.02
DRIVES = [DriveMove(0, 1.0, 10.0, 25.0, 0.1, 0.1)]
STEERS = [SteerMove(1, 0.5, 1.0, 10.0)]


class FakeEngine:
    """Answers as the port does. ``codes``: return code by call name; all other calls succeed."""

    def __init__(self) -> None:
        self.codes: dict[str, int] = {}
        self.calls: list[str] = []
        self.started: list[Any] = []
        self.open = True
        snapshot = empty_snapshot(8)
        snapshot.flags[Flag.COMMAND_MODE] = [1, 0, 1, 0, 1, 0, 1, 0]
        snapshot.flags[Flag.HOME_DONE] = 1
        self.snapshot: StatusSnapshot = replace(snapshot, engine_state=EngineState.Running)
        self.api = self.core_motion = self
        self.axisControl = self.motion = self.velocity = self.config = self
        self._parameters = new_device().core_motion.config

    def read_status(self) -> tuple[int, StatusSnapshot]:
        return self._answer("read_status"), self.snapshot

    def close(self) -> None:
        self.open = False

    def _answer(self, name: str) -> int:
        if name != "read_status":
            self.calls.append(name)
        return int(self.codes.get(name, ErrorCode.PyNone))

    def set_flag(self, flag: Flag, axis: int | slice, value: int) -> None:
        self.snapshot.flags[flag, axis] = value

    def __getattr__(self, name: str) -> Any:
        if not name.startswith("Get"):
            raise AttributeError(name)
        return getattr(self._parameters, name)

    # The vendor's method names. Unlike in the real engine, a request changes the status at once.

    def GetDeviceName(self) -> tuple[int, str]:  # noqa: N802
        return self._answer("GetDeviceName"), "node"

    def StartCommunication(self, milliseconds: int) -> int:  # noqa: N802
        assert milliseconds == 0, "a wait would hold the node up"
        code = self._answer("StartCommunication")
        if not code:
            self.snapshot = replace(self.snapshot, engine_state=EngineState.Communicating)
        return code

    def ImportAndSetAll(self, path: str) -> int:  # noqa: N802
        return self._answer("ImportAndSetAll") or self._parameters.ImportAndSetAll(path)

    def SetAxisCommandMode(self, axis: int, mode: int) -> int:  # noqa: N802
        self.set_flag(Flag.COMMAND_MODE, axis, mode)
        return self._answer("SetAxisCommandMode")

    def SetServoOn_AxisSel(self, selection: object, on: int) -> int:  # noqa: N802
        code = self._answer(f"SetServoOn({on})")
        if not code:
            self.set_flag(Flag.SERVO_ON, slice(None), on)
        return code

    def ClearAmpAlarm_AxisSel(self, selection: object) -> int:  # noqa: N802
        self.set_flag(Flag.AMP_ALARM, slice(None), 0)
        return self._answer("ClearAmpAlarm")

    def ClearAxisAlarm_AxisSel(self, selection: object) -> int:  # noqa: N802
        self.set_flag(Flag.FOLLOWING_ERROR_ALARM, slice(None), 0)
        return self._answer("ClearAxisAlarm")

    def ExecEStop(self, level: int) -> int:  # noqa: N802
        assert level == EStopLevel.Level1
        code = self._answer("ExecEStop")
        if not code:
            self.snapshot = replace(self.snapshot, emergency_stop=True)
        return code

    def ReleaseEStop(self) -> int:  # noqa: N802
        code = self._answer("ReleaseEStop")
        if not code:
            self.snapshot = replace(self.snapshot, emergency_stop=False)
        return code

    def StartPos(self, count: int, commands: list[object]) -> int:  # noqa: N802
        assert count == len(commands)
        return self._answer("StartPos")

    def StartVel(self, count: int, commands: list[object]) -> int:  # noqa: N802
        assert count == len(commands)
        self.started += commands
        return self._answer("StartVel")

    def StartVel_TimedVel(self, count: int, commands: list[object]) -> int:  # noqa: N802
        assert count == len(commands)
        self.started += commands
        return self._answer("StartVel_TimedVel")


class Story:
    """A session in fake time."""

    def __init__(self, file: Path, axes: AxisSettings = AXES, parameters: EngineParameters = PARAMETERS) -> None:
        self.engine = FakeEngine()
        self.refusals: list[int] = []  # codes returned by the next attempts to open a device
        self.opened = 0
        self.now_s = 100.0
        self.session = DriveSession(self._open, PARAMS.session, axes, parameters, str(file))

    def _open(self) -> FakeEngine:  # type: ignore[override]
        if self.refusals:
            code = self.refusals.pop(0)
            raise EngineError("cannot create a device", code, "refused")
        self.opened += 1
        return self.engine

    def tick(self, seconds: float = TICK_S, *, stop: bool = False, may: bool = True) -> tuple[Stage, str]:
        for _ in range(max(1, round(seconds / TICK_S))):
            self.now_s += TICK_S
            state = self.session.poll(self.now_s, stop=stop, may_switch_on=may)
        return state.stage, state.text

    def ready(self) -> Story:
        self.tick(0.2)
        assert self.session.ready
        self.engine.calls.clear()
        return self


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("parameters") / "robot.xml"
    write_file(str(path), file_values(PARAMETERS))
    return path


@pytest.fixture
def story(file: Path) -> Story:
    return Story(file)


def test_from_nothing_to_ready(story: Story):
    """From wrong command modes and an alarm. Wheels need no home."""
    story.engine.snapshot.flags[Flag.COMMAND_MODE] = 0
    story.engine.set_flag(Flag.AMP_ALARM, 2, 1)
    for axis in AXES.drive_axes:
        story.engine.set_flag(Flag.HOME_DONE, axis, 0)
    assert story.tick()[0] is Stage.COMMUNICATION
    assert story.session.state.snapshot is None  # no joint states before the bus is up
    story.tick(0.3)
    assert story.session.ready
    assert [
        call for call in story.engine.calls if call not in ("GetDeviceName", "ClearAmpAlarm", "ClearAxisAlarm")
    ] == [
        "StartCommunication",
        "ImportAndSetAll",
        *["SetAxisCommandMode"] * 4,
        "SetServoOn(1)",
    ]
    assert story.engine.snapshot.flags[Flag.COMMAND_MODE].tolist() == [1, 0, 1, 0, 1, 0, 1, 0]


def test_no_servo_comes_on_and_no_position_is_valid_without_the_parameters(story: Story, file: Path):
    story.engine.codes["ImportAndSetAll"] = ErrorCode.NotIdleState
    stage, text = story.tick(3.0)
    assert (stage, text) == (Stage.PARAMETERS, f"parameter file {file}: NotIdleState (error 1546)")
    assert story.session.state.snapshot is None
    assert story.engine.calls.count("ImportAndSetAll") == 2  # one every 2 s
    assert "SetServoOn(1)" not in story.engine.calls
    story.engine.codes.clear()
    story.tick(2.1)
    assert story.session.ready


def test_an_emergency_stop_reaches_axes_whose_parameters_are_not_set(story: Story):
    story.engine.codes["ImportAndSetAll"] = ErrorCode.NotIdleState
    story.tick(0.2, stop=True)
    assert story.session.state.stage is Stage.PARAMETERS
    assert story.engine.snapshot.emergency_stop
    story.engine.codes.clear()
    assert story.tick(2.1, stop=True) == (Stage.STOPPED, "emergency stop")


def test_parameters_other_than_the_robots_are_a_start_error(tmp_path: Path):
    """The file on disk was changed after it was written: what the engine has is not what the robot needs."""
    other = PARAMETERS.axes[2].model_copy(update={"estop_dec_radps2": 100000.0, "polarity": -1})
    axes = (*PARAMETERS.axes[:2], other, *PARAMETERS.axes[3:])
    write_file(str(tmp_path / "robot.xml"), file_values(replace(PARAMETERS, axes=axes)))
    story = Story(tmp_path / "robot.xml")
    stage, text = story.tick(3.0)
    assert stage is Stage.PARAMETERS
    assert text == (
        "axis 2 (fr_drive): axisPolarity is -1, expected 1; axis 2 (fr_drive): eStopDec is 100000, expected 24.24242424"
    )
    assert "SetServoOn(1)" not in story.engine.calls
    write_file(str(tmp_path / "robot.xml"), file_values(PARAMETERS))
    story.tick(2.1)
    assert story.session.ready


def test_steering_without_home_does_not_move(story: Story):
    """Its servos come on, because a homing needs them."""
    story.engine.set_flag(Flag.HOME_DONE, 1, 0)
    story.engine.set_flag(Flag.HOME_DONE, 5, 0)
    stage, text = story.tick(1.0)
    assert stage is Stage.HOMING
    assert text == "not homed: fl_steer, rl_steer; align the wheels and run robot-stack wmx home"
    assert story.engine.snapshot.servo_on.all()
    assert story.session.follow(ModuleSetPoints((0.1,) * 4, (0.2,) * 4)).problem == f"not ready: {text}"
    assert story.session.move(DRIVES, STEERS).set_points is None
    assert not {"StartPos", "StartVel_TimedVel"} & set(story.engine.calls)
    story.engine.set_flag(Flag.HOME_DONE, slice(None), 1)
    assert story.tick() == (Stage.HOMING, "homed: fl_steer, rl_steer; needs an emergency stop and its release")
    story.tick(stop=True)
    story.tick(0.1)
    assert story.session.ready


def test_steering_with_another_zero_does_not_move_before_an_emergency_stop(story: Story):
    """The controller's set points still refer to the former zero: the wheels would turn away from straight ahead."""
    story.ready()
    set_points = ModuleSetPoints((0.0,) * 4, (1.2,) * 4)
    assert story.session.follow(set_points).problem == ""
    story.engine.calls.clear()
    story.engine.snapshot.reals[Real.HOME_OFFSET, 3] += 1.2
    text = "homed: fr_steer; needs an emergency stop and its release"
    assert story.session.follow(set_points).problem == text, "between two polls"
    assert story.tick(1.0) == (Stage.HOMING, text)
    assert story.session.follow(set_points).problem == f"not ready: {text}"
    assert not {"StartPos", "StartVel", "StartVel_TimedVel"} & set(story.engine.calls)
    story.tick(stop=True)
    story.tick(0.1)
    assert story.session.ready


def test_axes_are_the_robots(tmp_path: Path):
    """Wheels on axes 3 to 0, steering on 4 to 7."""
    numbers = [number for pair in zip((3, 2, 1, 0), (4, 5, 6, 7), strict=True) for number in pair]
    data = ROBOT.model_dump()
    for joint, number in zip(JOINTS, numbers, strict=True):
        data["axes"][joint]["number"] = number
    robot = validate(Robot, data, "robot.yaml")
    write_file(str(tmp_path / "robot.xml"), file_values(robot_parameters(robot)))
    story = Story(tmp_path / "robot.xml", axis_settings(PARAMS, robot, 50.0), robot_parameters(robot))
    story.ready()
    assert story.engine.snapshot.flags[Flag.COMMAND_MODE].tolist() == [1, 1, 1, 1, 0, 0, 0, 0]
    story.engine.set_flag(Flag.AMP_ALARM, 0, 1)
    assert story.tick() == (Stage.TRIPPED, "rr_drive alarm 0")
    moves = drive_moves((0.1, 0.2, 0.3, 0.4), [0.0] * 4, axis_settings(PARAMS, robot, 50.0))
    assert [move.axis for move in moves] == [3, 2, 1, 0]


def test_absent_engine_is_looked_for_often(story: Story):
    story.refusals = [ErrorCode.IMLibIsNotRunning] * 8
    assert story.tick(0.5) == (Stage.CONNECTING, "waiting for the motion engine")
    assert len(story.refusals) in (3, 4)  # one attempt every 0.1 s
    story.tick(1.0)
    assert story.session.ready


def test_engine_that_refuses_is_tried_five_times_two_seconds_apart_and_then_on(story: Story):
    story.refusals = [ErrorCode.ReachMaxChannelNumber] * 7
    _, text = story.tick()
    assert text.startswith("attempt 1 of 5: cannot create a device: refused")
    story.tick(1.9)
    assert len(story.refusals) == 6
    story.tick(0.2)
    assert len(story.refusals) == 5
    _, text = story.tick(6.2)
    assert text.startswith("5 attempts failed, still trying")
    story.tick(6.5)
    assert story.session.ready


def test_servos_need_permission(story: Story):
    assert story.tick(1.0, may=False) == (
        Stage.SWITCHING_ON,
        "servo off: fl_drive, fl_steer, fr_drive, fr_steer, rl_drive, rl_steer, rr_drive, rr_steer; "
        "waiting for the safety monitor",
    )
    assert "SetServoOn(1)" not in story.engine.calls
    assert story.session.state.snapshot is not None  # joint states are published anyway
    story.engine.codes["SetServoOn(1)"] = ErrorCode.ServoOffline
    assert story.tick(1.2)[1] == f"servo on: ServoOffline (error {int(ErrorCode.ServoOffline)})"
    assert story.engine.calls.count("SetServoOn(1)") == 3


def test_stop_and_release(story: Story):
    story.ready()
    assert story.session.emergency_stop() == ""
    assert story.tick(stop=True) == (Stage.STOPPED, "emergency stop")
    assert story.session.move(DRIVES, STEERS).problem == "not ready: emergency stop"
    assert story.engine.started == []
    assert story.engine.calls.count("ExecEStop") == 1
    assert story.tick(may=False) == (Stage.STOPPED, "emergency stop, waiting for the safety monitor")
    assert "ReleaseEStop" not in story.engine.calls
    story.tick(0.1)
    assert "ReleaseEStop" in story.engine.calls
    assert story.session.ready


def test_stop_is_repeated_until_the_engine_shows_it(story: Story):
    story.ready()
    story.engine.codes["ExecEStop"] = ErrorCode.APIChannelTimeOut
    assert story.session.emergency_stop().startswith("emergency stop: APIChannelTimeOut")
    story.tick(0.1, stop=True)
    assert story.engine.calls.count("ExecEStop") == 6
    story.engine.codes.clear()
    story.tick(stop=True)
    assert story.engine.snapshot.emergency_stop


@pytest.mark.parametrize("at_start", [True, False])
def test_stop_of_another_source_requires_stop_and_release(story: Story, at_start: bool):
    """A restarted session cannot know the reason of the stop: a person may stand in front of the robot."""
    if not at_start:
        story.ready()
    story.engine.snapshot = replace(story.engine.snapshot, emergency_stop=True)
    story.tick(1.0, may=not at_start)
    stage, text = story.tick(5.0)
    assert (stage, text) == (
        Stage.TRIPPED,
        "an emergency stop of another source; needs an emergency stop and its release",
    )
    assert story.engine.snapshot.emergency_stop
    assert "ReleaseEStop" not in story.engine.calls
    story.tick(0.3, stop=True)
    story.tick(0.5)
    assert story.session.ready


@pytest.mark.parametrize(
    ("flag", "says"),
    [(Flag.AMP_ALARM, "rl_drive alarm 0"), (Flag.FOLLOWING_ERROR_ALARM, "rl_drive following error")],
)
def test_alarm_trips_and_waits_for_a_release(story: Story, flag: Flag, says: str):
    story.ready()
    story.engine.set_flag(flag, 4, 1)
    assert story.tick() == (Stage.TRIPPED, says)
    assert story.engine.snapshot.emergency_stop
    assert story.tick(2.0)[1] == f"{says}; needs an emergency stop and its release"
    assert story.engine.snapshot.flags[flag, 4] == 1  # alarms are cleared only by an emergency stop and its release
    story.tick(stop=True)
    assert story.engine.snapshot.flags[flag, 4] == 0
    story.tick(0.2)
    assert story.session.ready


def test_alarms_are_cleared_only_when_the_wheels_stand(story: Story):
    story.ready()
    story.engine.set_flag(Flag.AMP_ALARM, 0, 1)
    story.engine.snapshot.reals[Real.ACTUAL_VELOCITY, 2] = -3.0
    story.tick(1.0, stop=True)
    assert "ClearAmpAlarm" not in story.engine.calls
    story.engine.snapshot.reals[Real.ACTUAL_VELOCITY, 2] = 0.0
    story.tick(0.6, stop=True)
    assert "ClearAmpAlarm" in story.engine.calls


def test_servo_that_drops_out_trips(story: Story):
    story.ready()
    story.engine.set_flag(Flag.SERVO_ON, 7, 0)
    assert story.tick() == (Stage.TRIPPED, "servo off: rr_steer")
    assert "SetServoOn(1)" not in story.engine.calls


def test_lost_bus_is_started_again_and_then_trips(story: Story):
    story.ready()
    story.engine.snapshot = replace(story.engine.snapshot, engine_state=EngineState.Running)
    story.engine.set_flag(Flag.SERVO_ON, slice(None), 0)
    story.engine.codes["StartCommunication"] = ErrorCode.StartCommunicationError
    stage, text = story.tick(4.1)
    assert (stage, story.session.state.snapshot) == (Stage.COMMUNICATION, None)
    assert text.startswith("starting communication: StartCommunicationError")
    assert story.engine.calls.count("StartCommunication") == 2  # one attempt every 2 s
    story.engine.codes.clear()
    story.tick(2.1)
    assert story.session.state.stage is Stage.TRIPPED


def test_ended_engine_is_forgotten_and_found_again(story: Story):
    story.ready()
    story.engine.codes["GetDeviceName"] = ErrorCode.IMLibIsNotRunning
    story.refusals = [ErrorCode.IMLibIsNotRunning] * 3
    reported = [story.tick() for _ in range(8)]
    assert (Stage.CONNECTING, "the motion engine has ended") in reported
    assert not story.engine.open
    story.engine = FakeEngine()
    story.tick(0.5)
    assert story.opened == 2
    assert story.session.ready
    assert story.engine.calls.count("ImportAndSetAll") == 1


def test_hanging_engine_is_not_polled_every_tick(story: Story):
    """Every call would block the node for its whole timeout."""
    story.ready()
    story.engine.codes |= {
        "GetDeviceName": ErrorCode.APIChannelTimeOut,
        "read_status": ErrorCode.StatusChannelError,
    }
    stage, text = story.tick(3.0)
    assert stage is Stage.CONNECTING
    assert text.startswith("engine status: StatusChannelError")
    assert story.session.state.snapshot is None
    assert story.engine.calls.count("GetDeviceName") <= 2
    story.engine.codes.clear()
    story.now_s -= 1000.0  # time that runs back holds nothing up
    story.tick()
    assert story.session.ready
    story.engine.snapshot = replace(empty_snapshot(4), engine_state=EngineState.Communicating)
    assert story.tick()[0] is Stage.CONNECTING, "too few axes"
    assert story.session.state.snapshot is None
    assert story.session.look() is None


def test_headings_go_first_and_wheels_only_after_them(story: Story):
    story.ready()
    assert story.session.move(DRIVES, STEERS).problem == ""
    assert story.engine.calls[-2:] == ["StartPos", "StartVel_TimedVel"]
    story.engine.calls.clear()
    story.engine.codes["StartPos"] = ErrorCode.ServoOff
    started = list(story.engine.started)
    assert story.session.move(DRIVES, STEERS).problem == f"steering: ServoOff (error {int(ErrorCode.ServoOff)})"
    assert story.engine.started == started


def test_follow_returns_set_points_accepted_by_engine(story: Story):
    set_points = ModuleSetPoints((0.1, 0.1, 0.1, 0.1), (0.2, 0.2, 0.2, 0.2))
    assert story.session.follow(set_points) == (None, "not ready: waiting for the motion engine")
    story.ready()
    applied = story.session.follow(set_points)
    assert applied.problem == ""
    assert applied.set_points is not None
    assert [move.axis for move in applied.set_points.drives] == [0, 2, 4, 6]
    assert [move.target_rad for move in applied.set_points.steers] == pytest.approx([0.2] * 4)
    story.engine.codes["StartVel_TimedVel"] = ErrorCode.ServoOff
    applied = story.session.follow(set_points)
    assert applied.problem == f"driving: ServoOff (error {int(ErrorCode.ServoOff)})"
    assert applied.set_points is not None
    assert (applied.set_points.drives, len(applied.set_points.steers)) == ((), 4)
    story.engine.codes["read_status"] = ErrorCode.StatusChannelError
    applied = story.session.follow(set_points)
    assert applied.set_points is None
    assert applied.problem.startswith("engine status: StatusChannelError")


def test_uncommanded_moving_wheels_are_stopped(story: Story):
    story.ready()
    snapshot = story.session.state.snapshot
    assert snapshot is not None
    assert story.session.stop_wheels(snapshot) == (None, "")
    assert story.engine.started == []
    story.engine.snapshot.reals[Real.VELOCITY_CMD, 0] = 2.0
    applied = story.session.stop_wheels(story.engine.snapshot)
    assert applied.problem == ""
    assert applied.set_points is not None
    assert [move.velocity_radps for move in applied.set_points.drives] == [0.0] * 4
    assert "StartPos" not in story.engine.calls


def test_engine_counts_the_life_of_every_wheel_that_turns(story: Story):
    """The dead-man: a command to a turning wheel is timed, and timed commands accept only time-based profiles."""
    story.ready()
    still = DriveMove(2, 0.0, 10.0, 25.0, 0.0, 0.0)
    assert story.session.move([*DRIVES, still], []).problem == ""
    assert story.engine.calls[-2:] == ["StartVel", "StartVel_TimedVel"], "standing wheels first"
    rest, turn = story.engine.started
    assert (rest.axis, rest.profile.velocity, rest.profile.dec) == (2, 0.0, 25.0)
    assert turn.profile.type == ProfileType.TimeAccTrapezoidal
    # The speed is reached after 0.1 s. The built-in braking starts 0.2 s after the command, at 25 rad/s2 from 1 rad/s.
    assert (turn.runTimeMilliseconds, turn.profile.accTimeMilliseconds) == pytest.approx((100.0, 100.0))
    assert turn.profile.decTimeMilliseconds == pytest.approx(40.0)


def test_a_refused_rest_of_some_wheels_leaves_the_others_unmoved(story: Story):
    story.ready()
    story.engine.codes["StartVel"] = ErrorCode.ServoOff
    assert "ServoOff" in story.session.move([*DRIVES, DriveMove(2, 0.0, 10.0, 25.0, 0.0, 0.0)], []).problem
    assert "StartVel_TimedVel" not in story.engine.calls


def test_ready_session_only_queries_device_name(story: Story):
    """The fake has no such call, since the vendor's watchdog stops no axis."""
    story.ready()
    story.tick(5.0)
    assert set(story.engine.calls) == {"GetDeviceName"}


def test_motion_on_an_engine_that_has_just_ended(story: Story):
    story.ready()
    story.engine.codes["StartVel_TimedVel"] = ErrorCode.IMLibIsNotRunning
    assert story.session.move(DRIVES, []).problem == "the motion engine has ended"
    assert story.session.look() is None
    assert story.session.emergency_stop() == "no engine to stop"
