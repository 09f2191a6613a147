"""Compliance with the speed limit: a falling limit must be followed along the permitted ramp."""

from __future__ import annotations

import pytest

from robot_stack.contract.model import SafetyAction
from robot_stack.core.geometry import ZERO_TWIST, Twist2
from robot_stack.core.limits import SpeedLimit
from robot_stack.safety.inputs import CLEAR, Level
from robot_stack.safety.overspeed import OverspeedWatch, PermittedSpeed
from robot_stack.safety.params import OverspeedParams
from tests.unit.safety.story import ROBOT

P = OverspeedParams(hold_s=0.25, margin_mps=0.1, margin_radps=0.2, notice_s=0.25, deceleration_share=0.5)
OWN = SpeedLimit(1.5, 1.0)
TICK_S = 0.0625


def test_permitted_speed_falls_after_the_notice_and_rises_at_once() -> None:
    speed = PermittedSpeed(1.5)
    seen = [speed.update(0.5, 0.125, 2.0, tick * TICK_S) for tick in range(14)]
    assert seen == [1.5, 1.5, 1.5, 1.375, 1.25, 1.125, 1.0, 0.875, 0.75, 0.625, 0.5, 0.5, 0.5, 0.5]
    assert speed.update(1.2, 0.125, 2.0, 1.0) == 1.2
    assert speed.update(1.0, 0.125, 2.0, 1.1) == 1.2  # each fall has its own notice time
    assert speed.update(1.0, 0.125, 2.0, 0.0) == 1.2  # a clock that jumps backwards restarts it
    assert speed.update(1.0, 0.125, 2.0, 1.0) == 1.0


class Rig:
    def __init__(self) -> None:
        self.watch = OverspeedWatch(P, OWN, brake_mps2=2.0)
        self.now_s = 0.0

    def seconds_until_fault(
        self, limit: SpeedLimit, twist: Twist2, *, hard: bool = False, passenger: bool = False
    ) -> float | None:
        begun_s = self.now_s
        while self.now_s - begun_s < 8.0:
            self.watch.limited(limit, hard, ROBOT.motion(passenger), self.now_s)
            finding = self.watch.judge(twist, self.now_s)
            if finding is not CLEAR:
                assert (finding.level, finding.action) == (Level.PRESENT, SafetyAction.EMERGENCY_STOP)
                return self.now_s - begun_s
            self.now_s += TICK_S
        return None


@pytest.mark.parametrize(
    ("twist", "obeys"),
    [
        (Twist2(1.6, 0.0, 0.0), True),
        (Twist2(1.61, 0.0, 0.0), False),
        (Twist2(-1.61, 0.0, 0.0), False),
        (Twist2(1.2, 1.2, 0.0), False),
        (Twist2(0.0, 0.0, 1.2), True),
        (Twist2(0.0, 0.0, 1.21), False),
        (Twist2(0.0, 0.0, -1.21), False),
    ],
)
def test_faster_than_the_limit_and_its_margin_for_the_holding_time(twist: Twist2, obeys: bool) -> None:
    assert Rig().seconds_until_fault(OWN, twist) == (None if obeys else pytest.approx(P.hold_s + TICK_S))


def test_a_moment_is_no_disobedience() -> None:
    rig = Rig()
    for _ in range(20):
        for twist in (*[Twist2(2.0, 0.0, 0.0)] * 5, ZERO_TWIST):
            assert rig.watch.judge(twist, rig.now_s) is CLEAR
            rig.now_s += TICK_S


def test_a_hard_stop_is_expected_sooner_than_a_gentle_one() -> None:
    stop, twist = SpeedLimit(0.0, 0.0), Twist2(1.5, 0.0, 0.0)
    hard_s, gentle_s = (Rig().seconds_until_fault(stop, twist, hard=hard) for hard in (True, False))
    aboard_s = Rig().seconds_until_fault(stop, twist, passenger=True)
    # notice, then after 0.1 m/s / (0.5 x deceleration) less than 1.4 m/s of 1.5 is permitted, then the holding time
    assert hard_s == pytest.approx(0.25 + 0.1 / 1.0 + 0.25, abs=2 * TICK_S)
    jerk_s = ROBOT.empty.max_acceleration_mps2 / ROBOT.empty.max_jerk_mps3
    gentle_mps2, aboard_mps2 = ROBOT.empty.max_acceleration_mps2, ROBOT.with_passenger.max_acceleration_mps2
    assert gentle_s == pytest.approx(0.25 + jerk_s + 0.1 / (0.5 * gentle_mps2) + 0.25, abs=2 * TICK_S)
    assert aboard_s == pytest.approx(0.25 + jerk_s + 0.1 / (0.5 * aboard_mps2) + 0.25, abs=2 * TICK_S)


def test_a_turn_is_expected_to_end_with_its_own_deceleration() -> None:
    stop, turn = SpeedLimit(0.0, 0.0), Twist2(0.0, 0.0, 0.9)
    motion = ROBOT.with_passenger
    jerk_s = motion.max_acceleration_mps2 / motion.max_jerk_mps3
    ramp_s = 0.3 / (0.5 * motion.max_yaw_acceleration_radps2)  # from 1.0 to 0.7 rad/s, plus the margin
    took_s = Rig().seconds_until_fault(stop, turn, passenger=True)
    assert took_s == pytest.approx(0.25 + jerk_s + ramp_s + 0.25, abs=2 * TICK_S)


def test_falling_limit_gives_notice_again() -> None:
    speed = PermittedSpeed(1.0)
    for tick in range(100):
        speed.update(1.0, 0.125, 2.0, tick * TICK_S)
    assert speed.update(0.5, 0.125, 2.0, 100 * TICK_S) == 1.0
    assert speed.update(0.5, 0.125, 2.0, 102 * TICK_S) == 1.0
    assert speed.update(0.5, 0.125, 2.0, 103 * TICK_S) == 0.875


@pytest.mark.parametrize("passenger", [False, True])
def test_the_ramp_of_the_drive_is_obedience(passenger: bool) -> None:
    """A deceleration that starts late and is limited by its jerk, down to a lowered limit."""
    rig, motion = Rig(), ROBOT.motion(passenger)
    speed_mps, brake_mps2 = motion.max_speed_mps, 0.0
    limit = SpeedLimit(0.3, 0.3)
    for tick in range(100):
        rig.watch.limited(limit, False, motion, rig.now_s)
        assert rig.watch.judge(Twist2(speed_mps, 0.0, 0.0), rig.now_s) is CLEAR, f"{speed_mps} at {rig.now_s}"
        rig.now_s += TICK_S
        if tick < 3:
            continue
        easing = speed_mps - 0.3 < brake_mps2**2 / (2.0 * motion.max_jerk_mps3)
        change = motion.max_jerk_mps3 * TICK_S
        brake_mps2 = (
            max(change, brake_mps2 - change) if easing else min(motion.max_acceleration_mps2, brake_mps2 + change)
        )
        speed_mps = max(0.3, speed_mps - brake_mps2 * TICK_S)
    assert speed_mps == 0.3


def test_the_detail_names_all_four() -> None:
    rig = Rig()
    rig.watch.limited(OWN, False, ROBOT.empty, 0.0)
    rig.watch.judge(Twist2(2.0, 0.0, 0.5), 0.0)
    assert rig.watch.judge(Twist2(2.0, 0.0, 0.5), 1.0).detail == (
        "2.00 m/s, 0.50 rad/s where 1.50 m/s, 1.00 rad/s are permitted"
    )
