"""The session of the manipulator, tick by tick in fake time."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from robot_stack.wmx import EngineError
from robot_stack.wmx.api import AxisCommandMode, EngineState, ErrorCode, OperationState
from robot_stack.wmx.axes import UNTOLD, Flag, StatusSnapshot
from robot_stack.wmx.failures import ABSENT, BUSY
from robot_stack.wmx.manipulator.bring_up import BringUp, BringUpSettings
from robot_stack.wmx.manipulator.startup import Rule, Step
from tests.unit.wmx.manipulator.fake_engine import FakeEngine

TICK_S = 0.1
RULE = Rule(attempts=2, pause_s=2.0, longest_pause_s=2.0, limit_s=1.0)
SETTINGS = BringUpSettings(
    n_joints=2,
    names=("shoulder", "elbow", "left", "right"),
    parameter_file="/arm.xml",
    auto_servo_on=True,
    stop_communication=True,
    stale_s=0.25,
    rules=dict.fromkeys(Step, RULE),
)


class Story:
    """A session in fake time."""

    def __init__(self, **changes: Any) -> None:
        self.engine = FakeEngine()
        self.refusals: list[int] = []  # codes returned by the next attempts to open a device
        self.now_s = 100.0
        self.bring_up = BringUp(self._open, replace(SETTINGS, **changes))

    def _open(self) -> FakeEngine:  # type: ignore[override]
        if self.refusals:
            code = self.refusals.pop(0)
            raise EngineError("manipulator_state: cannot create a device", code, "refused")
        self.engine.open = True
        return self.engine

    def tick(self, *, stop: bool = False) -> StatusSnapshot | None:
        self.now_s += TICK_S
        return self.bring_up.poll(self.now_s, lambda: stop)

    def run(self, seconds: float, *, stop: bool = False) -> StatusSnapshot | None:
        snapshots = [self.tick(stop=stop) for _ in range(round(seconds / TICK_S))]
        return snapshots[-1]

    def up(self) -> Story:
        assert self.run(2.0) is not None
        assert self.step is Step.READY
        self.engine.calls.clear()
        self.bring_up.lines.clear()
        return self

    @property
    def step(self) -> Step:
        return self.bring_up.progress.step

    def told(self) -> list[str]:
        return [f"{line.level.value}: {line.text}" for line in self.bring_up.lines]


# --- start


def test_one_step_after_the_other():
    story = Story()
    steps = []
    while story.step is not Step.READY:
        story.tick()
        steps.append(story.step)
    assert story.engine.calls == [
        "ScanNetwork(0)",
        "StartCommunication",
        "ImportAndSetAll(/arm.xml)",
        "ClearAmpAlarm(0)",
        "ClearAmpAlarm(1)",
        "SetServoOn(0, 1)",
        "SetServoOn(1, 1)",
    ]
    assert steps[0] is Step.SCAN
    assert len(steps) == 10  # three steps need a second look to check their effect
    assert story.told() == [
        "info: device: open",
        "info: communication: started",
        "info: parameters: set from /arm.xml",
        "info: shoulder: axis 0, gear ratio 52953088 / 6.25, polarity -1, absolute encoder, Position mode",
        "info: elbow: axis 1, gear ratio 52953088 / 6.25, polarity -1, absolute encoder, Position mode",
        "info: servo on: shoulder elbow",
    ]


def test_nothing_is_known_before_the_parameters_are_set():
    story = Story()
    story.engine.communicates(True)
    story.engine.codes["ImportAndSetAll"] = 65542
    assert story.run(3.0) is None
    assert story.step is Step.PARAMETERS
    assert not [call for call in story.engine.calls if call.startswith("SetServoOn")]
    assert "attempt 1 of 2 failed, next in 2 s: /arm.xml: text 65542" in story.told()[-2]
    assert "2 attempts failed, still trying" in story.told()[-1]
    assert story.told()[-1].endswith("servos stay off")
    story.engine.codes.clear()
    assert story.run(3.0) is not None
    assert story.step is Step.READY


def test_missing_parameter_file_is_warned_of_and_start_continues():
    story = Story(parameter_file="")
    assert story.run(2.0) is not None
    text = "wmx_param_file_path is not set, the engine's parameters stay as they are"
    assert f"warning: parameters: {text}" in story.told()
    assert not [call for call in story.engine.calls if call.startswith("Import")]


@pytest.mark.parametrize("code", [ErrorCode.CreateDeviceLockError, ErrorCode.StartProcessLockError])
def test_a_device_that_is_refused(code: ErrorCode):
    story = Story()
    story.refusals = [code] * 3
    story.tick()
    assert story.told() == [
        "warning: device: attempt 1 of 2 failed, next in 2 s: manipulator_state: cannot create a device: refused "
        f"({code.name}, error {int(code)})"
    ]
    story.run(1.9)
    assert len(story.refusals) == 2
    story.run(0.2)
    assert len(story.refusals) == 1
    assert story.told()[-1].startswith("error: device: 2 attempts failed, still trying")
    story.run(6.0)
    assert story.step is Step.READY


def test_an_engine_that_is_absent_is_waited_for():
    story = Story()
    story.refusals = [ErrorCode.IMLibIsNotRunning] * 20
    story.run(1.5)
    assert story.told() == ["info: device: waiting for the motion engine"]
    story.run(3.0)
    assert story.step is Step.READY


def test_a_network_that_runs_is_not_scanned_nor_started():
    story = Story()
    story.engine.communicates(True)
    story.run(2.0)
    assert story.step is Step.READY
    assert not {"ScanNetwork(0)", "StartCommunication"} & set(story.engine.calls)


@pytest.mark.parametrize(
    ("call", "step"),
    [
        ("StartCommunication", Step.COMMUNICATION),
        ("ClearAmpAlarm(1)", Step.CLEAR_ALARMS),
        ("SetServoOn(1, 1)", Step.SERVO_ON),
    ],
)
def test_a_refused_step_is_tried_again(call: str, step: Step):
    story = Story()
    story.engine.codes[call] = 1288
    story.run(2.0)
    assert story.step is step
    assert [line for line in story.told() if line.startswith(f"warning: {step.value}: attempt 1 of 2")]
    assert "text 1288 (StartCommunicationError, error 1288)" in story.told()[-1]
    story.engine.codes.clear()
    story.run(4.0)
    assert story.step is Step.READY


@pytest.mark.parametrize(
    ("call", "step", "text"),
    [
        ("StartCommunication", Step.COMMUNICATION, "not started after 1 s"),
        ("SetServoOn", Step.SERVO_ON, "servo off: shoulder elbow after 1 s"),
    ],
)
def test_a_request_without_effect_fails_in_time(call: str, step: Step, text: str):
    story = Story()
    story.engine.deaf.add(call)
    story.run(2.5)
    assert story.step is step
    assert text in story.told()[-1]


def test_failed_network_scan_is_warned_of_and_start_continues():
    story = Story()
    story.engine.codes["ScanNetwork"] = 1288
    story.run(2.0)
    assert story.step is Step.READY
    assert [line for line in story.told() if line.startswith("warning: network scan: failed, going on without: ")]


def test_bus_that_ended_without_cause_is_restarted():
    """The vendor's status names no cause: the restart repairs a cable fault, but also undoes a deliberate stop."""
    story = Story().up()
    story.engine.communicates(False, error=UNTOLD)
    story.run(4.0)
    assert story.step is Step.READY
    assert story.engine.calls == ["StartCommunication"]


@pytest.mark.parametrize("code", sorted(ABSENT - BUSY))
def test_an_engine_that_is_not_up_yet_refuses_nothing(code: int):
    story = Story()
    story.refusals = [code] * 3
    story.tick()
    assert story.told() == ["info: device: waiting for the motion engine"]


def test_axis_parameters_that_cannot_be_read_stop_nothing():
    story = Story()
    story.engine.codes["GetAxisParam"] = 1537
    story.run(2.0)
    assert story.step is Step.READY
    assert "warning: axis parameters: cannot be read: text 1537 (CommNotStarted, error 1537)" in story.told()


def test_alarms_are_reported_before_clearing():
    story = Story()
    story.engine.flag(Flag.AMP_ALARM, 1, 1)
    story.engine.flag(Flag.AMP_ALARM_CODE, 1, 33)
    story.engine.flag(Flag.FOLLOWING_ERROR_ALARM, 0, 1)
    story.run(2.0)
    assert story.step is Step.READY
    assert "warning: elbow: clearing amplifier alarm 33" in story.told()
    assert "ClearAxisAlarm(0)" in story.engine.calls


def test_an_alarm_that_stays_keeps_the_servos_off_but_not_the_joint_states():
    story = Story()
    story.engine.flag(Flag.AMP_ALARM, 1, 1)
    story.engine.deaf.add("ClearAmpAlarm")
    assert story.run(3.0) is not None
    assert story.step is Step.CLEAR_ALARMS
    assert "alarm of elbow" in story.bring_up.progress.text
    assert "SetServoOn(0, 1)" not in story.engine.calls


def test_servos_are_left_alone_if_so_configured():
    story = Story(auto_servo_on=False)
    assert story.run(2.0) is not None
    assert story.step is Step.READY
    assert not [call for call in story.engine.calls if "Servo" in call or "Alarm" in call]


def test_no_servo_comes_on_during_an_emergency_stop():
    story = Story()
    assert story.run(2.0, stop=True) is not None
    assert story.step is Step.CLEAR_ALARMS
    assert story.told()[-1] == "info: amplifier alarms: emergency stop"
    story.run(2.0)
    assert story.step is Step.READY


def test_no_servo_comes_on_during_the_engines_own_emergency_stop():
    story = Story()
    story.engine.snapshot = replace(story.engine.snapshot, emergency_stop=True)
    story.run(2.0)
    assert (story.step, story.bring_up.progress.text) == (Step.SERVO_ON, "emergency stop of the engine")


def test_too_few_axes():
    story = Story(n_joints=4, names=("a", "b", "c", "d", "e", "f"))
    assert story.run(2.0) is None
    assert story.bring_up.status_problem == "the engine has 3 axes, joint_number is 4"


# --- while it runs


def test_ready_bring_up_makes_no_engine_calls():
    story = Story().up()
    story.run(5.0)
    assert story.engine.calls == []
    assert story.told() == []
    assert story.bring_up.status_problem == ""


def test_a_bus_that_is_lost_is_started_again_and_the_servos_stay_off():
    story = Story().up()
    story.engine.deaf.add("StartCommunication")
    story.engine.communicates(False, error=ErrorCode.ServoOffline)
    assert story.tick() is None
    assert story.told() == ["error: communication with the drives is lost"]
    story.engine.deaf.clear()
    assert story.run(4.0) is not None
    assert story.step is Step.READY
    assert set(story.engine.calls) == {"StartCommunication"}


def test_a_bus_that_was_stopped_is_its_stoppers_to_start():
    story = Story().up()
    story.engine.communicates(False)
    assert story.run(3.0) is None
    assert story.engine.calls == []
    assert story.told()[0] == "error: communication was stopped by another device"
    story.engine.communicates(True)
    assert story.run(0.5) is not None
    assert (story.step, story.engine.calls) == (Step.READY, [])


def test_bus_loss_during_start_repeats_remaining_steps():
    story = Story()
    story.engine.deaf.add("SetServoOn")
    story.run(1.0)
    assert story.step is Step.SERVO_ON
    story.engine.deaf.clear()
    story.engine.communicates(False, error=ErrorCode.ServoOffline)
    story.run(4.0)
    assert story.step is Step.READY
    assert story.engine.calls.count("ImportAndSetAll(/arm.xml)") == 2
    assert story.engine.snapshot.servo_on[:2].all()


def test_an_engine_that_ends_begins_again():
    story = Story().up()
    story.engine.codes["read_status"] = ErrorCode.DeviceIsNull
    story.refusals = [ErrorCode.IMLibIsNotRunning]
    assert story.tick() is None
    assert not story.engine.open
    story.engine = FakeEngine()
    assert story.run(5.0) is not None
    assert story.step is Step.READY
    assert "SetServoOn(0, 1)" in story.engine.calls


def test_an_engine_that_died_leaves_an_old_status_and_does_not_answer():
    story = Story().up()
    story.engine.codes |= {"read_status": ErrorCode.StatusChannelError, "GetDeviceName": ErrorCode.IMLibIsNotRunning}
    assert story.tick() is None
    assert story.step is Step.DEVICE
    assert story.told() == ["error: the motion engine has ended"]


def test_a_status_that_cannot_be_read_for_a_while():
    story = Story().up()
    story.engine.codes["read_status"] = ErrorCode.StatusChannelError
    assert story.run(2.0) is None
    assert story.bring_up.status_problem == f"status: text {int(ErrorCode.StatusChannelError)} (error 271)"
    assert story.engine.calls.count("GetDeviceName") == 4  # every 0.5 s, not at every tick
    story.engine.codes.clear()
    assert story.tick() is not None
    assert story.step is Step.READY


def test_frozen_cycle_counter_yields_no_status():
    story = Story().up()
    snapshot = story.engine.read_status()[1]
    story.engine.read_status = lambda: (0, snapshot)  # type: ignore[method-assign]
    assert [story.tick() is not None for _ in range(5)] == [True, True, True, False, False]
    assert story.bring_up.status_problem == "the engine's cycles do not advance"


# --- end


def test_the_end_takes_back_what_the_start_took():
    story = Story().up()
    assert story.bring_up.end(hurry=False)
    assert story.engine.calls == ["SetServoOn(0, 0)", "SetServoOn(1, 0)", "StopCommunication", "close"]
    assert story.bring_up.end(hurry=False)


def test_the_end_leaves_a_bus_that_others_use():
    story = Story().up()
    story.engine.n_devices = 2
    assert story.bring_up.end(hurry=False)
    assert story.engine.calls == ["SetServoOn(0, 0)", "SetServoOn(1, 0)", "close"]


def test_the_end_leaves_the_bus_if_so_configured():
    story = Story(stop_communication=False).up()
    assert story.bring_up.end(hurry=False)
    assert "StopCommunication" not in story.engine.calls


def test_end_switches_off_only_servos_switched_on_by_bring_up():
    story = Story()
    story.engine.communicates(True)
    story.engine.flag(Flag.SERVO_ON, 0, 1)
    story.up()
    assert story.bring_up.end(hurry=False)
    assert story.engine.calls == ["SetServoOn(1, 0)", "close"]


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
    assert story.bring_up.end(hurry=False)
    assert "SetServoOn(0, 0)" in story.engine.calls


def test_joints_that_do_not_stop_in_time():
    story = Story().up()
    story.engine.flag(Flag.OP_STATE, 0, OperationState.Intpl)
    assert story.bring_up.end(hurry=True)
    assert story.engine.calls[0] == "SetServoOn(0, 0)"


def test_the_end_before_there_was_an_engine():
    assert Story().bring_up.end(hurry=False)


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
