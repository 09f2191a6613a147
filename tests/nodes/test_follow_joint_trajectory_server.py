"""The trajectory server on a real engine process with six virtual joints, called by an independent action client."""

from __future__ import annotations

import itertools
import signal
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from builtin_interfaces.msg import Duration
from std_msgs.msg import Bool
from std_srvs.srv import SetBool
from trajectory_msgs.msg import JointTrajectoryPoint

from control_msgs.action import FollowJointTrajectory
from control_msgs.msg import JointTolerance
from robot_stack.contract import actions, services, topics
from robot_stack.wmx.api import ErrorCode, OperationState
from robot_stack.wmx.axes import StatusSnapshot
from robot_stack.wmx.config import ENGINE_CONFIG_VARIABLE, STALE_VARIABLE
from tests.support.engine import TestEngine
from tests.support.processes import Start
from tests.support.waiting import wait_for

if TYPE_CHECKING:
    from tests.support.peer import Peer

NAME = "follow_joint_trajectory_server"
JOINTS = ["joint1", "joint2", "joint3", "joint4", "joint5", "joint6"]
STATUS_SUCCEEDED, STATUS_CANCELED, STATUS_ABORTED = 4, 5, 6
Result = FollowJointTrajectory.Result
NO_ENGINE = 263
EMERGENCY_STOP_ON = 65632


def duration(seconds: float) -> Duration:
    whole, nanoseconds = divmod(round(seconds * 1e9), 1_000_000_000)
    return Duration(sec=whole, nanosec=nanoseconds)


def goal(*waypoints: tuple[float, list[float]], joints: list[str] = JOINTS, **fields: Any) -> Any:
    """Waypoints are (time, positions)."""
    message = FollowJointTrajectory.Goal(**fields)
    message.trajectory.joint_names = joints
    message.trajectory.points = [
        JointTrajectoryPoint(positions=positions, time_from_start=duration(time_s)) for time_s, positions in waypoints
    ]
    return message


def moving(message: Any, velocities: list[list[float]], accelerations: list[list[float]] | None = None) -> Any:
    """The goal with a velocity, and optionally an acceleration, of every joint at every point."""
    for index, point in enumerate(message.trajectory.points):
        point.velocities = velocities[index]
        point.accelerations = accelerations[index] if accelerations is not None else []
    return message


class Sent:
    """A goal that the server has accepted."""

    def __init__(self, peer: Peer, client: Any, message: Any) -> None:
        self._peer = peer
        self.feedback: list[Any] = []
        sent = peer.in_loop(
            lambda: client.send_goal_async(message, feedback_callback=lambda m: self.feedback.append(m.feedback))
        )
        wait_for(sent.done, "an answer to the goal")
        self.handle = sent.result()
        assert self.handle.accepted, "every goal is accepted"
        self._ended = peer.in_loop(self.handle.get_result_async)

    def result(self) -> tuple[int, int, str]:
        """(status, error_code, error_string)."""
        wait_for(self._ended.done, "the result")
        ended = self._ended.result()
        return ended.status, ended.result.error_code, ended.result.error_string

    @property
    def ended(self) -> bool:
        return bool(self._ended.done())

    def cancel(self) -> Any:
        return self._peer.in_loop(self.handle.cancel_goal_async)


class Rig:
    """Engine, server and client."""

    def __init__(self, start: Start, peer: Peer, folder: Path) -> None:
        from rclpy.action import ActionClient

        self.start, self.peer = start, peer
        self.engine = TestEngine(start, folder)
        self._beats = peer.listen(topics.HEARTBEAT)
        self._client = ActionClient(peer.node, FollowJointTrajectory, actions.FOLLOW_JOINT_TRAJECTORY.name)
        self.engine.run().up()
        self.launch()
        self.wait_health("")
        wait_for(self._client.server_is_ready, "the action")

    def launch(self) -> None:
        self.server = self.start(NAME, "-p", "start.max_velocity_radps:=[2.0,2.0,2.0,2.0,2.0,2.0]")

    def wait_health(self, text: str) -> None:
        """Waits for a heartbeat of this server with ``text``; empty means ready."""

        def matches() -> bool:
            last = self._beats.last
            if last is None or last.pid != self.server.pid:
                return False
            return text in last.waiting_for if text else last.ready

        wait_for(matches, f"the node to be {text or 'ready'}", 60.0)

    def send(self, *waypoints: tuple[float, list[float]], **fields: Any) -> Sent:
        return Sent(self.peer, self._client, goal(*waypoints, **fields))

    def send_message(self, message: Any) -> Sent:
        return Sent(self.peer, self._client, message)

    @property
    def status(self) -> StatusSnapshot:
        def read() -> StatusSnapshot | None:
            code, snapshot = self.engine.device.read_status()
            return None if code else snapshot

        snapshot = wait_for(read, "a status", poll_s=0.001)
        assert snapshot is not None
        return snapshot

    @property
    def standing(self) -> bool:
        snapshot = self.status
        idle = bool((snapshot.op_state == OperationState.Idle).all())
        return idle and not snapshot.velocity_cmd.any() and bool((np.abs(snapshot.actual_velocity) < 0.01).all())

    def wait_moving(self, speed_radps: float = 0.2) -> None:
        wait_for(lambda: np.abs(self.status.velocity_cmd).max() > speed_radps, "the arm to move", poll_s=0.002)

    def set_gripper(self, close: bool) -> tuple[bool, str]:
        answer = self.peer.call(services.SET_GRIPPER, SetBool.Request(data=close))
        return answer.success, answer.message

    def now(self, ahead_s: float = 0.0) -> Any:
        nanoseconds = self.peer.node.get_clock().now().nanoseconds + round(1e9 * ahead_s)
        whole, rest = divmod(nanoseconds, 1_000_000_000)
        return type(self.peer.node.get_clock().now().to_msg())(sec=whole, nanosec=rest)


@pytest.fixture(scope="module")
def shared_rig(shared_start: Start, shared_peer: Peer, shared_folder: Path) -> Iterator[Rig]:
    with pytest.MonkeyPatch.context() as monkeypatch:
        monkeypatch.setenv(ENGINE_CONFIG_VARIABLE, "wmx_engine_manipulator")
        monkeypatch.setenv(STALE_VARIABLE, "1.0")  # the engine may stall on a busy machine
        rig = Rig(shared_start, shared_peer, shared_folder)
        yield rig
        rig.engine.close()


HOME = [0.0] * 6
THERE = [0.3, -0.2, 0.25, 0.1, -0.3, 0.2]
FAR = [1.5, -1.0, 1.2, 0.5, -1.5, 1.0]
HALF = [0.5 * angle for angle in FAR]
LONG = ((0.0, HOME), (1.5, HALF), (3.0, FAR))


@pytest.fixture
def rig(shared_rig: Rig) -> Rig:
    """The arm stands at HOME."""
    assert shared_rig.send((2.0, HOME)).result()[0] == STATUS_SUCCEEDED
    return shared_rig


def test_a_trajectory_is_followed_and_reported(rig: Rig) -> None:
    backwards = JOINTS[::-1]
    sent = rig.send((0.0, HOME), (0.3, [0.5 * x for x in THERE[::-1]]), (0.7, THERE[::-1]), joints=backwards)
    assert sent.result() == (STATUS_SUCCEEDED, Result.SUCCESSFUL, "")
    assert rig.status.actual_pos == pytest.approx(THERE, abs=1e-3)
    assert rig.standing
    assert len(sent.feedback) > 10
    stamps = [m.header.stamp.sec + 1e-9 * m.header.stamp.nanosec for m in sent.feedback]
    assert all(after > before for before, after in itertools.pairwise(stamps))
    for message in sent.feedback:
        assert list(message.joint_names) == backwards
        desired, actual = np.array(message.desired.positions), np.array(message.actual.positions)
        assert np.array(message.error.positions) == pytest.approx(desired - actual)
        assert np.abs(desired - actual).max() < 0.02
        assert len(message.desired.velocities) == len(message.desired.accelerations) == 6
        assert message.desired.time_from_start == message.actual.time_from_start
    middle = max(sent.feedback, key=lambda m: np.abs(m.desired.velocities).max())
    assert np.array(middle.actual.velocities) == pytest.approx(np.array(middle.desired.velocities), abs=0.15)

    # a single waypoint from any position keeps its time
    begin_s = rig.status.engine_time_s
    assert rig.send((0.4, HOME)).result() == (STATUS_SUCCEEDED, 0, "")
    assert rig.status.engine_time_s - begin_s >= 0.35
    assert rig.status.actual_pos == pytest.approx(HOME, abs=1e-3)

    # a start in the future: no motion before it
    message = goal((0.0, HOME), (0.3, THERE))
    message.trajectory.header.stamp = rig.now(59.0)
    begin_s = rig.status.engine_time_s
    later = rig.send_message(message)
    wait_for(lambda: rig.status.engine_time_s - begin_s > 0.7, "more time than the trajectory takes")
    assert rig.standing
    assert rig.status.actual_pos == pytest.approx(HOME, abs=1e-3)
    later.cancel()
    assert later.result()[0] == STATUS_CANCELED
    message.trajectory.header.stamp = rig.now(3.0)
    assert rig.send_message(message).result() == (STATUS_SUCCEEDED, 0, "")
    assert rig.status.actual_pos == pytest.approx(THERE, abs=1e-3)

    # the gripper
    assert rig.set_gripper(True) == (True, "Gripper closed successfully")
    assert rig.engine.device.io.GetOutBit(0, 0) == (0, 1)
    assert rig.set_gripper(False) == (True, "Gripper opened successfully")
    assert rig.engine.device.io.GetOutBit(0, 0) == (0, 0)


def test_infeasible_goals_are_rejected_with_reason(rig: Rig) -> None:

    def refused(message: Any, code: int, words: str) -> None:
        status, error_code, text = rig.send_message(message).result()
        assert (status, error_code) == (STATUS_ABORTED, code)
        assert words in text
        assert rig.standing
        assert rig.status.pos_cmd == pytest.approx(HOME, abs=1e-6)

    def with_stamp(seconds: float) -> Any:
        message = goal((0.5, THERE))
        message.trajectory.header.stamp = rig.now(seconds)
        return message

    refused(goal((1.0, THERE), joints=[*JOINTS[:5], "joint7"]), Result.INVALID_JOINTS, "unknown: 'joint7'")
    with_effort = goal((1.0, THERE))
    with_effort.trajectory.points[0].effort = [1.0] * 6
    refused(with_effort, Result.INVALID_GOAL, "points[0].effort: no efforts")
    refused(with_stamp(-3.0), Result.OLD_HEADER_TIMESTAMP, "the trajectory ended")
    refused(goal((0.1, THERE)), Result.INVALID_GOAL, "velocity")
    bad = [JointTolerance(name="joint9", position=0.1)]
    refused(goal((1.0, THERE), path_tolerance=bad), Result.INVALID_JOINTS, "path_tolerance: unknown joint 'joint9'")
    status, code, text = rig.send_message(goal(joints=[])).result()
    assert (status, code) == (STATUS_SUCCEEDED, 0)
    assert "no points" in text
    # as many points as permitted, a millisecond apart
    ways = [3.0 * (0.001 * i) ** 2 - 2.0 * (0.001 * i) ** 3 for i in range(1, 1001)]
    many = [(0.001 * (i + 1), [way * angle for angle in THERE]) for i, way in enumerate(ways)]
    assert rig.send(*many).result() == (STATUS_SUCCEEDED, 0, "")
    assert rig.status.actual_pos == pytest.approx(THERE, abs=1e-3)


def test_tolerances_preemption_and_cancellation(rig: Rig) -> None:
    tight = [JointTolerance(name="joint1", position=1e-4)]
    status, code, text = rig.send(*LONG, path_tolerance=tight).result()
    assert (status, code) == (STATUS_ABORTED, Result.PATH_TOLERANCE_VIOLATED)
    assert "joint1: position error" in text
    assert rig.standing

    # a newer goal ends the present one and starts from rest
    first = rig.send((3.0, FAR))
    rig.wait_moving()
    second = rig.send((0.6, HOME))
    status, code, text = first.result()
    assert (status, code) == (STATUS_ABORTED, Result.INVALID_GOAL)
    assert "preempted by a newer goal" in text
    assert second.result() == (STATUS_SUCCEEDED, 0, "")
    assert rig.status.actual_pos == pytest.approx(HOME, abs=1e-3)

    # canceled: only after the axes stand, on the path, and before its end
    sent = rig.send(*LONG)
    rig.wait_moving(0.4)
    answer = sent.cancel()
    wait_for(answer.done, "the answer to the cancellation")
    assert len(answer.result().goals_canceling) == 1
    status, code, text = sent.result()
    assert (status, code) == (STATUS_CANCELED, 0)
    assert text.startswith("canceled; stood ")
    assert rig.standing
    place = rig.status.pos_cmd
    assert place == pytest.approx(np.array(FAR) * (place[0] / FAR[0]), abs=1e-5), "left the path"
    assert 0.0 < place[0] < FAR[0]

    # canceled before its start
    message = goal((0.5, HOME))
    message.trajectory.header.stamp = rig.now(30.0)
    waiting = rig.send_message(message)
    waiting.cancel()
    assert waiting.result()[:2] == (STATUS_CANCELED, 0)

    # the emergency stop
    sent = rig.send((3.0, FAR))
    rig.wait_moving()
    rig.peer.publish(topics.EMERGENCY_STOP, Bool(data=True))
    status, code, text = sent.result()
    assert (status, code) == (STATUS_ABORTED, EMERGENCY_STOP_ON)
    assert text.startswith("emergency stop")
    assert rig.standing
    assert rig.send((1.0, HOME)).result()[:2] == (STATUS_ABORTED, EMERGENCY_STOP_ON)
    assert rig.set_gripper(True) == (False, "Failed to close gripper")
    assert rig.standing

    # without a safety monitor, the same topic carries the stop's end and the next stop
    rig.peer.publish(topics.EMERGENCY_STOP, Bool(data=False))
    nothing = goal(joints=[])
    wait_for(lambda: rig.send_message(nothing).result()[0] == STATUS_SUCCEEDED, "the release", poll_s=0.1)
    sent = rig.send((3.0, FAR))
    rig.wait_moving()
    rig.peer.publish(topics.EMERGENCY_STOP, Bool(data=True))
    assert sent.result()[:2] == (STATUS_ABORTED, EMERGENCY_STOP_ON)
    assert rig.standing
    rig.peer.publish(topics.EMERGENCY_STOP, Bool(data=False))
    wait_for(lambda: rig.send_message(nothing).result()[0] == STATUS_SUCCEEDED, "the release", poll_s=0.1)


def desired(feedback: list[Any], time_s: float) -> Any:
    """The desired point of the feedback nearest to a time of the goal."""
    return min((m.desired for m in feedback), key=lambda point: abs(seconds(point.time_from_start) - time_s))


def seconds(time_from_start: Duration) -> float:
    return time_from_start.sec + 1e-9 * time_from_start.nanosec


def test_velocities_accelerations_and_late_starts_are_obeyed(rig: Rig) -> None:
    """The curves: tests/unit/wmx/trajectory/test_curves.py."""
    fast, still = [0.4 * angle for angle in FAR], [0.0] * 6
    # Without velocities the spline passes the middle at 0.75 of FAR per second.
    message = moving(goal((0.0, HOME), (1.0, HALF), (2.0, FAR)), [still, fast, still], [still, still, still])
    sent = rig.send_message(message)
    assert sent.result() == (STATUS_SUCCEEDED, 0, "")
    middle = desired(sent.feedback, 1.0)
    assert middle.velocities[0] == pytest.approx(fast[0], abs=0.06)
    assert middle.accelerations[0] == pytest.approx(0.0, abs=0.6)

    # Started half a second ago: the points are reached at their due times.
    late = goal((1.5, HALF), (3.0, HOME))
    late.trajectory.header.stamp = rig.now(-0.5)
    sent = rig.send_message(late)
    assert sent.result() == (STATUS_SUCCEEDED, 0, "")
    assert seconds(sent.feedback[0].desired.time_from_start) >= 0.5
    assert desired(sent.feedback, 1.5).positions[0] == pytest.approx(HALF[0], abs=0.05)
    assert rig.status.actual_pos == pytest.approx(HOME, abs=1e-3)


def test_an_engine_that_hangs_or_dies_in_motion_aborts_and_the_server_recovers(rig: Rig) -> None:
    # an engine that hangs: the goal ends in time, and the arm stops as soon as the engine continues
    sent = rig.send((3.0, FAR))
    rig.wait_moving()
    assert rig.engine.process is not None
    rig.engine.process.signal(signal.SIGSTOP)
    status, code, text = sent.result()
    assert (status, code) == (STATUS_ABORTED, ErrorCode.StatusChannelError)
    assert "engine status" in text
    rig.engine.process.signal(signal.SIGCONT)
    wait_for(lambda: rig.standing, "the arm to stand")
    assert abs(rig.status.pos_cmd[0]) < abs(FAR[0]) - 0.1, "it went on to its goal"
    rig.wait_health("")

    sent = rig.send((3.0, FAR))
    rig.wait_moving()
    rig.engine.kill()
    status, code, text = sent.result()
    assert status == STATUS_ABORTED
    assert code > 0
    assert "engine" in text
    assert rig.send((2.0, FAR)).result()[:2] == (STATUS_ABORTED, NO_ENGINE)
    assert rig.set_gripper(False) == (False, "Failed to open gripper")
    rig.wait_health("engine")
    rig.engine.close()
    rig.engine.run().up()
    rig.wait_health("")
    assert rig.send((0.5, THERE)).result() == (STATUS_SUCCEEDED, 0, "")


def test_a_server_that_hangs_is_killed_or_ends_in_motion(rig: Rig) -> None:
    # The engine's watchdog stops no axis: the arm continues to the end of the spline.
    sent = rig.send((1.5, THERE))
    rig.wait_moving()
    rig.server.signal(signal.SIGSTOP)
    try:
        wait_for(lambda: rig.standing, "the arm to stand")
        assert rig.status.pos_cmd[:6] == pytest.approx(THERE, abs=1e-6)
    finally:
        rig.server.signal(signal.SIGCONT)
    assert sent.result()[0] in (STATUS_SUCCEEDED, STATUS_ABORTED)

    # A restarted server stops the trajectory of the killed one.
    rig.send((30.0, FAR))
    rig.wait_moving(0.02)
    rig.server.signal(signal.SIGKILL)
    rig.server.wait()
    assert not rig.standing
    rig.launch()
    rig.wait_health("stopping a trajectory whose server has ended")
    rig.wait_health("")
    assert rig.standing
    assert abs(rig.status.pos_cmd[0]) < abs(FAR[0]) - 0.1, "it went on to its goal"
    assert rig.send((0.5, THERE)).result() == (STATUS_SUCCEEDED, 0, "")

    sent = rig.send((6.0, FAR))
    rig.wait_moving()
    rig.server.signal(signal.SIGINT)
    wait_for(lambda: rig.standing, "the arm to stand")
    assert abs(rig.status.pos_cmd[0]) < abs(FAR[0]) - 0.1, "it went on to its goal"
    assert sent.result()[:2] == (STATUS_ABORTED, Result.INVALID_GOAL)
    rig.server.wait()
    rig.launch()
    rig.wait_health("")
