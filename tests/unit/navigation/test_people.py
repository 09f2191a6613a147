"""People in costmaps: alone, in a group, beside furniture."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest

from robot_stack.navigation.people import PeopleTracker
from tests.unit.navigation.plant import params

P = params().people
RESOLUTION_M, SIZE_M, STEP_S = 0.05, 10.0, 0.2
Mask = npt.NDArray[np.bool_]
Y, X = (np.mgrid[0 : round(SIZE_M / RESOLUTION_M), 0 : round(SIZE_M / RESOLUTION_M)] + 0.5) * RESOLUTION_M
NOTHING = np.zeros(X.shape, np.bool_)


def people(*at: tuple[float, float]) -> Mask:
    return np.asarray(np.any([np.hypot(X - x, Y - y) < 0.25 for x, y in at], axis=0))


class Watch:
    """A tracker that is given a costmap every 0.2 s."""

    def __init__(self) -> None:
        self.tracker, self.now_s = PeopleTracker(P), 0.0

    def see(self, lethal: Mask) -> None:
        self.now_s += STEP_S
        self.tracker.update(self.now_s, lethal, NOTHING, RESOLUTION_M, 0.0, 0.0)

    def walked(self) -> list[tuple[float, float]]:
        return sorted(((one.x, one.y) for one in self.tracker.people if one.walked), key=lambda at: at[1])


def row_that_stops(watch: Watch) -> list[tuple[float, float]]:
    """Four people come one after the other and stop side by side, nearer to each other than ``join_m``."""
    ends = [(4.0, 3.0 + 0.55 * k) for k in range(4)]
    for step in range(60):
        watch.see(people(*((max(x, 5.0 + 1.2 * k - 0.2 * step), y) for k, (x, y) in enumerate(ends))))
    return ends


def test_group_that_stops_side_by_side_remains_people() -> None:
    watch = Watch()
    ends = row_that_stops(watch)
    assert np.ptp([y for _, y in ends]) + 0.5 > P.max_size_m
    assert np.array(watch.walked()) == pytest.approx(np.array(ends), abs=0.15)
    assert not any(one.walks for one in watch.tracker.people)


def test_group_that_walks_on_separately_is_followed_at_once() -> None:
    watch = Watch()
    ends = row_that_stops(watch)
    assert all(one.in_group for one in watch.tracker.people)
    watch.see(people(ends[0], ends[2]))
    assert [one.walked for one in watch.tracker.people if not one.in_group] == [True, True]


def test_group_is_followed_for_its_time() -> None:
    watch = Watch()
    ends = row_that_stops(watch)
    for _ in range(round((P.group_s + P.memory_s) / STEP_S) + 1):
        watch.see(people(*ends))
    assert not watch.walked()


def test_person_beside_furniture_is_not_found_in_it() -> None:
    watch, table = Watch(), (abs(X - 5.0) < 0.8) & (abs(Y - 5.0) < 0.5)
    for step in range(11):
        watch.see(table | people((2.0 + 0.2 * step, 5.0)))
    for _ in range(round(P.memory_s / STEP_S) + 1):
        watch.see(table)
    assert not watch.tracker.people
