"""The whole stack with a wheelchair in front of it, as tests dock, disturb and watch it."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

from rclpy.action import ActionClient

from custom_msgs.action import Dock, Undock
from custom_msgs.srv import InjectFault
from robot_stack.contract import actions, services, topics
from robot_stack.core.docks import load_docks
from robot_stack.core.geometry import Pose2
from sim.settings import pose_settings
from tests.support.peer import Peer
from tests.support.stack import FLAT, StackUnderTest, true_pose
from tests.support.waiting import wait_for

DOCK = "chair_1"
DOCKING_S = 150.0  # one try takes 20 s of simulated time; a slow machine makes three times as much of it


class Goal:
    """A goal of one of the docking actions. ``states``: of its feedback, in order."""

    def __init__(self, peer: Peer, client: ActionClient, goal: Any) -> None:
        self.states: list[str] = []
        self._peer = peer
        self.result: Any = None
        self._sent = peer.in_loop(lambda: client.send_goal_async(goal, feedback_callback=self._on_feedback))
        wait_for(self._sent.done, "an answer to the goal")
        self.handle = self._sent.result()
        assert self.handle.accepted
        peer.in_loop(lambda: self.handle.get_result_async().add_done_callback(self._on_result))

    def _on_feedback(self, message: Any) -> None:
        if not self.states or self.states[-1] != message.feedback.state:
            self.states.append(message.feedback.state)

    def _on_result(self, future: Any) -> None:
        self.result = future.result().result

    def cancel(self) -> None:
        self._peer.in_loop(self.handle.cancel_goal_async)
        self.wait()

    def wait(self, deadline_s: float = DOCKING_S) -> Any:
        wait_for(lambda: self.result is not None, f"the result; states so far {self.states}", deadline_s)
        return self.result


class DockingStackUnderTest(StackUnderTest):
    """The robot starts near the staging pose of the dock and believes to stand at it exactly."""

    def __init__(self, logs: Path, start: Pose2, *settings: str) -> None:
        self.dock = load_docks().docks[DOCK]
        staging = self.dock.staging.pose()
        chair = staging.compose(Pose2(1.5, 0.0, 0.0)).compose(self.dock.dock_pose.pose().inverse())
        place = staging.compose(start)
        super().__init__(
            logs,
            *FLAT,
            *pose_settings("sim_world.start", place),
            *pose_settings("sim_world.wheelchair", chair),
            *pose_settings("ndt_localization.start", staging),
            *settings,
        )
        self.status = self.peer.listen(topics.DOCKING_STATUS)
        self.docking_command = self.peer.listen(topics.DOCKING_CMD_VEL)
        self.passenger = self.peer.listen(topics.PASSENGER_ATTACHED)
        self.bodies = self.peer.listen(topics.SIM_BODIES)
        self._dock = ActionClient(self.peer.node, Dock, actions.DOCK.name)
        self._undock = ActionClient(self.peer.node, Undock, actions.UNDOCK.name)
        self._goal: Goal | None = None
        wait_for(lambda: self._dock.server_is_ready() and self._undock.server_is_ready(), "the docking actions")
        self.status.wait(lambda _: True, "a docking status")

    def begin_docking(self) -> Goal:
        return self._begin(self._dock, Dock.Goal(dock_id=DOCK))

    def begin_undocking(self) -> Goal:
        return self._begin(self._undock, Undock.Goal())

    def _begin(self, client: ActionClient, goal: Any) -> Goal:
        self._goal = Goal(self.peer, client, goal)
        return self._goal

    def be_docked(self) -> None:
        """As a story before it leaves it, or by a docking of its own."""
        if self.status.last.state != "DOCKED":
            assert self.begin_docking().wait(2.0 * DOCKING_S).success

    def be_free(self) -> None:
        if self.passenger.last.data:
            assert self.begin_undocking().wait().success

    def reach(self, state: str, deadline_s: float = DOCKING_S) -> None:
        self.status.wait(lambda message: message.state == state, f"docking state {state}", deadline_s)

    def reach_within(self, limit_s: float, state: str) -> None:
        """In the world's time."""
        self.wait_within(limit_s, lambda: self.status.last.state == state, f"docking state {state}")

    def replace_controller(self) -> None:
        """Kills the docking controller, and waits until DDS has noticed that it is gone and that another is there:
        what is sent to a dead one is lost.
        """
        dead = self._controllers()
        pid = self.kill("docking_controller")
        self.wait_restarted("docking_controller", pid)

        def replaced() -> bool:
            alive = self._controllers()
            return bool(alive) and not alive & dead and self._undock.server_is_ready()

        wait_for(replaced, "the killed docking controller to be forgotten", 40.0)

    def _controllers(self) -> set[bytes]:
        infos = self.peer.node.get_publishers_info_by_topic(topics.DOCKING_STATUS.name)
        return {bytes(info.endpoint_gid) for info in infos}

    def inject_camera(self, kind: str, target: str = "", value: float = 0.0, duration_s: float = 0.0) -> None:
        request = InjectFault.Request(kind=kind, target=target, value=value, duration_s=duration_s)
        answer = self.peer.call(services.INJECT_CAMERA_FAULT, request)
        assert answer.success, answer.message

    def make_ready(self) -> None:
        """A docking that a failed story has left behind is no part of the next one."""
        self.inject_camera("clear")
        if self._goal is not None and self._goal.result is None:
            self._goal.cancel()
        super().make_ready()

    def error(self) -> tuple[float, float]:
        """(m, rad) of base_link beside the dock pose of the true wheelchair."""
        robot, docked = true_pose(self.bodies.last, "base_link"), self.wheelchair().compose(self.dock.dock_pose.pose())
        off = robot.relative_to(docked)
        return math.hypot(off.x, off.y), abs(off.yaw)

    def wheelchair(self) -> Pose2:
        """Where it truly is."""
        return true_pose(self.bodies.last, "wheelchair")
