"""The session of two wheels, tick by tick in fake time. The engine is a fake that returns the real return codes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import pytest

from robot_stack.core.config import load
from robot_stack.wmx import EngineError
from robot_stack.wmx.api import (
    AxisCommandMode,
    AxisSelection,
    CoreMotionErrorCode,
    DetailOperationState,
    EngineState,
    ErrorCode,
    OperationState,
    ProfileType,
    Velocity_TimedVelCommand,
    Velocity_VelCommand,
)
from robot_stack.wmx.axes import Flag, Real, StatusSnapshot
from robot_stack.wmx.differential.kinematics import REST, WheelPair
from robot_stack.wmx.differential.params import DiffDriveParams
from robot_stack.wmx.differential.session import WheelSession
from robot_stack.wmx.session import EngineSession
from robot_stack.wmx.start_up import Stage
from tests.unit.wmx.fake_engine import FakeEngine as ArmEngine

PARAMS = load(DiffDriveParams, "diff_drive_controller")
TICK_S = 0.01
LEFT, RIGHT = 2, 1
N_AXES = 4


class FakeEngine(ArmEngine):
    """Turns the wheels at once. ``codes``: return code by call name; all other calls succeed."""

    def __init__(self) -> None:
        super().__init__(N_AXES)
        self.commands: list[Any] = []
        self.time_s = 5.0

    def read_status(self) -> tuple[int, StatusSnapshot]:
        code, snapshot = super().read_status()
        return code, replace(snapshot, engine_time_s=self.time_s)

    def put(self, flag: Flag, value: int, *axes: int) -> None:
        for axis in axes:
            self.flag(flag, axis, value)

    def run(self, velocity: float, *axes: int) -> None:
        self.put(Flag.OP_STATE, OperationState.Velocity, *axes)
        self.put(Flag.DETAIL_OP_STATE, DetailOperationState.Velocity, *axes)
        self.snapshot.reals[Real.VELOCITY_CMD, list(axes)] = velocity
        self.snapshot.reals[Real.ACTUAL_VELOCITY, list(axes)] = velocity

    def rest(self, *axes: int) -> None:
        self.run(0.0, *axes)
        self.put(Flag.OP_STATE, OperationState.Idle, *axes)
        self.put(Flag.DETAIL_OP_STATE, DetailOperationState.Idle, *axes)

    # --- the vendor's names

    def SetAxisCommandMode(self, axis: int, mode: int) -> int:
        call = f"SetAxisCommandMode({axis})"
        if self._answer(call):
            self.put(Flag.COMMAND_MODE, mode, axis)
        return self._code(call)

    def StartVel(self, count: int, commands: list[Velocity_VelCommand]) -> int:
        return self._started("StartVel", count, commands)

    def StartVel_TimedVel(self, count: int, commands: list[Velocity_TimedVelCommand]) -> int:
        assert all(command.profile.type == ProfileType.TimeAccTrapezoidal for command in commands), "the vendor's rule"
        return self._started("StartVel_TimedVel", count, commands)

    def _started(
        self, name: str, count: int, commands: Sequence[Velocity_VelCommand | Velocity_TimedVelCommand]
    ) -> int:
        assert count == len(commands)
        self.commands = list(commands)
        if self._answer(name):
            for command in commands:
                self.run(command.profile.velocity, command.axis)
        return self._code(name)

    def ExecQuickStop_AxisSel(self, selection: AxisSelection) -> int:
        assert sorted(selection.axis) == [RIGHT, LEFT]
        if self._answer("ExecQuickStop"):
            self.rest(LEFT, RIGHT)
        return self._code("ExecQuickStop")

    def ExecQuickStop(self, axis: int) -> int:
        call = f"ExecQuickStop({axis})"
        self._answer(call)
        return self._code(call)


class Story:
    """A session in fake time."""

    def __init__(self, parameter_file: str = "") -> None:
        self.engine = FakeEngine()
        self.refusals: list[int] = []  # codes returned by the next attempts to open a device
        self.opened = 0
        self.now_s = 100.0
        session = PARAMS.session
        self.connection = EngineSession(self._open, session.patience())
        params = PARAMS.model_copy(update={"left_axis": LEFT, "right_axis": RIGHT, "acc_time": 0.5, "dec_time": 0.25})
        self.session = WheelSession(self.connection, params, parameter_file)

    def _open(self) -> FakeEngine:  # type: ignore[override]
        if self.refusals:
            raise EngineError("cannot create a device", self.refusals.pop(0), "refused")
        self.opened += 1
        self.engine.open = True
        return self.engine

    def tick(self, seconds: float = TICK_S, *, stop: bool = False) -> tuple[Stage, str]:
        for _ in range(max(1, round(seconds / TICK_S))):
            self.now_s += TICK_S
            self.engine.time_s += TICK_S
            state = self.session.poll(self.now_s, stop=stop)
        return state.stage, state.text

    def ready(self) -> Story:
        self.tick(0.2)
        assert self.session.ready, self.session.state
        self.engine.calls.clear()
        return self

    def driving(self) -> Story:
        self.ready()
        assert self.session.follow(WheelPair(3.0, 4.0), self.now_s) == (WheelPair(3.0, 4.0), "")
        assert self.tick() == (Stage.READY, "ready")
        self.engine.calls.clear()
        return self

    def asked(self) -> list[str]:
        return [call for call in self.engine.calls if call != "GetDeviceName"]

    def called(self, name: str) -> int:
        return sum(call.startswith(name) for call in self.engine.calls)


@pytest.fixture
def story() -> Story:
    return Story()


# --- start ----------------------------------------------------------------------------------------------------


def test_start_calls_engine_in_fixed_order(story: Story) -> None:
    story = Story("/p.xml")
    story.engine.put(Flag.AMP_ALARM, 1, LEFT)
    story.tick(0.2)
    assert story.session.ready
    assert story.asked() == [
        "StartCommunication",
        "ImportAndSetAll(/p.xml)",
        "ClearAmpAlarm([2])",
        "SetAxisCommandMode(2)",
        "SetAxisCommandMode(1)",
        "SetServoOn([2, 1], 1)",
    ]


def test_other_axes_are_left_alone(story: Story) -> None:
    story.engine.put(Flag.AMP_ALARM, 1, 0, 3)
    story.ready()
    assert story.engine.snapshot.flags[Flag.AMP_ALARM, 0] == 1
    assert story.engine.snapshot.flags[Flag.SERVO_ON, 0] == 0
    assert story.engine.snapshot.flags[Flag.COMMAND_MODE, 3] == AxisCommandMode.Position


@pytest.mark.parametrize(
    ("call", "stage", "says"),
    [
        ("StartCommunication", Stage.COMMUNICATION, "starting communication: SystemError (error 1280)"),
        ("ImportAndSetAll", Stage.PARAMETERS, "parameter file /p.xml: SystemError (error 1280)"),
        ("SetAxisCommandMode", Stage.SWITCHING_ON, "command mode: SystemError (error 1280)"),
        ("SetServoOn", Stage.SWITCHING_ON, "servo on: SystemError (error 1280)"),
    ],
)
def test_refused_step_is_named_and_tried_again(call: str, stage: Stage, says: str) -> None:
    story = Story("/p.xml")
    story.engine.codes[call] = ErrorCode.SystemError
    assert story.tick(0.3) == (stage, says)
    assert story.called(call) == 1
    assert not story.engine.snapshot.flags[Flag.SERVO_ON, LEFT]
    story.tick(2.1)
    assert story.called(call) >= 2
    del story.engine.codes[call]
    story.tick(2.1)
    assert story.session.ready


# --- motion ----------------------------------------------------------------------------------------------------


def test_both_wheels_in_one_command_with_times_in_milliseconds(story: Story) -> None:
    """The change takes 0.5 s: in the 0.3 s lifetime of a command the wheels reach 3/5 of it at a constant rate."""
    story.ready()
    assert story.session.follow(WheelPair(-3.0, 4.0), story.now_s).problem == ""
    assert [command.axis for command in story.engine.commands] == [LEFT, RIGHT]
    assert [command.profile.velocity for command in story.engine.commands] == pytest.approx([-1.8, 2.4])
    for command in story.engine.commands:
        assert command.profile.accTimeMilliseconds == pytest.approx(300.0)
        assert command.profile.decTimeMilliseconds == pytest.approx(250.0)
        assert command.runTimeMilliseconds == 1.0, "no time at a speed on the way"


def test_wheel_slows_down_in_its_time_and_is_stopped_in_its_time(story: Story) -> None:
    """The engine accepts one deceleration for both phases: the harder one is used."""
    story.driving()
    story.engine.run(3.0, LEFT)
    story.engine.run(4.0, RIGHT)
    story.tick()
    story.session.follow(WheelPair(2.0, 2.0), story.now_s)
    left, right = story.engine.commands
    for command, change in ((left, 1.0), (right, 2.0)):
        assert command.profile.velocity == 2.0
        rate = command.profile.velocity / (1e-3 * command.profile.decTimeMilliseconds)
        assert rate == pytest.approx(max(change, 2.0) / 0.25)
        assert command.runTimeMilliseconds == pytest.approx(50.0)  # of 0.3 s in total the change takes 0.25 s


def test_one_wheel_at_rest_and_the_other_not(story: Story) -> None:
    story.ready()
    assert story.session.follow(WheelPair(0.0, 1.0), story.now_s).problem == ""
    assert [call for call in story.engine.calls if call.startswith("Start")] == ["StartVel", "StartVel_TimedVel"]
    assert [command.axis for command in story.engine.commands] == [RIGHT]


def test_rejected_motion_reports_engine_error(story: Story) -> None:
    story.ready()
    story.engine.codes["StartVel_TimedVel"] = CoreMotionErrorCode.NotVelocityMode
    assert story.session.follow(WheelPair(1.0, 1.0), story.now_s) == (None, "driving: NotVelocityMode (error 65572)")
    del story.engine.codes["StartVel_TimedVel"]
    assert story.session.follow(WheelPair(1.0, 1.0), story.now_s).problem == ""
    assert story.called("StartVel") == 2, "refused speeds are sent again"


def test_speeds_are_sent_again_three_times_in_the_life_of_a_command(story: Story) -> None:
    story.ready()
    for _ in range(100):
        assert story.session.follow(WheelPair(1.0, 2.0), story.now_s).problem == ""
        story.tick()
    assert 9 <= story.called("StartVel_TimedVel") <= 11, "one second"
    count = story.called("StartVel_TimedVel")
    story.session.follow(WheelPair(1.0, 2.1), story.now_s)
    assert story.called("StartVel_TimedVel") == count + 1


def test_a_ramp_of_its_own(story: Story) -> None:
    story.ready()
    story.session.follow(WheelPair(2.0, 2.0), story.now_s, 0.02)
    assert [command.profile.accTimeMilliseconds for command in story.engine.commands] == [pytest.approx(20.0)] * 2
    assert story.engine.commands[0].profile.velocity == 2.0


def test_external_stop_of_wheel_is_detected_while_speed_changes(story: Story) -> None:
    story.ready()
    for step in range(30):
        story.session.follow(WheelPair(1.0 + 0.01 * step, 1.0), story.now_s, 0.02)
        story.engine.run(1.0, LEFT, RIGHT)
        story.tick()
    story.engine.rest(LEFT)
    story.tick()
    assert story.session.state.stage is Stage.FAULT


def test_renewed_command_continues_ramp(story: Story) -> None:
    """The ramp does not restart: it ends 0.5 s after it began."""
    story.ready()
    begun_s = story.now_s
    while story.now_s - begun_s < 0.45:
        story.session.follow(WheelPair(2.0, 2.0), story.now_s)
        story.tick()
    story.session._sent_s = 0.0
    story.session.follow(WheelPair(2.0, 2.0), story.now_s)
    for command in story.engine.commands:
        assert command.profile.velocity == 2.0
        left_ms = 1e3 * (begun_s + 0.5 - story.now_s)
        assert command.profile.accTimeMilliseconds == pytest.approx(left_ms)
        assert command.runTimeMilliseconds == pytest.approx(300.0 - left_ms)


def test_rest_is_not_sent_to_wheels_at_rest_but_to_others(story: Story) -> None:
    story.ready()
    assert story.session.follow(REST, story.now_s).problem == ""
    assert story.called("StartVel") == 0
    story.engine.run(1.0, LEFT)  # by another client
    story.tick()
    assert story.session.follow(REST, story.now_s).problem == ""
    assert story.called("StartVel") == 1
    story.engine.rest(LEFT, RIGHT)
    assert story.tick(1.0)[0] is Stage.READY, "commanded rest is not reported as missing motion"


def test_nothing_drives_before_it_is_ready(story: Story) -> None:
    assert story.session.quick_stop() == "no engine to stop"
    assert story.session.follow(WheelPair(1.0, 1.0), story.now_s).problem.startswith("not ready")
    assert story.engine.commands == []


def test_session_without_follow_only_polls_engine(story: Story) -> None:
    """Only ``follow`` keeps the wheels turning: if a node does not call it, they stop."""
    story.driving()
    story.tick(1.0)
    assert 8 <= story.called("GetDeviceName") <= 11
    assert set(story.engine.calls) == {"GetDeviceName"}


# --- faults ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("flag", "value", "says"),
    [
        (Flag.AMP_ALARM, 1, "right wheel alarm 0; needs clear_alarm"),
        (Flag.FOLLOWING_ERROR_ALARM, 1, "right wheel following error; needs clear_alarm"),
        (Flag.SERVO_ON, 0, "servo off: right wheel; needs clear_alarm"),
    ],
)
def test_fault_of_one_wheel_stops_both_until_fault_is_cleared(story: Story, flag: Flag, value: int, says: str) -> None:
    story.driving()
    story.engine.put(flag, value, RIGHT)
    stage, text = story.tick()
    assert (stage, text[: len(says)]) == (Stage.FAULT, says)
    assert story.asked() == ["ExecQuickStop"]
    assert story.session.follow(WheelPair(1.0, 1.0), story.now_s).problem.startswith("not ready")
    story.tick(5.0)
    assert story.asked() == ["ExecQuickStop"]
    story.engine.put(flag, 1 - value, RIGHT)
    assert story.tick()[0] is Stage.READY


def test_wheel_that_another_stopped_stops_the_other_too(story: Story) -> None:
    story.driving()
    story.tick(0.2)
    story.engine.rest(LEFT)
    assert story.tick() == (Stage.FAULT, "left wheel was stopped by another client")
    assert story.called("ExecQuickStop") == 1
    assert story.tick() == (Stage.READY, "ready")


def test_wheel_that_is_being_stopped_by_another_stops_the_other_too(story: Story) -> None:
    story.driving()
    story.engine.put(Flag.OP_STATE, OperationState.Stop, RIGHT)
    story.engine.put(Flag.DETAIL_OP_STATE, DetailOperationState.Stop, RIGHT)
    assert story.tick() == (Stage.STOPPING, "right wheel is being stopped")
    assert story.called("ExecQuickStop") == 1


def test_delay_before_motion_command_does_not_restart_stopped_wheels(story: Story) -> None:
    """The process hangs between the status and the command, while the engine stops the wheels by itself."""
    story.driving()
    story.engine.time_s += 1.0
    story.engine.rest(LEFT, RIGHT)
    applied = story.session.follow(WheelPair(3.1, 4.1), story.now_s)
    assert applied == (None, "delayed between the engine's status and the command")
    assert story.asked() == []
    assert story.tick()[0] is Stage.FAULT


def test_delay_within_motion_command_stops_wheels(story: Story, monkeypatch: pytest.MonkeyPatch) -> None:
    story.driving()
    start = FakeEngine.StartVel_TimedVel

    def hang(engine: FakeEngine, count: int, commands: list[Velocity_TimedVelCommand]) -> int:
        engine.time_s += 1.0
        return start(engine, count, commands)

    monkeypatch.setattr(FakeEngine, "StartVel_TimedVel", hang)
    assert story.session.follow(WheelPair(3.1, 4.1), story.now_s).problem.startswith("delayed")
    assert story.asked() == ["StartVel_TimedVel", "ExecQuickStop"]


def test_stop_command_is_accepted_after_delay(story: Story) -> None:
    story.driving()
    story.engine.time_s += 1.0
    assert story.session.follow(REST, story.now_s) == (REST, "")
    assert story.asked() == ["StartVel"]


def test_wheel_is_given_time_to_begin(story: Story) -> None:
    story.ready()
    story.session.follow(WheelPair(1.0, 1.0), story.now_s)
    story.engine.rest(LEFT, RIGHT)
    assert story.tick(0.05)[0] is Stage.READY


def test_mode_that_another_changed_is_set_back_after_a_stop(story: Story) -> None:
    story.driving()
    story.engine.put(Flag.COMMAND_MODE, AxisCommandMode.Position, LEFT)
    assert story.tick() == (Stage.SWITCHING_ON, "wrong command mode: left wheel")
    assert story.asked() == ["ExecQuickStop"]
    assert story.tick(PARAMS.session.request_pause_s)[0] is Stage.READY
    assert story.asked() == ["ExecQuickStop", "SetAxisCommandMode(2)"]


def test_quick_stop_reaches_each_axis_in_its_own_mode(story: Story) -> None:
    story.ready()
    story.engine.codes["ExecQuickStop"] = CoreMotionErrorCode.NotVelocityMode
    text = story.session.quick_stop()
    assert text == "quick stop: NotVelocityMode (error 65572)"
    assert story.engine.calls == ["ExecQuickStop", *["ExecQuickStop(2)"] * 2, *["ExecQuickStop(1)"] * 2]


def test_lost_bus_is_brought_back_from_the_start(story: Story) -> None:
    story.driving()
    story.engine.codes["StartCommunication"] = ErrorCode.StartCommunicationError
    story.engine.snapshot = replace(story.engine.snapshot, engine_state=EngineState.Running)
    story.engine.put(Flag.SERVO_ON, 0, LEFT, RIGHT)
    story.engine.rest(LEFT, RIGHT)
    assert story.tick() == (Stage.COMMUNICATION, "communication with the drives is lost")
    assert story.session.state.snapshot is None
    assert story.tick(2.1) == (Stage.COMMUNICATION, "starting communication: StartCommunicationError (error 1288)")
    del story.engine.codes["StartCommunication"]
    assert story.tick(2.1) == (Stage.READY, "ready")
    assert story.engine.snapshot.flags[Flag.SERVO_ON, RIGHT] == 1


def test_engine_that_ended_is_looked_for_again(story: Story) -> None:
    code = ErrorCode.DeviceIsNull
    story.driving()
    story.engine.codes["read_status"] = code
    assert story.tick() == (Stage.CONNECTING, "the motion engine has ended")
    assert not story.engine.open
    story.engine.codes.clear()
    story.engine.rest(LEFT, RIGHT)
    story.tick(0.3)
    assert story.opened == 2
    assert story.session.ready


# --- emergency stop ----------------------------------------------------------------------------------------------


def test_emergency_stop_stops_clears_and_after_it_all_is_switched_on(story: Story) -> None:
    story.driving()
    story.engine.put(Flag.AMP_ALARM, 1, LEFT)
    story.engine.put(Flag.SERVO_ON, 0, LEFT)
    assert story.tick(stop=True) == (Stage.STOPPED, "emergency stop")
    assert story.called("ExecQuickStop") == 1
    story.tick(1.0, stop=True)
    assert story.called("ExecQuickStop") == 1, "wheels at rest need no second stop"
    assert story.called("ClearAmpAlarm") == 1
    assert story.called("SetServoOn") == 0
    story.tick(0.1)
    assert story.session.ready
    assert story.called("SetServoOn([2], 1)") == 1


def test_wheels_in_a_quick_stop_are_left_to_it(story: Story) -> None:
    story.driving()
    story.engine.put(Flag.OP_STATE, OperationState.Stop, LEFT, RIGHT)
    story.engine.put(Flag.DETAIL_OP_STATE, DetailOperationState.Stop_QStop, LEFT, RIGHT)
    story.tick(0.1, stop=True)
    assert story.asked() == []
    story.engine.put(Flag.DETAIL_OP_STATE, DetailOperationState.Stop, RIGHT)
    story.tick(stop=True)
    assert story.asked() == ["ExecQuickStop"], "a soft stop is not quick enough"


def test_rejected_quick_stop_is_repeated(story: Story) -> None:
    story.driving()
    story.engine.codes["ExecQuickStop"] = ErrorCode.APIChannelTimeOut
    story.tick(stop=True)
    story.tick(stop=True)
    assert story.called("ExecQuickStop") >= 4


def test_emergency_stop_of_the_engine_is_respected_and_not_released(story: Story) -> None:
    story.driving()
    story.engine.rest(LEFT, RIGHT)
    story.engine.snapshot = replace(story.engine.snapshot, emergency_stop=True)
    assert story.tick(1.0) == (Stage.STOPPED, "the engine is in emergency stop")
    story.engine.snapshot = replace(story.engine.snapshot, emergency_stop=False)
    assert story.tick(0.1) == (Stage.READY, "ready")


def test_alarm_is_not_cleared_while_a_wheel_turns(story: Story) -> None:
    story.driving()
    story.engine.put(Flag.AMP_ALARM, 1, LEFT)
    story.engine.codes["ExecQuickStop"] = ErrorCode.SystemError
    story.tick(2.0, stop=True)
    assert story.called("ClearAmpAlarm") == 0
