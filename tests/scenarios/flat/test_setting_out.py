"""On the whole stack people are warned before a robot that has stood begins to move by itself, whoever asks for it."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import pytest

from robot_stack.contract import frames, topics
from robot_stack.contract.display import Display
from robot_stack.core.config import load
from robot_stack.core.departure import DepartureParams
from robot_stack.core.geometry import Pose2
from robot_stack.middleware.conversions import pose_from_msg, pose_stamped, time_to_s
from tests.support.waiting import wait_for

if TYPE_CHECKING:
    from tests.support.stack import StackUnderTest

pytestmark = pytest.mark.timeout(900)
DEPARTURE = load(DepartureParams, "departure")


def test_a_goal_given_by_hand_is_announced_before_it_moves_the_robot(stack: StackUnderTest) -> None:
    shown = stack.peer.listen(topics.SIM_EHMI_DISPLAY)
    warnings = stack.peer.listen(topics.DEPARTURE_WARNING)
    pose = stack.peer.listen(topics.CURRENT_POSE)
    pose.wait(lambda _: True, "a pose")
    shown.wait(lambda message: json.loads(message.data)["state"] == Display.IDLE, "a display at rest")
    warnings.wait_connected()
    # Who has just driven need not be announced, and whoever had this stack before may have driven it.
    stack.wait_stood(DEPARTURE.after_s + 1.0)
    stack.peer.wait_matched(topics.GOAL_POSE)
    goal = pose_stamped(pose_from_msg(pose.last.pose).compose(Pose2(1.5, 0.0, 0.0)), frames.MAP, pose.last.header.stamp)
    goal.header.stamp.sec = goal.header.stamp.nanosec = 0
    start = len(stack.truth.items)
    stack.peer.publish(topics.GOAL_POSE, goal)
    shown.wait(lambda message: json.loads(message.data)["state"] == Display.NAVIGATING, "the light of driving")
    assert stack.stands, "light first, then motion"
    wait_for(lambda: stack.speed_mps > 0.3, "it drives")
    told = warnings.messages
    assert {message.frame_id for message in told} == {"navigation_controller"}
    moved = next(m for m in stack.truth.messages[start:] if abs(m.twist.twist.linear.x) > 0.02)
    times = [time_to_s(message.stamp) for message in told]
    last = times[-1]
    assert time_to_s(moved.header.stamp) >= last - 0.1
    stack.wait_stands()
    assert json.loads(shown.last.data)["state"] in (Display.NAVIGATING, Display.IDLE)
    shown.wait(lambda message: json.loads(message.data)["state"] == Display.IDLE, "a display at rest again")
    # One that may not move for a moment, as while its stack is still young, begins its warning anew.
    kept = [time_s for time_s in times if time_s == pytest.approx(last, abs=0.3)]
    assert len(kept) > 0.5 * DEPARTURE.warning_s * 10.0, (
        "what it went by has been announced for as long as people are warned"
    )
