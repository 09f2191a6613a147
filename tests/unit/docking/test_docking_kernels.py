"""The components of docking, with values computed by hand."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from custom_msgs.action import Dock as DockAction
from custom_msgs.action import Undock as UndockAction
from robot_stack.contract.frames import FRONT_CAMERA
from robot_stack.contract.states import DockingState
from robot_stack.core.geometry import IDENTITY, ZERO_TWIST, Pose2, Twist2
from robot_stack.docking.contact import ContactWatch
from robot_stack.docking.dock_calibration import Correction, learnt
from robot_stack.docking.latch import LatchCommand, LatchInputs, LatchKeeper, LatchMotion, Motion
from robot_stack.docking.motion import Follower, Point, approach, correction, straight_to
from robot_stack.docking.results import DockCode, UndockCode
from robot_stack.docking.sighting import Marker, Sighting, sighting
from robot_stack.docking.states import ACTIVE, TRANSITIONS, Trigger, target_of
from robot_stack.docking.target import DockTarget, Seen
from tests.unit.docking.bench import CAMERAS, dock, markers_at, params

OPEN, CLOSED = LatchInputs(True, False, True), LatchInputs(True, True, False)
BETWEEN, UNKNOWN = LatchInputs(True, False, False), LatchInputs()


@pytest.mark.parametrize(("codes", "message"), [(DockCode, DockAction.Result), (UndockCode, UndockAction.Result)])
def test_codes_are_those_of_the_action(codes: type[DockCode] | type[UndockCode], message: object) -> None:
    for code in codes:
        assert getattr(message, code.name) == code.value
    named = {name for name in dir(message) if name.isupper() and isinstance(getattr(message, name), int)}
    assert named == {code.name for code in codes}


def test_every_job_can_be_failed_and_cancelled() -> None:
    for state in ACTIVE:
        assert target_of(state, Trigger.GAVE_UP) is DockingState.FAILED
        assert target_of(state, Trigger.CANCELLED) is DockingState.IDLE
    with pytest.raises(KeyError):
        target_of(DockingState.IDLE, Trigger.FOUND)
    assert {row.target for row in TRANSITIONS} == {row.source for row in TRANSITIONS} == set(DockingState)


@pytest.mark.parametrize("name", ["chair_1", "charger"])
@given(x=st.floats(0.9, 3.0), y=st.floats(-0.6, 0.6), yaw=st.floats(-0.6, 0.6))
def test_a_perfect_picture_gives_the_docks_pose(name: str, x: float, y: float, yaw: float) -> None:
    approach_sign = 1.0 if name == "chair_1" else -1.0
    truth = Pose2(approach_sign * x, y, yaw if approach_sign > 0 else yaw + math.pi)
    seen = sighting(markers_at(truth, dock(name), 5.0), dock(name), CAMERAS[f"{dock(name).camera}_camera"])
    assert seen is not None
    off = seen.dock.relative_to(truth)
    assert (off.x, off.y, off.yaw) == pytest.approx((0.0, 0.0, 0.0), abs=1e-9)
    assert (seen.stamp_s, seen.markers, seen.yaw_known) == (5.0, 4, True)


def test_sighting_sigma_is_derived_from_marker_quality() -> None:
    seen = sighting(markers_at(Pose2(1.0, 0.0, 0.0), dock("chair_1"), 0.0, 0.5), dock("chair_1"), CAMERAS[FRONT_CAMERA])
    assert seen is not None
    assert seen.sigma_m == pytest.approx(0.01)  # 1 / (1 + 1)


def test_a_camera_that_nods_moves_the_dock_by_less_than_its_height() -> None:
    nod = np.eye(4)
    nod[1:3, 1:3] = [[math.cos(0.002), -math.sin(0.002)], [math.sin(0.002), math.cos(0.002)]]
    markers = [
        Marker(m.stamp_s, m.camera_frame, m.marker_id, nod @ m.pose, m.quality)
        for m in markers_at(Pose2(0.95, 0.0, 0.0), dock("chair_1"), 0.0)
    ]
    seen = sighting(markers, dock("chair_1"), CAMERAS[FRONT_CAMERA])
    assert seen is not None
    assert abs(seen.dock.x - 0.95) < 1e-4  # at the dock's origin on the ground the error would be 0.9 mm


def test_sighting_rejects_invalid_markers() -> None:
    own, camera = dock("chair_1"), CAMERAS[FRONT_CAMERA]
    good = markers_at(Pose2(1.0, 0.0, 0.0), own, 1.0)[0]
    bent = good.pose.copy()
    bent[0, 0] = 5.0
    nan = good.pose.copy()
    nan[0, 3] = math.nan
    for pose, quality, stamp_s in (
        (bent, 0.9, 1.0),
        (nan, 0.9, 1.0),
        (good.pose, math.nan, 1.0),
        (good.pose, 0.0, 1.0),
        (good.pose, -1.0, 1.0),
        (good.pose, 0.9, math.inf),
    ):
        assert sighting([Marker(stamp_s, FRONT_CAMERA, 0, pose, quality)], own, camera) is None
    assert sighting([Marker(1.0, FRONT_CAMERA, 7, good.pose, 0.9)], own, camera) is None  # a marker of another dock
    assert sighting([], own, camera) is None


def seen_at(pose: Pose2, *, sigma_m: float = 0.0005, yaw_known: bool = True) -> Sighting:
    return Sighting(0.0, pose, sigma_m, yaw_known, 4)


def test_many_sightings_average() -> None:
    random = np.random.default_rng(3)
    target = DockTarget(params().target)
    for _ in range(200):
        dx, dy, dyaw = 0.001 * random.standard_normal(3)
        target.see(seen_at(Pose2(1.0 + dx, dy, dyaw), sigma_m=0.001), IDENTITY)
    estimate = target.estimate
    assert estimate is not None
    assert math.hypot(estimate.pose.x - 1.0, estimate.pose.y) < 0.0008
    assert estimate.sigma_m < 0.0005


def test_the_estimate_stays_where_it_is_while_the_robot_drives() -> None:
    target = DockTarget(params().target)
    for k in range(20):
        base = Pose2(0.05 * k, 0.02 * k, 0.01 * k)
        assert target.see(seen_at(Pose2(2.0, 1.0, 0.3).relative_to(base)), base) is Seen.ACCEPTED
        target.drive(Pose2(0.05, 0.02, 0.01))
    assert target.estimate is not None
    assert target.estimate.pose.distance_to(Pose2(2.0, 1.0, 0.3)) < 1e-9


def test_target_rejects_jump_and_reports_moved_dock() -> None:
    target = DockTarget(params().target)
    target.see(seen_at(Pose2(1.0, 0.0, 0.0)), IDENTITY)
    away = seen_at(Pose2(1.0, 0.2, 0.0))
    verdicts = [target.see(away, IDENTITY) for _ in range(params().target.moved_after)]
    assert verdicts == [Seen.JUMPED] * (params().target.moved_after - 1) + [Seen.MOVED]
    assert target.estimate is not None
    assert target.estimate.pose == Pose2(1.0, 0.0, 0.0)
    contradicting = [target.see(seen_at(Pose2(1.0, 0.2 if k % 2 else -0.2, 0.0)), IDENTITY) for k in range(20)]
    assert contradicting == [Seen.JUMPED] * 20


def test_yaw_jump_is_rejected_only_if_yaw_is_known() -> None:
    target = DockTarget(params().target)
    target.see(seen_at(Pose2(1.0, 0.0, 0.0)), IDENTITY)
    assert target.see(seen_at(Pose2(1.0, 0.0, 0.5)), IDENTITY) is Seen.JUMPED
    assert target.see(seen_at(Pose2(1.0, 0.0, 0.5), yaw_known=False), IDENTITY) is Seen.ACCEPTED
    assert target.estimate is not None
    assert target.estimate.pose.yaw == 0.0


# Too fast to slow down before the last 0.1 m; at the permitted speed; the same sideways.
@example(x=-0.125, y=0.0, yaw=0.0, vx=0.125, approach_sign=1.0)
@example(x=-0.101, y=0.0, yaw=0.0, vx=0.2, approach_sign=1.0)
@example(x=-0.11, y=0.3, yaw=0.3, vx=-0.2, approach_sign=-1.0)
@settings(max_examples=60, deadline=None)
@given(
    x=st.floats(-2.5, -0.02),
    y=st.floats(-0.6, 0.6),
    yaw=st.floats(-0.5, 0.5),
    vx=st.floats(-0.2, 0.2),
    approach_sign=st.sampled_from([1.0, -1.0]),
)
def test_a_reference_is_smooth_within_its_limits_and_ends_docked(
    x: float, y: float, yaw: float, vx: float, approach_sign: float
) -> None:
    motion = params().motion
    reference = approach(Point(Pose2(approach_sign * x, y, yaw), Twist2(vx, 0.0, 0.0)), approach_sign, motion)
    times = np.linspace(0.0, reference.duration_s, 400)
    points = [reference.at(float(t)) for t in times]
    dt_s = float(times[1])
    speeds = np.array([(p.velocity.vx, p.velocity.vy, p.velocity.omega) for p in points])
    assert (np.abs(speeds) <= np.array([motion.along_mps, motion.across_mps, motion.turning_radps]) + 1e-6).all()
    rates = np.abs(np.diff(speeds, axis=0)) / dt_s
    assert (
        rates <= np.array([motion.acceleration_mps2, motion.acceleration_mps2, motion.acceleration_radps2]) + 1e-6
    ).all()
    end = points[-1]
    assert (end.pose.x, end.pose.y, end.pose.yaw) == pytest.approx((0.0, 0.0, 0.0), abs=1e-6)
    assert end.velocity.speed() < 1e-6
    near = [
        abs(p.velocity.vx)
        for p in points
        if -approach_sign * p.pose.x < motion.final_m - 1e-3 and -approach_sign * x > motion.final_m
    ]
    assert max(near, default=0.0) <= motion.final_mps + 1e-6
    if -approach_sign * x > motion.final_m and vx == 0.0:  # never beyond the dock pose
        assert all(-approach_sign * p.pose.x > -1e-3 for p in points)


def test_the_reference_waits_for_a_robot_that_is_held() -> None:
    motion = params().motion
    start = Pose2(-1.0, 0.0, 0.0)
    follower = Follower(straight_to(Point(start, ZERO_TWIST), Pose2(0.0, 0.0, 0.0), motion), motion)
    for _ in range(600):
        twist = follower.step(start, 0.05)
    assert not follower.finished
    ahead = follower.step(start, 0.05)
    assert 0.0 < ahead.vx <= motion.along_mps + motion.max_correction_mps
    assert twist.is_finite()


def test_corrections_are_bounded_and_point_at_the_error() -> None:
    motion = params().motion
    far = correction(Pose2(3.0, -4.0, 2.0), motion)
    assert far.speed() == pytest.approx(motion.max_correction_mps)
    assert math.atan2(far.vy, far.vx) == pytest.approx(math.atan2(-4.0, 3.0))
    assert far.omega == motion.max_correction_radps
    assert correction(IDENTITY, motion) == ZERO_TWIST


def roll(watch: ContactWatch, force_n: float, distance_m: float, seconds: float) -> bool:
    touched = False
    for _ in range(round(seconds / 0.05)):
        touched |= watch.update(force_n, distance_m, True, 0.05)
    return touched


@pytest.mark.parametrize("free_n", [0.0, 90.0, -40.0])
def test_pushing_is_more_than_rolling_on_whatever_slope(free_n: float) -> None:
    watch = ContactWatch(params().contact)
    assert not roll(watch, free_n, 0.3, 2.0)
    assert not roll(watch, free_n + 15.0, 0.1, 2.0)
    assert roll(watch, free_n + 40.0, 0.05, 0.5)
    assert watch.excess_n > params().contact.force_n


def test_spike_and_unknown_effort_are_no_contact() -> None:
    watch = ContactWatch(params().contact)
    roll(watch, 10.0, 0.3, 2.0)
    assert not watch.update(60.0, 0.05, True, 0.05)
    assert not roll(watch, 10.0, 0.05, 1.0)
    watch = ContactWatch(params().contact)
    assert not roll(watch, math.nan, 0.05, 2.0)
    assert not watch.update(1000.0, 0.05, True, 0.0)
    assert watch.excess_n == 0.0


@pytest.mark.parametrize(("command", "arrived"), [(LatchCommand.CLOSE, CLOSED), (LatchCommand.OPEN, OPEN)])
def test_a_movement_is_commanded_until_it_is_confirmed(command: LatchCommand, arrived: LatchInputs) -> None:
    motion = LatchMotion(command, 10.0, 2.0)
    assert motion.update(BETWEEN, 10.5) is Motion.MOVING
    assert motion.command is command
    assert motion.update(arrived, 11.0) is Motion.CONFIRMED
    assert motion.command is LatchCommand.HOLD


@pytest.mark.parametrize("inputs", [BETWEEN, UNKNOWN, OPEN, LatchInputs(True, True, True)])
def test_a_movement_that_is_not_confirmed_fails_and_holds(inputs: LatchInputs) -> None:
    motion = LatchMotion(LatchCommand.CLOSE, 10.0, 2.0)
    assert motion.update(inputs, 12.1) is Motion.FAILED
    assert motion.command is LatchCommand.HOLD
    assert "did not close" in motion.problem(inputs)
    assert motion.update(CLOSED, 13.0) is Motion.FAILED
    assert LatchMotion(LatchCommand.CLOSE, 10.0, 2.0).update(inputs, math.nan) is Motion.FAILED


def test_latch_keeper_reports_unexpected_release_once() -> None:
    keeper = LatchKeeper()
    assert keeper.attached is None
    assert not keeper.update(UNKNOWN, may_open=False)
    assert keeper.attached is None
    assert not keeper.update(OPEN, may_open=False)
    assert keeper.attached is False
    assert not keeper.update(CLOSED, may_open=False)
    assert keeper.attached is True
    assert not keeper.update(UNKNOWN, may_open=False)
    assert keeper.update(BETWEEN, may_open=False)
    assert not keeper.update(BETWEEN, may_open=False)
    assert keeper.attached is True
    keeper.update(CLOSED, may_open=False)
    assert not keeper.update(OPEN, may_open=True)
    assert not keeper.update(OPEN, may_open=False)
    assert keeper.attached is True
    keeper.released()
    assert keeper.attached is False


def test_recalled_attachment_with_open_latch_is_reported_as_release() -> None:
    keeper = LatchKeeper()
    keeper.recall(True)
    assert keeper.attached is True
    assert not keeper.update(UNKNOWN, may_open=False)
    assert keeper.update(OPEN, may_open=False)
    assert not keeper.update(OPEN, may_open=False)
    assert keeper.attached is True
    keeper.released()
    assert keeper.attached is False
    for attached, inputs in ((True, CLOSED), (False, OPEN)):
        matching = LatchKeeper()
        matching.recall(attached)
        assert matching.attached is (True if attached else None)
        assert not matching.update(inputs, may_open=False)
        assert matching.attached is attached


DOCK_POSE = Pose2(-0.95, 0.0, 0.0)


def test_camera_mounting_error_is_corrected_from_latched_pose() -> None:
    error = Pose2(0.001, -0.002, 0.0017)  # error of the mounting, at base_link
    true_dock = DOCK_POSE.inverse()
    sighted = [error.compose(true_dock)] * 5
    found = learnt(Correction(), sighted, DOCK_POSE, 0.5, 0.01, 0.02)
    assert isinstance(found, Correction)
    corrected = found.apply(error.compose(true_dock))
    assert (corrected.x, corrected.y, corrected.yaw) == pytest.approx((0.95, 0.0, 0.0), abs=1e-12)
    elsewhere = Pose2(2.0, 0.3, 0.1)  # the same camera at another place
    again = found.apply(error.compose(elsewhere))
    assert again.distance_to(elsewhere) < 1e-12


def test_later_findings_count_in_part() -> None:
    before = Correction(Pose2(0.002, 0.0, 0.0), 1)
    found = learnt(before, [DOCK_POSE.inverse()], DOCK_POSE, 0.5, 0.01, 0.02)
    assert isinstance(found, Correction)
    assert found.pose.x == pytest.approx(0.001)
    assert found.dockings == 2


@pytest.mark.parametrize("seen", [[], [Pose2(0.97, 0.0, 0.0)], [Pose2(0.95, 0.0, 0.05)], [Pose2(math.nan, 0.0, 0.0)]])
def test_implausible_sightings_yield_no_correction(seen: list[Pose2]) -> None:
    assert isinstance(learnt(Correction(), seen, DOCK_POSE, 0.5, 0.01, 0.02), str)
