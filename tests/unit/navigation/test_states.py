"""The state table of navigation: the controller takes each row, with a simulated drive and costmap in fake time."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import numpy.typing as npt
import pytest

from robot_stack.core.geometry import Pose2
from robot_stack.core.limits import NO_LIMIT, SpeedLimit
from robot_stack.core.transitions import Transition
from robot_stack.navigation import controller
from robot_stack.navigation.states import TRANSITIONS, NavigationState, Trigger, target_of
from tests.unit.navigation.test_among_obstacles import Story

Row = Transition[NavigationState, Trigger]
Array = npt.NDArray[np.float64]

_HALF_WIDTH_M = 0.3
_SHUT_IN_M = 1.9


class Site:
    """A robot on open ground, and events that a test can cause."""

    def __init__(self) -> None:
        self._things: list[tuple[float, float]] = []
        self.story = Story(self._obstacles)

    def _obstacles(self, _: float, x: Array, y: Array) -> npt.NDArray[np.bool_]:
        lethal = np.zeros(x.shape, np.bool_)
        for at_x, at_y in self._things:
            lethal |= (np.abs(x - at_x) < _HALF_WIDTH_M) & (np.abs(y - at_y) < _HALF_WIDTH_M)
        return lethal

    def put(self, x: float, y: float) -> None:
        """Adds an obstacle at a position relative to the robot."""
        place = self.story.drive.pose.compose(Pose2(x, y, 0.0))
        self._things.append((place.x, place.y))

    def shut_in(self) -> None:
        for bearing_rad in np.arange(0.0, 2.0 * np.pi, 0.2):
            self.put(_SHUT_IN_M * np.cos(bearing_rad), _SHUT_IN_M * np.sin(bearing_rad))

    def clear(self) -> None:
        self._things.clear()

    def goal_ahead(self, distance_m: float = 4.0) -> None:
        self.story.go(self.story.drive.pose.compose(Pose2(distance_m, 0.0, 0.0)))

    def cancel(self) -> None:
        self.story.controller.cancel()

    def permit(self, permitted: bool) -> None:
        self.story.controller.set_speed_limit(NO_LIMIT if permitted else SpeedLimit(0.0, 0.0))

    def until(self, state: NavigationState, *, moving: bool = False) -> None:
        self.story.until(lambda output: output.state is state and (not moving or output.twist.speed() > 0.3), 20.0)


def idle(_: Site) -> None:
    pass


def held(site: Site) -> None:
    site.permit(False)
    site.goal_ahead()
    site.until(NavigationState.HELD)


def driving(site: Site) -> None:
    site.goal_ahead()
    site.until(NavigationState.DRIVING, moving=True)


def following(site: Site) -> None:
    site.put(2.0, 0.0)
    site.goal_ahead()
    site.until(NavigationState.FOLLOWING, moving=True)


def arriving(site: Site) -> None:
    site.goal_ahead(1.0)
    site.until(NavigationState.ARRIVING)


def braking(site: Site) -> None:
    driving(site)
    site.cancel()
    site.until(NavigationState.BRAKING)


BROUGHT_TO: dict[NavigationState, Callable[[Site], None]] = {
    NavigationState.IDLE: idle,
    NavigationState.HELD: held,
    NavigationState.DRIVING: driving,
    NavigationState.FOLLOWING: following,
    NavigationState.ARRIVING: arriving,
    NavigationState.BRAKING: braking,
}


def way_clear(site: Site) -> None:
    site.clear()
    site.permit(True)
    if site.story.controller.state not in (NavigationState.HELD, NavigationState.FOLLOWING):  # these wait for it
        site.goal_ahead(3.0)


def way_obstructed(site: Site) -> None:
    site.permit(True)
    site.put(2.0, 0.0)
    site.goal_ahead()


def forbidden_with_a_goal(site: Site) -> None:
    site.permit(False)
    site.goal_ahead()


def nothing_happens(_: Site) -> None:
    pass


def withdrawn_where_nothing_may_move(site: Site) -> None:
    site.permit(False)
    site.cancel()


EVENTS: dict[Trigger, Callable[[Site], None]] = {
    Trigger.CLEAR: way_clear,
    Trigger.OBSTRUCTED: way_obstructed,
    Trigger.FORBIDDEN: forbidden_with_a_goal,
    Trigger.END_OF_PLAN: nothing_happens,
    Trigger.REACHED: nothing_happens,
    Trigger.GAVE_UP: Site.shut_in,
    Trigger.WITHDRAWN: withdrawn_where_nothing_may_move,
    Trigger.WITHDRAWN_MOVING: Site.cancel,
    Trigger.BRAKING_FORBIDDEN: lambda site: site.permit(False),
    Trigger.EMERGENCY_STOP: lambda site: site.story.controller.stop(),
}


def test_every_state_is_entered_and_left_and_each_way_is_unambiguous() -> None:
    assert len({(row.source, row.trigger) for row in TRANSITIONS}) == len(TRANSITIONS)
    assert {row.source for row in TRANSITIONS} == {row.target for row in TRANSITIONS} == set(NavigationState)
    assert {row.trigger for row in TRANSITIONS} == set(Trigger)


@pytest.mark.parametrize("row", TRANSITIONS, ids=lambda row: f"{row.source.name}-{row.trigger.name}")
def test_the_controller_takes_the_row(row: Row, monkeypatch: pytest.MonkeyPatch) -> None:
    site = Site()
    BROUGHT_TO[row.source](site)
    taken: list[Row] = []

    def recorded(state: NavigationState, trigger: Trigger) -> NavigationState:
        target = target_of(state, trigger)
        taken.append(Transition(state, trigger, target))
        return target

    monkeypatch.setattr(controller, "target_of", recorded)
    EVENTS[row.trigger](site)
    if not taken:
        site.story.until(lambda _: bool(taken), 60.0)
    assert taken[0] == row
    assert site.story.controller.state is taken[-1].target
