"""Docking on the whole stack in physics: cameras, detector, controller, latch; and what may come between.

Every state's reaction to every fault is tested tick by tick in tests/unit/docking; here the faults are real ones.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING

import pytest

from robot_stack.core.geometry import Pose2
from tests.support.compiled import assert_set_up_compiled_everything, tell_what_is_compiled
from tests.support.environment import stack_environment
from tests.support.waiting import wait_for

if TYPE_CHECKING:
    from tests.support.docking_stack import DockingStackUnderTest

pytestmark = pytest.mark.timeout(900)


@pytest.fixture(scope="module")
def module_docking(tmp_path_factory: pytest.TempPathFactory) -> Iterator[DockingStackUnderTest]:
    folder = tmp_path_factory.mktemp("docking")
    with stack_environment(folder), pytest.MonkeyPatch.context() as monkeypatch:
        tell_what_is_compiled(monkeypatch)
        from tests.support.docking_stack import DockingStackUnderTest

        start = Pose2(0.2, 0.3, math.radians(10.0))
        stack = DockingStackUnderTest(folder / "logs", start, "docking_controller.tries=2")
        yield stack
        stack.close()
        assert_set_up_compiled_everything(stack.logs)


@pytest.fixture
def docking(module_docking: DockingStackUnderTest) -> DockingStackUnderTest:
    module_docking.make_ready()
    return module_docking


def test_an_emergency_stop_while_servoing_ends_the_docking(docking: DockingStackUnderTest) -> None:
    goal = docking.begin_docking()
    docking.reach("SERVOING")
    wait_for(lambda: docking.speed_mps > 0.08, "the robot approaches")
    docking.estop(True)
    docking.wait_stands(3.0)
    result = goal.wait(5.0)
    assert (result.success, result.error_code) == (False, result.SAFETY_STOP)
    assert result.reason == "emergency stop"
    docking.reach_within(2.0, "FAILED")
    docking.release()
    before = docking.at()
    count = len(docking.commands.items)
    wait_for(lambda: len(docking.commands.items) > count + 20, "a second of wheel commands")
    assert docking.at().distance_to(before) < 0.002  # released, it does not go on by itself


def test_a_dead_camera_ends_the_docking_and_shows(docking: DockingStackUnderTest) -> None:
    goal = docking.begin_docking()
    docking.reach("SERVOING")
    docking.inject_camera("silent", "front")
    docking.wait_within(10.0, lambda: goal.result is not None, "the result")
    result = goal.wait()
    assert (result.success, result.error_code) == (False, result.CAMERA_TIMEOUT)
    docking.wait_stands(3.0)
    docking.reach_within(2.0, "FAILED")


def test_a_marker_covered_and_a_chair_moved_end_in_a_docking(docking: DockingStackUnderTest) -> None:
    goal = docking.begin_docking()
    docking.reach("SERVOING")
    docking.inject_camera("cover", "0", duration_s=1.0)
    docking.wait_within(10.0, lambda: docking.status.last.visible_markers_count == 3, "three markers")
    docking.wait_within(20.0, lambda: docking.status.last.visible_markers_count == 4, "four markers again")
    docking.reach("FINE_ALIGN")
    before = docking.at()
    docking.inject("chair_moved", "0.0,0.2,0.0")
    docking.reach_within(5.0, "APPROACH")
    assert docking.at().distance_to(before) < 0.05  # it went on only until it knew
    result = goal.wait(200.0)
    assert result.success, result.reason
    assert result.tries == 2
    assert goal.states[-1] == "DOCKED"
    assert docking.passenger.last.data is True
    position_m, yaw_rad = docking.error()
    assert position_m < 0.0005  # the closed latch holds the robot at the dock pose
    assert yaw_rad < math.radians(0.1)


def test_a_controller_that_dies_with_a_wheelchair_comes_back_holding_it(docking: DockingStackUnderTest) -> None:
    docking.be_docked()
    docking.replace_controller()
    docking.reach("DOCKED", 30.0)
    wait_for(lambda: docking.passenger.last.data is True, "a passenger aboard")
    before = docking.at()
    result = docking.begin_undocking().wait(30.0)
    assert result.success, result.reason
    assert docking.passenger.last.data is False
    assert docking.at().distance_to(before) == pytest.approx(0.5, abs=0.03)


def test_a_latch_that_does_not_confirm_is_given_up_with_a_reason(docking: DockingStackUnderTest) -> None:
    docking.be_free()
    docking.inject("latch_no_confirm")
    goal = docking.begin_docking()
    result = goal.wait(120.0)
    assert (result.success, result.error_code, result.tries) == (False, result.LATCH_FAILED, 2)
    assert "did not close" in result.reason
    docking.wait_stands(3.0)
    docking.reach_within(2.0, "FAILED")
    assert docking.passenger.last.data is False
