"""The navigation controller among a fake robot that does at once what it is told."""

from __future__ import annotations

import math
import time
from collections.abc import Callable

import numpy as np
import pytest
from geometry_msgs.msg import PoseStamped, Twist
from nav_msgs.msg import OccupancyGrid, Odometry
from std_msgs.msg import Bool

from custom_msgs.msg import SafetyStatus, VelocityLimit
from robot_stack.contract import topics
from robot_stack.core.geometry import IDENTITY, ZERO_TWIST, Pose2, exp_se2
from robot_stack.middleware.conversions import (
    pose_from_msg,
    pose_stamped,
    pose_to_msg,
    time_from_s,
    twist_from_msg,
    twist_to_msg,
)
from tests.support.blind import BLIND, WITHOUT_MAP
from tests.support.held_up import HeldUp
from tests.support.peer import Peer
from tests.support.processes import NodeProcess
from tests.support.waiting import wait_for

GOAL = Pose2(1.0, 0.5, 0.4)


class Robot:
    """Moves as /cmd_vel says; odom is its map."""

    def __init__(self) -> None:
        self.pose = IDENTITY
        self.twist = ZERO_TWIST
        self.last_s = time.time()

    def on_command(self, message: Twist) -> None:
        self.twist = twist_from_msg(message)

    def odometry(self) -> Odometry:
        now_s = time.time()
        self.pose = self.pose.compose(exp_se2(self.twist, now_s - self.last_s))
        self.last_s = now_s
        message = Odometry(child_frame_id="base_link")
        message.header.frame_id, message.header.stamp = "odom", time_from_s(now_s)
        message.pose.pose, message.twist.twist = pose_to_msg(self.pose), twist_to_msg(self.twist)
        return message

    def current_pose(self) -> PoseStamped:
        return pose_stamped(self.pose, "map", time_from_s(self.last_s))


def goal(pose: Pose2, frame_id: str = "map") -> PoseStamped:
    return pose_stamped(pose, frame_id, time_from_s(time.time()))


def moving(message: Twist) -> bool:
    return twist_from_msg(message) != ZERO_TWIST


@pytest.fixture
def node(start: Callable[..., NodeProcess], peer: Peer) -> NodeProcess:
    process = start("navigation_controller", *BLIND)
    for row in (topics.GOAL_POSE, topics.ODOM, topics.CURRENT_POSE, topics.VELOCITY_LIMIT, topics.EMERGENCY_STOP):
        peer.wait_matched(row)
    return process


@pytest.fixture
def robot(peer: Peer) -> Robot:
    robot = Robot()
    peer.listen(topics.CMD_VEL, robot.on_command)
    peer.repeat(topics.ODOM, robot.odometry, 50.0)
    peer.repeat(topics.CURRENT_POSE, robot.current_pose, 10.0)
    return robot


def test_zero_commands_at_their_rate_without_a_goal(node: NodeProcess, peer: Peer) -> None:
    commands, plans = peer.listen(topics.CMD_VEL), peer.listen(topics.PLAN)
    commands.wait_period(0.05, count=61)
    assert not any(map(moving, commands.messages))
    assert plans.wait(lambda message: not message.poses, "the empty plan").header.frame_id == "map"


def test_drives_to_the_goal_and_clears_its_plan(node: NodeProcess, peer: Peer, robot: Robot) -> None:
    commands, plans = peer.listen(topics.CMD_VEL), peer.listen(topics.PLAN)
    peer.publish(topics.GOAL_POSE, goal(GOAL))
    plan = plans.wait(lambda message: len(message.poses) > 1, "the plan")
    assert pose_from_msg(plan.poses[-1].pose).distance_to(GOAL) < 1e-3
    assert pose_from_msg(plan.poses[0].pose).distance_to(IDENTITY) < 1e-3
    node.wait_output("goal reached")
    plans.wait(lambda message: not message.poses, "the empty plan")
    assert robot.pose.distance_to(GOAL) < 0.05
    assert abs(robot.pose.yaw - GOAL.yaw) < math.radians(2.0)
    commands.wait(lambda message: not moving(message), "zero commands")


def test_emergency_stop_zeroes_and_only_a_goal_after_the_clean_status_moves_the_robot(
    node: NodeProcess, peer: Peer, robot: Robot
) -> None:
    commands = peer.listen(topics.CMD_VEL)
    peer.publish(topics.GOAL_POSE, goal(Pose2(6.0, 0.0, 0.0)))
    commands.wait(lambda message: message.linear.x > 0.5, "speed")
    peer.wait_matched(topics.EMERGENCY_STOP)
    peer.publish(topics.EMERGENCY_STOP, Bool(data=True))
    with HeldUp() as machine:
        stopped_s = time.monotonic()
        commands.wait(lambda message: not moving(message), "the zero command")
        assert time.monotonic() - stopped_s - machine.seconds < 0.2
    peer.repeat(topics.SAFETY_STATUS, lambda: SafetyStatus(safety_state="EMERGENCY_STOP"), 10.0)
    peer.publish(topics.EMERGENCY_STOP, Bool(data=False))
    count = len(commands.items)
    wait_for(lambda: len(commands.items) >= count + 10, "ten more commands")
    assert not any(map(moving, commands.messages[count:]))
    peer.publish(topics.GOAL_POSE, goal(Pose2(6.0, 0.0, 0.0)))
    node.wait_output("/goal_pose refused: an emergency stop is in force")
    peer.repeat(topics.SAFETY_STATUS, lambda: SafetyStatus(safety_state="NORMAL"), 10.0)
    count = len(commands.items)
    wait_for(lambda: len(commands.items) >= count + 20, "a second of commands")
    assert not any(map(moving, commands.messages[count:]))
    peer.publish(topics.GOAL_POSE, goal(Pose2(6.0, 0.0, 0.0)))
    first = commands.wait(moving, "motion after the release")
    assert twist_from_msg(first).speed() < 0.1


def test_silent_pose_stops_and_its_return_goes_on_from_rest(node: NodeProcess, peer: Peer, robot: Robot) -> None:
    commands = peer.listen(topics.CMD_VEL)
    peer.publish(topics.GOAL_POSE, goal(Pose2(6.0, 0.0, 0.0)))
    commands.wait(lambda message: message.linear.x > 0.5, "speed")
    peer.silence(topics.CURRENT_POSE)
    with HeldUp() as machine:
        silent_s = time.monotonic()
        commands.wait(lambda message: not moving(message), "the zero command")
        assert time.monotonic() - silent_s - machine.seconds < 1.0
    node.wait_output("/current_pose silent for more than 0.5 s")
    peer.repeat(topics.CURRENT_POSE, robot.current_pose, 10.0)
    first = commands.wait(moving, "motion again")
    assert twist_from_msg(first).speed() < 0.1


def test_bad_goals_are_refused_by_name_and_the_robot_stands(node: NodeProcess, peer: Peer, robot: Robot) -> None:
    commands = peer.listen(topics.CMD_VEL)
    crooked = goal(GOAL)
    crooked.pose.orientation.w = 3.0
    for bad, reason in (
        (goal(Pose2(math.nan, 0.0, 0.0)), "position is not finite"),
        (goal(Pose2(1e4, 0.0, 0.0)), "limit 500.0 m"),
        (goal(GOAL, "odom"), "frame_id is 'odom', must be 'map'"),
        (crooked, "no unit quaternion"),
    ):
        peer.publish(topics.GOAL_POSE, bad)
        node.wait_output(reason)
    assert not any(map(moving, commands.messages))


def test_empty_frame_id_cancels(node: NodeProcess, peer: Peer, robot: Robot) -> None:
    commands, plans = peer.listen(topics.CMD_VEL), peer.listen(topics.PLAN)
    peer.publish(topics.GOAL_POSE, goal(Pose2(6.0, 0.0, 0.0)))
    commands.wait(lambda message: message.linear.x > 0.3, "speed")
    peer.publish(topics.GOAL_POSE, PoseStamped())
    plans.wait(lambda message: not message.poses, "the empty plan")
    commands.wait(lambda message: not moving(message), "standstill")


def test_velocity_limit_is_kept(node: NodeProcess, peer: Peer, robot: Robot) -> None:
    commands = peer.listen(topics.CMD_VEL)
    limit = VelocityLimit(max_linear_velocity=0.25, max_angular_velocity=0.5)
    peer.repeat(topics.VELOCITY_LIMIT, lambda: limit, 10.0)
    peer.publish(topics.GOAL_POSE, goal(Pose2(0.6, 0.0, 0.0)))
    node.wait_output("goal reached")
    fastest = max(twist_from_msg(message).speed() for message in commands.messages)
    assert 0.2 < fastest <= 0.2501


def test_a_velocity_limit_that_falls_silent_is_a_stop(node: NodeProcess, peer: Peer, robot: Robot) -> None:
    commands = peer.listen(topics.CMD_VEL)
    limit = VelocityLimit(max_linear_velocity=1.0, max_angular_velocity=0.5)
    peer.repeat(topics.VELOCITY_LIMIT, lambda: limit, 10.0)
    peer.publish(topics.GOAL_POSE, goal(Pose2(6.0, 0.0, 0.0)))
    commands.wait(lambda message: message.linear.x > 0.5, "speed")
    peer.silence(topics.VELOCITY_LIMIT)
    commands.wait(lambda message: not moving(message), "standstill")
    peer.repeat(topics.VELOCITY_LIMIT, lambda: limit, 10.0)
    commands.wait(moving, "it goes on: nobody has stopped it")


def test_it_leaves_with_a_zero_command(node: NodeProcess, peer: Peer, robot: Robot) -> None:
    commands = peer.listen(topics.CMD_VEL)
    peer.publish(topics.GOAL_POSE, goal(Pose2(6.0, 0.0, 0.0)))
    commands.wait(lambda message: message.linear.x > 0.3, "speed")
    node.stop()
    commands.wait(lambda message: not moving(message), "the zero command on the way out")
    assert node.process.returncode == 0


class Passer:
    """Costmaps of 0.2 s of somebody who walks along x at 1 m/s, and of a post beside the way; whenever they come."""

    def __init__(self) -> None:
        self.stamp_s = 100.0

    def costmap(self) -> OccupancyGrid:
        self.stamp_s += 0.2
        cells = np.zeros((120, 120), np.int8)
        column = 10 + 4 * (round(5.0 * self.stamp_s) % 20)
        cells[38:42, column : column + 6] = 100
        cells[80:86, 80:86] = 100
        message = OccupancyGrid(data=cells.ravel().tolist())
        message.header.frame_id, message.header.stamp = "odom", time_from_s(self.stamp_s)
        message.info.width = message.info.height = 120
        message.info.resolution = 0.05
        message.info.origin.orientation.w = 1.0
        return message


def test_who_walks_is_shown_while_somebody_looks(start: Callable[..., NodeProcess], peer: Peer) -> None:
    start("navigation_controller", *WITHOUT_MAP)
    peer.wait_matched(topics.LOCAL_COSTMAP)
    people = peer.listen(topics.NAVIGATION_PEOPLE)
    peer.repeat(topics.LOCAL_COSTMAP, Passer().costmap, 20.0)
    message = people.wait(lambda message: any(item.ns == "velocity" for item in message.markers), "somebody who walks")
    walker, arrow, post = (
        next(m for m in message.markers if m.ns == name) for name in ("walking", "velocity", "object")
    )
    assert walker.header.frame_id == "odom"
    assert walker.id == arrow.id
    assert walker.pose.position.y == pytest.approx(2.0, abs=0.1)
    begin, end = arrow.points
    assert (end.x - begin.x, end.y - begin.y) == (pytest.approx(1.0, abs=0.4), pytest.approx(0.0, abs=0.1))
    assert (post.pose.position.x, post.pose.position.y) == (pytest.approx(4.15, abs=0.1), pytest.approx(4.15, abs=0.1))


def costmap_with_a_box(now_s: float) -> OccupancyGrid:
    """10 m x 10 m around the origin of odom, with a box 3 m ahead."""
    cells = np.zeros((200, 200), np.int8)
    cells[90:110, 160:170] = 100
    message = OccupancyGrid(data=cells.ravel().tolist())
    message.header.frame_id, message.header.stamp = "odom", time_from_s(now_s)
    message.info.width = message.info.height = 200
    message.info.resolution = 0.05
    message.info.origin.position.x = message.info.origin.position.y = -5.0
    message.info.origin.orientation.w = 1.0
    return message


def test_commands_go_on_while_a_long_route_is_planned(
    start: Callable[..., NodeProcess], peer: Peer, robot: Robot
) -> None:
    """300 m over four million cells: some tenths of a second in a thread. A tick tells so, and a later one has it."""
    start("navigation_controller", *WITHOUT_MAP)
    for row in (topics.GOAL_POSE, topics.ODOM, topics.CURRENT_POSE, topics.LOCAL_COSTMAP):
        peer.wait_matched(row)
    commands, plans = peer.listen(topics.CMD_VEL), peer.listen(topics.PLAN)
    told = peer.listen(topics.NAVIGATION_STATUS)
    peer.repeat(topics.LOCAL_COSTMAP, lambda: costmap_with_a_box(time.time()), 5.0)
    commands.wait(lambda message: not moving(message), "a command")
    peer.publish(topics.GOAL_POSE, goal(Pose2(300.0, 5.0, 0.0)))
    told.wait(lambda message: message.data == "planning a route", "a route being planned")
    count = len(commands.items)
    plans.wait(lambda message: len(message.poses) > 2, "the route")
    assert len(commands.items) > count, "another tick since"
    assert not any(map(moving, commands.messages[:count])), "no motion without a route"
