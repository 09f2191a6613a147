"""The navigation controller with a fake robot that executes commands without delay."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from geometry_msgs.msg import PoseStamped, Twist, TwistStamped
from nav_msgs.msg import OccupancyGrid
from sensor_msgs.msg import PointCloud2
from std_msgs.msg import Bool

from custom_msgs.msg import SafetyStatus, VelocityLimit
from robot_stack.contract import topics
from robot_stack.core.geometry import IDENTITY, ZERO_TWIST, Pose2
from robot_stack.core.people import Person, people_points
from robot_stack.middleware.conversions import pose_from_msg, pose_stamped, time_from_s, twist_from_msg
from robot_stack.middleware.point_cloud import cloud_message
from tests.simulated.bench import COMPUTE_S, JOB_S, LATENCY_S, Bench
from tests.simulated.nodes.robot import BLIND, WITHOUT_MAP, DrivenRobot

GOAL = Pose2(1.0, 0.5, 0.4)
AHEAD = Pose2(6.0, 0.0, 0.0)
TICK_S = 0.05


def moving(message: Twist) -> bool:
    return twist_from_msg(message) != ZERO_TWIST


class Scene:
    """A controller and a robot that it drives."""

    def __init__(self, bench: Bench, **parameters: Any) -> None:
        self.bench = bench
        self.plans = bench.listen(topics.PLAN)
        bench.publisher(topics.EMERGENCY_STOP)
        self.process = bench.start("navigation_controller", {**BLIND, **parameters})
        self.robot = DrivenRobot(bench)
        self.commands = self.robot.commands
        bench.run(0.3)

    def go(self, pose: Pose2, frame_id: str = "map") -> None:
        self.send(pose_stamped(pose, frame_id, self.bench.stamp()))

    def send(self, goal: PoseStamped) -> None:
        self.bench.publish(topics.GOAL_POSE, goal)

    def go_at(self, speed_mps: float) -> None:
        """Drives ahead until the command exceeds the speed."""
        self.go(AHEAD)
        self.commands.wait(lambda message: message.linear.x > speed_mps, f"{speed_mps} m/s")

    def rests(self, duration_s: float) -> None:
        begun_s = self.bench.now_s
        self.bench.run(duration_s)
        commands = self.commands.since(begun_s)
        assert len(commands) >= duration_s / TICK_S - 1.0
        assert not any(map(moving, commands))

    def stopped_s(self, since_s: float) -> float:
        """Time from ``since_s`` to the first zero command."""
        self.commands.wait(lambda message: not moving(message), "the zero command")
        return next(at_s for at_s, message in self.commands.items if at_s > since_s and not moving(message)) - since_s

    def log(self) -> str:
        return self.bench.log("navigation_controller")

    def arrive(self) -> None:
        self.bench.wait(lambda: "goal reached" in self.log(), "the goal reached")


@pytest.fixture
def scene(bench: Bench) -> Scene:
    return Scene(bench)


def test_zero_commands_at_their_rate_without_a_goal(scene: Scene) -> None:
    scene.rests(3.0)
    assert scene.commands.period_s(50) == pytest.approx(TICK_S, abs=2e-4)
    assert scene.plans.last.header.frame_id == "map"
    assert len(scene.plans.last.poses) == 0


def test_drives_to_the_goal_and_clears_its_plan(scene: Scene) -> None:
    scene.go(GOAL)
    plan = scene.plans.wait(lambda message: len(message.poses) > 1, "the plan")
    assert pose_from_msg(plan.poses[-1].pose).distance_to(GOAL) < 1e-3
    assert pose_from_msg(plan.poses[0].pose).distance_to(IDENTITY) < 1e-3
    scene.arrive()
    scene.plans.wait(lambda message: not message.poses, "the empty plan")
    assert scene.robot.pose.distance_to(GOAL) < 0.05
    assert abs(scene.robot.pose.yaw - GOAL.yaw) < math.radians(2.0)
    scene.rests(1.0)


def test_emergency_stop_zeroes_and_only_a_goal_after_the_clean_status_moves_the_robot(scene: Scene) -> None:
    bench = scene.bench
    scene.go_at(0.5)
    stopped_s = bench.now_s
    bench.publish(topics.EMERGENCY_STOP, Bool(data=True))
    assert scene.stopped_s(stopped_s) <= 2.0 * (LATENCY_S + COMPUTE_S)
    bench.repeat(topics.SAFETY_STATUS, lambda: SafetyStatus(safety_state="EMERGENCY_STOP"), 10.0)
    bench.publish(topics.EMERGENCY_STOP, Bool(data=False))
    scene.rests(1.0)
    scene.go(AHEAD)
    scene.rests(1.0)
    assert "goal refused: an emergency stop is active" in scene.log()
    bench.repeat(topics.SAFETY_STATUS, lambda: SafetyStatus(safety_state="NORMAL"), 10.0)
    scene.rests(1.0)
    scene.go(AHEAD)
    first = scene.commands.wait(moving, "motion after the release")
    assert twist_from_msg(first).speed() < 0.1


def test_missing_pose_stops_and_a_fresh_one_resumes_from_rest(scene: Scene) -> None:
    scene.go_at(0.5)
    silent_s = scene.bench.now_s
    scene.bench.silence(topics.CURRENT_POSE)
    # The newest pose is up to 0.1 s older.
    assert 0.4 <= scene.stopped_s(silent_s) <= 0.5 + TICK_S + LATENCY_S + 3.0 * COMPUTE_S
    assert "/current_pose silent for more than 0.5 s" in scene.log()
    scene.robot.know_pose()
    first = scene.commands.wait(moving, "motion again")
    assert twist_from_msg(first).speed() < 0.1


def test_a_stick_at_rest_holds_the_robot_without_ending_its_goal(scene: Scene) -> None:
    scene.go_at(0.5)
    scene.robot.held = True
    scene.bench.repeat(topics.TELEOP_CMD_VEL, TwistStamped, 20.0)
    scene.bench.run(20.0)
    scene.bench.silence(topics.TELEOP_CMD_VEL)
    scene.robot.held = False
    scene.arrive()


def test_silent_odometry_stops(scene: Scene) -> None:
    scene.go_at(0.5)
    silent_s = scene.bench.now_s
    scene.bench.silence(topics.ODOM)
    assert 0.18 <= scene.stopped_s(silent_s) <= 0.2 + TICK_S + LATENCY_S + 3.0 * COMPUTE_S


def test_bad_goals_are_refused_by_name_and_the_robot_stands(scene: Scene) -> None:
    crooked = pose_stamped(GOAL, "map", scene.bench.stamp())
    crooked.pose.orientation.w = 3.0
    for bad, frame_id, reason in (
        (Pose2(math.nan, 0.0, 0.0), "map", "position is not finite"),
        (Pose2(1e4, 0.0, 0.0), "map", "limit 500.0 m"),
        (GOAL, "odom", "frame_id is 'odom', must be 'map'"),
    ):
        scene.go(bad, frame_id)
        scene.rests(1.0)
        assert reason in scene.log()
    scene.send(crooked)
    scene.rests(1.0)
    assert "no unit quaternion" in scene.log()


def test_empty_frame_id_cancels(scene: Scene) -> None:
    scene.go_at(0.3)
    scene.send(PoseStamped())
    scene.plans.wait(lambda message: not message.poses, "the empty plan", 0.1)
    scene.commands.wait(lambda message: not moving(message), "standstill")
    scene.rests(1.0)


def test_velocity_limit_is_kept(scene: Scene) -> None:
    limit = VelocityLimit(max_linear_velocity=0.25, max_angular_velocity=0.5)
    scene.bench.repeat(topics.VELOCITY_LIMIT, lambda: limit, 20.0)
    scene.go(Pose2(0.6, 0.0, 0.0))
    scene.arrive()
    fastest = max(twist_from_msg(message).speed() for message in scene.commands.messages)
    assert 0.2 < fastest <= 0.2501


def test_a_velocity_limit_that_falls_silent_is_a_stop(scene: Scene) -> None:
    limit = VelocityLimit(max_linear_velocity=1.0, max_angular_velocity=0.5)
    scene.bench.repeat(topics.VELOCITY_LIMIT, lambda: limit, 20.0)
    scene.go_at(0.5)
    silent_s = scene.bench.now_s
    scene.bench.silence(topics.VELOCITY_LIMIT)
    braked_s = next_slower(scene, silent_s)
    assert 0.15 <= braked_s <= topics.VELOCITY_LIMIT.stale_limit_s + 2.0 * TICK_S
    scene.commands.wait(lambda message: not moving(message), "standstill")
    scene.bench.repeat(topics.VELOCITY_LIMIT, lambda: limit, 20.0)
    scene.commands.wait(moving, "it goes on: the goal is still there")


def next_slower(scene: Scene, since_s: float) -> float:
    """Time from ``since_s`` to the first command that is slower than the one before."""
    scene.commands.wait(lambda message: not moving(message), "standstill")
    items = [(at_s, message.linear.x) for at_s, message in scene.commands.items if at_s > since_s]
    return next(at_s for (_, before), (at_s, now) in itertools.pairwise(items) if now < before) - since_s


def test_it_leaves_with_a_zero_command(scene: Scene) -> None:
    scene.go_at(0.3)
    assert scene.bench.stop(scene.process) == 0
    scene.bench.run(0.1)
    assert not moving(scene.commands.last)


class Passer:
    """Lists every 0.2 s with a person walking along x at 1 m/s and a post aside, independent of their arrival."""

    def __init__(self) -> None:
        self.stamp_s = 100.0

    def people(self) -> PointCloud2:
        self.stamp_s += 0.2
        walker = Person(self.stamp_s, self.stamp_s % 4.0, 2.0, 1.0, 0.0, sightings=9, walks=True, walked=True, number=7)
        post = Person(self.stamp_s, 4.15, 4.15, sightings=9, number=8)
        apart = [replace(one, apart_s=self.stamp_s) for one in (walker, post)]
        return people_message(apart, self.stamp_s)


def people_message(people: Sequence[Person], stamp_s: float) -> PointCloud2:
    message = cloud_message(people_points(people, stamp_s), "odom")
    message.header.stamp = time_from_s(stamp_s)
    return message


def costmap(cells: Any, stamp_s: float, origin_m: float) -> OccupancyGrid:
    message = OccupancyGrid(data=cells.ravel().tolist())
    message.header.frame_id, message.header.stamp = "odom", time_from_s(stamp_s)
    message.info.width = message.info.height = len(cells)
    message.info.resolution = 0.05
    message.info.origin.position.x = message.info.origin.position.y = origin_m
    message.info.origin.orientation.w = 1.0
    return message


def test_pedestrians_are_published_while_subscribed(bench: Bench) -> None:
    bench.start("navigation_controller", WITHOUT_MAP)
    people = bench.listen(topics.NAVIGATION_PEOPLE)
    bench.run(0.2)
    bench.repeat(topics.PEOPLE, Passer().people, 5.0)
    message = people.wait(lambda message: any(item.ns == "velocity" for item in message.markers), "somebody who walks")
    walker, arrow, post = (
        next(m for m in message.markers if m.ns == name) for name in ("walking", "velocity", "object")
    )
    assert walker.header.frame_id == "odom"
    assert walker.id == arrow.id
    assert walker.pose.position.y == pytest.approx(2.0, abs=0.1)
    begin, end = arrow.points
    assert (end.x - begin.x, end.y - begin.y) == (pytest.approx(1.0, abs=1e-3), pytest.approx(0.0))
    assert (post.pose.position.x, post.pose.position.y) == (pytest.approx(4.15, abs=0.1), pytest.approx(4.15, abs=0.1))


def test_commands_go_on_while_a_route_is_planned(bench: Bench) -> None:
    """Planning runs beside the loop: one tick reports the planning, and a later one has the route."""
    reported = bench.listen(topics.NAVIGATION_STATUS)
    scene = Scene(bench, use_costmap=True)
    cells = np.zeros((200, 200), np.int8)
    cells[90:110, 160:170] = 100  # 3 m ahead
    bench.repeat(topics.LOCAL_COSTMAP, lambda: costmap(cells, bench.stamp_s(), -5.0), 5.0)
    bench.repeat(topics.PEOPLE, lambda: people_message((), bench.stamp_s()), 5.0)
    scene.rests(0.5)
    scene.go(Pose2(30.0, 5.0, 0.0))
    reported.wait(lambda message: message.data == "planning a route", "a route being planned", 0.2)
    begun_s = bench.now_s
    scene.plans.wait(lambda message: len(message.poses) > 2, "the route")
    assert bench.now_s - begun_s <= 2.0 * TICK_S + JOB_S
    commands = scene.commands.since(begun_s)
    assert commands, "another tick since"
    assert not any(map(moving, commands)), "no motion without a route"
