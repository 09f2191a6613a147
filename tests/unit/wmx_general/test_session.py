"""The general node's session, without ROS, on an engine whose drives a test can break."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from itertools import pairwise
from typing import Any

import pytest

from robot_stack.core.config import load
from robot_stack.wmx import EngineError, MotionEngine, connect
from robot_stack.wmx.api import EngineState, ErrorCode, OperationState
from robot_stack.wmx.axes import Real, StatusSnapshot
from robot_stack.wmx.general.answers import Answer
from robot_stack.wmx.general.commands import AxisOrder
from robot_stack.wmx.general.params import GeneralParams
from robot_stack.wmx.general.session import GeneralSession
from robot_stack.wmx.general.worker import Job
from tests.support.waiting import wait_for
from tests.unit.wmx.conformance import pos, vel
from tests.unit.wmx.harness import (
    POS,
    POS_MIRRORED,
    VEL,
    ThreadHarness,
    engine_in_thread,
    some_cycles,
    status,
    wait_status,
)

QUICK = {
    "axis_count": 5,
    "rated_torque_nm": [1.0] * 5,
    "device_retry_s": 0.02,
    "servo_timeout_s": 0.3,
    "alarm_timeout_s": 0.3,
    "homing_timeout_s": 0.3,
    "communication_timeout_s": 0.3,
    "command_max_wait_s": 5.0,
}


class Log:
    def __init__(self) -> None:
        self.lines: list[str] = []

    def info(self, text: str) -> None:
        self.lines.append(f"info {text}")

    def warning(self, text: str) -> None:
        self.lines.append(f"warning {text}")

    def error(self, text: str) -> None:
        self.lines.append(f"error {text}")

    def wait(self, text: str) -> str:
        found: str = wait_for(lambda: next((line for line in self.lines if text in line), ""), f"{text!r} in the log")
        return found


class Rig:
    """An engine, an observing client, and the session under test."""

    def __init__(self, harness: ThreadHarness, **params: Any) -> None:
        self.harness, self.log = harness, Log()
        self.refusals: list[int] = []
        self.opened = 0
        self.states: list[StatusSnapshot] = []
        self.session = GeneralSession(
            "general",
            load(GeneralParams, "wmx_ros2_general_node", QUICK | params),
            100.0,
            self._open,
            self.log,
            self._on,
        )

    def _open(self, path: str | None, name: str) -> MotionEngine:
        self.opened += 1
        if self.refusals:
            raise EngineError(name, self.refusals.pop(0), "refused by the test")
        config = self.harness.config if path is None else self.harness.config.model_copy(update={"path": path})
        return connect(name, config, timeout_s=0.0)

    def _on(self, snapshot: StatusSnapshot) -> None:
        self.states.append(snapshot)

    def start(self) -> Rig:
        self.session.worker.start()
        wait_for(lambda: self.session.n_axes, "a device")
        return self

    def ask(self, job: Callable[[], Job]) -> Answer:
        answered = threading.Event()
        answers: list[Answer] = []
        self.session.worker.ask(job, lambda answer: (answers.append(answer), answered.set()))
        assert answered.wait(30.0), "no answer"
        return answers[0]

    def up(self) -> MotionEngine:
        """Switches bus and servos on and returns the observing client."""
        onlooker = self.harness.ready()
        self.start()
        return onlooker

    def move(self, move: Callable[[AxisOrder], None], *order: Any) -> None:
        self.session.move("topic", move, AxisOrder(*order))


@pytest.fixture
def harness() -> Iterator[ThreadHarness]:
    with engine_in_thread() as harness:
        yield harness
        harness.end_test()


@pytest.fixture
def rig(harness: ThreadHarness) -> Iterator[Rig]:
    rig = Rig(harness)
    yield rig
    rig.session.end()
    assert rig.session.worker.failure is None


def moving(axis: int) -> Callable[[StatusSnapshot], bool]:
    return lambda now: abs(now.velocity_cmd[axis]) > 0.5


def at_rest(axis: int) -> Callable[[StatusSnapshot], bool]:
    return lambda now: now.op_state[axis] == OperationState.Idle


class TestDevice:
    def test_failed_attempts_are_logged_five_times_then_retried_silently(self, rig: Rig) -> None:
        rig.refusals = [297, 263, 297, 263, 297, 263, 263]
        rig.start()
        reported = [line for line in rig.log.lines if "attempt" in line]
        assert [line.split()[0] for line in reported] == ["warning"] * 4 + ["error"]
        assert "attempt 1 of 5: lock contention" in reported[0]
        assert "attempt 2 of 5" in reported[1]
        assert "lock contention" not in reported[1]
        assert "retries" in reported[4]
        assert rig.opened == 8

    def test_everything_is_answered_without_a_device(self, rig: Rig) -> None:
        rig.refusals = [263] * 100_000
        rig.session.worker.start()
        axes, engine = rig.session.axes, rig.session.engine
        null = "Error=301 (there is no open device)"
        assert rig.ask(lambda: axes.set_on([0, 1], [1, 0])) == Answer(
            False, f"Failed to set axis 0 on. {null}; Failed to set axis 1 off. {null}; "
        )
        for job, what in (
            (lambda: axes.clear_alarm([0]), "Failed to clear alarm axis 0"),
            (lambda: axes.set_mode([0], [1]), "Failed to set axis 0 mode 1"),
            (lambda: axes.set_polarity([0], [1]), "Failed to set polarity on axis 0"),
            (lambda: axes.set_gear_ratio([0], [1.0], [1.0]), "Failed to set gear ratio on axis 0"),
            (lambda: axes.homing([0]), "Failed to homing axis 0"),
            (lambda: axes.stop([0]), "Failed to stop axis 0"),
        ):
            assert rig.ask(job) == Answer(False, f"{what}. {null}; ")
        for job, what in (
            (lambda: engine.set_device(False, "", ""), "Failed to close device"),
            (lambda: engine.set_comm(True), "Failed to start communication"),
            (lambda: engine.set_comm(False), "Failed to stop communication"),
            (lambda: engine.estop(True), "Failed to execute emergency stop"),
            (lambda: engine.estop(False), "Failed to release emergency stop"),
        ):
            assert rig.ask(job) == Answer(False, f"{what}. {null}")
        assert rig.ask(engine.get_status) == Answer(True, "Unknown")
        assert rig.log.wait("engine status: Error=301")

    def test_creation_that_fails(self, rig: Rig) -> None:
        rig.start()
        answer = rig.ask(lambda: rig.session.engine.set_device(True, "/nowhere", "other"))
        assert answer == Answer(False, "Failed to create device. Error=263 (no engine is running there)")

    def test_creation_outwaits_a_lock_and_gives_up_on_one_that_stays(self, rig: Rig) -> None:
        rig.start()
        assert rig.ask(lambda: rig.session.engine.set_device(False, "", "")) == Answer(True, "Device stopped")
        rig.refusals = [297]
        created = Answer(True, "Created a device with name: again")
        assert rig.ask(lambda: rig.session.engine.set_device(True, "", "again")) == created
        assert rig.ask(lambda: rig.session.engine.set_device(False, "", "")) == Answer(True, "Device stopped")
        rig.refusals = [297] * 100_000
        answer = rig.ask(lambda: rig.session.engine.set_device(True, "", "again"))
        assert answer == Answer(False, "Failed to create device. Error=297 (refused by the test)")

    def test_a_second_creation_renames(self, rig: Rig, harness: ThreadHarness) -> None:
        rig.start()
        created = Answer(True, "Created a device with name: WMX3Device")
        assert rig.ask(lambda: rig.session.engine.set_device(True, "/opt/lmx/", "WMX3Device")) == created
        assert rig.opened == 1
        _, devices = harness.connect().api.GetAllDevices()
        assert sorted(device.name for device in devices.devices) == ["WMX3Device", "test"]

    def test_a_closed_device_stays_closed(self, rig: Rig) -> None:
        rig.start()
        assert rig.ask(lambda: rig.session.engine.set_device(False, "", "")) == Answer(True, "Device stopped")
        count = rig.opened
        ticks = time.monotonic() + 0.1
        wait_for(lambda: time.monotonic() > ticks, "some ticks")
        assert rig.opened == count
        again = rig.ask(lambda: rig.session.engine.set_device(False, "", ""))
        assert again == Answer(False, "Failed to close device. Error=301 (there is no open device)")

    def test_an_engine_that_was_stopped_is_found_again(self, rig: Rig, harness: ThreadHarness) -> None:
        rig.start()
        assert harness.connect().api.StopEngine(20000) == 0
        rig.log.wait("the motion engine has ended")
        wait_for(lambda: rig.opened >= 2 and rig.session.device.engine is not None, "another device")

    def test_an_engine_that_hangs_has_no_state_and_no_command_waits_for_it(self, harness: ThreadHarness) -> None:
        harness.config = harness.config.model_copy(update={"call_timeout_s": 0.3, "status_stale_s": 0.2})
        rig = Rig(harness, command_max_wait_s=0.05)
        onlooker = rig.up()
        wait_for(lambda: rig.states, "states")
        resume, exchange = threading.Event(), harness.drives.exchange

        def hangs(out: Any, inp: Any) -> bool:
            resume.wait(10.0)
            return exchange(out, inp)

        harness.drives.exchange = hangs  # type: ignore[method-assign]
        wait_for(lambda: rig.session.problem, "the silence")
        count = len(rig.states)
        rig.move(rig.session.motion.go_to, [POS], [1.0], [9.0], [9.0], [9.0])
        rig.log.wait("topic refused: no status of the engine: Error=271")
        assert rig.ask(rig.session.engine.get_status) == Answer(True, "Unknown")
        assert len(rig.states) == count
        resume.set()
        wait_for(lambda: len(rig.states) > count + 2, "states again")
        assert not status(onlooker).op_state.any()
        rig.session.end()

    def test_a_command_that_the_engine_took_without_an_answer_is_taken_back(self, harness: ThreadHarness) -> None:
        """The engine stalls with the command in its socket and executes it when it continues."""
        harness.config = harness.config.model_copy(update={"call_timeout_s": 0.2})
        rig = Rig(harness)
        onlooker = rig.up()
        resume, exchange, began = threading.Event(), harness.drives.exchange, threading.Event()

        def hangs(out: Any, inp: Any) -> bool:
            began.set()
            resume.wait(10.0)
            return exchange(out, inp)

        harness.drives.exchange = hangs  # type: ignore[method-assign]
        assert began.wait(10.0)
        rig.move(rig.session.motion.run, [VEL], [3.0], [100.0], [100.0])
        rig.log.wait("topic refused: the engine refuses it: Error=270")
        resume.set()
        rig.log.wait("axis 1 is stopped: the engine did not answer to its command")
        wait_status(onlooker, at_rest(VEL), "standstill")
        ended = some_cycles(onlooker, 20)
        assert ended.velocity_cmd[VEL] == 0.0
        rig.session.end()


class TestCommunication:
    def test_up_and_down(self, rig: Rig) -> None:
        rig.start()
        status_of = rig.session.engine.get_status
        assert rig.ask(status_of) == Answer(True, "Running")
        assert not any(state.communicating for state in rig.states)
        assert rig.ask(lambda: rig.session.engine.set_comm(True)) == Answer(True, "Communication is started")
        assert rig.ask(status_of) == Answer(True, "Communicating")
        wait_for(lambda: len(rig.states) > 2, "states")
        assert rig.ask(lambda: rig.session.engine.set_comm(False)) == Answer(True, "Communication is stopped")
        assert rig.ask(status_of) == Answer(True, "Running")

    def test_a_bus_that_does_not_answer(self, rig: Rig, harness: ThreadHarness) -> None:
        harness.drives.connected = False
        rig.start()
        answer = rig.ask(lambda: rig.session.engine.set_comm(True))
        text = "Failed to start communication. Error=1285 (communication did not start in the given time)"
        assert answer == Answer(False, text)

    def test_axes_stand_before_the_bus_ends(self, rig: Rig, harness: ThreadHarness) -> None:
        onlooker = rig.up()
        rig.move(rig.session.motion.run, [VEL], [3.0], [50.0], [10.0])
        wait_status(onlooker, lambda now: now.velocity_cmd[VEL] == 3.0, "cruise")
        speeds: list[float] = []
        exchange = harness.drives.exchange

        def watched(out: Any, inp: Any) -> bool:
            if harness.engine.condition.communicating:
                speeds.append(float(harness.engine.arrays.reals[Real.VELOCITY_CMD, VEL]))
            return exchange(out, inp)

        harness.drives.exchange = watched  # type: ignore[method-assign]
        assert rig.ask(lambda: rig.session.engine.set_comm(False)) == Answer(True, "Communication is stopped")
        assert speeds[0] > 2.0
        assert max(before - after for before, after in pairwise(speeds)) < 0.1  # 10 rad/s^2 in steps of 1 ms
        assert speeds[-1] == 0.0


class TestServos:
    def test_servo_request_answers_after_drives_confirm(self, rig: Rig, harness: ThreadHarness) -> None:
        onlooker = harness.communicating()
        rig.start()
        assert rig.ask(lambda: rig.session.axes.set_on([0, 2], [1, 1])) == Answer(
            True, "Set axis 0 on; Set axis 2 on; "
        )
        assert status(onlooker).servo_on.tolist() == [True, False, True, False, False]
        assert rig.ask(lambda: rig.session.axes.set_on([2], [0])) == Answer(True, "Set axis 2 off; ")
        assert not status(onlooker).servo_on[2]

    def test_every_axis_is_tried_and_every_failure_named(self, rig: Rig, harness: ThreadHarness) -> None:
        harness.communicating()
        harness.drives.broken[1] = True
        harness.drives.stubborn = True
        harness.drives.alarms[2] = 42
        onlooker = harness.connect("onlooker")
        wait_status(onlooker, lambda now: now.amp_alarm[2], "alarm")
        rig.start()
        answer = rig.ask(lambda: rig.session.axes.set_on([1, 2, 0, 9, -1, 3], [1, 1, 1, 1, 1, 2]))
        assert not answer.success
        assert answer.message.split("; ") == [
            "Failed to set axis 1 on. Error=1567 (the servo is off)",
            "Failed to set axis 2 on. Error=1568 (the axis has an alarm)",
            "Set axis 0 on",
            "Failed to set axis 9 on. Error=1547 (the axis number is out of range)",
            "Failed to set axis -1 on. Error=1547 (the axis number is out of range)",
            "Invalid servo value for axis 3: 2",
            "",
        ]

    def test_slow_servo_request_does_not_block_state_or_other_requests(self, rig: Rig, harness: ThreadHarness) -> None:
        harness.communicating()
        harness.drives.broken[1] = True
        rig.start()
        answers: list[Answer] = []
        rig.session.worker.ask(lambda: rig.session.axes.set_on([1], [1]), answers.append)
        count = len(rig.states)
        assert rig.ask(lambda: rig.session.axes.set_on([0], [1])) == Answer(True, "Set axis 0 on; ")
        assert answers == []
        wait_for(lambda: answers, "the slow answer")
        assert not answers[0].success
        assert len(rig.states) > count + 5  # 0.3 s

    def test_missing_bus_and_emergency_stop_keep_servos_off(self, rig: Rig, harness: ThreadHarness) -> None:
        onlooker = harness.connect()
        rig.start()
        short = Answer(False, "data has 1 entry, index has 2 entries: they must be equally long")
        assert rig.ask(lambda: rig.session.axes.set_on([0, 1], [1])) == short
        answer = rig.ask(lambda: rig.session.axes.set_on([0], [1]))
        assert answer == Answer(False, "Failed to set axis 0 on. Error=1537 (communication is not started); ")
        assert onlooker.api.StartCommunication(20000) == 0
        homing = rig.ask(lambda: rig.session.axes.homing([0, 77]))
        assert homing.message.split("; ") == [
            "Failed to homing axis 0. Error=65556 (the servo is not on)",
            "Failed to homing axis 77. Error=1547 (the axis number is out of range)",
            "",
        ]
        rig.session.stop()
        answer = rig.ask(lambda: rig.session.axes.set_on([0], [1]))
        assert answer == Answer(False, "Failed to set axis 0 on. Error=65632 (an emergency stop is active); ")
        rig.session.release()
        assert rig.ask(lambda: rig.session.axes.set_on([0], [1])).success


class TestAlarms:
    def test_cleared_when_it_is_gone(self, rig: Rig, harness: ThreadHarness) -> None:
        onlooker = rig.up()
        harness.drives.stubborn = True
        harness.drives.alarms[0] = 42
        wait_status(onlooker, lambda now: now.amp_alarm[0], "alarm")
        answer = rig.ask(lambda: rig.session.axes.clear_alarm([0]))
        assert answer == Answer(False, "Failed to clear alarm axis 0. Error=1568 (the axis has an alarm); ")
        harness.drives.stubborn = False
        assert rig.ask(lambda: rig.session.axes.clear_alarm([0, 1])) == Answer(
            True, "Cleared alarm axis 0; Cleared alarm axis 1; "
        )
        assert not status(onlooker).amp_alarm.any()


class TestModes:
    def test_both_modes_and_an_invalid_one(self, rig: Rig) -> None:
        onlooker = rig.up()
        answer = rig.ask(lambda: rig.session.axes.set_mode([POS, VEL, POS_MIRRORED], [1, 0, 2]))
        assert answer == Answer(
            False, "Set axis 0 in Velocity mode; Set axis 1 in Position mode; Invalid mode 2 for axis 2; "
        )
        assert status(onlooker).command_mode[:3].tolist() == [1, 0, 0]

    def test_refused_while_the_axis_moves(self, rig: Rig) -> None:
        onlooker = rig.up()
        rig.move(rig.session.motion.run, [VEL], [1.0], [50.0], [50.0])
        wait_status(onlooker, moving(VEL), "motion")
        text = "Error=1546 (the axis is not idle); "
        answers = [
            rig.ask(lambda: rig.session.axes.set_mode([VEL], [0])).message,
            rig.ask(lambda: rig.session.axes.set_polarity([VEL], [1])).message,
            rig.ask(lambda: rig.session.axes.set_gear_ratio([VEL], [1.0], [1.0])).message,
        ]
        assert answers == [
            f"Failed to set axis 1 mode 0. {text}",
            f"Failed to set polarity on axis 1. {text}",
            f"Failed to set gear ratio on axis 1. {text}",
        ]
        assert moving(VEL)(status(onlooker))

    def test_an_axis_stopped_by_velocity_zero_counts_as_at_rest(self, rig: Rig) -> None:
        onlooker = rig.up()
        rig.move(rig.session.motion.run, [VEL], [1.0], [50.0], [50.0])
        wait_status(onlooker, moving(VEL), "motion")
        rig.move(rig.session.motion.run, [VEL], [0.0], [50.0], [50.0])
        wait_status(onlooker, lambda now: now.velocity_cmd[VEL] == 0.0, "standstill")
        assert not at_rest(VEL)(status(onlooker))  # the engine still counts it as a motion
        assert rig.ask(lambda: rig.session.axes.set_mode([VEL], [0])).success

    def test_polarity_and_gear(self, rig: Rig) -> None:
        onlooker = rig.up()
        config = onlooker.core_motion.config
        assert rig.ask(lambda: rig.session.axes.set_polarity([0, 1, 2], [-1, 1, 0])) == Answer(
            False, "Set polarity on axis 0; Set polarity on axis 1; Invalid polarity value for axis 2: 0; "
        )
        assert config.GetAxisPolarity(0) == (0, -1)
        answer = rig.ask(lambda: rig.session.axes.set_gear_ratio([0, 1], [1000.0, 0.0], [2.0, 2.0]))
        first, second, _ = answer.message.split("; ")
        assert first == "Set gear ratio on axis 0"
        assert second.startswith("Failed to set gear ratio on axis 1. Error=")
        assert config.GetGearRatio(0) == (0, 1000.0, 2.0)
        nan = rig.ask(lambda: rig.session.axes.set_gear_ratio([0], [float("nan")], [2.0]))
        assert nan == Answer(False, "numerator[0] is nan: it must be finite")
        short = rig.ask(lambda: rig.session.axes.set_gear_ratio([0], [1.0], []))
        assert short == Answer(False, "denominator has 0 entries, index has 1 entry: they must be equally long")


class TestHoming:
    def test_the_present_position_becomes_home(self, rig: Rig) -> None:
        onlooker = rig.up()
        rig.move(rig.session.motion.go_to, [POS], [10.0], [100.0], [100.0], [0.4])
        wait_status(onlooker, lambda now: now.pos_cmd[POS] == 0.4 and at_rest(POS)(now), "target")
        assert rig.ask(lambda: rig.session.axes.homing([POS, 1])) == Answer(True, "Homing axis 0; Homing axis 1; ")
        assert status(onlooker).pos_cmd[POS] == 0.0
        assert status(onlooker).home_done[:2].all()


class TestMotion:
    def test_a_refused_list_moves_nothing(self, rig: Rig) -> None:
        onlooker = rig.up()
        rig.move(rig.session.motion.go_to, [POS, VEL], [1.0] * 2, [1.0] * 2, [1.0] * 2, [9.0] * 2)
        rig.log.wait("topic refused: axis 1 is not in position mode")
        rig.move(rig.session.motion.go_to, [POS, POS_MIRRORED], [1.0, 1e300], [1.0] * 2, [1.0] * 2, [9.0] * 2)
        rig.log.wait("topic refused: the engine refuses it: Error=65581")
        assert not status(onlooker).op_state.any()
        assert rig.session.refused == 2

    def test_repeated_rejections_are_logged_at_limited_rate(self, rig: Rig) -> None:
        rig.up()
        for number in range(200):
            rig.move(rig.session.motion.go_to, [POS], [1.0], [1.0], [-0.5 - 0.001 * number], [9.0])
        wait_for(lambda: rig.session.refused == 200, "refusals")
        reported = [line for line in rig.log.lines if "refused" in line]
        assert 1 <= len(reported) < 20
        assert reported[0] == "error topic refused: dec[0] is -0.5: it must be above 0"

    def test_relative_over_a_running_motion_counts_from_where_the_axis_is(self, rig: Rig) -> None:
        onlooker = rig.up()
        rig.move(rig.session.motion.go_to, [POS], [2.0], [1000.0], [1000.0], [50.0])
        before = wait_status(onlooker, lambda now: now.pos_cmd[POS] > 0.5, "motion").pos_cmd[POS]
        rig.move(rig.session.motion.go_by, [POS], [20.0], [1000.0], [1000.0], [1.0])
        ended = wait_status(onlooker, at_rest(POS), "the end").pos_cmd[POS]
        assert before + 1.0 <= ended < 20.0  # not 51, which the engine's own relative motion would reach

    def test_relative_from_rest_is_exact(self, rig: Rig) -> None:
        onlooker = rig.up()
        for step in (1, 2):
            rig.move(rig.session.motion.go_by, [POS], [20.0], [1000.0], [1000.0], [0.25])
            wait_status(onlooker, lambda now, step=step: now.pos_cmd[POS] == 0.25 * step and at_rest(POS)(now), "step")

    def test_stop_stops_all_at_once_and_answers_at_standstill(self, rig: Rig) -> None:
        onlooker = rig.up()
        rig.move(rig.session.motion.run, [VEL], [3.0], [100.0], [20.0])
        rig.move(rig.session.motion.go_to, [POS], [3.0], [100.0], [20.0], [1e4])
        wait_status(onlooker, lambda now: moving(POS)(now) and moving(VEL)(now), "motion")
        answer = rig.ask(lambda: rig.session.axes.stop([POS, VEL, POS_MIRRORED, 99]))
        assert answer == Answer(
            False,
            "Stopped axis 0; Stopped axis 1; Stopped axis 2; "
            "Failed to stop axis 99. Error=1547 (the axis number is out of range); ",
        )
        assert not status(onlooker).op_state.any()

    def test_silence_ends_a_velocity_where_a_time_out_is_set(self, harness: ThreadHarness) -> None:
        rig = Rig(harness, velocity_timeout_s=0.2)
        onlooker = rig.up()
        try:
            for _ in range(3):
                rig.move(rig.session.motion.run, [VEL], [1.0], [100.0], [10.0])
                wait_status(onlooker, moving(VEL), "motion")
            wait_status(onlooker, lambda now: at_rest(VEL)(now) and now.velocity_cmd[VEL] == 0.0, "rest")
        finally:
            rig.session.end()

    def test_an_order_that_waited_too_long_is_refused(self, harness: ThreadHarness) -> None:
        rig = Rig(harness, command_max_wait_s=0.05)
        onlooker = rig.up()
        try:
            hold = threading.Event()
            rig.session.worker.order(lambda: hold.wait(10.0))
            rig.move(rig.session.motion.go_to, [POS], [1.0], [1.0], [1.0], [9.0])
            late = time.monotonic() + 0.1
            wait_for(lambda: time.monotonic() > late, "an order that is late")
            hold.set()
            assert "at most 0.05 s" in rig.log.wait("topic refused: it waited")
            assert not status(onlooker).op_state.any()
        finally:
            rig.session.end()


class TestEmergencyStop:
    def test_own_axes_stop_and_nothing_starts(self, rig: Rig, harness: ThreadHarness) -> None:
        onlooker = rig.up()
        other = harness.connect("other")
        rig.move(rig.session.motion.run, [VEL], [3.0], [100.0], [0.1])
        wait_status(onlooker, lambda now: now.velocity_cmd[VEL] == 3.0, "cruise")
        assert other.core_motion.motion.StartPos(pos(POS, 1e4)) == 0
        wait_status(onlooker, lambda now: moving(POS)(now), "motion of another client")
        began_s = status(onlooker).engine_time_s
        rig.session.stop()
        ended_s = wait_status(onlooker, at_rest(VEL), "standstill").engine_time_s
        assert ended_s - began_s < 15.0  # 30 s with its own deceleration, 15 ms with the quick stop's
        assert not at_rest(POS)(status(onlooker))
        rig.move(rig.session.motion.run, [VEL], [3.0], [100.0], [100.0])
        rig.log.wait("topic refused: /emergency_stop is in force")
        release = rig.ask(lambda: rig.session.engine.estop(False))
        assert release == Answer(False, "Failed to release emergency stop: /emergency_stop is in force")
        rig.session.release()
        rig.move(rig.session.motion.run, [VEL], [3.0], [100.0], [100.0])
        wait_status(onlooker, moving(VEL), "motion again")

    def test_of_the_engine(self, rig: Rig) -> None:
        onlooker = rig.up()
        rig.move(rig.session.motion.run, [VEL], [3.0], [100.0], [1.0])
        wait_status(onlooker, moving(VEL), "motion")
        executed = Answer(True, "Emergency stop is executed")
        assert rig.ask(lambda: rig.session.engine.estop(True)) == executed
        wait_status(onlooker, at_rest(VEL), "standstill")
        rig.move(rig.session.motion.run, [VEL], [3.0], [100.0], [1.0])
        rig.log.wait("topic refused: the engine's emergency stop is active")
        released = Answer(True, "Emergency stop is released")
        assert rig.ask(lambda: rig.session.engine.estop(False)) == released
        assert not status(onlooker).emergency_stop


class TestState:
    def test_state_is_published_from_first_tick(self, harness: ThreadHarness) -> None:
        """The state is published with all servos off until an engine exists, and also while its bus is not running."""
        rig = Rig(harness)
        rig.refusals = [ErrorCode.IMLibIsNotRunning] * 3
        rig.start()
        wait_for(lambda: any(state.engine_state is EngineState.Running for state in rig.states), "the engine's state")
        rig.session.end()
        assert rig.session.worker.failure is None
        first = rig.states[0]
        assert (first.engine_state, first.n_axes) == (EngineState.Unknown, 5)
        assert not first.servo_on.any()


class TestEnd:
    def test_own_axes_are_stopped_with_their_own_deceleration(self, harness: ThreadHarness) -> None:
        rig = Rig(harness)
        onlooker = rig.up()
        rig.move(rig.session.motion.run, [VEL], [2.0], [100.0], [20.0])
        wait_status(onlooker, moving(VEL), "motion")
        rig.session.end()
        assert rig.session.worker.failure is None
        assert at_rest(VEL)(status(onlooker))
        assert status(onlooker).servo_on.all()  # bus and servos stay on
        assert status(onlooker).communicating

    def test_an_axis_that_another_client_has_taken_over_is_not_its_own_any_more(self, harness: ThreadHarness) -> None:
        rig = Rig(harness)
        onlooker = rig.up()
        rig.move(rig.session.motion.run, [VEL], [2.0], [100.0], [20.0])
        wait_status(onlooker, moving(VEL), "motion")
        assert onlooker.core_motion.velocity.StartVel(vel(VEL, 1.0)) == 0
        some_cycles(onlooker, 10)
        rig.session.end()
        ended = some_cycles(onlooker, 300)
        assert ended.velocity_cmd[VEL] == 1.0

    @pytest.mark.parametrize("own", [True, False])
    def test_only_a_bus_that_this_node_started_may_end_with_it(self, harness: ThreadHarness, own: bool) -> None:
        onlooker = harness.connect() if own else harness.communicating()
        rig = Rig(harness, stop_communication_at_exit=True).start()
        assert rig.ask(lambda: rig.session.engine.set_comm(True)) == Answer(True, "Communication is started")
        rig.session.end()
        after = EngineState.Running if own else EngineState.Communicating
        wait_status(onlooker, lambda now: now.engine_state is after, "the state after the end")
        assert some_cycles(onlooker, 20).engine_state is after

    def test_an_error_of_the_thread_is_kept_for_the_node(self, harness: ThreadHarness) -> None:
        rig = Rig(harness)
        rig.start()

        def broken() -> None:
            raise RuntimeError("broken")

        rig.session.worker.order(broken)
        wait_for(lambda: rig.session.worker.failure, "the failure")
        assert rig.session.device.engine is None
        assert str(rig.session.worker.failure) == "broken"
