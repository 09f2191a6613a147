"""The session of the manipulator, tick by tick in fake time."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from robot_stack.core.config import load
from robot_stack.wmx import EngineError
from robot_stack.wmx.api import AxisCommandMode, EngineState, ErrorCode, OperationState
from robot_stack.wmx.axes import UNTOLD, Flag, StatusSnapshot
from robot_stack.wmx.manipulator.bring_up import BringUp
from robot_stack.wmx.manipulator.params import ManipulatorStateParams
from robot_stack.wmx.start_up import Stage
from tests.unit.wmx.fake_engine import FakeEngine

TICK_S = 0.1
FILE = load(ManipulatorStateParams, "manipulator_state")
SESSION = FILE.session.model_copy(
    update={"attempts": 2, "attempt_pause_s": 1.95, "communication_retry_s": 2.95, "request_pause_s": 0.45}
)  # half a tick less than 2, 3 and 0.5 s
PARAMS = FILE.model_copy(
    update={
        "joint_number": 2,
        "joint_name": ("shoulder", "elbow", "left", "right"),
        "status_stale_s": 0.25,
        "session": SESSION,
    }
)


class Log:
    def __init__(self) -> None:
        self.lines: list[str] = []

    def info(self, text: str, /) -> None:
        self.lines.append(f"info: {text}")

    def warning(self, text: str, /) -> None:
        self.lines.append(f"warning: {text}")

    def error(self, text: str, /) -> None:
        self.lines.append(f"error: {text}")


class Story:
    """A session in fake time."""

    def __init__(self, parameter_file: str = "/arm.xml", **changes: Any) -> None:
        self.engine = FakeEngine()
        self.refusals: list[int] = []  # codes returned by the next attempts to open a device
        self.now_s = 100.0
        self.log = Log()
        self.bring_up = BringUp(self._open, PARAMS.model_copy(update=changes), parameter_file, self.log)

    def _open(self) -> FakeEngine:  # type: ignore[override]
        if self.refusals:
            code = self.refusals.pop(0)
            raise EngineError("manipulator_state: cannot create a device", code, "refused")
        self.engine.open = True
        return self.engine

    def tick(self, *, stop: bool = False) -> StatusSnapshot | None:
        self.now_s += TICK_S
        return self.bring_up.poll(self.now_s, stop=stop)

    def run(self, seconds: float, *, stop: bool = False) -> StatusSnapshot | None:
        snapshots = [self.tick(stop=stop) for _ in range(round(seconds / TICK_S))]
        return snapshots[-1]

    def up(self) -> Story:
        assert self.run(2.0) is not None
        assert self.stage is Stage.READY
        self.engine.calls.clear()
        self.bring_up.changes.clear()
        self.log.lines.clear()
        return self

    @property
    def stage(self) -> Stage:
        return self.bring_up.state.stage

    @property
    def text(self) -> str:
        return self.bring_up.state.text

    def passed(self) -> list[str]:
        """The texts of all states since the start or ``up``."""
        return [state.text for state in self.bring_up.changes]

    def end(self) -> None:
        """The end of a session that waits for the servos."""
        assert not self.bring_up.end(hurry=False)
        assert self.bring_up.end(hurry=False)


# --- start


def test_one_step_after_the_other():
    story = Story()
    story.run(1.0)
    assert story.engine.calls == [
        "ScanNetwork(0)",
        "StartCommunication",
        "ImportAndSetAll(/arm.xml)",
        "SetServoOn([0, 1], 1)",
    ]
    assert story.passed() == ["the engine does not communicate yet", "servo off: shoulder, elbow", "ready"]
    assert story.log.lines == [
        "info: parameters are set from /arm.xml",
        "info: shoulder: axis 0, gear ratio 52953088 / 6.25, polarity -1, absolute encoder, Position mode",
        "info: elbow: axis 1, gear ratio 52953088 / 6.25, polarity -1, absolute encoder, Position mode",
    ]


def test_nothing_is_known_before_the_parameters_are_set():
    story = Story()
    story.engine.communicates(True)
    story.engine.codes["ImportAndSetAll"] = 65542
    assert story.run(3.2) is None
    assert story.stage is Stage.PARAMETERS
    assert story.text == "parameter file /arm.xml: ParameterFileParseError (error 65542)"
    assert story.engine.calls == ["ImportAndSetAll(/arm.xml)"] * 2, "every 3 s, and no servo"
    story.engine.codes.clear()
    assert story.run(3.0) is not None
    assert story.stage is Stage.READY


@pytest.mark.parametrize("code", [ErrorCode.CreateDeviceLockError, ErrorCode.StartProcessLockError])
def test_a_device_that_is_refused(code: ErrorCode):
    story = Story()
    story.refusals = [ErrorCode.IMLibIsNotRunning] * 2
    story.run(0.2)
    assert story.text == "waiting for the motion engine"
    story = Story()
    story.refusals = [code] * 3
    story.tick()
    refusal = f"manipulator_state: cannot create a device: refused ({code.name}, error {int(code)})"
    assert story.passed() == [f"attempt 1 of 2: {refusal}"]
    story.run(1.9)
    assert len(story.refusals) == 2
    story.run(0.2)
    assert len(story.refusals) == 1
    assert story.text == f"2 attempts failed, still trying: {refusal}"
    story.run(6.0)
    assert story.stage is Stage.READY


@pytest.mark.parametrize(
    ("call", "name", "stage", "times"),
    [
        ("StartCommunication", "starting communication", Stage.COMMUNICATION, 2),
        ("ClearAmpAlarm([1])", "clearing alarms", Stage.SWITCHING_ON, 5),
        ("SetServoOn([0, 1], 1)", "servo on", Stage.SWITCHING_ON, 5),
    ],
)
def test_a_refused_step_is_tried_again(call: str, name: str, stage: Stage, times: int):
    story = Story()
    story.engine.flag(Flag.AMP_ALARM, 1, 1)
    story.engine.codes[call] = 1288
    story.run(2.3)
    assert story.stage is stage
    assert story.text == f"{name}: StartCommunicationError (error 1288)"
    assert story.engine.calls.count(call) == times, "communication after 2 s, others after 0.5 s"
    story.engine.codes.clear()
    story.run(4.0)
    assert story.stage is Stage.READY


@pytest.mark.parametrize(
    ("call", "sent", "stage", "text", "times"),
    [
        ("StartCommunication", "StartCommunication", Stage.COMMUNICATION, "the engine does not communicate yet", 1),
        ("SetServoOn", "SetServoOn([0, 1], 1)", Stage.SWITCHING_ON, "servo off: shoulder, elbow", 5),
    ],
)
def test_a_request_without_effect_is_repeated(call: str, sent: str, stage: Stage, text: str, times: int):
    story = Story()
    story.engine.deaf.add(call)
    story.run(2.5)
    assert (story.stage, story.text) == (stage, text)
    assert story.engine.calls.count(sent) == times
    story.run(3.0)
    assert story.engine.calls.count(sent) > times


def test_failed_network_scan_is_warned_of_and_start_continues():
    story = Story()
    story.engine.codes["ScanNetwork"] = 1288
    story.run(2.0)
    assert story.stage is Stage.READY
    assert story.log.lines[0] == "warning: network scan: StartCommunicationError (error 1288), going on without"
    assert story.engine.calls.count("ScanNetwork(0)") == 1


def test_axis_parameters_that_cannot_be_read_stop_nothing():
    story = Story()
    story.engine.codes["GetAxisParam"] = 1537
    story.run(2.0)
    assert story.stage is Stage.READY
    assert "warning: axis parameters cannot be read: CommNotStarted (error 1537)" in story.log.lines


def test_alarms_are_reported_before_clearing():
    story = Story()
    story.engine.flag(Flag.AMP_ALARM, 1, 1)
    story.engine.flag(Flag.AMP_ALARM_CODE, 1, 33)
    story.engine.flag(Flag.FOLLOWING_ERROR_ALARM, 0, 1)
    story.run(2.0)
    assert story.stage is Stage.READY
    assert "elbow alarm 33, shoulder following error" in story.passed()
    assert "ClearAxisAlarm([0])" in story.engine.calls


def test_an_alarm_that_stays_keeps_the_servos_off_but_not_the_joint_states():
    story = Story()
    story.engine.flag(Flag.AMP_ALARM, 1, 1)
    story.engine.deaf.add("ClearAmpAlarm")
    assert story.run(3.0) is not None
    assert (story.stage, story.text) == (Stage.SWITCHING_ON, "elbow alarm 0")
    assert not [call for call in story.engine.calls if call.startswith("SetServoOn")]


@pytest.mark.parametrize("at_the_start", [True, False])
def test_servos_are_left_alone_if_so_configured(at_the_start: bool):
    story = Story(parameter_file="", auto_servo_on=False)
    if not at_the_start:
        assert story.run(2.0) is not None
        assert story.stage is Stage.READY
    story.engine.flag(Flag.AMP_ALARM, 1, 1)
    assert story.run(2.0) is not None
    assert story.bring_up.started
    text = "wmx_param_file_path is not set, the engine's parameters stay as they are"
    assert story.log.lines[0] == f"warning: {text}"
    assert (story.stage, story.text) == (Stage.FAULT, "elbow alarm 0")
    assert not [call for call in story.engine.calls if "Servo" in call or "Alarm" in call]


def test_no_servo_comes_on_during_an_emergency_stop():
    story = Story()
    story.engine.flag(Flag.AMP_ALARM, 1, 1)
    assert story.run(2.0, stop=True) is not None
    assert (story.stage, story.text) == (Stage.STOPPED, "emergency stop")
    assert not [call for call in story.engine.calls if "Servo" in call or "Alarm" in call]
    story.engine.snapshot = replace(story.engine.snapshot, emergency_stop=True)
    story.run(2.0)
    assert (story.stage, story.text) == (Stage.STOPPED, "the engine is in emergency stop")
    assert not [call for call in story.engine.calls if "Servo" in call or "Alarm" in call]
    story.engine.snapshot = replace(story.engine.snapshot, emergency_stop=False)
    story.run(2.0)
    assert story.stage is Stage.READY
    story.run(2.0, stop=True)
    assert story.stage is Stage.READY, "servos that are on stay on"


def test_too_few_axes():
    story = Story(joint_number=4, joint_name=("a", "b", "c", "d", "e", "f"))
    assert story.run(2.0) is None
    assert story.text == "axes (0, 1, 2, 3) of an engine with 3"


# --- while it runs


def test_ready_bring_up_makes_no_engine_calls():
    story = Story().up()
    story.engine.flag(Flag.AMP_ALARM, 2, 1)  # of an axis that is no joint
    story.run(5.0)
    assert story.engine.calls == []
    assert story.passed() == story.log.lines == []


def test_a_bus_that_is_lost_is_started_again_and_the_servos_stay_off():
    story = Story().up()
    story.engine.deaf.add("StartCommunication")
    story.engine.communicates(False, error=ErrorCode.ServoOffline)
    assert story.tick() is None
    assert story.passed() == ["communication with the drives is lost"]
    assert not story.bring_up.started
    story.engine.deaf.clear()
    assert story.run(4.0) is not None
    assert (story.stage, story.text) == (Stage.FAULT, "servo off: shoulder, elbow")
    assert story.engine.calls == ["StartCommunication"]
    story.engine.flag(Flag.SERVO_ON, slice(None), 1)  # by an operator
    assert story.tick() is not None
    assert story.stage is Stage.READY


@pytest.mark.parametrize(
    ("flag", "value", "text"),
    [
        (Flag.AMP_ALARM, 1, "elbow alarm 0"),
        (Flag.FOLLOWING_ERROR_ALARM, 1, "elbow following error"),
        (Flag.SERVO_ON, 0, "servo off: elbow"),
    ],
)
def test_a_fault_after_the_start_is_an_operators_to_clear(flag: Flag, value: int, text: str):
    story = Story().up()
    story.engine.flag(flag, 1, value)
    assert story.run(2.0) is not None, "joints are still read"
    assert (story.stage, story.text) == (Stage.FAULT, text)
    assert story.bring_up.started
    story.engine.flag(flag, 1, 1 - value)
    story.tick()
    assert story.stage is Stage.READY
    assert not [call for call in story.engine.calls if call != "GetDeviceName"]


def test_bus_that_ended_without_cause_is_restarted():
    """The vendor's status names no cause: the restart repairs a cable fault, but also undoes a deliberate stop."""
    story = Story().up()
    story.engine.communicates(False, error=UNTOLD)
    story.run(4.0)
    assert story.engine.calls == ["StartCommunication"]


def test_a_bus_that_was_stopped_is_its_stoppers_to_start():
    story = Story().up()
    story.engine.communicates(False)
    assert story.run(3.0) is None
    assert story.engine.calls == []
    assert story.passed() == ["communication was stopped by another device, which has to start it again"]
    story.engine.communicates(True)
    assert story.run(0.5) is not None
    assert (story.text, story.engine.calls) == ("servo off: shoulder, elbow", [])


def test_bus_loss_during_start_repeats_remaining_steps():
    story = Story()
    story.engine.deaf.add("SetServoOn")
    story.run(1.0)
    assert story.stage is Stage.SWITCHING_ON
    story.engine.deaf.clear()
    story.engine.communicates(False, error=ErrorCode.ServoOffline)
    story.run(4.0)
    assert story.stage is Stage.READY
    assert story.engine.calls.count("ImportAndSetAll(/arm.xml)") == 1, "the engine still has them"
    assert story.engine.snapshot.servo_on[:2].all()


def test_an_engine_that_ends_begins_again():
    story = Story().up()
    story.engine.codes["read_status"] = ErrorCode.DeviceIsNull
    story.refusals = [ErrorCode.IMLibIsNotRunning]
    assert story.tick() is None
    assert not story.engine.open
    story.engine = FakeEngine()
    assert story.run(5.0) is not None
    assert story.stage is Stage.READY
    assert "SetServoOn([0, 1], 1)" in story.engine.calls


def test_an_engine_that_died_leaves_an_old_status_and_does_not_answer():
    story = Story().up()
    story.engine.codes |= {"read_status": ErrorCode.StatusChannelError, "GetDeviceName": ErrorCode.IMLibIsNotRunning}
    assert story.run(0.2) is None
    assert (story.stage, story.bring_up.started) == (Stage.CONNECTING, False)
    assert "the motion engine has ended" in story.passed()


def test_a_status_that_cannot_be_read_for_a_while():
    story = Story().up()
    story.engine.codes["read_status"] = ErrorCode.StatusChannelError
    assert story.run(2.0) is None
    assert (story.stage, story.text) == (Stage.CONNECTING, "engine status: StatusChannelError (error 271)")
    assert story.bring_up.started, "a gap in the feedback"
    assert story.engine.calls.count("GetDeviceName") == 4  # every 0.5 s, not at every tick
    story.engine.codes.clear()
    assert story.tick() is not None
    assert story.stage is Stage.READY


def test_frozen_cycle_counter_yields_no_status():
    story = Story().up()
    snapshot = story.engine.read_status()[1]
    story.engine.read_status = lambda: (0, snapshot)  # type: ignore[method-assign]
    assert [story.tick() is not None for _ in range(5)] == [True, True, True, False, False]
    assert story.text == "the engine's cycles do not advance"


# --- end


def test_the_end_takes_back_what_the_start_took():
    story = Story().up()
    story.end()
    assert story.engine.calls == ["SetServoOn([0, 1], 0)", "StopCommunication", "close"]
    assert story.bring_up.end(hurry=False)


@pytest.mark.parametrize(("devices", "stop"), [(2, True), (1, False)], ids=["others use it", "as configured"])
def test_the_end_leaves_the_bus(devices: int, stop: bool):
    story = Story(stop_communication=stop)
    assert story.bring_up.end(hurry=False), "before there was an engine"
    story = Story(stop_communication=stop).up()
    story.engine.n_devices = devices
    story.end()
    assert story.engine.calls == ["SetServoOn([0, 1], 0)", "close"]


def test_end_switches_off_only_servos_switched_on_by_bring_up():
    story = Story()
    story.engine.communicates(True)
    story.engine.flag(Flag.SERVO_ON, 0, 1)
    story.up()
    story.end()
    assert story.engine.calls == ["SetServoOn([1], 0)", "close"]


def test_joints_in_motion_are_stopped_before_their_servos_go_off():
    story = Story().up()
    story.engine.deaf.add("Stop_AxisSel")
    story.engine.flag(Flag.OP_STATE, 0, OperationState.Intpl)
    story.engine.flag(Flag.OP_STATE, 1, OperationState.Velocity)
    story.engine.flag(Flag.COMMAND_MODE, 1, AxisCommandMode.Velocity)
    assert not story.bring_up.end(hurry=False)
    assert not story.bring_up.end(hurry=False)
    assert story.engine.calls == ["Stop_AxisSel([0])", "Stop_AxisSel([1])"]
    story.engine.flag(Flag.OP_STATE, slice(None), OperationState.Idle)
    story.end()
    assert story.engine.calls[2:] == ["SetServoOn([0, 1], 0)", "StopCommunication", "close"]
    assert story.log.lines == ["warning: stopping shoulder elbow"]


def test_the_bus_stops_after_the_servos_are_off_or_in_a_hurry():
    story = Story().up()
    story.engine.deaf.add("SetServoOn")
    assert not story.bring_up.end(hurry=False)
    assert not story.bring_up.end(hurry=False)
    assert "StopCommunication" not in story.engine.calls
    story.engine.flag(Flag.OP_STATE, 0, OperationState.Intpl)
    assert story.bring_up.end(hurry=True)
    assert story.engine.calls[-2:] == ["StopCommunication", "close"]


def test_the_end_with_an_engine_that_has_ended():
    story = Story().up()
    story.engine.snapshot = replace(story.engine.snapshot, engine_state=EngineState.Shutdown)
    story.engine.codes["read_status"] = ErrorCode.DeviceIsNull
    assert story.bring_up.end(hurry=False)
    assert story.engine.calls == ["close"]


# --- between polls


def test_a_look_suffices_while_nothing_changes():
    story = Story()
    assert story.bring_up.look(story.now_s) is None, "no engine yet"
    story.up()
    feedback = story.bring_up.look(story.now_s)
    assert feedback is not None
    assert feedback.cycle_counter == story.engine.snapshot.cycle_counter
    assert feedback.position == tuple(story.engine.snapshot.actual_pos)
    assert story.engine.calls == []


@pytest.mark.parametrize("what", ["no status", "no communication", "a cycle that was seen already"])
def test_look_returns_none_for_changed_engine_state(what: str):
    story = Story().up()
    if what == "no status":
        story.engine.codes["read_status"] = ErrorCode.StatusChannelError
    elif what == "no communication":
        story.engine.communicates(False, error=5)
    else:
        story.engine.snapshot = replace(story.engine.snapshot, cycle_counter=story.engine.snapshot.cycle_counter - 1)
    assert story.bring_up.look(story.now_s) is None


def test_cycles_seen_by_looks_do_not_stand_still():
    story = Story().up()
    for _ in range(10):
        story.now_s += TICK_S
        assert story.bring_up.look(story.now_s) is not None
    story.engine.snapshot = replace(story.engine.snapshot, cycle_counter=story.engine.snapshot.cycle_counter - 1)
    assert story.tick() is not None, "seen a tick ago, not a second"
