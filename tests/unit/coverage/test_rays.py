"""Beams against solids and objects, compared with values computed by hand and with points on the solids."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from robot_stack.core.robot_shape import Placed, Solid, transform
from robot_stack.coverage.rays import count_on_things, enter_cylinder, own_ranges

AHEAD = np.array([[1.0, 0.0, 0.0]])


def solid(kind: str, size: tuple[float, float, float], at: tuple[float, float, float], turn: float = 0.0) -> Placed:
    item = Solid(kind=kind, size_m=size, at_m=at, turn_deg=(0.0, 0.0, turn), colour="#000000")  # type: ignore[arg-type]
    return Placed("x", item, item.pose())


@pytest.mark.parametrize(
    ("item", "expected_m"),
    [
        (solid("box", (1.0, 1.0, 1.0), (2.0, 0.0, 0.0)), 1.5),
        (solid("box", (1.0, 1.0, 1.0), (2.0, 0.0, 0.0), 45.0), 2.0 - math.sqrt(0.5)),
        (solid("cylinder", (1.0, 1.0, 1.0), (2.0, 0.0, 0.0)), 1.5),
        (solid("sphere", (1.0, 1.0, 1.0), (2.0, 0.3, 0.0)), 2.0 - 0.4),
        (solid("box", (1.0, 1.0, 1.0), (2.0, 0.6, 0.0)), math.inf),  # beside it
        (solid("box", (1.0, 1.0, 1.0), (-2.0, 0.0, 0.0)), math.inf),  # behind
        (solid("sphere", (1.0, 1.0, 1.0), (-2.0, 0.0, 0.0)), math.inf),
        (solid("cylinder", (1.0, 1.0, 1.0), (-2.0, 0.0, 0.0)), math.inf),
        (solid("box", (1.0, 1.0, 1.0), (0.0, 0.0, 0.0)), math.inf),  # the sensor's own housing
        (solid("cylinder", (1.0, 1.0, 1.0), (0.0, 0.0, 0.0)), math.inf),
        (solid("sphere", (1.0, 1.0, 1.0), (0.0, 0.0, 0.0)), math.inf),
    ],
)
def test_the_range_to_one_solid(item: Placed, expected_m: float) -> None:
    assert own_ranges(np.zeros(3), AHEAD, [item])[0] == pytest.approx(expected_m)


@given(
    st.floats(-3.0, 3.0),
    st.floats(-3.0, 3.0),
    st.floats(-1.0, 3.0),
    st.floats(0.0, 2.0 * math.pi),
    st.floats(0.05, 0.5),
    st.floats(0.1, 2.0),
)
def test_a_ray_to_a_point_on_a_cylinder_is_no_longer_than_the_way_there(
    x: float, y: float, z: float, angle: float, radius: float, top: float
) -> None:
    """From outside towards any point of its side: the first hit is there or nearer."""
    if math.hypot(x, y) <= radius + 1e-3:
        return
    goal = np.array([radius * math.cos(angle), radius * math.sin(angle), 0.5 * top])
    way = goal - (x, y, z)
    length = float(np.linalg.norm(way))
    met = enter_cylinder(x, y, z, *(way / length), radius + 1e-9, 0.0, top)
    assert met <= length + 1e-6
    hit = np.array([x, y, z]) + met * way / length
    assert math.hypot(hit[0], hit[1]) <= radius + 1e-6
    assert -1e-6 <= hit[2] <= top + 1e-6


def test_a_thing_is_met_by_the_beams_towards_it_and_by_no_other() -> None:
    """A ring of 360 beams and an object 0.2 m wide at 1 m: asin(0.1) is 5.7 deg to either side."""
    angles = np.radians(np.arange(-179.5, 180.0))
    beams = np.stack([np.cos(angles), np.sin(angles), np.zeros_like(angles)], axis=1)
    cells = np.array([[1.0, 0.0], [-1.0, 0.0], [0.0, 1.0]])
    counts = np.zeros(3, np.int64)
    count_on_things(np.array([0.0, 0.0, 0.3]), beams, np.full(360, 5.0), angles, 0.05, cells, 0.1, 0.1, 0.6, counts)
    assert counts.tolist() == [12, 12, 12]  # also across the seam behind


@pytest.mark.parametrize(
    ("height_m", "reach_m", "least_m"), [(0.7, 5.0, 0.05), (0.05, 5.0, 0.05), (0.3, 0.85, 0.05), (0.3, 5.0, 1.5)]
)
def test_rays_passing_or_blocked_are_not_counted(height_m: float, reach_m: float, least_m: float) -> None:
    counts = np.zeros(1, np.int64)
    origin, cell = np.array([0.0, 0.0, height_m]), np.array([[1.0, 0.0]])
    count_on_things(origin, AHEAD, np.array([reach_m]), np.zeros(1), least_m, cell, 0.1, 0.1, 0.6, counts)
    assert counts[0] == 0


def test_a_sensor_above_a_thing_sees_its_top() -> None:
    down = np.array([[0.0, 0.0, -1.0]])
    counts = np.zeros(1, np.int64)
    origin, cell = np.array([1.0, 0.0, 2.0]), np.array([[1.0, 0.05]])
    count_on_things(origin, down, np.array([5.0]), np.zeros(1), 0.1, cell, 0.1, 0.1, 0.6, counts)
    assert counts[0] == 1


def test_a_turned_solid_stands_where_its_parent_puts_it() -> None:
    item = Solid(kind="box", size_m=(0.2, 2.0, 1.0), at_m=(1.0, 0.0, 0.0), turn_deg=(0.0, 0.0, 0.0), colour="#000000")
    turned = Placed("x", item, transform((0.0, 0.0, 0.0), (0.0, 0.0, 90.0)) @ item.pose())
    left, nearer = np.array([[0.0, 1.0, 0.0]]), solid("box", (1.0, 0.2, 1.0), (0.0, 0.5, 0.0))
    assert own_ranges(np.zeros(3), left, [turned])[0] == pytest.approx(0.9)
    assert own_ranges(np.zeros(3), left, [turned, nearer])[0] == pytest.approx(0.4)
