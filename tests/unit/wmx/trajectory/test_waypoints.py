"""Cubics and quintics through points with velocities and accelerations, and turns of continuous joints."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robot_stack.wmx.trajectory.waypoints import Waypoints, curve_of, knot_velocities, peak_accelerations, segments

VALUE = st.floats(-3.0, 3.0)
STATES = st.lists(st.tuples(st.floats(0.05, 2.0), *[VALUE] * 6), min_size=2, max_size=8)


def waypoints(states: list[tuple[float, ...]]) -> Waypoints:
    """Returns waypoints from (gap, two positions, two velocities, two accelerations)."""
    rows = np.array(states)
    return Waypoints(np.cumsum(rows[:, 0]), rows[:, 1:3], rows[:, 3:5], rows[:, 5:7])


def test_a_cubic_by_hand() -> None:
    """From rest to rest: 3 s^2 - 2 s^3. Through 1 rad at 1 rad/s: p(1/2) = 1/2 + (0 - 1)/8."""
    rest = Waypoints(np.array([0.0, 1.0]), np.array([[0.0], [1.0]]), np.array([[0.0], [0.0]]))
    assert curve_of(rest)(0.25) == pytest.approx([3.0 / 16.0 - 2.0 / 64.0])
    moving = Waypoints(rest.times_s, rest.positions, np.array([[0.0], [1.0]]))
    assert curve_of(moving)(0.5) == pytest.approx([0.375])


def test_a_quintic_by_hand() -> None:
    """From rest to rest without acceleration: 10 s^3 - 15 s^4 + 6 s^5."""
    none = np.zeros((2, 1))
    curve = curve_of(Waypoints(np.array([0.0, 2.0]), np.array([[0.0], [1.0]]), none, none))
    assert curve(0.5) == pytest.approx([10.0 / 64.0 - 15.0 / 256.0 + 6.0 / 1024.0])


@settings(max_examples=60, deadline=None)
@given(STATES)
def test_quintics_keep_position_velocity_and_acceleration_of_every_point(states: list[tuple[float, ...]]) -> None:
    points = waypoints(states)
    curve = curve_of(points)
    assert points.velocities is not None
    assert points.accelerations is not None
    for index, time_s in enumerate(points.times_s):
        for side in (-1e-9, 1e-9):
            if points.times_s[0] <= time_s + side <= points.times_s[-1]:
                assert curve(time_s + side) == pytest.approx(points.positions[index], abs=1e-6)
                assert curve(time_s + side, 1) == pytest.approx(points.velocities[index], abs=1e-4)
                assert curve(time_s + side, 2) == pytest.approx(points.accelerations[index], abs=1e-2)


@settings(max_examples=60, deadline=None)
@given(STATES)
def test_cubics_keep_position_and_velocity_of_every_point(states: list[tuple[float, ...]]) -> None:
    full = waypoints(states)
    points = Waypoints(full.times_s, full.positions, full.velocities)
    curve = curve_of(points)
    assert not curve.c[:2].any()
    assert curve(points.times_s) == pytest.approx(points.positions, abs=1e-9)
    assert curve(points.times_s, 1) == pytest.approx(points.velocities, abs=1e-7)
    assert curve(points.times_s[1:] - 1e-9, 1) == pytest.approx(full.velocities[1:], abs=1e-4)  # type: ignore[index]


def test_positions_alone_pass_their_points_without_a_step_of_acceleration() -> None:
    points = Waypoints(np.array([0.0, 1.0, 2.0]), np.array([[0.0], [1.0], [2.0]]))
    assert knot_velocities(points) == pytest.approx(np.array([[0.0], [1.5], [0.0]]))
    curve = curve_of(points)
    assert curve(1.0 - 1e-9, 2) == pytest.approx(curve(1.0 + 1e-9, 2), abs=1e-6)


@settings(max_examples=60, deadline=None)
@given(STATES)
def test_peaks_are_those_of_a_fine_sampling(states: list[tuple[float, ...]]) -> None:
    points = waypoints(states)
    curve, h = curve_of(points), np.diff(points.times_s)
    fine = np.abs(curve(np.linspace(points.times_s[0], points.times_s[-1], 2000), 2)).max(axis=0)
    assert (peak_accelerations(h, curve.c).max(axis=0) >= 0.9 * fine - 1e-3).all()


def test_the_peak_of_a_cubic_is_exact() -> None:
    one = np.array([[1.0]])
    c = segments(np.array([2.0]), 0.0 * one, one, 0.0 * one, 0.0 * one)
    assert peak_accelerations(np.array([2.0]), c) == pytest.approx(np.array([[6.0 / 4.0]]))


def test_slower_is_the_same_path() -> None:
    points = waypoints([(0.5, 0.0, 1.0, 0.1, 0.2, 0.3, 0.4), (1.0, 1.0, 0.0, 0.0, 0.0, 2.0, 1.0)])
    slow = points.slowed(0.5)
    at = np.linspace(points.times_s[0], points.times_s[-1], 20)
    assert curve_of(slow)(2.0 * at) == pytest.approx(curve_of(points)(at))
    assert curve_of(slow)(2.0 * at, 1) == pytest.approx(0.5 * curve_of(points)(at, 1))


@pytest.mark.parametrize(
    ("present", "asked", "gone_to"),
    [
        (0.0, 0.3, 0.3),
        (6.2, 0.1, 0.1 + 2.0 * math.pi),
        (-20.0, 0.0, -6.0 * math.pi),
        (0.0, math.pi, math.pi),  # half a turn: the direction of the goal's sign
        (0.0, -math.pi, -math.pi),
        (0.0, 3.0 * math.pi, math.pi),
        (4.0 * math.pi, math.pi, 3.0 * math.pi),
    ],
)
def test_a_continuous_joint_takes_the_shortest_way_to_the_first_point(
    present: float, asked: float, gone_to: float
) -> None:
    points = Waypoints(np.array([1.0, 2.0]), np.array([[asked, asked], [asked + 4.0, asked]]))
    turned = points.unwrapped(np.array([present, present]), (0,))
    assert turned.positions[0].tolist() == [pytest.approx(gone_to), asked], "the other joint has an end"
    assert turned.positions[1, 0] == pytest.approx(gone_to + 4.0), "the rest follows, however far it is"


@settings(max_examples=100, deadline=None)
@given(st.floats(-50.0, 50.0), st.floats(-50.0, 50.0))
def test_the_shortest_way_is_never_more_than_half_a_turn(present: float, asked: float) -> None:
    turned = Waypoints(np.array([1.0]), np.array([[asked]])).unwrapped(np.array([present]), (0,))
    assert abs(turned.positions[0, 0] - present) <= math.pi + 1e-6
    assert math.remainder(turned.positions[0, 0] - asked, 2.0 * math.pi) == pytest.approx(0.0, abs=1e-9)
