"""A client written for Nav2, with rclpy alone, drives the navigation controller over DDS."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import pytest
import rclpy
from action_msgs.msg import GoalStatus
from geometry_msgs.msg import PoseStamped, Twist
from nav_msgs.msg import Odometry
from rclpy.action import ActionClient
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node

from nav2_msgs.action import NavigateToPose
from robot_stack.contract import topics
from robot_stack.core.geometry import IDENTITY, ZERO_TWIST, exp_se2
from robot_stack.middleware.conversions import (
    pose_stamped,
    pose_to_msg,
    time_from_s,
    time_to_s,
    twist_from_msg,
    twist_to_msg,
)
from tests.support.blind import BLIND
from tests.support.peer import Peer
from tests.support.processes import Start
from tests.support.waiting import DEADLINE_S, wait_for


class Navigator(Node):
    """Drives a robot as scripts for Nav2 do: one goal at a time, waited for in the caller's thread."""

    def __init__(self) -> None:
        self._own_context = Context()
        rclpy.init(context=self._own_context)
        super().__init__("navigator", context=self._own_context)
        self._loop = SingleThreadedExecutor(context=self._own_context)
        self._client = ActionClient(self, NavigateToPose, "navigate_to_pose")
        self.feedback: list[Any] = []

    def go_to_pose(self, x: float, y: float) -> Any:
        """Returns the accepted goal's handle."""
        goal = NavigateToPose.Goal()
        goal.pose.header.frame_id = "map"
        goal.pose.header.stamp = self.get_clock().now().to_msg()
        goal.pose.pose.position.x, goal.pose.pose.position.y = x, y
        goal.pose.pose.orientation.w = 1.0
        assert self._client.wait_for_server(DEADLINE_S)
        self.feedback.clear()
        handle = self.spin_until(self._client.send_goal_async(goal, lambda m: self.feedback.append(m.feedback)))
        assert handle.accepted
        return handle

    def result(self, handle: Any) -> tuple[int, Any]:
        answer = self.spin_until(handle.get_result_async())
        return answer.status, answer.result

    def cancel(self, handle: Any) -> None:
        answer = self.spin_until(handle.cancel_goal_async())
        assert [bytes(info.goal_id.uuid) for info in answer.goals_canceling] == [bytes(handle.goal_id.uuid)]

    def spin_until(self, future: Any) -> Any:
        rclpy.spin_until_future_complete(self, future, self._loop, DEADLINE_S)
        assert future.done(), f"timed out after {DEADLINE_S} s"
        return future.result()

    def spin_feedback(self, condition: Callable[[Any], bool]) -> None:
        def fits() -> bool:
            self._loop.spin_once(0.05)
            return bool(self.feedback) and condition(self.feedback[-1])

        self._loop.add_node(self)
        wait_for(fits, "the feedback")

    def close(self) -> None:
        self._client.destroy()
        self.destroy_node()
        rclpy.shutdown(context=self._own_context)


class Robot:
    """Executes /cmd_vel exactly; odom equals map."""

    def __init__(self, peer: Peer) -> None:
        self._clock = peer.node.get_clock()
        self.pose, self.twist = IDENTITY, ZERO_TWIST
        self._at_s = self._now_s()
        self.commands = peer.listen(topics.CMD_VEL, self._on_command)
        peer.repeat(topics.ODOM, self._odometry, 50.0)
        peer.repeat(topics.CURRENT_POSE, self._current_pose, 10.0)

    def _now_s(self) -> float:
        return time_to_s(self._clock.now().to_msg())

    def _move(self) -> None:
        now_s = self._now_s()
        self.pose = self.pose.compose(exp_se2(self.twist, now_s - self._at_s))
        self._at_s = now_s

    def _on_command(self, message: Twist) -> None:
        self._move()
        self.twist = twist_from_msg(message)

    def _odometry(self) -> Odometry:
        self._move()
        message = Odometry(child_frame_id="base_link")
        message.header.frame_id, message.header.stamp = "odom", time_from_s(self._at_s)
        message.pose.pose, message.twist.twist = pose_to_msg(self.pose), twist_to_msg(self.twist)
        return message

    def _current_pose(self) -> PoseStamped:
        self._move()
        return pose_stamped(self.pose, "map", time_from_s(self._at_s))

    def wait_standing(self) -> None:
        self.commands.wait(lambda message: twist_from_msg(message) == ZERO_TWIST, "standstill")


@pytest.fixture
def navigator(ros_domain: int) -> Iterator[Navigator]:
    node = Navigator()
    yield node
    node.close()


def test_a_client_written_for_nav2_drives_the_robot(start: Start, peer: Peer, navigator: Navigator) -> None:
    start("navigation_controller", *BLIND)
    robot = Robot(peer)
    # Before it knows its pose there is no plan, and feedback has no distance.
    peer.listen(topics.HEARTBEAT).wait(
        lambda beat: beat.node == "navigation_controller" and beat.ready, "a controller that knows its pose"
    )

    status, result = navigator.result(navigator.go_to_pose(1.0, 0.5))
    assert (status, result) == (GoalStatus.STATUS_SUCCEEDED, NavigateToPose.Result())
    assert abs(robot.pose.x - 1.0) < 0.05
    assert abs(robot.pose.y - 0.5) < 0.05
    assert navigator.feedback[0].distance_remaining > navigator.feedback[-1].distance_remaining
    assert {item.current_pose.header.frame_id for item in navigator.feedback} == {"map"}

    first = navigator.go_to_pose(100.0, 0.5)
    navigator.spin_feedback(lambda feedback: feedback.distance_remaining < 98.5)
    second = navigator.go_to_pose(200.0, 0.5)
    assert navigator.result(first)[0] == GoalStatus.STATUS_ABORTED, "preempted"
    navigator.spin_feedback(lambda feedback: feedback.distance_remaining < 198.0)
    navigator.cancel(second)
    status, result = navigator.result(second)
    assert (status, result.error_code) == (GoalStatus.STATUS_CANCELED, NavigateToPose.Result.NONE)
    robot.wait_standing()
