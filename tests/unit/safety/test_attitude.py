"""Inclination from gyroscope and accelerometer: exact at rest, unaffected by driving, fast on tipping."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robot_stack.safety.attitude import ZERO, PlanarAcceleration, UpDirection, Vector3
from robot_stack.safety.inputs import ImuSample

G = 9.81
DT_S = 0.01


def _up(time_constant_s: float = 2.0) -> UpDirection:
    return UpDirection(time_constant_s, settle_s=0.3, max_gap_s=0.3)


def _feed(up: UpDirection, sample: ImuSample, start_s: float, duration_s: float, own: Vector3 = ZERO) -> float:
    now_s = start_s
    for index in range(round(duration_s / DT_S)):
        now_s = start_s + index * DT_S
        up.update(sample, own, now_s)
    return now_s + DT_S


def _at_rest(roll_deg: float, pitch_deg: float) -> ImuSample:
    """Returns the specific force of a body at rest with this roll and pitch (z-y-x): R^T (0, 0, g)."""
    roll, pitch = math.radians(roll_deg), math.radians(pitch_deg)
    return ImuSample(
        -G * math.sin(pitch), G * math.sin(roll) * math.cos(pitch), G * math.cos(roll) * math.cos(pitch), 0.0, 0.0, 0.0
    )


# --- vectors ---------------------------------------------------------------------------------------------------------


def test_vectors() -> None:
    assert Vector3(1.0, 2.0, 2.0).norm() == 3.0
    assert Vector3(1.0, 2.0, 3.0).plus(Vector3(10.0, 20.0, 30.0), 0.5) == Vector3(6.0, 12.0, 18.0)
    assert Vector3(2.0, 3.0, 4.0).cross(Vector3(5.0, 6.0, 7.0)) == Vector3(-3.0, 6.0, -3.0)
    assert Vector3(0.0, -4.0, 3.0).unit() == Vector3(0.0, -0.8, 0.6)
    with pytest.raises(ZeroDivisionError):
        ZERO.unit()


# --- inclination -----------------------------------------------------------------------------------------------------


def test_unknown_until_settled() -> None:
    up = _up()
    assert math.isnan(up.inclination_rad())
    for index in range(30):
        up.update(_at_rest(0.0, 10.0), ZERO, 50.0 + index * DT_S)
        assert math.isnan(up.inclination_rad())
    up.update(_at_rest(0.0, 10.0), ZERO, 50.31)
    assert math.degrees(up.inclination_rad()) == pytest.approx(10.0, abs=1e-9)


@pytest.mark.parametrize(
    ("roll_deg", "pitch_deg", "inclination_deg"),
    [(0.0, 0.0, 0.0), (0.0, 10.0, 10.0), (0.0, -10.0, 10.0), (15.0, 0.0, 15.0), (90.0, 0.0, 90.0), (180.0, 0.0, 180.0)],
)
def test_at_rest_it_is_the_angle_to_the_vertical(roll_deg: float, pitch_deg: float, inclination_deg: float) -> None:
    up = _up()
    _feed(up, _at_rest(roll_deg, pitch_deg), 0.0, 1.0)
    assert math.degrees(up.inclination_rad()) == pytest.approx(inclination_deg, abs=1e-6)


@pytest.mark.parametrize(
    ("roll_deg", "pitch_deg", "downhill_deg"),
    [(0.0, 10.0, 0.0), (0.0, -10.0, 180.0), (10.0, 0.0, -90.0), (-10.0, 0.0, 90.0), (3.0, 3.0, -45.0)],
)
def test_the_fall_line_leads_where_the_robot_leans(roll_deg: float, pitch_deg: float, downhill_deg: float) -> None:
    """Nose down is a positive pitch, the right side down a positive roll."""
    up = _up()
    assert math.isnan(up.downhill_rad())
    _feed(up, _at_rest(roll_deg, pitch_deg), 0.0, 1.0)
    off_deg = math.degrees(up.downhill_rad()) - downhill_deg
    assert math.cos(math.radians(off_deg)) == pytest.approx(1.0, abs=1e-5)


def test_roll_and_pitch_together() -> None:
    """cos(inclination) = cos(roll) cos(pitch): 6 deg and 8 deg make 9.99 deg."""
    up = _up()
    _feed(up, _at_rest(6.0, 8.0), 0.0, 1.0)
    expected = math.acos(math.cos(math.radians(6.0)) * math.cos(math.radians(8.0)))
    assert up.inclination_rad() == pytest.approx(expected, abs=1e-9)


def test_settling_averages_the_noise_away() -> None:
    up = _up()
    for index in range(31):
        sway = 2.0 if index % 2 else -2.0
        up.update(ImuSample(sway, 0.0, G, 0.0, 0.0, 0.0), ZERO, index * 0.0101)
    # 31 samples, one -2.0 without its partner: atan(2 / (31 g))
    assert up.inclination_rad() == pytest.approx(math.atan2(2.0, 31 * G), abs=1e-12)


@pytest.mark.parametrize("axis", ["roll", "pitch", "roll back", "pitch back"])
def test_the_gyroscope_leads_when_it_tips(axis: str) -> None:
    """Half a second at 0.5 rad/s is 14.3 deg, independent of the filter's time constant."""
    up = _up(time_constant_s=1e9)
    now_s = _feed(up, _at_rest(0.0, 0.0), 0.0, 1.0)
    rate = -0.5 if "back" in axis else 0.5
    turn = ImuSample(0.0, 0.0, G, rate, 0.0, 0.0) if "roll" in axis else ImuSample(0.0, 0.0, G, 0.0, rate, 0.0)
    _feed(up, turn, now_s, 0.5)
    assert up.inclination_rad() == pytest.approx(0.25, abs=1e-3)


def test_gyroscope_and_accelerometer_agree_on_the_sign() -> None:
    """Roll to 20 deg and back, both sensors exact: the estimate is within the gyroscope's integration error."""
    up = _up()
    now_s = _feed(up, _at_rest(0.0, 0.0), 0.0, 1.0)
    rate = math.radians(20.0)
    for index in range(200):
        direction = 1.0 if index < 100 else -1.0
        roll_deg = 20.0 - abs(index + 1 - 100) * 0.2
        still = _at_rest(roll_deg, 0.0)
        up.update(ImuSample(still.ax, still.ay, still.az, direction * rate, 0.0, 0.0), ZERO, now_s + index * DT_S)
        assert math.degrees(up.inclination_rad()) == pytest.approx(roll_deg, abs=0.05)


def test_yaw_alone_is_no_tilt() -> None:
    up = _up()
    _feed(up, ImuSample(0.0, 0.0, G, 0.0, 0.0, 3.0), 0.0, 5.0)
    assert up.inclination_rad() == pytest.approx(0.0, abs=1e-12)


def test_a_slope_stays_put_while_the_robot_turns_on_it() -> None:
    """Turning at 1 rad/s on 8 deg: the direction of gravity turns in the body, but its angle is constant."""
    up, tilt = _up(), math.radians(8.0)
    for index in range(700):
        now_s = index * DT_S
        side = G * math.sin(tilt)
        sample = ImuSample(-side * math.cos(now_s), side * math.sin(now_s), G * math.cos(tilt), 0.0, 0.0, 1.0)
        up.update(sample, ZERO, now_s)
    assert math.degrees(up.inclination_rad()) == pytest.approx(8.0, abs=0.05)


def test_the_accelerometer_pulls_with_the_time_constant() -> None:
    """A step of 10 deg without angular rate: after one time constant the estimate has 1 - 1/e of it."""
    up = _up(time_constant_s=2.0)
    now_s = _feed(up, _at_rest(0.0, 0.0), 0.0, 1.0)
    _feed(up, _at_rest(0.0, 10.0), now_s, 2.0)
    assert math.degrees(up.inclination_rad()) == pytest.approx(10.0 * (1.0 - math.exp(-1.0)), abs=0.05)


def test_an_unexplained_acceleration_is_a_slope_only_slowly() -> None:
    """1 m/s2 for 1.5 s (0 to 1.5 m/s), unexplained: 5.8 deg seen by the accelerometer, 3.1 deg by the filter."""
    up = _up()
    now_s = _feed(up, _at_rest(0.0, 0.0), 0.0, 1.0)
    _feed(up, ImuSample(1.0, 0.0, G, 0.0, 0.0, 0.0), now_s, 1.5)
    assert math.degrees(up.inclination_rad()) == pytest.approx(5.8204 * (1.0 - math.exp(-0.75)), abs=0.03)


def test_an_explained_acceleration_is_no_slope_at_all() -> None:
    up = _up()
    now_s = _feed(up, ImuSample(1.0, 0.5, G, 0.0, 0.0, 0.0), 0.0, 1.0, Vector3(1.0, 0.5, 0.0))
    _feed(up, ImuSample(2.0, -1.0, G, 0.0, 0.0, 0.0), now_s, 10.0, Vector3(2.0, -1.0, 0.0))
    assert up.inclination_rad() == pytest.approx(0.0, abs=1e-12)


def test_free_fall_leaves_the_gyroscope_alone() -> None:
    up = _up()
    now_s = _feed(up, _at_rest(0.0, 10.0), 0.0, 1.0)
    _feed(up, ImuSample(0.0, 0.0, 0.0, 0.0, 0.0, 0.0), now_s, 1.0)
    assert math.degrees(up.inclination_rad()) == pytest.approx(10.0, abs=1e-9)


def test_free_fall_does_not_settle_the_filter() -> None:
    up = _up()
    _feed(up, ImuSample(0.0, 0.0, 0.0, 0.0, 0.0, 0.0), 0.0, 1.0)
    assert math.isnan(up.inclination_rad())


def test_two_samples_at_the_same_time_are_no_jump() -> None:
    up = _up()
    now_s = _feed(up, _at_rest(0.0, 10.0), 0.0, 1.0) - DT_S
    up.update(_at_rest(0.0, 10.0), ZERO, now_s)
    assert math.degrees(up.inclination_rad()) == pytest.approx(10.0, abs=1e-9)


def test_a_gap_of_exactly_the_limit_is_bridged() -> None:
    up = UpDirection(2.0, settle_s=0.0, max_gap_s=0.25)
    up.update(_at_rest(0.0, 10.0), ZERO, 1.0)
    up.update(_at_rest(0.0, 0.0), ZERO, 1.25)
    assert math.degrees(up.inclination_rad()) > 8.0
    up.update(_at_rest(0.0, 0.0), ZERO, 1.51)
    assert up.inclination_rad() == 0.0


def test_one_step_of_the_filter_by_hand() -> None:
    """dt = tau / 4: the pull is 1/5, so from up = (0, 0, 1) towards (0.6, 0, 0.8): (0.12, 0, 0.96)."""
    up = UpDirection(1.0, settle_s=0.0, max_gap_s=0.25)
    up.update(ImuSample(0.0, 0.0, 5.0, 0.0, 0.0, 0.0), ZERO, 1.0)
    up.update(ImuSample(3.0, 0.0, 4.0, 0.0, 0.0, 0.0), ZERO, 1.25)
    assert up.inclination_rad() == pytest.approx(math.atan2(0.12, 0.96), abs=1e-12)


def test_a_weak_force_has_a_direction_too() -> None:
    up = UpDirection(1.0, settle_s=0.0, max_gap_s=0.25)
    up.update(ImuSample(0.0, 0.0, 0.5, 0.0, 0.0, 0.0), ZERO, 1.0)
    assert up.inclination_rad() == 0.0
    up.update(ImuSample(0.3, 0.0, 0.4, 0.0, 0.0, 0.0), ZERO, 1.25)
    assert up.inclination_rad() == pytest.approx(math.atan2(0.12, 0.96), abs=1e-12)


@pytest.mark.parametrize("later_s", [0.31, -0.01, -100.0, math.nan])
def test_gap_or_jump_of_time_restarts_the_filter(later_s: float) -> None:
    up = _up()
    now_s = _feed(up, _at_rest(0.0, 10.0), 1000.0, 1.0) - DT_S
    up.update(_at_rest(0.0, 0.0), ZERO, now_s + later_s)
    assert math.isnan(up.inclination_rad())


def test_after_a_gap_only_new_samples_count() -> None:
    up = _up()
    now_s = _feed(up, _at_rest(0.0, 10.0), 0.0, 1.0)
    _feed(up, _at_rest(0.0, 2.0), now_s + 1.0, 0.4)
    assert math.degrees(up.inclination_rad()) == pytest.approx(2.0, abs=1e-9)


def test_a_short_gap_is_bridged_by_the_gyroscope() -> None:
    up = _up(time_constant_s=1e9)
    now_s = _feed(up, _at_rest(0.0, 0.0), 0.0, 1.0)
    up.update(ImuSample(0.0, 0.0, G, 0.5, 0.0, 0.0), ZERO, now_s - DT_S + 0.25)
    assert up.inclination_rad() == pytest.approx(math.atan2(0.125, 1.0 - 0.5 * 0.125**2), abs=1e-6)


FORCE, RATE = st.floats(-30.0, 30.0), st.floats(-10.0, 10.0)


@given(st.lists(st.tuples(FORCE, FORCE, FORCE, RATE, RATE, RATE, st.floats(0.0, 0.3)), min_size=1, max_size=60))
def test_always_an_angle_or_unknown(samples: list[tuple[float, ...]]) -> None:
    up, now_s = _up(), 0.0
    for ax, ay, az, wx, wy, wz, dt_s in samples:
        now_s += dt_s
        up.update(ImuSample(ax, ay, az, wx, wy, wz), ZERO, now_s)
        angle = up.inclination_rad()
        assert math.isnan(angle) or 0.0 <= angle <= math.pi


# --- the robot's own acceleration ------------------------------------------------------------------------------------


def test_no_velocity_no_acceleration() -> None:
    assert PlanarAcceleration(0.1, 2.5).at(1.0, 0.0) == ZERO


@pytest.mark.parametrize("direction", [(1.0, 0.0), (0.0, 1.0), (-0.6, 0.8)])
def test_a_steady_ramp_is_found_exactly(direction: tuple[float, float]) -> None:
    motion = PlanarAcceleration(0.1, 2.5)
    for index in range(200):
        speed = 0.02 * index * 0.7
        motion.update(speed * direction[0], speed * direction[1], 5.0 + 0.02 * index)
    found = motion.at(0.0, 5.0 + 0.02 * 199)
    assert (found.x, found.y, found.z) == pytest.approx((0.7 * direction[0], 0.7 * direction[1], 0.0), abs=1e-6)


def test_a_curve_pulls_inwards() -> None:
    """1.5 m/s forward at 1 rad/s to the left: 1.5 m/s2 to the left."""
    motion = PlanarAcceleration(0.1, 2.5)
    for index in range(100):
        motion.update(1.5, 0.0, 0.02 * index)
    found = motion.at(1.0, 1.98)
    assert (found.x, found.y) == pytest.approx((0.0, 1.5))
    found = motion.at(-0.5, 1.98)
    assert (found.x, found.y) == pytest.approx((0.0, -0.75))


def test_a_sideways_curve_pulls_backwards() -> None:
    motion = PlanarAcceleration(0.1, 2.5)
    motion.update(0.0, 1.0, 0.0)
    found = motion.at(0.5, 0.0)
    assert (found.x, found.y) == pytest.approx((-0.5, 0.0))


def test_never_more_than_a_robot_can_do() -> None:
    motion = PlanarAcceleration(0.1, 2.5)
    motion.update(0.0, 0.0, 0.0)
    motion.update(30.0, -40.0, 0.05)
    found = motion.at(0.0, 0.05)
    assert (found.x, found.y) == pytest.approx((1.5, -2.0))


@pytest.mark.parametrize("later_s", [0.11, -0.01, math.nan])
def test_stale_velocity_is_ignored(later_s: float) -> None:
    motion = PlanarAcceleration(0.1, 2.5)
    motion.update(1.0, 0.0, 7.0)
    assert motion.at(1.0, 7.0 + later_s) == ZERO


@pytest.mark.parametrize("later_s", [0.11, -5.0])
def test_derivative_restarts_after_a_gap(later_s: float) -> None:
    motion = PlanarAcceleration(0.1, 2.5)
    motion.update(0.0, 0.0, 7.0)
    motion.update(1.0, 0.0, 7.0 + later_s)
    assert motion.at(0.0, 7.0 + later_s) == ZERO


def test_derivative_continues_within_the_filter_time() -> None:
    motion = PlanarAcceleration(0.125, 25.0)
    motion.update(0.0, 0.0, 7.0)
    motion.update(1.0, 0.0, 7.125)
    # backward Euler with dt = tau: the low pass has gone half the way, 0.5 m/s behind by 0.125 s
    assert motion.at(0.0, 7.25).x == pytest.approx(4.0)
