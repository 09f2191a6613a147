"""Memory, limits and the reasons for missing inputs, as the observation passes them on. The stories cover the rest."""

from __future__ import annotations

import math
import re
from dataclasses import replace

import numpy as np
import pytest

from robot_stack.contract import topics
from robot_stack.contract.frames import JOINTS
from robot_stack.contract.model import SafetyState
from robot_stack.core.geometry import ZERO_TWIST, Pose2, Twist2
from robot_stack.core.limits import SafetyLimit
from robot_stack.core.robot import Robot
from robot_stack.safety.button import Contact
from robot_stack.safety.conditions import stale_s
from robot_stack.safety.inputs import DriveReading, Level
from robot_stack.safety.observation import CAMERAS, Observation
from robot_stack.safety.pedestrian_collision import PedestrianCollision
from robot_stack.safety.stop_sources import Press
from tests.unit.safety.story import NOTHING, NOTHING_MOVES, PARAMS, ROBOT, Story

PRESSES = (Press("touch_ui", 17),)
FAST = SafetyLimit(1.5, 1.5)


def observation(*, passenger: bool = False, robot: Robot = ROBOT) -> Observation:
    return Observation(PARAMS, robot, 0.0, passenger, PRESSES)


def test_stored_state_is_available_from_the_start() -> None:
    assert observation().sources.presses == PRESSES
    assert observation(passenger=True).chair.carried is True
    assert observation(passenger=False).chair.carried is False


def test_why_something_is_missing() -> None:
    found = observation()
    at_first = found.snapshot(False, 1.0)
    assert at_first.latch_problem == ""
    assert {at_first.lidar_problem, at_first.overhead_lidar_problem, at_first.obstacles_problem} == {"never received"}
    found.latch_problem = "disk full"
    found.lidar.refused("a")
    found.overhead_lidar.refused("b")
    found.surroundings.refused("c")
    seen = found.snapshot(False, 1.0)
    assert (seen.lidar_problem, seen.overhead_lidar_problem, seen.obstacles_problem) == ("a", "b", "c")
    assert seen.latch_problem == "disk full"


def too_fast_after_s(found: Observation, *, hard: bool) -> float:
    """Time after a stop command until a robot that still drives at 1 m/s is reported as a fault, s."""
    speed = 1.0 / ROBOT.wheel_radius_m
    velocity = [speed if name.endswith("_drive") else 0.0 for name in JOINTS]
    for tick in range(1000):
        now_s = 0.01 * tick
        found.joint_states(JOINTS, [0.0] * len(JOINTS), velocity, now_s)
        found.limited(FAST if tick < 10 else SafetyLimit(0.0, 0.0, ("TILT" if hard else "SLOPE",)), now_s)
        if found.snapshot(False, now_s).overspeed.level is Level.PRESENT:
            return now_s
    pytest.fail("nobody has noticed")


def test_a_hard_stop_is_missed_sooner_than_one_in_comfort() -> None:
    assert too_fast_after_s(observation(), hard=True) < too_fast_after_s(observation(), hard=False) - 0.1


def test_a_passenger_s_gentle_stop_is_waited_for() -> None:
    """Uses motion limits with the largest allowed difference, since the shipped values may change."""
    hasty = ROBOT.empty.model_copy(update={"max_acceleration_mps2": 3.0, "max_jerk_mps3": 30.0})
    gentle = ROBOT.with_passenger.model_copy(update={"max_acceleration_mps2": 0.3, "max_jerk_mps3": 0.5})
    robot = ROBOT.model_copy(update={"empty": hasty, "with_passenger": gentle})
    alone = too_fast_after_s(observation(passenger=False, robot=robot), hard=False)
    assert alone < too_fast_after_s(observation(passenger=True, robot=robot), hard=False) - 0.5


def test_servo_off_during_a_requested_stop_is_no_fault() -> None:
    """In the step of the request itself, before anything is latched."""
    story = Story().healthy()
    found, now_s = story.monitor.observation, story.now_s + 0.01
    off = tuple(replace(axis, servo_on=False) for axis in story.axes)
    found.engine(DriveReading(True, story.ticks + 1, off, Contact.RELEASED), now_s)
    assert found.snapshot(False, now_s).drive.level is Level.UNKNOWN
    found.emergency_stop(True, now_s)
    assert found.snapshot(False, now_s).drive.level is Level.CLEAR


def test_all_sources_of_the_stop_are_named() -> None:
    story = Story().healthy()
    story.reporting.discard("emergency_stop_button")
    story.run(2.0).estop(True)
    asked = story.monitor.observation.snapshot(True, story.now_s).estop
    assert re.fullmatch(r"[^;]*touch_ui[^;]*; no message from emergency_stop_button for \d\.\d\d s", asked), asked


def test_obstacles_at_exactly_the_age_limit_are_fresh() -> None:
    found = observation()
    found.obstacles(NOTHING, 0.0, 0.0)
    limit_s = stale_s(topics.OBSTACLES)
    found.joint_states(JOINTS, [0.0] * 8, [0.0] * 8, limit_s)
    assert found.snapshot(False, limit_s).prediction is not None
    assert found.snapshot(False, limit_s + 0.001).prediction is None
    found.joint_states(JOINTS, [0.0] * 8, [1.0, 0.0] * 4, limit_s + 0.01)
    assert found.snapshot(False, limit_s + 0.01).prediction is not None  # the robot keeps rolling


def test_stale_docking_target_excludes_no_dock() -> None:
    found = observation()
    found.docking("SERVOING", 0.0)
    limit_s = stale_s(topics.DOCKING_STATUS)
    for now_s, nearest_m in ((limit_s, math.inf), (limit_s + 0.001, pytest.approx(0.1, abs=0.05))):
        found.surroundings.dock(Pose2(ROBOT.footprint.front_m, 0.0, 0.0), 0.0, now_s)
        found.obstacles(np.array([[ROBOT.footprint.front_m + 0.1, 0.0, 0.5]]), 0.0, now_s)
        prediction = found.snapshot(False, now_s).prediction
        assert prediction is not None
        assert prediction.nearest_m == nearest_m


class MeetingRecorder:
    """Replaces the pedestrian_collision watch and records its inputs."""

    def __init__(self) -> None:
        self.motions: list[Twist2] = []
        self.request, self.now_s = ZERO_TWIST, math.nan

    def judge(
        self, moving: object, nearest_m: float, body: object, motions: list[Twist2], request: Twist2, now_s: float
    ) -> PedestrianCollision:
        self.motions, self.request, self.now_s = motions, request, now_s
        return PedestrianCollision(stop=True)


def test_moving_objects_are_evaluated_against_actual_and_requested_motion(monkeypatch: pytest.MonkeyPatch) -> None:
    found, recorder = observation(), MeetingRecorder()
    monkeypatch.setattr(found, "_pedestrian_collision", recorder)
    found.obstacles(NOTHING, 0.0, 1.0)
    found.surroundings.moving_received(NOTHING_MOVES, 0.0, 1.0)
    request, driven = Twist2(0.5, 0.0, 0.0), Twist2(0.2, 0.0, 0.0)
    found.commands.request("/cmd_vel", request, 1.0)
    prediction = found.snapshot(False, 1.0).prediction
    assert prediction is not None
    assert prediction.pedestrian_collision.stop
    assert (recorder.motions, recorder.request, recorder.now_s) == ([ZERO_TWIST, request], request, 1.0)
    found.commands.limited(driven, 1.0)
    found.snapshot(False, 1.0)
    assert recorder.motions == [ZERO_TWIST, driven]


def test_cameras_have_half_a_second_after_docking_starts() -> None:
    """Images from before the search do not count, since a camera may have been switched on for this docking."""
    story = Story().healthy()
    story.cameras = [CAMERAS[0].name]
    story.run(1.0)
    story.cameras = []
    story.run(3.0)
    story.docking = "SEARCH"
    story.tick().before(0.5).expect(SafetyState.NORMAL, ())
    story.docking = "SERVOING"  # the time still counts from the start of the search
    story.past().expect(SafetyState.DEGRADED, ["CAMERA_TIMEOUT"])
    story.docking = "IDLE"
    story.tick()
    story.docking = "SEARCH"
    story.tick().before(0.5).expect(SafetyState.NORMAL, ())
    story.past().expect(SafetyState.DEGRADED, ["CAMERA_TIMEOUT"])


def test_links_that_never_come_up_are_missed_once_their_processes_live() -> None:
    linked = ("swerve_controller", "ehmi_bridge", "touch_ui")
    story = Story(expected_processes=linked)
    story.beating = {"swerve_controller"}
    story.run(8.0).expect(SafetyState.DEGRADED, ("NODE_DEAD",))
    story.beating = set(linked)
    story.run(4.9).expect(SafetyState.NORMAL, ())
    story.run(0.2).expect(SafetyState.DEGRADED, ("EHMI_LINK_LOST", "UI_LINK_LOST"))
