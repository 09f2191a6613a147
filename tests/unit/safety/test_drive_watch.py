"""The drives' history, tick by tick. The times are binary fractions, so limits can be met exactly."""

from __future__ import annotations

import math

import pytest

from robot_stack.contract.model import SafetyAction
from robot_stack.safety.drive_watch import DriveWatch
from robot_stack.safety.inputs import CLEAR, Axis, DriveReading, Finding, Level

GOOD = Axis(True, False, False)
OFF, ALARM, FOLLOWING = Axis(False, False, False), Axis(True, True, False), Axis(True, False, True)
NO_ENGINE = "the motion engine does not communicate"


class Drives:
    def __init__(self) -> None:
        times = {
            "silence_s": 0.125,
            "servo_off_s": 0.25,
            "servo_on_timeout_s": 2.0,
            "startup_grace_s": 8.0,
            "startup_settle_s": 0.5,
        }
        self.watch = DriveWatch(**times, now_s=16.0)
        self.cycle = 0

    def look(
        self, now_s: float, *axes: Axis, communicating: bool = True, emergency: bool = False, complete: bool = True
    ) -> Finding:
        """Feeds a new cycle with the given first axes; the other axes are good."""
        self.cycle += 1
        all_axes = (*axes, *[GOOD] * (8 - len(axes)))
        self.watch.received(DriveReading(communicating, self.cycle, all_axes), now_s)
        return self.watch.judge(emergency, complete, now_s)

    def up(self) -> Drives:
        """Brings the drives up at 17.0 s."""
        for now_s in (16.375, 16.5, 16.625, 16.75, 16.875):
            assert self.look(now_s).level is Level.WAITING
        assert self.look(17.0) == CLEAR
        return self


def waiting(detail: str) -> Finding:
    return Finding(Level.WAITING, SafetyAction.STOP, None, detail)


def fault(detail: str) -> Finding:
    return Finding(Level.PRESENT, SafetyAction.EMERGENCY_STOP, None, detail)


def test_waits_for_the_engine_and_then_gives_up() -> None:
    drives = Drives()
    assert drives.watch.judge(False, True, 16.0) == waiting(NO_ENGINE)
    assert drives.watch.judge(False, True, 24.0) == waiting(NO_ENGINE)
    assert drives.watch.judge(False, True, 24.001) == fault(NO_ENGINE)


def test_first_status_alone_does_not_settle() -> None:
    drives = Drives()
    assert drives.look(17.0) == waiting(NO_ENGINE)
    assert drives.look(17.0) == waiting("settling")


def test_a_stutter_while_starting_starts_the_settling_again() -> None:
    drives = Drives()
    drives.look(17.0)
    for now_s in (17.0, 17.125, 17.25, 17.375):
        assert drives.look(now_s) == waiting("settling")
    assert drives.watch.judge(False, True, 17.5625) == waiting(NO_ENGINE)
    for now_s in (17.625, 17.75, 17.875, 18.0):
        assert drives.look(now_s) == waiting("settling")
    assert drives.look(18.125) == CLEAR


def test_settling_begins_when_the_stack_is_complete() -> None:
    drives = Drives()
    for now_s in (17.0, 17.125, 17.25, 17.375, 17.5, 17.625):
        assert drives.look(now_s, complete=False).level is Level.WAITING
    for now_s in (17.75, 17.875, 18.0, 18.125):
        assert drives.look(now_s) == waiting("settling")
    assert drives.look(18.25) == CLEAR


def test_drive_that_is_up_needs_no_other_input() -> None:
    drives = Drives().up()
    assert drives.look(17.1, complete=False) == CLEAR
    drives.watch.released(17.1)
    assert drives.look(17.2, complete=False) == CLEAR
    assert drives.look(17.3, OFF, complete=False) == Finding(Level.UNKNOWN)


def test_settling_may_outlast_the_grace() -> None:
    drives = Drives()
    drives.look(23.875)
    for now_s in (23.875, 24.0, 24.125, 24.25):
        assert drives.look(now_s) == waiting("settling")
    assert drives.look(24.375) == CLEAR


@pytest.mark.parametrize(
    ("axis", "detail"), [(OFF, "servo off"), (ALARM, "amplifier alarm"), (FOLLOWING, "following error")]
)
def test_waits_for_good_axes_and_then_gives_up(axis: Axis, detail: str) -> None:
    drives = Drives()
    drives.look(16.5, axis)
    assert drives.look(17.0, axis) == waiting(f"{detail}: fl_drive")
    assert drives.look(24.0, axis) == waiting(f"{detail}: fl_drive")
    assert drives.look(24.001, axis) == fault(f"{detail}: fl_drive")


def test_once_up_it_never_waits_again() -> None:
    drives = Drives().up()
    assert drives.look(17.5, ALARM) == fault("amplifier alarm: fl_drive")
    assert drives.look(17.5, FOLLOWING) == fault("following error: fl_drive")
    assert drives.look(17.5) == CLEAR
    assert drives.watch.judge(False, True, 18.0) == fault(NO_ENGINE)


def test_every_bad_axis_is_named() -> None:
    drives = Drives().up()
    assert drives.look(18.0, GOOD, ALARM, GOOD, ALARM) == fault("amplifier alarm: fl_steer, fr_steer")


def test_an_alarm_is_named_before_a_following_error() -> None:
    assert Drives().up().look(18.0, FOLLOWING, ALARM) == fault("amplifier alarm: fl_steer")


def test_silence_counts_from_the_last_new_cycle() -> None:
    drives = Drives().up()
    assert drives.watch.judge(False, True, 17.125) == CLEAR
    assert drives.watch.judge(False, True, 17.1251) == fault(NO_ENGINE)


def test_a_cycle_that_stands_still_is_silence() -> None:
    drives = Drives().up()
    for now_s in (17.05, 17.1, 17.2):
        drives.watch.received(DriveReading(True, drives.cycle, (GOOD,) * 8), now_s)
    assert drives.watch.judge(False, True, 17.2) == fault(NO_ENGINE)


def test_cycles_without_communication_are_silence() -> None:
    drives = Drives().up()
    assert drives.look(17.1, communicating=False) == CLEAR
    assert drives.look(17.2, communicating=False) == fault(NO_ENGINE)
    assert drives.look(17.25) == CLEAR


@pytest.mark.parametrize("reading", [None, DriveReading(True, 99, (GOOD,) * 7), DriveReading(True, 99, ())])
def test_no_reading_is_silence(reading: DriveReading | None) -> None:
    drives = Drives().up()
    drives.watch.received(reading, 17.2)
    assert drives.watch.judge(False, True, 17.2) == fault(NO_ENGINE)


def test_axes_beyond_the_robots_own_are_no_concern() -> None:
    drives = Drives().up()
    drives.watch.received(DriveReading(True, 99, (*[GOOD] * 8, ALARM, OFF)), 17.1)
    assert drives.watch.judge(False, True, 17.1) == CLEAR


def test_a_servo_off_is_a_fault_after_its_time() -> None:
    drives = Drives().up()
    unknown = Finding(Level.UNKNOWN)
    assert drives.look(18.0, OFF) == unknown
    assert drives.look(18.25, OFF) == unknown
    assert drives.look(18.2501, OFF) == fault("servo off: fl_drive")
    assert drives.look(18.3) == CLEAR
    assert drives.look(18.4, OFF) == unknown


def test_servo_off_during_an_emergency_stop_is_expected() -> None:
    drives = Drives().up()
    assert drives.look(18.0, OFF, emergency=True) == CLEAR
    assert drives.look(28.0, OFF, emergency=True) == CLEAR
    assert drives.look(28.0, OFF, ALARM, emergency=True) == fault("amplifier alarm: fl_steer")
    assert drives.look(28.0, OFF) == fault("servo off: fl_drive")


def test_after_a_release_servos_may_take_their_time() -> None:
    drives = Drives().up()
    drives.look(18.0, OFF, emergency=True)
    drives.watch.released(20.0)
    assert drives.look(20.0, OFF) == waiting("servo off: fl_drive")
    assert drives.look(22.0, OFF) == waiting("servo off: fl_drive")
    assert drives.look(22.001, OFF) == fault("servo off: fl_drive")


def test_after_a_release_only_servos_may_take_their_time() -> None:
    drives = Drives().up()
    drives.watch.released(20.0)
    assert drives.look(20.5, ALARM) == fault("amplifier alarm: fl_drive")
    assert drives.look(21.0) == CLEAR
    assert drives.look(21.1, OFF) == Finding(Level.UNKNOWN)  # the servos were back: the grace period has ended


def test_an_emergency_while_starting_does_not_use_up_the_patience() -> None:
    drives = Drives()
    drives.look(17.0, OFF)
    assert drives.look(30.0, OFF, emergency=True) == CLEAR
    drives.watch.released(31.0)
    assert drives.look(32.0, OFF) == waiting("servo off: fl_drive")


@pytest.mark.parametrize("now_s", [10.0, math.nan])
def test_time_that_misbehaves_is_a_fault(now_s: float) -> None:
    assert Drives().up().watch.judge(False, True, now_s) == fault(NO_ENGINE)
    assert Drives().watch.judge(False, True, now_s) == fault(NO_ENGINE)
