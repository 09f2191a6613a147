"""The action navigate_to_pose on the navigation controller, with a fake robot that executes commands without delay."""

from __future__ import annotations

import pytest
from geometry_msgs.msg import PoseStamped
from std_msgs.msg import Bool

from custom_msgs.msg import SafetyStatus
from nav2_msgs.action import NavigateToPose
from robot_stack.contract import actions, topics
from robot_stack.core.geometry import Pose2
from robot_stack.core.goals import GoalStatus
from robot_stack.middleware.conversions import pose_from_msg, pose_stamped, time_to_s
from robot_stack.navigation.goal import GoalCode
from tests.simulated.bench import Bench
from tests.simulated.nodes.test_navigation import AHEAD, GOAL, TICK_S, Scene, moving
from tests.simulated.story import Goal


class Client:
    """Sends goals as a client written for Nav2 does."""

    def __init__(self, bench: Bench) -> None:
        self.bench, self.scene = bench, Scene(bench)

    def send(self, pose: Pose2, frame_id: str = "map", tree: str = "") -> Goal:
        request = NavigateToPose.Goal(pose=pose_stamped(pose, frame_id, self.bench.stamp()), behavior_tree=tree)
        goal = Goal(self.bench, self.bench.port, actions.NAVIGATE_TO_POSE, request)
        self.bench.wait(lambda: goal.accepted, "an accepted goal")
        return goal

    def send_at(self, speed_mps: float, pose: Pose2 = AHEAD) -> Goal:
        """Sends a goal and returns at the speed."""
        goal = self.send(pose)
        self.scene.commands.wait(lambda message: abs(message.linear.x) > speed_mps, f"{speed_mps} m/s")
        return goal

    def ends(self, goal: Goal, status: GoalStatus, code: GoalCode, text: str) -> None:
        goal.wait()
        assert goal.status is status
        assert goal.result.error_code == code
        assert text in goal.result.error_msg


@pytest.fixture
def client(bench: Bench) -> Client:
    return Client(bench)


def test_goal_is_driven_to_its_end_with_feedback(client: Client) -> None:
    begun_s = client.bench.now_s
    goal = client.send(AHEAD)
    goal.wait(30.0)
    took_s = client.bench.now_s - begun_s
    assert (goal.status, goal.result) == (GoalStatus.SUCCEEDED, NavigateToPose.Result())
    assert client.scene.robot.pose.distance_to(AHEAD) < 0.05
    assert len(goal.feedback) == pytest.approx(5.0 * took_s, abs=2.0)
    left = [item.distance_remaining for item in goal.feedback]
    assert left[0] == pytest.approx(6.0, abs=0.1)
    assert left == sorted(left, reverse=True)
    for item in goal.feedback:
        assert item.current_pose.header.frame_id == "map"
        away_m = pose_from_msg(item.current_pose.pose).distance_to(AHEAD)
        assert item.distance_remaining == pytest.approx(away_m, abs=0.05)
        assert item.number_of_recoveries == 0
    times = [time_to_s(item.navigation_time) for item in goal.feedback]
    assert times == sorted(times)
    assert times[-1] == pytest.approx(took_s, abs=0.3)
    middle = goal.feedback[len(goal.feedback) // 2]
    assert 2.0 < time_to_s(middle.estimated_time_remaining) < 6.0
    assert time_to_s(goal.feedback[0].estimated_time_remaining) == 0.0, "unknown at standstill"


def test_cancelled_goal_stops_the_robot_smoothly(client: Client) -> None:
    goal = client.send_at(0.5)
    cancelled_s = client.bench.now_s
    goal.cancel(0.2)
    client.ends(goal, GoalStatus.CANCELED, GoalCode.NONE, "cancelled")
    stopped_s = client.scene.stopped_s(cancelled_s)
    assert stopped_s > 0.5, "a ramp, no step"
    client.scene.rests(1.0)
    client.scene.plans.wait(lambda message: not message.poses, "the empty plan")


def test_newer_goal_preempts_without_a_stop(client: Client) -> None:
    first = client.send_at(0.5)
    begun_s = client.bench.now_s
    second = client.send(Pose2(8.0, 0.0, 0.0))
    client.ends(first, GoalStatus.ABORTED, GoalCode.NONE, "preempted")
    client.bench.run(0.5)
    assert all(message.linear.x > 0.4 for message in client.scene.commands.since(begun_s))
    second.wait(30.0)
    assert second.status is GoalStatus.SUCCEEDED


def test_goal_pose_preempts_and_its_empty_frame_ends_a_goal(client: Client) -> None:
    first = client.send_at(0.5)
    client.scene.go(GOAL)
    client.ends(first, GoalStatus.ABORTED, GoalCode.NONE, "preempted")
    client.scene.arrive()
    second = client.send_at(0.3)
    client.scene.send(PoseStamped())
    client.ends(second, GoalStatus.ABORTED, GoalCode.NONE, "goal cancelled")
    client.scene.stopped_s(client.bench.now_s)


@pytest.mark.parametrize(
    ("pose", "frame_id", "tree", "code", "text"),
    [
        (GOAL, "odom", "", GoalCode.TF_ERROR, "frame_id is 'odom', must be 'map'"),
        (GOAL, "", "", GoalCode.TF_ERROR, "frame_id is '', must be 'map'"),
        (Pose2(1e4, 0.0, 0.0), "map", "", GoalCode.INVALID, "limit 500.0 m"),
        (GOAL, "map", "spin.xml", GoalCode.INVALID, "behavior_tree must be empty"),
    ],
)
def test_goal_that_cannot_be_driven_is_aborted_with_its_code(
    client: Client, pose: Pose2, frame_id: str, tree: str, code: GoalCode, text: str
) -> None:
    client.ends(client.send(pose, frame_id, tree), GoalStatus.ABORTED, code, text)
    client.scene.rests(0.5)


def test_goal_with_a_behavior_tree_leaves_the_previous_one(client: Client) -> None:
    first = client.send_at(0.5)
    client.ends(client.send(GOAL, tree="spin.xml"), GoalStatus.ABORTED, GoalCode.INVALID, "behavior_tree")
    first.wait(30.0)
    assert first.status is GoalStatus.SUCCEEDED


def test_goal_beyond_the_map_is_aborted(bench: Bench) -> None:
    bench.start("navigation_controller", {"map": "yard", "use_costmap": False})
    request = NavigateToPose.Goal(pose=pose_stamped(Pose2(400.0, 0.0, 0.0), "map", bench.stamp()))
    goal = Goal(bench, bench.port, actions.NAVIGATE_TO_POSE, request)
    goal.wait()
    assert (goal.status, goal.result.error_code) == (GoalStatus.ABORTED, GoalCode.GOAL_OUTSIDE_MAP)


def test_emergency_stop_aborts_and_refuses(client: Client) -> None:
    goal = client.send_at(0.5)
    client.bench.repeat(topics.SAFETY_STATUS, lambda: SafetyStatus(safety_state="EMERGENCY_STOP"), 10.0)
    client.bench.publish(topics.EMERGENCY_STOP, Bool(data=True))
    client.ends(goal, GoalStatus.ABORTED, GoalCode.STOPPED, "emergency stop: the goal is dropped")
    client.ends(client.send(AHEAD), GoalStatus.ABORTED, GoalCode.STOPPED, "an emergency stop is active")
    client.scene.rests(1.0)


def test_feedback_goes_on_while_the_pose_is_unknown(client: Client) -> None:
    """Its silence would mean that the goal is lost."""
    goal = client.send_at(0.5)
    client.bench.silence(topics.CURRENT_POSE)
    client.bench.run(2.0)
    before = len(goal.feedback)
    client.bench.run(2.0)
    assert len(goal.feedback) - before == pytest.approx(10, abs=1)
    client.scene.robot.know_pose()
    goal.wait(30.0)
    assert goal.status is GoalStatus.SUCCEEDED


def test_restarted_controller_has_no_goal_and_stands(client: Client) -> None:
    goal = client.send_at(0.5)
    client.scene.process.kill()
    client.bench.start_again(client.scene.process)
    client.scene.rests(2.0)
    goal._goal.ask_result(goal._on_result)
    goal.wait()
    assert goal.status is GoalStatus.UNKNOWN
    assert not moving(client.scene.commands.last)
    assert client.scene.commands.period_s(20) == pytest.approx(TICK_S, abs=2e-4)
